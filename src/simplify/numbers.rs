//! The table of numbers that a form is written with, and what each is printed as.

use std::collections::HashMap;

use nalgebra::DMatrix;

use super::quantity::Quantity;
use super::snap::{NiceNumber, Niceness, Tolerance, nice};
use super::{Snap, Target};

/// What stands in print for a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Printed {
    Itself,
    NiceNumber(NiceNumber),
    /// The number of that row, which it cannot be told from.
    Same(usize),
}

/// A number: never negative, signs stand in the expression.
#[derive(Debug, Clone)]
pub(super) struct Row {
    /// As fitted.
    pub fitted: Quantity,
    /// As printed, where it is printed itself: the mean of those that are taken as equal.
    pub shown: Quantity,
    pub printed: Printed,
    pub snap: Option<Snap>,
    what: String,
}

/// Value and slopes bit by bit, and what the number may be printed as.
type Key = (u64, Vec<(usize, u64)>, Option<Niceness>);

/// Every number of the forms of one part.
pub(super) struct Numbers<'a> {
    covariance: &'a DMatrix<f64>,
    tolerance: Tolerance,
    pub rows: Vec<Row>,
    known: HashMap<Key, usize>,
}

/// Standard errors within which a derived number is taken for zero.
const ZERO_SIGMAS: f64 = 3.0;

impl<'a> Numbers<'a> {
    pub(super) fn new(covariance: &'a DMatrix<f64>, tolerance: Tolerance) -> Self {
        Numbers { covariance, tolerance, rows: Vec::new(), known: HashMap::new() }
    }

    pub(super) fn error(&self, quantity: &Quantity) -> f64 {
        quantity.standard_error(self.covariance)
    }

    /// The row of |quantity|. `niceness` says what it may be printed as, `None` only itself.
    pub(super) fn row(
        &mut self,
        quantity: &Quantity,
        niceness: Option<Niceness>,
        what: &dyn Fn() -> String,
    ) -> usize {
        let size = if quantity.value < 0.0 { quantity.scaled(-1.0) } else { quantity.clone() };
        let slopes = size.slopes.iter().map(|&(i, s)| (i, s.to_bits())).collect();
        let key = (size.value.to_bits(), slopes, niceness);
        if let Some(&row) = self.known.get(&key) {
            return row;
        }
        let error = self.error(&size);
        // A number that nobody learned is what it is.
        let exact =
            Tolerance { sigmas: 0.0, relative: 1e-15, probability: self.tolerance.probability };
        let tolerance = if size.is_known() { exact } else { self.tolerance };
        let found = niceness.and_then(|niceness| nice(size.value, error, niceness, tolerance));
        let snap = match found {
            Some(nice) if !size.is_known() && nice.value() != size.value => {
                let to = Target { text: nice.to_string(), value: nice.value() };
                Some(self.snap(&size, to, what()))
            }
            _ => None,
        };
        let printed = found.map_or(Printed::Itself, Printed::NiceNumber);
        self.rows.push(Row { fitted: size.clone(), shown: size, printed, snap, what: what() });
        self.known.insert(key, self.rows.len() - 1);
        self.rows.len() - 1
    }

    fn snap(&self, quantity: &Quantity, to: Target, what: String) -> Snap {
        let standard_error = self.error(quantity);
        let distance = (quantity.value - to.value).abs();
        let sigmas = if standard_error > 0.0 { distance / standard_error } else { 0.0 };
        Snap { what, from: quantity.value, standard_error, to, sigmas }
    }

    /// Whether a number that competes with `scale` may be taken for zero.
    pub(super) fn is_nothing(&self, quantity: &Quantity, scale: f64) -> bool {
        let error = self.error(quantity);
        let relative = self.tolerance.relative * scale.abs();
        let window = (ZERO_SIGMAS * error).max(relative);
        let certain = 2.0 * window <= 4.0 * self.tolerance.probability * scale.abs();
        quantity.value == 0.0 || (certain && quantity.value.abs() <= window)
    }

    /// A row that is printed as zero.
    pub(super) fn nothing(&mut self, quantity: &Quantity, what: String) -> usize {
        let size = if quantity.value < 0.0 { quantity.scaled(-1.0) } else { quantity.clone() };
        let zero = NiceNumber { numerator: 0, denominator: 1, pi: false };
        let snap = self.snap(&size, Target { text: "0".into(), value: 0.0 }, what.clone());
        let printed = Printed::NiceNumber(zero);
        self.rows.push(Row { fitted: size.clone(), shown: size, printed, snap: Some(snap), what });
        self.rows.len() - 1
    }

    /// Takes those rows as one, for their difference is not significant. All must mean the same
    /// kind of thing.
    pub(super) fn merge_equal(&mut self, candidates: &[usize]) {
        let mut free: Vec<usize> = candidates
            .iter()
            .copied()
            .filter(|&i| self.rows[i].printed == Printed::Itself && !self.rows[i].fitted.is_known())
            .collect();
        free.sort_unstable();
        free.dedup();
        let pairs = (free.len() * free.len().saturating_sub(1) / 2) as f64;
        free.sort_by(|&a, &b| self.rows[a].fitted.value.total_cmp(&self.rows[b].fitted.value));
        let mut start = 0;
        while start < free.len() {
            let first = &self.rows[free[start]].fitted;
            let mut end = start + 1;
            while end < free.len() {
                let other = &self.rows[free[end]].fitted;
                let difference = other.minus(first);
                let error = self.error(&difference);
                let relative = self.tolerance.relative * first.value;
                let window = (self.tolerance.sigmas * error).max(relative);
                // The look-elsewhere effect: one of many pairs is often close by chance.
                let probability = 2.0 * window * pairs / first.value;
                if difference.value > window || probability > self.tolerance.probability {
                    break;
                }
                end += 1;
            }
            self.merge(&free[start..end]);
            start = end;
        }
    }

    fn merge(&mut self, group: &[usize]) {
        let Some(&leader) = group.iter().min() else { return };
        if group.len() < 2 {
            return;
        }
        let mut mean = Quantity::known(0.0);
        for &row in group {
            mean = mean.plus(&self.rows[row].fitted.scaled(1.0 / group.len() as f64));
        }
        let text = format!("the same as the {}", self.rows[leader].what);
        for &row in group {
            if row != leader {
                let to = Target { text: text.clone(), value: mean.value };
                let snap = self.snap(&self.rows[row].fitted, to, self.rows[row].what.clone());
                self.rows[row].snap = Some(snap);
                self.rows[row].printed = Printed::Same(leader);
            }
        }
        self.rows[leader].shown = mean;
    }

    /// The value that is printed.
    pub(super) fn printed_value(&self, row: usize) -> f64 {
        match self.rows[row].printed {
            Printed::Itself => self.rows[row].shown.value,
            Printed::NiceNumber(nice) => nice.value(),
            Printed::Same(other) => self.rows[other].shown.value,
        }
    }
}
