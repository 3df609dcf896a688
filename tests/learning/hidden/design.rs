//! The design of the benchmark: which cases out of the product of all that is varied, in an order
//! in which any first part is a sample of the whole.
//!
//! Cases come in blocks that hold every kind in its share. Within a kind, the levels of every
//! factor come in shuffled blocks of their own, so that each level is met as often as any other.

use leverrier::internals::spec::effects::by_name;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64;

use super::bases::{BASES, Base, base};
use super::making::may_be_filtered;
use super::statement;
use super::strangers::STRANGERS;
use super::terms::hidden_terms;
use super::wholes::{GROUPS, NUMBERS, PARTNERS};

/// What kind of thing is hidden.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    /// Nothing at all.
    Nothing,
    /// One effect of the catalogue.
    Single,
    /// Two effects.
    Pair,
    /// Three effects.
    Triple,
    /// One effect on several coordinates or on a body, with one coefficient.
    Group,
    /// A known number that is wrong.
    Number,
    /// A term that the catalogue lacks.
    Composed,
    /// What neither the catalogue nor a composed term says.
    Stranger,
}

impl Kind {
    /// Every kind, and how many of it a block of the design holds.
    pub(crate) const SHARES: [(Kind, usize); 8] = [
        (Kind::Nothing, 6),
        (Kind::Single, 8),
        (Kind::Pair, 2),
        (Kind::Triple, 1),
        (Kind::Group, 2),
        (Kind::Number, 2),
        (Kind::Composed, 1),
        (Kind::Stranger, 2),
    ];

    /// In words, as in tables and in the file of results.
    pub(crate) fn text(self) -> &'static str {
        match self {
            Kind::Nothing => "nothing",
            Kind::Single => "one effect",
            Kind::Pair => "two effects",
            Kind::Triple => "three effects",
            Kind::Group => "group",
            Kind::Number => "wrong number",
            Kind::Composed => "composed term",
            Kind::Stranger => "stranger",
        }
    }
}

/// What the noise is like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Colour {
    /// Independent from sample to sample.
    White,
    /// Each deviation goes with the one before it.
    Correlated,
    /// Readings are rounded to whole steps.
    Quantised,
    /// Velocities are filtered differences of noisy positions.
    Filtered,
}

impl Colour {
    /// In a word.
    pub(crate) fn text(self) -> &'static str {
        match self {
            Colour::White => "white",
            Colour::Correlated => "correlated",
            Colour::Quantised => "quantised",
            Colour::Filtered => "filtered velocity",
        }
    }
}

/// Which numbers of the spec are known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Known {
    /// All of them.
    All,
    /// Some.
    Half,
    /// None: terms are known, their coefficients are to be learned.
    None,
}

impl Known {
    /// In a word.
    pub(crate) fn text(self) -> &'static str {
        match self {
            Known::All => "all numbers",
            Known::Half => "half of them",
            Known::None => "none",
        }
    }
}

/// What is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Seen {
    /// Positions and momenta of several runs.
    States,
    /// Positions alone.
    Positions,
    /// Positions and momenta at irregular times, with gaps and lost cells.
    Irregular,
    /// One long run.
    LongRun,
}

impl Seen {
    /// In words.
    pub(crate) fn text(self) -> &'static str {
        match self {
            Seen::States => "states",
            Seen::Positions => "positions",
            Seen::Irregular => "irregular, gaps",
            Seen::LongRun => "one long run",
        }
    }
}

/// By how much of their spread what is hidden moves the samples.
pub(crate) const REACHES: [f64; 4] = [0.02, 0.2, 1.0, 2.0];
/// Noise in parts of each column's spread.
pub(crate) const NOISES: [f64; 4] = [0.0, 0.001, 0.01, 0.05];
/// Turns of a unit oscillator in a run.
pub(crate) const PERIODS: [f64; 5] = [5.0, 12.0, 30.0, 80.0, 200.0];
/// Colours of the noise: most is white.
const COLOURS: [Colour; 6] = [
    Colour::White,
    Colour::White,
    Colour::White,
    Colour::Correlated,
    Colour::Quantised,
    Colour::Filtered,
];

/// What is hidden.
#[derive(Debug, Clone)]
pub(crate) enum What {
    /// Nothing.
    Nothing,
    /// Statements of the language, each with a coefficient; the labels of effects.
    Statements(Vec<(String, String)>),
    /// A row of the wrong numbers.
    Number(usize),
    /// A row of the hidden partners, or beyond them of the strangers.
    Partner(usize),
    /// A row of the strangers that are no system of the language.
    Stranger(usize),
}

/// One case of the design.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    /// Its place in the design, from 0.
    pub number: usize,
    /// What kind of thing is hidden.
    pub kind: Kind,
    /// The system.
    pub base: &'static Base,
    /// What is hidden in it.
    pub what: What,
    /// Its strength: by how much of their spread the samples move.
    pub reach: f64,
    /// Noise in parts of each column's spread.
    pub noise: f64,
    /// What that is like.
    pub colour: Colour,
    /// Turns in a run.
    pub periods: f64,
    /// What the spec knows.
    pub known: Known,
    /// What is measured.
    pub seen: Seen,
    /// Of starts and noise.
    pub seed: u64,
}

