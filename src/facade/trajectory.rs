//! A predicted motion.

use crate::simulate::Trajectories;

/// The motion that a law predicts from a start.
///
/// ```
/// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = q^2/2")?;
/// let motion = spec.known_law()?.predict(&[1.0, 0.0], &[0.0, 0.5, 1.0])?;
/// assert_eq!(motion.names(), ["q", "p"]);
/// assert!((motion.column("q").unwrap()[2] - 1.0_f64.cos()).abs() < 1e-12);
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    names: Vec<String>,
    times: Vec<f64>,
    states: Vec<Vec<f64>>,
    energy_drift: f64,
    method: &'static str,
}

impl Trajectory {
    /// The first of some trajectories.
    pub(super) fn first(names: Vec<String>, of: Trajectories) -> Trajectory {
        Trajectory {
            names,
            times: of.times,
            states: of.states.into_iter().next().unwrap_or_default(),
            energy_drift: of.drift.largest,
            method: of.integration.method,
        }
    }

    /// The same at some of its times alone.
    pub(super) fn at(mut self, wanted: &[usize]) -> Trajectory {
        self.times = wanted.iter().filter_map(|&at| self.times.get(at).copied()).collect();
        self.states = wanted.iter().filter_map(|&at| self.states.get(at).cloned()).collect();
        self
    }

    /// Names of the components of the state: coordinates, then momenta.
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = q^2/2")?;
    /// let motion = spec.known_law()?.predict(&[1.0, 0.0], &[0.0, 0.5])?;
    /// assert_eq!(motion.names(), ["q", "p"]);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The times that were asked for, in the spec's unit.
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = q^2/2")?;
    /// let motion = spec.known_law()?.predict(&[1.0, 0.0], &[0.0, 0.5])?;
    /// assert_eq!(motion.times(), [0.0, 0.5]);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The state at each time, in the order of [`Trajectory::names`] and the spec's units.
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = q^2/2")?;
    /// let motion = spec.known_law()?.predict(&[1.0, 0.0], &[0.0, 0.5])?;
    /// assert_eq!(motion.states()[0], [1.0, 0.0]);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn states(&self) -> &[Vec<f64>] {
        &self.states
    }

    /// One component of the state at each time; `None` where there is none of that name.
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = q^2/2")?;
    /// let motion = spec.known_law()?.predict(&[1.0, 0.0], &[0.0, 0.5])?;
    /// assert!((motion.column("p").unwrap()[1] + 0.5_f64.sin()).abs() < 1e-12);
    /// assert_eq!(motion.column("z"), None);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn column(&self, name: &str) -> Option<Vec<f64>> {
        let at = self.names.iter().position(|own| own == name)?;
        Some(self.states.iter().filter_map(|state| state.get(at).copied()).collect())
    }

    /// Largest |H(t) - H(0)|, in the unit of energy. Where no force takes or brings energy, it
    /// shows how exact the integration is.
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = q^2/2")?;
    /// let motion = spec.known_law()?.predict(&[1.0, 0.0], &[0.0, 100.0])?;
    /// assert!(motion.energy_drift() < 1e-11);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn energy_drift(&self) -> f64 {
        self.energy_drift
    }

    /// Name of the integrator that was chosen.
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = q^2/2")?;
    /// let motion = spec.known_law()?.predict(&[1.0, 0.0], &[0.0, 0.5])?;
    /// assert!(!motion.method().is_empty());
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn method(&self) -> &'static str {
        self.method
    }
}
