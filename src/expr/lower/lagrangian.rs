//! Energies written as functions of velocities, and the Legendre transform to momenta.
//!
//! L = v^T M v / 2 + b^T v - V has p = M v + b and H = (p - b)^T M^-1 (p - b) / 2 + V, where M, b
//! and V depend on the coordinates (Landau and Lifshitz, Mechanics, section 40). A coordinate
//! whose velocity does not stand in L keeps what T or H say of its momentum.

use std::collections::HashMap;

use nalgebra::DMatrix;

use super::super::graph::{Expr, Symbol};
use super::super::system::Place;
use super::terms::{DraftTerm, TermPart, holds_span};
use super::value::Value;
use super::{Context, Lowering};
use crate::diagnostic::{Diagnostic, Severity, Span};
use crate::spec::ast::{EnergyPart, Expression, ExpressionKind};

/// A mass matrix is singular where its smallest singular value is below this part of the largest.
const SINGULAR: f64 = 1e-10;

/// At how many places mass matrices are looked at.
const PLACES: usize = 8;

/// What is known of the motion as a function of velocities.
#[derive(Debug, Clone, Default)]
pub(super) struct Lagrangian {
    /// The parts of L, and those of T that name velocities.
    parts: Vec<(Value, Span)>,
    /// Their summands, so that a message can point at one.
    summands: Vec<(Expr, Span)>,
    /// How many of them were transformed.
    done: usize,
    /// The known parts of H that were made of them.
    transformed: Vec<(Place, Expr, Span)>,
    /// The transform was refused: nothing more is said about velocities.
    failed: bool,
    /// A force names a velocity, which is then a known function of coordinates and momenta.
    in_forces: bool,
}

impl Lagrangian {
    /// Its parts with their units, which are all that of H.
    pub(super) fn parts(&self) -> impl Iterator<Item = (Place, Value, Span)> + '_ {
        self.parts.iter().map(|&(value, span)| (Place::Hamiltonian, value, span))
    }
}

