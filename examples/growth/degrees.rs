//! Growth of a whole fit with the degrees of freedom, of chains and of square lattices.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use leverrier::internals::expr::build;
use leverrier::internals::fit::{Options, Silent, fit};
use leverrier::internals::simulate::{NoiseLevel, Simulator, add_noise};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::page::{exponent, machine, time};
use super::stages::{peak_memory, processor_seconds};

/// The heading of the section.
const HEADING: &str = "\n## Chains and lattices\n";
/// Standard deviation of the noise on every number.
const SIGMA: f64 = 0.005;
/// Masses of the chains, and of the sides of the lattices.
const CHAINS: [usize; 7] = [1, 3, 10, 30, 100, 300, 1000];
const SIDES: [usize; 6] = [2, 4, 6, 10, 18, 31];
/// Transitions that each shape is fitted to.
const TRANSITIONS: [(&str, usize); 2] = [("chain", 4000), ("lattice", 1000)];
/// Fits are repeated until they took so many seconds: the clock of the processor time is coarse.
const LEAST: f64 = 1.0;

/// One fit, in a process of its own.
struct Fitted {
    degrees: usize,
    terms: usize,
    /// Processor seconds for each transition.
    each: f64,
    /// Peak resident memory, MiB.
    memory: f64,
    exact: bool,
}

/// A chain, or a square lattice row after row: pairs of neighbours.
fn edges(shape: &str, size: usize) -> (usize, Vec<(usize, usize)>) {
    if shape == "chain" {
        return (size, (1..size).map(|i| (i, i + 1)).collect());
    }
    let site = |row: usize, column: usize| size * row + column;
    let along = (0..size).flat_map(|r| (1..size).map(move |c| (site(r, c), site(r, c + 1))));
    let across = (1..size).flat_map(|r| (1..=size).map(move |c| (site(r - 1, c), site(r, c))));
    (size * size, along.chain(across).collect())
}

/// Makes transitions, fits them on one thread, and prints what it took.
pub(crate) fn measure(shape: &str, size: usize, transitions: usize) {
    let (degrees, edges) = edges(shape, size);
    let header = format!("coordinates q[1..{degrees}]\nmomenta p[1..{degrees}]\n");
    let springs = |scale: &str| -> Vec<String> {
        edges.iter().map(|(a, b)| format!("{scale}(q[{b}] - q[{a}])^2")).collect()
    };
    let mut potential = springs("0.5*");
    // Every fifth spring to the ground hardens; the space asks it of all.
    let hardens = |i: usize| i.is_multiple_of(5);
    for i in 1..=degrees {
        potential.push(format!("0.25*q[{i}]^2"));
        potential.extend(hardens(i).then(|| format!("0.25*q[{i}]^4")));
    }
    let kinetic = format!("T = sum(0.5*p[i]^2 for i in 1..{degrees})\n");
    let truth = format!("{header}{kinetic}V = {}\n", potential.join(" + "));
    let mut candidates = springs("");
    candidates.push(format!("q[i]^2 for i in 1..{degrees}, q[i]^4 for i in 1..{degrees}"));
    let space = format!(
        "{header}T = span{{ p[i]^2 for i in 1..{degrees} }}\nV = span{{ {} }}\n",
        candidates.join(", ")
    );
    let law = build("truth", &truth).expect("a sound spec");
    let mut generator = Pcg64::seed_from_u64(11);
    let starts: Vec<Vec<f64>> = (0..transitions)
        .map(|_| (0..2 * degrees).map(|_| generator.random_range(-1.0..1.0)).collect())
        .collect();
    let motion = Simulator::known(&law.system).trajectories(&starts, &[0.0, 0.1]);
    let mut data = motion.expect("finite").dataset(&law.system);
    add_noise(&mut data, &vec![NoiseLevel::Absolute(SIGMA); 2 * degrees], 3).expect("positive");
    let space = build("space", &space).expect("a sound spec");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let learn = || pool.install(|| fit(&space.system, &data, &Options::default(), &Silent));
    let before = processor_seconds();
    let model = learn().expect("enough data");
    let mut fits = 1;
    while processor_seconds() - before < LEAST {
        learn().expect("enough data");
        fits += 1;
    }
    let each = (processor_seconds() - before) / (fits * transitions) as f64;
    let wanted = 2 * degrees + edges.len() + degrees / 5;
    let hardening = model.terms.iter().filter(|term| term.term.ends_with("]^4"));
    let exact = model.terms.len() == wanted && hardening.count() == degrees / 5;
    let terms = space.system.terms.len();
    println!("{degrees} {terms} {each:e} {} {}", peak_memory(), u8::from(exact));
}

