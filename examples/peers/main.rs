//! Leverrier beside others, in one run on one machine: regenerates docs/peers.md.
//!
//! ```console
//! $ cargo run --release --example peers                      everything: about half an hour
//! $ cargo run --release --example peers -- --only gradient   one table
//! $ cargo run --release --example peers -- --quick 5         a try; nothing is written to docs
//! ```
//!
//! Others come from Python packages, which are installed at pinned versions in an environment of
//! their own below `target/peers` (`--folder` names another place, `--python` another
//! interpreter). What cannot be installed is left out, and the page says why.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a benchmark that fails stops"
)]

mod by_hand;
mod gradient;
mod learning;
mod page;
#[allow(dead_code, reason = "the tests use the rest")]
#[path = "../../tests/learning/paper/mod.rs"]
mod paper;
mod program;
mod python;
mod trajectory;
mod turns;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use page::Section;
use python::Python;

/// What the command line asks for.
pub struct Asked {
    /// Files of the runs, the Python environment, the sections of the page.
    pub folder: PathBuf,
    python: String,
    only: Vec<String>,
    /// Seconds that a network may train.
    train: f64,
    /// A try: seconds that anything may train.
    pub quick: Option<f64>,
}

impl Asked {
    /// Seconds of processor time that a network may train.
    pub fn seconds(&self) -> f64 {
        self.quick.unwrap_or(self.train)
    }
}

type Take = fn(&Asked, Result<&Python, &String>) -> Result<Section, String>;

/// Every table of the page, with its name on the command line.
const TABLES: [(&str, Take); 9] = [
    ("paper", learning::paper),
    ("rivals", |asked, python| learning::rivals(asked, python, false)),
    ("rivals-noisy", |asked, python| learning::rivals(asked, python, true)),
    ("gradient", |asked, python| gradient::section(asked, python, false)),
    ("functions", |asked, python| gradient::section(asked, python, true)),
    ("steps", |asked, _| trajectory::steps(asked)),
    ("series", trajectory::series),
    ("start", |asked, _| program::start(asked)),
    ("cores", |asked, _| program::two_cores(asked)),
];

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let done = match words.as_slice() {
        [child, threads] if child == "--fit-with" => program::child(threads),
        _ => on_one_core(&words),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("error: {why}");
            ExitCode::FAILURE
        }
    }
}

/// Set for the process that is bound to one core.
const BOUND: &str = "LEVERRIER_PEERS_BOUND";

/// Runs everything, the others too, on the machine's last core, where that can be had.
fn on_one_core(words: &[String]) -> Result<(), String> {
    let asked = asked(words)?;
    if std::env::var_os(BOUND).is_none()
        && let Ok(own) = std::env::current_exe()
    {
        let mut command = Command::new("taskset");
        command.args(["--cpu-list", &(page::cores() - 1).to_string()]).arg(own).args(words);
        if let Ok(done) = command.env(BOUND, "1").status() {
            return if done.success() { Ok(()) } else { Err("it did not end well".to_string()) };
        }
    }
    run(&asked)
}

fn run(asked: &Asked) -> Result<(), String> {
    // This thread is the one that works, so that its processor time is all there is.
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global();
    one.map_err(|error| error.to_string())?;
    // Sections of a try are kept apart.
    let sections = asked.folder.join(if asked.quick.is_some() { "tries" } else { "sections" });
    std::fs::create_dir_all(&sections)
        .map_err(|error| format!("{}: {error}", sections.display()))?;
    let python = Python::new(&asked.folder, &asked.python);
    if let Err(why) = &python {
        println!("{why}");
    }
    for (name, take) in TABLES {
        if asked.only.is_empty() || asked.only.iter().any(|only| only == name) {
            println!("{name}");
            match take(asked, python.as_ref()) {
                Ok(section) => section.keep(&sections, name)?,
                Err(why) => println!("    not run: {why}"),
            }
        }
    }
    let page = page::page(&sections, &TABLES.map(|(name, _)| name));
    println!("\n{page}");
    if asked.quick.is_some() {
        return Ok(());
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/peers.md");
    std::fs::write(&path, page).map_err(|error| format!("{}: {error}", path.display()))
}

fn asked(words: &[String]) -> Result<Asked, String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/peers");
    let (python, only) = ("python3".to_string(), Vec::new());
    let mut asked = Asked { folder, python, only, train: 180.0, quick: None };
    let mut words = words.iter();
    while let Some(word) = words.next() {
        let mut value = || words.next().cloned().ok_or(format!("{word} needs a value"));
        let seconds = |text: String| match text.parse::<f64>() {
            Ok(x) if x.is_finite() && x > 0.0 => Ok(x),
            _ => Err(format!("{word} needs a number of seconds, not `{text}`")),
        };
        match word.as_str() {
            "--folder" => asked.folder = PathBuf::from(value()?),
            "--python" => asked.python = value()?,
            "--train" => asked.train = seconds(value()?)?,
            "--quick" => asked.quick = Some(seconds(value()?)?),
            "--only" => {
                let name = value()?;
                let names = TABLES.map(|(name, _)| name);
                if !names.contains(&name.as_str()) {
                    return Err(format!("there is no table `{name}`: {}", names.join(", ")));
                }
                asked.only.push(name);
            }
            other => {
                return Err(format!(
                    "there is no option `{other}`: --only TABLE, --train SECONDS, --quick \
                     SECONDS, --folder FOLDER, --python PROGRAM"
                ));
            }
        }
    }
    Ok(asked)
}
