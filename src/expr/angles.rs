//! Sums of products of sines and cosines as they are shorter: sin^2 + cos^2 is 1, and
//! cos a cos b + sin a sin b is cos(a - b).
//!
//! Kinetic energies of linkages, written by the places of their masses, are full of them.

use std::collections::HashMap;

use super::functions::Function;
use super::graph::{Expr, Graph, Node};

/// Sums with more terms are left as they are.
const MOST_TERMS: usize = 64;

/// How nearly two numbers must be equal, relative to them: they were rounded on different ways.
const SAME: f64 = 1e-14;

impl Graph {
    /// The expression, multiplied out and with its angles merged, where that makes it shorter.
    pub(super) fn with_merged_angles(&mut self, expr: Expr) -> Expr {
        let Some(terms) = self.multiplied_out(expr) else { return expr };
        let sum = self.linear(0.0, &terms);
        let merged = self.merged(sum);
        if merged == sum { expr } else { merged }
    }

    /// (factor, term) of every term of what an expression is when multiplied out; `None` where
    /// there are too many.
    fn multiplied_out(&mut self, expr: Expr) -> Option<Vec<(f64, Expr)>> {
        let terms = match self.node(expr).clone() {
            Node::Sum { constant, terms } => {
                let one = self.number(1.0);
                let mut all = vec![(constant.value(), one)];
                for (term, factor) in terms.iter() {
                    let inner = self.multiplied_out(*term)?;
                    all.extend(inner.into_iter().map(|(f, t)| (f * factor.value(), t)));
                    if all.len() > MOST_TERMS + 1 {
                        return None;
                    }
                }
                all.retain(|(factor, _)| *factor != 0.0);
                all
            }
            Node::Product(parts) => {
                let mut all = vec![(1.0, self.number(1.0))];
                for &(base, exponent) in parts.iter() {
                    let (exponent, is_sum) =
                        (exponent.value(), matches!(self.node(base), Node::Sum { .. }));
                    if is_sum && [1.0, 2.0].contains(&exponent) {
                        let inner = self.multiplied_out(base)?;
                        for _ in 0..exponent as usize {
                            all = self.each_with_each(&all, &inner)?;
                        }
                    } else {
                        let power = self.power(base, exponent);
                        all = self.each_with_each(&all, &[(1.0, power)])?;
                    }
                }
                all
            }
            _ => vec![(1.0, expr)],
        };
        (terms.len() <= MOST_TERMS).then_some(terms)
    }

    fn each_with_each(
        &mut self,
        left: &[(f64, Expr)],
        right: &[(f64, Expr)],
    ) -> Option<Vec<(f64, Expr)>> {
        if left.len() * right.len() > MOST_TERMS {
            return None;
        }
        let mut all = Vec::with_capacity(left.len() * right.len());
        for &(f, a) in left {
            for &(g, b) in right {
                all.push((f * g, self.multiply(a, b)));
            }
        }
        Some(all)
    }

    /// A sum with every pair of terms merged that makes one.
    fn merged(&mut self, sum: Expr) -> Expr {
        let mut sum = sum;
        while let Node::Sum { constant, terms } = self.node(sum).clone() {
            let of: HashMap<Expr, f64> = terms.iter().map(|(t, f)| (*t, f.value())).collect();
            let found = terms.iter().find_map(|(term, factor)| {
                self.partner(*term, factor.value(), &of).map(|(other, one)| (*term, other, one))
            });
            let Some((term, other, one)) = found else { break };
            let rest = terms.iter().filter(|(t, _)| *t != term && *t != other);
            let mut parts: Vec<(f64, Expr)> = rest.map(|(t, f)| (f.value(), *t)).collect();
            parts.push(one);
            sum = self.linear(constant.value(), &parts);
        }
        sum
    }

