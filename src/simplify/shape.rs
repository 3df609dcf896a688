//! Polynomials that have the shape of a known function: "the Taylor polynomial of -2 cos(q)".
//!
//! A polynomial fitted over a range is not the Taylor polynomial itself: the terms that it
//! lacks are shared among those it has. So the coefficients are compared with those of the
//! best polynomial in the same powers over that range, whose limit at zero range is Taylor's.

use nalgebra::{DMatrix, DVector};

use crate::expr::Place;

/// A function that a polynomial may be an approximation of: one row each.
#[derive(Debug, Clone, Copy)]
pub struct Shape {
    /// Its name in the mini-language.
    pub name: &'static str,
    /// The function.
    pub value: fn(f64) -> f64,
    /// k-th derivative at zero, for k modulo 4.
    pub derivatives: [f64; 4],
    /// Fewest powers that must agree when the wave number is 1; with any other wave number
    /// it takes three, since two powers always fit.
    pub fewest: usize,
}

/// Every shape. A new one is one row here.
pub static SHAPES: &[Shape] = &[
    Shape { name: "cos", value: f64::cos, derivatives: [1.0, 0.0, -1.0, 0.0], fewest: 2 },
    Shape { name: "sin", value: f64::sin, derivatives: [0.0, 1.0, 0.0, -1.0], fewest: 2 },
    Shape { name: "cosh", value: f64::cosh, derivatives: [1.0, 0.0, 1.0, 0.0], fewest: 3 },
    Shape { name: "sinh", value: f64::sinh, derivatives: [0.0, 1.0, 0.0, 1.0], fewest: 3 },
    Shape { name: "exp", value: f64::exp, derivatives: [1.0, 1.0, 1.0, 1.0], fewest: 3 },
];

/// A polynomial's coefficient of x^power and its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Power {
    /// The exponent.
    pub power: usize,
    /// The coefficient.
    pub value: f64,
    /// Its standard error; zero where exact.
    pub standard_error: f64,
}

/// amplitude * shape(wave_number * x), up to a constant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TaylorMatch {
    /// The function's name.
    pub name: &'static str,
    /// The factor in front.
    pub amplitude: f64,
    /// The factor of x.
    pub wave_number: f64,
    /// Largest relative difference from the Taylor coefficients.
    pub difference: f64,
}

impl TaylorMatch {
    /// "V has the shape of the Taylor polynomial of -2.00 cos(1.00 q): ...".
    pub fn sentence(&self, variable: &str, place: Place, powers: &[Power]) -> String {
        let part = match place {
            Place::Kinetic => "T",
            Place::Potential => "V",
            Place::Hamiltonian => "H",
            Place::Force(_) => "the force",
            Place::Rate(_) => "the rate",
            Place::Sensor(_) => "what the instrument adds",
        };
        let ordinal = |power: usize| match power {
            1 => "linear".to_string(),
            2 => "quadratic".to_string(),
            3 => "cubic".to_string(),
            4 => "quartic".to_string(),
            n => format!("{n}th-order"),
        };
        let period = SHAPES.iter().find(|shape| shape.name == self.name);
        let list: Vec<String> = powers
            .iter()
            .filter(|p| period.is_some_and(|shape| shape.derivatives[p.power % 4] != 0.0))
            .map(|p| ordinal(p.power))
            .collect();
        let list = match list.split_last() {
            Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
            _ => list.concat(),
        };
        format!(
            "{part} has the shape of the Taylor polynomial of {:.2} {}({:.2} {variable}): \
             the {list} coefficients agree to {:.0} %",
            self.amplitude,
            self.name,
            self.wave_number,
            (100.0 * self.difference).ceil()
        )
    }
}

/// Largest relative difference from the best polynomial over the range.
const AGREEMENT: f64 = 0.05;
/// A coefficient more uncertain than this fraction of itself says nothing about shape.
const CERTAINTY: f64 = 0.1;
/// A power counts as absent if it contributes less than this fraction at the end of the range.
const ABSENT: f64 = 0.02;

