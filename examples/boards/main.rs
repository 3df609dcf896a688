//! Boards: lists of laws that others defined, with figures of others to beat. Motions are made
//! from each law, and `discover` is asked for it. Writes docs/boards.md.
//!
//! ```console
//! $ cargo run --release --example boards -- --oscillators FILE --odebench FILE   # goes on
//! $ cargo run --release --example boards -- --oscillators FILE --names PO0,PO2 --noise 1
//! $ cargo run --release --example boards -- --odebench FILE --limit 60 --output page.md
//! $ cargo run --release --example boards -- --oscillators FILE --names PO0 --write FOLDER
//! $ cargo run --release --example boards -- --page       # the page of what was run
//! ```
//!
//! The lists are not part of the project. That of the oscillators has the columns `name` and
//! `acceleration`, that of ODEBench `id`, `acceleration`, `known_V`, `missing` and `starts`. Every
//! case that is done is a line of target/boards.csv (`--results` names another file): a run that
//! was ended goes on where it was. Each case is a process of its own, which can be ended.

mod boards;
mod expression;
mod motion;
mod page;
mod record;
mod terms;

use std::fs;
use std::io::Read as _;
use std::path::PathBuf;
use std::process::{Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

use boards::{ODEBENCH, OSCILLATORS, Row, processor_seconds};
use clap::Parser;
use record::{Record, State};

/// Between looks at a case that runs.
const PAUSE: Duration = Duration::from_millis(50);

/// A case that waits and does not compute ends after so many limits by the clock on the wall.
const WAITING: f64 = 10.0;

/// Makes motions from lists of laws, and asks for the laws.
#[derive(Parser)]
struct Arguments {
    /// The list of oscillators: name, acceleration
    #[arg(long, value_name = "FILE")]
    oscillators: Option<PathBuf>,
    /// The list of ODEBench: id, acceleration, known_V, missing, starts
    #[arg(long, value_name = "FILE")]
    odebench: Option<PathBuf>,
    /// Noise in per cent of each column's spread
    #[arg(long, value_delimiter = ',', default_values_t = [0.0, 1.0, 5.0])]
    noise: Vec<f64>,
    /// Only these systems
    #[arg(long, value_delimiter = ',')]
    names: Vec<String>,
    /// Seconds of processor time that a case may take
    #[arg(long, default_value_t = 300.0)]
    limit: f64,
    /// A line for every case
    #[arg(long, default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/target/boards.csv"))]
    results: PathBuf,
    /// The page
    #[arg(long, default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/boards.md"))]
    output: PathBuf,
    /// Only make the page of what was run
    #[arg(long)]
    page: bool,
    /// Run nothing, and write the data and the spec of every case into a folder
    #[arg(long, value_name = "FOLDER")]
    write: Option<PathBuf>,
    /// Run the cases here and without a limit, and print their lines of the results
    #[arg(long)]
    alone: bool,
}

/// A case that is to be run.
struct Case<'a> {
    board: &'static str,
    list: &'a PathBuf,
    row: Row,
    noise: f64,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(sentence) => {
            eprintln!("{sentence}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), String> {
    if !arguments.page {
        let cases = cases(arguments)?;
        if let Some(folder) = &arguments.write {
            for case in &cases {
                match boards::write(folder, &case.row, case.noise)? {
                    Some(spec) => eprintln!("{}", spec.display()),
                    None => eprintln!("{} leaves every bound.", case.row.name),
                }
            }
            return Ok(());
        }
        if arguments.alone {
            for case in &cases {
                let record = boards::case(case.board, &case.row, case.noise);
                print!("{}", record::to_line(&record, false)?);
            }
            return Ok(());
        }
        let done = record::records(&arguments.results);
        for case in &cases {
            let is_done = done.iter().any(|record| {
                record.is_of(case.board, &case.row.name, case.noise)
                    && record.stands(arguments.limit)
            });
            if !is_done {
                let record = apart(case, arguments.limit)?;
                record::keep(&arguments.results, &record)?;
                eprintln!("{}", record.line());
            }
        }
    }
    let all = record::records(&arguments.results);
    if all.is_empty() {
        let place = arguments.results.display();
        return Err(format!("No case stands in {place}: run some first, without --page."));
    }
    if let Some(folder) = arguments.output.parent().filter(|one| !one.as_os_str().is_empty()) {
        fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    }
    let place = arguments.output.display();
    fs::write(&arguments.output, page::page(all))
        .map_err(|error| format!("{place}: {error}; give another file with --output"))?;
    eprintln!("The page is {place}.");
    Ok(())
}

/// The cases that the arguments ask for.
fn cases(arguments: &Arguments) -> Result<Vec<Case<'_>>, String> {
    let lists = [(OSCILLATORS, &arguments.oscillators), (ODEBENCH, &arguments.odebench)];
    let lists: Vec<_> =
        lists.into_iter().filter_map(|(board, list)| Some((board, list.as_ref()?))).collect();
    if lists.is_empty() {
        return Err("No list of laws was named: they are not part of this project; give \
                    --oscillators FILE, --odebench FILE, or both."
            .to_string());
    }
    let is_noise = |noise: &f64| (0.0..=100.0).contains(noise);
    if let Some(strange) = arguments.noise.iter().find(|noise| !is_noise(noise)) {
        return Err(format!("A noise of {strange} % cannot be made: give 0 to 100, like 0,1,5."));
    }
    if arguments.limit.is_nan() || arguments.limit <= 0.0 {
        return Err(format!("A limit of {} s ends everything: give more.", arguments.limit));
    }
    let (mut out, mut known) = (Vec::new(), Vec::new());
    for (board, list) in lists {
        for row in boards::rows(board, list)? {
            known.push(row.name.clone());
            if arguments.names.is_empty() || arguments.names.contains(&row.name) {
                for noise in &arguments.noise {
                    out.push(Case { board, list, row: row.clone(), noise: *noise });
                }
            }
        }
    }
    if let Some(strange) = arguments.names.iter().find(|name| !known.contains(name)) {
        return Err(format!("No list has a system `{strange}`: there are {}.", known.join(", ")));
    }
    Ok(out)
}

/// Runs a case in a process of its own, on one thread, and ends it at the limit.
fn apart(case: &Case, limit: f64) -> Result<Record, String> {
    let empty = |state| Record::new(case.board, &case.row.name, case.noise, state);
    let failed = |error: std::io::Error| format!("A case cannot be run as a process: {error}.");
    let mut child = Command::new(std::env::current_exe().map_err(failed)?)
        .arg(format!("--{}", case.board))
        .arg(case.list)
        .arg(format!("--names={}", case.row.name))
        .arg(format!("--noise={}", case.noise))
        .arg("--alone")
        .env("RAYON_NUM_THREADS", "1")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .map_err(failed)?;
    let clock = Instant::now();
    let process = child.id().to_string();
    let status = loop {
        if let Some(status) = child.try_wait().map_err(failed)? {
            break status;
        }
        let wall = clock.elapsed().as_secs_f64();
        let used = processor_seconds(&process).unwrap_or(wall);
        if used > limit || wall > WAITING * limit {
            child.kill().and_then(|()| child.wait()).map_err(failed)?;
            return Ok(Record { seconds: limit, ..empty(State::NotFinished) });
        }
        std::thread::sleep(PAUSE);
    };
    let mut text = String::new();
    if let Some(mut out) = child.stdout.take() {
        out.read_to_string(&mut text).map_err(failed)?;
    }
    let read = text.lines().last().and_then(record::from_line);
    Ok(read.unwrap_or_else(|| Record {
        remark: format!("the case ended without an answer ({status})"),
        ..empty(State::Failed)
    }))
}
