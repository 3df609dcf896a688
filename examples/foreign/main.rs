//! Regenerates docs/foreign.md: data that others measured, their figures and ours.
//!
//! ```console
//! $ cargo run --release --example foreign [FOLDER]
//! ```
//!
//! The data are not part of the project: `FOLDER` holds them, by default `../shared/data`. A case
//! whose files are not there is said to be absent.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a benchmark that fails stops"
)]

mod record;
mod stars;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use leverrier::{Data, Law, Spec};
use record::{Record, rms};

fn main() {
    let folder =
        std::env::args().nth(1).map_or_else(|| PathBuf::from("../shared/data"), PathBuf::from);
    let mut page = String::from(HEAD);
    for case in [silverbox, emps] {
        let text = case(&folder);
        println!("{text}");
        page.push_str(&text);
    }
    let text = stars::page(&folder);
    println!("{text}");
    page.push_str(&text);
    std::fs::write("docs/foreign.md", page).expect("docs/ is writable");
}

const HEAD: &str = "# Data that others measured

Made by `cargo run --release --example foreign FOLDER`; the folder holds the files, which are not
part of this project. Where there is an input, each model is fitted to the training record alone; a
test is simulated from its input, and what is printed is the root mean square of measured minus
simulated. Figures of others are as published, or (marked *) measured on the same files by other
means.
";

/// A law of one spec, learned from the training record, and how long that took.
fn learn(text: &str, training: &Record) -> (Law, f64) {
    let spec = Spec::parse(text).expect("a sound spec");
    let data = Data::from_slices(&spec, &training.times, &[&training.output, &training.input])
        .expect("columns of one length");
    let clock = Instant::now();
    let threads = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let law = threads.install(|| spec.fit(&data)).expect("a law");
    (law, clock.elapsed().as_secs_f64())
}

fn numbers(law: &Law) -> String {
    let mut out = String::new();
    for term in law.terms() {
        let name = term.name.clone().unwrap_or(term.term.clone());
        let _ = write!(out, " `{name}` {:.5};", term.coefficient);
    }
    out.trim_end_matches(';').to_string()
}

fn absent(title: &str, path: &Path) -> String {
    let name = path.file_name().map(|name| name.to_string_lossy()).unwrap_or_default();
    format!("\n## {title}\n\nAbsent: `{name}` is not in the folder.\n")
}

/// An electronic circuit: m y'' + d y' + k y + k3 y^3 = u.
fn silverbox(folder: &Path) -> String {
    let title = "Silverbox";
    let path = folder.join("silverbox.csv");
    let Some(all) = Record::read(&path, "u", "y") else { return absent(title, &path) };
    let training = all.part(40_650, 105_712);
    let tests = [all.part(105_712, 127_400), all.part(100, 40_575), all.part(100, 32_100)];
    let mut out = format!(
        "\n## {title}\n\nTrained on rows 40,650 to 105,712; the first 50 outputs of a test are free for \
         the initial state. Millivolts, on the multisine, the arrow, and the arrow without \
         extrapolation; seconds of training on one core.\n\n\
         | model | multisine | arrow | no extrapolation | training |\n|---|---|---|---|---|\n\
         | GRU (Champneys and others, 2024) | 1.49 | 2.80 | 0.95 | |\n\
         | LSTM (the same) | 1.50 | 2.68 | 0.96 | |\n\
         | drag, spring, cubic spring * | 0.351 | 0.452 | 0.354 | |\n\
         | with a quadratic stiffness * | 0.303 | 0.389 | 0.315 | |\n"
    );
    let mut learned = String::new();
    let drag = "force q += span{ drag: -p }";
    for (name, between, space) in [
        ("`V = span{ q^2 }`", "spline", "V = span{ q^2 }".to_string()),
        ("with offset, drag and q^4", "linear", format!("V = span{{ q, q^2, q^4 }}\n{drag}")),
        ("the same", "spline", format!("V = span{{ q, q^2, q^4 }}\n{drag}")),
        ("the same", "band_limited", format!("V = span{{ q, q^2, q^4 }}\n{drag}")),
        ("with q^3 too", "band_limited", format!("V = span{{ q, q^2, q^3, q^4 }}\n{drag}")),
    ] {
        let text = format!(
            "coordinates q; momenta p; time t\ninput u {{ {between} }}\n\
             T = span{{ p^2 }}\n{space}\nforce q += u"
        );
        let (law, seconds) = learn(&text, &training);
        let errors: Vec<String> =
            tests.iter().map(|test| format!("{:.3}", 1e3 * rms(&law, test, 50))).collect();
        let _ = writeln!(out, "| {name}; {between} | {} | {seconds:.1} |", errors.join(" | "));
        let _ = writeln!(learned, "- {name}; {between}:{}", numbers(&law));
    }
    out + "\nCoefficients:\n\n" + &learned
}

/// The axis of a motor: M q'' = force - Fv q' - Fc sign(q') - offset.
fn emps(folder: &Path) -> String {
    let title = "EMPS";
    let paths = [folder.join("emps.csv"), folder.join("emps_pulses.csv")];
    let read = |path: &PathBuf| Record::read(path, "force", "q");
    let (Some(training), Some(pulses)) = (read(&paths[0]), read(&paths[1])) else {
        return absent(title, &paths[0]);
    };
    let mut out = format!(
        "\n## {title}\n\nTrained on the first record; the second is simulated from its force alone, its \
         initial state free. Millimetres over the whole record.\n\n\
         | model | pulses | training |\n|---|---|---|\n| LSTM | 74 | |\n\
         | published parameters * | 8.36 | |\n| with quadratic drag beside * | 5.99 | |\n"
    );
    let mut learned = String::new();
    let friction = "force q += span{ viscous: -p, dry: -sign(p), offset: 1 }";
    for (name, space) in [
        ("drag, dry friction, offset", friction.to_string()),
        ("with quadratic drag", format!("{friction}\nforce q += span{{ quadratic: -p*abs(p) }}")),
    ] {
        let text = format!(
            "coordinates q; momenta p; time t\ninput u {{ linear }}\n\
             T = span{{ p^2 }}\nforce q += u\n{space}"
        );
        let (law, seconds) = learn(&text, &training);
        let error = 1e3 * rms(&law, &pulses, pulses.times.len());
        let _ = writeln!(out, "| {name} | {error:.2} | {seconds:.1} |");
        let _ = writeln!(learned, "- {name}:{}", numbers(&law));
    }
    out + "\nCoefficients (of momenta, not velocities):\n\n" + &learned
}
