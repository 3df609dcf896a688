//! The parts that composed terms are products of: monomials, and other functions of one leaf.

use super::expression::{Factor, LeafJets, product};
use super::leaves::{Jet, Leaves};
use super::shapes::{Inner, SHAPES};
use crate::diagnose::tuning;

/// A product of factors, evaluated.
pub(super) struct Part {
    pub(super) factors: Vec<Factor>,
    /// Description length in nats.
    pub(super) length: f64,
    /// At the nodes of all segments.
    pub(super) nodes: Jet,
    /// Where expressions are compared.
    pub(super) few: Jet,
}

impl Part {
    fn of(factors: Vec<Factor>, length: f64, jets: &LeafJets) -> Option<Part> {
        let at = |leaves: &[Jet]| {
            let own: Vec<Jet> =
                factors.iter().map(|factor| factor.jet(&leaves[factor.leaf])).collect();
            product(&own.iter().collect::<Vec<_>>())
        };
        let (nodes, few) = (at(&jets.nodes), at(&jets.few));
        (nodes.is_finite() && few.is_finite()).then_some(Part { factors, length, nodes, few })
    }

    /// Components of the state that it depends on.
    pub(super) fn depends(&self, component: usize) -> bool {
        self.nodes.slopes[component].is_some()
    }
}

/// All parts.
pub(super) struct Library {
    /// Products of powers of coordinates and momenta, the shortest first.
    pub(super) monomials: Vec<Part>,
    /// Other functions of one leaf, the shortest first.
    pub(super) others: Vec<Part>,
}

/// What one more factor costs.
const ONE_MORE: f64 = std::f64::consts::LN_2;

impl Library {
    pub(super) fn of(leaves: &Leaves, jets: &LeafJets, tuning: &tuning::Composed) -> Library {
        let mut monomials: Vec<Part> = monomials(leaves, jets, tuning.monomials)
            .into_iter()
            .filter_map(|(factors, length)| Part::of(factors, length, jets))
            .collect();
        let mut others: Vec<(Factor, f64)> = others(leaves, jets);
        others.sort_by(|a, b| a.1.total_cmp(&b.1));
        others.truncate(tuning.others);
        let mut others: Vec<Part> = others
            .into_iter()
            .filter_map(|(factor, length)| Part::of(vec![factor], length, jets))
            .collect();
        monomials.sort_by(|a, b| a.length.total_cmp(&b.length));
        others.sort_by(|a, b| a.length.total_cmp(&b.length));
        Library { monomials, others }
    }
}

/// Products of positive powers of coordinates and momenta, the shortest first, `most` of them.
fn monomials(leaves: &Leaves, jets: &LeafJets, most: usize) -> Vec<(Vec<Factor>, f64)> {
    let plain = leaves.list.iter().enumerate().filter(|(_, leaf)| leaf.component.is_some());
    let mut all: Vec<(Vec<Factor>, f64)> = vec![(Vec::new(), 0.0)];
    for (at, leaf) in plain {
        let (lower, upper) = jets.ranges[at];
        let mut next = all.clone();
        for (place, shape) in SHAPES.iter().enumerate() {
            if shape.power == 0 || !shape.suits(lower, upper) {
                continue;
            }
            let factor = Factor { leaf: at, shape: place, numbers: [0.0; 2] };
            let own = leaf.length + shape.length() + ONE_MORE;
            next.extend(all.iter().map(|(factors, length)| {
                let mut factors = factors.clone();
                factors.push(factor);
                (factors, length + own)
            }));
        }
        next.sort_by(|a, b| a.1.total_cmp(&b.1));
        next.truncate(2 * most);
        all = next;
    }
    all.retain(|(factors, _)| !factors.is_empty());
    all.truncate(most);
    all
}

/// Every shape of every leaf that is no power of a coordinate or momentum, at every point of the
/// grid of its inner numbers.
fn others(leaves: &Leaves, jets: &LeafJets) -> Vec<(Factor, f64)> {
    let mut all = Vec::new();
    for (at, leaf) in leaves.list.iter().enumerate() {
        let (lower, upper) = jets.ranges[at];
        for (place, shape) in SHAPES.iter().enumerate() {
            let monomial = leaf.monomial && shape.power != 0;
            if monomial || !leaf.unit.allows(shape) || !shape.suits(lower, upper) {
                continue;
            }
            let axes: Vec<Vec<f64>> =
                shape.numbers.iter().map(|inner| inner.grid(lower, upper)).collect();
            let points: f64 = axes.iter().map(|axis| (axis.len() as f64).ln()).sum();
            let length = leaf.length + shape.length() + ONE_MORE + points;
            for numbers in choices(&axes) {
                all.push((Factor { leaf: at, shape: place, numbers }, length));
            }
        }
    }
    all
}

/// Every choice of up to two numbers.
fn choices(axes: &[Vec<f64>]) -> Vec<[f64; 2]> {
    match axes {
        [] => vec![[0.0; 2]],
        [a] => a.iter().map(|&a| [a, 0.0]).collect(),
        [a, b, ..] => a.iter().flat_map(|&a| b.iter().map(move |&b| [a, b])).collect(),
    }
}

/// The range in which an inner number of a factor is refined.
pub(super) fn bounds(factor: &Factor, inner: Inner, jets: &LeafJets) -> (f64, f64) {
    let (lower, upper) = jets.ranges[factor.leaf];
    inner.bounds(lower, upper)
}
