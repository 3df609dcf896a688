//! The binary's start, and a fit on two cores.

use std::path::Path;
use std::process::Command;

use leverrier::internals::fit::{Options, Silent, fit};

use crate::Asked;
use crate::page::{Section, cores, ratio, time};
use crate::paper::{SIGMA, henon_heiles_pairs, tensor};
use crate::turns::{Turn, fastest, on_the_wall};

pub(crate) fn start(_: &Asked) -> Result<Section, String> {
    let mut section = Section::new(
        "Start of the program",
        "`leverrier --version` from start to end, the fastest and the median of 50.",
        &["who", "fastest", "median"],
    );
    let cargo = std::env::var("CARGO").unwrap_or("cargo".to_string());
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let built = Command::new(cargo)
        .args(["build", "--release", "--quiet", "--bin", "leverrier"])
        .current_dir(folder)
        .status();
    let own = std::env::current_exe().map_err(|error| error.to_string())?;
    // An example lies in a folder beside the program.
    let program = own.parent().and_then(Path::parent).map(|folder| folder.join("leverrier"));
    let program = program.filter(|path| path.exists() && built.is_ok_and(|done| done.success()));
    let Some(program) = program else {
        section.not_run("leverrier --version", "the program could not be built");
        return Ok(section);
    };
    let mut times = Vec::new();
    for _ in 0..50 {
        let (done, seconds) = on_the_wall(|| Command::new(&program).arg("--version").output());
        done.map_err(|error| error.to_string())?;
        times.push(seconds);
    }
    times.sort_by(f64::total_cmp);
    section.row(&["leverrier --version", &time(times[0]), &time(times[25])]);
    Ok(section)
}

/// Pairs of the fit that is shared by cores.
const PAIRS: usize = 100_000;

/// Prints the seconds of one fit after another, one for each line of the input.
pub(crate) fn child(threads: &str) -> Result<(), String> {
    let threads = threads.parse().map_err(|_| "a number of threads is missing")?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|error| error.to_string())?;
    let (space, data) = (tensor(3), henon_heiles_pairs(PAIRS, SIGMA, 1));
    let (model, seconds) =
        on_the_wall(|| pool.install(|| fit(&space, &data, &Options::default(), &Silent)));
    model.map_err(|error| error.to_string())?;
    println!("{seconds}");
    Ok(())
}

pub(crate) fn two_cores(asked: &Asked) -> Result<Section, String> {
    let about = format!(
        "A whole fit of {PAIRS} noisy pairs in memory, 30 terms, search and all. On a machine that \
         does other things the second core is not all there, and the ratio is too low."
    );
    let mut section = Section::new("Two cores", &about, &["cores", "fit", "times faster"]);
    if cores() < 2 {
        section.not_run("2", "the machine has one core");
        return Ok(section);
    }
    let own = std::env::current_exe().map_err(|error| error.to_string())?;
    let run = |threads: usize| -> Result<f64, String> {
        let mut command = Command::new("taskset");
        command.args(["--cpu-list", &format!("0-{}", cores() - 1)]).arg(&own);
        command.arg("--fit-with").arg(threads.to_string());
        let done = command.output().map_err(|error| format!("no taskset: {error}"))?;
        let text = String::from_utf8_lossy(&done.stdout);
        let said = String::from_utf8_lossy(&done.stderr);
        text.trim().parse().map_err(|_| format!("the fit failed: {}", said.trim()))
    };
    let rounds = if asked.quick.is_some() { 1 } else { 25 };
    let turns: [Turn; 2] = [Box::new(|| run(1)), Box::new(|| run(2))];
    let times = fastest(rounds, &mut turns.map(|turn| turn));
    match (&times[0], &times[1]) {
        (Ok(one), Ok(two)) => {
            section.row(&["1", &time(*one), "1"]);
            section.row(&["2", &time(*two), &ratio(one / two)]);
        }
        (Err(why), _) | (_, Err(why)) => section.not_run("2", why),
    }
    Ok(section)
}
