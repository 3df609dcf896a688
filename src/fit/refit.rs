//! The numbers of a law fitted again, its terms as they are: nothing is searched.

use std::sync::Arc;

use super::gauss_newton::LeastGain;
use super::law::Law;
use super::monitor::Monitor;
use super::options::Options;
use super::pass::Linearised;
use super::segments::Segments;
use super::states::States;
use super::stepping::{Aim, PART_OF_MISFIT};
use super::train::Training;
use super::tuning::Tuning;
use crate::data::Packed;
use crate::error::{Error, Result};

/// How the numbers of a law are fitted again.
#[derive(Clone, Copy)]
pub struct Refitting<'a> {
    /// Segments, with states that they start from; `None` for those of the law's window, as they
    /// were measured.
    pub start: Option<(&'a Segments, &'a States)>,
    /// By what trajectories are integrated.
    pub integrator: Integrator,
    /// The fit ends when a step promises less.
    pub least: LeastGain,
    /// The numbers that it goes by.
    pub tuning: &'a Tuning,
    /// Asked whether to stop with the best so far.
    pub monitor: &'a dyn Monitor,
}

/// By what trajectories are integrated in a refit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Integrator {
    /// By that of the law.
    Kept,
    /// By one that is accurate enough for the law's noise, or for what the law leaves where that is
    /// so many times as large.
    Chosen(f64),
}

/// A law that leaves less than this part of what its integrator was chosen for is fitted further by
/// a finer one.
const FALLEN: f64 = 0.1;

/// A law whose numbers were fitted together.
pub struct Refitted {
    /// Its noise is what this fit leaves; its covariance is not known.
    pub law: Law,
    /// The problem linearised at its numbers: the columns of its coefficients, then those of the
    /// inner parameters in use.
    pub linearised: Linearised,
    /// What the integrator and the digits of the data resolve of each observable.
    pub resolution: Vec<f64>,
}

/// Fits all numbers of a law to measurements, by Gauss-Newton from where they are.
///
/// # Errors
///
/// When no coordinate is measured, or no two samples are near enough in time; when it is to stop at
/// once.
pub fn refitted(law: &Law, measured: &Arc<Packed>, how: Refitting) -> Result<Refitted> {
    if how.monitor.halted() {
        return Err(Error::Interrupted);
    }
    let tuning = how.tuning.clone();
    let options = Options { window: Some(law.window()), tuning, ..Options::default() };
    let mut training = Training::from_law(law, measured.clone(), &options)?;
    if let Some((segments, states)) = how.start {
        training.segments.clone_from(segments);
        training.states.clone_from(states);
    }
    let mut misfit = match how.integrator {
        Integrator::Kept => None,
        Integrator::Chosen(times) => Some(times),
    };
    // Each integrator is chosen as if it were the first.
    let accuracy = training.accuracy.clone();
    loop {
        if let Some(times) = misfit {
            training.accuracy.clone_from(&accuracy);
            training.choose_integrator(Aim::Misfit(times));
        }
        let mut refit = training.refit_until(how.least, how.monitor);
        let sums = refit.sums();
        let left = (sums.loss / sums.rows.max(1) as f64).sqrt();
        training.take(&mut refit);
        let is_coarse = |times: f64| left < FALLEN * times && PART_OF_MISFIT * times > 1.0;
        if misfit.is_some_and(is_coarse) && !how.monitor.stopped() {
            misfit = Some(left);
            training.law.set_noise(law.noise().to_vec());
            continue;
        }
        let resolution = training.accuracy.resolution.clone();
        let mut refitted = training.law().clone();
        if misfit.is_some_and(|times| PART_OF_MISFIT * times > 1.0) {
            // What it leaves of other data is not to be what its steps do.
            training.law.set_noise(law.noise().to_vec());
            training.accuracy = accuracy;
            training.choose_integrator(Aim::Round);
            refitted.set_stepping(training.law().stepping());
        }
        return Ok(Refitted { law: refitted, linearised: refit.linearised, resolution });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Dataset;
    use crate::expr::{System, build};
    use crate::fit::monitor::Silent;
    use crate::fit::segments::packed;
    use crate::simulate::Simulator;

    const NOISE: f64 = 1e-9;

    fn system(potential: &str) -> Arc<System> {
        let text = format!("coordinates q\nmomenta p\nT = p^2/2\nV = {potential}\n");
        build("law", &text).expect("a spec").system
    }

    /// Two runs of a law in which everything is known, to all digits.
    fn computed(potential: &str) -> Dataset {
        let system = system(potential);
        let simulator = Simulator::new(&system, &[], &[], &[]).expect("a law");
        let times: Vec<f64> = (0..64).map(|i| 0.1 * f64::from(i)).collect();
        let starts = [vec![1.2, 0.1], vec![-0.4, 0.9]];
        simulator.trajectories(&starts, &times).expect("a motion").dataset(&system)
    }

    /// A law of the square and the fourth power, with wrong numbers, fitted by steps that are
    /// chosen for so many times the noise.
    fn fitted(data: &Dataset, times: f64) -> Refitted {
        let free = system("span{ q^2, q^4 }");
        let known = Law::known(system("q^2")).expect("a law");
        let ids = free.term_ids();
        let terms = vec![(ids[0], 0.3), (ids[1], 0.1)];
        let how = (known.stepping(), 16);
        let law = Law::new(free, terms, Vec::new(), vec![NOISE; 2], how).expect("a law");
        let tuning = Tuning::default();
        let measured = Arc::new(packed(data, &Options::default().tuning.segments));
        let how = Refitting {
            start: None,
            integrator: Integrator::Chosen(times),
            least: tuning.refit.converged.into(),
            tuning: &tuning,
            monitor: &Silent,
        };
        refitted(&law, &measured, how).expect("a fit")
    }

    /// How many times the noise a law leaves.
    fn left(fitted: &Refitted) -> f64 {
        let sums = &fitted.linearised.sums;
        (sums.loss / sums.rows as f64).sqrt()
    }

    #[test]
    fn steps_get_finer_as_a_law_leaves_less() {
        let data = computed("q^2/2 + q^4/4");
        // The first guess leaves about a hundredth of the motion: ten million times the noise.
        let found = fitted(&data, 1e7);
        assert!(left(&found) < 10.0, "{}", left(&found));
        assert!((found.law.coefficients()[0] - 0.5).abs() < 1e-8, "{:?}", found.law.coefficients());
        assert!((found.law.coefficients()[1] - 0.25).abs() < 1e-8);
    }

    #[test]
    fn coarse_steps_find_what_fine_ones_find_where_a_law_is_wrong() {
        let data = computed("q^2/2 + q^4/4 - q^3/5");
        let fine = fitted(&data, 1.0);
        let (times, sizes) = (left(&fine), fine.law.coefficients());
        assert!(times > 1e5, "{times}");
        let coarse = fitted(&data, times);
        assert!((left(&coarse) / times - 1.0).abs() < 1e-3, "{} {times}", left(&coarse));
        for (coarse, fine) in coarse.law.coefficients().iter().zip(sizes) {
            assert!((coarse / fine - 1.0).abs() < 1e-2, "{coarse} {fine}");
        }
        // What it leaves of other data is as exact as the noise asks for, all the same.
        assert!(coarse.law.stepping().longest <= 2.0 * fine.law.stepping().longest);
    }
}
