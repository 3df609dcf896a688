//! What a spec means: values of its expressions against closed forms, bounds, columns.

use std::collections::HashMap;

use leverrier::internals::expr::{Bounds, Compiled, Observed, Place, Symbol, build};

fn compiled(text: &str) -> Compiled {
    build("test", text).unwrap_or_else(|e| panic!("{e}"))
}

fn state(q: &[f64], p: &[f64], t: f64) -> HashMap<Symbol, f64> {
    let q = q.iter().enumerate().map(|(i, &x)| (Symbol::Coordinate(i), x));
    let p = p.iter().enumerate().map(|(i, &x)| (Symbol::Momentum(i), x));
    q.chain(p).chain([(Symbol::Time, t)]).collect()
}

#[test]
fn known_parts_have_the_values_of_their_formulas() {
    let compiled = compiled(
        "constant n = 3; constant k = 2*pi
         coordinates q[0..n]; momenta p[0..n]
         T = sum(p[i]^2/2 for i in 0..n)
         V = k*sum((q[i+1] - q[i])^2 for i in 0..n-1) - -q[0]^2^0.5/3 + 2^-q[1]*sqrt(abs(q[2]))
         H = -p[0]^2*q[1] - (1 - q[0])/(2 + q[3])*cos(t)
         force q[i] += i*p[i]*sign(p[i]) for i in 1..2
         force q[1] += 1",
    );
    let (q, p, t) = ([0.3_f64, -0.7, 1.1, 0.4], [0.2_f64, -0.5, 0.9, 1.3], 0.6_f64);
    let values = state(&q, &p, t);
    let system = &compiled.system;
    let value = |expr| system.graph.value(expr, &|s| values.get(&s).copied().unwrap_or(f64::NAN));
    let kinetic: f64 = p.iter().map(|p| p * p / 2.0).sum();
    let springs: f64 = q.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
    let potential = std::f64::consts::TAU * springs
        + q[0].powf(2.0_f64.sqrt()) / 3.0
        + 2.0_f64.powf(-q[1]) * q[2].abs().sqrt();
    let mixed = -p[0] * p[0] * q[1] - (1.0 - q[0]) / (2.0 + q[3]) * t.cos();
    let forces = [0.0, p[1].abs() + 1.0, 2.0 * p[2].abs(), 0.0];
    approx::assert_relative_eq!(value(system.kinetic), kinetic, max_relative = 1e-14);
    approx::assert_relative_eq!(value(system.potential), potential, max_relative = 1e-14);
    approx::assert_relative_eq!(value(system.hamiltonian), mixed, max_relative = 1e-14);
    for (&force, expected) in system.forces.iter().zip(forces) {
        approx::assert_relative_eq!(value(force), expected, max_relative = 1e-14);
    }
}

#[test]
fn terms_stand_in_their_places_with_names_bounds_and_signs() {
    let compiled = compiled(
        "coordinates x, y; momenta p, r; param a = 1, 2 in 0.5..; param b = -3
         T = p^2/2 - span{ c: r^2 }
         V = span{ k: x^i*y^j for i in 1..2, j in 1..2 where i + j < 4 }
         force y += -span{ d: r }
         constrain k >= 0; constrain -1 < c < 0; constrain 0 >= b",
    );
    let terms = &compiled.system.terms;
    let found: Vec<(Place, &str, Option<&str>, Bounds)> =
        terms.iter().map(|t| (t.place, t.label.as_str(), t.name.as_deref(), t.bounds)).collect();
    let positive = Bounds { lower: 0.0, upper: f64::INFINITY };
    let expected = [
        (Place::Kinetic, "-r^2", Some("c"), Bounds { lower: -1.0, upper: 0.0 }),
        (Place::Potential, "x*y", Some("k[1,1]"), positive),
        (Place::Potential, "x*y^2", Some("k[1,2]"), positive),
        (Place::Potential, "x^2*y", Some("k[2,1]"), positive),
        (Place::Force(1), "-r", Some("d"), Bounds::FREE),
    ];
    assert_eq!(found, expected);
    assert_eq!(compiled.starts, [vec![1.0, 2.0], vec![-3.0]]);
    assert_eq!(compiled.system.parameters[0].bounds.lower, 0.5);
    assert_eq!(compiled.system.parameters[1].bounds.upper, 0.0);
}

#[test]
fn columns_are_found_and_converted() {
    let compiled = compiled(
        "coordinates theta [rad], q[1..2] [m]; velocities omega [rad/s], v[1..2]
         time t [s]
         data \"runs.csv\" { time stamp [ms]  run trial  theta = angle [deg]  q[2] = \"second mass\" [cm] pairs }
         T = p_theta^2/2; V = span{ cos(theta), poly(q; 2) }",
    );
    assert_eq!(compiled.system.observed, Observed::Velocities);
    let data = compiled.data.into_iter().next().unwrap_or_else(|| panic!("a data statement"));
    assert_eq!(
        (data.file.as_str(), data.run.as_deref(), data.pairs),
        ("runs.csv", Some("trial"), true)
    );
    let time = data.time.unwrap_or_else(|| panic!("a time column"));
    assert_eq!(time.column, "stamp");
    approx::assert_relative_eq!(time.scale, 1e-3);
    let columns: Vec<(&str, Vec<&str>)> = data
        .observables
        .iter()
        .map(|o| (o.name.as_str(), o.candidates.iter().map(String::as_str).collect()))
        .collect();
    assert_eq!(columns[0], ("theta", vec!["angle"]));
    assert_eq!(columns[1], ("q[1]", vec!["q[1]", "q1", "q_1"]));
    assert_eq!(columns[2], ("q[2]", vec!["second mass"]));
    assert_eq!(columns[3].0, "omega");
    approx::assert_relative_eq!(data.observables[0].scale, std::f64::consts::PI / 180.0);
    approx::assert_relative_eq!(data.observables[2].scale, 0.01);
}

#[test]
fn momenta_and_velocities_together() {
    let compiled = compiled(
        "coordinates x [m]; momenta p [kg*m/s]; velocities v [m/s]; time t [s]
         T = span{ p^2 }; V = span{ x^2 }",
    );
    assert_eq!(compiled.system.observables(), ["x", "v"]);
    assert_eq!(compiled.system.names().momenta, ["p"]);
    assert_eq!(compiled.system.terms[0].unit_text.as_deref(), Some("1/kg"));
    assert_eq!(compiled.system.terms[1].unit_text.as_deref(), Some("kg/s^2"));
}

#[test]
fn the_known_energy_tells_the_unit_of_implied_momenta() {
    let compiled = compiled(
        "coordinates x [m]; velocities v [m/s]; time t [s]
         constant k = 3 [N/m]
         T = span{ p_x^2 }; V = k*x^2/2",
    );
    let expected = leverrier::internals::expr::Unit::parse("kg m/s");
    let unit = compiled.system.momenta[0].unit;
    assert!(unit.zip(expected.ok()).is_some_and(|(a, b)| a.agrees(b)), "{unit:?}");
    assert_eq!(compiled.system.terms[0].unit_text.as_deref(), Some("1/kg"));
}
