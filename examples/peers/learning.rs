//! Learning Hénon-Heiles from 5,000 pairs: the paper's method, PySINDy and neural networks.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use leverrier::internals::data::Dataset;
use leverrier::internals::expr::System;
use leverrier::internals::fit::{Model, Options, Silent, fit};
use leverrier::internals::simulate::Simulator;
use serde_json::Value;

use crate::Asked;
use crate::page::{Section, ratio, time};
use crate::paper::figures::{deviations, largest_error};
use crate::paper::{Law, SIGMA, STEP, henon_heiles, henon_heiles_pairs, system, tensor};
use crate::python::{PYSINDY, Python, TORCH, number};
use crate::turns::{Turn, clocked, fastest};

const PAIRS: usize = 5_000;
/// Turns of fits of milliseconds: on a shared machine few of them go undisturbed.
const TURNS: usize = 50;
/// Predictions one step ahead, and predictions of `LONG` steps.
const SHORT: usize = 200;
const STARTS: usize = 220;
const LONG: usize = 80;

/// Both files, and the truth that predictions are held against.
struct Task {
    data: Dataset,
    space: Arc<System>,
    law: Law,
    pairs: PathBuf,
    starts: PathBuf,
    out: PathBuf,
    truth: Vec<Vec<Vec<f64>>>,
}

impl Task {
    fn new(folder: &Path, sigma: f64) -> Result<Task, String> {
        let law = henon_heiles();
        let data = henon_heiles_pairs(PAIRS, sigma, 1);
        let mut text = String::from("q1,q2,p1,p2,q1_after,q2_after,p1_after,p2_after\n");
        for run in &data.runs {
            let at = |sample: usize| run.values.iter().map(move |column| column[sample]);
            let row: Vec<String> = at(0).chain(at(1)).map(|x| x.to_string()).collect();
            let _ = writeln!(text, "{}", row.join(","));
        }
        let known = system(&law.spec);
        let nature = Simulator::known(&known);
        let from = henon_heiles_pairs(STARTS, 0.0, 2);
        let starts: Vec<Vec<f64>> = from
            .runs
            .iter()
            .map(|run| run.values.iter().map(|column| column[0]).collect())
            .collect();
        let truth = follow(&nature, &starts)?;
        let mut listed = String::from("q1,q2,p1,p2\n");
        for start in &starts {
            let row: Vec<String> = start.iter().map(f64::to_string).collect();
            let _ = writeln!(listed, "{}", row.join(","));
        }
        let named = |name: &str| folder.join(format!("{name}-{sigma}.csv"));
        let (pairs, starts, out) = (named("pairs"), named("starts"), named("predicted"));
        std::fs::write(&pairs, text).map_err(|error| error.to_string())?;
        std::fs::write(&starts, listed).map_err(|error| error.to_string())?;
        Ok(Task { data, space: tensor(3), law, pairs, starts, out, truth })
    }

    fn ours(&self) -> Result<Model, String> {
        fit(&self.space, &self.data, &Options::default(), &Silent).map_err(|e| e.to_string())
    }

    fn arguments(&self, before: &[&str], after: &[&str]) -> Vec<String> {
        let files = [&self.pairs, &self.starts, &self.out].map(|path| path.display().to_string());
        let words = |words: &[&str]| words.iter().map(|w| w.to_string()).collect::<Vec<_>>();
        [words(before), files.to_vec(), words(after)].concat()
    }

    /// What a peer predicted, judged.
    fn judged(&self) -> Result<Errors, String> {
        let text = std::fs::read_to_string(&self.out).map_err(|error| error.to_string())?;
        let row = |line: &str| -> Vec<f64> {
            line.split(',').map(|x| x.parse().unwrap_or(f64::NAN)).collect()
        };
        let rows: Vec<Vec<f64>> = text.lines().map(row).collect();
        Ok(self.errors(&rows))
    }

