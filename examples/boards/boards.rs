//! The two boards: what their files hold, and one case of each.

use std::collections::{BTreeSet, HashMap};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use leverrier::{Data, Discovery, DiscoveryOptions, Silent, Spec, Verdict};

use super::expression::Expression;
use super::motion::{Motion, Square, drawn, error, motion, noisy, seed, times};
use super::record::{Record, State};
use super::terms::{form, judged, learned};

/// The names of the boards, as their files are called.
pub(crate) const OSCILLATORS: &str = "oscillators";
pub(crate) const ODEBENCH: &str = "odebench";

/// Half the side of the square from which starts are drawn.
const RANGE: f64 = 1.5;

/// That square.
const INSIDE: Square = Square { inner: 0.0, outer: RANGE };

/// How much further new motions begin.
const FURTHER: f64 = 1.5;

/// Runs of an oscillator, and new motions of either kind.
const RUNS: usize = 6;
const NEW: usize = 6;

/// Length and samples of a run of an oscillator, and of one of ODEBench.
const OSCILLATOR: (f64, usize) = (20.0, 300);
const ODE: (f64, usize) = (10.0, 150);

/// Part of the samples that is held out, as the program does by itself.
const HELD_OUT: f64 = 0.25;

/// What the spec of an oscillator says of V.
const LEARNED: &str = "V = span{ poly(x; 4) }";

/// A system of a board.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Row {
    pub name: String,
    pub acceleration: String,
    /// What is known of V, what is missing, and the starts: on the board of ODEBench alone.
    pub known: Option<Known>,
}

/// What ODEBench's board says besides.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Known {
    pub potential: String,
    pub missing: String,
    pub starts: Vec<[f64; 2]>,
}

/// The rows of a board's file.
///
/// # Errors
/// The file is not there or is no such board, in a sentence.
pub(crate) fn rows(board: &str, path: &Path) -> Result<Vec<Row>, String> {
    let place = path.display();
    let reader = csv::ReaderBuilder::new().flexible(true).from_path(path);
    let mut reader = reader.map_err(|_| {
        format!(
            "There is no file of the board at {place}: the lists of laws are not part of this \
             project; name one with --{board} FILE."
        )
    })?;
    let header = reader.headers().map_err(|error| format!("{place}: {error}"))?.clone();
    let column = |name: &str| {
        let found = header.iter().position(|cell| cell.trim() == name);
        found.ok_or_else(|| {
            format!("{place} has no column `{name}`: its header is {:?}", header.as_slice())
        })
    };
    let is_ode = board == ODEBENCH;
    let first = column(if is_ode { "id" } else { "name" })?;
    let acceleration = column("acceleration")?;
    let more = match is_ode {
        true => Some([column("known_V")?, column("missing")?, column("starts")?]),
        false => None,
    };
    let mut out = Vec::new();
    for (i, line) in reader.records().enumerate() {
        let line = line.map_err(|error| format!("{place}: {error}"))?;
        let cell = |at: usize| line.get(at).unwrap_or("").trim().to_string();
        let known = match more {
            Some([potential, missing, starts]) => {
                let read: Result<Vec<[f64; 2]>, _> = serde_json::from_str(&cell(starts));
                let starts = read.map_err(|_| {
                    format!(
                        "{place}, row {}: the starts must be pairs like [[0.4, 0], [0, 0.2]]",
                        i + 1
                    )
                })?;
                Some(Known { potential: cell(potential), missing: cell(missing), starts })
            }
            None => None,
        };
        out.push(Row { name: cell(first), acceleration: cell(acceleration), known });
    }
    Ok(out)
}

/// Seconds of processor time of a process in its own code, by the system's count; none where the
/// system keeps no such count in a file.
pub(crate) fn processor_seconds(process: &str) -> Option<f64> {
    /// Of the count's unit, whatever the processor.
    const PER_SECOND: f64 = 100.0;
    let text = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // The name of the program stands in parentheses, and may have anything in it.
    let (_, rest) = text.rsplit_once(')')?;
    let ticks: f64 = rest.split_whitespace().nth(11)?.parse().ok()?;
    Some(ticks / PER_SECOND)
}

