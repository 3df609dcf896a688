//! What was tried, one line of JSON for every time that something was run.

use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// One run of one part of a habit.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Record {
    pub habit: String,
    pub part: String,
    /// Cases; their numbers, which are their seeds, go on from those of earlier lines.
    pub tried: u64,
    /// Cases that went wrong.
    pub found: u64,
    /// Numbers of these.
    pub finds: Vec<u64>,
    pub seconds: f64,
    /// Counts and measures by their names.
    pub figures: Vec<(String, f64)>,
    /// Numbers of which the distribution is asked.
    pub values: Vec<f64>,
}

impl Record {
    pub(crate) fn of(habit: &str, part: &str) -> Self {
        Record { habit: habit.to_string(), part: part.to_string(), ..Record::default() }
    }

    pub(crate) fn figure(&self, name: &str) -> f64 {
        self.figures.iter().filter(|(own, _)| own == name).map(|(_, value)| value).sum()
    }
}

fn path() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/target/reliability.jsonl"))
}

/// All lines so far; one that was cut off is left out.
pub(crate) fn records() -> Vec<Record> {
    let text = std::fs::read_to_string(path()).unwrap_or_default();
    text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect()
}

/// Adds a line.
pub(crate) fn kept(record: &Record) {
    let file = OpenOptions::new().create(true).append(true).open(path());
    let text = serde_json::to_string(record).expect("a record is JSON");
    writeln!(file.expect("the file of results"), "{text}").expect("the file of results");
}
