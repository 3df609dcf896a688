//! What a fitted model is printed as, and that it stays the same function.

use std::sync::Arc;

use leverrier::internals::dynamics::Method;
use leverrier::internals::error::Result;
use leverrier::internals::expr::{
    Bounds, Expr, Function, Graph, Observed, Parameter, Place, Symbol, System, Term, TermId,
    Variable,
};
use leverrier::internals::fit::{Law, Stepping};
use leverrier::internals::simplify::{SaturationEnd, Simplified, SimplifyOptions, Style, simplify};
use nalgebra::DMatrix;
use proptest::prelude::*;

fn variable(name: String) -> Variable {
    Variable { name, unit: None, unit_text: None }
}

/// A system with nothing known; terms are added by the tests.
fn system(degrees: usize) -> System {
    let mut graph = Graph::new();
    let zero = graph.number(0.0);
    let name = |letter: &str, i: usize| match degrees {
        1 => letter.to_string(),
        _ => format!("{letter}[{}]", i + 1),
    };
    System {
        name: "test".into(),
        graph,
        coordinates: (0..degrees).map(|i| variable(name("q", i))).collect(),
        momenta: (0..degrees).map(|i| variable(name("p", i))).collect(),
        declared_bodies: Vec::new(),
        observed: Observed::Momenta,
        velocities: Vec::new(),
        time: variable("t".into()),
        inputs: Vec::new(),
        hidden: Vec::new(),
        parameters: Vec::new(),
        kinetic: zero,
        potential: zero,
        hamiltonian: zero,
        forces: vec![zero; degrees],
        sensors: vec![zero; 2 * degrees],
        constraints: Vec::new(),
        measures: Vec::new(),
        terms: Vec::new(),
    }
}

fn law(system: Arc<System>, terms: Vec<(TermId, f64)>, parameters: Vec<f64>) -> Result<Law> {
    let stepping = Stepping { method: Method::by_name("leapfrog").unwrap(), longest: 0.1 };
    Law::new(system, terms, parameters, Vec::new(), (stepping, 2))
}

/// A model under construction: terms with coefficients and standard errors.
struct Model {
    system: System,
    coefficients: Vec<f64>,
    errors: Vec<f64>,
    parameters: Vec<f64>,
    parameter_errors: Vec<f64>,
}

impl Model {
    fn new(degrees: usize) -> Self {
        Model {
            system: system(degrees),
            coefficients: Vec::new(),
            errors: Vec::new(),
            parameters: Vec::new(),
            parameter_errors: Vec::new(),
        }
    }

    fn q(&mut self, i: usize) -> Expr {
        self.system.graph.symbol(Symbol::Coordinate(i))
    }

    fn p(&mut self, i: usize) -> Expr {
        self.system.graph.symbol(Symbol::Momentum(i))
    }

    fn parameter(&mut self, name: &str, value: f64, error: f64) -> Expr {
        self.parameters.push(value);
        self.parameter_errors.push(error);
        self.system.parameters.push(Parameter {
            per: None,
            name: name.into(),
            start: 0.0,
            bounds: Bounds::FREE,
            unit: None,
            unit_text: None,
        });
        self.system.graph.symbol(Symbol::Parameter(self.parameters.len() - 1))
    }

    fn term(&mut self, place: Place, expr: Expr, coefficient: f64, error: f64) {
        self.system.terms.push(Term {
            place,
            expr,
            also: Vec::new(),
            effect: None,
            label: String::new(),
            name: None,
            bounds: Bounds::FREE,
            unit: None,
            unit_text: None,
        });
        self.coefficients.push(coefficient);
        self.errors.push(error);
    }

    /// A monomial: (is a momentum, index, power).
    fn monomial(&mut self, place: Place, powers: &[(bool, usize, i32)], value: f64, error: f64) {
        let parts: Vec<(Expr, f64)> = powers
            .iter()
            .map(|&(momentum, i, power)| {
                let base = if momentum { self.p(i) } else { self.q(i) };
                (base, f64::from(power))
            })
            .collect();
        let expr = self.system.graph.product(1.0, &parts);
        self.term(place, expr, value, error);
    }

