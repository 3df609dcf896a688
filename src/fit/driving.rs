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

/// Sets the inputs of each lane from where it stands to the next sample; a lane without a place
/// keeps what it has.
pub fn drive(batch: &mut Batch, measured: &Packed, places: impl Iterator<Item = Option<Standing>>) {
    let (inputs, powers) = measured.driven();
    if inputs == 0 {
        return;
    }
    if batch.drive == Drive::default() {
        batch.drive = Drive::new(inputs, powers, batch.lanes);
    }
    let mut coefficients = vec![0.0; powers];
    for (lane, place) in places.enumerate() {
        let Some(Standing { run, sample, ends }) = place else { continue };
        for input in 0..inputs {
            measured.driving(input, run, sample, ends, &mut coefficients);
            batch.drive.set(input, lane, &coefficients);
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