/// The function whose shape the polynomial has on |x| < range, if it is one of [`SHAPES`].
///
/// The constant is ignored: it is free in an energy. `range` in units of x; without one,
/// some usual ranges are tried.
pub fn recognise(powers: &[Power], range: Option<f64>) -> Option<TaylorMatch> {
    let mut best: Option<(f64, TaylorMatch)> = None;
    for shape in SHAPES {
        let tried = match range {
            Some(range) if range > 0.0 && range.is_finite() => vec![range],
            _ => vec![0.3, 0.8, 1.1, 1.4],
        };
        for range in tried {
            let Some((distance, likeness)) = compare(shape, powers, range) else { continue };
            if best.as_ref().is_none_or(|(least, _)| distance < *least) {
                best = Some((distance, likeness));
            }
        }
    }
    best.map(|(_, likeness)| likeness)
}

fn compare(shape: &Shape, powers: &[Power], range: f64) -> Option<(f64, TaylorMatch)> {
    let at_end = |p: &Power| p.value.abs() * range.powi(p.power as i32);
    let largest = powers.iter().map(at_end).fold(0.0, f64::max);
    let (own, other): (Vec<&Power>, Vec<&Power>) =
        powers.iter().filter(|p| p.power > 0).partition(|p| shape.derivatives[p.power % 4] != 0.0);
    let absent =
        |p: &&Power| at_end(p) <= ABSENT * largest || p.value.abs() < 2.0 * p.standard_error;
    if own.len() < shape.fewest || !other.iter().all(absent) {
        return None;
    }
    // The lowest powers of a series must all be there: cos without its square is no cos.
    let highest = own.iter().map(|p| p.power).max()?;
    let expected = (1..=highest).filter(|k| shape.derivatives[k % 4] != 0.0).count();
    let certain = own.iter().all(|p| p.standard_error <= CERTAINTY * p.value.abs());
    if expected != own.len() || !certain || highest > 24 {
        return None;
    }
    let degrees: Vec<usize> = own.iter().map(|p| p.power).collect();
    let (wave_number, fit) = if own.len() == 2 {
        (1.0, distance(shape, &own, &degrees, range, 1.0)?)
    } else {
        // The ratio of the two lowest coefficients gives the wave number to begin with.
        let (a, b) = (own[0], own[1]);
        let step = (b.power - a.power) as f64;
        let ratio = b.value / a.value * taylor(shape, a.power) / taylor(shape, b.power);
        if ratio <= 0.0 && step == 2.0 {
            return None;
        }
        let start = if step == 2.0 { ratio.sqrt() } else { ratio };
        search(shape, &own, &degrees, range, start)?
    };
    let (worst, amplitude) = fit;
    if worst > AGREEMENT {
        return None;
    }
    let difference = own
        .iter()
        .map(|p| {
            let series = amplitude * taylor(shape, p.power) * wave_number.powi(p.power as i32);
            ((p.value - series) / series).abs()
        })
        .fold(0.0, f64::max);
    let likeness = TaylorMatch { name: shape.name, amplitude, wave_number, difference };
    Some((worst, likeness))
}

/// k-th Taylor coefficient.
fn taylor(shape: &Shape, k: usize) -> f64 {
    shape.derivatives[k % 4] / (1..=k).map(|i| i as f64).product::<f64>()
}

/// The wave number near `start` at which the coefficients agree best.
fn search(
    shape: &Shape,
    own: &[&Power],
    degrees: &[usize],
    range: f64,
    start: f64,
) -> Option<(f64, (f64, f64))> {
    let mut best: Option<(f64, (f64, f64))> = None;
    let (mut centre, mut width) = (start, 0.3);
    for _ in 0..4 {
        for k in -8..=8 {
            let wave_number = centre * (1.0 + width * f64::from(k) / 8.0);
            let Some(fit) = distance(shape, own, degrees, range, wave_number) else { continue };
            if best.is_none_or(|(_, least)| fit.0 < least.0) {
                best = Some((wave_number, fit));
            }
        }
        centre = best?.0;
        width /= 6.0;
    }
    best
}