    /// Another term of a sum that makes one term with this one, and that term with its factor.
    fn partner(
        &mut self,
        term: Expr,
        factor: f64,
        of: &HashMap<Expr, f64>,
    ) -> Option<(Expr, (f64, Expr))> {
        let powers: Vec<(Expr, f64)> = match self.node(term) {
            Node::Product(parts) => parts.iter().map(|&(b, e)| (b, e.value())).collect(),
            _ => vec![(term, 1.0)],
        };
        let same = |other: f64, sign: f64| (other - sign * factor).abs() <= SAME * factor.abs();
        let waves: Vec<(usize, Function, Expr)> = (powers.iter().enumerate())
            .filter_map(|(at, &(base, exponent))| match *self.node(base) {
                Node::Apply(function, angle)
                    if exponent >= 1.0 && [Function::SIN, Function::COS].contains(&function) =>
                {
                    Some((at, function, angle))
                }
                _ => None,
            })
            .collect();
        let flipped = |f: Function| if f == Function::SIN { Function::COS } else { Function::SIN };
        for (k, &(at, function, angle)) in waves.iter().enumerate() {
            if function == Function::SIN && powers[at].1 >= 2.0 {
                let rest = self.without(&powers, &[(at, 2.0)]);
                let cosine = self.apply(Function::COS, angle);
                let other = self.product(1.0, &[(rest, 1.0), (cosine, 2.0)]);
                if of.get(&other).is_some_and(|&f| same(f, 1.0)) {
                    return Some((other, (factor, rest)));
                }
            }
            for &(at_second, second, angle_second) in &waves[k + 1..] {
                let rest = self.without(&powers, &[(at, 1.0), (at_second, 1.0)]);
                let a = self.apply(flipped(function), angle);
                let b = self.apply(flipped(second), angle_second);
                let other = self.product(1.0, &[(rest, 1.0), (a, 1.0), (b, 1.0)]);
                let Some(&other_factor) = of.get(&other).filter(|_| other != term) else {
                    continue;
                };
                let alike = if same(other_factor, 1.0) {
                    1.0
                } else if same(other_factor, -1.0) {
                    -1.0
                } else {
                    continue;
                };
                // cos a cos b + s sin a sin b = cos(a - s b), whichever of the two stands here;
                // sin a cos b + s cos a sin b = sin(a + s b).
                let (wave, sign, towards) = match (function == Function::COS, function == second) {
                    (true, true) => (Function::COS, 1.0, -alike),
                    (false, true) => (Function::COS, alike, -alike),
                    (false, false) => (Function::SIN, 1.0, alike),
                    (true, false) => (Function::SIN, alike, alike),
                };
                let angle = self.linear(0.0, &[(1.0, angle), (towards, angle_second)]);
                let (wave, odd) = self.wave(wave, angle);
                let one = self.multiply(rest, wave);
                return Some((other, (factor * sign * odd, one)));
            }
        }
        None
    }

    /// A product without some powers of its bases.
    fn without(&mut self, powers: &[(Expr, f64)], less: &[(usize, f64)]) -> Expr {
        let mut powers = powers.to_vec();
        for &(at, exponent) in less {
            powers[at].1 -= exponent;
        }
        powers.retain(|(_, exponent)| *exponent != 0.0);
        self.product(1.0, &powers)
    }

    /// The sine or cosine of an angle whose first term is positive, and the sign before it.
    fn wave(&mut self, function: Function, angle: Expr) -> (Expr, f64) {
        let negative = match self.node(angle) {
            Node::Sum { terms, .. } => terms.first().is_some_and(|(_, f)| f.value() < 0.0),
            _ => false,
        };
        if !negative {
            return (self.apply(function, angle), 1.0);
        }
        let turned = self.negate(angle);
        let sign = if function == Function::SIN { -1.0 } else { 1.0 };
        (self.apply(function, turned), sign)
    }
}

#[cfg(test)]
mod tests {
    use super::super::build;
    use super::super::print::Names;

    /// What a potential is when its angles are merged.
    fn merged(potential: &str) -> String {
        let text =
            format!("coordinates a, b, r; momenta p, q, s\nT = p^2 + q^2 + s^2\nV = {potential}");
        let mut system = (*build("test", &text).unwrap_or_else(|e| panic!("{e}")).system).clone();
        let merged = system.graph.with_merged_angles(system.potential);
        let names: Names = system.names();
        let values = |x: super::super::Symbol| match x {
            super::super::Symbol::Coordinate(i) => [0.7, -1.9, 0.4][i],
            _ => 0.0,
        };
        let (before, after) =
            (system.graph.value(system.potential, &values), system.graph.value(merged, &values));
        assert!((before - after).abs() < 1e-14, "{potential}: {before} {after}");
        system.graph.text(merged, &names)
    }

    #[test]
    fn squares_of_sine_and_cosine_are_one() {
        assert_eq!(merged("3*r^2*sin(a)^2 + 3*r^2*cos(a)^2 + b"), "3*r^2 + b");
        assert_eq!(merged("2*sin(a)^2 + 3*cos(a)^2"), "2*sin(a)^2 + 3*cos(a)^2");
    }

    #[test]
    fn products_of_two_angles_are_one_of_their_difference() {
        assert_eq!(merged("r*sin(a)*sin(b) + r*cos(a)*cos(b)"), "r*cos(a - b)");
        assert_eq!(merged("sin(a)*sin(b) - cos(a)*cos(b)"), "-cos(a + b)");
        assert_eq!(merged("sin(a)*cos(b) + cos(a)*sin(b)"), "sin(a + b)");
        assert_eq!(merged("cos(a)*sin(b) - sin(a)*cos(b)"), "-sin(a - b)");
        assert_eq!(merged("cos(a)*cos(a + b) + sin(a)*sin(a + b)"), "cos(b)");
    }

    #[test]
    fn squares_of_sums_are_multiplied_out_where_it_helps() {
        let arm = "(cos(a) + r*cos(a + b))^2 + (sin(a) + r*sin(a + b))^2";
        assert_eq!(merged(arm), "2*r*cos(b) + r^2 + 1");
        assert_eq!(merged("(a + b)*r"), "(a + b)*r");
    }
}
