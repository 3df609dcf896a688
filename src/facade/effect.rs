//! An effect as a user names it, and where a spec has it.

use crate::diagnose::{LawOnData, candidates::candidates, scan::scan, settling::settle};
use crate::error::{Error, ErrorKind, Result};
use crate::expr::{Compiled, Scope, System};
use crate::spec::ast::{Statement, StatementKind};
use crate::spec::edit;
use crate::spec::effects::{ActsOn, EffectRow, Misfit, Scene, by_name, hint_for, instances};
use crate::spec::scene_of;

/// An effect on its arguments.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct NamedEffect {
    /// `viscous_drag(theta)`, or the name of a candidate of the spec.
    pub label: String,
    /// `effect viscous_drag(theta)`.
    pub statement: String,
    /// Whether it has inner parameters for which no value was given.
    pub open: bool,
    /// Names of inner parameters in the model with values to start from.
    pub values: Vec<(String, f64)>,
}

/// Labels of the effects that a text has.
pub(crate) fn effects_of(text: &str) -> Vec<String> {
    let found = edit::find(text, |s| matches!(s.kind, StatementKind::Effect { .. }));
    found.iter().map(|statement| label_of(text, statement)).collect()
}

fn label_of(text: &str, statement: &Statement) -> String {
    let (name, arguments, _) = parts(text.get(statement.site.0.range()).unwrap_or(""));
    let Some(row) = by_name(&name) else { return name };
    let scene = scene_of(text);
    let given: Vec<Vec<String>> = arguments.iter().map(|one| scene.members(one)).collect();
    row.label(&scene.arguments(row.on, &given).unwrap_or(arguments))
}

/// `name(a, b; c = 1)` in its parts.
fn parts(text: &str) -> (String, Vec<String>, String) {
    let text = text.trim().trim_start_matches("effect ").trim();
    let Some((name, rest)) = text.split_once('(') else {
        return (text.to_string(), Vec::new(), String::new());
    };
    let inside = rest.trim_end().strip_suffix(')').unwrap_or(rest);
    let (arguments, settings) = inside.split_once(';').unwrap_or((inside, ""));
    let mut out: Vec<String> = vec![String::new()];
    let mut depth = 0;
    for c in arguments.chars().filter(|c| !c.is_whitespace()) {
        depth += i32::from(matches!(c, '[' | '(')) - i32::from(matches!(c, ']' | ')'));
        match (c, out.last_mut()) {
            (',', _) if depth == 0 => out.push(String::new()),
            (c, Some(last)) => last.push(c),
            _ => {}
        }
    }
    out.retain(|argument| !argument.is_empty());
    (name.trim().to_string(), out, settings.trim().to_string())
}

/// Names of the spec's own candidates.
fn own(text: &str) -> Vec<String> {
    let found = edit::find(text, |s| matches!(s.kind, StatementKind::Candidates(_)));
    let lists = found.into_iter().filter_map(|statement| match statement.kind {
        StatementKind::Candidates(list) => Some(list),
        _ => None,
    });
    lists.flatten().map(|candidate| candidate.name.text).collect()
}