    fn v(&mut self, powers: &[(usize, i32)], value: f64, error: f64) {
        let powers: Vec<_> = powers.iter().map(|&(i, power)| (false, i, power)).collect();
        self.monomial(Place::Potential, &powers, value, error);
    }

    fn t(&mut self, i: usize, value: f64, error: f64) {
        self.monomial(Place::Kinetic, &[(true, i, 2)], value, error);
    }

    fn apply(&mut self, name: &str, argument: Expr) -> Expr {
        let function = Function::by_name(name).unwrap();
        self.system.graph.apply(function, argument)
    }

    fn simplify_with(&self, options: &SimplifyOptions) -> Simplified {
        let errors: Vec<f64> =
            self.errors.iter().chain(&self.parameter_errors).map(|e| e * e).collect();
        let law = self.law().unwrap().with_covariance(DMatrix::from_diagonal(&errors.into()));
        simplify(&law.unwrap(), options)
    }

    fn law(&self) -> Result<Law> {
        let terms = self.system.term_ids().into_iter().zip(self.coefficients.iter().copied());
        let system = Arc::new(self.system.clone());
        law(system, terms.collect(), self.parameters.clone())
    }

    fn simplify(&self) -> Simplified {
        self.simplify_with(&SimplifyOptions::default())
    }

    fn text(&self) -> String {
        self.simplify().text(Style::default())
    }

    /// The model's own H.
    fn energy(&self, state: &[f64]) -> f64 {
        let mut system = self.system.clone();
        let active = system.term_ids();
        let energy = system.energy(&active).unwrap();
        let degrees = system.degrees();
        system.graph.value(energy, &|symbol| match symbol {
            Symbol::Coordinate(i) => state[i],
            Symbol::Momentum(i) => state[degrees + i],
            Symbol::Velocity(_) => f64::NAN,
            Symbol::Time => 0.0,
            Symbol::Input(..) | Symbol::Delayed(..) => 0.4,
            Symbol::Parameter(i) => self.parameters[i],
            Symbol::Coefficient(k) => self.coefficients[k],
        })
    }
}

fn henon_heiles(error: f64) -> Model {
    let mut model = Model::new(2);
    let mut sign = 1.0;
    let mut off = |value: f64| {
        sign = -sign;
        value + 0.7 * sign * error
    };
    for i in 0..2 {
        model.t(i, off(0.5), error);
    }
    for i in 0..2 {
        model.v(&[(i, 2)], off(0.5), error);
    }
    model.v(&[(0, 2), (1, 1)], off(1.0), error);
    model.v(&[(1, 3)], off(-1.0 / 3.0), error);
    model
}

#[test]
fn henon_heiles_reads_as_in_the_textbook() {
    let expected = "H = (p[1]^2 + p[2]^2)/2 + (q[1]^2 + q[2]^2)/2 + q[1]^2 q[2] - q[2]^3/3";
    for error in [0.0, 1e-10, 1e-4, 2e-3] {
        let model = henon_heiles(error);
        let simplified = model.simplify();
        assert_eq!(simplified.text(Style::default()), expected, "standard error {error}");
        assert_eq!(simplified.snaps.len(), if error == 0.0 { 0 } else { 6 });
        assert!(simplified.snaps.iter().all(|snap| snap.sigmas < 1.0));
    }
}

#[test]
fn uncertain_numbers_keep_their_digits() {
    let mut model = Model::new(1);
    model.t(0, 0.53, 0.2);
    model.v(&[(0, 2)], 0.501_23, 0.001_3);
    model.v(&[(0, 3)], -0.271_8, 0.001_1);
    assert_eq!(model.text(), "H = 0.53(20) p^2 + q^2/2 - 0.2718(11) q^3");
    let plain = Style { uncertainties: false, digits: 3 };
    assert_eq!(model.simplify().text(plain), "H = 0.53 p^2 + q^2/2 - 0.272 q^3");
}

#[test]
fn coupled_oscillators() {
    let mut model = Model::new(2);
    for i in 0..2 {
        model.t(i, 0.5, 1e-9);
    }
    for i in 0..2 {
        model.v(&[(i, 2)], 0.5, 1e-9);
    }
    model.v(&[(0, 2), (1, 2)], 0.5, 1e-9);
    assert_eq!(model.text(), "H = (p[1]^2 + p[2]^2)/2 + (q[1]^2 + q[2]^2 + q[1]^2 q[2]^2)/2");
}

