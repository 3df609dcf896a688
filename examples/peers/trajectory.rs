//! One long motion of Hénon-Heiles, by a method of order four and by Taylor series.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use leverrier::internals::dynamics::systems::SYSTEMS;
use leverrier::internals::dynamics::{Batch, Dynamics, Method, Scratch, advance, taylor};
use leverrier::internals::eval::Backend;
use leverrier::internals::export::{Output, exporter};
use leverrier::internals::expr::System;
use leverrier::internals::fit::{Law, Stepping};
use leverrier::internals::report::present;

use crate::Asked;
use crate::by_hand::by_hand;
use crate::page::{Section, ratio, time};
use crate::python::{HEYOKA, Peer, Python, number};
use crate::turns::{Turn, clocked, fastest, of_children};

const STEP: f64 = 0.01;
/// Runs of a program that are measured together.
const AT_ONCE: usize = 5;
const START: [f64; 4] = [0.1, 0.2, 0.35, 0.1];

fn system() -> Result<System, String> {
    let row = SYSTEMS.iter().find(|row| row.name == "Henon-Heiles");
    row.map(|row| (row.build)()).ok_or_else(|| "Hénon-Heiles is not in the table".to_string())
}

/// Writes and builds the simulator that `export rust` makes; the path of its program.
fn generated(folder: &Path) -> Result<PathBuf, String> {
    let method = Method::by_name("forest-ruth").ok_or("there is no forest-ruth")?;
    let law = Law::known(Arc::new(system()?)).map_err(|error| error.to_string())?;
    let law = law.with_stepping(Stepping { method, longest: STEP });
    let pretty = present::pretty(&present::simplified(&law, &[1.0; 4]));
    let export = present::export(&law, &pretty);
    let row = exporter("rust").map_err(|error| error.to_string())?;
    let Output::Files(files) = (row.export)(&export).map_err(|error| error.to_string())? else {
        return Err("the exporter wrote one text".to_string());
    };
    let project = folder.join("simulator");
    for (name, text) in files {
        let path = project.join(name);
        let parent = path.parent().unwrap_or(&project);
        std::fs::create_dir_all(parent).map_err(|error| error.to_string())?;
        std::fs::write(&path, text).map_err(|error| error.to_string())?;
    }
    let cargo = std::env::var("CARGO").unwrap_or("cargo".to_string());
    let target = project.join("target");
    let done = Command::new(cargo)
        .args(["build", "--release", "--quiet", "--target-dir"])
        .arg(&target)
        .current_dir(&project)
        .env_remove("CARGO_PROFILE_RELEASE_INCREMENTAL")
        .output()
        .map_err(|error| format!("cargo does not start: {error}"))?;
    if !done.status.success() {
        return Err(format!("it does not build: {}", String::from_utf8_lossy(&done.stderr)));
    }
    let programs = std::fs::read_dir(target.join("release")).map_err(|error| error.to_string())?;
    let is_program = |path: &PathBuf| path.is_file() && path.extension().is_none();
    programs
        .flatten()
        .map(|entry| entry.path())
        .find(|path| is_program(path) && !path.to_string_lossy().ends_with(".cargo-lock"))
        .ok_or_else(|| "its program is not there".to_string())
}

