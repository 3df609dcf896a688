//! `effect` statements as the statements that they stand for.

use std::collections::HashMap;

use super::ast::*;
use super::bodies::Named;
use super::effects::{self, ActsOn, EffectRow, Misfit, Scene};
use super::gain;
use super::parse::template;
use super::resolve::{Resolved, resolve};
use crate::diagnostic::{Diagnostic, Span};

/// How many candidates a spec may have.
pub(crate) const MOST_CANDIDATES: usize = 200;

/// The spec with every effect written out, candidates left aside.
///
/// Statements that were made from an effect say so, and stand where it stands.
pub(crate) fn expand(spec: &SyntaxTree, diagnostics: &mut Vec<Diagnostic>) -> SyntaxTree {
    let expands = |s: &&Statement| {
        matches!(s.kind, StatementKind::Effect { .. } | StatementKind::Candidates(_))
    };
    if !spec.statements.iter().any(|statement| expands(&statement)) {
        return spec.clone();
    }
    let mut expander = Expander {
        // What is wrong with declarations is said when the whole spec is resolved.
        resolved: resolve(spec, &mut Vec::new()),
        scene: Scene::default(),
        candidates: HashMap::new(),
        lost_candidates: spec.lost.iter().any(|word| word == "candidates"),
        seen: HashMap::new(),
        diagnostics,
    };
    expander.scene = expander.resolved.scene();
    for statement in &spec.statements {
        if let StatementKind::Candidates(list) = &statement.kind {
            list.iter().for_each(|candidate| expander.declare(candidate));
        }
    }
    let mut out = SyntaxTree { statements: Vec::new(), lost: spec.lost.clone() };
    for statement in &spec.statements {
        match &statement.kind {
            StatementKind::Effect { name, arguments, settings } => {
                let asked = EffectUse { name, arguments, settings, span: statement.site.0 };
                out.statements.extend(expander.effect(asked).unwrap_or_default());
            }
            StatementKind::Candidates(_) => {}
            _ => out.statements.push(statement.clone()),
        }
    }
    out
}

/// The names that an effect meets in the text of a spec; what is wrong with it is left aside.
pub(crate) fn scene_of(text: &str) -> Scene {
    let (spec, _) = super::parse::spec(text);
    resolve(&spec, &mut Vec::new()).scene()
}

/// An `effect` statement.
#[derive(Clone, Copy)]
struct EffectUse<'a> {
    name: &'a Word,
    arguments: &'a [Argument],
    settings: &'a [Setting],
    span: Span,
}

struct Expander<'a, 'd> {
    resolved: Resolved<'a>,
    scene: Scene,
    candidates: HashMap<&'a str, &'a Candidate>,
    /// A `candidates` statement could not be read: what is unknown may stand in it.
    lost_candidates: bool,
    /// Effects that the spec has, by their labels.
    seen: HashMap<String, Span>,
    diagnostics: &'d mut Vec<Diagnostic>,
}