impl Lowering<'_> {
    /// One side of `L = ...`, or of `T = ...` where it names velocities.
    pub(super) fn velocity_side(&mut self, part: EnergyPart, expression: &Expression, minus: bool) {
        match &expression.kind {
            ExpressionKind::Sum(parts) if holds_span(expression).is_some() => {
                for (negative, inner) in parts {
                    self.velocity_side(part, inner, minus != *negative);
                }
            }
            ExpressionKind::Negate(inner) => self.velocity_side(part, inner, !minus),
            ExpressionKind::Span(_) if part == EnergyPart::Kinetic => {
                self.not_linear(expression.site.0);
            }
            // What holds no velocity is a part of -V.
            ExpressionKind::Span(items) => {
                for item in items {
                    self.item(Place::Potential, item, !minus);
                }
            }
            _ => {
                let Some(value) = self.value(expression) else { return };
                let expr = if minus { self.graph.negate(value.expr) } else { value.expr };
                self.require_finite(expr, expression.site.0);
                self.lagrangian.parts.push((Value { expr, ..value }, expression.site.0));
                let summands = match &expression.kind {
                    ExpressionKind::Sum(parts) => parts.iter().map(|(_, part)| part).collect(),
                    _ => vec![expression],
                };
                for summand in summands {
                    let lowered = self.value(summand).map(|value| (value.expr, summand.site.0));
                    self.lagrangian.summands.extend(lowered);
                }
            }
        }
    }

    /// Refuses a learned term that H would not be linear in.
    pub(super) fn not_linear(&mut self, span: Span) {
        self.report(
            Diagnostic::error(span, "a coefficient of velocities cannot be that of a term")
                .label("H divides by the masses, and is not linear in it")
                .hint("make it a parameter: `param m = 1 in 0..`, and `m*...` outside of span{ }"),
        );
    }

    /// Puts momenta in the place of velocities, once all energies are lowered.
    pub(super) fn legendre_transform(&mut self) {
        if self.lagrangian.done == self.lagrangian.parts.len() {
            return;
        }
        self.lagrangian.done = self.lagrangian.parts.len();
        let old = std::mem::take(&mut self.lagrangian.transformed);
        self.known.retain(|(place, value, span)| !old.contains(&(*place, value.expr, *span)));
        let Some(&(_, span)) = self.lagrangian.parts.first() else { return };
        let before = self.diagnostics.len();
        if self.diagnostics.iter().all(|d| d.severity != Severity::Error)
            && let Some((quadratic, rest)) = self.transformed()
        {
            let of_coordinates = |s: &Symbol| matches!(s, Symbol::Coordinate(_));
            let mixed = self.graph.symbols(&[quadratic]).iter().any(of_coordinates);
            let place = if mixed { Place::Hamiltonian } else { Place::Kinetic };
            for (place, expr) in [(place, quadratic), (Place::Potential, rest)] {
                if !self.graph.is_zero(expr) {
                    self.lagrangian.transformed.push((place, expr, span));
                    // Units are checked where they were written.
                    self.known.push((place, Value { expr, unit: None }, span));
                }
            }
            self.require_inertia(span);
        }
        self.lagrangian.failed =
            self.lagrangian.transformed.is_empty() || self.diagnostics.len() > before;
    }

    /// (p - b)^T M^-1 (p - b) / 2 and V; `None` after a diagnostic.
    fn transformed(&mut self) -> Option<(Expr, Expr)> {
        let parts: Vec<(f64, Expr)> =
            self.lagrangian.parts.iter().map(|(value, _)| (1.0, value.expr)).collect();
        let whole = self.graph.linear(0.0, &parts);
        let moving: Vec<usize> = (self.graph.symbols(&[whole]).into_iter())
            .filter_map(|symbol| match symbol {
                Symbol::Velocity(i) => Some(i),
                _ => None,
            })
            .collect();
        let velocities: Vec<Symbol> = moving.iter().map(|&i| Symbol::Velocity(i)).collect();
        let gradient = self.graph.gradient(whole, &velocities);
        let mut mass: Vec<Vec<Expr>> = self.graph.hessian(whole, &velocities);
        if self.holds_velocity(&mass.concat()) {
            self.not_quadratic(&velocities);
            return None;
        }
        let zero = self.graph.number(0.0);
        let at_rest: HashMap<Symbol, Expr> = velocities.iter().map(|&v| (v, zero)).collect();
        let mut momenta = Vec::with_capacity(moving.len());
        for (&i, slope) in moving.iter().zip(gradient) {
            let linear = self.graph.substitute(slope, &at_rest);
            let linear = self.graph.with_merged_angles(linear);
            let momentum = self.graph.symbol(Symbol::Momentum(i));
            momenta.push(self.graph.subtract(momentum, linear));
        }
        for entry in mass.iter_mut().flatten() {
            *entry = self.graph.with_merged_angles(*entry);
        }
        let rest = self.graph.substitute(whole, &at_rest);
        let rest = self.graph.negate(rest);
        let form = self.graph.inverse_form(&mass, &momenta);
        let Some(form) = form.filter(|_| !self.is_singular(&mass)) else {
            self.singular();
            return None;
        };
        Some((self.graph.scale(0.5, form), rest))
    }

    fn holds_velocity(&self, exprs: &[Expr]) -> bool {
        self.graph.symbols(exprs).iter().any(|symbol| matches!(symbol, Symbol::Velocity(_)))
    }

    /// Says which part is not quadratic in the velocities.
    fn not_quadratic(&mut self, velocities: &[Symbol]) {
        let summands = self.lagrangian.summands.clone();
        let mut wrong = summands.first().map(|&(_, span)| span);
        for (expr, span) in summands {
            let second = self.graph.hessian(expr, velocities).concat();
            if self.holds_velocity(&second) {
                wrong = Some(span);
                break;
            }
        }
        let Some(span) = wrong else { return };
        self.report(
            Diagnostic::error(span, "this is not quadratic in the velocities")
                .label("a velocity stands here other than to the first or second power")
                .hint("write `H = ...` of momenta: no formula gives it for every such energy"),
        );
    }

    /// Whether a mass matrix is singular wherever it was looked at, parameters at their starts.
    fn is_singular(&self, mass: &[Vec<Expr>]) -> bool {
        let n = mass.len();
        let mut looked = false;
        if n == 0 {
            return false;
        }
        for place in 0..PLACES {
            let of = |symbol: Symbol| match symbol {
                Symbol::Coordinate(i) => 1.4 * (1.0 + 2.3 * place as f64 + 1.7 * i as f64).sin(),
                Symbol::Parameter(j) => self.starts.get(j).copied().unwrap_or(1.0),
                _ => 0.7,
            };
            let masses = mass.iter().flatten().map(|&entry| self.graph.value(entry, &of));
            let mut at = DMatrix::from_row_iterator(n, n, masses);
            if at.iter().any(|x| !x.is_finite()) {
                continue;
            }
            looked = true;
            // Coordinates in units of their own must not look singular beside each other.
            let sizes: Vec<f64> = at.row_iter().map(|row| row.amax().sqrt()).collect();
            for (i, row) in sizes.iter().enumerate() {
                for (j, column) in sizes.iter().enumerate() {
                    if let Some(entry) = at.get_mut((i, j)) {
                        *entry /= (row * column).max(f64::MIN_POSITIVE);
                    }
                }
            }
            let values = at.singular_values();
            if values.min() > SINGULAR * values.max() {
                return false;
            }
        }
        looked
    }

    fn singular(&mut self) {
        let span = self.lagrangian.parts.iter().map(|&(_, span)| span);
        let Some(span) = span.reduce(Span::join) else { return };
        let (label, hint) = match self.resolved.parameters.is_empty() {
            true => (
                "some motion has no kinetic energy",
                "give every coordinate a mass, or write fewer coordinates",
            ),
            false => (
                "some motion has no kinetic energy where the parameters start",
                "start masses and lengths away from 0, or write fewer coordinates",
            ),
        };
        let message = "the mass matrix is singular: the velocities do not follow from momenta";
        self.report(Diagnostic::error(span, message).label(label).hint(hint));
    }

    /// That every coordinate has its momentum or its velocity in some energy.
    fn require_inertia(&mut self, span: Span) {
        let energy = self.known_energy();
        let drafts = self.drafts.iter().flat_map(energies_of);
        let exprs: Vec<Expr> = std::iter::once(energy).chain(drafts).collect();
        let there = self.graph.symbols(&exprs);
        let internal = |i: usize| {
            let mut hidden = self.resolved.hidden.iter();
            hidden.any(|hidden| hidden.coordinate == i && hidden.rate.is_some())
        };
        let missing = (0..self.coordinates.len())
            .find(|&i| !internal(i) && there.binary_search(&Symbol::Momentum(i)).is_err());
        let Some(declared) = missing.and_then(|i| self.resolved.coordinates.get(i)) else { return };
        let name = &declared.name;
        self.report(
            Diagnostic::error(span, format!("`{name}` has no kinetic energy"))
                .label(format!("its velocity, `rate({name})`, does not stand here"))
                .hint("write the kinetic energy of every coordinate")
                .related(declared.span, "declared here"),
        );
    }

    /// The known part of H.
    pub(super) fn known_energy(&mut self) -> Expr {
        let parts: Vec<(f64, Expr)> = (self.known.iter())
            .filter(|(place, ..)| place.is_energy())
            .map(|(_, value, _)| (1.0, value.expr))
            .collect();
        self.graph.linear(0.0, &parts)
    }

    /// The velocity of a coordinate as a function of coordinates and momenta, for a force. No
    /// learned term may stand in it: the equations of motion are linear in the coefficients.
    pub(super) fn velocity_in_force(&mut self, i: usize, name: &str, span: Span) -> Option<Value> {
        if self.lagrangian.failed {
            return None;
        }
        let of_momenta = |graph: &super::Graph, expr| {
            graph.symbols(&[expr]).iter().any(|s| matches!(s, Symbol::Momentum(_)))
        };
        let mut terms = self.drafts.iter().flat_map(energies_of);
        let term = terms.find(|&expr| of_momenta(&self.graph, expr));
        drop(terms);
        if let Some(term) = term {
            let term = self.graph.text(term, &self.symbol_names());
            let momentum = self.resolved.momenta.get(i).map_or("p", |p| p.name.as_str());
            self.report(
                Diagnostic::error(span, format!("the velocity `{name}` is not known in a force"))
                    .label(format!("it would depend on the learned term `{term}`"))
                    .hint(format!("write it with `{momentum}`, or make T known, with `param`s")),
            );
            return None;
        }
        self.lagrangian.in_forces = true;
        let energy = self.known_energy();
        let expr = self.graph.derivative(energy, Symbol::Momentum(i));
        Some(Value { expr, unit: self.velocity_unit(i) })
    }

    /// The unit of a velocity: as it was declared, or that of its coordinate over that of time.
    pub(super) fn velocity_unit(&self, i: usize) -> Option<super::Unit> {
        let declared = self.velocities.get(i).copied().flatten();
        declared.or_else(|| self.coordinates.get(i).copied().flatten()?.over(self.time?))
    }

    /// Whether a force names a velocity which additions to H have changed since the known part of
    /// H was `energy` and there were so many terms.
    pub(super) fn changes_velocities(&mut self, energy: Expr, terms: usize) -> bool {
        let now = self.known_energy();
        let added = self.graph.subtract(now, energy);
        let new = self.drafts.iter().skip(terms).flat_map(energies_of);
        let exprs: Vec<Expr> = std::iter::once(added).chain(new).collect();
        let changes = |symbol: &Symbol| matches!(symbol, Symbol::Momentum(_));
        self.lagrangian.in_forces && self.graph.symbols(&exprs).iter().any(changes)
    }

    /// The velocity of coordinate i where it stands for itself.
    pub(super) fn own_velocity(&mut self, i: usize) -> Value {
        Value { expr: self.graph.symbol(Symbol::Velocity(i)), unit: self.velocity_unit(i) }
    }

    /// d/dt of a function of coordinates by the chain rule, velocities standing for themselves or,
    /// in a force, as momenta tell them; `None` after a diagnostic.
    pub(super) fn rate_by_velocities(
        &mut self,
        expr: Expr,
        symbols: &[Symbol],
        span: Span,
    ) -> Option<Expr> {
        if symbols.iter().any(|symbol| matches!(symbol, Symbol::Velocity(_))) {
            self.report(
                Diagnostic::error(span, "an acceleration stands in an energy")
                    .label("the rate of a velocity")
                    .hint("T and L are functions of coordinates and velocities"),
            );
            return None;
        }
        let mut parts = vec![(1.0, self.rate_of_driver(expr))];
        for &symbol in symbols {
            let Symbol::Coordinate(i) = symbol else { continue };
            let slope = self.graph.derivative(expr, symbol);
            let velocity = match self.context {
                Context::Force => {
                    let name = format!("rate({})", self.resolved.coordinates.get(i)?.name);
                    self.velocity_in_force(i, &name, span)?
                }
                _ => self.own_velocity(i),
            };
            parts.push((1.0, self.graph.multiply(slope, velocity.expr)));
        }
        Some(self.graph.linear(0.0, &parts))
    }
}

/// What a term adds to H.
fn energies_of(draft: &DraftTerm) -> impl Iterator<Item = Expr> + '_ {
    let own = std::iter::once((draft.place, draft.expr));
    let also = draft.also.iter().map(|part: &TermPart| (part.place, part.expr));
    own.chain(also).filter(|(place, _)| place.is_energy()).map(|(_, expr)| expr)
}
