//! Which columns of a data file hold what, as the spec says.

use super::lower::Lowering;
use super::system::{InputVariable, Parameter, System};
use super::unit::Unit;
use crate::data::format_number;
use crate::diagnostic::{Diagnostic, Span};
use crate::spec::ast::{DataItem, DataItemKind, Expression, ExpressionKind, UnitText, Word};

/// A column and the number its cells are multiplied with to be in the spec's unit.
#[derive(Debug, Clone, PartialEq)]
pub struct ColumnScale {
    /// Name of the column.
    pub column: String,
    /// The spec's units per unit of the column.
    pub scale: f64,
}

/// An observable and the columns that may hold it.
#[derive(Debug, Clone, PartialEq)]
pub struct ObservedColumn {
    /// Name of the variable in the spec.
    pub name: String,
    /// Names of columns, the likeliest first; only one where the spec names it, none where it
    /// says that nothing was measured.
    pub candidates: Vec<String>,
    /// The spec's units per unit of the column.
    pub scale: f64,
    /// The column that holds the standard error of each value, where one does.
    pub error: Option<ColumnScale>,
}

/// The `data` statement with its names and units resolved.
#[derive(Debug, Clone, PartialEq)]
pub struct DataColumns {
    /// As written; a relative path is meant from the spec's directory.
    pub file: String,
    /// `None`: the spec does not say which column is time.
    pub time: Option<ColumnScale>,
    /// Time from one sample to the next, in the spec's unit, where no column holds the time.
    pub every: Option<f64>,
    /// The column that tells runs apart, if the spec names one.
    pub run: Option<String>,
    /// Every two rows are one transition.
    pub pairs: bool,
    /// In the order of [`System::observables`].
    pub observables: Vec<ObservedColumn>,
    /// In the order of [`System::inputs`].
    pub inputs: Vec<ObservedColumn>,
}

/// `q[1]` may stand in a column `q[1]`, `q1` or `q_1`.
pub fn candidates(name: &str) -> Vec<String> {
    let mut out = vec![name.to_string()];
    if let Some((base, index)) = name.strip_suffix(']').and_then(|name| name.split_once('[')) {
        out.push(format!("{base}{index}"));
        out.push(format!("{base}_{index}"));
    }
    out
}

/// What tells apart the groups of runs that have some of these parameters for themselves, each
/// once: columns, and `None` for every run.
pub fn groupings(parameters: &[Parameter]) -> Vec<Option<&str>> {
    let mut out = Vec::new();
    for by in parameters.iter().filter_map(|parameter| parameter.per.as_ref()) {
        if !out.contains(&by.column()) {
            out.push(by.column());
        }
    }
    out
}

impl System {
    /// Where the observables stand when no `data` statement says otherwise.
    pub fn observed_columns(&self) -> Vec<ObservedColumn> {
        let observables = self.observables();
        let column = |(at, name): (usize, String)| {
            let candidates = if self.is_hidden(at) { Vec::new() } else { candidates(&name) };
            ObservedColumn { candidates, name, scale: 1.0, error: None }
        };
        observables.into_iter().enumerate().map(column).collect()
    }

    /// What tells apart the groups of runs that have inner parameters of their own, each once:
    /// columns, and `None` for every run.
    pub fn groupings(&self) -> Vec<Option<String>> {
        groupings(&self.parameters).into_iter().map(|by| by.map(str::to_string)).collect()
    }

    /// Where the inputs stand when no `data` statement says otherwise.
    pub fn input_columns(&self) -> Vec<ObservedColumn> {
        let column = |input: &InputVariable| ObservedColumn {
            name: input.variable.name.clone(),
            candidates: candidates(&input.variable.name),
            scale: 1.0,
            error: None,
        };
        self.inputs.iter().map(column).collect()
    }
}

/// Of every `data` statement, in the order of the text.
pub(super) fn resolve(lowering: &mut Lowering, system: &System) -> Vec<DataColumns> {
    let statements = lowering.resolved.data.clone();
    statements
        .into_iter()
        .map(|(file, items)| of_statement(lowering, system, file, items))
        .collect()
}

