//! Bodies and groups: effects on several coordinates that share a coefficient.

use leverrier::internals::expr::{Compiled, Place, Symbol, build};
use leverrier::internals::spec::effects::{ActsOn, catalogue};

const TWO: &str = "coordinates x1, y1, x2, y2\nmomenta px1, py1, px2, py2\n\
                   T = (px1^2 + py1^2 + px2^2 + py2^2)/2\n";

fn compiled(text: &str) -> Compiled {
    build("test", text).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// Written by hand: energy at a distance r, the inner parameter last.
fn energy_between(name: &str, r: f64, a: f64) -> Option<f64> {
    Some(match name {
        "gravity_between" => -r.recip(),
        "softened_gravity" => -r.hypot(a).recip(),
        "inverse_square_between" => -r.powi(-2),
        "spring_between" => 0.5 * r * r,
        "elastic_rod_between" => 0.5 * (r - a).powi(2),
        "logarithm_between" => r.ln(),
        "power_law_between" => r.powf(a) / a,
        "screening_between" => -(-r / a).exp_m1() / r,
        "yukawa_between" => -(-r / a).exp() / r,
        _ => return None,
    })
}

const STATES: [[f64; 8]; 3] = [
    [0.7, -0.4, 0.3, 0.9, 0.2, 1.1, -0.6, 0.5],
    [-0.8, 0.6, -0.5, 0.2, 1.7, -0.3, 0.4, 0.8],
    [1.3, 1.1, 0.8, -1.2, 0.4, -0.9, -1.5, 0.1],
];

/// The terms at a place, each with coefficient 1.
fn total(compiled: &Compiled, wanted: impl Fn(Place) -> bool, z: &[f64; 8]) -> f64 {
    let system = &compiled.system;
    let of = |symbol| match symbol {
        Symbol::Coordinate(i) => z[i],
        Symbol::Momentum(i) => z[4 + i],
        Symbol::Parameter(i) => system.parameters[i].start,
        _ => f64::NAN,
    };
    let parts = system.terms.iter().flat_map(|term| term.parts());
    parts.filter(|part| wanted(part.0)).map(|(_, expr)| system.graph.value(expr, &of)).sum()
}

#[test]
fn effects_between_bodies_are_what_their_closed_forms_say() {
    let arguments = ["(x1, y1)".to_string(), "(x2, y2)".to_string()];
    for row in catalogue().filter(|row| row.on == ActsOn::BodyPair && row.detector.is_none()) {
        let a = row.parameters.first().map_or(f64::NAN, |scan| 1.07 * scan.example);
        let statement = row.statement(&arguments, &[a]);
        let compiled = compiled(&format!("{TWO}{statement}\n"));
        assert_eq!(compiled.system.terms.len(), 1, "{}", row.name);
        let label = format!("{}((x1, y1), (x2, y2))", row.name);
        assert_eq!(compiled.system.terms[0].effect, Some(label));
        for z in &STATES {
            let r = (z[2] - z[0]).hypot(z[3] - z[1]);
            let energy = energy_between(row.name, r, a);
            // A damper is the one that is no energy.
            let forces: [f64; 4] = match row.name {
                "damping_between" => [z[6] - z[4], z[7] - z[5], z[4] - z[6], z[5] - z[7]],
                _ => [0.0; 4],
            };
            assert!(energy.is_some() || forces[0] != 0.0, "no closed form: {}", row.name);
            let found = total(&compiled, Place::is_energy, z);
            let expected = energy.unwrap_or(0.0);
            assert!((found - expected).abs() < 1e-12, "{}: {found}, not {expected}", row.name);
            for (i, expected) in forces.into_iter().enumerate() {
                let found = total(&compiled, |place| place == Place::Force(i), z);
                assert!((found - expected).abs() < 1e-12, "{}: {found}", row.name);
            }
        }
    }
}

#[test]
fn an_effect_on_several_coordinates_has_one_coefficient() {
    let compiled = compiled(&format!(
        "{TWO}effect viscous_drag(y2, x1, y1, x2)\neffect linear_spring(x1, y1)\n\
         effect harmonic_drive(x1, x2; frequency = 2)\n"
    ));
    let system = &compiled.system;
    let of = |label: &str| -> Vec<_> {
        system.terms.iter().filter(|term| term.effect.as_deref() == Some(label)).collect()
    };
    // Arguments stand in the order of the coordinates, however they are written.
    let drag = of("viscous_drag(x1, y1, x2, y2)");
    assert_eq!((drag.len(), drag[0].parts().count()), (1, 4));
    assert_eq!(drag[0].name.as_deref(), Some("viscous_drag_x1_y1_x2_y2"));
    // One place, one expression: the energy of both springs.
    let spring = of("linear_spring(x1, y1)");
    assert_eq!((spring.len(), spring[0].parts().count()), (1, 1));
    assert_eq!(spring[0].label, "x1^2/2 + y1^2/2");
    assert_eq!(of("harmonic_drive(x1, x2)").len(), 2);
    assert_eq!(system.parameters.len(), 1);
}

#[test]
fn a_declared_body_stands_for_its_coordinates() {
    let text = format!("{TWO}body star = (x1, y1)\nbody planet = (x2, y2)\n");
    let labels = |effects: &str| -> Vec<String> {
        let compiled = compiled(&format!("{text}{effects}\n"));
        compiled.system.terms.iter().filter_map(|term| term.effect.clone()).collect()
    };
    assert_eq!(labels("effect viscous_drag(star)"), ["viscous_drag(x1, y1)"]);
    assert_eq!(labels("effect viscous_drag(planet, star)"), ["viscous_drag(x1, y1, x2, y2)"]);
    assert_eq!(labels("effect drag_along_velocity(x2, y2)"), ["drag_along_velocity(planet)"]);
    assert_eq!(labels("effect gravity_between((x2, y2), star)"), ["gravity_between(star, planet)"]);
    assert_eq!(labels("effect magnetic_force(star)"), ["magnetic_force(x1, y1)"]);
}

#[test]
fn bodies_are_seen_where_the_names_or_the_symmetry_tell_them() {
    let seen = |text: &str| -> Vec<String> {
        compiled(text).system.bodies().iter().map(|body| body.text()).collect()
    };
    assert_eq!(seen(TWO), ["(x1, y1)", "(x2, y2)"]);
    // Names and equal masses suffice, whatever the potential.
    let fall = "coordinates x, y\nmomenta px, py\nT = (px^2 + py^2)/(2*0.3)\nV = 9.81*0.3*y\n";
    assert_eq!(seen(fall), ["(x, y)"]);
    assert!(seen(&fall.replace("py^2", "1.1*py^2")).is_empty());
    // Without such names, the known energy must have the symmetry.
    let plain = "coordinates a, b\nmomenta p, s\nT = (p^2 + s^2)/2\n";
    assert_eq!(seen(&format!("{plain}V = 1/sqrt(a^2 + b^2)\n")), ["(a, b)"]);
    assert_eq!(seen(&format!("{plain}V = span{{ a^2 + b^2 }}\n")), ["(a, b)"]);
    assert!(seen(&format!("{plain}V = (a - b)^2\n")).is_empty());
    assert!(seen(&format!("{plain}V = span{{ cos(a), cos(b) }}\n")).is_empty());
    assert!(seen("coordinates x [rad], y [rad]\nmomenta p, s\nT = (p^2 + s^2)/2\n").is_empty());
    let four = "coordinates a, b, c, d\nmomenta p, q, r, s\nT = (p^2 + q^2)/2 + r^2 + s^2\n";
    assert_eq!(seen(&format!("{four}V = -1/sqrt((a - c)^2 + (b - d)^2)\n")), ["(a, b)", "(c, d)"]);
    let crossed = "coordinates a, c, b, d\nmomenta p, r, q, s\nT = (p^2 + q^2)/2 + r^2 + s^2\n";
    assert_eq!(
        seen(&format!("{crossed}V = -1/sqrt((a - c)^2 + (b - d)^2)\n")),
        ["(a, b)", "(c, d)"]
    );
    let space = "coordinates x_ball, y_ball, z_ball\nmomenta p, q, r\nT = (p^2 + q^2 + r^2)/2\n";
    assert_eq!(seen(space), ["(x_ball, y_ball, z_ball)"]);
}