impl Plan {
    /// Labels of the effects that are hidden.
    pub(crate) fn labels(&self) -> Vec<String> {
        match &self.what {
            What::Statements(all) => all.iter().map(|(label, _)| label.clone()).collect(),
            _ => Vec::new(),
        }
    }
}

/// A number in `0..count`: in each stretch of `count` values of `k`, every one once, shuffled.
fn level(factor: u64, k: usize, count: usize) -> usize {
    let block = (k / count) as u64;
    let mut order: Vec<usize> = (0..count).collect();
    let seed = factor.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ block.wrapping_mul(0xbf58_476d);
    order.shuffle(&mut Pcg64::seed_from_u64(seed));
    order[k % count]
}

/// The first `count` cases of the design.
pub(crate) fn plans(count: usize) -> Vec<Plan> {
    let slots: Vec<Kind> =
        Kind::SHARES.iter().flat_map(|&(kind, share)| vec![kind; share]).collect();
    let mut met = [0usize; Kind::SHARES.len()];
    (0..count)
        .map(|number| {
            let kind = slots[level(1, number, slots.len())];
            let k = met[kind as usize];
            met[kind as usize] += 1;
            plan(number, kind, k)
        })
        .collect()
}

/// The k-th case of a kind.
fn plan(number: usize, kind: Kind, k: usize) -> Plan {
    let of = |factor: u64, count: usize| level(100 * (kind as u64 + 1) + factor, k, count);
    let (base, what) = match kind {
        Kind::Nothing => (&BASES[of(0, BASES.len())], What::Nothing),
        Kind::Single => {
            let rows: Vec<_> =
                BASES.iter().flat_map(|base| base.hidden.iter().map(move |h| (base, h))).collect();
            let (base, &(effect, on)) = rows[of(0, rows.len())];
            (base, What::Statements(vec![effect_on(effect, on)]))
        }
        Kind::Pair | Kind::Triple => {
            let base = &BASES[of(0, BASES.len())];
            let mut all: Vec<_> = base.hidden.iter().collect();
            all.shuffle(&mut Pcg64::seed_from_u64(7919 * (number as u64 + 1)));
            let some = all.into_iter().take(if kind == Kind::Pair { 2 } else { 3 });
            let some = some.map(|&(effect, on)| effect_on(effect, on)).collect();
            (base, What::Statements(some))
        }
        Kind::Group => {
            let (name, effect, on) = GROUPS[of(0, GROUPS.len())];
            (base(name), What::Statements(vec![effect_on(effect, on)]))
        }
        Kind::Number => {
            let row = of(0, NUMBERS.len());
            (base(NUMBERS[row].base), What::Number(row))
        }
        Kind::Composed => {
            let all = hidden_terms();
            let hidden = &all[of(0, all.len())];
            let label = hidden.statement.clone();
            (hidden.base, What::Statements(vec![(label, hidden.statement.clone())]))
        }
        Kind::Stranger => {
            let others: Vec<usize> =
                (0..STRANGERS.len()).filter(|&row| !STRANGERS[row].is_statement()).collect();
            let row = of(0, PARTNERS.len() + others.len());
            let (name, what) = match row.checked_sub(PARTNERS.len()) {
                None => (PARTNERS[row].base, What::Partner(row)),
                Some(rest) => (STRANGERS[others[rest]].base, What::Stranger(others[rest])),
            };
            (base(name), what)
        }
    };
    let known = [Known::All, Known::Half, Known::None][of(5, 3)];
    let noise = NOISES[of(2, NOISES.len())];
    let mut plan = Plan {
        number,
        kind,
        base,
        what,
        reach: REACHES[of(1, REACHES.len())],
        noise,
        colour: if noise > 0.0 { COLOURS[of(3, COLOURS.len())] } else { Colour::White },
        periods: PERIODS[of(4, PERIODS.len())],
        // A wrong number must be a known one.
        known: if kind == Kind::Number { Known::All } else { known },
        seen: [Seen::States, Seen::Positions, Seen::Irregular, Seen::LongRun][of(6, 4)],
        seed: number as u64 + 1,
    };
    if plan.colour == Colour::Filtered && !may_be_filtered(&plan) {
        plan.colour = Colour::Correlated;
    }
    plan
}

/// Label and statement of an effect.
fn effect_on(effect: &str, on: &[&str]) -> (String, String) {
    let arguments: Vec<String> = on.iter().map(|s| s.to_string()).collect();
    let row = by_name(effect).unwrap_or_else(|| panic!("{effect} is not in the catalogue"));
    (row.label(&arguments), statement(effect, on))
}
