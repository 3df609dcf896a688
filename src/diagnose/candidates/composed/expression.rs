//! Composed terms: products of shapes of leaves, at a place in the equations of motion.

use std::ops::Range;

use super::actions::{Action, Channels};
use super::leaves::{Jet, Leaf, LeafUnit, Leaves};
use super::shapes::{Inner, SHAPES, Shape};
use crate::expr::{Place, System};

/// A shape of a leaf.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Factor {
    pub(super) leaf: usize,
    pub(super) shape: usize,
    /// Inner numbers of the shape; zero where it has fewer.
    pub(super) numbers: [f64; 2],
}

impl Factor {
    pub(super) fn shape(&self) -> &'static Shape {
        &SHAPES[self.shape]
    }

    /// Value and gradient from those of its leaf.
    pub(super) fn jet(&self, leaf: &Jet) -> Jet {
        let value = self.shape().value;
        let (values, rates): (Vec<f64>, Vec<f64>) =
            leaf.value.iter().map(|&x| value(x, self.numbers)).unzip();
        let slope = |of: &Vec<f64>| of.iter().zip(&rates).map(|(x, rate)| x * rate).collect();
        let slopes = leaf.slopes.iter().map(|of| of.as_ref().map(slope)).collect();
        Jet { value: values, slopes }
    }
}

/// A composed term.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Composed {
    pub(super) place: Place,
    pub(super) factors: Vec<Factor>,
    /// Description length in nats by the grammar.
    pub(super) length: f64,
    /// What it costs to say it, in nats: the logarithm of the number of distinct expressions that
    /// are no longer, and that it is a composed term at all.
    pub(super) price: f64,
}

impl Composed {
    /// Kinds of its inner numbers, factor after factor, with the leaf that each is about.
    pub(super) fn inner(&self) -> Vec<(usize, usize, Inner)> {
        let of = |(at, factor): (usize, &Factor)| {
            let numbers = factor.shape().numbers.iter().enumerate();
            numbers.map(move |(slot, inner)| (at, slot, *inner)).collect::<Vec<_>>()
        };
        self.factors.iter().enumerate().flat_map(of).collect()
    }

    /// Values of its inner numbers, in the same order.
    pub(super) fn numbers(&self) -> Vec<f64> {
        self.inner().iter().map(|&(at, slot, _)| self.factors[at].numbers[slot]).collect()
    }

    /// The same with other inner numbers.
    pub(super) fn with_numbers(&self, numbers: &[f64]) -> Composed {
        let mut other = self.clone();
        for (&(at, slot, _), &number) in self.inner().iter().zip(numbers) {
            other.factors[at].numbers[slot] = number;
        }
        other
    }

    /// Whether it differs from another in its inner numbers alone.
    pub(super) fn has_form_of(&self, other: &Composed) -> bool {
        let form = |factor: &Factor| (factor.leaf, factor.shape);
        self.place == other.place
            && self.factors.iter().map(form).eq(other.factors.iter().map(form))
    }

    /// Unit of each of its inner numbers as a spec has it, empty for a pure number.
    pub(super) fn units(&self, leaves: &[Leaf]) -> Vec<String> {
        let of = |&(at, _, inner): &(usize, usize, Inner)| {
            let LeafUnit::Of(unit) = &leaves[self.factors[at].leaf].unit else {
                return String::new();
            };
            match inner {
                Inner::Length | Inner::Scale | Inner::Centre => unit.clone(),
                Inner::WaveNumber => format!("1/({unit})"),
                Inner::Exponent => String::new(),
            }
        };
        self.inner().iter().map(of).collect()
    }

    /// Its text, inner numbers by names between braces.
    pub(super) fn text(&self, leaves: &[Leaf], names: &[String]) -> String {
        let mut names = names.iter();
        let (mut over, mut under) = (Vec::new(), String::new());
        for factor in &self.factors {
            let (leaf, shape) = (&leaves[factor.leaf], factor.shape());
            let own: Vec<String> = names.by_ref().take(shape.numbers.len()).cloned().collect();
            let alone = self.factors.len() == 1 && shape.power == 1;
            let text = shape.text(&leaf.text, leaf.name || alone, &own);
            if shape.power < 0 {
                let below = if leaf.name { leaf.text.clone() } else { format!("({})", leaf.text) };
                let power = -shape.power;
                under +=
                    &if power == 1 { format!("/{below}") } else { format!("/{below}^{power}") };
            } else if let Some(divisor) = text.strip_prefix("1/") {
                under += &format!("/{divisor}");
            } else if shape.power == 1 && !leaf.name && !alone {
                over.push(format!("({})", leaf.text));
            } else {
                over.push(text);
            }
        }
        if over.is_empty() {
            over.push("1".to_string());
        }
        over.join("*") + &under
    }

    /// The statement that adds it, its term under a name.
    pub(super) fn statement(&self, system: &System, term: &str, text: &str) -> String {
        let place = match self.place {
            Place::Kinetic => "T".to_string(),
            Place::Potential => "V".to_string(),
            Place::Hamiltonian => "H".to_string(),
            Place::Force(i) => format!("force {}", system.coordinates[i].name),
            Place::Rate(i) => format!("rate {}", system.coordinates[i].name),
            Place::Sensor(i) => format!("sensor {}", system.observables()[i]),
        };
        format!("{place} += span{{ {term}: {text} }}")
    }