fn fitted(shape: &str, size: usize, transitions: usize) -> Fitted {
    let own = std::env::current_exe().expect("this program");
    let words = ["--degrees-child", shape, &size.to_string(), &transitions.to_string()];
    let done = Command::new(own).args(words).output().expect("started");
    let text = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(done.status.success(), "{text}{}", String::from_utf8_lossy(&done.stderr));
    println!("{shape} of {size}: {}", text.trim());
    let n: Vec<f64> = text.split_whitespace().map(|x| x.parse().expect("a number")).collect();
    let [degrees, terms, each, memory, exact] = n[..] else { panic!("five numbers: {text}") };
    Fitted { degrees: degrees as usize, terms: terms as usize, each, memory, exact: exact == 1.0 }
}

/// The section, measured anew.
pub(crate) fn section() -> String {
    let mut text = format!(
        "{HEADING}\n\
         Written by `cargo run --release --example growth -- --degrees`, with the rest or alone. \
         Machine: {}{}. Whole fits, each in a process of its own on one thread: noisy transitions \
         (sigma {SIGMA}) in memory, {} of chains and {} of lattices; masses, springs between \
         neighbours, springs to the ground, of which every fifth hardens; the space asks all of \
         them to. Processor time; the peak memory is that of making the data, too.\n\n\
         | shape | degrees of freedom | terms | whole fit, for a transition | for a degree of \
         freedom | peak memory | support |\n|---|---|---|---|---|---|---|\n",
        machine(),
        if cfg!(debug_assertions) { "; built for development, `opt-level = 2`" } else { "" },
        TRANSITIONS[0].1,
        TRANSITIONS[1].1,
    );
    let mut exponents = Vec::new();
    let sizes = [CHAINS.as_slice(), SIDES.as_slice()];
    for ((shape, transitions), sizes) in TRANSITIONS.into_iter().zip(sizes) {
        let all: Vec<Fitted> = sizes.iter().map(|&size| fitted(shape, size, transitions)).collect();
        for one in &all {
            let _ = writeln!(
                text,
                "| {shape} | {} | {} | {} | {} | {:.0} MiB | {} |",
                one.degrees,
                one.terms,
                time(one.each),
                time(one.each / one.degrees as f64),
                one.memory,
                if one.exact { "exact" } else { "not exact" },
            );
        }
        let points = all.iter().filter(|one| one.degrees >= 9);
        let points: Vec<(f64, f64)> = points.map(|one| (one.degrees as f64, one.each)).collect();
        exponents.push(format!("{shape}s {:.2}", exponent(&points)));
    }
    let _ = writeln!(
        text,
        "\nExponents from about 10 degrees of freedom on: {}. Small systems go by the dense factor. \
         From some tens on, tangents reach a few neighbours, and the states of some masses are \
         eliminated with those of the few around them, whatever the number of masses: a pass takes \
         nearly the same for each mass. The search and the covariance of all terms do not grow with \
         the transitions but with more than the number of masses. In a lattice more masses stand \
         within that distance than in a chain, and in a small one not all, so that it begins cheaper \
         and its exponent is above one.",
        exponents.join(", ")
    );
    text
}

/// Puts the section into a page, in the place of the one that stands there.
pub(crate) fn renewed(page: &str, section: &str) -> String {
    let (start, end) = place(page);
    format!("{}{section}{}", &page[..start], &page[end..])
}

/// Where the section stands, or should.
fn place(page: &str) -> (usize, usize) {
    let from =
        |at: usize| page[at + 1..].find("\n## ").map_or(page.len(), |length| at + 1 + length);
    match page.find(HEADING) {
        Some(start) => (start, from(start)),
        None => {
            let at = page.find("\n## A diagnosis").unwrap_or(page.len());
            (at, at)
        }
    }
}

/// Measures the section alone, and writes it into the page.
pub(crate) fn write(page: &Path) {
    let before = std::fs::read_to_string(page).unwrap_or_default();
    let section = section();
    std::fs::write(page, renewed(&before, &section)).expect("docs can be written");
    println!("{section}");
}
