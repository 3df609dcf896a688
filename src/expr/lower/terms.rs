//! The function space: items of `span{ }` become terms, each of them once.

use super::super::functions::Function;
use super::super::graph::{Expr, Node, Symbol};
use super::super::print::Names;
use super::super::system::{Bounds, Place, Term};
use super::super::unit::Unit;
use super::value::Value;
use super::{Lowering, MOST_TERMS};
use crate::diagnostic::{Diagnostic, Severity, Span};
use crate::spec::ast::*;
use crate::spec::families::{self, FamilyRow, Member, Wave};
use crate::spec::resolve::{Force, Meaning};

/// A term before labels and constraints.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DraftTerm {
    pub place: Place,
    pub expr: Expr,
    pub unit: Option<Unit>,
    pub name: Option<String>,
    pub span: Span,
    /// Written out, not a member of a family.
    pub explicit: bool,
    /// Further places where the same coefficient stands.
    pub also: Vec<TermPart>,
    pub effect: Option<String>,
    /// As it was written, where the expression does not print like that.
    pub text: Option<String>,
}

/// What a coefficient multiplies at a further place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TermPart {
    pub place: Place,
    pub expr: Expr,
    pub unit: Option<Unit>,
    pub span: Span,
}

const COORDINATE: u8 = 1;
const MOMENTUM: u8 = 2;
const OTHER: u8 = 4;
const BROKEN: u8 = 8;
const VELOCITY: u8 = 16;

pub(super) fn holds_span(expression: &Expression) -> Option<Span> {
    let any = |parts: &[(bool, Expression)]| parts.iter().find_map(|(_, part)| holds_span(part));
    match &expression.kind {
        ExpressionKind::Span(_) => Some(expression.site.0),
        ExpressionKind::Sum(parts) | ExpressionKind::Product(parts) => any(parts),
        ExpressionKind::Negate(inner) | ExpressionKind::Quantity(inner, _) => holds_span(inner),
        ExpressionKind::Power(base, exponent) => holds_span(base).or_else(|| holds_span(exponent)),
        ExpressionKind::Call { arguments, .. } => arguments.iter().find_map(holds_span),
        ExpressionKind::SumOver { body, .. } => holds_span(body),
        _ => None,
    }
}

