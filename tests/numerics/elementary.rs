//! Vectorised elementary functions against numbers of twice the length.

use leverrier::internals::eval::{InstructionSet, apply, powers};
use leverrier::internals::expr::{FUNCTIONS, Function, Kernel};

/// A number of twice the length: the sum of two, the second far smaller (Dekker 1971).
#[derive(Clone, Copy)]
struct Double(f64, f64);

impl Double {
    fn sum(a: f64, b: f64) -> Double {
        let s = a + b;
        let back = s - a;
        Double(s, (a - (s - back)) + (b - back))
    }

    fn add(self, other: Double) -> Double {
        let Double(s, e) = Double::sum(self.0, other.0);
        let Double(t, f) = Double::sum(self.1, other.1);
        let Double(s, e) = Double::sum(s, e + t);
        Double::sum(s, e + f)
    }

    fn multiply(self, other: Double) -> Double {
        let p = self.0 * other.0;
        let e = self.0.mul_add(other.0, -p);
        Double::sum(p, e + (self.0 * other.1 + self.1 * other.0))
    }

    fn scale(self, factor: f64) -> Double {
        self.multiply(Double(factor, 0.0))
    }

    fn divide(self, other: Double) -> Double {
        let first = self.0 / other.0;
        let rest = self.add(other.scale(-first));
        let second = rest.0 / other.0;
        let rest = rest.add(other.scale(-second));
        Double::sum(first, second).add(Double(rest.0 / other.0, 0.0))
    }

    /// sum of self^k / k! for k = first, first + step, ..., signs alternating if `sign` is -1.
    fn series(self, first: u32, step: u32, sign: f64) -> Double {
        let mut term = Double(1.0, 0.0);
        let mut total = Double(0.0, 0.0);
        let mut flip = 1.0;
        for k in 0..60 {
            if k > 0 {
                term = term.multiply(self).divide(Double(f64::from(k), 0.0));
            }
            if k >= first && (k - first).is_multiple_of(step) {
                total = total.add(term.scale(flip));
                flip *= sign;
            }
        }
        total
    }
}

/// ln 2 and pi/2 to four parts, for reductions without loss.
const LN_2: [f64; 3] = [std::f64::consts::LN_2, 2.3190468138462996e-17, 5.707708438416212e-34];
const HALF_PI: [f64; 4] = [
    std::f64::consts::FRAC_PI_2,
    6.123233995736766e-17,
    -1.4973849048591833e-33,
    4.320574262296449e-50,
];

/// x - k times a number of several parts; k is whole and below 2^24.
fn reduce(x: f64, k: f64, parts: &[f64]) -> Double {
    parts.iter().fold(Double(x, 0.0), |rest, &part| {
        let p = k * part;
        rest.add(Double(-p, -k.mul_add(part, -p)))
    })
}

/// For arguments whose exponential neither overflows nor is subnormal.
fn exp_of(x: Double) -> Double {
    let k = (x.0 * std::f64::consts::LOG2_E).round();
    reduce(x.0, k, &LN_2).add(Double(x.1, 0.0)).series(0, 1, 1.0).scale(k.exp2())
}

fn exp(x: f64) -> Double {
    exp_of(Double(x, 0.0))
}

fn sin_cos(x: f64) -> (Double, Double) {
    let k = (x * std::f64::consts::FRAC_2_PI).round();
    let r = reduce(x, k, &HALF_PI);
    let (s, c) = (r.series(1, 2, -1.0), r.series(0, 2, -1.0));
    match k.rem_euclid(4.0) as u32 {
        0 => (s, c),
        1 => (c, s.scale(-1.0)),
        2 => (s.scale(-1.0), c.scale(-1.0)),
        _ => (c.scale(-1.0), s),
    }
}

/// Newton's step on exp from the logarithm of the standard library.
fn log(x: f64) -> Double {
    let y = x.ln();
    let e = exp(-y);
    let u = e.scale(x).add(Double(-1.0, 0.0));
    // ln(1 + u) for tiny u.
    let square = u.multiply(u).scale(-0.5);
    Double(y, 0.0).add(u).add(square)
}

