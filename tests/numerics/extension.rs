//! Statements lowered onto a system that stands give what the whole text gives.

use std::collections::HashMap;

use leverrier::internals::expr::{
    Bounds, Compiled, Expr, Place, Scope, Symbol, System, build, instances,
};
use leverrier::internals::spec::effects::catalogue;
use proptest::prelude::*;

/// A number between 0.2 and 1.2 that belongs to a text.
fn number_of(text: &str) -> f64 {
    let hash = text.bytes().fold(17_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3).rotate_left(23)
    });
    0.2 + (hash >> 11) as f64 / (1_u64 << 53) as f64
}

/// What a term is known by, wherever it stands in its system: factors of a product are printed in
/// the order in which they were met first.
fn known_by(system: &System, k: usize) -> String {
    let term = &system.terms[k];
    let label = if term.name.is_none() { &term.label } else { "" };
    format!("{:?} {label} {:?} {:?}", term.place, term.name, term.effect)
}

/// The value of an expression at a state, with coefficients by what their terms are known by.
fn value(system: &System, expr: Expr) -> f64 {
    let coefficients: Vec<f64> =
        (0..system.terms.len()).map(|k| number_of(&known_by(system, k))).collect();
    system.graph.value(expr, &|symbol| match symbol {
        Symbol::Coordinate(i) => number_of(&format!("q{i}")),
        Symbol::Momentum(i) => number_of(&format!("p{i}")),
        Symbol::Velocity(_) => f64::NAN,
        Symbol::Time => 0.7,
        Symbol::Delayed(i, order, _) => number_of(&format!("d{i}.{order}")),
        Symbol::Input(i, order) => number_of(&format!("u{i}.{order}")),
        Symbol::Parameter(j) => number_of(&system.parameters[j].name),
        Symbol::Coefficient(k) => coefficients[k],
    })
}

/// Everything that is said of a term, with values of its expressions.
fn said(system: &System) -> HashMap<String, (String, Vec<(Place, f64)>)> {
    let term = |k: usize| {
        let term = &system.terms[k];
        let values = term.parts().map(|(place, expr)| (place, value(system, expr))).collect();
        let mut letters: Vec<char> = term.label.chars().collect();
        letters.sort_unstable();
        let text = format!("{:?} {:?} {:?} {letters:?}", term.bounds, term.unit, term.unit_text);
        (known_by(system, k), (text, values))
    };
    (0..system.terms.len()).map(term).collect()
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * a.abs().max(b.abs()).max(1.0)
}

fn assert_same(extended: &System, whole: &System, what: &str) {
    assert_eq!(extended.terms.len(), whole.terms.len(), "{what}");
    assert_eq!(extended.parameters, whole.parameters, "{what}");
    let (ours, theirs) = (said(extended), said(whole));
    for (term, (text, values)) in &ours {
        let (other, others) =
            theirs.get(term).unwrap_or_else(|| panic!("{what}: {term} in {:?}", theirs.keys()));
        assert_eq!(text, other, "{what}: {term}");
        let same = values.iter().zip(others).all(|(a, b)| a.0 == b.0 && close(a.1, b.1));
        assert!(same && values.len() == others.len(), "{what}: {term}, {values:?} {others:?}");
    }
    let known = |system: &System| -> Vec<f64> {
        let energies = [system.kinetic, system.potential, system.hamiltonian].into_iter();
        let all = energies.chain(system.forces.clone()).chain(system.sensors.clone());
        all.map(|expr| value(system, expr)).collect()
    };
    for (a, b) in known(extended).into_iter().zip(known(whole)) {
        assert!(close(a, b), "{what}: a known part, {a} {b}");
    }
}

/// Lowers a statement both ways.
fn assert_one(text: &str, base: &Compiled, scope: &mut Scope, statement: &str) {
    let whole = build("whole", &format!("{text}\n{statement}\n")).map(|whole| whole.system);
    let extension = scope.extension(statement);
    let what = format!("{statement} on\n{text}");
    assert_eq!(whole.is_ok(), extension.is_ok(), "{what}: {whole:?} {extension:?}");
    let (Ok(whole), Ok(extension)) = (whole, extension) else { return };
    let extended = extension.onto(&base.system);
    assert_same(&extended, &whole, &what);
    for (k, term) in base.system.terms.iter().enumerate() {
        // A member of a family that the statement writes out is its own from then on.
        let same = &extended.terms[k];
        assert!(term.place == same.place || term.effect != same.effect, "{what}: places stay");
    }
    for (j, parameter) in base.system.parameters.iter().enumerate() {
        assert_eq!(parameter.name, extended.parameters[j].name, "{what}: those of parameters too");
    }
}

#[test]
fn additions_to_energies_of_velocities_are_transformed_again() {
    let text = "coordinates a, b
T = rate(a)^2 + rate(b)^2/2 + rate(a)*rate(b)*cos(a - b)
V = span{ cos(a), cos(b) }
force a += span{ upper: -rate(a), lower: rate(b) - rate(a) }
force b += span{ lower: rate(a) - rate(b) } - 0.1*rate(b)
sensor a += span{ -rate(a) }
";
    for statement in [
        "T += 0.3*rate(b)^2/2",
        "param m = 0.3; L += m*(rate(a)^2 + a*rate(b)) - m*a^2; L += span{ sin(b) }",
        "V += span{ a^2 }; force a += span{ rate(b) }",
        "H += 0.2*p_a^4",
        "T += span{ p_a^4 }",
        "effect viscous_drag(a)",
        "effect quadratic_drag(b)",
        "effect relative_damping(a, b)",
    ] {
        let base = build("base", text).expect("a sound spec");
        assert_one(text, &base, &mut Scope::of(&base), statement);
        let next = Scope::of(&base).with(statement);
        let whole = build("whole", &format!("{text}\n{statement}\n"));
        assert_eq!(next.is_ok(), whole.is_ok(), "{statement}");
        if let (Ok(next), Ok(whole)) = (next, whole) {
            assert_same(&next.compiled().system, &whole.system, statement);
        }
    }
}

