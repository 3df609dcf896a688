//! docs/reliability.md: what was tried, how often, what was found.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::clothes::ROUNDING;
use super::promises::kolmogorov_smirnov;
use super::records::Record;
use super::targets::TARGETS;

const HEAD: &str = "# Reliability

What this program is tried with before others try it: seven habits, each with a short form that
`.ci/run` carries out before every change, and a long form that is one command. This page is written
by `cargo run --release --example reliability -- page` from what the long forms left in
target/reliability.jsonl. They go on where they were left; the numbers are sums over all runs.
What is promised stands in [security.md](security.md).
";

/// What was found, by which habit, and what became of it. A find is a row and a test.
const FINDS: &[(&str, &str, &str)] = &[
    (
        "fuzzing (whole runs)",
        "`Law::compare` with measurements of which nothing was held out panicked",
        "it is refused with a sentence",
    ),
    (
        "fuzzing (specs)",
        "a spec with a velocity more than it has coordinates, and units, panicked",
        "it gets its error; what reads and lowers specs indexes nothing, which a lint holds",
    ),
    (
        "fuzzing (damaged files)",
        "fits of files with times 1e204 apart took for ever or panicked, for they were to be \
         integrated in as many steps; where values have no squares, they ended with a sentence on \
         something else",
        "no two samples are bridged that are 1,000 typical intervals apart; values beyond 1e100 are \
         refused with a sentence",
    ),
    (
        "by hand (signals)",
        "SIGINT in a diagnosis of some thousand samples: the answer came after 15 s to 50 s",
        "passes over the data end where they are; the verdict is `interrupted` \
         (`tests/program/interrupts.rs`)",
    ),
    (
        "fill",
        "an `undo` that could not write its ledger was refused, but had changed the spec",
        "the spec is put back",
    ),
    (
        "kill",
        "temporary files of killed commands stayed for ever",
        "the next command that writes there removes them; those in use are locked",
    ),
    (
        "promised statistics",
        "a diagnosis lost the scores of all effects that were tried beside a shifted clock of a \
         momentum, where the fit had left out a force: p-values of 1 for what may well be missing",
        "what was left out counts as zero, and a candidate that gives no number is tried alone",
    ),
    (
        "clothes",
        "with positions alone and runs of 200 samples, the order of the runs decides between two \
         integrators that both pass as accurate enough; the coarser moves coefficients of \
         Henon-Heiles by two standard errors (and standard errors of the Kepler problem by 0.3 %)",
        "open: the error that an integrator is allowed does not shrink with the number of samples",
    ),
    (
        "two implementations",
        "at 6 of 20,000 random expressions, at points of up to a million, the evaluators gave a \
         number where the plain evaluation gives none",
        "open: not looked into; an overflow on the way is the likely cause",
    ),
    (
        "by hand, from outside",
        "text of a model file became code of an exported simulator; two `add` at once lost one; the \
         origin of the clock changed verdicts; `new` took minutes on 100,000 columns",
        "tests in `tests/program` and `tests/learning/clock.rs`",
    ),
];

/// All lines of a habit, summed by their part.
fn parts<'a>(records: &'a [Record], habit: &str) -> Vec<(&'a str, Record)> {
    let mut order: Vec<&str> = Vec::new();
    let mut sums: BTreeMap<&str, Record> = BTreeMap::new();
    for one in records.iter().filter(|one| one.habit == habit) {
        if !order.contains(&one.part.as_str()) {
            order.push(&one.part);
        }
        let sum = sums.entry(&one.part).or_insert_with(|| Record::of(habit, &one.part));
        sum.tried += one.tried;
        sum.found += one.found;
        sum.seconds += one.seconds;
        sum.figures.extend(one.figures.clone());
        sum.values.extend(&one.values);
    }
    order.into_iter().filter_map(|part| Some((part, sums.remove(part)?))).collect()
}

/// A number with a space between its thousands.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut out = String::new();
    for (at, digit) in digits.chars().enumerate() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

fn minutes(seconds: f64) -> String {
    if seconds < 90.0 { format!("{seconds:.0} s") } else { format!("{:.0} min", seconds / 60.0) }
}