pub(crate) fn steps(asked: &Asked) -> Result<Section, String> {
    let steps = if asked.quick.is_some() { 500_000 } else { 10_000_000 };
    let about = format!(
        "{steps} steps of 0.01 of Forest and Ruth's method, one trajectory of Hénon-Heiles. Ours \
         carries what rounding takes from every sum, which the others do not. The generated \
         simulator is what `leverrier export SPEC rust` writes, run as a program from start to end \
         its energy check included."
    );
    let columns =
        ["who", "whole", "a step", "of the time by hand", "error of the energy at the end"];
    let mut section = Section::new("Ten million steps of order four", &about, &columns);
    let system = system()?;
    let dynamics = Dynamics::known(&system, Backend::Machine);
    let method = Method::by_name("forest-ruth").ok_or("there is no forest-ruth")?;
    let program = generated(&asked.folder);
    let span = [steps as f64 * STEP];
    let (mut hand, mut own, mut simulated) = (START, START.to_vec(), START.to_vec());
    let mut scratch = Scratch::new();
    let mut turns: Vec<Turn> = vec![
        Box::new(|| {
            hand = START;
            Ok(clocked(|| by_hand(&mut hand, STEP, std::hint::black_box(steps))).1)
        }),
        Box::new(|| {
            let mut batch = Batch::new(2, 1);
            batch.set(0, 0.0, &START);
            let call = || advance(&dynamics, method, &mut batch, &span, steps, &[], &mut scratch);
            let seconds = clocked(call).1;
            own = batch.get(0);
            Ok(seconds)
        }),
        Box::new(|| {
            let mut command = Command::new(program.as_ref().map_err(String::clone)?);
            command.arg("--start").arg(START.map(|x| x.to_string()).join(","));
            command.arg("--duration").arg(span[0].to_string());
            command.arg("--step").arg(STEP.to_string());
            command.arg("--every").arg(steps.to_string());
            // So many, because the system counts in hundredths of a second.
            let run = || (0..AT_ONCE).map(|_| command.output()).last();
            let (done, seconds) = of_children(run);
            let done = done.ok_or("it was not run")?;
            let text = done.map_err(|error| error.to_string())?.stdout;
            let text = String::from_utf8_lossy(&text);
            let last = text.lines().last().unwrap_or("");
            simulated = last.split(',').skip(1).map(|x| x.parse().unwrap_or(f64::NAN)).collect();
            Ok(seconds / AT_ONCE as f64)
        }),
    ];
    let times = fastest(7, &mut turns);
    drop(turns);
    let by_hand = times[0].clone()?;
    let ends = [("by hand, Rust, release", hand.to_vec()), ("Leverrier, machine code", own)];
    let ends = [&ends[..], &[("generated simulator, whole program", simulated)]].concat();
    for ((who, state), seconds) in ends.iter().zip(times) {
        match seconds {
            Ok(seconds) => section.row(&[
                who,
                &time(seconds),
                &time(seconds / steps as f64),
                &ratio(seconds / by_hand),
                &format!("{:.1e}", (energy(state) / energy(&START) - 1.0).abs()),
            ]),
            Err(why) => section.not_run(who, &why),
        }
    }
    Ok(section)
}

fn energy(state: &[f64]) -> f64 {
    let &[x, y, u, v] = state else { return f64::NAN };
    0.5 * (u * u + v * v + x * x + y * y) + x * x * y - y * y * y / 3.0
}

const SAMPLES: usize = 100;
/// How often the contestants take turns.
const TURNS: usize = 15;

/// Starts of about the energy of [`START`]: regular and chaotic motions.
fn starts() -> Vec<[f64; 4]> {
    (0..8).map(|k| START.map(|x| x * (1.0 - 0.03 * k as f64))).collect()
}

/// Tolerances of ours that are tried, the loosest first.
fn tolerances() -> impl Iterator<Item = f64> {
    (0..=40)
        .map(|k| 10f64.powf(-6.0 - 0.25 * k as f64))
        .take_while(|x| *x > f64::EPSILON)
        .chain([0.0])
}

struct Run {
    /// Of each motion, the fastest of several turns.
    seconds: Vec<f64>,
    /// Root mean square over samples and starts, as a part of the energy.
    error: f64,
    steps: f64,
}

impl Run {
    /// Takes from another turn the motions that were faster there.
    fn fastest(&mut self, turn: &Run) {
        for (seconds, again) in self.seconds.iter_mut().zip(&turn.seconds) {
            *seconds = again.min(*seconds);
        }
    }

    /// Of one motion, on the average.
    fn mean(&self) -> f64 {
        self.seconds.iter().sum::<f64>() / self.seconds.len() as f64
    }
}

fn ours(dynamics: &Dynamics, end: f64, tolerance: f64) -> Result<Run, String> {
    let times: Vec<f64> = (0..=SAMPLES).map(|k| end * k as f64 / SAMPLES as f64).collect();
    let (mut squares, mut seconds, mut steps) = (0.0, Vec::new(), 0.0);
    for start in starts() {
        let (run, spent) = clocked(|| taylor(dynamics, &[], &start, &times, tolerance));
        let run = run.ok_or("there is no series")?;
        seconds.push(spent);
        steps += run.steps as f64;
        let strayed = run.trajectory.states[1..].iter().map(|z| energy(z) / energy(&start) - 1.0);
        squares += strayed.map(|x| x * x).sum::<f64>();
    }
    let count = starts().len() as f64;
    let error = (squares / (count * SAMPLES as f64)).sqrt();
    Ok(Run { seconds, error, steps: steps / count })
}

