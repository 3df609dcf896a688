//! Functions of two arguments, which are put together of elementary ones: whatever takes those
//! takes these.

use super::Function;
use crate::expr::graph::{Expr, Graph};

/// Below every coordinate that is measured: what is 0 has a sign with it, all else stays the same.
const TINY: f64 = 1e-300;

/// A function of two arguments.
pub struct FunctionOfTwo {
    /// Its name in the mini-language.
    pub name: &'static str,
    /// Its arguments, as they are printed in a hint.
    pub arguments: &'static str,
    /// What it is made of.
    pub build: fn(&mut Graph, Expr, Expr) -> Expr,
    /// Its value at two numbers: the truth for tests.
    pub value: fn(f64, f64) -> f64,
    /// It is an angle, of which whole turns are lost. Its arguments have one unit, it has none.
    pub turns: bool,
}

/// The functions of two arguments of the mini-language. A new one is one row here.
pub static FUNCTIONS_OF_TWO: &[FunctionOfTwo] = &[FunctionOfTwo {
    name: "atan2",
    arguments: "y, x",
    build: direction,
    value: f64::atan2,
    turns: true,
}];

impl FunctionOfTwo {
    /// Looks a name of the mini-language up.
    pub fn by_name(name: &str) -> Option<&'static FunctionOfTwo> {
        FUNCTIONS_OF_TWO.iter().find(|function| function.name == name)
    }
}

/// The angle of the point (x, y), from -pi to pi.
///
/// With r = sqrt(x^2 + y^2) it is a = 2 atan(y / (r + |x|)) on the right and pi - a, or -pi - a
/// below, on the left. No difference of near numbers is taken, and the derivatives of the signs
/// vanish: the derivatives (-y, x) / r^2 come out to rounding everywhere but at the origin.
fn direction(graph: &mut Graph, y: Expr, x: Expr) -> Expr {
    let mut side = |of: Expr| {
        let tiny = graph.number(TINY);
        let shifted = graph.add(of, tiny);
        graph.apply(Function::SIGN, shifted)
    };
    let (right, above) = (side(x), side(y));
    let squares = [graph.power(x, 2.0), graph.power(y, 2.0)];
    let square = graph.sum(&squares);
    let distance = graph.apply(Function::SQRT, square);
    let across = graph.multiply(right, x);
    let under = graph.add(distance, across);
    let slope = graph.divide(y, under);
    let half = graph.apply(Function::ATAN, slope);
    let own = graph.product(2.0, &[(right, 1.0), (half, 1.0)]);
    let left = graph.linear(1.0, &[(-1.0, right)]);
    let turned = graph.product(std::f64::consts::FRAC_PI_2, &[(above, 1.0), (left, 1.0)]);
    graph.add(own, turned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::graph::Symbol;

    #[test]
    fn directions_and_their_derivatives_are_those_of_the_plane() {
        let mut graph = Graph::new();
        let (sx, sy) = (Symbol::Coordinate(0), Symbol::Coordinate(1));
        let (x, y) = (graph.symbol(sx), graph.symbol(sy));
        for row in FUNCTIONS_OF_TWO {
            let built = (row.build)(&mut graph, y, x);
            let slopes = [graph.derivative(built, sx), graph.derivative(built, sy)];
            let sizes = [0.0, 1e-12, 1e-7, 0.3, 1.0, 2.5, 1e6];
            for (a, b) in sizes.iter().flat_map(|a| sizes.iter().map(move |b| (*a, *b))) {
                for (px, py) in [(a, b), (-a, b), (a, -b), (-a, -b)] {
                    let square = px * px + py * py;
                    if square == 0.0 {
                        continue;
                    }
                    let at = |symbol: Symbol| if symbol == sx { px } else { py };
                    let value = graph.value(built, &at);
                    // -0 stands for 0 in this language.
                    let truth = (row.value)(py + 0.0, px + 0.0);
                    assert!((value - truth).abs() < 1e-14, "{px} {py}: {value}, not {truth}");
                    let found = slopes.map(|slope| graph.value(slope, &at));
                    for (found, truth) in found.into_iter().zip([-py / square, px / square]) {
                        let size = square.sqrt().recip();
                        assert!((found - truth).abs() < 1e-13 * size, "{px} {py}: {found}");
                    }
                }
            }
        }
    }
}
