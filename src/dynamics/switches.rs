//! Where equations of motion jump, and what they are between the jumps.
//!
//! A function with a kink or a jump has it where its argument passes zero: a switching surface of
//! the state space. Between the surfaces the motion is smooth. On a surface that the motion is
//! pushed to from both sides it slides (a mass that dry friction holds): the sign is then the
//! number between -1 and 1 that keeps the argument at zero (Filippov's convention).

use std::collections::{HashMap, HashSet};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::gradient::Gradient;
use crate::expr::{Domain, Expr, Function, Graph, Node, Symbol};

/// Points of a surface at which it is looked for a jump, all of numbers near 1.
const POINTS: usize = 3;
/// Newton's steps to the surface.
const PROJECTIONS: usize = 20;
/// What is smaller is zero there.
const NEAR: f64 = 1e-9;

/// Where a state stands to a switching surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Side {
    /// The motion does not jump there: functions keep their kinks.
    Any,
    /// The argument is negative.
    Below,
    /// The argument is positive.
    Above,
    /// The motion slides along the surface.
    On,
}

/// Equations of motion as expressions.
#[derive(Clone)]
pub(super) struct Motion {
    /// What the expressions are of.
    pub(super) graph: Graph,
    /// g.
    pub(super) slope: Gradient,
    /// v.
    pub(super) velocity: Gradient,
}

/// Equations of motion between switching surfaces, as expressions.
pub(super) struct Between {
    /// The motion there.
    pub(super) motion: Motion,
    /// The surfaces that end it.
    pub(super) watched: Vec<usize>,
    /// For each of them how far its end is: positive inside.
    pub(super) margins: Vec<Expr>,
}

/// The switching surfaces of equations of motion.
pub(super) struct Switches {
    motion: Motion,
    state: Vec<Symbol>,
    coefficients: Vec<Symbol>,
    /// (v, -g).
    rates: Vec<Expr>,
    /// The arguments that change their sign on the surfaces.
    pub(super) arguments: Vec<Expr>,
    /// Each of them, and each with the other sign: which it is, and by what sign.
    by_argument: HashMap<Expr, (usize, f64)>,
    /// Functions that stay what they are, with their kinks: what is made of them is no number
    /// behind the surface.
    kept: HashSet<Expr>,
}

impl Switches {
    /// The switching surfaces; `None` for equations without kinks and jumps.
    pub(super) fn new(
        motion: &Motion,
        state: &[Symbol],
        coefficients: &[Symbol],
    ) -> Option<Switches> {
        let mut motion = motion.clone();
        let graph = &mut motion.graph;
        let mut rates = motion.velocity.rows.clone();
        rates.extend(motion.slope.rows.iter().map(|&g| graph.negate(g)));
        let kept = within_limits(graph, &rates);
        let mut arguments: Vec<Expr> = Vec::new();
        let mut by_argument = HashMap::new();
        for part in graph.topological(&rates) {
            let Node::Apply(function, argument) = *graph.node(part) else { continue };
            let known = by_argument.contains_key(&argument);
            if function.row().is_smooth() || known || kept.contains(&part) {
                continue;
            }
            by_argument.insert(argument, (arguments.len(), 1.0));
            by_argument.insert(graph.negate(argument), (arguments.len(), -1.0));
            arguments.push(argument);
        }
        if arguments.is_empty() {
            return None;
        }
        let (state, coefficients) = (state.to_vec(), coefficients.to_vec());
        Some(Switches { motion, state, coefficients, rates, arguments, by_argument, kept })
    }

    /// Number of surfaces.
    pub(super) fn count(&self) -> usize {
        self.arguments.len()
    }

    /// On which surfaces the motion jumps when some coefficients are zero. A kink in the force is
    /// nothing that steps of a usual length mind.
    pub(super) fn acting(&self, zeros: &[bool]) -> Vec<bool> {
        let mut graph = self.motion.graph.clone();
        let signs: Vec<Option<Expr>> =
            (0..self.count()).map(|k| Some(graph.symbol(placeholder(k)))).collect();
        let absent = self.coefficients.iter().zip(zeros).filter(|(_, zero)| **zero);
        let absent: HashMap<Symbol, f64> = absent.map(|(&symbol, _)| (symbol, 0.0)).collect();
        let mut open = self.rates.clone();
        let mut acting = vec![false; self.count()];
        while let Some(expr) = open.pop() {
            let expr = self.rewritten(&mut graph, expr, &signs);
            let expr = graph.substitute_numbers(expr, &absent);
            for symbol in graph.symbols(&[expr]) {
                if let Symbol::Velocity(k) = symbol
                    && !std::mem::replace(&mut acting[k], true)
                {
                    open.push(self.arguments[k]);
                }
            }
        }
        for (k, acts) in acting.iter_mut().enumerate() {
            *acts &= self.jumps(&mut graph, k, &absent);
        }
        acting
    }

