//! The long forms of the habits that keep the program reliable. Writes docs/reliability.md.
//!
//! ```console
//! $ cargo build --release                                          # the program that is killed
//! $ cargo run --release --example reliability -- kill 1000         # so many kills
//! $ cargo run --release --example reliability -- clothes           # every system in all clothes
//! $ cargo run --release --example reliability -- promises 1000     # so many cases of each law
//! $ cargo run --release --example reliability -- twins 100000      # so many random expressions
//! $ cargo run --release --example reliability -- random 10000      # so many inputs of each reader
//! $ cargo run --release --example reliability -- page              # the page of what was run
//! ```
//!
//! What is done is a line of target/reliability.jsonl: every part goes on where it was left, and
//! the numbers on the page are sums over all lines. `--threads 1` keeps to one core.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a check that fails stops"
)]

#[path = "../../tests/reliability/choices.rs"]
mod choices;
#[allow(dead_code, reason = "the tests use the rest")]
#[path = "../../tests/reliability/clothes.rs"]
mod clothes;
#[path = "../../tests/reliability/grammar.rs"]
mod grammar;
#[allow(dead_code, reason = "the benchmark of hidden effects uses the rest")]
#[path = "../../tests/learning/hidden/mod.rs"]
mod hidden;
#[allow(dead_code, reason = "the tests use the rest")]
#[path = "../../tests/reliability/killing.rs"]
mod killing;
#[path = "../../tests/reliability/mutated.rs"]
mod mutated;
mod page;
#[allow(dead_code, reason = "the tests use the rest")]
#[path = "../../tests/reliability/promises.rs"]
mod promises;
mod records;
#[path = "../../tests/reliability/runs.rs"]
mod runs;
#[allow(dead_code, reason = "the numeric tests use the rest")]
#[path = "../../tests/numerics/support.rs"]
mod support;
#[path = "../../tests/reliability/targets.rs"]
mod targets;
#[allow(dead_code, reason = "the tests use the rest")]
#[path = "../../tests/reliability/twins.rs"]
mod twins;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use clap::{Parser, Subcommand};
use clothes::{GARMENTS, ROUNDING, Wearer};
use hidden::bases::BASES;
use promises::{Coverage, LAWS};
use records::{Record, kept, records};

/// Runs the long forms.
#[derive(Parser)]
struct Arguments {
    #[command(subcommand)]
    part: Part,
    /// How many threads the library takes
    #[arg(long, global = true)]
    threads: Option<usize>,
}

#[derive(Subcommand)]
enum Part {
    /// Kills writing commands at random moments
    Kill { count: u64 },
    /// Every system of the benchmark in all clothes
    Clothes,
    /// Intervals, p-values, false alarms, inclusion
    Promises { cases: u64 },
    /// Evaluators, streams and whole fits against each other
    Twins { cases: u64 },
    /// Random inputs of every target
    Random { cases: u64 },
    /// Writes docs/reliability.md
    Page,
}

/// How many cases of a part are done.
fn done(habit: &str, part: &str) -> u64 {
    let mine = records().into_iter().filter(|one| one.habit == habit && one.part == part);
    mine.map(|one| one.tried).sum()
}

/// A line is written at least as often: a run that is ended loses no more.
const KEPT: Duration = Duration::from_secs(30);

/// Tries cases of a part that were not tried yet, each of which may panic or take too long, and
/// keeps what came.
fn each(habit: &str, part: &str, count: u64, work: impl Fn(u64)) {
    let from = done(habit, part);
    let mut begun = Instant::now();
    let mut record = Record::of(habit, part);
    for number in from..from + count {
        record.tried += 1;
        if catch_unwind(AssertUnwindSafe(|| work(number))).is_err() {
            record.found += 1;
            record.finds.push(number);
        }
        if begun.elapsed() > KEPT || number + 1 == from + count {
            record.seconds = begun.elapsed().as_secs_f64();
            println!("{habit}, {part}: {} tried, found: {:?}", record.tried, record.finds);
            kept(&std::mem::replace(&mut record, Record::of(habit, part)));
            begun = Instant::now();
        }
    }
}