fn of_statement(
    lowering: &mut Lowering,
    system: &System,
    file: &Word,
    items: &[DataItem],
) -> DataColumns {
    let mut out = DataColumns {
        file: file.text.clone(),
        time: None,
        every: None,
        run: None,
        pairs: false,
        observables: system.observed_columns(),
        inputs: system.input_columns(),
    };
    let mut mapped = vec![false; out.observables.len()];
    let mut driven = vec![false; out.inputs.len()];
    // Where the time is said to be known from.
    let mut told_time: Option<Span> = None;
    for item in items {
        if matches!(item.kind, DataItemKind::Time { .. } | DataItemKind::Every(_)) {
            let both = out.time.is_some() || out.every.is_some();
            if let Some(first) = told_time.filter(|_| both) {
                lowering.report(time_told_twice(item, first, out.every.is_some()));
                continue;
            }
            told_time = Some(item.site.0);
        }
        let twice = match &item.kind {
            DataItemKind::Time { column, unit } => {
                let scale = scale(lowering, unit.as_ref(), system.time.unit, column);
                let column = column.text.clone();
                out.time.replace(ColumnScale { column, scale }).is_some()
            }
            DataItemKind::Every(period) => {
                out.every = self::period(lowering, period, system.time.unit).or(out.every);
                false
            }
            DataItemKind::Run(column) => out.run.replace(column.text.clone()).is_some(),
            DataItemKind::Pairs => std::mem::replace(&mut out.pairs, true),
            DataItemKind::Column { variable, column, unit, error }
                if let Some(at) = input(system, variable) =>
            {
                if let Some(error) = error {
                    lowering.report(
                        Diagnostic::error(error.column.site.0, "an input has no errors of its own")
                            .label("what drives the motion is taken as it was recorded")
                            .hint("leave `error` and the column behind it away"),
                    );
                }
                let own = system.inputs.get(at).and_then(|input| input.variable.unit);
                let scale = scale(lowering, unit.as_ref(), own, column);
                if let Some(found) = out.inputs.get_mut(at) {
                    found.candidates = vec![column.text.clone()];
                    found.scale = scale;
                }
                driven.get_mut(at).is_some_and(|driven| std::mem::replace(driven, true))
            }
            DataItemKind::NotMeasured(variable) if input(system, variable).is_some() => {
                lowering.report(
                    Diagnostic::error(variable.site.0, "an input has to be measured")
                        .label("the motion cannot be followed without it")
                        .hint("name the column that holds it, or take its statement away"),
                );
                false
            }
            DataItemKind::Column { variable, column, unit, error } => {
                let Some(at) = observable(lowering, system, &out.observables, variable) else {
                    continue;
                };
                let of = system.observed_variables().nth(at);
                let own = of.and_then(|of| of.unit);
                let scale = self::scale(lowering, unit.as_ref(), own, column);
                let error = error.as_ref().map(|error| ColumnScale {
                    column: error.column.text.clone(),
                    scale: match &error.unit {
                        Some(unit) => self::scale(lowering, Some(unit), own, &error.column),
                        None => scale,
                    },
                });
                if let Some(observed) = out.observables.get_mut(at) {
                    observed.candidates = vec![column.text.clone()];
                    observed.scale = scale;
                    observed.error = error;
                }
                mapped.get_mut(at).is_some_and(|mapped| std::mem::replace(mapped, true))
            }
            DataItemKind::NotMeasured(variable) => {
                let all = family(&out.observables, variable).unwrap_or_else(|| {
                    let one = observable(lowering, system, &out.observables, variable);
                    one.into_iter().collect()
                });
                if all.iter().any(|&at| at < system.degrees()) && system.measures.is_empty() {
                    lowering.report(
                        Diagnostic::error(variable.site.0, "a coordinate has to be measured")
                            .label("only momenta and velocities can do without a column")
                            .hint(
                                "name the column that holds it, or say with `measure` what a \
                                 column shows of it",
                            ),
                    );
                }
                let mut twice = false;
                for at in all {
                    if let Some(observed) = out.observables.get_mut(at) {
                        observed.candidates.clear();
                    }
                    let before =
                        mapped.get_mut(at).is_some_and(|mapped| std::mem::replace(mapped, true));
                    twice |= before;
                }
                twice
            }
        };
        if twice {
            lowering.report(
                Diagnostic::error(item.site.0, "the data statement says this twice")
                    .label("said again here")
                    .hint("keep one of them"),
            );
        }
    }
    out
}

/// A column and a period, or one of them twice.
fn time_told_twice(item: &DataItem, first: Span, by_every: bool) -> Diagnostic {
    let counted = matches!(item.kind, DataItemKind::Every(_));
    let (message, hint) = if counted == by_every {
        ("the data statement says this twice", "keep one of them")
    } else {
        (
            "the time is in a column, or counted, but not both",
            "keep `time` if a column holds the time, and `every` if none does",
        )
    };
    Diagnostic::error(item.site.0, message)
        .label("said again here")
        .hint(hint)
        .related(first, "first said here")
}