    /// Whether the motion is another on both sides of a surface, next to it: at points of it.
    fn jumps(&self, graph: &mut Graph, k: usize, absent: &HashMap<Symbol, f64>) -> bool {
        let mut signs = vec![None; self.count()];
        signs[k] = Some(graph.symbol(placeholder(k)));
        let rates: Vec<Expr> = self
            .rates
            .iter()
            .map(|&rate| {
                let rate = self.rewritten(graph, rate, &signs);
                graph.substitute_numbers(rate, absent)
            })
            .collect();
        let argument = self.arguments[k];
        let slopes: Vec<Expr> = self.state.iter().map(|&s| graph.derivative(argument, s)).collect();
        let mut generator = Pcg64::seed_from_u64(k as u64);
        (0..POINTS).any(|_| {
            let symbols = graph.symbols(&[rates.as_slice(), &[argument]].concat());
            let mut point: HashMap<Symbol, f64> = symbols
                .into_iter()
                .map(|symbol| (symbol, generator.random_range(0.5..1.5)))
                .collect();
            for _ in 0..PROJECTIONS {
                let at = |symbol: Symbol| point.get(&symbol).copied().unwrap_or(0.0);
                let value = graph.value(argument, &at);
                let slopes: Vec<f64> = slopes.iter().map(|&s| graph.value(s, &at)).collect();
                let square: f64 = slopes.iter().map(|slope| slope * slope).sum();
                for (symbol, slope) in self.state.iter().zip(slopes) {
                    if let Some(x) = point.get_mut(symbol).filter(|_| square > 0.0) {
                        *x -= value * slope / square;
                    }
                }
            }
            let side = |sign: f64| -> Vec<f64> {
                let at = |symbol: Symbol| match symbol == placeholder(k) {
                    true => sign,
                    false => point.get(&symbol).copied().unwrap_or(0.0),
                };
                rates.iter().map(|&rate| graph.value(rate, &at)).collect()
            };
            let at = |symbol: Symbol| point.get(&symbol).copied().unwrap_or(0.0);
            let on_surface = graph.value(argument, &at).abs() < NEAR;
            let both = side(-1.0).into_iter().zip(side(1.0));
            on_surface && both.into_iter().any(|(a, b)| (a - b).abs() > NEAR)
        })
    }

    /// An expression with the signs of arguments put in, where they are given.
    fn rewritten(&self, graph: &mut Graph, expr: Expr, signs: &[Option<Expr>]) -> Expr {
        let by =
            |graph: &mut Graph, part: Expr, function: Function, [argument, image]: [Expr; 2]| {
                if self.kept.contains(&part) {
                    return None;
                }
                let of_side = function.row().of_side?;
                let &(k, factor) = self.by_argument.get(&argument)?;
                let sign = graph.scale(factor, signs[k]?);
                Some(of_side(graph, image, sign))
            };
        graph.replace_functions(expr, by)
    }

    /// The motion with the state on some side of each surface; `None` where it cannot slide as
    /// asked for.
    pub(super) fn between(&self, sides: &[Side]) -> Option<Between> {
        let mut graph = self.motion.graph.clone();
        let signs = self.signs(&mut graph, sides)?;
        let mut rewritten = |expr: &Expr| self.rewritten(&mut graph, *expr, &signs);
        let slides = sides.contains(&Side::On);
        let mut parts = [self.motion.slope.clone(), self.motion.velocity.clone()];
        for part in &mut parts {
            part.rows = part.rows.iter().map(&mut rewritten).collect();
            for (_, expr) in part.linear.iter_mut().flatten() {
                *expr = rewritten(expr);
            }
        }
        if slides {
            parts.iter_mut().for_each(|part| part.linear_by_all(&mut graph, &self.coefficients));
        }
        let mut watched = Vec::new();
        let mut ends = Vec::new();
        for (k, side) in sides.iter().enumerate() {
            let argument = self.rewritten(&mut graph, self.arguments[k], &signs);
            let end = match side {
                Side::Any => continue,
                Side::Below => graph.negate(argument),
                Side::Above => argument,
                Side::On => {
                    let square = graph.power(signs[k]?, 2.0);
                    graph.linear(1.0, &[(-1.0, square)])
                }
            };
            watched.push(k);
            ends.push(end);
        }
        let [slope, velocity] = parts;
        Some(Between { motion: Motion { graph, slope, velocity }, watched, margins: ends })
    }

