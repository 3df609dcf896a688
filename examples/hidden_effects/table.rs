//! What the benchmark prints.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use leverrier::internals::diagnose::diagnosis::Verdict;
use leverrier::internals::spec::effects::{EffectKind, by_name};

use super::hidden::outcome::Outcome;
use super::hidden::pairs::PAIRS;
use super::{NOISES, TWO_NOISES, Task, Two};

/// One case in a line.
pub fn line(task: &Task, outcome: &Outcome) -> String {
    let after = outcome.after.map_or_else(|| "-".to_string(), |x| format!("{x:.3}"));
    format!(
        "{:<12} {:<32} noise {:<4} seed {} {:<15} {:<7} after {:<8} {:.2} s  {}",
        task.base,
        if task.hidden.is_empty() { "(nothing)" } else { &task.hidden },
        task.noise,
        task.seed,
        word(outcome.verdict),
        format!("{:?}", outcome.place),
        after,
        outcome.seconds,
        outcome.group.join(" ~ "),
    )
}

/// One case of two effects in a line.
pub fn line_of_two(two: &Two) -> String {
    format!(
        "{:<12} {:<44} noise {:<4} seed {} found {:<44} held-out {:.3}  {}",
        two.pair.base,
        two.pair.effects.join(" and "),
        two.noise,
        two.seed,
        two.found.join(" and "),
        two.held_out_error,
        two.stop
    )
}

/// The ranking of one case, and what the verdict rests on.
pub fn leaders(outcome: &Outcome) -> String {
    let diagnosis = &outcome.diagnosis;
    let mut out = format!("    {}\n", diagnosis.reason);
    let terms: Vec<String> =
        outcome.model.terms.iter().map(|t| format!("{:.4} {}", t.coefficient, t.term)).collect();
    let noise: Vec<f64> = outcome.model.noise.iter().map(|n| n.standard_deviation).collect();
    let window = outcome.model.evidence.window;
    let _ = writeln!(out, "    {} window {window} noise {noise:.4?}", terms.join(", "));
    let _ = writeln!(out, "    floor {:.4?}", diagnosis.noise_floor);
    for leader in diagnosis.ranking.iter().chain(&diagnosis.further).chain(&diagnosis.unnamed) {
        let _ = writeln!(
            out,
            "    {:<60} deviance {:9.1}  held-out {:.3} -> {:.3}  {:?}",
            leader.snippet,
            leader.deviance,
            leader.held_out_error_before,
            leader.held_out_error_after,
            leader.coefficient
        );
    }
    out
}

fn word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Missing => "missing",
        Verdict::NothingMissing => "nothing missing",
        Verdict::Unexplained => "unexplained",
        Verdict::TooLittleData => "too little data",
    }
}

/// The whole page.
pub fn page(done: &[(Task, Outcome)], pairs: &[Two]) -> String {
    let mut out = String::new();
    let seeds: BTreeSet<u64> = done.iter().map(|(task, _)| task.seed).collect();
    let seeds: Vec<String> = seeds.iter().map(u64::to_string).collect();
    let noises = NOISES.iter().filter(|noise| done.iter().any(|(task, _)| task.noise == **noise));
    let noises: Vec<String> = noises.map(|noise| format!("{:.0} %", 100.0 * noise)).collect();
    let _ = writeln!(
        out,
        "{HEAD}\nOn this page: {} cases, noise {}, seeds {}.",
        done.len(),
        noises.join(", "),
        seeds.join(", ")
    );
    out.push_str(
        "\n## Goals\n\n| question | noise | cases | share | goal |\n|---|---|---|---|---|\n",
    );
    for noise in NOISES {
        let here: Vec<_> = done.iter().filter(|(task, _)| task.noise == noise).collect();
        let listed = here.iter().filter(|(task, _)| task.listed && !task.hidden.is_empty());
        let goal = match noise {
            x if x > 0.02 => "85 %",
            x if x > 0.0 => "95 %",
            _ => "",
        };
        let named =
            |of: &(Task, Outcome)| of.1.place.is_named() && of.1.verdict == Verdict::Missing;
        row(
            &mut out,
            "the hidden effect is first, or in a group of at most three",
            noise,
            goal,
            listed.clone().map(|c| named(c)),
        );
        row(
            &mut out,
            "... and its addition brings held-out runs to 1.1 times the noise",
            noise,
            "",
            listed.clone().filter(|c| named(c)).map(|c| c.1.after.is_some_and(|x| x <= 1.1)),
        );
        row(
            &mut out,
            "nothing is hidden, nothing is named",
            noise,
            "95 %",
            here.iter()
                .filter(|c| c.0.hidden.is_empty())
                .map(|c| c.1.verdict == Verdict::NothingMissing),
        );
        row(
            &mut out,
            "no effect of the catalogue is hidden: unexplained",
            noise,
            "90 %",
            here.iter().filter(|c| !c.0.listed).map(|c| c.1.verdict == Verdict::Unexplained),
        );
    }
    if !pairs.is_empty() {
        at_once(&mut out, pairs);
    }
    kinds(&mut out, done);
    effects(&mut out, done);
    out
}

const HEAD: &str = "# Hidden effects\n\n\
    Every effect of the catalogue is hidden in simulated measurements of a known system, with the\n\
    strength at which it moves the samples by a fifth of their spread; what the catalogue does not\n\
    have moves them by half of it, because a weak delay or a distant body is, up to the noise, what\n\
    some damping or spring does. 8 runs of 200 samples from random starts, two runs held_out. Whoever\n\
    asks knows the system's terms, but not its numbers, and not the effect. Noise is in parts of\n\
    each column's spread.\n\n\
    `cargo run --release --example hidden_effects` makes this page.\n";