fn truth(name: &str, x: f64) -> Double {
    let one = Double(1.0, 0.0);
    match name {
        "sin" => sin_cos(x).0,
        "cos" => sin_cos(x).1,
        "tan" => {
            let (s, c) = sin_cos(x);
            s.divide(c)
        }
        "exp" => exp(x),
        "log" => log(x),
        "sinh" if x.abs() < 0.5 => Double(x, 0.0).series(1, 2, 1.0),
        "sinh" => exp(x).add(exp(-x).scale(-1.0)).scale(0.5),
        "cosh" => exp(x).add(exp(-x)).scale(0.5),
        "tanh" if x.abs() < 0.5 => {
            let x = Double(x, 0.0);
            x.series(1, 2, 1.0).divide(x.series(0, 2, 1.0))
        }
        _ => {
            let e = exp(2.0 * x);
            e.add(one.scale(-1.0)).divide(e.add(one))
        }
    }
}

/// Error in units in the last place of the truth.
fn ulps(value: f64, truth: Double) -> f64 {
    let size = truth.0.abs();
    let ulp = size.next_up() - size;
    ((value - truth.0) - truth.1).abs() / ulp
}

fn evaluate(name: &str, x: &[f64]) -> Vec<f64> {
    let function = Function::by_name(name).unwrap();
    let mut all: Vec<Vec<f64>> = InstructionSet::available()
        .into_iter()
        .map(|set| {
            let mut out = vec![7.0; x.len()];
            apply(set, function, x, &mut out);
            out
        })
        .collect();
    let first = all.remove(0);
    for other in all {
        for (a, b) in first.iter().zip(&other) {
            assert!(a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan(), "{name}: {a} {b}");
        }
    }
    first
}

/// (function, bound in units in the last place, largest argument, smallest argument).
const BOUNDS: [(&str, f64, f64, f64); 8] = [
    ("sin", 1.0, 9.9e6, -9.9e6),
    ("cos", 1.0, 9.9e6, -9.9e6),
    ("tan", 2.0, 9.9e6, -9.9e6),
    ("exp", 1.0, 700.0, -700.0),
    ("log", 1.0, 1e300, 1e-300),
    ("sinh", 2.0, 700.0, -700.0),
    ("cosh", 2.0, 700.0, -700.0),
    ("tanh", 2.0, 30.0, -30.0),
];

/// One that is exact needs no bound.
#[test]
fn every_kernel_has_its_bound() {
    for row in FUNCTIONS {
        let exact = matches!(
            row.kernel,
            None | Some(Kernel::SquareRoot | Kernel::AbsoluteValue | Kernel::Sign)
        );
        let bound = BOUNDS.iter().any(|(name, ..)| *name == row.name);
        assert!(exact != bound, "{}: give the error of its kernel a bound", row.name);
    }
}

#[test]
fn errors_stay_below_their_bounds() {
    for (name, bound, most, least) in BOUNDS {
        let mut x = Vec::new();
        for i in 0..6000 {
            let part = ((i as f64 + 0.5) * 0.618_033_988_749_895).fract();
            x.push(least.max(-4.0) + (most.min(4.0) - least.max(-4.0)) * part);
            // All sizes.
            let size = 10_f64.powf(-12.0 + (12.0 + most.log10()) * part);
            x.extend([size, -size].into_iter().filter(|&x| x > least && x < most));
        }
        if ["sin", "cos", "tan"].contains(&name) {
            // Near multiples of pi/2 nothing but the reduction counts.
            x.extend((1..3000).map(|k| f64::from(k * k) * std::f64::consts::FRAC_PI_2));
            x.retain(|x| x.abs() < most);
        }
        let values = evaluate(name, &x);
        let errors = x.iter().zip(&values).map(|(&x, &value)| (ulps(value, truth(name, x)), x));
        let worst = errors.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        println!("{name}: {:.3} units in the last place at {:e}", worst.0, worst.1);
        assert!(worst.0 <= bound, "{name}: {} at {:e}", worst.0, worst.1);
    }
}

/// The same number, sign of zero included, or both finite and so many units apart at most.
fn agrees(value: f64, expected: f64, units: f64) -> bool {
    // Subnormal numbers are all one unit apart.
    let unit = expected.abs().next_up() - expected.abs();
    let close = (value - expected).abs() <= units * unit;
    let same = value == expected && value.is_sign_negative() == expected.is_sign_negative();
    same || value.is_nan() && expected.is_nan() || value.is_finite() && close
}