impl Lowering<'_> {
    /// One side of `T = ...`: known parts and function spaces, added.
    pub(super) fn side(&mut self, place: Place, expression: &Expression, minus: bool) {
        match &expression.kind {
            ExpressionKind::Sum(parts) if holds_span(expression).is_some() => {
                for (negative, part) in parts {
                    self.side(place, part, minus != *negative);
                }
            }
            ExpressionKind::Negate(inner) => self.side(place, inner, !minus),
            ExpressionKind::Span(items) => {
                for item in items {
                    self.item(place, item, minus);
                }
            }
            _ => {
                let Some(value) = self.value(expression) else { return };
                let expr = if minus { self.graph.negate(value.expr) } else { value.expr };
                self.require_finite(expr, expression.site.0);
                self.known.push((place, Value { expr, ..value }, expression.site.0));
            }
        }
    }

    /// Reports numbers in an expression that are not finite.
    pub(super) fn require_finite(&mut self, expr: Expr, span: Span) {
        if self.depends_on(expr) & BROKEN != 0 {
            self.not_finite(span);
        }
    }

    /// A `force` statement, for every combination of its indices.
    pub(super) fn force(&mut self, force: &Force) {
        let one = |lowering: &mut Self| {
            if let Some(i) = lowering.coordinate(force.coordinate) {
                lowering.side(Place::Force(i), force.value, false);
            }
        };
        match force.comprehension {
            Some(comprehension) => {
                self.each(comprehension, &mut { one });
            }
            None => one(self),
        }
    }

    /// The number of the coordinate that an expression names.
    pub(super) fn coordinate(&mut self, expression: &Expression) -> Option<usize> {
        let value = self.value(expression)?;
        match self.graph.node(value.expr) {
            Node::Symbol(Symbol::Coordinate(i)) => Some(*i),
            _ => {
                self.report(
                    Diagnostic::error(
                        expression.site.0,
                        format!("`{expression}` is not a coordinate"),
                    )
                    .label("a force acts on a coordinate")
                    .hint(match self.resolved.coordinates.first() {
                        Some(first) => format!("write for example `force {} += ...`", first.name),
                        None => "declare it: `coordinates x`".to_string(),
                    }),
                );
                None
            }
        }
    }

    fn not_finite(&mut self, span: Span) {
        self.report(
            Diagnostic::error(span, "this is not finite")
                .label("a number in it overflows or divides by zero")
                .hint("correct the numbers"),
        );
    }

    pub(super) fn item(&mut self, place: Place, item: &Item, minus: bool) {
        if let Some(span) = holds_span(&item.body) {
            self.report(
                Diagnostic::error(span, "span inside span")
                    .label("this one is inside another")
                    .hint("write all items in one span{ }"),
            );
            return;
        }
        let family = match &item.body.kind {
            ExpressionKind::Call { name, arguments, order } => {
                families::by_name(name).map(|row| (row, arguments.as_slice(), order.as_deref()))
            }
            _ => None,
        };
        let mut repeated = Repeated::default();
        let sign = if minus { -1.0 } else { 1.0 };
        let mut one = |lowering: &mut Self| {
            let indices = &lowering.indices;
            let name = item.name.as_ref().map(|name| indexed_name(&name.text, indices));
            // The rate of a variable is a long expression; people read it as it was written.
            let long = place.is_sensor() || lowering.resolved.names_velocity(&item.body);
            let text = (long && indices.is_empty())
                .then(|| format!("{}{}", if minus { "-" } else { "" }, item.body));
            match family {
                Some((row, arguments, order)) => {
                    let span = item.body.site.0;
                    let members = lowering.family(row, arguments, order, span);
                    for (i, value) in members.into_iter().flatten().enumerate() {
                        let name = name.as_ref().map(|name| format!("{name}[{}]", i + 1));
                        let found = FoundTerm { place, value, sign, name, span, text: None };
                        lowering.add(found, false, &mut repeated);
                    }
                }
                None => {
                    if let Some(value) = lowering.value(&item.body) {
                        let span = item.body.site.0;
                        let found = FoundTerm { place, value, sign, name, span, text };
                        lowering.add(found, true, &mut repeated);
                    }
                }
            }
        };
        match &item.comprehension {
            Some(comprehension) if item.alike => {
                for found in self.alike((place, sign), item, comprehension, family) {
                    self.add(found, family.is_none(), &mut repeated);
                }
            }
            Some(comprehension) => {
                self.each(comprehension, &mut one);
            }
            None => one(self),
        }
        if let Some(expr) = repeated.first {
            let label = self.graph.text(expr, &self.symbol_names());
            let message = match repeated.count {
                1 => format!(
                    "`{label}` also stands elsewhere in the function space; it is kept once"
                ),
                n => format!(
                    "`{label}` and {} more terms also stand elsewhere in the function space; each is kept once",
                    n - 1
                ),
            };
            self.report(
                Diagnostic::new(Severity::Note, item.body.site.0, message)
                    .label("overlaps another item")
                    .hint("nothing needs to be done"),
            );
        }
    }

    /// The members of a family over its arguments; `None` after a diagnostic.
    pub(super) fn family(
        &mut self,
        row: &FamilyRow,
        arguments: &[Expression],
        order: Option<&Expression>,
        span: Span,
    ) -> Option<Vec<Value>> {
        let hint = format!("write `{}`", row.signature);
        let Some(order) = order else {
            let message = format!("`{}` needs an order after a semicolon", row.name);
            self.report(Diagnostic::error(span, message).label("no order is given").hint(hint));
            return None;
        };
        if arguments.is_empty() {
            self.wrong_arity(row.name, "one or more variables", 0, span, &hint);
            return None;
        }
        let degree = self.integer(order)?;
        let Ok(size) = u64::try_from(degree) else {
            self.report(
                Diagnostic::error(order.site.0, "the order is negative")
                    .label(format!("{degree}"))
                    .hint("write a whole number from 1 on"),
            );
            return None;
        };
        if size == 0 {
            self.report(
                Diagnostic::error(order.site.0, format!("`{}` of order 0 is empty", row.name))
                    .label("no term is left")
                    .hint("write a whole number from 1 on"),
            );
            return None;
        }
        let variables = self.variables(arguments)?;
        let count = (row.size)(variables.len() as u64, size);
        self.make_room(
            count,
            span,
            &format!("`{}` of order {degree} in {} variables", row.name, variables.len()),
        )?;
        for (value, at) in &variables {
            if row.needs_number {
                let what = format!("an argument of `{}`", row.name);
                self.require_number(value.unit, *at, &what);
            }
        }
        let degree = u32::try_from(size).unwrap_or(u32::MAX);
        let members = (row.members)(variables.len(), degree);
        Some(members.iter().map(|member| self.member(member, &variables)).collect())
    }

    /// Takes up `count` more terms, or says how many there would be.
    fn make_room(&mut self, count: u128, span: Span, what: &str) -> Option<()> {
        self.expected = self.expected.saturating_add(count);
        if self.expected <= MOST_TERMS {
            return Some(());
        }
        let terms = if count >= u128::MAX - 1 {
            "more terms than can be counted".to_string()
        } else {
            format!("{count} terms")
        };
        self.report(
            Diagnostic::error(span, format!("the function space is too large: {what} has {terms}"))
                .label(format!("{terms}; at most {MOST_TERMS} are possible in all"))
                .hint("lower the degree, or take fewer variables together"),
        );
        None
    }

    /// The arguments of a family: single quantities, whole indexed families, and ranges of them.
    fn variables(&mut self, arguments: &[Expression]) -> Option<Vec<(Value, Span)>> {
        let resolved = self.resolved;
        let mut out: Vec<(Value, Span)> = Vec::new();
        let mut sound = true;
        for argument in arguments {
            let span = argument.site.0;
            let whole = match &argument.kind {
                ExpressionKind::Name(name) => match resolved.names.get(name) {
                    Some(&(Meaning::Family { first, count, .. }, _)) => {
                        Some((name, first, first + count as i64 - 1))
                    }
                    _ => None,
                },
                ExpressionKind::Slice { name, range } => {
                    let ends = (self.integer(&range.first), self.integer(&range.last));
                    let (Some(first), Some(last)) = ends else {
                        sound = false;
                        continue;
                    };
                    if first > last {
                        self.report(
                            Diagnostic::error(
                                range.site.0,
                                format!("the range {first}..{last} is empty"),
                            )
                            .label("no variable is in it")
                            .hint("write the smaller index first"),
                        );
                        sound = false;
                        continue;
                    }
                    Some((name, first, last))
                }
                _ => None,
            };
            let Some((name, first, last)) = whole else {
                match self.value(argument) {
                    Some(value) => out.push((value, span)),
                    None => sound = false,
                }
                continue;
            };
            for index in first..=last {
                let index =
                    Expression { kind: ExpressionKind::Number(index as f64), site: argument.site };
                let kind = ExpressionKind::Index { name: name.clone(), index: Box::new(index) };
                match self.value(&Expression { kind, site: argument.site }) {
                    Some(value) => out.push((value, span)),
                    None => {
                        sound = false;
                        break;
                    }
                }
            }
        }
        let mut seen: Vec<(Expr, Span)> =
            out.iter().map(|(value, span)| (value.expr, *span)).collect();
        seen.sort_by_key(|&(expr, span)| (expr, span));
        for (&(one, span), &(next, again)) in seen.iter().zip(seen.iter().skip(1)) {
            if one == next {
                sound = false;
                let text = self.graph.text(one, &self.symbol_names());
                self.report(
                    Diagnostic::error(again, format!("the variable `{text}` is given twice"))
                        .label("given again here")
                        .hint("name each variable of a family once")
                        .related(span, "first given here"),
                );
            }
        }
        sound.then_some(out)
    }

    fn member(&mut self, member: &Member, variables: &[(Value, Span)]) -> Value {
        match member {
            Member::Monomial(powers) => {
                let mut unit = Some(Unit::ONE);
                let mut parts = Vec::with_capacity(powers.len());
                for &(i, exponent) in powers {
                    let Some(&(value, _)) = variables.get(i) else { continue };
                    parts.push((value.expr, f64::from(exponent)));
                    let exponent =
                        i32::try_from(exponent).ok().map(num_rational::Ratio::from_integer);
                    unit = unit
                        .zip(value.unit)
                        .zip(exponent)
                        .and_then(|((unit, base), exponent)| unit.times(base.power(exponent)?));
                }
                Value { expr: self.graph.product(1.0, &parts), unit }
            }
            Member::Harmonic { wave, variable, harmonic } => {
                let variable = variables.get(*variable);
                let variable = variable.map_or_else(|| self.graph.number(0.0), |(own, _)| own.expr);
                let argument = self.graph.scale(f64::from(*harmonic), variable);
                let function = match wave {
                    Wave::Sine => Function::SIN,
                    Wave::Cosine => Function::COS,
                };
                Value { expr: self.graph.apply(function, argument), unit: Some(Unit::ONE) }
            }
        }
    }

    fn add(&mut self, found: FoundTerm, explicit: bool, repeated: &mut Repeated) {
        let FoundTerm { place, value, sign, name, span, text } = found;
        let on = self.depends_on(value.expr);
        if on & BROKEN != 0 {
            return self.not_finite(span);
        }
        if on & VELOCITY != 0 {
            return self.not_linear(span);
        }
        if self.graph.is_zero(value.expr) {
            self.report(
                Diagnostic::error(span, "this term is zero")
                    .label("nothing is left of it")
                    .hint("take it away"),
            );
            return;
        }
        let outside = (!place.is_energy()).then_some(place);
        if on & (COORDINATE | MOMENTUM) == 0 && outside.is_none() {
            let label = self.graph.text(value.expr, &self.symbol_names());
            self.report(
                Diagnostic::warning(
                    span,
                    format!("the term `{label}` cannot be learned; it is left out"),
                )
                .label("does not depend on the state")
                .hint("only derivatives of H move anything, so a constant in H has no effect"),
            );
            return;
        }
        if explicit && self.make_room(1, span, "with this item it").is_none() {
            return;
        }
        let key = (outside, self.direction(value.expr));
        let expr = if sign < 0.0 { self.graph.negate(value.expr) } else { value.expr };
        let unit = value.unit;
        if let Some(name) = name.as_ref().filter(|name| self.is_shared(name))
            && !self.first_of_shared(name, TermPart { place, expr, unit, span })
        {
            return;
        }
        let is_shared = name.as_ref().is_some_and(|name| self.is_shared(name));
        let effect = self.effect.clone();
        let also = Vec::new();
        let draft = DraftTerm { place, expr, unit, name, span, explicit, also, effect, text };
        if is_shared {
            // Tied to other places, it may stand beside a term of its own.
            self.drafts.push(draft);
            return;
        }
        let standing = self.index.get(&key).copied();
        let Some(first) = standing.and_then(|at| self.drafts.get_mut(at)) else {
            self.index.insert(key, self.drafts.len());
            self.drafts.push(draft);
            return;
        };
        if first.explicit && explicit {
            let first_span = first.span;
            let label = self.graph.text(value.expr, &self.symbol_names());
            let again = match &self.effect {
                Some(effect) => format!("`{effect}` adds what stands elsewhere"),
                None => "stands here again".to_string(),
            };
            let mut diagnostic = Diagnostic::error(span, format!("duplicate term `{label}`"))
                .label(again)
                .hint("keep one of them; two coefficients of one term cannot be told apart");
            if first_span != span {
                diagnostic = diagnostic.related(first_span, "first stands here");
            }
            self.report(diagnostic);
            return;
        }
        repeated.count += 1;
        repeated.first = repeated.first.or(Some(value.expr));
        if explicit {
            *first = draft;
        }
    }

    /// The expression without a number in front of it.
    fn direction(&self, expr: Expr) -> Expr {
        match self.graph.node(expr) {
            Node::Sum { constant, terms } if constant.value() == 0.0 => match &**terms {
                [(only, _)] => *only,
                _ => expr,
            },
            _ => expr,
        }
    }

    /// What an expression depends on; each node of the graph is looked at once.
    fn depends_on(&mut self, expr: Expr) -> u8 {
        for i in self.dependence.len()..self.graph.len() {
            let node = Expr(i as u32);
            let own = match self.graph.node(node) {
                Node::Number(number) if !number.value().is_finite() => BROKEN,
                Node::Symbol(Symbol::Coordinate(_)) => COORDINATE,
                Node::Symbol(Symbol::Momentum(_)) => MOMENTUM,
                Node::Symbol(Symbol::Velocity(_)) => VELOCITY,
                Node::Symbol(_) => OTHER,
                Node::Sum { constant, terms } => {
                    let finite = constant.value().is_finite()
                        && terms.iter().all(|(_, factor)| factor.value().is_finite());
                    if finite { 0 } else { BROKEN }
                }
                Node::Product(parts) => {
                    let finite = parts.iter().all(|(_, exponent)| exponent.value().is_finite());
                    let known = parts.iter().any(|&(base, _)| self.graph.as_number(base).is_some());
                    if finite && !known { 0 } else { BROKEN }
                }
                _ => 0,
            };
            let of_children = self.graph.children(node);
            let of_children =
                of_children.iter().filter_map(|child| self.dependence.get(child.0 as usize));
            let all = of_children.fold(own, |all, one| all | one);
            self.dependence.push(all);
        }
        self.dependence.get(expr.0 as usize).copied().unwrap_or(BROKEN)
    }

    /// Names of the symbols, without those of coefficients.
    pub(super) fn symbol_names(&self) -> Names {
        let resolved = self.resolved;
        Names {
            coordinates: resolved.coordinates.iter().map(|d| d.name.clone()).collect(),
            momenta: resolved.momenta.iter().map(|d| d.name.clone()).collect(),
            inputs: resolved.inputs.iter().map(|input| input.name.text.clone()).collect(),
            parameters: resolved.parameters.iter().map(|p| p.name.text.clone()).collect(),
            coefficients: Vec::new(),
        }
    }

    /// Terms with labels and units.
    pub(super) fn finish_terms(
        &mut self,
        drafts: Vec<DraftTerm>,
        energy: Option<Unit>,
    ) -> Vec<Term> {
        let names = self.symbol_names();
        let terms = drafts.into_iter().map(|draft| {
            let unit = self.coefficient_unit(&draft, energy);
            Term {
                place: draft.place,
                also: draft.also.iter().map(|part| (part.place, part.expr)).collect(),
                effect: draft.effect,
                label: draft.text.unwrap_or_else(|| self.graph.text(draft.expr, &names)),
                expr: draft.expr,
                name: draft.name,
                bounds: Bounds::FREE,
                unit,
                unit_text: unit.map(|unit| unit.to_string()),
            }
        });
        terms.collect()
    }
}

/// A member of the function space where it was found.
pub(super) struct FoundTerm {
    pub(super) place: Place,
    pub(super) value: Value,
    pub(super) sign: f64,
    pub(super) name: Option<String>,
    pub(super) span: Span,
    pub(super) text: Option<String>,
}

/// Terms of an item that stood elsewhere already.
#[derive(Default)]
struct Repeated {
    count: usize,
    first: Option<Expr>,
}

/// `k` for i = 2, j = 3 is called `k[2,3]`.
fn indexed_name(name: &str, indices: &[(String, i64)]) -> String {
    if indices.is_empty() {
        return name.to_string();
    }
    let values: Vec<String> = indices.iter().map(|(_, value)| value.to_string()).collect();
    format!("{name}[{}]", values.join(","))
}
