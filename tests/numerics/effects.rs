//! The catalogue: every row on systems where it applies, against closed forms.

use std::collections::HashMap;

use leverrier::internals::expr::{Compiled, Delay, Place, Symbol, System, build, instances};
use leverrier::internals::spec::effects::{self, ActsOn, EffectKind, EffectRow, ScanBy, catalogue};
use leverrier::internals::spec::spec;

/// x, y, p_x, p_y, t, then inner parameters in the order of the row.
type Closed = fn(&[f64; 5], &[f64]) -> f64;

/// What the terms of a row are at a place, each with coefficient 1, added up.
enum At {
    /// Energy.
    H(Closed),
    /// Force on x, and on y.
    F(Closed, Closed),
    /// What the sensor of x adds.
    S(Closed),
}

/// Energy of two unit dipoles that point along an axis, `across` and `along` it from each other.
fn dipoles(across: f64, along: f64) -> f64 {
    let cosine = along / across.hypot(along);
    (1.0 - 3.0 * cosine * cosine) / across.hypot(along).powi(3)
}

/// A force whose parts along the line to the origin and across it go with the distance and with
/// those parts of the momentum, in x and y.
fn polar(z: &[f64; 5], parts: fn(f64, f64, f64) -> [f64; 2]) -> [f64; 2] {
    let (sine, cosine) = z[1].atan2(z[0]).sin_cos();
    let (along, across) = (cosine * z[2] + sine * z[3], cosine * z[3] - sine * z[2]);
    let [radial, turning] = parts(z[0].hypot(z[1]), along, across);
    [cosine * radial - sine * turning, sine * radial + cosine * turning]
}

/// What the input is, and its rate before.
const INPUT: f64 = 1.8;
const RATE: f64 = 0.5;

const NONE: Closed = |_, _| 0.0;

