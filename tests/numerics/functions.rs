//! Every row of the table of functions says what is true, in all that it says.

use std::collections::HashSet;
use std::f64::consts::PI;

use leverrier::internals::eval::{Backend, Inputs, InstructionSet, apply, compile};
use leverrier::internals::expr::{
    Domain, FUNCTIONS, Function, FunctionRow, Graph, Latex, SignRule, Symbol, UnitRule, build,
};
use leverrier::internals::spec::families::FAMILIES;

/// Points inside the domain, spread evenly.
fn samples(row: &FunctionRow) -> impl Iterator<Item = f64> {
    let (low, high) = row.domain.sample_interval();
    (0..57).map(move |i| low + (high - low) * (f64::from(i) + 0.31) / 57.0)
}

#[test]
fn every_row_is_filled_in_and_every_name_is_its_own() {
    let mut names: HashSet<&str> = FAMILIES.iter().map(|row| row.name).collect();
    names.extend(["pi", "rate", "sum", "span"]);
    for (function, row) in Function::all().zip(FUNCTIONS) {
        for text in [row.name, row.rust.name, row.c.name, row.sympy] {
            assert!(!text.is_empty(), "{}: a name is missing", row.name);
        }
        assert!(row.latex != Latex::Command("") && row.cost > 0, "{}", row.name);
        for name in row.aliases.iter().copied().chain([row.name]) {
            assert!(names.insert(name), "{name} means two things");
            assert_eq!(Function::by_any_name(name), Some(function), "{name}");
        }
        assert_eq!(Function::by_name(row.name), Some(function));
        for target in [row.rust, row.c] {
            if let Some(definition) = target.definition {
                assert!(definition.contains(&format!("{}(", target.name)), "{}", row.name);
                assert!(definition.ends_with("}\n"), "{}", row.name);
            }
        }
    }
}

#[test]
fn domains_are_where_there_are_values() {
    for row in FUNCTIONS {
        for x in samples(row) {
            assert!((row.value)(x).is_finite(), "{}({x})", row.name);
        }
        let outside: &[f64] = match row.domain {
            Domain::Real => &[],
            Domain::Positive => &[0.0, -0.1, -3.0],
            Domain::NonNegative => &[-0.1, -3.0],
            Domain::UnitInterval => &[1.01, -1.01, 40.0],
        };
        for &x in outside {
            assert!(!(row.value)(x).is_finite(), "{}({x})", row.name);
        }
    }
}

#[test]
fn half_turns_and_exact_values_are_true() {
    for row in FUNCTIONS {
        let turned = |factor: f64| {
            samples(row).all(|x| {
                let (here, there) = ((row.value)(x), (row.value)(x + PI));
                (there - factor * here).abs() < 1e-12 * (1.0 + here.abs())
            })
        };
        match row.half_turn {
            Some(factor) => assert!(turned(factor), "{}", row.name),
            // A sign that is the same at all samples is no period.
            None => assert!(!(turned(1.0) || turned(-1.0)), "{} has a period", row.name),
        }
        for &(argument, value) in row.exact {
            assert_eq!((row.value)(argument as f64), value as f64, "{}({argument})", row.name);
        }
    }
}

#[test]
fn signs_are_those_of_the_values() {
    for row in FUNCTIONS {
        for x in samples(row) {
            let value = (row.value)(x);
            let holds = match row.sign {
                SignRule::Unknown => true,
                SignRule::Positive => value > 0.0,
                SignRule::NonNegative => value > 0.0 || value == 0.0 && x <= 0.0,
                SignRule::OfArgument => (value > 0.0) == (x > 0.0) && (value < 0.0) == (x < 0.0),
            };
            assert!(holds, "{}({x}) = {value}", row.name);
        }
        let (low, _) = row.domain.sample_interval();
        if row.odd && row.sign == SignRule::OfArgument {
            assert!(low < 0.0 && (row.value)(0.0) == 0.0, "{}", row.name);
        }
    }
}

#[test]
fn units_follow_their_rules() {
    for row in FUNCTIONS {
        let (low, high) = row.domain.sample_interval();
        let x = 0.3 * low + 0.7 * high;
        let holds = |argument: &str, value: &str| {
            let text = format!(
                "coordinates q\nmomenta p\nconstant a = {}({x}{argument}) + 3{value}\n\
                 T = p^2/2\nV = a*q^2",
                row.name
            );
            build("units", &text).is_ok()
        };
        let kept = match row.unit {
            UnitRule::Number => None,
            UnitRule::Kept => Some(" [m]".to_string()),
            UnitRule::Dropped => Some(String::new()),
            UnitRule::Power(over, under) => Some(format!(" [m^({over}/{under})]")),
        };
        assert!(holds("", ""), "{} of a number", row.name);
        match kept {
            None => assert!(!holds(" [m]", "") && !holds(" [m]", " [m]"), "{}", row.name),
            Some(unit) => {
                assert!(holds(" [m]", &unit), "{} of a length has no {unit}", row.name);
                assert!(!holds(" [m]", " [kg]"), "{} of a length has any unit", row.name);
            }
        }
    }
}

#[test]
fn other_names_are_the_same_function() {
    let label = |name: &str| {
        let text = format!("coordinates q\nmomenta p\nT = p^2/2\nV = span{{ {name}(q) }}");
        let compiled = build("names", &text).unwrap_or_else(|e| panic!("{e}"));
        compiled.system.terms[0].label.clone()
    };
    for row in FUNCTIONS {
        for alias in row.aliases {
            assert_eq!(label(alias), label(row.name));
        }
    }
}

/// The vectorised code and that of the machine agree to the last bit with each other, and with
/// the row's value to rounding.
#[test]
fn compiled_functions_are_the_functions_of_the_rows() {
    let symbol = Symbol::Coordinate(0);
    let inputs = Inputs { varying: vec![symbol], uniform: Vec::new() };
    for (function, row) in Function::all().zip(FUNCTIONS) {
        let mut graph = Graph::new();
        let x = graph.symbol(symbol);
        let value = graph.apply(function, x);
        let derivative = graph.derivative(value, symbol);
        let outputs = [value, derivative];
        let points: Vec<f64> = samples(row).collect();
        let run = |backend: Backend, lanes: usize| {
            let mut out = vec![0.0; 2 * lanes];
            let compiled = compile(&graph, &inputs, &outputs, backend);
            compiled.evaluate(&points[..lanes], &[], lanes, &mut out, &mut Vec::new());
            out
        };
        for lanes in [1, 8, 57] {
            let (batched, machine) = (run(Backend::Batched, lanes), run(Backend::Machine, lanes));
            assert_eq!(batched, machine, "{} at {lanes} points", row.name);
            for (a, b) in batched.iter().zip(run(Backend::Reference, lanes)) {
                assert!((a - b).abs() <= 1e-13 * (1.0 + b.abs()), "{}: {a} {b}", row.name);
            }
        }
        let mut alone = vec![0.0; points.len()];
        apply(InstructionSet::widest(), function, &points, &mut alone);
        assert_eq!(alone, run(Backend::Batched, 57)[..57], "{}", row.name);
    }
}