impl<'a> Expander<'a, '_> {
    fn report(&mut self, diagnostic: Diagnostic) {
        self.diagnostics.push(diagnostic);
    }

    fn declare(&mut self, candidate: &'a Candidate) {
        let (name, span) = (candidate.name.text.as_str(), candidate.name.site.0);
        if effects::by_name(name).is_some() {
            self.report(
                Diagnostic::error(span, format!("the catalogue has an effect called `{name}`"))
                    .label("named again here")
                    .hint("give your own effect another name"),
            );
        } else if let Some(first) = self.candidates.get(name) {
            let diagnostic =
                Diagnostic::error(span, format!("the candidate `{name}` is given twice"))
                    .label("given again here")
                    .hint("give every candidate a name of its own")
                    .related(first.name.site.0, "first given here");
            self.report(diagnostic);
        } else if self.candidates.len() >= MOST_CANDIDATES {
            self.report(
                Diagnostic::error(
                    span,
                    format!("there are more than {MOST_CANDIDATES} candidates"),
                )
                .label("one too many")
                .hint("every one is tried; keep those that you believe in"),
            );
        } else {
            self.candidates.insert(name, candidate);
        }
    }

    /// The statements of one effect; `None` after a diagnostic.
    fn effect(&mut self, asked: EffectUse) -> Option<Vec<Statement>> {
        let name = asked.name.text.as_str();
        if let Some(&candidate) = self.candidates.get(name) {
            return self.candidate(asked, candidate);
        }
        let Some(row) = effects::by_name(name) else {
            if self.lost_candidates {
                return None;
            }
            let mut own: Vec<&str> = self.candidates.keys().copied().collect();
            own.sort_unstable();
            let hint = effects::hint_for(name, &own);
            self.report(
                Diagnostic::error(asked.name.site.0, format!("unknown effect `{name}`"))
                    .label("neither the catalogue nor `candidates` has it")
                    .hint(hint),
            );
            return None;
        };
        if self.resolved.lost_names
            || self.resolved.coordinates.len() != self.resolved.momenta.len()
        {
            return None;
        }
        if let Some(reason) = row.cannot(&self.scene) {
            self.report(
                Diagnostic::error(asked.span, format!("`{}` does not apply here", row.name))
                    .label(reason)
                    .hint("take it away; `leverrier effects` says what each effect needs"),
            );
            return None;
        }
        let arguments = self.arguments(row, asked)?;
        let mut out = self.parameters(row, asked, &arguments)?;
        self.once(row.label(&arguments), asked.span)?;
        let text = row.filled(&self.scene, &arguments)?;
        match template(&text, asked.span) {
            Ok(statements) => out.extend(statements),
            Err(diagnostic) => {
                self.report(diagnostic);
                return None;
            }
        }
        if row.whole
            && let [coordinate, input] = arguments.as_slice()
        {
            let (on, name) = ((coordinate.as_str(), input.as_str()), row.term_name(&arguments));
            out.extend(gain::tie(&self.resolved, on, &name, Site(asked.span)));
        }
        let label = row.label(&arguments);
        out.iter_mut().for_each(|statement| statement.effect = Some(label.clone()));
        Some(out)
    }

    fn candidate(&mut self, asked: EffectUse, candidate: &Candidate) -> Option<Vec<Statement>> {
        let name = &candidate.name.text;
        if !asked.arguments.is_empty() || !asked.settings.is_empty() {
            self.report(
                Diagnostic::error(asked.span, format!("`{name}` takes nothing in parentheses"))
                    .label("it is a candidate of this spec, with its variables in it")
                    .hint(format!("write `effect {name}`"))
                    .related(candidate.name.site.0, "declared here"),
            );
            return None;
        }
        self.once(name.clone(), asked.span)?;
        let mut out = candidate.statements.clone();
        for statement in &mut out {
            statement.effect = Some(name.clone());
            if let StatementKind::Energy { adds, .. } = &mut statement.kind {
                *adds = true;
            }
        }
        Some(out)
    }

    fn once(&mut self, label: String, span: Span) -> Option<()> {
        let Some(&first) = self.seen.get(&label) else {
            self.seen.insert(label, span);
            return Some(());
        };
        self.report(
            Diagnostic::error(span, format!("the effect `{label}` is there already"))
                .label("added again here")
                .hint("keep one of them")
                .related(first, "first added here"),
        );
        None
    }

    /// The names that the arguments stand for.
    fn arguments(&mut self, row: &EffectRow, asked: EffectUse) -> Option<Vec<String>> {
        let there =
            if row.on.observes() { &self.scene.observables } else { &self.scene.coordinates };
        let example: Vec<String> = match row.on {
            ActsOn::Body => there.iter().take(2).cloned().collect(),
            ActsOn::BodyPair => {
                there.chunks(2).take(2).map(|pair| format!("({})", pair.join(", "))).collect()
            }
            ActsOn::Driven => {
                there.iter().take(1).chain(self.scene.inputs.iter().take(1)).cloned().collect()
            }
            _ => there.iter().take(row.on.count()).cloned().collect(),
        };
        let hint = format!("write for example `{}`", row.statement(&example, &[]));
        let mut given: Vec<Vec<String>> = Vec::new();
        for argument in asked.arguments {
            let mut names = Vec::new();
            for variable in argument.variables() {
                names.extend(self.variables(row, variable, &hint)?);
            }
            given.push(names);
        }
        let misfit = match self.scene.arguments(row.on, &given) {
            Ok(arguments) => return Some(arguments),
            Err(misfit) => misfit,
        };
        let place = |name: &String| -> Span {
            let holds = given.iter().rposition(|names| names.contains(name));
            let argument = holds.and_then(|at| asked.arguments.get(at));
            argument.map_or(asked.span, Argument::span)
        };
        let diagnostic = match misfit {
            Misfit::Count => {
                let count = match row.on.is_of_bodies() {
                    true => given.len(),
                    false => given.iter().map(Vec::len).sum(),
                };
                let label = match count {
                    0 => "none is given".to_string(),
                    1 => "one is given".to_string(),
                    n => format!("{n} are given"),
                };
                let message = format!("`{}` takes {}", row.name, row.on.text());
                Diagnostic::error(asked.span, message).label(label)
            }
            Misfit::Twice(name) => {
                let message = match row.on {
                    ActsOn::Coordinate | ActsOn::Body => {
                        format!("`{}` takes each coordinate once", row.name)
                    }
                    _ => format!("`{}` takes two different arguments", row.name),
                };
                Diagnostic::error(place(&name), message)
                    .label(format!("`{name}` stands here again"))
            }
            Misfit::NoBody(name) => Diagnostic::error(
                place(&name),
                format!("`{name}` is not a body"),
            )
            .label(format!("`{}` takes {}", row.name, row.on.text())),
            Misfit::NoInput(name) => {
                Diagnostic::error(place(&name), format!("`{name}` cannot stand here"))
                    .label(format!("`{}` takes {}", row.name, row.on.text()))
            }
        };
        self.report(diagnostic.hint(hint));
        None
    }

    /// The coordinates or observables that a variable among the arguments stands for; `None`
    /// after a diagnostic.
    fn variables(
        &mut self,
        row: &EffectRow,
        variable: &Expression,
        hint: &str,
    ) -> Option<Vec<String>> {
        let resolved = &self.resolved;
        if let ExpressionKind::Name(name) = &variable.kind
            && row.on.observes()
            && resolved.measures.iter().any(|measure| measure.name.text == *name)
        {
            return Some(vec![name.clone()]);
        }
        if let ExpressionKind::Name(name) = &variable.kind
            && row.on == ActsOn::Driven
            && self.scene.inputs.contains(name)
        {
            return Some(vec![name.clone()]);
        }
        let (role, at) = match resolved.named(variable) {
            Err(diagnostic) => {
                self.report(diagnostic);
                return None;
            }
            Ok(Named::Variable(role, at)) => (Some(role), at),
            Ok(Named::Body(at)) if !row.on.observes() => {
                let body = resolved.bodies.get(at)?;
                let names = body.coordinates.iter();
                let names =
                    names.filter_map(|&at| Some(resolved.coordinates.get(at)?.name.clone()));
                let names: Vec<String> = names.collect();
                // What is wrong with the body was said where it is declared.
                return (!names.is_empty()).then_some(names);
            }
            Ok(_) => (None, 0),
        };
        let of = |role| match role {
            Role::Coordinates => resolved.coordinates.get(at),
            Role::Momenta => resolved.momenta.get(at),
            Role::Velocities => resolved.velocities.get(at),
        };
        let fits = match role {
            Some(Role::Coordinates) => true,
            Some(Role::Momenta) => row.on.observes() && resolved.velocities.is_empty(),
            Some(Role::Velocities) => row.on.observes(),
            None => false,
        };
        let name = role.and_then(of).map(|declared| declared.name.clone());
        if let Some(name) = name.filter(|_| fits) {
            return Some(vec![name]);
        }
        let what = if row.on.observes() { "an observable" } else { "a coordinate" };
        let partner = role.and_then(|_| of(Role::Coordinates));
        let hint = match partner {
            Some(partner) => format!("write `{}`, to which it belongs", partner.name),
            None => hint.to_string(),
        };
        self.report(
            Diagnostic::error(variable.site.0, format!("`{variable}` is not {what}"))
                .label(format!("`{}` takes {}", row.name, row.on.text()))
                .hint(hint),
        );
        None
    }

    /// One `param` statement for each inner parameter.
    fn parameters(
        &mut self,
        row: &EffectRow,
        asked: EffectUse,
        arguments: &[String],
    ) -> Option<Vec<Statement>> {
        let first =
            arguments.first().and_then(|first| self.scene.members(first).into_iter().next());
        let at = self.scene.coordinates.iter().position(|name| Some(name) == first.as_ref());
        let resolved = &self.resolved;
        let unit =
            |list: &[super::resolve::Declared]| Some(list.get(at?)?.unit.as_ref()?.text.clone());
        let (q, p) = (unit(&resolved.coordinates), unit(&resolved.momenta));
        let time = resolved.time.and_then(|(_, unit)| unit).map(|unit| unit.text.clone());
        let input = match (row.on, arguments) {
            (ActsOn::Driven, [_, name]) => {
                resolved.inputs.iter().find(|input| input.name.text == *name)
            }
            _ => None,
        };
        let input = input.and_then(|input| input.unit).map(|unit| unit.text.clone());
        for (i, setting) in asked.settings.iter().enumerate() {
            let name = setting.name.text.as_str();
            let twice = asked.settings.iter().take(i).find(|other| other.name.text == name);
            if let Some(first) = twice {
                let diagnostic =
                    Diagnostic::error(setting.site.0, format!("`{name}` is given twice"))
                        .label("given again here")
                        .hint("keep one of them")
                        .related(first.site.0, "first given here");
                self.report(diagnostic);
                return None;
            }
            if !row.parameters.iter().any(|scan| scan.name == name) {
                let known: Vec<&str> = row.parameters.iter().map(|scan| scan.name).collect();
                let hint = match super::nearest(name, known.iter().copied()) {
                    _ if known.is_empty() => "it has no inner parameter: take it away".to_string(),
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!("it has {}", known.join(" and ")),
                };
                let message = format!("`{}` has no parameter `{name}`", row.name);
                self.report(
                    Diagnostic::error(setting.site.0, message).label("unknown here").hint(hint),
                );
                return None;
            }
        }
        let mut out = Vec::new();
        if let Some(name) = row.unit_name(arguments) {
            let site = Site(asked.span);
            let number = Expression { kind: ExpressionKind::Number(1.0), site };
            let value = match q.clone() {
                Some(text) => Expression {
                    kind: ExpressionKind::Quantity(Box::new(number), Word { text, site }),
                    site,
                },
                None => number,
            };
            let name = Word { text: name, site };
            let kind = StatementKind::Constant { name, value, by_let: false };
            out.push(Statement { kind, site, effect: None });
        }
        for scan in row.parameters {
            let Some(setting) = asked.settings.iter().find(|s| s.name.text == scan.name) else {
                self.report(
                    Diagnostic::error(
                        asked.span,
                        format!("`{}` needs a start for its {}", row.name, scan.name),
                    )
                    .label("not given here")
                    .hint(format!(
                        "write for example `{}`; `leverrier diagnose` looks for the best one",
                        row.statement(arguments, &[])
                    )),
                );
                return None;
            };
            if scan.by.is_scale() && not_positive(&setting.value) {
                self.report(
                    Diagnostic::error(
                        setting.value.site.0,
                        format!("the {} of `{}` is larger than zero", scan.name, row.name),
                    )
                    .label("not a size")
                    .hint(format!("write for example `{}`", row.statement(arguments, &[]))),
                );
                return None;
            }
            let site = Site(asked.span);
            let text =
                scan.by.unit_text(q.as_deref(), p.as_deref(), time.as_deref(), input.as_deref());
            // A bare number is in the units of the variables.
            let start = match text {
                Some(text) if bare(&setting.value) => Expression {
                    kind: ExpressionKind::Quantity(
                        Box::new(setting.value.clone()),
                        Word { text, site: setting.value.site },
                    ),
                    site: setting.value.site,
                },
                _ => setting.value.clone(),
            };
            let name = Word { text: row.parameter_name(scan.name, arguments), site };
            let bounds = scan.by.is_scale().then(|| around(&start));
            let kind = StatementKind::Parameter { name, starts: vec![start], per: None, bounds };
            out.push(Statement { kind, site, effect: None });
        }
        Some(out)
    }
}