/// How often the loop finds both of two effects and nothing else.
fn at_once(out: &mut String, pairs: &[Two]) {
    out.push_str(
        "\n## Two effects at once\n\nWhat `discover` adds to the bare spec. The goal is both of \
         them and nothing else in 90 %.\n\n| hidden | in | noise | both, nothing else | both | \
         held-out error at the end | instead |\n|---|---|---|---|---|---|---|\n",
    );
    for pair in PAIRS {
        for noise in TWO_NOISES {
            let same = |two: &&Two| std::ptr::eq(two.pair, pair) && two.noise == noise;
            let here: Vec<&Two> = pairs.iter().filter(same).collect();
            let exact = here.iter().filter(|two| two.found == pair.effects).count();
            let has = |two: &Two| pair.effects.iter().all(|e| two.found.iter().any(|f| f == e));
            let both = here.iter().filter(|two| has(two)).count();
            let worst = here.iter().map(|two| two.held_out_error).fold(0.0, f64::max);
            let others: BTreeSet<String> = here
                .iter()
                .filter(|two| two.found != pair.effects)
                .map(|two| two.found.join(" and "))
                .collect();
            let others: Vec<String> = others.into_iter().collect();
            let _ = writeln!(
                out,
                "| {} | {} | {:.0} % | {exact} of {count} | {both} of {count} | at most {worst:.2} | {} |",
                pair.effects.join(" and "),
                pair.base,
                100.0 * noise,
                others.join("; "),
                count = here.len(),
            );
        }
    }
}

fn row(out: &mut String, what: &str, noise: f64, goal: &str, hits: impl Iterator<Item = bool>) {
    let hits: Vec<bool> = hits.collect();
    if hits.is_empty() {
        return;
    }
    let share = 100.0 * hits.iter().filter(|hit| **hit).count() as f64 / hits.len() as f64;
    let _ =
        writeln!(out, "| {what} | {} % | {} | {share:.1} % | {goal} |", 100.0 * noise, hits.len());
}

/// What an effect is of, for the matrix; strangers and nothing by themselves.
fn kind(label: &str) -> String {
    let name = label.split('(').next().unwrap_or_default();
    by_name(name)
        .map_or_else(|| "not in the catalogue".to_string(), |row| row.kind.text().to_string())
}

/// What was named, by kind.
fn answer(outcome: &Outcome) -> String {
    match outcome.verdict {
        Verdict::Missing => outcome.first.as_deref().map_or_else(String::new, kind),
        other => word(other).to_string(),
    }
}

/// Confusion of kinds: hidden down, named across.
fn kinds(out: &mut String, done: &[(Task, Outcome)]) {
    let mut columns: Vec<String> =
        EffectKind::ALL.iter().map(|kind| kind.text().to_string()).collect();
    let mut rows = columns.clone();
    columns.extend(["nothing missing".to_string(), "unexplained".to_string()]);
    rows.extend(["nothing".to_string(), "not in the catalogue".to_string()]);
    out.push_str(
        "\n## Confusion of kinds\n\nHidden down, named across; all noises and seeds.\n\n| |",
    );
    for column in &columns {
        let _ = write!(out, " {column} |");
    }
    let _ = write!(out, "\n|---|{}\n", "---|".repeat(columns.len()));
    for name in &rows {
        let of = |task: &Task| {
            if task.hidden.is_empty() { "nothing".to_string() } else { kind(&task.hidden) }
        };
        let here: Vec<_> = done.iter().filter(|(task, _)| of(task) == *name).collect();
        let _ = write!(out, "| **{name}** |");
        for column in &columns {
            let count = here.iter().filter(|(_, outcome)| answer(outcome) == *column).count();
            let _ =
                write!(out, " {} |", if count == 0 { String::new() } else { count.to_string() });
        }
        out.push('\n');
    }
}

/// How often an effect was named, out of how many, and what was said instead.
type Line = (usize, usize, BTreeMap<String, usize>);

/// Confusion of effects: one line for each that was hidden.
fn effects(out: &mut String, done: &[(Task, Outcome)]) {
    out.push_str(
        "\n## Confusion of effects\n\nWhat stood first, or stood in one group with the hidden \
         effect; how often out of all noises and seeds.\n\n| hidden | in | named | instead |\n|---|---|---|---|\n",
    );
    let mut lines: BTreeMap<(String, &str), Line> = BTreeMap::new();
    for (task, outcome) in done {
        let name =
            if task.hidden.is_empty() { "(nothing)".to_string() } else { task.hidden.clone() };
        let line = lines.entry((name, task.base)).or_default();
        line.1 += 1;
        let right = match (task.hidden.is_empty(), task.listed) {
            (true, _) => outcome.verdict == Verdict::NothingMissing,
            (_, false) => outcome.verdict == Verdict::Unexplained,
            _ => outcome.verdict == Verdict::Missing && outcome.place.is_named(),
        };
        if right {
            line.0 += 1;
        } else {
            let instead = match outcome.verdict {
                Verdict::Missing => outcome.first.clone().unwrap_or_default(),
                other => word(other).to_string(),
            };
            *line.2.entry(instead).or_default() += 1;
        }
    }
    for ((hidden, base), (right, all, instead)) in lines {
        let instead: Vec<String> =
            instead.into_iter().map(|(name, count)| format!("{name} {count}")).collect();
        let _ = writeln!(out, "| {hidden} | {base} | {right} of {all} | {} |", instead.join(", "));
    }
}
