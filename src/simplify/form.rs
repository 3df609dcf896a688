//! A normal form written out in the language of the e-graph, in one of several ways.

use egg::{Id, RecExpr};

use super::lang::{FittedNumber, Math, Name, Rational, Variable};
use super::normal::{Atom, Atoms, Monomial, Polynomial};
use super::numbers::{Numbers, Printed};
use super::quantity::Quantity;
use super::snap::Niceness;
use crate::expr::{Function, Graph, Names, Number};

/// What a form does beyond writing the terms down; each way is tried and the shortest kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FormStyle {
    /// Quadratic forms of coordinates as springs and completed squares.
    pub springs: bool,
    /// A sin x + B cos x as C cos(x - phi).
    pub waves: bool,
}

/// One addend of a sum, its sign taken out.
pub(super) struct Addend {
    /// The row of its number, or `None` where the number is 1.
    pub number: Option<usize>,
    pub negative: bool,
    pub id: Id,
}

/// Writes forms.
pub(super) struct FormWriter<'a, 'b> {
    pub atoms: &'a Atoms,
    pub numbers: &'a mut Numbers<'b>,
    pub names: &'a Names,
    pub expr: RecExpr<Math>,
}

impl FormWriter<'_, '_> {
    pub(super) fn add(&mut self, node: Math) -> Id {
        self.expr.add(node)
    }

    /// (row, whether the number is negative, its expression without the sign).
    pub(super) fn number(
        &mut self,
        quantity: &Quantity,
        niceness: Niceness,
        what: &dyn Fn() -> String,
    ) -> (usize, bool, Id) {
        let row = self.numbers.row(quantity, Some(niceness), what);
        (row, quantity.value < 0.0, self.add(Math::Fitted(FittedNumber(row))))
    }

    pub(super) fn signed(&mut self, negative: bool, id: Id) -> Id {
        if negative { self.add(Math::Negate([id])) } else { id }
    }

    pub(super) fn rational(&mut self, numerator: i64, denominator: i64) -> Id {
        let value = Rational::new(numerator.into(), denominator.into()).unwrap_or(Rational::ONE);
        self.add(Math::Rational(value))
    }

    pub(super) fn square(&mut self, base: Id) -> Id {
        let two = self.rational(2, 1);
        self.add(Math::Raise([base, two]))
    }

    /// The monomial in the syntax of the mini-language.
    pub(super) fn label(&self, monomial: &Monomial) -> String {
        let mut graph = Graph::new();
        let mut form = Polynomial::default();
        form.add_term(monomial.clone(), &Quantity::known(1.0));
        let expr = self.atoms.expression(&mut graph, &form);
        graph.text(expr, self.names)
    }

    /// Addends to one sum, those with the same number next to each other.
    pub(super) fn sum(&mut self, addends: Vec<Addend>) -> Id {
        if addends.is_empty() {
            return self.add(Math::Rational(Rational::ZERO));
        }
        let mut groups: Vec<(String, Vec<Id>)> = Vec::new();
        for addend in addends {
            let key = match addend.number.map(|row| (row, self.numbers.rows[row].printed)) {
                None => "1".to_string(),
                Some((_, Printed::NiceNumber(nice))) => nice.to_string(),
                Some((_, Printed::Same(row)) | (row, Printed::Itself)) => format!("#{row}"),
            };
            let id = self.signed(addend.negative, addend.id);
            match groups.iter_mut().find(|(other, _)| *other == key) {
                Some((_, list)) => list.push(id),
                None => groups.push((key, vec![id])),
            }
        }
        let sums: Vec<Id> = groups.into_iter().map(|(_, list)| self.balanced(list)).collect();
        self.balanced(sums)
    }

    /// A sum as a shallow tree, in order.
    fn balanced(&mut self, mut list: Vec<Id>) -> Id {
        while list.len() > 1 {
            list = list
                .chunks(2)
                .map(|pair| match pair {
                    [a, b] => self.expr.add(Math::Add([*a, *b])),
                    _ => pair[0],
                })
                .collect();
        }
        list[0]
    }

    /// Number times monomial.
    pub(super) fn term(&mut self, monomial: &Monomial, quantity: &Quantity) -> Addend {
        let (mut negative, product) = self.monomial(monomial);
        let what = {
            let label = self.label(monomial);
            move || format!("coefficient of {label}")
        };
        let (row, minus, number) = self.number(quantity, Niceness::Factor, &what);
        negative ^= minus;
        let id = match product {
            Some(product) => self.add(Math::Multiply([number, product])),
            None => number,
        };
        Addend { number: Some(row), negative, id }
    }