    /// The channels that it acts on, some values of the leaves being given.
    pub(super) fn channels(&self, leaves: &[Jet], channels: Channels) -> Vec<usize> {
        let n = channels.degrees;
        let depends = |component: usize| {
            self.factors.iter().any(|factor| leaves[factor.leaf].slopes[component].is_some())
        };
        match self.place {
            Place::Force(i) => vec![channels.kick(i)],
            Place::Rate(i) => vec![channels.drift(i)],
            Place::Sensor(i) => vec![channels.sensor(i)],
            _ => {
                let kicks = (0..n).filter(|&i| depends(i)).map(|i| channels.kick(i));
                let drifts = (0..n).filter(|&i| depends(n + i)).map(|i| channels.drift(i));
                kicks.chain(drifts).collect()
            }
        }
    }

    /// What it does at all points at which the leaves are given.
    pub(super) fn action(&self, leaves: &[Jet], channels: Channels) -> Action {
        let jets: Vec<Jet> =
            self.factors.iter().map(|factor| factor.jet(&leaves[factor.leaf])).collect();
        let parts: Vec<&Jet> = jets.iter().collect();
        action(self.place, &parts, channels)
    }
}

/// What the product of some parts does at a place, at all their points.
pub(super) fn action(place: Place, parts: &[&Jet], channels: Channels) -> Action {
    let n = channels.degrees;
    let values = parts.first().map_or(0, |jet| jet.value.len());
    let depends = |component: usize| parts.iter().any(|jet| jet.slopes[component].is_some());
    let mut action = Action::default();
    let mut value = |channel: usize| {
        action.channels.push(channel);
        push_value(&mut action.values, parts, channels.values(channel, values));
    };
    match place {
        Place::Kinetic | Place::Potential | Place::Hamiltonian => {
            let kicks = (0..n).map(|i| (channels.kick(i), i, -1.0));
            let drifts = (0..n).map(|i| (channels.drift(i), n + i, 1.0));
            for (channel, by, sign) in kicks.chain(drifts).filter(|(_, by, _)| depends(*by)) {
                let points = channels.values(channel, values);
                action.channels.push(channel);
                push_slope(&mut action.values, parts, points, by, sign);
            }
        }
        Place::Force(i) => value(channels.kick(i)),
        Place::Rate(i) => value(channels.drift(i)),
        Place::Sensor(i) => value(channels.sensor(i)),
    }
    action
}

/// Appends the product of the parts' values at some points.
fn push_value(out: &mut Vec<f64>, parts: &[&Jet], points: Range<usize>) {
    let start = out.len();
    let Some((first, others)) = parts.split_first() else { return };
    out.extend_from_slice(&first.value[points.clone()]);
    for jet in others {
        let values = &jet.value[points.clone()];
        out[start..].iter_mut().zip(values).for_each(|(x, y)| *x *= y);
    }
}

/// Appends the derivative of the parts' product by one component at some points, times a sign.
fn push_slope(
    out: &mut Vec<f64>,
    parts: &[&Jet],
    points: Range<usize>,
    component: usize,
    sign: f64,
) {
    let start = out.len();
    out.resize(start + points.len(), 0.0);
    for (at, jet) in parts.iter().enumerate() {
        let Some(slope) = &jet.slopes[component] else { continue };
        let others: Vec<&[f64]> = parts
            .iter()
            .enumerate()
            .filter(|(other, _)| *other != at)
            .map(|(_, jet)| &jet.value[points.clone()])
            .collect();
        let sums = out[start..].iter_mut().zip(&slope[points.clone()]);
        match others.as_slice() {
            [] => sums.for_each(|(sum, x)| *sum += sign * x),
            [a] => sums.zip(*a).for_each(|((sum, x), a)| *sum += sign * x * a),
            _ => sums.enumerate().for_each(|(i, (sum, x))| {
                *sum += sign * others.iter().fold(*x, |product, other| product * other[i]);
            }),
        }
    }
}

/// The product of several parts with its gradient.
pub(super) fn product(parts: &[&Jet]) -> Jet {
    let size = parts.first().map_or(0, |jet| jet.slopes.len());
    let all = 0..parts.first().map_or(0, |jet| jet.value.len());
    let mut value = Vec::new();
    push_value(&mut value, parts, all.clone());
    let slope = |component: usize| {
        parts.iter().any(|jet| jet.slopes[component].is_some()).then(|| {
            let mut slope = Vec::new();
            push_slope(&mut slope, parts, all.clone(), component, 1.0);
            slope
        })
    };
    Jet { value, slopes: (0..size).map(slope).collect() }
}

/// Leaves at all points that the search needs.
pub(super) struct LeafJets {
    /// At the nodes of all segments.
    pub(super) nodes: Vec<Jet>,
    /// At a few of them, where expressions are compared.
    pub(super) few: Vec<Jet>,
    /// Smallest and largest value of each leaf.
    pub(super) ranges: Vec<(f64, f64)>,
}

impl LeafJets {
    /// Leaves at some points; expressions are compared at so many of them.
    pub(super) fn of(
        leaves: &Leaves,
        parameters: &[f64],
        points: &super::states::PhasePoints,
        compared_at: usize,
    ) -> LeafJets {
        let nodes = leaves.jets(parameters, points);
        let range = |jet: &Jet| {
            let none = (f64::INFINITY, f64::NEG_INFINITY);
            jet.value.iter().fold(none, |(a, b), &x| (a.min(x), b.max(x)))
        };
        LeafJets {
            ranges: nodes.iter().map(range).collect(),
            few: leaves.jets(parameters, &points.sample(compared_at)),
            nodes,
        }
    }
}
