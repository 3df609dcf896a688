//! Standard errors that a file holds beside its values.

use super::mapping::{ColumnMap, Mapping, missing_column};
use super::table::{Column, Table};
use super::{Dataset, Run};
use crate::error::Result;

/// The columns of all standard errors, in the order of their observables.
///
/// # Errors
/// A column does not exist.
pub(super) fn columns<'t, 'm>(
    table: &'t Table,
    mapping: &'m Mapping,
) -> Result<Vec<(&'t Column, &'m ColumnMap)>> {
    let mut found = Vec::new();
    for observable in &mapping.observables {
        let Some(map) = &observable.error else { continue };
        let what = format!("the standard error of {}", observable.name);
        let column = table.find(&map.column)?;
        found.push((column.ok_or_else(|| missing_column(table, &map.column, &what))?, map));
    }
    Ok(found)
}

/// Takes the standard errors, which stand behind the observables and the inputs, out of the values
/// of every run.
///
/// # Errors
/// A value has no standard error, or one that is not above zero.
pub(super) fn take_errors(data: &mut Dataset, table: &Table, mapping: &Mapping) -> Result<()> {
    let all = mapping.observables.iter().enumerate();
    let maps: Vec<(usize, &ColumnMap)> =
        all.filter_map(|(at, one)| Some((at, one.error.as_ref()?))).collect();
    if maps.is_empty() {
        return Ok(());
    }
    let first = mapping.observables.len() + mapping.inputs.len();
    for run in &mut data.runs {
        let columns = run.values.split_off(first);
        run.errors = vec![Vec::new(); mapping.observables.len()];
        for ((at, map), errors) in maps.iter().zip(columns) {
            each_is_sound(run, (*at, map), &errors, table)?;
            if let Some(place) = run.errors.get_mut(*at) {
                *place = errors;
            }
        }
    }
    Ok(())
}

/// That every value of an observable has a standard error above zero.
fn each_is_sound(
    run: &Run,
    (observable, map): (usize, &ColumnMap),
    errors: &[f64],
    table: &Table,
) -> Result<()> {
    let Some(values) = run.values.get(observable) else { return Ok(()) };
    let unsound =
        |(value, error): (&f64, &f64)| value.is_finite() && !(error.is_finite() && *error > 0.0);
    let Some(at) = values.iter().zip(errors).position(unsound) else { return Ok(()) };
    let (message, hint) = if errors.get(at).is_none_or(|error| error.is_nan()) {
        (
            "a value has no standard error here".to_string(),
            "give one beside every value, or leave the value empty",
        )
    } else {
        (
            "a standard error has to be above zero".to_string(),
            "an error of zero says that nothing can be wrong; give the one that the instrument has",
        )
    };
    Err(table.error(run.lines.get(at).copied(), Some(map.column.as_str()), message, hint))
}

/// Standard errors as parts of the middle one of all that their observable has: what a noise says
/// is then that of the middle value.
pub(crate) fn as_parts_of_the_middle(data: &mut Dataset) {
    for observable in 0..data.observables.len() {
        let of = |run: &Run| run.errors.get(observable).cloned().unwrap_or_default();
        let mut all: Vec<f64> =
            data.runs.iter().flat_map(of).filter(|error| error.is_finite()).collect();
        if all.is_empty() {
            continue;
        }
        let middle = all.len() / 2;
        let middle = *all.select_nth_unstable_by(middle, f64::total_cmp).1;
        let own = data.runs.iter_mut().filter_map(|run| run.errors.get_mut(observable));
        own.flatten().for_each(|error| *error /= middle);
    }
}