/// (largest relative difference from the best polynomial, amplitude).
fn distance(
    shape: &Shape,
    own: &[&Power],
    degrees: &[usize],
    range: f64,
    wave_number: f64,
) -> Option<(f64, f64)> {
    let target = best_polynomial(shape, degrees, range, wave_number)?;
    // The amplitude that fits best at the end of the range: large contributions count more.
    let weight = |p: &Power| range.powi(2 * p.power as i32);
    let product: f64 = own.iter().zip(&target).map(|(p, t)| weight(p) * p.value * t).sum();
    let square: f64 = own.iter().zip(&target).map(|(p, t)| weight(p) * t * t).sum();
    let amplitude = product / square;
    let ratios = own.iter().zip(&target).map(|(p, t)| t / p.value);
    let worst = ratios.map(|r| (amplitude * r - 1.0).abs()).fold(0.0, f64::max);
    (worst.is_finite() && amplitude.is_finite()).then_some((worst, amplitude))
}

/// Coefficients of the least-squares polynomial in these powers and a constant on |x| < range.
fn best_polynomial(
    shape: &Shape,
    degrees: &[usize],
    range: f64,
    wave_number: f64,
) -> Option<Vec<f64>> {
    const POINTS: usize = 64;
    let columns = degrees.len() + 1;
    let x = |row: usize| (std::f64::consts::PI * (row as f64 + 0.5) / POINTS as f64).cos();
    let matrix = DMatrix::from_fn(POINTS, columns, |row, column| match column {
        0 => 1.0,
        _ => x(row).powi(degrees[column - 1] as i32),
    });
    let values = DVector::from_fn(POINTS, |row, _| (shape.value)(wave_number * range * x(row)));
    let solution = matrix.svd(true, true).solve(&values, 1e-14).ok()?;
    Some(
        degrees
            .iter()
            .enumerate()
            .map(|(i, &degree)| solution[i + 1] / range.powi(degree as i32))
            .collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn powers(list: &[(usize, f64)]) -> Vec<Power> {
        list.iter()
            .map(|&(power, value)| Power { power, value, standard_error: 1e-4 * value.abs() })
            .collect()
    }

    #[test]
    fn the_pendulum_as_a_quintic_is_a_cosine() {
        let found = recognise(&powers(&[(2, 0.998), (4, -0.079)]), Some(1.4));
        let found = found.expect("a cosine");
        assert_eq!(found.name, "cos");
        assert!((found.amplitude + 2.0).abs() < 0.02, "{found:?}");
        assert!((found.wave_number - 1.0).abs() < 1e-12 && found.difference < 0.08);
        assert!(recognise(&powers(&[(2, 0.998), (4, -0.079)]), None).is_some());
    }

    #[test]
    fn every_row_recognises_its_own_best_polynomial() {
        for shape in SHAPES {
            for wave_number in [1.0, 0.8] {
                let degrees: Vec<usize> =
                    (1..=6).filter(|k| shape.derivatives[k % 4] != 0.0).collect();
                let target = best_polynomial(shape, &degrees, 1.2, wave_number).expect("solvable");
                let list: Vec<(usize, f64)> =
                    degrees.iter().zip(&target).map(|(&k, t)| (k, -1.7 * t)).collect();
                let found = recognise(&powers(&list), Some(1.2));
                if degrees.len() < 3 && shape.fewest > 2 {
                    continue;
                }
                let found = found.unwrap_or_else(|| panic!("{} not recognised", shape.name));
                assert_eq!(found.name, shape.name);
                assert!((found.wave_number - wave_number).abs() < 0.02, "{found:?}");
            }
        }
    }

    #[test]
    fn other_polynomials_are_left_alone() {
        for list in [
            vec![(2, 0.5)],
            vec![(2, 0.5), (3, -0.333)],
            vec![(2, 0.5), (4, 0.25)],
            vec![(2, 0.5), (4, -0.25)],
            vec![(4, -0.08), (6, 0.01)],
            vec![(1, 0.3), (2, -0.7), (3, 0.9), (4, 0.2), (5, -0.4)],
            vec![(2, 0.5), (4, -0.3), (6, 0.4)],
        ] {
            assert_eq!(recognise(&powers(&list), Some(1.4)), None, "{list:?}");
        }
        let vague = [
            Power { power: 2, value: 0.998, standard_error: 0.01 },
            Power { power: 4, value: -0.079, standard_error: 0.05 },
        ];
        assert_eq!(recognise(&vague, Some(1.4)), None);
    }
}