    /// (whether a minus was taken out, the product).
    fn monomial(&mut self, monomial: &Monomial) -> (bool, Option<Id>) {
        let mut negative = false;
        let mut product = None;
        for &(atom, exponent) in monomial {
            let (minus, base) = self.atom(atom);
            let odd = exponent.value().rem_euclid(2.0) == 1.0;
            let even = exponent.value().rem_euclid(2.0) == 0.0;
            let base = if odd || even { base } else { self.signed(minus, base) };
            negative ^= minus && odd;
            let factor = self.raised(base, exponent);
            product = Some(match product {
                Some(before) => self.add(Math::Multiply([before, factor])),
                None => factor,
            });
        }
        (negative, product)
    }

    fn raised(&mut self, base: Id, exponent: Number) -> Id {
        if exponent.value() == 1.0 {
            return base;
        }
        let exponent = match Rational::exactly(exponent.value()) {
            Some(rational) => self.add(Math::Rational(rational)),
            None => {
                let quantity = Quantity::known(exponent.value());
                let row = self.numbers.row(&quantity, None, &|| "exponent".to_string());
                let size = self.add(Math::Fitted(FittedNumber(row)));
                self.signed(exponent.value() < 0.0, size)
            }
        };
        self.add(Math::Raise([base, exponent]))
    }

    /// (whether a minus was taken out, the atom).
    fn atom(&mut self, atom: usize) -> (bool, Id) {
        match self.atoms.get(atom).clone() {
            Atom::Symbol(symbol) => (false, self.add(Math::Variable(Variable(symbol)))),
            Atom::Apply(function, argument) => self.apply(function, &argument),
            Atom::Sum(sum) => (false, self.argument(&sum)),
            Atom::Power(base, exponent) => {
                let (base, exponent) = (self.argument(&base), self.argument(&exponent));
                (false, self.add(Math::Raise([base, exponent])))
            }
        }
    }

    /// A sum inside a function or a power.
    fn argument(&mut self, form: &Polynomial) -> Id {
        let mut addends = Vec::new();
        for (monomial, quantity) in self.atoms.ordered(form) {
            if !monomial.is_empty() {
                addends.push(self.term(monomial, quantity));
            }
        }
        if let Some(offset) = form.0.get(&Vec::new()) {
            let what = || "constant inside".to_string();
            let (row, negative, id) = self.number(offset, Niceness::Offset, &what);
            addends.push(Addend { number: Some(row), negative, id });
        }
        self.sum(addends)
    }

    /// A function with the sign of its argument and whole turns of its phase taken out.
    pub(super) fn apply(&mut self, function: Function, argument: &Polynomial) -> (bool, Id) {
        let row = function.row();
        let mut argument = argument.clone();
        let mut negative = false;
        let leading =
            self.atoms.ordered(&argument).iter().find(|(m, _)| !m.is_empty()).map(|t| t.1.value);
        if leading.is_some_and(|value| value < 0.0) && (row.odd || row.even) {
            let mut turned = Polynomial::default();
            turned.add_scaled(&argument, &Quantity::known(-1.0));
            argument = turned;
            negative = row.odd;
        }
        let Some(half_turn) = row.half_turn else {
            let inner = self.argument(&argument);
            return (negative, self.add(Math::Apply(Name(function), [inner])));
        };
        let phase = argument.0.remove(&Vec::new());
        let mut addends = Vec::new();
        for (monomial, quantity) in self.atoms.ordered(&argument) {
            let label = self.label(monomial);
            let (sign, product) = self.monomial(monomial);
            let what = || format!("wave number of {label} in {}", row.name);
            let (number_row, minus, number) = self.number(quantity, Niceness::Factor, &what);
            let id = match product {
                Some(product) => self.add(Math::Multiply([number, product])),
                None => number,
            };
            addends.push(Addend { number: Some(number_row), negative: sign ^ minus, id });
        }
        let mut inner = self.sum(addends);
        if let Some(phase) = phase {
            let (turned, phase) = self.reduced(phase, row.name);
            let turned = turned && half_turn < 0.0;
            negative ^= turned;
            let what = || format!("phase in {}", row.name);
            let (_, minus, number) = self.number(&phase, Niceness::Phase, &what);
            let number = self.signed(minus, number);
            inner = self.add(Math::Add([inner, number]));
        }
        (negative, self.add(Math::Apply(Name(function), [inner])))
    }

    /// A phase without whole turns; without half turns too (true: one was taken out), unless
    /// it is a multiple of a quarter turn, which rewrites deal with.
    fn reduced(&mut self, phase: Quantity, name: &str) -> (bool, Quantity) {
        use std::f64::consts::PI;
        let phase = phase.shifted(-2.0 * PI * (phase.value / (2.0 * PI)).round());
        let row = self.numbers.row(&phase, Some(Niceness::Phase), &|| format!("phase in {name}"));
        let quarter = match self.numbers.rows[row].printed {
            Printed::NiceNumber(nice) => nice.denominator <= 2,
            _ => false,
        };
        if quarter || phase.value.abs() <= PI / 2.0 {
            return (false, phase);
        }
        (true, phase.shifted(-PI * phase.value.signum()))
    }
}
