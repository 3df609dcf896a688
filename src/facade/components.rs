//! Components of the state by their names.

use crate::error::{Error, ErrorKind, Result};
use crate::expr::{System, candidates};
use crate::spec::nearest;

/// Names of coordinates, then of momenta.
pub(crate) fn state_names(system: &System) -> Vec<String> {
    system.coordinates.iter().chain(&system.momenta).map(|v| v.name.clone()).collect()
}

/// Components that a name means: itself, `q1` for `q[1]`, or `q` for all of a family.
///
/// # Errors
/// [`ErrorKind::InvalidArgument`] where it means none.
pub(crate) fn matching(names: &[String], name: &str) -> Result<Vec<usize>> {
    let exact = names.iter().position(|n| n == name || candidates(n).iter().any(|c| c == name));
    if let Some(at) = exact {
        return Ok(vec![at]);
    }
    let family: Vec<usize> = names
        .iter()
        .enumerate()
        .filter(|(_, n)| n.strip_prefix(name).is_some_and(|rest| rest.starts_with('[')))
        .map(|(at, _)| at)
        .collect();
    if !family.is_empty() {
        return Ok(family);
    }
    let hint = match nearest(name, names.iter().map(String::as_str)) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("the state has {}", names.join(", ")),
    };
    let message = format!("the state has no component `{name}`");
    Err(Error::new(ErrorKind::InvalidArgument, message, hint))
}