/// Written by hand from textbooks, not from the templates.
fn closed_form(name: &str) -> Option<At> {
    use At::{F, H, S};
    Some(match name {
        "viscous_drag" => F(|z, _| -z[2], NONE),
        "quadratic_drag" => F(|z, _| -z[2].signum() * z[2].powi(2), NONE),
        "cubic_drag" => F(|z, _| -z[2].powi(3), NONE),
        "power_drag" => {
            F(|z, a| -z[2] * (1.0 + z[2] * z[2] / (a[0] * a[0])).powf(0.5 * a[1] - 0.5), NONE)
        }
        "coulomb_friction" => F(|z, _| if z[2] > 0.0 { -1.0 } else { 1.0 }, NONE),
        "stribeck_friction" => F(|z, a| -z[2].signum() / (z[2] * z[2] / (a[0] * a[0])).exp(), NONE),
        "relative_damping" => F(|z, _| z[3] - z[2], |z, _| z[2] - z[3]),
        "asymmetric_friction" => F(|z, _| if z[2] > 0.0 { -1.0 } else { 1.0 }, NONE),
        "asymmetric_drag" => F(|z, _| -z[2], NONE),
        "self_excitation" => F(|z, _| z[2], NONE),
        "negative_damping" => F(|z, _| (1.0 - z[0] * z[0]) * z[2], NONE),
        "constant_force" => H(|z, _| -z[0]),
        "tilt" => H(|z, _| z[0].sin()),
        "linear_spring" => H(|z, _| 0.5 * z[0].powi(2)),
        "quadratic_stiffness" => H(|z, _| z[0].powi(3) / 3.0),
        "cubic_stiffness" => H(|z, _| z[0].powi(4) / 4.0),
        "quintic_stiffness" => H(|z, _| z[0].powi(6) / 6.0),
        "double_well" => H(|z, _| 0.25 * (z[0] * z[0] - 1.0).powi(2) - 0.25),
        "pendulum" => H(|z, _| 2.0 * (0.5 * z[0]).sin().powi(2) - 1.0),
        "periodic_substrate" => {
            H(|z, a| 2.0_f64.sqrt() * (a[0] * z[0] - std::f64::consts::FRAC_PI_4).cos())
        }
        "coupling_spring" => H(|z, _| 0.5 * (z[0] - z[1]).powi(2)),
        "quadratic_coupling" => H(|z, _| (z[1] - z[0]).powi(3) / 3.0),
        "cubic_coupling" => H(|z, _| 0.25 * (z[0] - z[1]).powi(4)),
        "bilinear_coupling" => H(|z, _| 0.25 * ((z[0] + z[1]).powi(2) - (z[0] - z[1]).powi(2))),
        "quadratic_cross_coupling" => H(|z, _| z[0] * z[1] * z[0]),
        "cubic_cross_coupling" => H(|z, _| z[1] * z[0].powi(3)),
        "quartic_cross_coupling" => H(|z, _| 0.5 * (z[0] * z[1]).powi(2)),
        "tidal_force" => H(|z, _| 0.5 * z[1].powi(2) - z[0].powi(2)),
        "lift_force" => F(|z, _| z[2].hypot(z[3]) * z[3], |z, _| -z[2].hypot(z[3]) * z[2]),
        "drag_along_velocity" => {
            F(|z, _| -z[2] * z[2].hypot(z[3]), |z, _| -z[3] * z[2].hypot(z[3]))
        }
        "cubic_drag_along_velocity" => {
            F(|z, _| -z[2] * z[2].hypot(z[3]).powi(2), |z, _| -z[3] * z[2].hypot(z[3]).powi(2))
        }
        "friction_along_velocity" => {
            F(|z, _| -z[3].atan2(z[2]).cos(), |z, _| -z[3].atan2(z[2]).sin())
        }
        "central_linear" => H(|z, _| z[0].hypot(z[1])),
        "central_quartic" => H(|z, _| z[0].hypot(z[1]).powi(4) / 4.0),
        "central_sextic" => H(|z, _| z[0].hypot(z[1]).powi(6) / 6.0),
        "central_logarithm" => H(|z, _| z[0].hypot(z[1]).ln()),
        "central_power" => H(|z, a| z[0].hypot(z[1]).powf(a[0]) / a[0]),
        "central_yukawa" => H(|z, a| -1.0 / (z[0].hypot(z[1]) * (z[0].hypot(z[1]) / a[0]).exp())),
        "screening_of_centre" => H(|z, a| -(-z[0].hypot(z[1]) / a[0]).exp_m1() / z[0].hypot(z[1])),
        "central_inverse" => H(|z, _| -1.0 / z[0].hypot(z[1])),
        "central_inverse_square" => H(|z, _| -z[0].hypot(z[1]).powi(-2)),
        "softened_centre" => H(|z, a| -1.0 / z[0].hypot(z[1]).hypot(a[0])),
        "contact_above" => H(|z, a| if z[0] > a[0] { 0.5 * (z[0] - a[0]).powi(2) } else { 0.0 }),
        "contact_below" => H(|z, a| if z[0] < a[0] { 0.5 * (z[0] - a[0]).powi(2) } else { 0.0 }),
        "hertz_contact_above" => H(|z, a| 0.4 * (z[0] - a[0]).max(0.0).powf(2.5)),
        "hertz_contact_below" => H(|z, a| 0.4 * (a[0] - z[0]).max(0.0).powf(2.5)),
        "play" => H(|z, a| 0.5 * (z[0].abs() - a[0]).max(0.0).powi(2)),
        // Two dipoles along an axis, at a distance R that makes an angle with it.
        "magnet_below" => H(|z, a| dipoles(z[0].abs(), a[0])),
        "central_magnet" => H(|z, a| dipoles(z[0].hypot(z[1]), a[0])),
        "image_charge" => H(|z, a| -0.25 / (a[0] - z[0]).abs()),
        "central_inverse_cube" => H(|z, _| -z[0].hypot(z[1]).powi(-3)),
        "poynting_robertson_drag" => F(
            |z, _| polar(z, |r, along, across| [-2.0 * along / (r * r), -across / (r * r)])[0],
            |z, _| polar(z, |r, along, across| [-2.0 * along / (r * r), -across / (r * r)])[1],
        ),
        "radiation_damping" => F(
            |z, _| polar(z, |r, along, across| [2.0 * along / r.powi(3), -across / r.powi(3)])[0],
            |z, _| polar(z, |r, along, across| [2.0 * along / r.powi(3), -across / r.powi(3)])[1],
        ),
        "position_dependent_mass" => H(|z, _| 0.5 * (z[0] * z[2]).powi(2)),
        "coupled_momenta" => H(|z, _| z[2] * z[3]),
        "relativistic_kinetic" => H(|z, _| -0.125 * z[2].powi(4)),
        "inertial_coupling" => H(|z, _| -(z[1] - z[0]).cos() * z[2] * z[3]),
        "magnetic_force" => F(|z, _| z[3], |z, _| -z[2]),
        "magnetic_gradient" => F(|z, _| z[0] * z[3], |z, _| -z[0] * z[2]),
        // Minus the angular momentum.
        "rotating_frame" => H(|z, _| -(z[0] * z[3] - z[1] * z[2])),
        "centrifugal_force" => H(|z, _| -0.5 * z[0].hypot(z[1]).powi(2)),
        "harmonic_drive" | "second_drive" => {
            F(|z, a| 2.0_f64.sqrt() * (a[0] * z[4] + std::f64::consts::FRAC_PI_4).sin(), NONE)
        }
        "parametric_drive" => F(
            |z, a| -z[0] * 2.0_f64.sqrt() * (a[0] * z[4] + std::f64::consts::FRAC_PI_4).sin(),
            NONE,
        ),
        "stiffness_drift" => F(|z, _| -z[0] * z[4], NONE),
        "drag_drift" => F(|z, _| -z[2] * z[4], NONE),
        "force_drift" => F(|z, _| z[4], NONE),
        // The logistic function.
        "step_force" => F(|z, a| 1.0 / (1.0 + (-2.0 * (z[4] - a[0]) / a[1]).exp()), NONE),
        "decaying_force" => F(|z, a| 1.0 / (a[0] * z[4]).exp(), NONE),
        "input_gain" => F(|_, _| INPUT, NONE),
        "input_asymmetry" => F(|_, _| INPUT, NONE),
        "input_dead_zone" => F(|_, a| -INPUT.min(a[0]), NONE),
        "input_saturation" => F(|_, a| -(INPUT - a[0]).max(0.0), NONE),
        "input_delay" => F(|_, a| -RATE * a[0], NONE),
        "sensor_offset" => S(|_, _| 1.0),
        "sensor_scale" => S(|z, _| z[0]),
        "sensor_drift" => S(|z, _| z[4]),
        "sensor_cross_talk" => S(|z, _| z[1]),
        "sensor_nonlinearity" => S(|z, _| z[0].powi(2)),
        "sensor_hum" | "second_hum" => {
            S(|z, a| 2.0_f64.sqrt() * (a[0] * z[4] + std::f64::consts::FRAC_PI_4).sin())
        }
        // T = p^2 / 2, so the rate of x is its momentum.
        "clock_shift" => S(|z, _| z[2]),
        _ => return None,
    })
}

