//! How clearly an effect is there: its numbers beside their standard errors.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::effect::RankedEffect;
use crate::expr::{System, TermId};

/// How far the least clear coefficient of an effect is from zero (Wald's test).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Clearness {
    /// Coefficients over standard errors, squared and summed.
    squares: f64,
    /// How many coefficients these are: the cosine and the sine of one wave are its amplitude and
    /// its phase, and clear together.
    degrees: usize,
}

impl Clearness {
    /// That of an effect whose coefficients are those of these terms. An effect without
    /// coefficients is clear.
    pub(super) fn of(effect: &RankedEffect, terms: &[TermId], system: &System) -> Clearness {
        let wave = |id: TermId| {
            let name = system.term(id).and_then(|term| term.name.as_deref()).unwrap_or("");
            name.strip_suffix("_cos").or_else(|| name.strip_suffix("_sin")).map(str::to_string)
        };
        let mut all: Vec<(Option<String>, Clearness)> = Vec::new();
        // A known number is a change where it is clearly not what the spec says.
        if let Some(change) = &effect.number {
            let both = effect.coefficient.last().zip(effect.standard_error.last());
            let off = both.map_or(0.0, |(value, error)| (value - change.was) / error);
            all.push((None, Clearness { squares: off.powi(2), degrees: 1 }));
        }
        let numbers = effect.coefficient.iter().zip(&effect.standard_error);
        for (&id, (value, error)) in terms.iter().zip(numbers) {
            let squares = (value / error).powi(2);
            let wave = wave(id);
            match all.iter_mut().find(|(of, _)| wave.is_some() && *of == wave) {
                Some((_, sum)) => {
                    sum.squares += squares;
                    sum.degrees += 1;
                }
                None => all.push((wave, Clearness { squares, degrees: 1 })),
            }
        }
        // What is no number is not clear.
        let all = all.into_iter().map(|(_, one)| Clearness {
            squares: if one.squares.is_nan() { 0.0 } else { one.squares },
            ..one
        });
        let least = all.min_by(|a, b| a.squares.total_cmp(&b.squares));
        least.unwrap_or(Clearness { squares: f64::INFINITY, degrees: 1 })
    }

    pub(super) fn standard_errors(self) -> f64 {
        self.squares.sqrt()
    }

    /// The probability that noise alone makes the coefficients as large, where so many effects
    /// were tried.
    pub(super) fn p_value(self, tests: f64) -> f64 {
        let chi = ChiSquared::new(self.degrees as f64);
        let alone = chi.map_or(1.0, |chi| chi.sf(self.squares));
        (alone * tests).min(1.0)
    }
}