const UNITS: [&str; 4] = [
    "coordinates q\nmomenta p\n",
    "coordinates q, r\nmomenta p, s\ntime t [s]\n",
    "coordinates q [m], r [m]\nmomenta p [kg*m/s], s [kg*m/s]\ntime t [s]\n",
    "coordinates q [rad]\nvelocities v [rad/s]\ntime t [s]\n",
];

const SPACES: [&str; 5] = [
    "V = span{ q^2 }\n",
    "V = span{ poly(q; 6), cos(q) }\nconstrain terms of V >= -3\n",
    "V = 1.5*q^2\nforce q += span{ drag: -{p} }\nconstrain drag >= 0\n",
    "H = span{ tensor(q, {p}; 3) }\nforce q += span{ {p}^3 }\n",
    "V = span{ q^2 }\nsensor q += span{ lag: -rate(q) }\n",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn every_effect_on_a_system_gives_what_the_whole_text_gives(
        units in 0..UNITS.len(),
        space in 0..SPACES.len(),
        standing in proptest::collection::vec(any::<prop::sample::Index>(), 0..3),
    ) {
        let momentum = if UNITS[units].contains("velocities") { "p_q" } else { "p" };
        let kinetic = if units == 2 { "T = {p}^2/(2 [kg])\n" } else { "T = {p}^2/2\n" };
        let kinetic = if units == 3 { "T = {p}^2/(2 [kg*m^2])\n" } else { kinetic };
        let mut text = format!("{}{kinetic}{}", UNITS[units], SPACES[space]).replace("{p}", momentum);
        let Ok(mut base) = build("base", &text) else { return Ok(()) };
        let mut scope = Scope::of(&base);
        let all = instances(&base.system);
        for index in standing {
            // What stands may have been added to the spec, or be a part of it.
            let statement = &index.get(&all).statement;
            if let Ok(next) = scope.with(statement) {
                text.push_str(&format!("{statement}\n"));
                base = next.compiled().clone();
                let whole = build("whole", &text);
                assert_same(&base.system, &whole.expect("a sound spec").system, &text);
                scope = if index.index(2) == 0 { next } else {
                    base = build("base", &text).expect("a sound spec");
                    Scope::of(&base)
                };
            }
        }
        let rows = catalogue().filter(|row| row.cannot(&base.system.scene()).is_none()).count();
        prop_assert!(rows > 10);
        for instance in instances(&base.system) {
            // What has states of its own needs a spec of its own.
            if instance.effect.has_states() {
                continue;
            }
            assert_one(&text, &base, &mut scope, &instance.statement);
        }
    }
}

#[test]
fn candidates_of_the_users_own_are_lowered_in_their_scope() {
    let text = "coordinates q\nmomenta p\nparam a = 1 in 0.5..2\nT = p^2/2\n\
        V = span{ k: q^2, q^4 }\nforce q += span{ -p }\n\
        candidates {\n\
        wall: V += span{ exp(a*q) }; constrain a <= 1.5\n\
        tied: force q += span{ k: -q^3 }\n\
        again: V += span{ 2*q^4 }\n\
        known: V += 0.3*q^6; force q += span{ -p^3, poly(p; 2) }\n\
        late: param b = 0.5; sensor q += span{ exp(-b*t), q }\n\
        }\n";
    let base = build("base", text).expect("a sound spec");
    let mut scope = Scope::of(&base);
    for name in ["wall", "tied", "again", "known", "late", "nothing"] {
        assert_one(text, &base, &mut scope, &format!("effect {name}"));
    }
    let wall = scope.with("effect wall").expect("a sound spec");
    assert_eq!(wall.compiled().starts, [[1.0]]);
    assert_eq!(wall.compiled().system.parameters[0].bounds.upper, 1.5);
    let error = scope.extension("force q += span{ -p }").expect_err("a duplicate");
    assert!(error.to_string().contains("duplicate term"), "{error}");
}

#[test]
fn rates_in_a_sensor_follow_what_is_added() {
    let text = "coordinates q\nmomenta p\nT = p^2/2\nV = q^2\nsensor p += span{ lag: -rate(p) }\n";
    let base = build("base", text).expect("a sound spec");
    let mut scope = Scope::of(&base);
    assert_one(text, &base, &mut scope, "effect viscous_drag(q)");
    let added = scope.extension("effect viscous_drag(q)").expect("an extension");
    assert_eq!(added.terms().map(|(id, _)| id.position()).collect::<Vec<_>>(), [0, 1]);
    // What was tried leaves nothing behind.
    let next = scope.with("effect cubic_drag(q)").expect("an extension");
    let text = format!("{text}effect cubic_drag(q)\n");
    assert_one(&text, next.compiled(), &mut next.clone(), "effect viscous_drag(q)");
}

#[test]
fn bounds_of_parameters_stay_beside_what_is_added_later() {
    let text = "coordinates q\nmomenta p\nT = p^2/2\nV = q^2/2\nparam k = 1 in 0.2..9\n\
                force q += span{ tanh(p/k) }\n";
    let base = build("base", text).expect("a spec without errors");
    let id = base.system.parameter_ids()[0];
    let inner = Bounds { lower: 0.5, upper: 20.0 };
    let scope = Scope::of(&base).bounded([(id, inner)]);
    let scope = scope.with("force q += span{ p^3 }").expect("a force");
    let bounds = scope.compiled().system.parameters[0].bounds;
    assert_eq!(bounds, Bounds { lower: 0.5, upper: 9.0 });
}
