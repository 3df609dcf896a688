//! `leverrier demo`: a whole story on data made on the spot.

mod course;
mod missing;

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use serde_json::{Value, json};

use super::console::{Console, set, usage};
use super::progress::Progress;
use super::project::fitting::{learn, origin, write_model};
use super::project::{ModelFile, Spec};
use crate::data::{Layout, write_atomically, write_csv};
use crate::error::{Error, Result};
use crate::expr;
use crate::fit::Options;
use crate::report::layout::{WIDTH, table, wrapped};
use crate::report::{present, seconds};
use crate::simplify::{Style, significant, uncertain};
use crate::simulate::{InitialDistribution, Interval, NoiseLevel, Simulator, add_noise, draw};

/// Watch a law fail, be told what it lacks, and get it.
///
/// Makes measurements of a system whose law is known, works on them alone, and prints what was
/// found beside the truth. Other demos learn whole Hamiltonians.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier demo\n  \
    leverrier demo --quick\n  \
    leverrier demo henon-heiles     another one; --list shows all\n  \
    leverrier demo -o demo          keep its spec, data and model to play with")]
pub(super) struct Arguments {
    /// Which demo; `--list` shows all.
    pub name: Option<String>,
    /// Fewer measurements: done in a moment.
    #[arg(long)]
    pub quick: bool,
    /// List the demos.
    #[arg(long)]
    pub list: bool,
    /// Keep spec, data and model in this folder.
    #[arg(short, long, value_name = "FOLDER")]
    pub output: Option<PathBuf>,
}

/// One demo.
struct Demo {
    name: &'static str,
    /// What it shows, in one line.
    shows: &'static str,
    run: fn(&DemoRun) -> Result<Value>,
}

/// Every demo; the first is the one that runs unless another is named.
static DEMOS: &[Demo] = &[
    Demo {
        name: "missing-drag",
        shows: "sees a pendulum's law fail, names the effect that is missing, and adds it",
        run: missing::drag,
    },
    Demo {
        name: "henon-heiles",
        shows: "learns a chaotic star orbit's Hamiltonian from noisy pairs of states",
        run: henon_heiles,
    },
    Demo {
        name: "coupled-oscillators",
        shows: "learns a nonlinear coupling from 200 short, noisy runs",
        run: |stage| course::walk(stage, &course::COUPLED),
    },
    Demo {
        name: "mass-spring",
        shows: "learns which of five masses are joined by springs, and how stiffly",
        run: |stage| course::walk(stage, &course::SPRINGS),
    },
    Demo {
        name: "pendulum",
        shows: "learns numbers inside a sine, and prints a cosine",
        run: |stage| course::walk(stage, &course::PENDULUM),
    },
];

/// Where a demo plays.
struct DemoRun<'a> {
    folder: &'a Path,
    quick: bool,
    console: &'a Console,
}

/// Runs the command.
pub(super) fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    if arguments.list {
        let rows = DEMOS.iter().map(|demo| vec![demo.name.to_string(), demo.shows.to_string()]);
        let list: Vec<Value> =
            DEMOS.iter().map(|demo| json!({ "name": demo.name, "shows": demo.shows })).collect();
        let object = json!({ "format": "leverrier.demo-list/1", "demos": list });
        return console
            .result(&table(&["demo", "what it shows"], rows.collect(), &[], WIDTH), &object);
    }
    let name = arguments.name.as_deref();
    let demo = DEMOS.iter().find(|demo| name.is_none_or(|name| name == demo.name));
    let Some(demo) = demo else {
        let names: Vec<&str> = DEMOS.iter().map(|demo| demo.name).collect();
        return Err(usage(
            format!("there is no demo `{}`", name.unwrap_or_default()),
            format!("choose one of {}", names.join(", ")),
        ));
    };
    let temporary;
    let folder = match &arguments.output {
        Some(folder) => {
            let failed = |error| Error::file("create", folder, error);
            std::fs::create_dir_all(folder).map_err(failed)?;
            if std::fs::read_dir(folder).map_err(failed)?.next().is_some() {
                return Err(usage(
                    format!("the folder {} is not empty", folder.display()),
                    "name another one with -o",
                ));
            }
            folder.as_path()
        }
        None => {
            temporary = tempfile::tempdir()
                .map_err(|error| Error::file("create", Path::new("a temporary folder"), error))?;
            temporary.path()
        }
    };
    let mut object = (demo.run)(&DemoRun { folder, quick: arguments.quick, console })?;
    set(&mut object, "format", json!("leverrier.demo/2"));
    set(&mut object, "demo", json!(demo.name));
    set(
        &mut object,
        "folder",
        json!(arguments.output.as_ref().map(|path| path.display().to_string())),
    );
    if console.is_json() {
        return console.result("", &object);
    }
    if arguments.output.is_some() {
        console.message(&format!("Spec, data and model are in {}.", folder.display()));
    }
    Ok(())
}

