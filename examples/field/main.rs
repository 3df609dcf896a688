//! Regenerates docs/field.md: records of people who do this work, what is known of their rigs, and
//! what is learned.
//!
//! ```console
//! $ cargo run --release --example field [FOLDER]
//! ```
//!
//! The records are not part of the project: `FOLDER` holds them, by default `../shared/data/field`.
//! A record that is not there is said to be absent.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a benchmark that fails stops"
)]

mod cases;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use cases::{CASES, Case};
use leverrier::{Data, DiscoveryOptions, Law, Result, Silent, Spec, Verdict};

fn main() {
    let folder = std::env::args()
        .nth(1)
        .map_or_else(|| PathBuf::from("../shared/data/field"), PathBuf::from);
    let mut page = String::from(HEAD);
    for case in CASES {
        let row = row(case, &folder);
        print!("{row}");
        page.push_str(&row);
    }
    page.push_str("\n## Specs\n");
    for (at, case) in CASES.iter().enumerate() {
        let text = case.text();
        if !CASES[..at].iter().any(|before| before.text() == text) {
            let _ = write!(page, "\n{}:\n\n```ham\n{text}```\n", case.title);
        }
    }
    std::fs::write("docs/field.md", page).expect("docs/ is writable");
}

const HEAD: &str = "# Records from the field

Made by `cargo run --release --example field FOLDER`; the folder holds the records, which are not part
of this project. \"Known\" is what was published of a rig, or what an output error fit by other means
gives. A fit learns from the whole record; `discover` holds a quarter of it out. Seconds are those of
one core of a machine that does other things, too.

| record | known | asked | learned | seconds |
|---|---|---|---|---|
";

/// What is done with a record.
#[derive(Clone, Copy)]
enum Asked {
    /// The numbers of the spec.
    Fit,
    /// What the spec lacks.
    Discover,
}

fn row(case: &Case, folder: &Path) -> String {
    let asked = match case.asked {
        Asked::Fit => "`fit`",
        Asked::Discover => "`discover`",
    };
    let path = folder.join(case.file);
    let clock = Instant::now();
    let learned = match path.exists() {
        true => answer(case, &path).unwrap_or_else(|error| error.to_string()),
        false => format!("absent: `{}`", case.file),
    };
    let seconds = clock.elapsed().as_secs_f64();
    let Case { title, known, .. } = case;
    format!("| {title} | {known} | {asked} | {} | {seconds:.1} |\n", learned.replace('|', "\\|"))
}

fn answer(case: &Case, path: &Path) -> Result<String> {
    let spec = Spec::parse(&case.text())?;
    let data = Data::open(path, &spec)?;
    let threads = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    threads.install(|| match case.asked {
        Asked::Fit => Ok(numbers(&spec.fit(&data)?)),
        Asked::Discover => {
            let (training, held_out) = data.split(0.25, 0)?;
            let options = DiscoveryOptions::default();
            let found = spec.discover(&training, &held_out, &options, &Silent)?;
            let verdict = match found.verdict() {
                Verdict::NothingMissing => "explained",
                Verdict::ExplainedInPart => "a part of it",
                Verdict::InsufficientData => "too little data",
                _ => "unexplained",
            };
            let steps: Vec<String> = found
                .steps()
                .iter()
                .map(|step| {
                    let both = step.coefficients.iter().zip(&step.standard_errors);
                    let values: Vec<String> = both.map(|(x, s)| with_error(*x, *s)).collect();
                    format!("`{}` {}", step.effect, values.join(", "))
                })
                .collect();
            let steps = if steps.is_empty() { "nothing".to_string() } else { steps.join("; ") };
            Ok(format!("{verdict}: {steps}"))
        }
    })
}

/// Coefficients and parameters of a law with their standard errors.
fn numbers(law: &Law) -> String {
    let terms = law.terms().iter().map(|term| {
        let name = term.name.as_deref().unwrap_or(&term.term);
        (name.to_string(), term.coefficient, term.standard_error)
    });
    let parameters = law.parameters().iter();
    let parameters = parameters.map(|one| (one.name.clone(), one.value, one.standard_error));
    let all = terms.chain(parameters);
    let all: Vec<String> =
        all.map(|(name, value, error)| format!("`{name}` {}", with_error(value, error))).collect();
    all.join("; ")
}

/// A number with two digits of its error.
fn with_error(value: f64, error: f64) -> String {
    if !(error > 0.0 && error.is_finite()) {
        return format!("{value:.4e}");
    }
    let decimals = (1.0 - error.log10().floor()).max(0.0) as usize;
    if decimals > 6 {
        return format!("{value:.4e} ± {error:.0e}");
    }
    format!("{value:.decimals$} ± {error:.decimals$}")
}