/// The standard library itself, where numbers of twice the length do not reach.
#[test]
fn edges_are_those_of_the_standard_library() {
    let tiny = f64::from_bits(1);
    let edges = [
        0.0,
        -0.0,
        tiny,
        -tiny,
        1e-310,
        -1e-310,
        f64::MIN_POSITIVE,
        1e7,
        -1.0001e7,
        1e15,
        -3e22,
        1e300,
        f64::MAX,
        -f64::MAX,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NAN,
        709.782_712_893_383_9,
        709.782_712_893_384_1,
        710.4,
        710.475_860_073_943_9,
        711.0,
        -708.5,
        -720.3,
        -744.4,
        -745.13,
        -745.14,
        -800.0,
        1.0,
        -1.0,
        0.999_999_999_999_999_9,
        22.0,
        -22.5,
        40.0,
    ];
    for function in Function::all() {
        let name = function.row().name;
        let values = evaluate(name, &edges);
        for (&x, &value) in edges.iter().zip(&values) {
            let expected = (function.row().value)(x);
            assert!(agrees(value, expected, 2.0), "{name}({x:e}): {value:e} {expected:e}");
        }
    }
}

#[test]
fn results_do_not_depend_on_the_place_in_the_row() {
    for function in Function::all() {
        let x: Vec<f64> = (0..83).map(|i| 0.9 * (1.0 + 0.37 * f64::from(i)).sin()).collect();
        let whole = evaluate(function.row().name, &x);
        for (i, value) in whole.iter().enumerate() {
            let alone = evaluate(function.row().name, &x[i..=i])[0];
            assert!(alone.to_bits() == value.to_bits() || alone.is_nan() && value.is_nan());
        }
    }
}

/// Powers on every instruction set, which agree to the last bit.
fn evaluate_powers(bases: &[f64], exponents: &[f64]) -> Vec<f64> {
    let of = |set| {
        let mut out = vec![7.0; bases.len()];
        powers(set, bases, exponents, &mut out);
        out
    };
    let first = of(InstructionSet::Plain);
    for set in InstructionSet::available() {
        for (a, b) in first.iter().zip(of(set)) {
            assert!(a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan(), "{a} {b}");
        }
    }
    first
}

#[test]
fn errors_of_powers_stay_below_one_unit() {
    let (mut bases, mut exponents) = (Vec::new(), Vec::new());
    for i in 0..40_000 {
        let part = |step: f64| ((i as f64 + 0.5) * step).fract();
        let (a, b) = (part(0.618_033_988_749_895), part(0.414_213_562_373_095_1));
        // Everyday numbers, bases near one, and results of every size.
        let base = match i % 3 {
            0 => 4.0 * a,
            1 => 1.0 + 1e-3 * (a - 0.5),
            _ => (1380.0 * (a - 0.5)).exp(),
        };
        let most = [4.0, 1e5, 690.0 / base.ln().abs()][i % 3];
        bases.push(base);
        exponents.push(most * (2.0 * b - 1.0));
    }
    let values = evaluate_powers(&bases, &exponents);
    let mut worst = (0.0, 0.0, 0.0);
    for ((&x, &y), &value) in bases.iter().zip(&exponents).zip(&values) {
        let error = ulps(value, exp_of(log(x).scale(y)));
        if error > worst.0 || error.is_nan() {
            worst = (error, x, y);
        }
    }
    println!("{:.3} units in the last place at {:e}^{:e}", worst.0, worst.1, worst.2);
    assert!(worst.0 <= 1.0, "{} at {:e}^{:e}", worst.0, worst.1, worst.2);
}

/// What a straight line cannot do is done as the standard library does it.
#[test]
fn edges_of_powers_are_those_of_the_standard_library() {
    let tiny = f64::from_bits(1);
    let edges = [
        0.0,
        -0.0,
        tiny,
        -tiny,
        1e-310,
        f64::MIN_POSITIVE,
        0.5,
        -0.5,
        1.0,
        -1.0,
        1.0_f64.next_up(),
        1.0_f64.next_down(),
        2.0,
        3.0,
        -3.0,
        1023.9,
        1e300,
        f64::MAX,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NAN,
    ];
    let pairs = edges.iter().flat_map(|&x| edges.iter().map(move |&y| (x, y)));
    let (bases, exponents): (Vec<f64>, Vec<f64>) = pairs.unzip();
    let values = evaluate_powers(&bases, &exponents);
    for ((&x, &y), &value) in bases.iter().zip(&exponents).zip(&values) {
        let expected = x.powf(y);
        assert!(agrees(value, expected, 1.0), "{x:e}^{y:e}: {value:e} {expected:e}");
    }
}
