//! What the names of a spec stand for: declarations flattened and checked.

use std::collections::HashMap;

use super::ast::*;
pub(crate) use super::integer::integer;
use super::lagrangian::{Constant, Definition};
use super::{bodies, may_name, nearest};
use crate::diagnostic::{Diagnostic, Span};

/// How many coordinates a spec may have.
pub(crate) const MOST_COORDINATES: i64 = 10_000;

/// A coordinate, momentum or velocity, one by one.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Declared {
    /// `theta`, `q[3]`.
    pub name: String,
    pub unit: Option<UnitText>,
    pub span: Span,
}

/// What a name stands for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Meaning {
    /// The variable at this place in the list of its role.
    Variable(Role, usize),
    /// `count` variables from `start` on; the first has the index `first`.
    Family {
        role: Role,
        first: i64,
        start: usize,
        count: usize,
    },
    Time,
    /// The input at this place in the list.
    Input(usize),
    Constant(usize),
    Parameter(usize),
    /// What a column shows, at this place in the list.
    Measure(usize),
    /// The body at this place in the list.
    Body(usize),
}

/// A statement `T = ...`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Energy<'a> {
    pub part: EnergyPart,
    pub value: &'a Expression,
    /// The effect that it came with.
    pub effect: Option<&'a str>,
}

/// A statement `force q[i] += ...`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Force<'a> {
    pub coordinate: &'a Expression,
    pub value: &'a Expression,
    pub comprehension: Option<&'a Comprehension>,
    /// The effect that it came with.
    pub effect: Option<&'a str>,
}

/// A statement `sensor theta += ...`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sensor<'a> {
    pub observable: &'a Expression,
    pub value: &'a Expression,
    pub comprehension: Option<&'a Comprehension>,
    /// The effect that it came with.
    pub effect: Option<&'a str>,
}

/// A statement `measure r [m] = sqrt(x^2 + y^2)`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Measure<'a> {
    pub name: &'a Word,
    pub unit: Option<&'a UnitText>,
    pub value: &'a Expression,
    /// Whole turns of it are lost.
    pub wrapped: bool,
}

/// A statement `input u [N] { linear }`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Input<'a> {
    pub name: &'a Word,
    pub unit: Option<&'a UnitText>,
    pub between: &'a Between,
}

/// A statement `hidden z with p_z` or `state w { w' = ... }`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Hidden<'a> {
    pub of: &'a HiddenStart,
    pub momentum: Option<&'a HiddenStart>,
    /// The law of an internal state of first order, which has no momentum.
    pub rate: Option<&'a Expression>,
    /// Its place among the coordinates.
    pub coordinate: usize,
    /// The effect that it came with.
    pub effect: Option<&'a str>,
}

/// A statement `param a = ...`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Parameter<'a> {
    pub name: &'a Word,
    pub starts: &'a [Expression],
    /// The column that tells apart what has a number of its own; `run` for every run.
    pub per: Option<&'a Word>,
    pub bounds: Option<&'a Limits>,
}

/// A statement `constrain a <= k <= b`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Constraint<'a> {
    pub first: &'a Operand,
    /// Each relation stands before its operand.
    pub rest: &'a [(Relation, Operand)],
    pub span: Span,
}

/// A statement `constrain x^2 + y^2 == l^2`: an equation between coordinates.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Holonomic<'a> {
    pub left: &'a Expression,
    pub right: &'a Expression,
    pub span: Span,
}

/// A statement `body star = (x, y)`.
#[derive(Debug, Clone)]
pub(crate) struct BodyOf<'a> {
    pub name: &'a Word,
    /// Places of its coordinates; empty where one of them is none.
    pub coordinates: Vec<usize>,
}