fn heyoka(peer: &mut Peer) -> Result<Run, String> {
    let (mut squares, mut seconds, mut steps) = (0.0, Vec::new(), 0.0);
    for start in starts() {
        let answer = peer.ask(&start.map(|x| x.to_string()).join(","))?;
        squares += number(&answer, "error").powi(2);
        seconds.push(number(&answer, "seconds"));
        steps += number(&answer, "steps");
    }
    let count = starts().len() as f64;
    Ok(Run { seconds, error: (squares / count).sqrt(), steps: steps / count })
}

pub(crate) fn series(asked: &Asked, python: Result<&Python, &String>) -> Result<Section, String> {
    let end = if asked.quick.is_some() { 5e3 } else { 1e5 };
    let about = format!(
        "Eight motions of Hénon-Heiles to t = {end}, by adaptive Taylor series; times of one \
         motion, each the fastest of its turns. The error is the root mean square, over motions and \
         {SAMPLES} times, of what the energy strayed, as a part of the energy. For each tolerance of \
         heyoka, ours is the loosest one with at most its error, or the finest there is."
    );
    let columns =
        ["who", "tolerance", "error of the energy", "steps", "time", "times ours", "compilation"];
    let mut section = Section::new("Taylor series at equal energy error", &about, &columns);
    let system = system()?;
    let compile = || {
        let dynamics = Dynamics::known(&system, Backend::Machine);
        let spent = clocked(|| taylor(&dynamics, &[], &START, &[0.0, 1e-9], 0.0)).1;
        (dynamics, spent)
    };
    let (dynamics, mut compilation) = compile();
    for _ in 0..5 {
        compilation = compile().1.min(compilation);
    }
    for wanted in [0.0, 1e-12, 1e-9] {
        let arguments = [end.to_string(), SAMPLES.to_string(), wanted.to_string()];
        let started =
            python.map_err(String::clone).and_then(|p| p.start(&HEYOKA, "taylor.py", &arguments));
        let measured = started.and_then(|(mut peer, ready)| {
            let first = heyoka(&mut peer)?;
            Ok((peer, ready, first))
        });
        let (peer, error) = match &measured {
            Ok((_, _, run)) => (true, run.error),
            Err(_) => (false, if wanted == 0.0 { f64::INFINITY } else { f64::NAN }),
        };
        if !peer && wanted > 0.0 {
            continue;
        }
        let mut chosen = 0.0;
        if peer {
            for tolerance in tolerances() {
                chosen = tolerance;
                if ours(&dynamics, end, tolerance)?.error <= error {
                    break;
                }
            }
        }
        let mut own = ours(&dynamics, end, chosen)?;
        let label = |x: f64| if x == 0.0 { "finest".to_string() } else { format!("{x:.1e}") };
        let mut theirs = None;
        match measured {
            Ok((mut peer, ready, first)) => {
                let mut fastest = first;
                for _ in 0..if asked.quick.is_some() { 1 } else { TURNS } {
                    own.fastest(&ours(&dynamics, end, chosen)?);
                    fastest.fastest(&heyoka(&mut peer)?);
                }
                theirs = Some((fastest, ready));
            }
            Err(why) => section.not_run("heyoka taylor_adaptive", &why),
        }
        let row = |who: &str, tolerance: f64, run: &Run, compilation: f64| {
            let error = format!("{:.2e}", run.error);
            let (steps, seconds) = (format!("{:.0}", run.steps), time(run.mean()));
            let times = ratio(run.mean() / own.mean());
            let who = who.to_string();
            [who, label(tolerance), error, steps, seconds, times, time(compilation)]
        };
        let mut rows = vec![row("Leverrier", chosen, &own, compilation)];
        if let Some((run, ready)) = &theirs {
            let who = format!("heyoka {}", ready["version"].as_str().unwrap_or(""));
            rows.push(row(&who, wanted, run, number(ready, "compile")));
        }
        for row in rows {
            section.row(&row.each_ref().map(String::as_str));
        }
    }
    Ok(section)
}
