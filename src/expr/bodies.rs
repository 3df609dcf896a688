//! Bodies: coordinates that turn together when the axes are turned, declared or seen.

use super::graph::{Expr, Symbol};
use super::system::System;
use super::unit::Unit;
use crate::spec::effects::Body;

/// Systems with more coordinates are not searched for bodies that nobody declared.
const MOST_COORDINATES: usize = 12;

/// How exactly an energy stays the same when the axes are turned.
const SAME: f64 = 1e-9;

impl System {
    /// The bodies of the system: those that the spec declares, else those that are seen.
    ///
    /// Coordinates are seen to be a body where their names differ by one letter of x, y and z and
    /// the known kinetic energy does not change when their momenta are turned (equal masses).
    /// Names that say nothing suffice where the whole known energy has that symmetry.
    pub fn bodies(&self) -> Vec<Body> {
        if !self.declared_bodies.is_empty() {
            return self.declared_bodies.clone();
        }
        if !(2..=MOST_COORDINATES).contains(&self.degrees()) {
            return Vec::new();
        }
        let mut named = self.named_alike();
        if !self.turns(&named, false) {
            named.retain(|body| self.turns(std::slice::from_ref(body), false));
        }
        if !named.is_empty() {
            return self.with_names(&named);
        }
        let whole = |parts: &Vec<Vec<usize>>| {
            parts.iter().all(|body| self.is_of_one_unit(body))
                && self.moves(parts)
                && self.turns(parts, false)
                && self.turns(parts, true)
        };
        self.partitions()
            .into_iter()
            .find(whole)
            .map_or(Vec::new(), |found| self.with_names(&found))
    }

    fn with_names(&self, bodies: &[Vec<usize>]) -> Vec<Body> {
        let name = |&i: &usize| self.coordinates[i].name.clone();
        let body =
            |of: &Vec<usize>| Body { name: None, coordinates: of.iter().map(name).collect() };
        bodies.iter().map(body).collect()
    }

    /// Coordinates whose names differ by one letter: x1 and y1, or ball_x, ball_y and ball_z.
    fn named_alike(&self) -> Vec<Vec<usize>> {
        let letters = |i: usize| -> Vec<char> { self.coordinates[i].name.chars().collect() };
        let is_axis = |c: char| "xyzXYZ".contains(c);
        let mut left: Vec<usize> = (0..self.degrees()).collect();
        let mut out = Vec::new();
        while let Some(&first) = left.first() {
            let name = letters(first);
            let alike = |at: usize, i: usize| {
                let other = letters(i);
                other.len() == name.len()
                    && is_axis(other[at])
                    && other[at].is_uppercase() == name[at].is_uppercase()
                    && (0..name.len()).all(|k| (k == at) != (other[k] == name[k]))
            };
            let bodies = (0..name.len()).filter(|&at| is_axis(name[at])).map(|at| {
                let others = left[1..].iter().copied().filter(|&i| alike(at, i));
                std::iter::once(first).chain(others).collect::<Vec<usize>>()
            });
            let body = bodies.max_by_key(Vec::len).unwrap_or_default();
            left.retain(|i| *i != first && !body.contains(i));
            if (2..=3).contains(&body.len()) && self.is_of_one_unit(&body) {
                out.push(body);
            }
        }
        out
    }

    /// Ways to part all coordinates into bodies by their order.
    fn partitions(&self) -> Vec<Vec<Vec<usize>>> {
        let n = self.degrees();
        let mut out = Vec::new();
        for size in [2, 3] {
            if n.is_multiple_of(size) {
                let count = n / size;
                out.push((0..count).map(|k| (0..size).map(|i| k * size + i).collect()).collect());
                if count > 1 {
                    let every = |k: usize| (0..size).map(|i| k + i * count).collect();
                    out.push((0..count).map(every).collect());
                }
            }
        }
        out
    }

    /// Whether some coordinates have one unit, and so have their momenta. Angles are no body.
    fn is_of_one_unit(&self, body: &[usize]) -> bool {
        let same = |unit: &dyn Fn(usize) -> Option<Unit>| {
            let first = body.first().and_then(|&i| unit(i));
            body.iter().all(|&i| match (first, unit(i)) {
                (None, None) => true,
                (Some(a), Some(b)) => a.agrees(b),
                _ => false,
            })
        };
        let angle = body.iter().any(|&i| self.coordinates[i].unit.is_some_and(Unit::is_number));
        !angle && same(&|i| self.coordinates[i].unit) && same(&|i| self.momenta[i].unit)
    }