/// One case; an error of it is in the record.
pub(crate) fn case(board: &str, row: &Row, noise: f64) -> Record {
    let made = match &row.known {
        None => oscillator(row, noise),
        Some(known) => ode(row, known, noise),
    };
    let empty = |state| Record::new(board, &row.name, noise, state);
    match made {
        Ok(Some(record)) => Record { board: board.to_string(), ..record },
        Ok(None) => empty(State::NotMade),
        Err(why) => Record { remark: one_line(&why), ..empty(State::Failed) },
    }
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn law_of(text: &str) -> Result<Expression, String> {
    Expression::parse(text, &HashMap::new())
}

/// Writes the data of a case and its spec into a folder, as files that the program reads. Nothing
/// is written where a motion leaves every bound.
pub(crate) fn write(folder: &Path, row: &Row, noise: f64) -> Result<Option<PathBuf>, String> {
    let truth = law_of(&row.acceleration)?;
    let (made, potential) = match &row.known {
        None => (oscillator_runs(row, &truth), LEARNED.to_string()),
        Some(known) => (ode_runs(known, &truth), format!("V = {}", known.potential)),
    };
    let Some((runs, times)) = made else { return Ok(None) };
    let stem = format!("{}-{noise}", row.name);
    let mut table = String::from("run,t,x,v\n");
    for (at, run) in measured(&row.name, &runs, noise).iter().enumerate() {
        for (time, [x, v]) in times.iter().zip(run) {
            table.push_str(&format!("{at},{time},{x},{v}\n"));
        }
    }
    let text = spec_text(&potential) + &format!("data \"{stem}.csv\" {{ run run }}\n");
    let spec = folder.join(format!("{stem}.ham"));
    let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
    fs::create_dir_all(folder).map_err(failed)?;
    fs::write(folder.join(format!("{stem}.csv")), table).map_err(failed)?;
    fs::write(&spec, text).map_err(failed)?;
    Ok(Some(spec))
}

/// Runs of an oscillator and the times of their samples; none where one leaves every bound.
fn oscillator_runs(row: &Row, truth: &Expression) -> Option<(Vec<Motion>, Vec<f64>)> {
    let times = times(OSCILLATOR.0, OSCILLATOR.1);
    Some((drawn(truth, INSIDE, RUNS, &times, seed(&row.name))?, times))
}

/// The same of a system of ODEBench, from the starts that the board names.
fn ode_runs(known: &Known, truth: &Expression) -> Option<(Vec<Motion>, Vec<f64>)> {
    let times = times(ODE.0, ODE.1);
    let runs = known.starts.iter().map(|start| motion(truth, *start, &times));
    Some((runs.collect::<Option<Vec<Motion>>>()?, times))
}

fn oscillator(row: &Row, noise: f64) -> Result<Option<Record>, String> {
    let truth = law_of(&row.acceleration)?;
    let Some((runs, times)) = oscillator_runs(row, &truth) else { return Ok(None) };
    let outside = Square { inner: RANGE, outer: FURTHER * RANGE };
    let told = told(LEARNED, &row.name, &runs, &times, noise)?;
    let mut record = compared(row, noise, &truth, None, &told);
    let new = |square, what: &str| {
        let seed = seed(&format!("{}, new motions {what}", row.name));
        let motions = drawn(&truth, square, NEW, &times, seed)?;
        error(told.found.law(), &motions, &times)
    };
    (record.within, record.beyond) = (new(INSIDE, "within"), new(outside, "beyond"));
    Ok(Some(record))
}

fn ode(row: &Row, known: &Known, noise: f64) -> Result<Option<Record>, String> {
    let (truth, potential) = (law_of(&row.acceleration)?, law_of(&known.potential)?);
    let Some((runs, times)) = ode_runs(known, &truth) else { return Ok(None) };
    let told = told(&format!("V = {}", known.potential), &row.name, &runs, &times, noise)?;
    let mut record = compared(row, noise, &truth, Some(&potential), &told);
    // What has no name in the catalogue is told by the terms.
    let is_name = |text: &&str| text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    let wanted = known.missing.split(" and ").map(str::trim).filter(is_name);
    let wanted: BTreeSet<&str> = wanted.filter(|name| *name != "nothing").collect();
    let steps = told.found.steps().iter().filter_map(|step| step.effect.split_once('('));
    let catalogue: BTreeSet<&str> = steps.map(|(name, _)| name).filter(is_name).collect();
    record.named = Some(record.is_exact() && record.is_explained() && catalogue == wanted);
    Ok(Some(record))
}

/// What was found, and in which time.
struct Told {
    found: Discovery,
    seconds: f64,
}

fn spec_text(potential: &str) -> String {
    format!("coordinates x\nmomenta v\ntime t\nT = v^2/2\n{potential}\n")
}

/// The motions with the noise of a case.
fn measured(name: &str, runs: &[Motion], noise: f64) -> Vec<Motion> {
    noisy(runs, noise / 100.0, seed(&format!("{name}, noise of {noise} %")))
}

/// Asks for the law of noisy motions, of which one line on V is known, or its space.
fn told(
    potential: &str,
    name: &str,
    runs: &[Motion],
    times: &[f64],
    noise: f64,
) -> Result<Told, String> {
    let said = |error: leverrier::Error| error.to_string();
    let spec = Spec::parse(&spec_text(potential)).map_err(said)?;
    let read = measured(name, runs, noise);
    let mut data = Data::empty(&spec);
    for run in &read {
        let column = |i: usize| run.iter().map(|state| state[i]).collect::<Vec<f64>>();
        data = data.with_run(times, &[&column(0), &column(1)]).map_err(said)?;
    }
    let (training, held_out) = data.split(HELD_OUT, 0).map_err(said)?;
    let clock = Instant::now();
    let before = processor_seconds("self");
    let options = DiscoveryOptions::default();
    let found = spec.discover(&training, &held_out, &options, &Silent).map_err(said)?;
    let after = processor_seconds("self");
    let seconds = before.zip(after).map(|(before, after)| after - before);
    Ok(Told { found, seconds: seconds.unwrap_or(clock.elapsed().as_secs_f64()) })
}

fn compared(
    row: &Row,
    noise: f64,
    truth: &Expression,
    known: Option<&Expression>,
    told: &Told,
) -> Record {
    let mut record = Record::new("", &row.name, noise, State::Done);
    record.verdict = match told.found.verdict() {
        Verdict::NothingMissing => "explained",
        Verdict::InsufficientData => "too little data",
        _ => "unexplained",
    }
    .to_string();
    record.seconds = told.seconds;
    let steps: Vec<&str> = told.found.steps().iter().map(|step| step.effect.as_str()).collect();
    record.added = one_line(&steps.join(" and "));
    let mut law = learned(told.found.law(), known);
    law.strange.extend(changed_numbers(&told.found));
    match judged(truth, &law, &named_beside(&told.found)) {
        Ok(found) => {
            (record.missing, record.beside) = (found.missing.len(), found.beside.len());
            record.level = found.named;
            let list = |what: &str, terms: &[String]| match terms.is_empty() {
                true => String::new(),
                false => format!("{what} {}", terms.join(", ")),
            };
            let both = [list("without", &found.missing), list("beside", &found.beside)];
            let both: Vec<String> = both.into_iter().filter(|part| !part.is_empty()).collect();
            record.remark = one_line(&both.join("; "));
        }
        // A law that cannot be compared is not that of the truth.
        Err(why) => (record.beside, record.remark) = (1, one_line(&why)),
    }
    record
}

/// What is named as explaining as much as a member of what was found, or as all of it.
fn named_beside(found: &Discovery) -> Vec<Expression> {
    let document: serde_json::Value = serde_json::from_str(&found.to_json()).unwrap_or_default();
    let mut labels: Vec<String> = Vec::new();
    let mut open = vec![&document];
    while let Some(value) = open.pop() {
        open.extend(value.as_array().into_iter().flatten());
        for (key, value) in value.as_object().into_iter().flatten() {
            open.push(value);
            let is_list = ["indistinguishable", "others"].contains(&key.as_str());
            let all = value.as_array().filter(|_| is_list);
            let texts = all.into_iter().flatten().filter_map(|label| label.as_str());
            labels.extend(texts.flat_map(|text| text.split(" and ")).map(str::to_string));
        }
    }
    labels.iter().filter_map(|label| form(label)).collect()
}

/// Known numbers of the spec that were found to be others: they are right on the board.
fn changed_numbers(found: &Discovery) -> Vec<String> {
    let document: serde_json::Value = serde_json::from_str(&found.to_json()).unwrap_or_default();
    let steps = document.get("steps").and_then(|steps| steps.as_array()).cloned();
    let changed = steps
        .unwrap_or_default()
        .into_iter()
        .filter(|step| step.get("number").is_some_and(|number| !number.is_null()));
    let name = |step: serde_json::Value| {
        format!("another number in {}", step.get("effect").and_then(|e| e.as_str()).unwrap_or("V"))
    };
    changed.map(name).collect()
}
