//! The demo of an effect that the spec does not know of: the law fails, is told what it lacks,
//! and gets it.

use std::path::PathBuf;

use serde_json::{Value, json};

use super::{DemoRun, indented};
use crate::cli::diagnosis_options::DiagnosisArguments;
use crate::cli::progress::Progress;
use crate::cli::splitting::SplitArguments;
use crate::cli::{compare, diagnose, revise};
use crate::data::{Layout, write_atomically, write_csv};
use crate::diagnose::discover::{DiscoveryOptions, discover};
use crate::error::{Error, Result};
use crate::expr;
use crate::expr::Term;
use crate::fit::Law;

use crate::project::Spec;
use crate::project::workspace::Workspace;
use crate::report::layout::{WIDTH, table, wrapped};
use crate::simplify::{significant, uncertain};
use crate::simulate::{InitialDistribution, Interval, NoiseLevel, Simulator, add_noise, draw};

const TRUTH: &str = r#"# The truth, from which the measurements are made.
system "damped pendulum"
coordinates q
momenta     p
T = p^2/2
V = -cos(q)
force q += -0.05*p
"#;

const SPEC: &str = r#"# A pendulum on a bench: nobody has thought of a drag.
system "pendulum on a bench"
coordinates q
momenta     p
data "swings.csv" { time t  run run }

T = p^2/2                    # the mass is known
V = span{ cos(q) }           # the weight is to be learned
"#;

/// The effect that is hidden.
const HIDDEN: &str = "viscous_drag(q)";

/// Part, term and coefficient of the truth.
const TERMS: [(&str, &str, f64); 2] = [("V", "cos(q)", -1.0), ("force q", "-p", 0.05)];

/// Noise of the swings, in parts of each column's spread.
const NOISE: f64 = 0.01;

/// The hidden drag.
pub(super) fn drag(stage: &DemoRun) -> Result<Value> {
    let runs = if stage.quick { 6 } else { 8 };
    measure(stage, runs)?;
    // In the folder itself, so that commands are shown as one would type them.
    let failed = |error| Error::file("open", stage.folder, error);
    let home = std::env::current_dir().map_err(failed)?;
    std::env::set_current_dir(stage.folder).map_err(failed)?;
    let done = story(stage, runs);
    std::env::set_current_dir(home).map_err(failed)?;
    done
}

fn story(stage: &DemoRun, runs: usize) -> Result<Value> {
    let spec = PathBuf::from("pendulum.ham");
    write_atomically(&spec, SPEC.as_bytes())?;
    let splitting = SplitArguments { data: None, held_out: 0.25, seed: 0, threads: None };
    let truth = json!({
        "hidden": HIDDEN,
        "terms": TERMS
            .iter()
            .map(|(place, term, value)| json!({ "place": place, "term": term, "coefficient": value }))
            .collect::<Vec<_>>(),
    });
    if stage.console.is_json() {
        let workspace = Workspace::open(&spec, &splitting.asked()?, stage.console)?;
        let held_out = workspace.held_out().unwrap_or(&workspace.dataset);
        let (training, options) = (&workspace.split.training, DiscoveryOptions::default());
        let progress = Progress::new();
        let found = discover("pendulum.ham", SPEC, training, held_out, &options, &progress)?;
        return Ok(json!({
            "truth": truth,
            "steps": found.steps,
            "terms": found.model.terms,
            "held_out_error": found.held_out_error,
        }));
    }
    let say = |text: &str| stage.console.text(&format!("{}\n\n", wrapped(text, WIDTH, 0)));
    let chapter = |number: usize, title: &str| {
        let line = format!("{number}. {title} ");
        stage.console.text(&format!("\n{line:=<width$}\n\n", width = WIDTH))
    };
    say(&format!(
        "The measurements: {runs} swings of a pendulum, with noise of {} % and an effect that the spec does \
         not know of. The spec:",
        100.0 * NOISE
    ))?;
    stage.console.text(&format!("{}\n", indented(SPEC)))?;
    chapter(1, "Where does it fail?  leverrier compare pendulum.ham")?;
    let arguments = compare::Arguments { spec: spec.clone(), splitting: splitting.clone() };
    compare::run(&arguments, stage.console)?;
    chapter(2, "What is missing?  leverrier diagnose pendulum.ham")?;
    let ask = diagnose::Arguments {
        spec: spec.clone(),
        diagnosis: DiagnosisArguments::default(),
        splitting: splitting.clone(),
    };
    diagnose::run(&ask, stage.console)?;
    chapter(3, &format!("Add it.  leverrier add pendulum.ham \"{HIDDEN}\""))?;
    let effect = HIDDEN.to_string();
    let add = revise::Add { spec: spec.clone(), effect, splitting: splitting.clone() };
    revise::add(&add, stage.console)?;
    chapter(4, "What is missing now?  leverrier diagnose pendulum.ham")?;
    diagnose::run(&ask, stage.console)?;
    chapter(5, "The truth, and what was found")?;
    let spec = Spec::open(&spec)?;
    let found = beside_the_truth(spec.law(None)?.numbers());
    stage.console.text(&format!("{found}\n"))?;
    Ok(json!({ "truth": truth }))
}

/// Makes the swings.
fn measure(stage: &DemoRun, runs: usize) -> Result<()> {
    let truth = expr::build("truth", TRUTH)?;
    let nature = Simulator::known(&truth.system);
    let side = |lower, upper| Interval { lower, upper };
    let sampling =
        InitialDistribution { intervals: vec![side(-1.5, 1.5), side(-0.5, 0.5)], energy: None };
    let starts = draw(&nature, &sampling, runs, 0.0, 3)?;
    let times: Vec<f64> = (0..=120).map(|i| 0.1 * f64::from(i)).collect();
    let mut data = nature.trajectories(&starts, &times)?.dataset(&truth.system);
    add_noise(&mut data, &[NoiseLevel::Relative(NOISE); 2], 3)?;
    write_csv(&stage.folder.join("swings.csv"), &data, &Layout::default())
}

/// The law that was learned from all measurements, term by term beside the true one.
fn beside_the_truth(law: &Law) -> String {
    let (system, errors) = (law.system(), law.standard_errors());
    let learned = |place: &str, label: &str| {
        let same = |term: &Term| term.label == label && system.place_name(term.place) == place;
        let found = law.terms().zip(&errors).find(|((_, term, _), _)| same(term));
        found.map(|((_, _, coefficient), error)| (coefficient, *error))
    };
    let rows = TERMS.iter().map(|&(place, term, value)| {
        let (found, off) = match learned(place, term) {
            Some((x, error)) => (uncertain(x, error, 8), format!("{:+.1}", (x - value) / error)),
            None => ("missed".to_string(), String::new()),
        };
        vec![place.to_string(), term.to_string(), significant(value, 6), found, off]
    });
    let header = ["part", "term", "truth", "found", "off by (standard errors)"];
    table(&header, rows.collect(), &[2, 3, 4], WIDTH)
}