const PLANE: &str = "coordinates x, y\nmomenta p_x, p_y\nT = (p_x^2 + p_y^2)/2\n";

fn compiled(text: &str) -> Compiled {
    build("test", text).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// Unknown terms of one place with coefficient 1.
fn total(compiled: &Compiled, wanted: impl Fn(Place) -> bool, z: &[f64; 5], a: &[f64]) -> f64 {
    let system = &compiled.system;
    let of = |symbol| match symbol {
        Symbol::Coordinate(i) => z[i],
        Symbol::Momentum(i) => z[2 + i],
        Symbol::Velocity(_) => f64::NAN,
        Symbol::Time => z[4],
        Symbol::Input(_, order) => [INPUT, RATE][order],
        Symbol::Delayed(_, 0, Delay::Parameter(j)) => INPUT - RATE * a[j],
        Symbol::Delayed(..) => f64::NAN,
        Symbol::Parameter(i) => a[i],
        // The effect under test is no part of what moves here.
        Symbol::Coefficient(_) => 0.0,
    };
    let parts = system.terms.iter().flat_map(|term| term.parts());
    parts.filter(|part| wanted(part.0)).map(|(_, expr)| system.graph.value(expr, &of)).sum()
}

const STATES: [[f64; 5]; 6] = [
    [0.7, -0.4, 0.3, 0.9, 0.2],
    [-0.8, 0.6, -0.5, 0.2, 1.7],
    [1.3, 1.1, 0.8, -1.2, 3.1],
    [-1.4, -0.2, -1.1, -0.6, 5.3],
    [0.1, 0.9, 1.6, 0.4, 7.9],
    [0.55, -1.3, -0.2, 1.4, 5.02],
];

#[test]
fn every_row_is_what_its_closed_form_says() {
    // Effects between two bodies have a test of their own: a plane holds one.
    let here = |row: &&EffectRow| row.detector.is_none() && row.on != ActsOn::BodyPair;
    for row in catalogue().filter(here).filter(|row| !row.has_states()) {
        let form = closed_form(row.name).unwrap_or_else(|| panic!("no closed form: {}", row.name));
        let arguments: Vec<String> = match row.on {
            ActsOn::Driven => ["x", "u"].iter().take(2),
            _ => ["x", "y"].iter().take(row.on.least()),
        }
        .map(|name| name.to_string())
        .collect();
        let values: Vec<f64> = row.parameters.iter().map(|scan| scan.example * 1.07).collect();
        let statement = row.statement(&arguments, &values);
        let compiled = compiled(&format!("{PLANE}input u {{ linear }}\n{statement}\n"));
        assert!(!compiled.system.terms.is_empty(), "{}", row.name);
        let a: Vec<f64> = compiled.system.parameters.iter().map(|p| p.start).collect();
        assert_eq!(a, values, "{}", row.name);
        for term in &compiled.system.terms {
            assert_eq!(term.effect.as_deref(), Some(row.label(&arguments).as_str()));
            let name = term.name.as_deref().unwrap_or_default();
            assert!(name.starts_with(&row.term_name(&arguments)), "{name}");
        }
        let none: Closed = NONE;
        let (h, fx, fy, s) = match form {
            At::H(h) => (h, none, none, none),
            At::F(x, y) => (none, x, y, none),
            At::S(s) => (none, none, none, s),
        };
        for z in &STATES {
            for (what, wanted, expected) in [
                ("H", (|p: Place| p.is_energy()) as fn(Place) -> bool, h),
                ("force x", |p| p == Place::Force(0), fx),
                ("force y", |p| p == Place::Force(1), fy),
                ("sensor x", |p| p == Place::Sensor(0), s),
                ("other sensors", |p| p.is_sensor() && p != Place::Sensor(0), none),
            ] {
                let (found, expected) = (total(&compiled, wanted, z, &a), expected(z, &a));
                assert!(
                    (found - expected).abs() < 1e-12 * (1.0 + expected.abs()),
                    "{} {what} at {z:?}: {found}, not {expected}",
                    row.name
                );
            }
        }
    }
}

#[test]
fn every_instance_parses_lowers_and_prints_back() {
    let systems = [
        format!("{PLANE}V = x^2 + y^2\n"),
        "coordinates theta; momenta omega; T = omega^2/2; V = theta^2\n".to_string(),
        "coordinates q[0..2]; velocities v[0..2]; T = sum(p_q[i]^2/2 for i in 0..2)
         V = sum(q[i]^2/2 for i in 0..2)\n"
            .to_string(),
        "coordinates x [m], a [rad]; momenta p_x [kg*m/s], p_a [kg*m^2/s]; time clock [s]
         constant m = 2 [kg]; constant j = 3 [kg*m^2]; T = p_x^2/(2*m) + p_a^2/(2*j)
         V = 3 [N/m]*x^2 + 2 [J]*a^2\n"
            .to_string(),
        "coordinates x [m]; momenta p [kg*m/s]; time t [s]; input u [V] { spline }
         T = span{ p^2 }; V = 3 [N/m]*x^2; force x += 2 [N/V]*u\n"
            .to_string(),
    ];
    for text in systems {
        let base = compiled(&text);
        let mut kinds = HashMap::new();
        for instance in instances(&base.system) {
            let statement = &instance.statement;
            let whole = format!("{text}{statement}\n");
            let (tree, diagnostics) = spec(&whole);
            assert!(diagnostics.is_empty(), "{statement}: {diagnostics:?}");
            let (again, _) = spec(&tree.to_string());
            assert_eq!(again, tree, "{statement}");
            assert!(tree.to_string().contains(statement.as_str()), "{statement}");
            let found = compiled(&whole).system.terms.len();
            assert!(found > base.system.terms.len(), "{statement}");
            *kinds.entry(instance.effect.kind).or_insert(0) += 1;
        }
        // Nothing turns where there is one dimension, or two that do not compare.
        let plane = base.system.degrees() > 1 && !text.contains("[m]");
        assert_eq!(kinds.len(), if plane { 6 } else { 5 }, "{text}: {kinds:?}");
    }
}

#[test]
fn what_cannot_apply_is_no_instance_and_has_a_reason() {
    let line = compiled("coordinates x; momenta p; T = p^2/2");
    let scene = line.system.scene();
    let found = instances(&line.system);
    assert!(found.iter().all(|instance| instance.effect.name != "magnetic_force"));
    let reason = effects::by_name("magnetic_force").and_then(|row| row.cannot(&scene));
    assert!(reason.is_some_and(|reason| reason.contains("one dimension has none")));
    let metres = compiled("coordinates x [m]; momenta p; T = p^2/2");
    let angles = instances(&metres.system).iter().filter(|i| i.effect.angle).count();
    assert_eq!(angles, 0);
    assert!(instances(&line.system).iter().any(|instance| instance.effect.name == "pendulum"));
}

#[test]
fn other_names_lead_to_the_same_effect() {
    let of = |name: &str| compiled(&format!("{PLANE}effect {name}(x, y)\n")).system.terms.clone();
    assert_eq!(of("coriolis_force"), of("magnetic_force"));
    for row in catalogue() {
        for alias in row.aliases {
            assert_eq!(effects::by_name(alias).map(|row| row.name), Some(row.name));
        }
    }
}

#[test]
fn magnetic_force_is_one_term_and_does_no_work() {
    let compiled = compiled(&format!("{PLANE}effect magnetic_force(x, y)\n"));
    let mut system = System::clone(&compiled.system);
    assert_eq!(system.terms.len(), 1);
    assert_eq!(system.terms[0].place, Place::Force(0));
    assert_eq!(system.terms[0].also.len(), 1);
    assert_eq!(system.terms[0].also[0].0, Place::Force(1));
    let only = system.term_ids();
    let forces = system.force(&only).unwrap();
    let of = |symbol| match symbol {
        Symbol::Momentum(i) => [0.3, -1.7][i],
        Symbol::Velocity(_) => f64::NAN,
        Symbol::Coefficient(_) => 2.5,
        _ => 0.4,
    };
    let f: Vec<f64> = forces.iter().map(|&force| system.graph.value(force, &of)).collect();
    assert_eq!(f, [2.5 * -1.7, -2.5 * 0.3]);
    assert!((f[0] * 0.3 - f[1] * 1.7).abs() < 1e-15);
}

#[test]
fn a_rate_is_the_derivative_by_the_whole_model() {
    let compiled = compiled(
        "coordinates x; velocities v
         constant m = 2
         T = p_x^2/(2*m); V = span{ k: x^2 }; force x += span{ d: -p_x } + cos(t)
         sensor x += span{ a: rate(x), b: x*v }
         sensor v += span{ c: rate(v), e: rate(p_x), f: rate(t*x) }",
    );
    let system = &compiled.system;
    let (x, p, t, k, d) = (0.7, -0.6, 0.3, 1.9, 0.4);
    let of = |symbol| match symbol {
        Symbol::Coordinate(_) => x,
        Symbol::Momentum(_) => p,
        Symbol::Velocity(_) => f64::NAN,
        Symbol::Time => t,
        Symbol::Coefficient(0) => k,
        Symbol::Coefficient(1) => d,
        _ => f64::NAN,
    };
    let rate: f64 = -2.0 * k * x - d * p + f64::cos(t);
    let expected = [p / 2.0, x * p / 2.0, rate / 2.0, rate, x + t * p / 2.0];
    let sensors = system.terms.iter().filter(|term| term.place.is_sensor());
    let found: Vec<f64> = sensors.map(|term| system.graph.value(term.expr, &of)).collect();
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        approx::assert_relative_eq!(*found, expected, epsilon = 1e-14);
    }
    let labels: Vec<&str> = system.terms[2..].iter().map(|term| term.label.as_str()).collect();
    assert_eq!(labels, ["rate(x)", "x*v", "rate(v)", "rate(p_x)", "rate(t*x)"]);
    assert!(system.sensors.iter().all(|&known| system.graph.is_zero(known)));
}

