//! A law on the measurements that it was learned from, and on others.

use super::{Comparison, compare};
use crate::data::Dataset;
use crate::diagnose::Options;
use crate::diagnose::instrument::{Detection, detect};
use crate::diagnose::law_on_data::{LawOnData, Measurements};
use crate::diagnose::noise_floor::noise_floor;
use crate::error::{Error, ErrorKind, Result};
use crate::fit::Law;

/// A law on the measurements that it was learned from, and on others.
pub struct Compared<'a> {
    /// The law on the measurements that it was learned from.
    pub training: LawOnData<'a>,
    /// The same on others, where there are some.
    pub held_out: Option<LawOnData<'a>>,
    /// Faults of the instrument among its findings.
    pub comparison: Comparison,
    /// Faults of the instrument in the training part.
    pub detections: Vec<Detection>,
}

impl<'a> Compared<'a> {
    /// Compares in units of the noise of every observable, which is measured where it is not given:
    /// a model that fails takes a part of what it lacks for noise; the floor is the instrument's.
    ///
    /// # Errors
    ///
    /// [`ErrorKind::InvalidArgument`] where the noise is none of these observables, or a number of
    /// the options is none that a comparison can go by.
    pub fn new(
        law: Law,
        training: &'a Dataset,
        held_out: Option<&'a Dataset>,
        options: &'a Options,
        noise: Option<&[f64]>,
    ) -> Result<Compared<'a>> {
        let training = LawOnData::of(law, training, options);
        let detections = detect(&training);
        let training = match noise {
            Some(noise) => {
                let observables = training.data.dataset.observables.len();
                if noise.len() != observables || !noise.iter().all(|x| *x > 0.0) {
                    return Err(Error::new(
                        ErrorKind::InvalidArgument,
                        format!("{} numbers are no noise of these observables", noise.len()),
                        "give a standard deviation above zero for each",
                    ));
                }
                training.with_noise(noise.to_vec())
            }
            None => training.with_noise(noise_floor(&training)),
        };
        let held_out = held_out.map(|data| training.with_data(&Measurements::of(data, options)));
        let mut comparison = compare(&training, held_out.as_ref())?;
        comparison.findings.extend(detections.iter().map(|found| found.sentence.clone()));
        Ok(Compared { training, held_out, comparison, detections })
    }
}