    /// Whether the known kinetic energy depends on every momentum of some bodies.
    fn moves(&self, bodies: &[Vec<usize>]) -> bool {
        let there = self.graph.symbols(&[self.kinetic, self.hamiltonian]);
        bodies.iter().flatten().all(|&i| there.contains(&Symbol::Momentum(i)))
    }

    /// Whether the known energy stays the same when all of some bodies are turned together:
    /// their momenta alone, or with the coordinates.
    fn turns(&self, bodies: &[Vec<usize>], coordinates: bool) -> bool {
        let mut energies = vec![vec![self.kinetic], vec![self.hamiltonian]];
        if coordinates {
            energies.push(vec![self.potential]);
            // Each learned term once: a function space with axes of its own shows in the sum.
            let terms = self.terms.iter().flat_map(|term| term.parts());
            energies.push(terms.filter(|(place, _)| place.is_energy()).map(|(_, e)| e).collect());
        }
        (0..2).all(|plane| {
            let turned: Vec<(usize, usize)> = (bodies.iter())
                .filter_map(|body| Some((*body.get(plane)?, *body.get(plane + 1)?)))
                .collect();
            let same = |sum: &Vec<Expr>| (0..5).all(|k| self.is_same(sum, &turned, coordinates, k));
            turned.is_empty() || energies.iter().all(same)
        })
    }

    /// Whether a sum is the same at a point of phase space and at a turned one.
    fn is_same(
        &self,
        sum: &[Expr],
        turned: &[(usize, usize)],
        coordinates: bool,
        point: usize,
    ) -> bool {
        let n = self.degrees();
        // Any numbers of size 1 that have nothing in common.
        let place = |i: usize| 1.5 * (1.0 + 2.3 * i as f64 + 0.7 * point as f64).sin() + 0.1;
        let before: Vec<f64> = (0..2 * n).map(place).collect();
        let mut after = before.clone();
        let (sine, cosine) = 0.7_f64.sin_cos();
        for &(i, j) in turned {
            for half in if coordinates { [Some(0), Some(n)] } else { [None, Some(n)] } {
                let Some(from) = half else { continue };
                let (x, y) = (before[from + i], before[from + j]);
                after[from + i] = cosine * x - sine * y;
                after[from + j] = sine * x + cosine * y;
            }
        }
        let value = |state: &[f64]| -> (f64, f64) {
            let of = |symbol| match symbol {
                Symbol::Coordinate(i) => state[i],
                Symbol::Momentum(i) => state[n + i],
                Symbol::Time => 0.7,
                Symbol::Input(i, order) => 0.9 + 0.3 * i as f64 - 0.2 * order as f64,
                Symbol::Delayed(i, order, _) => 0.8 + 0.3 * i as f64 - 0.2 * order as f64,
                Symbol::Parameter(j) => self.parameters[j].start,
                Symbol::Velocity(_) | Symbol::Coefficient(_) => 1.0,
            };
            let parts = sum.iter().map(|&expr| self.graph.value(expr, &of));
            parts.fold((0.0, 0.0), |(sum, size), x| (sum + x, size + f64::abs(x)))
        };
        let ((a, size), (b, _)) = (value(&before), value(&after));
        // Where it has no value, it says nothing.
        !(a.is_finite() && b.is_finite()) || (a - b).abs() <= SAME * size
    }

    /// Coordinates that an effect with one coefficient may act on together: all of one unit, and
    /// each of some bodies.
    pub(super) fn groups(&self, bodies: &[Body]) -> Vec<Vec<String>> {
        let mut classes: Vec<Vec<usize>> = Vec::new();
        for i in 0..self.degrees() {
            let fits = |class: &&mut Vec<usize>| {
                let same = |a: Option<Unit>, b: Option<Unit>| match (a, b) {
                    (None, None) => true,
                    (Some(a), Some(b)) => a.agrees(b),
                    _ => false,
                };
                let j = class[0];
                same(self.coordinates[i].unit, self.coordinates[j].unit)
                    && same(self.momenta[i].unit, self.momenta[j].unit)
            };
            match classes.iter_mut().find(fits) {
                Some(class) => class.push(i),
                None => classes.push(vec![i]),
            }
        }
        let name = |i: &usize| self.coordinates[*i].name.clone();
        let mut out: Vec<Vec<String>> = (classes.iter().filter(|class| class.len() > 1))
            .map(|class| class.iter().map(name).collect())
            .collect();
        for body in bodies {
            let mut names = body.coordinates.clone();
            names.sort_by_key(|name| self.coordinates.iter().position(|q| q.name == *name));
            if !out.contains(&names) {
                out.push(names);
            }
        }
        out
    }
}