const SPRINGS: [f64; 6] = [0.113, 0.374, 0.0611, 0.2872, 0.1873, 0.3317];

/// Five masses between walls, fitted in monomials.
fn mass_spring(error: f64) -> Model {
    let mut model = Model::new(5);
    for (i, mass) in [1.31, 0.92, 1.17, 0.74, 1.56].into_iter().enumerate() {
        model.t(i, 0.5 / mass, error);
    }
    for i in 0..5 {
        model.v(&[(i, 2)], (SPRINGS[i] + SPRINGS[i + 1]) / 2.0, error);
    }
    for i in 0..4 {
        model.v(&[(i, 1), (i + 1, 1)], -SPRINGS[i + 1], error);
    }
    model.v(&[(4, 1)], -1.5 * SPRINGS[5], error);
    model
}

#[test]
fn masses_and_springs_are_spring_differences() {
    let text = mass_spring(1e-9).simplify().text(Style { uncertainties: false, digits: 4 });
    let (_, potential) = text.split_once("p[5]^2 + ").unwrap();
    assert_eq!(
        potential,
        "(0.113 q[1]^2 + 0.374 (q[2] - q[1])^2 + 0.0611 (q[3] - q[2])^2 \
         + 0.2872 (q[4] - q[3])^2 + 0.1873 (q[5] - q[4])^2 + 0.3317 (q[5] - 3/2)^2)/2"
    );
    // Clean data: residuals, not errors, limit the coefficients.
    let mut model = mass_spring(0.0);
    model.coefficients[6] += 3e-9;
    assert!(model.text().contains("(q[4] - q[3])^2"), "{}", model.text());
}

#[test]
fn springs_with_noise_carry_their_uncertainty() {
    let mut model = mass_spring(0.002);
    for (k, coefficient) in model.coefficients.iter_mut().enumerate() {
        *coefficient += 0.0015 * [0.3, -0.8, 0.5, 0.9, -0.4][k % 5];
    }
    let simplified = model.simplify();
    let text = simplified.text(Style::default());
    assert!(
        text.contains("(q[2] - q[1])^2") && text.contains("0.3319(45) (q[5] - 1.501(21))^2"),
        "{text}"
    );
    assert!(text.contains("0.3735(20) (q[2] - q[1])^2"), "{text}");
    assert!(simplified.snaps.iter().any(|snap| snap.what.contains("wall") && snap.to.value == 0.0));
}

#[test]
fn a_chain_that_is_none_is_left_alone() {
    let mut model = mass_spring(1e-9);
    model.coefficients[6] += 0.05;
    // Now mass 2 has a wall of its own; nothing is hidden.
    let text = model.text();
    assert!(
        model.simplify().snaps.iter().all(|snap| !snap.what.contains("q[2] and a wall")),
        "{text}"
    );
}

#[test]
fn squares_are_completed() {
    let mut model = Model::new(1);
    model.v(&[(0, 2)], 0.731_23, 1e-5);
    model.v(&[(0, 1)], -2.0 * 0.731_23 * 1.5, 1e-5);
    assert_eq!(model.text(), "H = 0.731230(10) (q - 3/2)^2");
    // The constant is free only because nothing else depends on q.
    model.v(&[(0, 3)], 0.417_3, 1e-5);
    assert!(!model.text().contains("(q -"), "{}", model.text());
}

/// c sin((1 + a) q + b), or cos.
fn wave(name: &str, amplitude: f64, a: f64, b: f64, error: f64) -> Model {
    let mut model = Model::new(1);
    let q = model.q(0);
    let a = model.parameter("a", a, error);
    let b = model.parameter("b", b, error);
    let one = model.system.graph.number(1.0);
    let number = model.system.graph.add(one, a);
    let product = model.system.graph.multiply(number, q);
    let argument = model.system.graph.add(product, b);
    let expr = model.apply(name, argument);
    model.term(Place::Potential, expr, amplitude, error);
    model
}

/// A quarter turn to the precision of a fit.
const QUARTER: f64 = std::f64::consts::FRAC_PI_2 - 3e-8;