impl NamedEffect {
    /// Understands `viscous_drag(theta)`, or a bare name where there is only one place for it, in
    /// the text of a spec and its system.
    ///
    /// # Errors
    /// An unknown name, or an effect that cannot act here, with the reason.
    pub(crate) fn new(effect: &str, spec: &str, system: &System) -> Result<Self> {
        let (name, arguments, settings) = parts(effect);
        let own = own(spec);
        if own.contains(&name) {
            let statement = format!("effect {name}");
            return Ok(NamedEffect { statement, label: name, open: true, values: Vec::new() });
        }
        let row = by_name(&name).ok_or_else(|| {
            let own: Vec<&str> = own.iter().map(String::as_str).collect();
            Error::new(
                ErrorKind::UnknownName,
                format!("there is no effect `{name}`"),
                hint_for(&name, &own),
            )
        })?;
        let scene = system.scene();
        if let Some(reason) = row.cannot(&scene) {
            return Err(Error::new(
                ErrorKind::NotApplicable,
                format!("`{}` does not apply here: {reason}", row.name),
                format!("`leverrier effects {}` says what it needs", row.name),
            ));
        }
        let arguments = if arguments.is_empty() { only(row, &scene)? } else { arguments };
        let mut names =
            if row.on.observes() { scene.observables.clone() } else { scene.coordinates.clone() };
        if row.on == ActsOn::Driven {
            names.extend(scene.inputs.iter().cloned());
        }
        let given: Vec<Vec<String>> = arguments.iter().map(|one| scene.members(one)).collect();
        if let Some(strange) = given.iter().flatten().find(|name| !names.contains(name)) {
            let bodies = scene.bodies.iter().filter_map(|body| body.name.as_deref());
            let known = names.iter().map(String::as_str).chain(bodies);
            let hint = match crate::spec::nearest(strange, known) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("it acts on {}: {}", row.on.text(), names.join(", ")),
            };
            return Err(Error::new(
                ErrorKind::UnknownName,
                format!("`{}` cannot be on `{strange}`", row.name),
                hint,
            ));
        }
        let arguments = scene.arguments(row.on, &given).map_err(|misfit| {
            let has = match misfit {
                Misfit::Count => format!("not on {}", arguments.len()),
                Misfit::Twice(name) => format!("not on `{name}` twice"),
                Misfit::NoBody(name) => format!("and `{name}` is none"),
                Misfit::NoInput(name) => format!("not on `{name}` there"),
            };
            Error::new(
                ErrorKind::InvalidArgument,
                format!("`{}` is on {}, {has}", row.name, row.on.text()),
                format!("name {} in parentheses", row.on.text()),
            )
        })?;
        let label = row.label(&arguments);
        let open = settings.is_empty() && !row.parameters.is_empty();
        let statement = if settings.is_empty() {
            row.statement(&arguments, &[])
        } else {
            format!("effect {}({}; {settings})", row.name, arguments.join(", "))
        };
        Ok(NamedEffect { label, statement, open, values: Vec::new() })
    }

    /// Its statement in a text.
    pub(crate) fn place(&self, text: &str) -> Option<Statement> {
        let found = edit::find(text, |s| matches!(s.kind, StatementKind::Effect { .. }));
        found.into_iter().find(|statement| label_of(text, statement) == self.label)
    }

    /// Values of the inner parameters that a scan over their grid likes best, where they were not
    /// given.
    pub(crate) fn scanned(&mut self, compiled: &Compiled, model: LawOnData) -> Result<()> {
        if !self.open {
            return Ok(());
        }
        let tuning = &model.tuning().candidates;
        let all = candidates(
            &mut Scope::of(&compiled.with_system(model.system())),
            &model.data.dataset,
            tuning,
        );
        let Some(candidate) = all.iter().find(|c| c.label == self.label) else { return Ok(()) };
        let scores = scan(&settle(model), None, std::slice::from_ref(candidate))?;
        if let Some(best) = scores.scored.first() {
            let values = &best.values;
            let parameters = candidate.parameters_in(&compiled.system);
            let names = parameters.map(|parameter| parameter.name.clone());
            self.values = names.zip(values.iter().copied()).collect();
            let short: Vec<f64> =
                values.iter().map(|x| format!("{x:.5e}").parse().unwrap_or(*x)).collect();
            self.statement = candidate.snippet(&short);
        }
        Ok(())
    }
}

/// The arguments of an effect that has a single place in the system.
fn only(row: &EffectRow, scene: &Scene) -> Result<Vec<String>> {
    let mut places: Vec<Vec<String>> = instances(scene)
        .into_iter()
        .filter(|instance| instance.effect.name == row.name)
        .map(|instance| instance.arguments)
        .collect();
    match places.len() {
        1 => Ok(places.remove(0)),
        _ => {
            let some: Vec<String> = places.iter().take(6).map(|on| row.label(on)).collect();
            Err(Error::new(
                ErrorKind::Ambiguous,
                format!("`{}` has {} places here", row.name, places.len()),
                format!("say which: {}", some.join(", ")),
            ))
        }
    }
}