fn kill(count: u64) {
    let experiments = killing::experiments();
    let share = count.div_ceil(experiments.len() as u64);
    for experiment in &experiments {
        each("kill", experiment.writing.name, share, |seed| experiment.killed(seed));
    }
    each("fill", "full disk", 1, |_| {
        killing::on_a_full_disk(&[0, 1000, 3000, 10_000, 30_000]).expect("a disk of its own");
    });
    each("fill", "files that stay small", 1, |_| {
        killing::where_files_stay_small().expect("a Unix system");
    });
    each("forbid", "read-only folder", 1, |_| {
        killing::in_a_read_only_folder().expect("a disk of its own");
    });
}

fn clothes() {
    for base in BASES {
        for seen in ["states", "positions"] {
            let plain = Wearer::new(base, "", 0.01, 17);
            let plain = if seen == "positions" { plain.positions_only() } else { plain };
            let part = format!("{}, {seen}", base.name);
            let mut record = Record::of("clothes", &part);
            let begun = Instant::now();
            for garment in GARMENTS.iter().filter(|garment| (garment.fits)(&plain)) {
                let moved = clothes::moved(&plain, garment);
                println!("{part}, {}: {moved:.1e} standard errors", garment.name);
                record.tried += 1;
                record.found += u64::from(moved > ROUNDING);
                record.figures.push((garment.name.to_string(), moved.min(1e300)));
            }
            record.seconds = begun.elapsed().as_secs_f64();
            kept(&record);
        }
    }
}

fn promises(cases: u64) {
    for law in LAWS {
        let from = done("promises", law.name);
        let begun = Instant::now();
        let mut record = Record::of("promises", law.name);
        let found = Coverage::of(law, from..from + cases);
        record.tried = cases;
        let counts = [found.intervals, found.within[0], found.within[1], found.within[2]];
        let names = ["intervals", "within 1", "within 1.96", "within 3"];
        record.figures =
            names.map(str::to_string).into_iter().zip(counts.map(|n| n as f64)).collect();
        record.figures.push(("lost".to_string(), found.lost as f64));
        for (at, (chosen, right)) in found.inclusion.iter().enumerate() {
            record.figures.push((format!("chosen {at}"), *chosen as f64));
            record.figures.push((format!("right {at}"), *right as f64));
        }
        record.values = promises::p_values(law, from..from + cases);
        record.seconds = begun.elapsed().as_secs_f64();
        kept(&record);
        for (what, memory) in [("white noise", 0.0), ("noise with a memory", 0.8)] {
            let part = format!("{}, {what}", law.name);
            let from = done("false alarms", &part);
            let begun = Instant::now();
            let mut record = Record::of("false alarms", &part);
            // A diagnosis takes as long as some ten fits.
            let count = cases.div_ceil(10);
            let (missing, unexplained) = promises::told(law, from..from + count, memory);
            (record.tried, record.found) = (count, missing as u64);
            record.figures = vec![("unexplained".to_string(), unexplained as f64)];
            record.seconds = begun.elapsed().as_secs_f64();
            println!("{part}: {missing} missing, {unexplained} unexplained of {count}");
            kept(&record);
        }
    }
}

fn main() {
    let arguments = Arguments::parse();
    if let Some(threads) = arguments.threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build_global().expect("the first pool of this program");
    }
    match arguments.part {
        Part::Kill { count } => kill(count),
        Part::Clothes => clothes(),
        Part::Promises { cases } => promises(cases),
        Part::Twins { cases } => {
            each("twins", "evaluators", cases, twins::evaluators_agree);
            each("twins", "streams", cases.div_ceil(20), twins::streams_agree);
            each("twins", "whole fits", cases.div_ceil(500), |seed| {
                twins::whole_fits_agree(seed..seed + 1);
            });
        }
        Part::Random { cases } => {
            for target in targets::TARGETS {
                let seeds = (target.seeds)();
                // Requests go over a socket, and a run fits, compares and diagnoses.
                let share = match target.name {
                    "request" => cases.div_ceil(20),
                    "run" => cases.div_ceil(100),
                    _ => cases,
                };
                each("random", target.name, share, |number| {
                    (target.run)(&mutated::input(target, &seeds, 1_000_000 + number));
                });
            }
        }
        Part::Page => page::write(&records()),
    }
}