#[test]
fn shifted_sines_become_cosines() {
    use std::f64::consts::PI;
    for (name, amplitude, a, b, expected) in [
        ("sin", -1.999_999_9, 0.0, QUARTER, "-2 cos(q)"),
        ("sin", 1.999_999_9, 0.0, QUARTER, "2 cos(q)"),
        ("sin", 2.0, 0.0, -QUARTER, "-2 cos(q)"),
        ("sin", 2.0, 1e-8, QUARTER + PI, "-2 cos(q)"),
        ("sin", 2.0, 0.0, QUARTER - 4.0 * PI, "2 cos(q)"),
        ("sin", 2.0, -2.0, QUARTER, "2 cos(q)"),
        ("sin", -2.0, -2.0, 0.0, "2 sin(q)"),
        ("sin", 2.0, 0.0, 2.0 * QUARTER, "-2 sin(q)"),
        ("sin", 2.0, 1.0, -2.0 * QUARTER, "-2 sin(2 q)"),
        ("cos", 0.5, 0.0, QUARTER, "-sin(q)/2"),
        ("cos", 0.5, 0.0, -QUARTER, "sin(q)/2"),
        ("cos", 1.0, 0.0, 6.0 * QUARTER, "-cos(q)"),
        ("sin", 1.0, 0.0, PI / 3.0, "sin(q + pi/3)"),
        ("sin", 1.0, 0.0, 2.0 * PI / 3.0, "-sin(q - pi/3)"),
    ] {
        for error in [0.0, 1e-5] {
            let model = wave(name, amplitude, a, b, error);
            assert_eq!(model.text(), format!("H = {expected}"), "{amplitude} {name} {a} {b}");
        }
    }
    let model = wave("sin", -1.66, 0.13, 1.2, 1e-3);
    assert_eq!(model.text(), "H = -1.6600(10) sin(1.1300(10) q + 1.2000(10))");
}

#[test]
fn sine_and_cosine_become_one_wave() {
    let mut model = Model::new(1);
    let q = model.q(0);
    let (sin, cos) = (model.apply("sin", q), model.apply("cos", q));
    model.term(Place::Potential, sin, 2.0 * 0.3f64.sin(), 1e-4);
    model.term(Place::Potential, cos, 2.0 * 0.3f64.cos(), 1e-4);
    assert_eq!(model.text(), "H = 2 cos(q - 0.300000(50))");
}

#[test]
fn equal_coefficients_are_one() {
    let mut model = Model::new(2);
    model.v(&[(0, 2)], 0.312_7, 0.000_5);
    model.v(&[(1, 2)], 0.313_1, 0.000_5);
    assert_eq!(model.text(), "H = 0.31290(35) (q[1]^2 + q[2]^2)");
    assert!(model.simplify().snaps[0].to.text.contains("the same as"));
    model.coefficients[1] = 0.33;
    assert_eq!(model.text(), "H = 0.31270(50) q[1]^2 + 0.33000(50) q[2]^2");
}

#[test]
fn a_spring_in_the_spec_stays_a_spring() {
    let mut model = Model::new(2);
    let (a, b) = (model.q(0), model.q(1));
    let difference = model.system.graph.subtract(b, a);
    let square = model.system.graph.power(difference, 2.0);
    model.term(Place::Potential, square, 0.271_83, 1e-6);
    assert_eq!(model.text(), "H = 0.2718300(10) (q[2] - q[1])^2");
}

#[test]
fn the_pendulum_as_a_quintic_says_what_it_is() {
    let mut model = Model::new(1);
    model.t(0, 0.25, 1e-6);
    model.v(&[(0, 2)], 0.998, 1e-4);
    model.v(&[(0, 4)], -0.079, 1e-4);
    for options in [
        SimplifyOptions::default(),
        SimplifyOptions { ranges: vec![1.4, 2.0], ..SimplifyOptions::default() },
    ] {
        let simplified = model.simplify_with(&options);
        let shape = &simplified.parts[1].shape;
        assert_eq!(shape.len(), 1);
        assert!(
            shape[0].starts_with(
                "V has the shape of the Taylor polynomial of -2.00 cos(1.00 q): \
                 the quadratic and quartic coefficients agree to "
            ) || shape[0].contains("of -2.01 cos(1.00 q)")
                || shape[0].contains("of -1.99 cos(1.00 q)"),
            "{shape:?}"
        );
        assert!(simplified.parts[0].shape.is_empty());
    }
    let henon = henon_heiles(1e-9).simplify();
    assert!(henon.parts.iter().all(|part| part.shape.is_empty()));
}

