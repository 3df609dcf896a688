//! Quadratic forms of coordinates as springs, and completed squares.
//!
//! sum a_i q_i^2 + b_ij q_i q_j + l_i q_i is k_ij/2 (q_j - q_i)^2 with k_ij = -b_ij between
//! masses, and w_i/2 (q_i - L_i)^2 with w_i = 2 a_i - sum_j k_ij and L_i = -l_i / w_i to the
//! walls, up to a constant, which is free in an energy.

use std::collections::{BTreeMap, BTreeSet};

use egg::Id;

use super::form::{Addend, FormWriter};
use super::lang::{FittedNumber, Math};
use super::normal::{Monomial, Polynomial};
use super::quantity::Quantity;
use super::snap::Niceness;

/// The quadratic part of a potential, by atom.
#[derive(Default)]
struct Quadratic {
    squares: BTreeMap<usize, Quantity>,
    couplings: BTreeMap<(usize, usize), Quantity>,
    linear: BTreeMap<usize, Quantity>,
    /// Coordinates that also stand elsewhere; their squares are not completed.
    elsewhere: BTreeSet<usize>,
}

impl Quadratic {
    fn of(writer: &FormWriter, form: &Polynomial) -> Self {
        let mut out = Quadratic::default();
        for (monomial, quantity) in &form.0 {
            let powers: Vec<(usize, f64)> = monomial.iter().map(|&(a, e)| (a, e.value())).collect();
            let plain = powers.iter().all(|&(a, _)| writer.atoms.coordinate(a).is_some());
            match powers[..] {
                [(a, 1.0)] if plain => drop(out.linear.insert(a, quantity.clone())),
                [(a, 2.0)] if plain => drop(out.squares.insert(a, quantity.clone())),
                [(a, 1.0), (b, 1.0)] if plain => {
                    out.couplings.insert((a, b), quantity.clone());
                }
                _ => out.elsewhere.extend(powers.iter().map(|&(a, _)| a)),
            }
        }
        // A function may hold any coordinate inside.
        let functions = form
            .0
            .keys()
            .flatten()
            .any(|&(a, _)| !matches!(writer.atoms.get(a), super::normal::Atom::Symbol(_)));
        if functions {
            let all: Vec<usize> = out.linear.keys().copied().collect();
            out.elsewhere.extend(all);
        }
        out
    }

    /// 2 a_i minus the springs at mass i.
    fn wall(&self, atom: usize) -> Quantity {
        let zero = Quantity::known(0.0);
        let mut wall = self.squares.get(&atom).unwrap_or(&zero).scaled(2.0);
        for (&(i, j), coupling) in &self.couplings {
            if i == atom || j == atom {
                wall = wall.plus(coupling);
            }
        }
        wall
    }

    fn scale(&self, atom: usize) -> f64 {
        self.squares.get(&atom).map_or(0.0, |a| 2.0 * a.value)
    }
}

/// The quadratic part as springs.
#[derive(Default)]
pub(super) struct Springs {
    pub addends: Vec<Addend>,
    /// The terms that the springs stand for.
    pub taken: Vec<Monomial>,
    /// Masses without a spring to a wall: in monomials nothing shows that their coefficients
    /// depend on each other.
    pub without_wall: usize,
}

