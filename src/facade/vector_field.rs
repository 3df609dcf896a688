//! The equations of motion as a function.

use super::Law;
use crate::dynamics::{Batch, Dynamics, Scratch};
use crate::error::{Error, ErrorKind, Result};

/// The equations of motion of a law, compiled: rates of change of a state, and its energy. For
/// integrators of others.
///
/// ```
/// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = q^2/2")?;
/// let field = spec.known_law()?.vector_field();
/// assert_eq!(field.rates(0.0, &[1.0, 0.5])?, [0.5, -1.0]);
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug)]
pub struct VectorField {
    dynamics: Dynamics,
    theta: Vec<f64>,
}

impl Law {
    /// The equations of motion as a function of time and state; measured inputs are at rest in it.
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = cos(q)")?;
    /// let field = spec.known_law()?.vector_field();
    /// assert_eq!(field.rates(0.0, &[0.0, 2.0])?, [2.0, 0.0]);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn vector_field(&self) -> VectorField {
        let dynamics = self.numbers().dynamics();
        let theta = self.numbers().theta(&dynamics);
        VectorField { dynamics, theta }
    }
}

impl VectorField {
    /// dq/dt of every coordinate, then dp/dt of every momentum, at a time and a state. Several
    /// states, one after the other, give their rates one after the other.
    ///
    /// # Errors
    /// The numbers are not those of whole states
    /// ([`ErrorKind::InvalidArgument`]).
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = q^2/2")?;
    /// let field = spec.known_law()?.vector_field();
    /// assert_eq!(field.rates(0.0, &[1.0, 0.5, 2.0, 0.0])?, [0.5, -1.0, 0.0, -2.0]);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn rates(&self, time: f64, states: &[f64]) -> Result<Vec<f64>> {
        let (batch, count) = self.batch(time, states)?;
        let mut rates = vec![0.0; states.len()];
        self.dynamics.field_at(&batch, &self.theta, &mut rates, &mut Scratch::new());
        let rows = rates.chunks_exact(count.max(1));
        let mut out = vec![0.0; states.len()];
        for (row, values) in rows.enumerate() {
            for (of_state, value) in out.chunks_exact_mut(2 * self.dynamics.degrees()).zip(values) {
                if let Some(place) = of_state.get_mut(row) {
                    *place = *value;
                }
            }
        }
        Ok(out)
    }

    /// H at a time and a state; of several states, one after the other.
    ///
    /// # Errors
    /// As [`VectorField::rates`].
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = q^2/2")?;
    /// let field = spec.known_law()?.vector_field();
    /// assert_eq!(field.energies(0.0, &[1.0, 0.0, 2.0, 2.0])?, [0.5, 4.0]);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn energies(&self, time: f64, states: &[f64]) -> Result<Vec<f64>> {
        let (batch, count) = self.batch(time, states)?;
        let mut out = vec![0.0; count];
        self.dynamics.energy(&batch, &self.theta, &mut out, &mut Scratch::new());
        Ok(out)
    }

    fn batch(&self, time: f64, states: &[f64]) -> Result<(Batch, usize)> {
        let size = 2 * self.dynamics.degrees();
        if states.is_empty() || !states.len().is_multiple_of(size) {
            return Err(Error::new(
                ErrorKind::InvalidArgument,
                format!("{} numbers are no states of this system", states.len()),
                format!("give {size} for each: coordinates, then momenta"),
            ));
        }
        let count = states.len() / size;
        let mut batch = Batch::new(self.dynamics.degrees(), count);
        for (lane, state) in states.chunks_exact(size).enumerate() {
            batch.set(lane, time, state);
        }
        Ok((batch, count))
    }
}
