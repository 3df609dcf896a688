//! The hidden-effect benchmark: what the diagnosis tells of measurements in which something is
//! hidden, or nothing. Writes docs/hidden-effects.md.
//!
//! ```console
//! $ cargo run --release --example hidden_effects                 # the whole design; goes on
//! $ cargo run --release --example hidden_effects -- --cases 240  # the first tenth of it
//! $ cargo run --release --example hidden_effects -- --turns 5    # those with short runs alone
//! $ cargo run --release --example hidden_effects -- --threads 1
//! $ cargo run --release --example hidden_effects -- --page       # the page of what was run
//! $ cargo run --release --example hidden_effects -- --case 17    # one case, with all that is told
//! ```
//!
//! Every case that is done is a line of target/hidden-effects.jsonl (`--results` names another
//! file): a run that was ended goes on where it was.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a benchmark that fails stops"
)]

#[allow(dead_code, reason = "the tests use the rest")]
#[path = "../../tests/learning/hidden/mod.rs"]
mod hidden;
mod page;

use std::collections::HashSet;
use std::fs::{self, OpenOptions};
use std::io::Write as _;
use std::panic::catch_unwind;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::Parser;
use hidden::design::{Plan, plans};
use hidden::making::made;
use hidden::score::{Record, scored};
use leverrier::internals::data::{Layout, to_csv};

/// Seconds that a case may take.
const PATIENCE: f64 = 200.0;

/// Cases of the whole design.
const CASES: usize = 2400;

/// Hides effects, and asks what is missing.
#[derive(Parser)]
struct Arguments {
    /// How many cases of the design, from its beginning
    #[arg(long, default_value_t = CASES)]
    cases: usize,
    /// Of these, only those with so many turns in a run (5, 12, 30, 80 or 200)
    #[arg(long)]
    turns: Option<f64>,
    /// How many at once
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// A line of JSON for every case
    #[arg(long, default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/target/hidden-effects.jsonl"))]
    results: PathBuf,
    /// Only make the page of what was run
    #[arg(long)]
    page: bool,
    /// Run this case alone, and say all about it
    #[arg(long)]
    case: Option<usize>,
    /// Only list the cases
    #[arg(long)]
    list: bool,
    /// With --case: write its spec and measurements to a folder instead
    #[arg(long)]
    write: Option<PathBuf>,
}

/// The lines of a file of results; one that was cut off is left out.
fn records(path: &PathBuf) -> Vec<Record> {
    let text = fs::read_to_string(path).unwrap_or_default();
    text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect()
}

/// One case in a line.
fn line(record: &Record) -> String {
    let labels = |of: &[hidden::score::Member]| -> String {
        let all: Vec<&str> = of.iter().map(|one| one.label.as_str()).collect();
        all.join(" and ")
    };
    let is_run = !(record.verdict.is_empty() && record.reason.is_empty());
    format!(
        "{:>4} {:<22} {:<12} {:<11} reach {:<4} noise {:<5} {:<11} {:>3.0} turns {:<12} {:<15} \
         {:6.1} s | {} | {}{}",
        record.number,
        if is_run { record.mark().text() } else { "" },
        record.kind,
        record.base,
        record.reach.0,
        record.noise,
        record.colour,
        record.periods,
        record.known,
        record.seen,
        record.seconds,
        labels(&record.hidden),
        labels(&record.story),
        match is_run && !record.hidden.is_empty() && !record.identifiable() {
            true => " (not identifiable)",
            false => "",
        },
    )
}

/// A case, whatever becomes of it.
fn run(plan: &Plan) -> Record {
    catch_unwind(|| scored(plan, PATIENCE))
        .unwrap_or_else(|_| Record { reason: "the case panicked".to_string(), ..Record::of(plan) })
}

fn main() {
    let arguments = Arguments::parse();
    let number = arguments.case.map_or(arguments.cases, |case| case + 1);
    let mut design = plans(number);
    if let Some(turns) = arguments.turns.filter(|_| arguments.case.is_none()) {
        design.retain(|plan| plan.periods == turns);
    }
    if let Some(plan) = arguments.case.and_then(|case| design.get(case)) {
        return one(plan, arguments.write);
    }
    if arguments.list {
        return design.iter().for_each(|plan| println!("{}", line(&Record::of(plan))));
    }
    let done: HashSet<usize> = records(&arguments.results).iter().map(|one| one.number).collect();
    if !arguments.page {
        let open: Vec<&Plan> = design.iter().filter(|plan| !done.contains(&plan.number)).collect();
        let file = OpenOptions::new().create(true).append(true).open(&arguments.results);
        let file = Mutex::new(file.expect("the file of results"));
        let next = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..arguments.threads.max(1) {
                scope.spawn(|| {
                    while let Some(plan) = open.get(next.fetch_add(1, Ordering::Relaxed)) {
                        let record = run(plan);
                        println!("{}", line(&record));
                        let text = serde_json::to_string(&record).expect("a record is JSON");
                        let mut file = file.lock().expect("no thread panics while it writes");
                        writeln!(file, "{text}").expect("the file of results");
                    }
                });
            }
        });
    }
    let mut all = records(&arguments.results);
    all.retain(|record| record.number < arguments.cases);
    all.sort_by_key(|record| record.number);
    all.dedup_by_key(|record| record.number);
    let text = page::page(&all, CASES);
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/hidden-effects.md");
    fs::write(path, text).expect("docs/hidden-effects.md");
    println!("{} of {CASES} cases are on the page", all.len());
}

/// All about one case.
fn one(plan: &Plan, folder: Option<PathBuf>) {
    if let Some(folder) = folder {
        let made = made(plan).expect("a case that does not run away");
        fs::create_dir_all(&folder).expect("a folder");
        fs::write(folder.join("case.ham"), &made.case.text).expect("the spec");
        for (name, data) in
            [("training.csv", &made.case.training), ("held_out.csv", &made.case.held_out)]
        {
            let path = folder.join(name);
            let text = to_csv(&path, data, &Layout::default()).expect("the measurements");
            fs::write(path, text).expect("the measurements");
        }
        return;
    }
    let record = run(plan);
    println!("{}", line(&record));
    println!("{}", serde_json::to_string_pretty(&record).expect("a record is JSON"));
}