#[test]
fn junk_gets_no_structure() {
    let mut model = Model::new(2);
    let list = [
        (1, 0, 0.731_1),
        (2, 0, -0.412_7),
        (1, 1, 0.297_3),
        (0, 2, 0.883_9),
        (3, 0, 0.153_1),
        (2, 1, -0.671_3),
        (0, 3, 0.341_9),
        (4, 0, -0.227_7),
        (1, 3, 0.519_7),
    ];
    for (i, j, value) in list {
        let powers: Vec<(usize, i32)> =
            [(0, i), (1, j)].into_iter().filter(|&(_, power)| power > 0).collect();
        model.v(&powers, value, 1e-5);
    }
    let simplified = model.simplify();
    let text = simplified.text(Style { uncertainties: false, digits: 4 });
    assert_eq!(
        text,
        "H = 0.7311 q[1] - 0.4127 q[1]^2 + 0.2973 q[1] q[2] + 0.8839 q[2]^2 + 0.1531 q[1]^3 \
         - 0.6713 q[1]^2 q[2] + 0.3419 q[2]^3 - 0.2277 q[1]^4 + 0.5197 q[1] q[2]^3"
    );
    assert!(simplified.snaps.is_empty() && simplified.parts[0].shape.is_empty());
}

#[test]
fn forces_and_functions() {
    let mut model = Model::new(1);
    let p = model.p(0);
    let abs = model.apply("abs", p);
    let drag = model.system.graph.multiply(p, abs);
    model.t(0, 0.5, 0.0);
    model.term(Place::Force(0), drag, -0.081_3, 0.000_4);
    model.term(Place::Force(0), p, -0.25, 1e-5);
    assert_eq!(model.text(), "H = p^2/2\nforce q = -p/4 - 0.08130(40) p abs(p)");
    let empty = Model::new(1);
    assert_eq!(empty.text(), "H = 0");
}

#[test]
fn models_of_many_terms_are_lists() {
    let mut model = Model::new(3);
    for i in 0..6 {
        for j in 0..6 {
            for k in 0..6 {
                if i + j + k > 0 {
                    let powers: Vec<(usize, i32)> =
                        [(0, i), (1, j), (2, k)].into_iter().filter(|t| t.1 > 0).collect();
                    let value = 0.3 + (f64::from(i * 36 + j * 6 + k) * 0.618_034).fract();
                    model.v(&powers, value, 1e-3);
                }
            }
        }
    }
    let simplified = model.simplify();
    assert_eq!(simplified.parts.len(), 1);
    assert!(simplified.info.stop <= SaturationEnd::TooLarge && simplified.info.rejected == 0);
}

#[test]
fn equal_springs_are_one_number() {
    let mut model = Model::new(3);
    for i in 0..3 {
        model.v(&[(i, 2)], 0.25, 1e-8);
    }
    for i in 0..2 {
        model.v(&[(i, 1), (i + 1, 1)], -0.25, 1e-8);
    }
    assert_eq!(model.text(), "H = (q[1]^2 + (q[2] - q[1])^2 + (q[3] - q[2])^2 + q[3]^2)/8");
}

#[test]
fn nothing_panics_on_odd_numbers() {
    for value in [f64::NAN, f64::INFINITY, -f64::INFINITY, 0.0, 1e-320, 1e300] {
        for error in [0.0, f64::NAN, f64::INFINITY, 1e300] {
            let mut model = mass_spring(error);
            for coefficient in model.coefficients.iter_mut().step_by(2) {
                *coefficient = value;
            }
            let simplified = model.simplify();
            assert!(!simplified.text(Style::default()).is_empty());
            let wave = wave("sin", 1.0, value, value, error).simplify();
            assert!(!wave.text(Style { uncertainties: true, digits: 0 }).is_empty());
        }
    }
}

