//! The hidden-effect benchmark: every effect of the catalogue is hidden in simulated
//! measurements, and the diagnosis must name it. Regenerates docs/hidden-effects.md.
//!
//! ```console
//! $ cargo run --release --example hidden_effects
//! $ cargo run --release --example hidden_effects -- 0.01 0.05 1         # two noises, one seed
//! $ cargo run --release --example hidden_effects -- pendulum 0.01 1 -v  # base, noise, seed
//! $ cargo run --release --example hidden_effects -- two                 # two effects at once
//! ```

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a benchmark that fails stops"
)]

#[allow(dead_code, reason = "the tests use the rest")]
#[path = "../../tests/learning/hidden/mod.rs"]
mod hidden;
mod table;

use hidden::bases::BASES;
use hidden::outcome::{Outcome, outcome};
use hidden::pairs::{PAIRS, Pair};
use hidden::strangers::STRANGERS;
use hidden::{case, statement};
use leverrier::internals::spec::effects::by_name;
use rayon::prelude::*;

/// Noise in parts of each column's spread.
const NOISES: [f64; 3] = [0.0, 0.01, 0.05];
const SEEDS: [u64; 3] = [1, 2, 3];

/// Noise and seeds of the cases with two effects.
const TWO_NOISES: [f64; 2] = [0.01, 0.05];
const TWO_SEEDS: u64 = 10;

/// One case that is to be run.
#[derive(Clone)]
struct Task {
    base: &'static str,
    /// Label of the hidden effect; empty where nothing is hidden.
    hidden: String,
    /// Whether the catalogue has it.
    listed: bool,
    stranger: Option<usize>,
    statement: String,
    noise: f64,
    seed: u64,
}

fn tasks() -> Vec<Task> {
    let mut out = Vec::new();
    for noise in NOISES {
        for seed in SEEDS {
            for base in BASES {
                let plain = Task {
                    base: base.name,
                    hidden: String::new(),
                    listed: true,
                    stranger: None,
                    statement: String::new(),
                    noise,
                    seed,
                };
                for &(effect, on) in base.hidden {
                    let arguments: Vec<String> = on.iter().map(|s| s.to_string()).collect();
                    let row = by_name(effect).expect("a row of the catalogue");
                    let (hidden, statement) = (row.label(&arguments), statement(effect, on));
                    out.push(Task { hidden, statement, ..plain.clone() });
                }
                out.push(plain.clone());
                for (number, stranger) in STRANGERS.iter().enumerate() {
                    if stranger.base == base.name {
                        let hidden = stranger.name.to_string();
                        let stranger = Some(number);
                        out.push(Task { hidden, listed: false, stranger, ..plain.clone() });
                    }
                }
            }
        }
    }
    out
}

fn run(task: &Task) -> Outcome {
    let base = BASES.iter().find(|base| base.name == task.base).expect("a row of BASES");
    let case = match task.stranger {
        Some(number) => STRANGERS[number].case(task.noise, task.seed),
        None => case(base, &task.statement, task.noise, task.seed),
    };
    outcome(&case, &task.hidden)
}

/// What the loop found where two effects are hidden.
pub struct Two {
    pair: &'static Pair,
    noise: f64,
    seed: u64,
    found: Vec<String>,
    stop: String,
    held_out_error: f64,
}

fn two(wanted: impl Fn(&Pair, f64, u64) -> bool) -> Vec<Two> {
    let mut all: Vec<(&Pair, f64, u64)> = Vec::new();
    for pair in PAIRS {
        for noise in TWO_NOISES {
            all.extend((1..=TWO_SEEDS).map(|seed| (pair, noise, seed)));
        }
    }
    all.retain(|&(pair, noise, seed)| wanted(pair, noise, seed));
    let run = |&(pair, noise, seed): &(&'static Pair, f64, u64)| {
        let (discovery, found) = pair.discovered(noise, seed);
        let held_out_error = discovery.held_out_error.1;
        let two = Two { pair, noise, seed, found, stop: discovery.stop, held_out_error };
        println!("{}", table::line_of_two(&two));
        two
    };
    all.par_iter().map(run).collect()
}

fn main() {
    let mut asked: Vec<String> = std::env::args().skip(1).collect();
    let verbose = asked.iter().any(|word| word == "-v");
    asked.retain(|word| word != "-v");
    // Numbers below 1 are noises, others seeds; without any of a kind all of it are wanted.
    let numbers: Vec<f64> = asked.iter().filter_map(|word| word.parse().ok()).collect();
    let words: Vec<&String> = asked.iter().filter(|word| word.parse::<f64>().is_err()).collect();
    let among = |x: f64, below_one: bool| {
        let mut same = numbers.iter().filter(|n| (**n < 1.0) == below_one).peekable();
        same.peek().is_none() || same.any(|n| *n == x)
    };
    let wanted = |task: &Task| {
        let named = |word: &str| match word {
            "nothing" => task.hidden.is_empty(),
            _ => task.base == word || task.hidden.starts_with(word),
        };
        among(task.noise, true)
            && among(task.seed as f64, false)
            && words.iter().all(|word| named(word))
    };
    let wanted_pair = |pair: &Pair, noise: f64, seed: u64| {
        among(noise, true)
            && among(seed as f64, false)
            && words.iter().all(|word| pair.base == *word || *word == "two")
    };
    let whole = words.is_empty();
    let pairs = words.iter().any(|word| *word == "two");
    let tasks: Vec<Task> = tasks().into_iter().filter(|t| !pairs && wanted(t)).collect();
    let clock = std::time::Instant::now();
    let done: Vec<(Task, Outcome)> = tasks
        .par_iter()
        .map(|task| {
            let outcome = run(task);
            println!("{}", table::line(task, &outcome));
            if verbose {
                println!("{}", table::leaders(&outcome));
            }
            (task.clone(), outcome)
        })
        .collect();
    let seconds = clock.elapsed().as_secs_f64();
    let pairs = if whole || pairs { two(wanted_pair) } else { Vec::new() };
    let page = table::page(&done, &pairs);
    println!("{page}\n{} cases in {seconds:.0} s", done.len());
    // A part of the bases or effects makes no page; fewer noises and seeds do, and it says so.
    if whole {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/hidden-effects.md");
        if let Err(error) = std::fs::write(path, &page) {
            eprintln!("{path}: {error}");
        }
    }
}