    fn own_errors(&self, model: &Model) -> Result<Errors, String> {
        let law = model.law(&self.space).ok_or("the model is of another space")?;
        let learned = law.simulator();
        let starts: Vec<Vec<f64>> = self.truth.iter().map(|states| states[0].clone()).collect();
        let rows = follow(&learned, &starts)?;
        let rows: Vec<Vec<f64>> = rows
            .iter()
            .enumerate()
            .map(|(k, states)| if k < SHORT { states[1].clone() } else { states[1..].concat() })
            .collect();
        Ok(self.errors(&rows))
    }

    fn errors(&self, rows: &[Vec<f64>]) -> Errors {
        let (mut step, mut long, mut lost) = (0.0, 0.0, 0);
        for (k, (row, truth)) in rows.iter().zip(&self.truth).enumerate() {
            let count = if k < SHORT { 1 } else { LONG };
            let truth: Vec<f64> = truth[1..=count].concat();
            let apart = row.iter().zip(&truth).map(|(a, b)| (a - b).abs());
            let mean = apart.sum::<f64>() / truth.len() as f64;
            if k < SHORT {
                step += mean / SHORT as f64;
            } else if mean.is_finite() && mean < 10.0 && row.len() == truth.len() {
                long += mean;
            } else {
                lost += 1;
            }
        }
        let kept = STARTS - SHORT - lost;
        Errors { step, long: long / kept as f64, lost }
    }
}

/// States after 0, 0.1, ... 8.
fn follow(simulator: &Simulator, starts: &[Vec<f64>]) -> Result<Vec<Vec<Vec<f64>>>, String> {
    let times: Vec<f64> = (0..=LONG).map(|k| k as f64 * STEP).collect();
    let found = simulator.trajectories(starts, &times).map_err(|error| error.to_string())?;
    Ok(found.states)
}

/// Mean absolute errors of predictions.
struct Errors {
    /// 0.1 ahead.
    step: f64,
    /// Over the time from 0 to 8.
    long: f64,
    /// Long predictions that left the region.
    lost: usize,
}

impl Errors {
    fn cells(&self) -> (String, String) {
        let lost = match self.lost {
            0 => String::new(),
            lost => format!(" ({lost} of {} lost)", STARTS - SHORT),
        };
        (format!("{:.1e}", self.step), format!("{:.1e}{lost}", self.long))
    }
}

const COLUMNS: [&str; 9] = [
    "who",
    "training",
    "times our time",
    "largest coefficient error",
    "times our error",
    "terms exact",
    "one step of 0.1",
    "to t = 8",
    "parameters",
];

struct Table {
    section: Section,
    task: Task,
    seconds: f64,
    error: f64,
}

impl Table {
    fn new(section: Section, task: Task) -> Table {
        Table { section, task, seconds: f64::NAN, error: f64::NAN }
    }

    fn ours(&mut self) -> Result<(), String> {
        let model = self.task.ours()?;
        let exact = deviations(&self.task.law, &model).is_some();
        self.error = if exact { largest_error(&self.task.law, &model) } else { f64::NAN };
        let (step, long) = self.task.own_errors(&model)?.cells();
        let error = format!("{:.1e}", self.error);
        let count = model.terms.len().to_string();
        let cells = ["Leverrier", &time(self.seconds), "1", &error, "1", yes(exact), &step, &long];
        self.section.row(&[&cells[..], &[&count]].concat());
        Ok(())
    }

    fn peer(&mut self, who: &str, seconds: f64, answer: &Value) -> Result<(), String> {
        let (step, long) = self.task.judged()?.cells();
        let who = format!("{who} {}", answer["version"].as_str().unwrap_or(""));
        let error = number(answer, "error");
        let (shown, exact) = match answer["exact"].as_bool() {
            Some(exact) => (format!("{error:.1e}"), yes(exact)),
            None => ("none".to_string(), "none"),
        };
        self.section.row(&[
            &who,
            &time(seconds),
            &ratio(seconds / self.seconds),
            &shown,
            &ratio(error / self.error),
            exact,
            &step,
            &long,
            &number(answer, "parameters").to_string(),
        ]);
        Ok(())
    }
}

fn yes(so: bool) -> &'static str {
    if so { "yes" } else { "no" }
}

