//! Bodies: `body star = (x, y)` names coordinates that turn together.

use super::ast::*;
use super::effects::Body;
use super::resolve::{Meaning, Resolved, integer};
use crate::diagnostic::{Diagnostic, Span};

/// What a variable in a list of arguments is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Named {
    /// The variable at this place in the list of its role.
    Variable(Role, usize),
    /// The body at this place.
    Body(usize),
    /// Something else: a number, a whole family, time.
    Other,
}

/// Finds the coordinates of every body, and says what is wrong with them.
pub(super) fn resolve<'a>(
    spec: &'a SyntaxTree,
    resolved: &mut Resolved<'a>,
    diagnostics: &mut Vec<Diagnostic>,
) {
    let mut taken: Vec<(usize, Span, &'a str)> = Vec::new();
    let mut place = 0;
    for statement in &spec.statements {
        let StatementKind::Body { name, coordinates } = &statement.kind else { continue };
        let mut own = Vec::new();
        let mut sound = true;
        for variable in coordinates {
            match coordinate(resolved, variable, &taken, &name.text) {
                Ok(Some(at)) => {
                    taken.push((at, variable.site.0, &name.text));
                    own.push(at);
                }
                Ok(None) => sound = false,
                Err(diagnostic) => {
                    sound = false;
                    diagnostics.push(diagnostic);
                }
            }
        }
        if sound && !(2..=3).contains(&own.len()) {
            sound = false;
            let label = if own.len() == 1 { "one is given" } else { "too many" };
            let hint = "a body moves in a plane or in space: write `body NAME = (x, y)`";
            diagnostics.push(
                Diagnostic::error(statement.site.0, "a body has two or three coordinates")
                    .label(label)
                    .hint(hint),
            );
        }
        if sound && let Some(body) = resolved.bodies.get_mut(place) {
            body.coordinates = own;
        }
        place += 1;
    }
}

/// The coordinate that a body has; none where its name may have been lost.
fn coordinate(
    resolved: &Resolved,
    variable: &Expression,
    taken: &[(usize, Span, &str)],
    body: &str,
) -> Result<Option<usize>, Diagnostic> {
    let span = variable.site.0;
    let at = match resolved.named(variable) {
        Err(_) if resolved.lost_names => return Ok(None),
        Err(diagnostic) => return Err(diagnostic),
        Ok(Named::Variable(Role::Coordinates, at)) => at,
        Ok(_) => {
            return Err(Diagnostic::error(span, format!("`{variable}` is not a coordinate"))
                .label("a body is made of coordinates")
                .hint("write for example `body ball = (x, y)`; momenta follow their coordinates"));
        }
    };
    match taken.iter().find(|(other, ..)| *other == at) {
        None => Ok(Some(at)),
        Some((_, first, of)) => {
            let message = if *of == body {
                format!("`{variable}` stands in `{body}` twice")
            } else {
                format!("`{variable}` belongs to the body `{of}` already")
            };
            Err(Diagnostic::error(span, message)
                .label("given again here")
                .hint("a coordinate belongs to one body, once")
                .related(*first, "first given here"))
        }
    }
}

impl Resolved<'_> {
    /// What a variable in a list of arguments is.
    ///
    /// # Errors
    /// Nothing has its name, or an index is out of range.
    pub(crate) fn named(&self, variable: &Expression) -> Result<Named, Diagnostic> {
        let (name, index) = match &variable.kind {
            ExpressionKind::Name(name) => (name, None),
            ExpressionKind::Index { name, index } => (name, Some(index)),
            _ => return Ok(Named::Other),
        };
        let Some(&(meaning, _)) = self.names.get(name) else {
            let hint = self.hint_for(name, &[]);
            return Err(Diagnostic::error(variable.site.0, format!("unknown name `{name}`"))
                .label("nothing has this name")
                .hint(hint));
        };
        let known = |name: &str| self.integers.get(name).copied();
        match (meaning, index) {
            (Meaning::Variable(role, at), None) => Ok(Named::Variable(role, at)),
            (Meaning::Body(at), None) => Ok(Named::Body(at)),
            (Meaning::Family { role, first, start, count }, Some(index)) => {
                let value = integer(index, &known)?;
                let place = value.checked_sub(first).and_then(|i| usize::try_from(i).ok());
                let Some(place) = place.filter(|&place| place < count) else {
                    let last = first + count as i64 - 1;
                    let message = format!("the index {value} is out of range");
                    return Err(Diagnostic::error(variable.site.0, message)
                        .label(format!("`{name}[{value}]` does not exist"))
                        .hint(format!("`{name}` has the indices {first}..{last}")));
                };
                Ok(Named::Variable(role, start + place))
            }
            _ => Ok(Named::Other),
        }
    }

    /// The declared bodies whose coordinates are sound.
    pub(crate) fn declared_bodies(&self) -> Vec<Body> {
        let sound = self.bodies.iter().filter(|body| !body.coordinates.is_empty());
        let body = |body: &super::resolve::BodyOf| Body {
            name: Some(body.name.text.clone()),
            coordinates: (body.coordinates.iter())
                .filter_map(|&at| Some(self.coordinates.get(at)?.name.clone()))
                .collect(),
        };
        sound.map(body).collect()
    }
}
