//! Composed terms in the order of their description length, duplicates removed.
//!
//! Two terms are the same when they do the same: the spec's constant of an energy, a factor, the
//! place where a force is written (a force f(q) and the potential whose slope it is), and every
//! identity of algebra and trigonometry then count as none. That is decided by numbers, at a few
//! states of the data's own range: the e-graph of the simplifier stands in a later layer and is
//! optional, and its classes know identities of one expression, not of what an expression does
//! at different places.

use rayon::prelude::*;
use rustc_hash::FxHashSet;

use super::actions::{Action, Channels};
use super::expression::{Composed, action};
use super::leaves::Jet;
use super::library::{Library, Part};
use super::responses::{Responses, TOGETHER};
use crate::diagnose::tuning;
use crate::expr::Place;
use crate::fit::Monitor;

/// A product of parts at a place, by places in the library.
#[derive(Debug, Clone, Copy)]
struct Draft {
    monomial: Option<u32>,
    others: [Option<u32>; 2],
    place: Place,
    length: f64,
}

/// A distinct expression with the fall of the squares that it brings.
pub(super) struct Found {
    pub(super) composed: Composed,
    pub(super) fall: f64,
}

/// What a search saw.
pub(super) struct Enumerated {
    /// The best, by fall less price.
    pub(super) found: Vec<Found>,
    /// The shortest that do anything, whatever it is.
    pub(super) shortest: Vec<Composed>,
    /// Distinct expressions.
    pub(super) distinct: usize,
}

/// Terms that are looked at between two questions whether to stop; it changes cost alone.
const CHUNK: usize = 20_000;

/// Scores about as many distinct terms as the tuning says, the shortest, and keeps the best.
///
/// `variance` is that of the weighted residuals.
pub(super) fn enumerate(
    library: &Library,
    responses: &Responses,
    variance: f64,
    tuning: &tuning::Composed,
    monitor: &dyn Monitor,
) -> Enumerated {
    let channels = responses.channels;
    let drafts = drafts(library, channels, tuning);
    let mut seen = FxHashSet::default();
    let mut found: Vec<Found> = Vec::new();
    let mut shortest: Vec<(usize, Composed)> = Vec::new();
    let merit = |found: &Found| 0.5 * found.fall / variance - found.composed.price;
    let chunks = drafts.len().div_ceil(CHUNK).max(1);
    for (at, chunk) in drafts.chunks(CHUNK).enumerate() {
        if monitor.stopped() {
            break;
        }
        let done = at as f64 / chunks as f64;
        monitor.stage("terms composed from the variables", 0.3 + 0.4 * done);
        let keys: Vec<Option<Key>> =
            chunk.par_iter().map(|draft| Key::of(&draft.action(library, channels, true))).collect();
        let mut distinct: Vec<(usize, Draft)> = Vec::new();
        for (draft, key) in chunk.iter().zip(keys) {
            if key.is_some_and(|key| seen.insert(key)) {
                distinct.push((seen.len(), *draft));
            }
        }
        // Those that act on the same channels side by side.
        let mask = |draft: &Draft| draft.action_channels(library, channels);
        distinct.sort_by_cached_key(|(order, draft)| (mask(draft), *order));
        let groups: Vec<&[(usize, Draft)]> = distinct
            .chunk_by(|(_, a), (_, b)| mask(a) == mask(b))
            .flat_map(|group| group.chunks(TOGETHER))
            .collect();
        let scored: Vec<[f64; TOGETHER]> = groups
            .par_iter()
            .map(|group| {
                let actions: Vec<Action> =
                    group.iter().map(|(_, draft)| draft.action(library, channels, false)).collect();
                responses.falls(&actions)
            })
            .collect();
        for (group, falls) in groups.iter().zip(scored) {
            for ((order, draft), fall) in group.iter().zip(falls) {
                if fall > 0.0 {
                    let composed = draft.composed(library, (*order as f64).ln() + tuning.unnamed);
                    if *order <= tuning.short {
                        shortest.push((*order, composed.clone()));
                    }
                    found.push(Found { composed, fall });
                }
            }
        }
        found.sort_by(|a, b| merit(b).total_cmp(&merit(a)));
        found.truncate(tuning.kept);
    }
    shortest.sort_by_key(|(order, _)| *order);
    let shortest = shortest.into_iter().map(|(_, composed)| composed).collect();
    Enumerated { found, shortest, distinct: seen.len() }
}

/// All drafts up to the length that makes about as many as are wanted, the shortest first.
fn drafts(library: &Library, channels: Channels, tuning: &tuning::Composed) -> Vec<Draft> {
    let others = &library.others;
    let mut tails: Vec<([Option<u32>; 2], f64)> = vec![([None, None], 0.0)];
    tails.extend(others.iter().enumerate().map(|(i, p)| ([Some(i as u32), None], p.length)));
    let multiplied = &others[..others.len().min(tuning.multiplied)];
    for (i, a) in multiplied.iter().enumerate() {
        // A part times itself is not a simpler form of anything.
        for (j, b) in multiplied.iter().enumerate().skip(i + 1) {
            tails.push(([Some(i as u32), Some(j as u32)], a.length + b.length));
        }
    }
    tails.sort_by(|a, b| a.1.total_cmp(&b.1));
    let heads: Vec<(Option<u32>, f64)> = std::iter::once((None, 0.0))
        .chain(library.monomials.iter().enumerate().map(|(i, m)| (Some(i as u32), m.length)))
        .collect();
    let count = |bound: f64| -> usize {
        let of = |&(_, head): &(Option<u32>, f64)| tails.partition_point(|t| t.1 + head <= bound);
        heads.iter().map(of).sum()
    };
    // Each product stands at some places; a third of all is the same as another.
    let wanted = tuning.expressions * 3 / 2 / (1 + channels.degrees);
    let (mut low, mut high) = (0.0, 64.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if count(middle) < wanted { low = middle } else { high = middle }
    }
    let mut all = Vec::new();
    for &(monomial, head) in &heads {
        for &(others, tail) in tails.iter().take_while(|tail| tail.1 + head <= high) {
            if monomial.is_none() && others[0].is_none() {
                continue;
            }
            let draft = Draft { monomial, others, place: Place::Potential, length: head + tail };
            all.extend(draft.placed(library, channels, tuning.sensor_length));
        }
    }
    all.sort_by(|a, b| a.length.total_cmp(&b.length));
    all
}