/// Bounds of a scale: it may leave its start by this factor, and never becomes zero.
const AROUND: f64 = 100.0;

fn around(start: &Expression) -> Limits {
    let site = start.site;
    let times = |inverse: bool| {
        let factor = Expression { kind: ExpressionKind::Number(AROUND), site };
        let parts = vec![(false, start.clone()), (inverse, factor)];
        Expression { kind: ExpressionKind::Product(parts), site }
    };
    Limits { lower: Some(times(true)), upper: Some(times(false)), site }
}

/// Whether an expression is a number that is negative or zero, as it is written.
fn not_positive(expression: &Expression) -> bool {
    match &expression.kind {
        ExpressionKind::Number(number) => *number <= 0.0,
        ExpressionKind::Quantity(number, _) => not_positive(number),
        ExpressionKind::Negate(inner) => !not_positive(inner),
        _ => false,
    }
}

/// Whether an expression is made of numbers alone, none with a unit.
fn bare(expression: &Expression) -> bool {
    match &expression.kind {
        ExpressionKind::Number(_) => true,
        ExpressionKind::Name(name) => name == "pi",
        ExpressionKind::Negate(inner) => bare(inner),
        ExpressionKind::Sum(parts) | ExpressionKind::Product(parts) => {
            parts.iter().all(|(_, part)| bare(part))
        }
        ExpressionKind::Power(base, exponent) => bare(base) && bare(exponent),
        _ => false,
    }
}

impl Resolved<'_> {
    /// The names that an effect meets.
    fn scene(&self) -> Scene {
        let names = |list: &[super::resolve::Declared]| -> Vec<String> {
            list.iter().map(|declared| declared.name.clone()).collect()
        };
        let second = if self.velocities.is_empty() { &self.momenta } else { &self.velocities };
        Scene {
            coordinates: names(&self.coordinates),
            momenta: names(&self.momenta),
            velocities: self.has_lagrangian(),
            observables: [names(&self.coordinates), names(second), self.measure_names()].concat(),
            time: self.time_name(),
            inputs: self.inputs.iter().map(|input| input.name.text.clone()).collect(),
            bodies: self.declared_bodies(),
            groups: Vec::new(),
        }
    }
}
