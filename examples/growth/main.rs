//! How training grows with the data and with the function space, and a diagnosis with the data:
//! regenerates docs/growth.md and docs/growth.svg.
//!
//! ```console
//! $ cargo run --release --example growth                   1e6 and 1e7 transitions
//! $ cargo run --release --example growth -- --largest 1e8  another 7 GB in a temporary folder
//! $ cargo run --release --example growth -- --degrees      the section on chains and lattices
//! ```
//!
//! Files of transitions are made in a temporary folder (`--folder` names another) and fitted in
//! processes of their own, whose peak memory the operating system tells.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a benchmark that fails stops"
)]

mod degrees;
mod diagnosis;
mod make;
mod page;
mod space;
mod stages;
mod trap;

use std::path::{Path, PathBuf};
use std::process::Command;

use stages::Stages;

/// The section of the page that another program writes.
const DISTRIBUTED: &str = "\n## Beyond one machine";

/// What the command line asks for.
struct Asked {
    largest: u64,
    folder: Option<PathBuf>,
    /// Largest function space that is factorised.
    terms: usize,
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    if let [child, file, threads] = words.as_slice()
        && child == "--child"
    {
        let threads = threads.parse().expect("a number of threads");
        println!("{}", stages::measure(Path::new(file), threads).to_line());
        return;
    }
    if let [child, shape, size, transitions] = words.as_slice()
        && child == "--degrees-child"
    {
        let number = |word: &String| word.parse().expect("a number");
        return degrees::measure(shape, number(size), number(transitions));
    }
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    if words == ["--degrees"] {
        return degrees::write(&docs.join("growth.md"));
    }
    let asked = asked(&words);
    let temporary = tempfile::tempdir().expect("a temporary folder");
    let folder = asked.folder.clone().unwrap_or_else(|| temporary.path().to_path_buf());
    std::fs::create_dir_all(&folder).expect("a folder that can be written");

    let sizes: Vec<u64> =
        (6..).map(|power| 10u64.pow(power)).take_while(|size| *size <= asked.largest).collect();
    let mut by_size = Vec::new();
    let mut cores = None;
    for &size in &sizes {
        let file = folder.join(format!("henon-heiles-{size}.parquet"));
        if !file.exists() {
            println!("making {size} transitions ...");
            make::write(&file, size);
        }
        let bytes = std::fs::metadata(&file).map_or(0, |about| about.len());
        if size == sizes[0] {
            cores = Some([1, 2].map(|threads| best_of_three(&file, threads)));
        }
        let stages = child(&file, std::thread::available_parallelism().map_or(1, usize::from));
        println!("{size}: {}", stages.to_line());
        by_size.push((size, bytes, stages));
        if asked.folder.is_none() {
            let _ = std::fs::remove_file(&file);
        }
    }
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let (by_terms, by_degrees, by_samples) = one
        .install(|| (space::by_terms(asked.terms), space::by_degrees(), diagnosis::by_samples()));
    let page = page::Page { by_size, cores, by_terms, by_degrees, by_samples };
    // What examples/growth/distributed.py wrote stands behind.
    let before = std::fs::read_to_string(docs.join("growth.md")).unwrap_or_default();
    let rest = before.find(DISTRIBUTED).map_or("", |at| &before[at..]);
    let text = degrees::renewed(&page.text(), &degrees::section());
    std::fs::write(docs.join("growth.md"), text + rest).expect("docs can be written");
    std::fs::write(docs.join("growth.svg"), page.picture()).expect("docs can be written");
    println!("{}", page.text());
}

fn asked(words: &[String]) -> Asked {
    let value = |name: &str| {
        words
            .iter()
            .position(|word| word == name)
            .map(|at| words.get(at + 1).unwrap_or_else(|| panic!("{name} needs a value")).clone())
    };
    let number = |name: &str, usual: f64| {
        value(name).map_or(usual, |text| text.parse::<f64>().expect("a number"))
    };
    Asked {
        largest: number("--largest", 1e7) as u64,
        folder: value("--folder").map(PathBuf::from),
        terms: number("--terms", 2046.0) as usize,
    }
}

/// A fit in a process of its own, so that its peak memory is its own.
fn child(file: &Path, threads: usize) -> Stages {
    let own = std::env::current_exe().expect("this program");
    let done = Command::new(own)
        .arg("--child")
        .arg(file)
        .arg(threads.to_string())
        .output()
        .expect("started");
    let text = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(done.status.success(), "{text}{}", String::from_utf8_lossy(&done.stderr));
    Stages::from_line(text.trim())
}

fn best_of_three(file: &Path, threads: usize) -> Stages {
    let runs = (0..3).map(|_| child(file, threads));
    runs.min_by(|a, b| a.whole.total_cmp(&b.whole)).expect("three of them")
}
