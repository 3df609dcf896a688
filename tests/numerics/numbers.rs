//! Known numbers of a spec: which there are, and what changing one of them does.

use leverrier::internals::expr::{KnownNumber, Scope, build};

fn scope(text: &str) -> Scope {
    Scope::of(&build("test", text).unwrap_or_else(|error| panic!("{error}\n{text}")))
}

fn labels(text: &str) -> Vec<String> {
    scope(text).numbers().iter().map(KnownNumber::label).collect()
}

fn number(scope: &Scope, label: &str) -> KnownNumber {
    let all = scope.numbers();
    let found = all.iter().find(|number| number.label() == label).cloned();
    found.unwrap_or_else(|| panic!("no {label} among {:?}", labels(&scope.compiled().text)))
}

const SPRING: &str = "coordinates x, y\nmomenta p, s\nconstant m = 0.8\nconstant k = 2*m\n\
                      T = p^2/(2*m) + s^2/2\nV = k*x^2/2 + 0.3*sqrt(x^2 + y^2)^3\n\
                      force y += -0.1*s + span{ exp(-0.5*y^2) }\n";

#[test]
fn numbers_are_found_where_they_stand() {
    let expected = [
        "m",
        "2 at 5:10",
        "2 at 5:21",
        "exponent 2 at 6:7",
        "2 at 6:11",
        "0.3 at 6:15",
        "exponent of sqrt at 6:19",
        "3 at 6:35",
        "0.1 at 7:13",
        "0.5 at 7:32",
        "exponent 2 at 7:36",
    ];
    assert_eq!(labels(SPRING), expected);
    // Indices, ranges and orders are no numbers of the law.
    let chain = "coordinates q[1..3]; momenta p[1..3]\nT = sum(p[i]^2/2 for i in 1..3)\n\
                 V = 4*(q[1] - q[2])^2 + span{ poly(q[3]; 4) }\n";
    assert_eq!(labels(chain), ["2 at 2:16", "4 at 3:5", "exponent 2 at 3:7"]);
}

#[test]
fn a_number_is_edited_in_its_place() {
    let scope = scope(SPRING);
    let edited = |label: &str, value: f64| number(&scope, label).edited(SPRING, value);
    let with = |from: &str, to: &str| SPRING.replacen(from, to, 1);
    assert_eq!(edited("m", 0.9), with("m = 0.8", "m = 0.9"));
    assert_eq!(edited("0.3 at 6:15", -0.25), with("0.3*", "(-0.25)*"));
    assert_eq!(
        edited("exponent of sqrt at 6:19", 0.485),
        with("sqrt(x^2 + y^2)", "((x^2 + y^2)^0.485)")
    );
    assert_eq!(edited("exponent 2 at 6:7", 1.97), with("k*x^2", "k*abs(x)^1.97"));
    assert_eq!(number(&scope, "m").rewritten(0.9, &[]), "constant m = 0.9");
    // Beside one that was freed before it, both are written with their values.
    let pull =
        self::scope("coordinates x, y; momenta p, s; T = (p^2 + s^2)/2\nV = -1/sqrt(x^2 + y^2)");
    let exponent = number(&pull, "exponent of sqrt at 2:8");
    let freed = pull.freed(&exponent, 0.5).unwrap_or_else(|error| panic!("{error}"));
    let strength = number(&freed, "1 at 2:6");
    assert_eq!(strength.rewritten(1.03, &[(&exponent, 0.485)]), "V = -1.03/(x^2 + y^2)^0.485");
    let metres = "coordinates x [m]\nmomenta p [kg*m/s]\ntime t [s]\nconstant m = 2 [kg]\n\
                  T = p^2/(2*m)\nV = 3 [N/m]*x^2\n";
    let scope = self::scope(metres);
    let edited = number(&scope, "3 at 6:5").edited(metres, 3.5);
    assert_eq!(edited, metres.replace("3 [N/m]", "3.5 [N/m]"));
    assert_eq!(number(&scope, "m").edited(metres, 2.5), metres.replace("2 [kg]", "2.5 [kg]"));
}