#[test]
fn what_differs_with_direction_acts_in_one_direction() {
    for name in ["asymmetric_friction", "asymmetric_drag"] {
        let compiled = compiled(&format!("{PLANE}effect {name}(x)\n"));
        let system = &compiled.system;
        assert_eq!(system.terms.len(), 2, "{name}");
        for (term, ahead) in system.terms.iter().zip([1.0, -1.0]) {
            let at = |p: f64| {
                let of = |symbol| if symbol == Symbol::Momentum(0) { p } else { 0.4 };
                system.graph.value(term.expr, &of)
            };
            assert_eq!(at(-0.6 * ahead), 0.0, "{name}");
            assert!(at(0.6 * ahead) * ahead < 0.0, "{name}");
        }
    }
}

#[test]
fn inner_parameters_take_the_units_of_the_variables() {
    let unit = |by: ScanBy| by.unit_text(Some("m"), Some("kg*m/s"), Some("s"), Some("N"));
    assert_eq!(unit(ScanBy::Frequency).as_deref(), Some("1/s"));
    assert_eq!(
        ScanBy::WaveNumber.unit_text(Some("m/s"), None, None, None).as_deref(),
        Some("1/(m/s)")
    );
    assert_eq!(unit(ScanBy::Exponent), None);
    assert_eq!(ScanBy::Momentum.unit_text(Some("m"), None, Some("s"), None), None);
    let compiled = compiled(
        "coordinates x [m]; momenta p [kg*m/s]; time t [s]; T = span{ p^2 }
         effect contact_above(x; position = 0.2)
         effect periodic_substrate(x; wave = 2*pi)",
    );
    let units: Vec<_> =
        compiled.system.parameters.iter().map(|p| p.unit.map(|u| u.to_string())).collect();
    assert_eq!(units, [Some("m".to_string()), Some("1/m".to_string())]);
    let spring = compiled.system.terms.iter().find(|term| term.effect.is_some());
    assert_eq!(spring.and_then(|term| term.unit_text.as_deref()), Some("kg/s^2"));
}