fn table(out: &mut String, header: &[&str], rows: &[Vec<String>]) {
    let _ = writeln!(out, "| {} |", header.join(" | "));
    let _ = writeln!(out, "|{}", "---|".repeat(header.len()));
    for row in rows {
        let _ = writeln!(out, "| {} |", row.join(" | "));
    }
    out.push('\n');
}

fn fuzzing(records: &[Record]) -> String {
    let mut out = String::from(
        "
## 1. Fuzzing

Bytes go into everything that reads what others wrote, and into whole runs on specs and tables made
from them: inputs that are sound, with bytes and words changed and parts moved from one to another,
without guidance by coverage. Specs are changed by their grammar, too: statements, names, numbers and
units change places; that alone is `LEVERRIER_CASES=100000 cargo test --test reliability
fuzz::grammar`, which found nothing in 439 s on 2026-11-26, and fits of damaged files are
`fuzz::damaged`. No panic; what was read is written and read again as the same; the studio still
answers.

",
    );
    let all = parts(records, "random");
    let rows: Vec<Vec<String>> = TARGETS
        .iter()
        .filter_map(|target| {
            let (_, sum) = all.iter().find(|(part, _)| *part == target.name)?;
            let what = target.what.to_string();
            Some(vec![what, grouped(sum.tried), minutes(sum.seconds), sum.found.to_string()])
        })
        .collect();
    table(&mut out, &["what", "inputs", "in", "finds"], &rows);
    out
}

fn killing(records: &[Record]) -> String {
    let mut out = String::from(
        "## 2. Kill, fill, forbid

Every command that writes is killed (SIGKILL), half of the times at any moment and half of them when
something in its folder has just changed. Afterwards every file is the old one or the new one,
`history`, `check` and `fit` work, and the next command that writes leaves no temporary file. The
same commands on a disk with no room, or with room for some of what they write; where no file may
grow beyond a block; in a folder that can only be read; on measurements that are cut off or removed
while they are read, in one pass or in several; and from a pipe.

",
    );
    let mut rows = Vec::new();
    for habit in ["kill", "fill", "forbid"] {
        rows.extend(parts(records, habit).into_iter().map(|(part, sum)| {
            let what = if habit == "kill" { format!("`{part}` killed") } else { part.to_string() };
            vec![what, grouped(sum.tried), sum.found.to_string()]
        }));
    }
    table(&mut out, &["what", "times", "finds"], &rows);
    out
}

fn dressing(records: &[Record]) -> String {
    let mut out = format!(
        "## 3. Clothes

Every system of the benchmark, with all measured and with positions alone, in other clothes. The
same terms; coefficients and standard errors to the bit where only the form of the file or the number
of threads is another, else to {ROUNDING} standard errors. The largest move of any coefficient over all
systems that can wear it:

"
    );
    let mut worst: Vec<(String, u64, f64)> = Vec::new();
    for (_, sum) in parts(records, "clothes") {
        for (name, moved) in sum.figures {
            match worst.iter_mut().find(|(known, ..)| *known == name) {
                Some((_, count, most)) => (*count, *most) = (*count + 1, most.max(moved)),
                None => worst.push((name, 1, moved)),
            }
        }
    }
    let rows: Vec<Vec<String>> = worst
        .into_iter()
        .map(|(name, count, moved)| {
            let moved = match moved {
                0.0 => "0".to_string(),
                large if large > 1e200 => "another precision or law".to_string(),
                moved => format!("{moved:.0e}"),
            };
            vec![name, count.to_string(), moved]
        })
        .collect();
    table(&mut out, &["garment", "systems", "moved by, in standard errors"], &rows);
    out
}