#[test]
fn a_freed_number_changes_the_system_as_an_edited_one_does() {
    let scope = scope(SPRING);
    let base = scope.compiled().system.clone();
    let state = |symbol| {
        use leverrier::internals::expr::Symbol;
        match symbol {
            Symbol::Coordinate(i) => [0.7, -0.4][i],
            Symbol::Momentum(i) => [0.3, 0.9][i],
            Symbol::Velocity(_) => f64::NAN,
            Symbol::Coefficient(_) => 1.3,
            Symbol::Time => 0.0,
            Symbol::Input(..) | Symbol::Delayed(..) => 0.4,
            Symbol::Parameter(_) => f64::NAN,
        }
    };
    for number in scope.numbers() {
        let value = 1.1 * number.value;
        let edited = build("test", &number.edited(SPRING, value)).expect("a sound spec").system;
        let (extension, probe) = scope.extension_of(&number).expect("it moves something");
        let free = extension.onto(&base);
        let at = |value: f64| {
            move |symbol| match symbol {
                leverrier::internals::expr::Symbol::Parameter(0) => value,
                other => state(other),
            }
        };
        let label = number.label();
        assert_eq!(free.parameters.len(), 1, "{label}");
        assert_eq!(free.parameters[0].start, number.value, "{label}");
        // The terms are those that they were, whatever number is in them.
        assert_eq!(free.term_ids(), base.term_ids(), "{label}");
        let known = |system: &leverrier::internals::expr::System| {
            [system.kinetic, system.potential, system.forces[1], system.terms[0].expr]
        };
        for (free_part, edited_part) in known(&free).into_iter().zip(known(&edited)) {
            let found = free.graph.value(free_part, &at(value));
            let expected = edited.graph.value(edited_part, &state);
            assert!((found - expected).abs() < 1e-12, "{label}: {found}, not {expected}");
        }
        // To first order, the probe is what a small change does.
        let mut graph = base.graph.clone();
        let symbols = std::collections::HashMap::new();
        let local = extension.import(&probe, &mut graph, &symbols);
        let slope: f64 = local.parts().map(|(_, expr)| graph.value(expr, &at(number.value))).sum();
        let sum = |value: f64| -> f64 {
            let [t, v, f, term] = known(&free).map(|part| free.graph.value(part, &at(value)));
            t + v + f + 1.3 * term
        };
        let step = 1e-5 * number.value;
        let expected = (sum(number.value + step) - sum(number.value - step)) / (2.0 * step);
        assert!((slope - expected).abs() < 1e-6 * (1.0 + expected.abs()), "{label}");
    }
}

#[test]
fn a_number_in_a_scope_is_another_or_an_inner_parameter() {
    let scope = scope(SPRING);
    let mass = number(&scope, "m");
    let heavier = scope.with_number(&mass, 1.6).expect("a sound spec");
    let expected = build("test", &SPRING.replace("m = 0.8", "m = 1.6")).expect("a sound spec");
    let text = |system: &leverrier::internals::expr::System| {
        let names = system.names();
        [system.kinetic, system.potential].map(|expr| system.graph.text(expr, &names))
    };
    assert_eq!(text(&heavier.compiled().system), text(&expected.system));
    let free = scope.freed(&mass, 0.9).expect("a sound spec");
    // The constant that is made of it goes with it.
    let system = &free.compiled().system;
    assert_eq!(text(system)[1].matches('m').count(), 1);
    assert_eq!((system.parameters[0].name.as_str(), system.parameters[0].start), ("m", 0.9));
    // Others keep their places: they can be freed beside it, and statements added.
    let both = free.freed(&number(&scope, "0.1 at 7:13"), 0.1).expect("a sound spec");
    assert_eq!(both.compiled().system.parameters.len(), 2);
    let more = both.with("effect viscous_drag(x)").expect("a sound spec");
    assert_eq!(more.compiled().system.terms.len(), 2);
    assert!(!more.numbers().iter().any(|number| number.label() == "m"));
}

#[test]
fn exponents_of_lengths_can_be_learned_where_there_are_units() {
    let text = "coordinates x [m], y [m]\nmomenta p [kg*m/s], s [kg*m/s]\ntime t [s]\n\
                T = (p^2 + s^2)/(2*1 [kg])\nV = -2 [kg*m^3/s^2]/sqrt(x^2 + y^2)\n";
    let scope = scope(text);
    let root = number(&scope, "exponent of sqrt at 5:21");
    assert!(scope.extension_of(&root).is_ok());
}
