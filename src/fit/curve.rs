//! First guesses of coordinates that no column holds: the curve whose measures come nearest to what
//! was measured.
//!
//! No law is known yet. A measure of positions is inverted sample by sample, each from where the
//! one before it was going. Then the values of all coordinates at all samples are found together,
//! by least squares: rates are differences of neighbouring samples, so that the normal equations
//! are banded. What the measures leave open, such as the constants of an acceleration that is
//! integrated twice, comes out as small as it can.

use rayon::prelude::*;

use super::inversion::Curve;
use super::law::Law;
use super::scales::ObservableScale;
use super::shown::Shown;
use super::tuning::SegmentTuning;
use crate::data::Packed;
use crate::error::{Error, ErrorKind, Result};
use crate::expr::{System, unseen};

/// Samples of a curve that are found together, at most: a longer run is a curve after the other.
const TOGETHER: usize = 4096;

/// Guesses coordinates that no column holds, where there are measures to tell them; once for all
/// measurements.
pub(super) fn guess(law: &Law, packed: &Packed) {
    let system = law.system();
    if !system.measures.is_empty() {
        packed.guess(|| guesses(system, law.parameters(), packed));
    }
}

fn guesses(system: &System, parameters: &[f64], packed: &Packed) -> Vec<Vec<f64>> {
    let n = system.degrees();
    let measured = |row: usize| packed.column(row).iter().any(|x| x.is_finite());
    let wanted = |i: usize| !measured(i) && !system.is_hidden(i);
    if !(0..n).any(wanted) {
        return Vec::new();
    }
    let Some(shown) = Shown::of(system, parameters, packed) else { return Vec::new() };
    let hole = SegmentTuning::default().hole * packed.typical_step();
    let runs: Vec<Vec<f64>> =
        (0..packed.runs()).into_par_iter().map(|run| of_run(&shown, packed, run, hole)).collect();
    let column = |i: usize| {
        let of = |curve: &Vec<f64>| curve.iter().skip(i).step_by(n).copied().collect();
        let values: Vec<Vec<f64>> = runs.iter().map(of).collect();
        packed.column_of(values.iter().map(Vec::as_slice))
    };
    (0..n).map(|i| if wanted(i) { column(i) } else { Vec::new() }).collect()
}

/// The coordinates at every sample of a run, `[sample][coordinate]`.
fn of_run(shown: &Shown, packed: &Packed, run: usize, hole: f64) -> Vec<f64> {
    let times = packed.times_of(run);
    let mut out: Vec<f64> = Vec::with_capacity(times.len() * shown.degrees());
    let mut first = 0;
    while first < times.len() {
        let mut end = first + 1;
        while end < times.len() && end - first < TOGETHER && times[end] - times[end - 1] <= hole {
            end += 1;
        }
        // Two samples that are left over belong to those before them.
        if times.len() - end < 3 && end < times.len() && times[end] - times[end - 1] <= hole {
            end = times.len();
        }
        let n = shown.degrees();
        let before = out.len().checked_sub(n).map(|at| out[at..].to_vec());
        let curve = Curve::new(shown, packed, run, first..end);
        out.extend(curve.found(before.as_deref()));
        first = end;
    }
    out
}

/// That every coordinate acts on something that is measured.
pub(super) fn identifiable(system: &System, scales: &[ObservableScale]) -> Result<()> {
    let measured = |row: usize| scales.get(row).is_some_and(|scale| scale.spread.is_some());
    let silent = unseen(system, measured);
    let hidden = |i: &usize| !system.is_hidden(*i);
    let Some(variable) = silent.into_iter().find(hidden).map(|i| &system.coordinates[i]) else {
        return Ok(());
    };
    Err(Error::new(
        ErrorKind::NotIdentifiable,
        format!("nothing that is measured depends on `{}`", variable.name),
        "name its column in the data block, or say with `measure` what a column shows of it",
    ))
}