    /// The sign of each argument on the given sides.
    fn signs(&self, graph: &mut Graph, sides: &[Side]) -> Option<Vec<Option<Expr>>> {
        let mut signs: Vec<Option<Expr>> = Vec::new();
        for (k, side) in sides.iter().enumerate() {
            signs.push(match side {
                Side::Any => None,
                Side::Below => Some(graph.number(-1.0)),
                Side::Above => Some(graph.number(1.0)),
                Side::On => Some(graph.symbol(placeholder(k))),
            });
        }
        let sliding: Vec<usize> = (0..sides.len()).filter(|&k| sides[k] == Side::On).collect();
        if sliding.is_empty() {
            return Some(signs);
        }
        // The arguments stay where they are: linear equations for the signs, one after another.
        let rates: Vec<Expr> =
            self.rates.iter().map(|&rate| self.rewritten(graph, rate, &signs)).collect();
        let mut solved: Vec<(usize, Expr)> = Vec::new();
        for &k in &sliding {
            let argument = self.rewritten(graph, self.arguments[k], &signs);
            let mut changes = vec![of_time(graph, argument)];
            for (&symbol, &rate) in self.state.iter().zip(&rates) {
                let slope = graph.derivative(argument, symbol);
                changes.push(graph.multiply(slope, rate));
            }
            let change = graph.sum(&changes);
            let change = substituted(graph, change, &solved);
            let slope = graph.derivative(change, placeholder(k));
            if graph.is_zero(slope) {
                return None;
            }
            let none = graph.number(0.0);
            let rest = substituted(graph, change, &[(k, none)]);
            let ratio = graph.divide(rest, slope);
            let sign = graph.negate(ratio);
            for (_, known) in &mut solved {
                *known = substituted(graph, *known, &[(k, sign)]);
            }
            solved.push((k, sign));
        }
        for (k, sign) in solved {
            signs[k] = Some(sign);
        }
        Some(signs)
    }
}

/// What lies within powers that are not whole, and within functions that are not defined for all
/// numbers.
fn within_limits(graph: &Graph, roots: &[Expr]) -> HashSet<Expr> {
    let mut limited = Vec::new();
    for part in graph.topological(roots) {
        match graph.node(part) {
            Node::Product(parts) => {
                let powers = parts.iter().filter(|(_, exponent)| exponent.value().fract() != 0.0);
                limited.extend(powers.map(|(base, _)| *base));
            }
            Node::Power(base, _) => limited.push(*base),
            Node::Apply(function, argument) if function.row().domain != Domain::Real => {
                limited.push(*argument);
            }
            _ => {}
        }
    }
    graph.topological(&limited).into_iter().collect()
}

/// Stands for the sign of an argument. Equations of motion hold no velocities, so that these
/// symbols are free.
fn placeholder(switch: usize) -> Symbol {
    Symbol::Velocity(switch)
}

fn substituted(graph: &mut Graph, expr: Expr, signs: &[(usize, Expr)]) -> Expr {
    let replace = signs.iter().map(|&(k, sign)| (placeholder(k), sign)).collect();
    graph.substitute(expr, &replace)
}

/// The derivative by the time, and by what inputs do in it, with the state at rest.
pub(super) fn of_time(graph: &mut Graph, expr: Expr) -> Expr {
    let mut parts = Vec::new();
    for symbol in graph.symbols(&[expr]) {
        let rate = match symbol.input_rate() {
            Some(rate) => graph.symbol(rate),
            None if symbol == Symbol::Time => graph.number(1.0),
            None => continue,
        };
        let slope = graph.derivative(expr, symbol);
        parts.push(graph.multiply(slope, rate));
    }
    graph.sum(&parts)
}