fn promises(records: &[Record]) -> String {
    let mut out = String::from(
        "## 4. Promised statistics

Simulated measurements with a noise of 0.02, five runs of 60 samples; the number of a case is its
seed, from 0. Intervals of 1, 1.96 and 3 standard errors should hold the truth in 68.3, 95.0 and
99.7 % of cases. Where nothing is hidden, the p-value of one candidate of the diagnosis (another one
in every case, before the correction for having tried so many) should be even between 0 and 1: the
distance is that of Kolmogorov and Smirnov, with the probability that even numbers are as far.

",
    );
    let all = parts(records, "promises");
    let row = |(name, sum): &(&str, Record)| {
        let intervals = sum.figure("intervals");
        let share = |of: &str| format!("{:.1} %", 100.0 * sum.figure(of) / intervals.max(1.0));
        let (distance, chance) = kolmogorov_smirnov(&sum.values);
        vec![
            name.to_string(),
            grouped(sum.tried),
            grouped(intervals as u64),
            share("within 1"),
            share("within 1.96"),
            share("within 3"),
            format!("{}", sum.figure("lost")),
            format!("{distance:.3}, {chance:.2}"),
        ]
    };
    let rows: Vec<Vec<String>> = all.iter().map(row).collect();
    let header = ["law", "cases", "intervals", "in 1", "in 1.96", "in 3", "terms lost", "p-values"];
    table(&mut out, &header, &rows);
    out += "Terms that were chosen, by how often they are chosen when the data are resampled, and \
            how many of\nthem belong to the law:\n\n";
    let sum = |what: &str| all.iter().map(|(_, sum)| sum.figure(what)).sum::<f64>();
    let rows: Vec<Vec<String>> = (0..10)
        .filter(|at| sum(&format!("chosen {at}")) > 0.0)
        .map(|at| {
            let (chosen, right) = (sum(&format!("chosen {at}")), sum(&format!("right {at}")));
            let upper = (at + 1) as f64 / 10.0;
            vec![
                format!("{:.1} to {upper:.1}", at as f64 / 10.0),
                grouped(chosen as u64),
                format!("{:.1} %", 100.0 * right / chosen),
            ]
        })
        .collect();
    table(&mut out, &["inclusion", "chosen", "belong to the law"], &rows);
    out += "What a diagnosis tells where nothing is hidden; with noise of a memory (0.8 from one \
            sample to the\nnext) the option for it is on:\n\n";
    let rows: Vec<Vec<String>> = parts(records, "false alarms")
        .into_iter()
        .map(|(part, sum)| {
            let unexplained = sum.figure("unexplained");
            let counts = [sum.tried, sum.found, unexplained as u64];
            [part.to_string()].into_iter().chain(counts.map(grouped)).collect()
        })
        .collect();
    table(&mut out, &["data", "cases", "something told", "unexplained"], &rows);
    out
}

fn pairs(records: &[Record]) -> String {
    let mut out = String::from(
        "## 5. Two implementations

Random expressions at random points: the portable evaluator and machine code to the bit on every
instruction set of the processor, and both against the plain evaluation of the expression. Random
tables in chunks of random sizes against the table in memory, to the bit. Whole fits of random specs
with machine code and two threads against the portable evaluator and one, as processes of their own:
the same model file.

",
    );
    let rows: Vec<Vec<String>> = parts(records, "twins")
        .into_iter()
        .map(|(part, sum)| vec![part.to_string(), grouped(sum.tried), sum.found.to_string()])
        .collect();
    table(&mut out, &["what", "cases", "finds"], &rows);
    out
}

const TAIL: &str = "## 6. Supply chain

`cargo deny check` holds licences, advisories, duplicates and sources against `deny.toml`, where it is
installed and can reach its database; without it a test holds the licences of all crates against the
same list (`cargo test --test architecture`). What each dependency is for stands in
[security.md](security.md), and so does every file with `unsafe` in it, counted. Where valgrind is
installed, machine code and the evaluators run under it on random expressions.

## 7. Versions

tests/fixtures/versions holds the model, ledger and spec that each version of the formats wrote. They
are read, told, compared, exported, taken back and learned again by `cargo test --test reliability
versions::`.
";

fn found() -> String {
    let mut out = String::from("## What was found\n\n");
    let row = |(habit, what, mended): &(&str, &str, &str)| {
        vec![habit.to_string(), what.to_string(), mended.to_string()]
    };
    let rows: Vec<Vec<String>> = FINDS.iter().map(row).collect();
    table(&mut out, &["habit", "found", "now"], &rows);
    out
}

/// Writes the page.
pub(crate) fn write(records: &[Record]) {
    let parts = [
        HEAD.to_string(),
        fuzzing(records),
        killing(records),
        dressing(records),
        promises(records),
        pairs(records),
        TAIL.to_string() + "\n",
        found(),
    ];
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/reliability.md");
    let text = parts.concat().trim_end().to_string() + "\n";
    std::fs::write(path, text).expect("the folder of the pages");
    println!("{path} written");
}