/// A spec by the meaning of its statements.
#[derive(Debug, Default)]
pub(crate) struct Resolved<'a> {
    pub title: Option<String>,
    pub coordinates: Vec<Declared>,
    /// As many as coordinates where the spec has no error.
    pub momenta: Vec<Declared>,
    /// Measured velocities, as many as coordinates, or none.
    pub velocities: Vec<Declared>,
    /// Momenta that are not written but implied by velocities.
    pub implied_momenta: bool,
    /// Its name and its unit.
    pub time: Option<(&'a str, Option<&'a UnitText>)>,
    pub inputs: Vec<Input<'a>>,
    /// Coordinates that nobody measures, behind those that are, in the order of the text.
    pub hidden: Vec<Hidden<'a>>,
    /// File and columns of every `data` statement.
    pub data: Vec<(&'a Word, &'a [DataItem])>,
    pub constants: Vec<Constant<'a>>,
    /// For each of them what it stands for, where that is no number.
    pub definitions: Vec<Option<Definition>>,
    pub parameters: Vec<Parameter<'a>>,
    pub energies: Vec<Energy<'a>>,
    pub forces: Vec<Force<'a>>,
    pub sensors: Vec<Sensor<'a>>,
    pub measures: Vec<Measure<'a>>,
    pub constraints: Vec<Constraint<'a>>,
    pub bodies: Vec<BodyOf<'a>>,
    pub names: HashMap<String, (Meaning, Span)>,
    /// Constants that are whole numbers: they may stand in indices.
    pub integers: HashMap<String, i64>,
    /// A statement that declares names could not be read: what is unknown may stand in it.
    pub lost_names: bool,
}

/// Gives names their meaning, and says what is missing or doubled.
pub(crate) fn resolve<'a>(spec: &'a SyntaxTree, diagnostics: &mut Vec<Diagnostic>) -> Resolved<'a> {
    let mut resolver = Resolver { out: Resolved::default(), diagnostics };
    let lost = |words: &[&str]| spec.lost.iter().any(|lost| words.contains(&lost.as_str()));
    let declaring = [
        "coordinates",
        "momenta",
        "velocities",
        "time",
        "input",
        "hidden",
        "state",
        "data",
        "constant",
        "let",
        "param",
        "measure",
        "body",
    ];
    // A misspelt first word may have been any of them.
    resolver.out.lost_names =
        lost(&declaring) || spec.lost.iter().any(|lost| lost != "L" && may_name(lost));
    resolver.constants(spec);
    let mut seen: HashMap<&str, Span> = HashMap::new();
    for statement in &spec.statements {
        resolver.statement(statement, &mut seen);
    }
    resolver.out.define();
    resolver.pair_up();
    resolver.append_hidden(spec);
    resolver.name_time();
    bodies::resolve(spec, &mut resolver.out, resolver.diagnostics);
    if !lost(&["T", "V", "H", "L"]) && !resolver.out.lost_names {
        resolver.require_energy();
    }
    resolver.out
}

struct Resolver<'a, 'd> {
    out: Resolved<'a>,
    diagnostics: &'d mut Vec<Diagnostic>,
}

