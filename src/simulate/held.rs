//! That motions which are held to a constraint start where it holds.

use super::trajectory::Simulator;
use crate::error::{Error, ErrorKind, Result};
use crate::expr::{Expr, ParameterId, Symbol};

/// A start may be off by this part of the coordinates: as measured, not as a mistake.
const OFF: f64 = 0.1;

impl Simulator<'_> {
    /// Refuses starts that are far from a constraint of the system: a motion keeps to whatever
    /// surface it starts on.
    pub(super) fn require_held(&self, starts: &[Vec<f64>]) -> Result<()> {
        let mut graph = self.system.graph.clone();
        let state = self.system.state();
        for constraint in &self.system.constraints {
            let slopes = graph.gradient(constraint.expr, &state);
            for start in starts {
                let value = |expr: Expr| graph.value(expr, &|symbol| self.at(start, symbol));
                let off = value(constraint.expr).abs();
                let size: f64 = slopes.iter().zip(start).map(|(&s, q)| (value(s) * q).abs()).sum();
                if off <= OFF * size || start.iter().any(|q| !q.is_finite()) {
                    continue;
                }
                return Err(Error::new(
                    ErrorKind::InvalidArgument,
                    format!(
                        "a motion is to start where the constraint `{}` does not hold: its sides \
                         differ by {off}",
                        constraint.label
                    ),
                    "give a start that satisfies it",
                ));
            }
        }
        Ok(())
    }

    /// What a constraint sees of a start: coordinates and inner parameters.
    fn at(&self, start: &[f64], symbol: Symbol) -> f64 {
        match symbol {
            Symbol::Coordinate(i) => start.get(i).copied().unwrap_or(f64::NAN),
            Symbol::Parameter(j) => {
                let position = |id: &ParameterId| id.position() == j;
                let at = self.dynamics.parameters().iter().position(position);
                let at = at.map(|at| self.dynamics.active().len() + at);
                at.and_then(|at| self.theta.get(at)).copied().unwrap_or(f64::NAN)
            }
            _ => f64::NAN,
        }
    }
}
