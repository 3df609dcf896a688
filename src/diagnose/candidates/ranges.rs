//! How far the inner numbers of a candidate may go in a fit. Beyond the grid that is looked through
//! the data say nothing of them: a drag whose exponent runs to -300 is another curve under its
//! name.

use super::{Candidate, Origin};
use crate::diagnose::tuning::Ranking;
use crate::expr::Bounds;
use crate::spec::effects::ScanBy;

/// Allowed values of an inner number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InnerRange {
    /// Free where the grid has one point only: a start of the user's is no grid.
    pub bounds: Bounds,
    /// Whether the effect stands in for a simpler one at an end of it (a decay that takes for ever
    /// is a constant).
    ends_in_another: bool,
}

impl InnerRange {
    /// Whether a value is at an end, to a `part` of its length, where the effect is another.
    pub fn is_at_its_end(&self, value: f64, part: f64) -> bool {
        let Bounds { lower, upper } = self.bounds;
        let close = part * (upper - lower);
        self.ends_in_another && (value - lower <= close || upper - value <= close)
    }
}

impl Candidate {
    /// The range of each inner number: it may leave the grid by a part of its length, but for
    /// places and instants, which are looked for where there are data, and for waves, of which the
    /// data show half a length or more.
    pub fn ranges(&self, tuning: &Ranking) -> Vec<InnerRange> {
        let range = |place: usize| {
            let axis = self.grid.iter().filter_map(|values| values.get(place));
            let (lower, upper) =
                axis.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
            let by = match &self.origin {
                Origin::Catalogue(row) => row.parameters.get(place).map(|scan| scan.by),
                _ => None,
            };
            let inside = by.is_some_and(ScanBy::is_seen_inside_only);
            let part = tuning.beyond_grid;
            let margin = if inside { 0.0 } else { part * (upper - lower) };
            let smallest = if lower > 0.0 && !inside { part * lower } else { lower - margin };
            match lower < upper {
                true => InnerRange {
                    bounds: Bounds { lower: smallest, upper: upper + margin },
                    ends_in_another: by.is_some_and(ScanBy::ends_in_another),
                },
                false => InnerRange { bounds: Bounds::FREE, ends_in_another: false },
            }
        };
        (0..self.parameters.len()).map(range).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::InnerRange;
    use crate::expr::Bounds;

    #[test]
    fn only_what_becomes_another_effect_has_an_end() {
        let range = |bounds, ends_in_another| InnerRange { bounds, ends_in_another };
        let bounds = Bounds { lower: 0.5, upper: 4.5 };
        for (value, at_end) in [(0.5, true), (1.0, false), (4.499_999, true), (4.4, false)] {
            assert_eq!(range(bounds, true).is_at_its_end(value, 1e-6), at_end, "{value}");
            assert!(!range(bounds, false).is_at_its_end(value, 1e-6));
        }
        assert!(!range(Bounds::FREE, false).is_at_its_end(1e300, 1e-6));
    }
}