impl Draft {
    fn parts<'a>(&self, library: &'a Library) -> impl Iterator<Item = &'a Part> {
        let head = self.monomial.map(|i| &library.monomials[i as usize]);
        let tails = self.others.into_iter().flatten();
        head.into_iter().chain(tails.map(|i| &library.others[i as usize]))
    }

    fn depends(&self, library: &Library, component: usize) -> bool {
        self.parts(library).any(|part| part.depends(component))
    }

    /// The same at every place where it makes sense; in a sensor, where it costs less than
    /// `sensor_length` nats.
    fn placed(self, library: &Library, channels: Channels, sensor_length: f64) -> Vec<Draft> {
        let n = channels.degrees;
        let coordinates = (0..n).any(|i| self.depends(library, i));
        let momenta = (n..2 * n).any(|i| self.depends(library, i));
        let energy = match (coordinates, momenta) {
            (true, false) => Place::Potential,
            (false, true) => Place::Kinetic,
            _ => Place::Hamiltonian,
        };
        let ln = |count: usize| (count as f64).ln();
        let at = |place: Place, cost: f64| Draft { place, length: self.length + cost, ..self };
        let cost = if energy == Place::Hamiltonian { ln(6) } else { ln(3) };
        let mut all = vec![at(energy, cost)];
        all.extend((0..n).map(|i| at(Place::Force(i), ln(3) + ln(n))));
        if self.length < sensor_length {
            all.extend((0..2 * n).map(|i| at(Place::Sensor(i), ln(6) + ln(2 * n))));
        }
        all
    }

    /// The channels that it acts on, as a set of bits.
    fn action_channels(&self, library: &Library, channels: Channels) -> u64 {
        let n = channels.degrees;
        let bit = |channel: usize| 1u64 << channel.min(63);
        match self.place {
            Place::Force(i) => bit(channels.kick(i)),
            Place::Sensor(i) => bit(channels.sensor(i)),
            _ => (0..n)
                .map(|i| {
                    let kick = if self.depends(library, i) { bit(channels.kick(i)) } else { 0 };
                    let drift = self.depends(library, n + i);
                    kick | if drift { bit(channels.drift(i)) } else { 0 }
                })
                .sum(),
        }
    }

    fn action(&self, library: &Library, channels: Channels, few: bool) -> Action {
        let parts: Vec<&Jet> =
            self.parts(library).map(|part| if few { &part.few } else { &part.nodes }).collect();
        action(self.place, &parts, channels)
    }

    fn composed(&self, library: &Library, price: f64) -> Composed {
        let factors = self.parts(library).flat_map(|part| part.factors.iter().copied()).collect();
        Composed { place: self.place, factors, length: self.length, price }
    }
}

/// What an action does, but for its size: equal for actions that differ by rounding alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Key(i64, i64);

impl Key {
    /// `None` for what does nothing, or is not finite.
    fn of(action: &Action) -> Option<Key> {
        let count = (action.values.len() / action.channels.len().max(1)).max(1);
        let norm = action.values.iter().map(|x| x * x).sum::<f64>().sqrt();
        let size = action.values.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        // What is smaller has squares that are no numbers any more.
        if !(norm.is_finite() && size > 1e-100) {
            return None;
        }
        // Two directions that no expression has a reason to be at right angles to.
        let (mut first, mut second) = (0.0, 0.0);
        for (at, value) in action.values.iter().enumerate() {
            let place = (action.channels[at / count] * count + at % count) as u64;
            first += value * direction(2 * place);
            second += value * direction(2 * place + 1);
        }
        let sign = if first < 0.0 { -1.0 } else { 1.0 };
        // Rounding moves a direction by some 1e-14, and no two forms are as near as 1e-8.
        let cell = |x: f64| (sign * x / norm * 1e8).round() as i64;
        Some(Key(cell(first), cell(second)))
    }
}

/// A number between -1 and 1 for each place (Steele, Lea and Flood, OOPSLA 2014).
fn direction(place: u64) -> f64 {
    let mut z = place.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^= z >> 31;
    (z >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn action(channels: &[usize], of: impl Fn(f64) -> f64) -> Action {
        let values = (0..24).map(|i| of(-1.3 + 0.11 * f64::from(i)));
        Action { channels: channels.to_vec(), values: values.collect(), fine: false }
    }

    #[test]
    fn what_does_the_same_has_one_key() {
        let key = Key::of(&action(&[0], |q| (2.0 * q).sin()));
        assert_eq!(key, Key::of(&action(&[0], |q| -7.3 * q.sin() * q.cos())));
        assert_ne!(key, Key::of(&action(&[0], |q| (2.0 * q).sin() + 1e-5 * q)));
        assert_ne!(key, Key::of(&action(&[1], |q| (2.0 * q).sin())));
        assert_eq!(None, Key::of(&action(&[0], |_| 0.0)));
        assert_eq!(None, Key::of(&action(&[0], |_| f64::NAN)));
    }
}
