//! Every rewrite holds numerically, by itself, wherever its condition says so.

use leverrier::internals::simplify::rules::{Condition, RULES, RuleKind, compiled};

/// Points of a low-discrepancy sequence in (-2, 2).
fn point(sample: usize, variable: usize) -> f64 {
    let step = [0.754_877_666_2, 0.569_840_290_9, 0.430_159_709][variable % 3];
    4.0 * ((sample + 1) as f64 * step + 0.137 * variable as f64).fract() - 2.0
}

#[test]
fn every_row_holds_inside_its_domain() {
    for rule in RULES {
        let names = rule.variables();
        let mut checked = 0;
        for sample in 0..200 {
            let value = |name: &str| {
                let i = names.iter().position(|other| other == name).unwrap();
                let x = point(sample, i);
                match rule.condition {
                    Condition::NonNegative(only) | Condition::Positive(only) if only == name => {
                        x.abs()
                    }
                    _ => x,
                }
            };
            let (left, right) = rule.values(&value);
            if !left.is_finite() || !right.is_finite() {
                continue;
            }
            checked += 1;
            let size = left.abs().max(right.abs()).max(1.0);
            assert!((left - right).abs() <= 1e-11 * size, "{}: {left} and {right}", rule.name);
        }
        assert!(checked > 50, "{}: only {checked} points were inside its domain", rule.name);
    }
}

#[test]
fn conditions_are_needed() {
    for rule in RULES {
        if matches!(rule.condition, Condition::Always | Condition::Number(_)) {
            continue;
        }
        let (left, right) = rule.values(&|_| -1.3);
        assert!(
            !left.is_finite() || (left - right).abs() > 0.1,
            "{} needs no condition: {left} and {right}",
            rule.name
        );
    }
}

#[test]
fn every_row_compiles_and_has_its_own_name() {
    let (ordered, all) = compiled();
    assert_eq!(all, RULES.len());
    assert_eq!(ordered, RULES.iter().filter(|rule| rule.kind != RuleKind::Reorder).count());
    for (i, rule) in RULES.iter().enumerate() {
        assert!(RULES[..i].iter().all(|other| other.name != rule.name), "{} twice", rule.name);
    }
}
