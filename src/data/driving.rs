//! The inputs of a data set: taken from among its columns, complete, and ready to be followed
//! between their samples.

use super::header::counted;
use super::mapping::{InputMap, Mapping};
use super::table::Table;
use super::{Dataset, Interpolation, MeasuredInput, Run, typical_step};
use crate::error::Result;

/// An input is not interpolated over more than so many of the usual steps: what it did there is
/// not known.
const GAP: f64 = 8.0;
/// Steps between the samples of a band-limited signal may differ by this part of one.
const UNEVEN: f64 = 1e-3;

/// The longest step that an input is interpolated over, of some runs.
pub(super) fn gap<'a>(times: impl IntoIterator<Item = &'a [f64]>) -> f64 {
    GAP * typical_step(times.into_iter())
}

/// Takes the inputs, which stand behind the observables, out of the values of every run.
///
/// # Errors
/// An input has no value at a sample, is shorter than its run, or cannot be followed between its
/// samples as the spec says.
pub(super) fn take_inputs(data: &mut Dataset, table: &Table, mapping: &Mapping) -> Result<()> {
    if mapping.inputs.is_empty() {
        return Ok(());
    }
    let gap = gap(data.runs.iter().map(|run| run.times.as_slice()));
    for run in &mut data.runs {
        for (input, values) in
            mapping.inputs.iter().zip(run.values.split_off(mapping.observables.len()))
        {
            complete(run, input, &values, table)?;
            if input.between == Interpolation::BandLimited {
                even(run, input, gap, table)?;
            }
            run.inputs.extend(input.between.derivatives(&run.times, &values, gap));
        }
    }
    data.inputs = mapping.inputs.iter().map(InputMap::measured).collect();
    Ok(())
}

/// That an input has a value at every sample of a run.
fn complete(run: &Run, input: &InputMap, values: &[f64], table: &Table) -> Result<()> {
    let Some(first) = values.iter().position(|x| x.is_nan()) else { return Ok(()) };
    let name = &input.column.name;
    let line = |at: usize| run.lines.get(at).copied();
    let column = input.column.columns.first().map(String::as_str);
    let (place, rest) = (table.reading.noun(), values.get(first..).unwrap_or_default());
    let (message, hint) = if rest.iter().all(|x| x.is_nan()) && first > 0 {
        let last = line(first - 1).unwrap_or(0);
        (
            format!(
                "the input `{name}` ends at {place} {last}, but run {} goes on for {}",
                run.name,
                counted(rest.len(), "sample")
            ),
            "the motion cannot be followed without its input: remove these rows, or complete them",
        )
    } else {
        (
            format!("the input `{name}` has no value here"),
            "give it in every row; where it was not recorded, give its samples runs of their own",
        )
    };
    Err(table.error(line(first), column, message, hint))
}

/// That the samples of a run are evenly spaced, but for gaps.
fn even(run: &Run, input: &InputMap, gap: f64, table: &Table) -> Result<()> {
    let steps = run.times.array_windows().map(|[a, b]| b - a).enumerate();
    let near: Vec<(usize, f64)> = steps.filter(|(_, step)| *step <= gap).collect();
    let mean = near.iter().map(|(_, step)| step).sum::<f64>() / near.len().max(1) as f64;
    let uneven = near.iter().find(|(_, step)| (step - mean).abs() > UNEVEN * mean);
    let Some((at, step)) = uneven else { return Ok(()) };
    let name = &input.column.name;
    Err(table.error(
        run.lines.get(at + 1).copied(),
        None,
        format!(
            "the input `{name}` is band-limited, but its samples are not evenly spaced: {step:.6} \
             here, {mean:.6} on average"
        ),
        "say `spline` or `linear` in the spec",
    ))
}

/// Says where inputs were not recorded for long.
pub(super) fn about_gaps(data: &Dataset, table: &Table) -> Option<String> {
    let jumps = |input: &MeasuredInput| input.between == Interpolation::Hold;
    if data.inputs.iter().all(jumps) {
        return None;
    }
    let gap = gap(data.runs.iter().map(|run| run.times.as_slice()));
    let in_run = |run: &'_ Run| {
        let far = run.times.array_windows().zip(1..).filter(|([a, b], _)| b - a > gap);
        far.filter_map(|(_, at): (_, usize)| run.lines.get(at).copied()).collect::<Vec<u64>>()
    };
    let lines: Vec<u64> = data.runs.iter().flat_map(in_run).collect();
    let first = lines.first()?;
    let names: Vec<&str> = data.inputs.iter().map(|input| input.name.as_str()).collect();
    Some(format!(
        "{} longer than {GAP} samples in what drives the motion ({}): nothing is known of it there; \
         the first ends at {} {first}.",
        counted(lines.len(), "gap"),
        names.join(", "),
        table.reading.noun()
    ))
}