const HENON_HEILES: &str = r#"# The truth, from which the measurements are made.
system "Henon-Heiles"
coordinates q[1..2]
momenta     p[1..2]
T = (p[1]^2 + p[2]^2)/2
V = (q[1]^2 + q[2]^2)/2 + q[1]^2*q[2] - q[2]^3/3
"#;

const HENON_HEILES_SPACE: &str = r#"# Motion in the gravity of a galaxy (Henon and Heiles, 1964), as if nothing were known of it.
system "Henon-Heiles"
coordinates q[1..2]
momenta     p[1..2]
data "pairs.csv" { time t  run run }

T = span{ tensor(p; 3) }     # every monomial with exponents up to 3
V = span{ tensor(q; 3) }
"#;

/// Part, term and coefficient of the truth.
const HENON_HEILES_TERMS: &[(&str, &str, f64)] = &[
    ("T", "p[1]^2", 0.5),
    ("T", "p[2]^2", 0.5),
    ("V", "q[1]^2", 0.5),
    ("V", "q[2]^2", 0.5),
    ("V", "q[1]^2*q[2]", 1.0),
    ("V", "q[2]^3", -1.0 / 3.0),
];

/// Standard deviation of the noise of every measured number.
const SIGMA: f64 = 0.005;

fn henon_heiles(stage: &DemoRun) -> Result<Value> {
    let say = |text: &str| match stage.console.is_json() {
        true => Ok(()),
        false => stage.console.text(&format!("{}\n\n", text.trim_end())),
    };
    let pairs = if stage.quick { 1_000 } else { 5_000 };
    let clock = Instant::now();
    let truth = expr::build("truth", HENON_HEILES)?;
    let nature = Simulator::known(&truth.system);
    // Chaotic energies, as in DiPietro, Xiong and Zhu (2020).
    let side = |lower, upper| Interval { lower, upper };
    let sampling = InitialDistribution {
        intervals: vec![side(-1.0, 1.0), side(-0.5, 1.0), side(-1.0, 1.0), side(-1.0, 1.0)],
        energy: Some(side(1.0 / 12.0, 1.0 / 6.0)),
    };
    let starts = draw(&nature, &sampling, pairs, 0.0, 1)?;
    let mut data = nature.trajectories(&starts, &[0.0, 0.1])?.dataset(&truth.system);
    add_noise(&mut data, &[NoiseLevel::Absolute(SIGMA); 4], 1)?;
    for name in &mut data.observables {
        name.retain(|c| !matches!(c, '[' | ']'));
    }
    write_csv(&stage.folder.join("pairs.csv"), &data, &Layout::default())?;
    let spec = stage.folder.join("henon-heiles.ham");
    write_atomically(&spec, HENON_HEILES_SPACE.as_bytes())?;
    let making = clock.elapsed().as_secs_f64();
    say(&wrapped(
        &format!(
            "The measurements: {pairs} pairs of states 0.1 apart in time, of a star in a galaxy, each of the \
             four numbers with noise of {SIGMA}. Made in {}, written to pairs.csv.\n",
            seconds(making)
        ),
        WIDTH,
        0,
    ))?;
    say(&format!("The spec, as if nothing were known:\n\n{}\n", indented(HENON_HEILES_SPACE)))?;

    let clock = Instant::now();
    let spec = Spec::open(&spec)?;
    let (dataset, about) = spec.measurements(None)?;
    let progress = Progress::new();
    let learned = learn(spec.system(), &dataset, &Options::default(), None, &progress);
    drop(progress);
    let model = learned?;
    let file = ModelFile { model, origin: origin(&spec, &dataset, &about) };
    write_model(&spec.model_path(), &file)?;
    let fitting = clock.elapsed().as_secs_f64();
    let model = &file.model;
    let simplified = present::simplified(&spec.learned(&file.model)?, &file.origin.ranges);
    say(&format!(
        "Learned in {} from {} candidate terms:\n\n    {}\n",
        seconds(fitting),
        model.evidence.function_space,
        wrapped(&simplified.text(Style::default()), WIDTH - 4, 8),
    ))?;

    let mut rows = Vec::new();
    for &(place, label, value) in HENON_HEILES_TERMS {
        let found = model.terms.iter().find(|term| term.place == place && term.term == label);
        rows.push(vec![
            place.to_string(),
            label.to_string(),
            significant(value, 6),
            found.map_or("missed".to_string(), |t| uncertain(t.coefficient, t.standard_error, 10)),
            found.map_or(String::new(), |t| {
                format!("{:+.1}", (t.coefficient - value) / t.standard_error)
            }),
        ]);
    }
    let known = |place: &str, label: &str| {
        HENON_HEILES_TERMS.iter().any(|&(at, term, _)| at == place && term == label)
    };
    for extra in model.terms.iter().filter(|term| !known(&term.place, &term.term)) {
        rows.push(vec![
            extra.place.clone(),
            extra.term.clone(),
            "0".to_string(),
            uncertain(extra.coefficient, extra.standard_error, 10),
            format!("{:+.1}", extra.coefficient / extra.standard_error),
        ]);
    }
    let header = ["part", "term", "truth", "learned", "off by (standard errors)"];
    say(&format!("{}\n", table(&header, rows, &[2, 3, 4], WIDTH)))?;

    let error = prediction_error(&nature, &spec, stage)?;
    let noise: Vec<f64> = model.noise.iter().map(|n| n.standard_deviation).collect();
    say(&wrapped(
        &format!(
            "Noise of the measurements, learned too: {} (true: {SIGMA}). Started anew from \
             q = (-0.48, -0.02), p = (-0.08, 0.18), the learned law stays within {} of the true \
             orbit up to t = 8.",
            noise.iter().map(|s| significant(*s, 3)).collect::<Vec<_>>().join(", "),
            significant(error, 2),
        ),
        WIDTH,
        0,
    ))?;
    Ok(json!({
        "pairs": pairs,
        "sigma": SIGMA,
        "hamiltonian": present::equations_json(&simplified, Style::default()),
        "truth": HENON_HEILES_TERMS
            .iter()
            .map(|&(place, term, value)| json!({ "place": place, "term": term, "coefficient": value }))
            .collect::<Vec<_>>(),
        "model": model,
        "prediction_error": error,
        "seconds": { "data": making, "fit": fitting },
    }))
}

/// Largest distance of a predicted coordinate from the truth up to t = 8.
fn prediction_error(nature: &Simulator, spec: &Spec, _: &DemoRun) -> Result<f64> {
    let law = spec.law(None)?;
    let learned = law.numbers().simulator();
    let start = vec![vec![-0.48, -0.02, -0.08, 0.18]];
    let times: Vec<f64> = (0..=80).map(|at| 0.1 * f64::from(at)).collect();
    let truth = nature.trajectories(&start, &times)?;
    let guess = learned.trajectories(&start, &times)?;
    let pairs = truth.states.iter().flatten().zip(guess.states.iter().flatten());
    let far = |(a, b): (&Vec<f64>, &Vec<f64>)| {
        a.iter().zip(b).take(2).fold(0.0f64, |most, (x, y)| most.max((x - y).abs()))
    };
    Ok(pairs.map(far).fold(0.0, f64::max))
}

fn indented(text: &str) -> String {
    text.lines()
        .map(|line| format!("    {line}").trim_end().to_string())
        .collect::<Vec<_>>()
        .join("\n")
}