const DATA: &str = "5,000 pairs of states 0.1 apart at energies between 1/12 and 1/6, 15 candidate \
    terms for T and 15 for V; every contestant reads the same file. Predictions are judged by \
    their mean absolute error on 200 other starts, and by that over 20 motions of 8 units of \
    time. Training times leave out loading and reading.";

/// The paper's method, to its end.
pub(crate) fn paper(asked: &Asked, python: Result<&Python, &String>) -> Result<Section, String> {
    let about = format!(
        "{DATA} The paper's method is a script of ours with the settings of the paper's code \
         (single precision, as there; the code itself took 398 s on another machine and ended at \
         4e-6); its time is processor time."
    );
    let section = Section::new("The paper's method", &about, &COLUMNS);
    let mut table = Table::new(section, Task::new(&asked.folder, 0.0)?);
    let own = || fastest(TURNS, &mut [Box::new(|| timed(&table.task)) as Turn]).remove(0);
    let before = own()?;
    let peer = python.map_err(String::clone).and_then(|python| {
        let limit = asked.quick.map_or("0".to_string(), |seconds| seconds.to_string());
        python.start(&TORCH, "sparse_hamiltonian.py", &table.task.arguments(&[], &[&limit]))
    });
    table.seconds = own()?.min(before);
    table.ours()?;
    match peer {
        Ok((_, answer)) => {
            let seconds = number(&answer, "seconds");
            table.peer("the paper's method in PyTorch", seconds, &answer)?;
            if answer["finished"].as_bool() != Some(true) {
                let seen = number(&answer, "pairs_seen");
                table.section.note(&format!(
                    "The paper's method was ended after {seen} of 24,000 pairs: not converged."
                ));
            }
        }
        Err(why) => table.section.not_run("the paper's method in PyTorch", &why),
    }
    Ok(table.section)
}

fn timed(task: &Task) -> Result<f64, String> {
    let (model, seconds) = clocked(|| task.ours());
    model.map(|_| seconds)
}

/// PySINDy and the networks, on clean and on noisy pairs.
pub(crate) fn rivals(
    asked: &Asked,
    python: Result<&Python, &String>,
    noisy: bool,
) -> Result<Section, String> {
    let (title, noise, sigma) = if noisy {
        ("The paper's rivals, noisy pairs", "Noise of 0.005 on every number. ", SIGMA)
    } else {
        ("The paper's rivals, clean pairs", "", 0.0)
    };
    let about = format!(
        "{noise}{DATA} PySINDy gets the differences over each pair at its middle, and polynomials \
         of total degree 3 for the rates; its coefficients are those of the rates. Networks are in \
         single precision and train for {} of processor time.",
        time(asked.seconds())
    );
    let mut table =
        Table::new(Section::new(title, &about, &COLUMNS), Task::new(&asked.folder, sigma)?);
    let sindy = python
        .map_err(String::clone)
        .and_then(|python| python.start(&PYSINDY, "stlsq.py", &table.task.arguments(&[], &["3"])));
    let (mut sindy, answer) = match sindy {
        Ok((peer, answer)) => (Ok(peer), answer),
        Err(why) => (Err(why), Value::Null),
    };
    let times = fastest(
        TURNS,
        &mut [
            Box::new(|| timed(&table.task)),
            Box::new(|| sindy.as_mut().map_err(|why| why.clone())?.seconds()),
        ],
    );
    table.seconds = times[0].clone()?;
    table.ours()?;
    match &times[1] {
        Ok(seconds) => table.peer("PySINDy STLSQ", *seconds, &answer)?,
        Err(why) => table.section.not_run("PySINDy STLSQ", why),
    }
    let networks = [("mlp", "MLP, 4 layers of 400"), ("symplectic", "symplectic network, 512")];
    for (which, who) in networks {
        let budget = asked.seconds().to_string();
        let answer = python.map_err(String::clone).and_then(|python| {
            python.start(&TORCH, "network.py", &table.task.arguments(&[which], &[&budget]))
        });
        match answer {
            Ok((_, answer)) => {
                table.peer(&format!("{who}, PyTorch"), number(&answer, "seconds"), &answer)?;
            }
            Err(why) => table.section.not_run(who, &why),
        }
    }
    Ok(table.section)
}