#[test]
fn candidates_are_listed_and_added_by_name() {
    let text = format!(
        "{PLANE}candidates {{\n  swirl: force x += span{{ s: y }}  # round\n    force y += span{{ s: -x }}\n}}\n"
    );
    let without = compiled(&text);
    assert!(without.system.terms.is_empty());
    assert_eq!(without.candidates.len(), 1);
    let candidate = &without.candidates[0];
    assert_eq!(candidate.name, "swirl");
    assert_eq!(candidate.statements, ["force x += span{ s: y }", "force y += span{ s: -x }"]);
    assert!(text[candidate.span.range()].starts_with("swirl:"));
    let with = compiled(&format!("{text}effect swirl\n"));
    assert_eq!(with.system.terms.len(), 1);
    assert_eq!(with.system.terms[0].effect.as_deref(), Some("swirl"));
    assert_eq!(with.system.terms[0].also.len(), 1);
}

#[test]
fn every_kind_has_rows() {
    for kind in EffectKind::ALL {
        let count = catalogue().filter(|row| row.kind == kind).count();
        assert!(count >= 4, "{}: {count}", kind.text());
    }
}

#[test]
fn equal_coefficients_make_the_simpler_effect() {
    let rows: Vec<&EffectRow> = catalogue().filter(|row| row.where_equal.is_some()).collect();
    assert!(!rows.is_empty());
    for row in rows {
        let simpler = row.where_equal.unwrap();
        let both = closed_form(row.name).zip(closed_form(simpler));
        let Some((At::F(own, _), At::F(other, _))) = both else { panic!("{}", row.name) };
        for z in [[0.4, -1.2, 0.7, 0.1, 2.0], [-0.9, 0.3, -1.6, 0.5, 0.4]] {
            assert_eq!(own(&z, &[]), other(&z, &[]), "{} and {simpler}", row.name);
        }
    }
}