impl<'a> Resolver<'a, '_> {
    fn report(&mut self, diagnostic: Diagnostic) {
        self.diagnostics.push(diagnostic);
    }

    /// Whole-numbered constants come first: the range of a family may need them.
    fn constants(&mut self, spec: &'a SyntaxTree) {
        for statement in &spec.statements {
            if let StatementKind::Constant { name, value, .. } = &statement.kind {
                let known = &self.out.integers;
                if let Ok(value) = integer(value, &|name| known.get(name).copied()) {
                    self.out.integers.insert(name.text.clone(), value);
                }
            }
        }
    }

    /// Reports a second statement of a kind that may stand once.
    fn once(&mut self, what: &'a str, span: Span, seen: &mut HashMap<&'a str, Span>) {
        if let Some(first) = seen.insert(what, span) {
            self.report(
                Diagnostic::error(span, format!("`{what}` is given twice"))
                    .label("given again here")
                    .hint(if matches!(what, "T" | "V" | "H" | "L") {
                        format!("write `{what} += ...` to add to it")
                    } else {
                        "keep one of them".to_string()
                    })
                    .related(first, "first given here"),
            );
        }
    }

    fn statement(&mut self, statement: &'a Statement, seen: &mut HashMap<&'a str, Span>) {
        let span = statement.site.0;
        let effect = statement.effect.as_deref();
        match &statement.kind {
            StatementKind::System(title) => {
                self.once("system", span, seen);
                self.out.title = Some(title.text.clone());
            }
            StatementKind::Variables { role, list } => {
                for declaration in list {
                    self.declare(*role, declaration);
                }
            }
            StatementKind::Time { name, unit } => {
                self.once("time", span, seen);
                self.out.time = Some((&name.text, unit.as_ref()));
                self.name(&name.text, Meaning::Time, name.site.0);
            }
            StatementKind::Input { name, unit, between } => {
                let meaning = Meaning::Input(self.out.inputs.len());
                self.name(&name.text, meaning, name.site.0);
                self.out.inputs.push(Input { name, unit: unit.as_ref(), between });
            }
            // They come behind all that is measured.
            StatementKind::Hidden(..) | StatementKind::State { .. } => {}
            StatementKind::Data { file, items } => {
                self.out.data.push((file, items));
            }
            StatementKind::Constant { name, value, by_let } => {
                let meaning = Meaning::Constant(self.out.constants.len());
                self.name(&name.text, meaning, name.site.0);
                self.out.constants.push(Constant { value, by_let: *by_let });
            }
            StatementKind::Parameter { name, starts, per, bounds } => {
                let meaning = Meaning::Parameter(self.out.parameters.len());
                self.name(&name.text, meaning, name.site.0);
                self.out.parameters.push(Parameter {
                    name,
                    starts,
                    per: per.as_ref(),
                    bounds: bounds.as_ref(),
                });
            }
            StatementKind::Energy { part, adds, value } => {
                if !adds {
                    self.once(part.letter(), span, seen);
                }
                self.out.energies.push(Energy { part: *part, value, effect });
            }
            StatementKind::Force { coordinate, value, comprehension, .. } => {
                let comprehension = comprehension.as_ref();
                self.out.forces.push(Force { coordinate, value, comprehension, effect });
            }
            StatementKind::Sensor { observable, value, comprehension } => {
                let comprehension = comprehension.as_ref();
                self.out.sensors.push(Sensor { observable, value, comprehension, effect });
            }
            StatementKind::Measure { name, unit, value, wrapped } => {
                let meaning = Meaning::Measure(self.out.measures.len());
                self.name(&name.text, meaning, name.site.0);
                let (unit, wrapped) = (unit.as_ref(), *wrapped);
                self.out.measures.push(Measure { name, unit, value, wrapped });
            }
            StatementKind::Body { name, .. } => {
                let meaning = Meaning::Body(self.out.bodies.len());
                self.name(&name.text, meaning, name.site.0);
                self.out.bodies.push(BodyOf { name, coordinates: Vec::new() });
            }
            // Their statements stand in their places where the spec was expanded.
            StatementKind::Effect { .. } | StatementKind::Candidates(_) => {}
            StatementKind::Constrain { first, rest } => {
                self.out.constraints.push(Constraint { first, rest, span });
            }
        }
    }

    fn name(&mut self, name: &str, meaning: Meaning, span: Span) {
        if !may_name(name) || name == "pi" {
            self.report(
                Diagnostic::error(span, format!("`{name}` cannot be a name"))
                    .label("it has a meaning of its own in the mini-language")
                    .hint("choose another name"),
            );
        } else if let Some(&(_, first)) = self.out.names.get(name) {
            self.report(
                Diagnostic::error(span, format!("the name `{name}` is taken"))
                    .label("named again here")
                    .hint("give every variable, constant and parameter a name of its own")
                    .related(first, "first named here"),
            );
        } else {
            self.out.names.insert(name.to_string(), (meaning, span));
        }
    }

    fn declare(&mut self, role: Role, declaration: &Declaration) {
        let name = &declaration.name.text;
        let span = declaration.site.0;
        let start = self.list(role).len();
        let unit = &declaration.unit;
        let Some(range) = &declaration.range else {
            self.name(name, Meaning::Variable(role, start), declaration.name.site.0);
            let declared = Declared { name: name.clone(), unit: unit.clone(), span };
            self.list(role).push(declared);
            return;
        };
        let known = &self.out.integers;
        let look_up = |name: &str| known.get(name).copied();
        let ends = (integer(&range.first, &look_up), integer(&range.last, &look_up));
        let (first, last) = match ends {
            (Ok(first), Ok(last)) => (first, last),
            (first, last) => {
                self.diagnostics.extend(first.err().into_iter().chain(last.err()));
                self.out.lost_names = true;
                return;
            }
        };
        let count = last.saturating_sub(first).saturating_add(1);
        if !(1..=MOST_COORDINATES).contains(&count) {
            let message = if count < 1 {
                format!("the range {first}..{last} is empty")
            } else {
                format!("`{name}` would be {count} variables")
            };
            self.report(
                Diagnostic::error(range.site.0, message)
                    .label("this range")
                    .hint(format!("write a range of 1 to {MOST_COORDINATES} indices, as in 1..5")),
            );
            self.out.lost_names = true;
            return;
        }
        let count = usize::try_from(count).unwrap_or(0);
        let meaning = Meaning::Family { role, first, start, count };
        self.name(name, meaning, declaration.name.site.0);
        let members = (first..=last).map(|i| Declared {
            name: format!("{name}[{i}]"),
            unit: unit.clone(),
            span,
        });
        self.list(role).extend(members);
    }

    fn list(&mut self, role: Role) -> &mut Vec<Declared> {
        match role {
            Role::Coordinates => &mut self.out.coordinates,
            Role::Momenta => &mut self.out.momenta,
            Role::Velocities => &mut self.out.velocities,
        }
    }

    /// Every coordinate needs its momentum; velocities alone imply the momenta.
    fn pair_up(&mut self) {
        let count = self.out.coordinates.len();
        let whole = |list: &[Declared]| match list {
            [first, .., last] => first.span.join(last.span),
            [only] => only.span,
            [] => Span::default(),
        };
        if self.out.lost_names {
            let velocities = !self.out.velocities.is_empty() || self.out.has_lagrangian();
            if self.out.momenta.is_empty() && velocities {
                self.imply_momenta();
            }
            return;
        }
        let Some(first) = self.out.coordinates.first() else {
            self.report(
                Diagnostic::error(Span::default(), "the spec has no coordinates")
                    .label("a spec says what moves")
                    .hint("write for example `coordinates theta [rad]`"),
            );
            return;
        };
        let at = whole(&self.out.coordinates);
        // Velocities in L need no names: `rate(x)` is one.
        let undeclared = self.out.momenta.is_empty() && self.out.velocities.is_empty();
        if undeclared && !self.out.has_lagrangian() {
            let example = &first.name;
            self.report(
                Diagnostic::error(at, "the coordinates have no momenta")
                    .label(match count {
                        1 => "this coordinate".to_string(),
                        _ => format!("these {count} coordinates"),
                    })
                    .hint(format!(
                        "name the momentum of `{example}` with `momenta`, or its measured velocity with `velocities`"
                    )),
            );
            return;
        }
        for role in [Role::Momenta, Role::Velocities] {
            let list = self.list(role);
            if !list.is_empty() && list.len() != count {
                let (found, span) = (list.len(), whole(list));
                let missing = self.out.coordinates.get(found).map(|declared| declared.name.clone());
                let message = match (&missing, role) {
                    (Some(name), Role::Momenta) => format!("the momentum of `{name}` is missing"),
                    (Some(name), _) => format!("the velocity of `{name}` is missing"),
                    (None, _) => format!("there are more {} than coordinates", role.keyword()),
                };
                self.report(
                    Diagnostic::error(span, message)
                        .label(format!("{found} {}", role.keyword()))
                        .hint("write one for each coordinate, in the same order")
                        .related(at, format!("{count} coordinates")),
                );
            }
        }
        if self.out.momenta.is_empty() {
            self.imply_momenta();
        }
    }

    /// Coordinates that nobody measures, and internal states, behind those that are declared: an
    /// addition to the spec leaves the places of all others as they are.
    ///
    /// An internal state stands in the list of coordinates too, with a momentum that has no name,
    /// is always zero and moves nothing: one layout of the state serves all.
    fn append_hidden(&mut self, spec: &'a SyntaxTree) {
        let velocities = !self.out.velocities.is_empty();
        for statement in &spec.statements {
            let (of, momentum, rate) = match &statement.kind {
                StatementKind::Hidden(of, momentum) => (of, momentum.as_ref(), None),
                StatementKind::State { of, rate } => (of, None, Some(rate)),
                _ => continue,
            };
            let coordinate = self.out.coordinates.len();
            let span = of.name.site.0;
            let name = &of.name.text;
            self.name(name, Meaning::Variable(Role::Coordinates, coordinate), span);
            self.out.coordinates.push(Declared { name: name.clone(), unit: of.unit.clone(), span });
            let declared = |name: String| Declared { name, unit: None, span };
            let meaning = Meaning::Variable(Role::Momenta, coordinate);
            let partner = match momentum {
                _ if rate.is_some() => declared(format!("momentum of {name}")),
                None => declared(format!("p_{name}")),
                Some(given) => Declared {
                    name: given.name.text.clone(),
                    unit: given.unit.clone(),
                    span: given.name.site.0,
                },
            };
            if rate.is_none() {
                self.name(&partner.name, meaning, partner.span);
            }
            self.out.momenta.push(partner);
            if velocities {
                self.out.velocities.push(declared(format!("rate of {name}")));
            }
            let effect = statement.effect.as_deref();
            self.out.hidden.push(Hidden { of, momentum, rate, coordinate, effect });
        }
    }

    /// `p_theta` for `theta`, `p_q[1]` for `q[1]`.
    fn imply_momenta(&mut self) {
        self.out.implied_momenta = true;
        let declared =
            |c: &Declared| Declared { name: format!("p_{}", c.name), unit: None, span: c.span };
        self.out.momenta = self.out.coordinates.iter().map(declared).collect();
        let mut implied: Vec<(String, Meaning, Span)> = Vec::new();
        for (name, &(meaning, span)) in &self.out.names {
            let meaning = match meaning {
                Meaning::Variable(Role::Coordinates, i) => Meaning::Variable(Role::Momenta, i),
                Meaning::Family { role: Role::Coordinates, first, start, count } => {
                    Meaning::Family { role: Role::Momenta, first, start, count }
                }
                _ => continue,
            };
            implied.push((format!("p_{name}"), meaning, span));
        }
        implied.sort_by_key(|&(_, _, span)| span);
        for (name, meaning, span) in implied {
            self.name(&name, meaning, span);
        }
    }

    /// Without a `time` statement, time is called as its column is, or t; its unit is that of the
    /// column, or of the time between samples.
    fn name_time(&mut self) {
        if self.out.time.is_some() {
            return;
        }
        let mut items = self.out.data.iter().flat_map(|(_, items)| items.iter());
        let told = items.find_map(|item| match &item.kind {
            DataItemKind::Time { column, unit } => {
                Some((column.text.as_str(), unit.as_ref(), column.site.0))
            }
            DataItemKind::Every(period) => match &period.kind {
                ExpressionKind::Quantity(_, unit) => Some(("t", Some(unit), unit.site.0)),
                _ => None,
            },
            _ => None,
        });
        let (name, unit, span) = told.unwrap_or(("t", None, Span::default()));
        self.out.time = told.map(|_| (name, unit));
        let name = if may_name(name) { name } else { "t" };
        self.out.names.entry(name.to_string()).or_insert((Meaning::Time, span));
    }

    fn require_energy(&mut self) {
        if self.out.energies.is_empty() && !self.out.coordinates.is_empty() {
            self.report(
                Diagnostic::error(Span::default(), "the spec has no energy")
                    .label("neither T, V nor H is given")
                    .hint(
                        "write for example `T = span{ poly(p; 2) }` and `V = span{ poly(q; 4) }`",
                    ),
            );
        }
    }
}

impl Resolved<'_> {
    /// What time is called in expressions.
    pub(crate) fn time_name(&self) -> String {
        let named = |(name, (meaning, _)): (&String, &(Meaning, Span))| {
            (*meaning == Meaning::Time).then(|| name.clone())
        };
        self.names.iter().find_map(named).unwrap_or_else(|| "t".to_string())
    }

    /// What columns show that is no part of the state.
    pub(crate) fn measure_names(&self) -> Vec<String> {
        self.measures.iter().map(|measure| measure.name.text.clone()).collect()
    }

    /// The names that a mistyped one may have meant.
    pub(crate) fn hint_for(&self, name: &str, more: &[&str]) -> String {
        let mut names: Vec<&str> = self.names.keys().map(String::as_str).collect();
        names.sort_unstable();
        match nearest(name, names.iter().copied().chain(more.iter().copied())) {
            Some(near) => format!("did you mean `{near}`?"),
            None if names.is_empty() => "declare it first".to_string(),
            None => format!("known names are {}", names.join(", ")),
        }
    }
}