#[test]
fn lists_that_do_not_belong_together_are_refused() {
    let model = henon_heiles(0.0);
    let system = Arc::new(model.system.clone());
    let terms: Vec<(TermId, f64)> = system.term_ids().into_iter().map(|id| (id, 0.5)).collect();
    assert!(law(system.clone(), terms[..2].to_vec(), Vec::new()).is_ok());
    assert!(law(system.clone(), [&terms[..2], &terms[..1]].concat(), Vec::new()).is_err());
    assert!(law(system.clone(), terms[..2].to_vec(), vec![1.0]).is_err());
    let known = law(system.clone(), terms[..2].to_vec(), Vec::new()).unwrap();
    assert!(known.with_covariance(DMatrix::zeros(1, 1)).is_err());
    let other = Arc::new(mass_spring(0.0).system);
    assert!(law(other, terms, Vec::new()).is_err());
}

#[test]
fn results_repeat() {
    let model = mass_spring(0.002);
    let first = model.simplify();
    let second = model.simplify();
    assert_eq!(first.text(Style::default()), second.text(Style::default()));
    assert_eq!(first.info, second.info);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// The printed model differs from the fitted one by a constant and by what snapped.
    #[test]
    fn simplified_models_are_the_same_function(
        terms in prop::collection::vec((0usize..9, 0usize..2, 1i32..5, -2.0f64..2.0), 1..9),
        inner in (-1.5f64..1.5, -7.0f64..7.0),
        point in prop::collection::vec(-1.2f64..1.2, 4),
    ) {
        let mut model = Model::new(2);
        let a = model.parameter("a", inner.0, 1e-7);
        let b = model.parameter("b", inner.1, 1e-7);
        for (kind, i, power, value) in terms {
            let (q, other, p) = (model.q(i), model.q(1 - i), model.p(i));
            let g = &mut model.system.graph;
            let (place, expr) = match kind {
                0 => (Place::Kinetic, g.power(p, f64::from(power))),
                1 => (Place::Potential, g.power(q, f64::from(power))),
                2 => (Place::Potential, g.multiply(q, other)),
                3 => {
                    let difference = g.subtract(q, other);
                    (Place::Potential, g.power(difference, f64::from(power)))
                }
                4 => {
                    let product = g.multiply(a, q);
                    let argument = g.add(product, b);
                    (Place::Potential, g.apply(Function::by_name("sin").unwrap(), argument))
                }
                5 => {
                    let product = g.multiply(a, other);
                    let argument = g.subtract(b, product);
                    let cos = g.apply(Function::by_name("cos").unwrap(), argument);
                    (Place::Potential, g.power(cos, f64::from(power)))
                }
                6 => (Place::Potential, g.apply(Function::by_name("sin").unwrap(), q)),
                7 => (Place::Potential, g.apply(Function::by_name("cos").unwrap(), q)),
                _ => {
                    let square = g.power(q, 2.0);
                    let one = g.number(1.0);
                    let sum = g.add(one, square);
                    let inverse = g.power(sum, -1.0);
                    (Place::Hamiltonian, g.multiply(inverse, p))
                }
            };
            model.term(place, expr, value, 1e-7);
        }
        let simplified = model.simplify();
        prop_assert_eq!(simplified.info.rejected, 0);
        let zero = [0.1, -0.2, 0.3, 0.4];
        let ours = simplified.pretty_value(&point) - simplified.pretty_value(&zero);
        let theirs = model.energy(&point) - model.energy(&zero);
        // Snapping moves numbers by two standard errors.
        prop_assert!((ours - theirs).abs() < 1e-4, "{} and {}: {}", ours, theirs,
            simplified.text(Style::default()));
        // The normal form holds the fitted numbers: no snapping at all.
        let exact: f64 = simplified.parts.iter().map(|part| {
            let at = |state: &[f64]| simplified.graph.value(part.exact, &|symbol| match symbol {
                Symbol::Coordinate(i) => state[i],
                Symbol::Momentum(i) => state[2 + i],
                Symbol::Velocity(_) => f64::NAN,
                _ => f64::NAN,
            });
            at(&point) - at(&zero)
        }).sum();
        prop_assert!((exact - theirs).abs() < 1e-9 * theirs.abs().max(100.0));
    }
}