/// Writes the quadratic part as springs. `None` where it is none.
pub(super) fn write(writer: &mut FormWriter, form: &Polynomial) -> Option<Springs> {
    let quadratic = Quadratic::of(writer, form);
    let completes = quadratic
        .linear
        .keys()
        .any(|a| quadratic.squares.contains_key(a) && !quadratic.elsewhere.contains(a));
    if quadratic.couplings.is_empty() && !completes {
        return None;
    }
    // Springs pull: a positive coupling is no spring, nor is a wall that pushes.
    if quadratic.couplings.values().any(|b| b.value >= 0.0) {
        return None;
    }
    let atoms: BTreeSet<usize> = quadratic
        .squares
        .keys()
        .copied()
        .chain(quadratic.couplings.keys().flat_map(|&(i, j)| [i, j]))
        .collect();
    let coupled: BTreeSet<usize> = quadratic.couplings.keys().flat_map(|&(i, j)| [i, j]).collect();
    for &atom in &coupled {
        let wall = quadratic.wall(atom);
        if wall.value < 0.0 && !writer.numbers.is_nothing(&wall, quadratic.scale(atom)) {
            return None;
        }
    }
    let Springs { mut addends, mut taken, mut without_wall } = Springs::default();
    for &atom in &atoms {
        let one = |atom: usize, power: f64| vec![(atom, crate::expr::Number::new(power))];
        taken.push(one(atom, 2.0));
        let half = coupled.contains(&atom);
        let wall = quadratic.wall(atom);
        let name = writer.label(&one(atom, 1.0));
        let nothing = half && writer.numbers.is_nothing(&wall, quadratic.scale(atom));
        let linear = match quadratic.linear.get(&atom) {
            Some(linear)
                if !nothing && wall.value != 0.0 && !quadratic.elsewhere.contains(&atom) =>
            {
                taken.push(one(atom, 1.0));
                Some(linear)
            }
            _ => None,
        };
        let mut base = writer.add(Math::Variable(variable(writer, atom)));
        if let Some(linear) = linear {
            let place = linear.over(&wall).scaled(-1.0);
            let what = || format!("rest position of {name}");
            let (_, negative, id) = writer.number(&place, Niceness::Factor, &what);
            let minus = writer.signed(!negative, id);
            base = writer.add(Math::Add([base, minus]));
        }
        let square = writer.square(base);
        let (stiffness, scale) = if half { (wall, true) } else { (wall.scaled(0.5), false) };
        let (row, negative) = if nothing {
            // Where the specification has springs itself, this is no finding.
            without_wall += usize::from(!stiffness.is_known());
            let what = format!("spring between {name} and a wall");
            (writer.numbers.nothing(&stiffness, what), stiffness.value < 0.0)
        } else {
            let what = || {
                let kind = if scale {
                    "spring between a wall and"
                } else {
                    "coefficient of the square of"
                };
                format!("{kind} {name}")
            };
            let row = writer.numbers.row(&stiffness, Some(Niceness::Factor), &what);
            (row, stiffness.value < 0.0)
        };
        addends.push(spring(writer, row, negative, square, scale));
    }
    for (&(i, j), coupling) in &quadratic.couplings {
        let one = crate::expr::Number::new(1.0);
        taken.push(vec![(i, one), (j, one)]);
        let (first, second) = (variable(writer, i), variable(writer, j));
        let what = {
            let names = [writer.label(&vec![(i, one)]), writer.label(&vec![(j, one)])];
            move || format!("spring between {} and {}", names[0], names[1])
        };
        let row = writer.numbers.row(&coupling.scaled(-1.0), Some(Niceness::Factor), &what);
        let first = writer.add(Math::Variable(first));
        let second = writer.add(Math::Variable(second));
        let minus = writer.add(Math::Negate([first]));
        let difference = writer.add(Math::Add([second, minus]));
        let square = writer.square(difference);
        addends.push(spring(writer, row, false, square, true));
    }
    Some(Springs { addends, taken, without_wall })
}

fn variable(writer: &FormWriter, atom: usize) -> super::lang::Variable {
    let index = writer.atoms.coordinate(atom).unwrap_or(0);
    super::lang::Variable(crate::expr::Symbol::Coordinate(index))
}

/// k/2 times a square, or k times it.
fn spring(writer: &mut FormWriter, row: usize, negative: bool, square: Id, half: bool) -> Addend {
    let number = writer.add(Math::Fitted(FittedNumber(row)));
    let mut id = writer.add(Math::Multiply([number, square]));
    if half {
        let factor = writer.rational(1, 2);
        id = writer.add(Math::Multiply([factor, id]));
    }
    Addend { number: Some(row), negative, id }
}