/// The time from one sample to the next in the spec's unit; `None` after a diagnostic.
fn period(lowering: &mut Lowering, period: &Expression, own: Option<Unit>) -> Option<f64> {
    let (value, unit, span) = lowering.number(period)?;
    let unit = unit.filter(|unit| !unit.is_number());
    let second = Unit::parse("s").ok()?;
    if let Some(unit) = unit.filter(|unit| !unit.same_kind(second)) {
        let rate = Unit::ONE.over(unit).filter(|each| each.same_kind(second));
        let hint = match rate {
            Some(each) if value > 0.0 => format!(
                "write the time from one sample to the next: `every {} [s]`",
                format_number(each.scale / second.scale / value)
            ),
            _ => "write for example `every 10 [ms]`".to_string(),
        };
        lowering.report(
            Diagnostic::error(span, format!("[{unit}] is no unit of time"))
                .label("this should be the time from one sample to the next")
                .hint(hint),
        );
        return None;
    }
    if value <= 0.0 {
        lowering.report(
            Diagnostic::error(span, "the time from one sample to the next has to be above zero")
                .label(format!("this is {}", format_number(value)))
                .hint("write for example `every 10 [ms]`"),
        );
        return None;
    }
    Some(unit.zip(own).map_or(value, |(unit, own)| value * (unit.scale / own.scale)))
}

/// The number of the input that a variable names.
fn input(system: &System, variable: &Expression) -> Option<usize> {
    let ExpressionKind::Name(name) = &variable.kind else { return None };
    system.inputs.iter().position(|input| input.variable.name == *name)
}

/// The observables of a family that is named without an index.
fn family(observables: &[ObservedColumn], variable: &Expression) -> Option<Vec<usize>> {
    let ExpressionKind::Name(name) = &variable.kind else { return None };
    let of = |observed: &ObservedColumn| {
        observed.name.strip_prefix(name.as_str()).is_some_and(|rest| rest.starts_with('['))
    };
    let all: Vec<usize> = (0..observables.len()).filter(|&at| of(&observables[at])).collect();
    (!all.is_empty()).then_some(all)
}

fn observable(
    lowering: &mut Lowering,
    system: &System,
    observables: &[ObservedColumn],
    variable: &Expression,
) -> Option<usize> {
    let name = match &variable.kind {
        ExpressionKind::Name(name) => name.clone(),
        ExpressionKind::Index { name, index } => {
            match crate::spec::resolve::integer(index, &|_| None) {
                Ok(index) => format!("{name}[{index}]"),
                Err(diagnostic) => {
                    lowering.report(diagnostic);
                    return None;
                }
            }
        }
        _ => variable.to_string(),
    };
    let found = observables.iter().position(|observed| observed.name == name);
    if found.is_some_and(|at| system.is_hidden(at)) {
        lowering.report(
            Diagnostic::error(variable.site.0, format!("`{name}` is hidden"))
                .label("nobody measures it")
                .hint("declare it with `coordinates` and `momenta` if a column holds it"),
        );
        return None;
    }
    if found.is_none() {
        let names: Vec<&str> = observables.iter().map(|observed| observed.name.as_str()).collect();
        let state = system.momenta.iter().any(|momentum| momentum.name == name);
        let hint = match crate::spec::nearest(&name, names.iter().copied()) {
            Some(near) if !state => format!("did you mean `{near}`?"),
            _ => format!("observed are {}", names.join(", ")),
        };
        lowering.report(
            Diagnostic::error(variable.site.0, format!("`{name}` is not observed"))
                .label("no column can hold it")
                .hint(hint),
        );
    }
    found
}

/// How many of the spec's units one unit of a column is.
fn scale(
    lowering: &mut Lowering,
    column_unit: Option<&UnitText>,
    own: Option<Unit>,
    column: &Word,
) -> f64 {
    let Some(unit) = lowering.unit(column_unit) else { return 1.0 };
    let (Some(own), Some(text)) = (own, column_unit) else { return 1.0 };
    if !unit.same_kind(own) {
        lowering.report(
            Diagnostic::error(
                text.site.0,
                format!("units clash: the column is in [{unit}], the variable in [{own}]"),
            )
            .label(format!("cannot be converted to [{own}]"))
            .hint("correct the unit of the column or of the variable")
            .related(column.site.0, "this column"),
        );
        return 1.0;
    }
    unit.scale / own.scale
}
