//! What inputs do in the next interval of each of some trajectories.

use crate::data::Packed;
use crate::dynamics::{Batch, Drive};

/// Where a trajectory stands: a sample of a run, and whether it is followed no further.
#[derive(Debug, Clone, Copy)]
pub struct Standing {
    /// Index of the run.
    pub run: usize,
    /// Index of the sample.
    pub sample: usize,
    /// Whether the trajectory ends there.
    pub ends: bool,
}

/// What runs have for themselves, as inputs that never change: they stand behind the measured ones.
#[derive(Debug, Clone, Copy, Default)]
pub struct OwnInputs<'a> {
    /// How many every run has.
    pub count: usize,
    /// `[run][number]`: what theta's number is less than the run's own.
    pub values: &'a [f64],
}

impl<'a> OwnInputs<'a> {
    /// Those of a run.
    pub fn of(&self, run: usize) -> &'a [f64] {
        self.values.get(run * self.count..(run + 1) * self.count).unwrap_or_default()
    }

    /// Inputs and coefficients of each, beside those of the measured ones.
    pub fn beside(&self, (inputs, powers): (usize, usize)) -> (usize, usize) {
        (inputs + self.count, if self.count > 0 { powers.max(1) } else { powers })
    }
}

/// Sets the inputs of each lane from where it stands to the next sample; a lane without a place
/// keeps what it has.
pub fn drive(batch: &mut Batch, measured: &Packed, places: impl Iterator<Item = Option<Standing>>) {
    drive_each(batch, (measured, OwnInputs::default()), places);
}

/// The same, with what runs have for themselves.
pub fn drive_each(
    batch: &mut Batch,
    (measured, own): (&Packed, OwnInputs),
    places: impl Iterator<Item = Option<Standing>>,
) {
    let inputs = measured.driven().0;
    let (all, powers) = own.beside(measured.driven());
    if all == 0 {
        return;
    }
    if batch.drive == Drive::default() {
        batch.drive = Drive::new(all, powers, batch.lanes);
    }
    let mut coefficients = vec![0.0; powers];
    for (lane, place) in places.enumerate() {
        let Some(Standing { run, sample, ends }) = place else { continue };
        let time = measured.times_of(run).get(sample).copied().unwrap_or(f64::NAN);
        batch.drive.stand(measured.record(), lane, run, time);
        for input in 0..inputs {
            measured.driving(input, run, sample, ends, &mut coefficients);
            batch.drive.set(input, lane, &coefficients);
        }
        for (input, value) in (inputs..).zip(own.of(run)) {
            batch.drive.set(input, lane, &[*value]);
        }
    }
}

/// Where a segment stands at a sample counted from its first; none where it is over.
pub fn at(segment: super::segments::Segment, sample: usize) -> Option<Standing> {
    let place = Standing {
        run: segment.run,
        sample: segment.first + sample,
        ends: segment.first + sample == segment.last,
    };
    (place.sample <= segment.last).then_some(place)
}
