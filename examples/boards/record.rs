//! What became of a case: a line of a file of comma-separated values, so that a run that was ended
//! goes on where it was.

use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::Path;

use serde::{Deserialize, Serialize};

/// How far a case came.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum State {
    #[serde(rename = "done")]
    Done,
    /// It took more than the limit.
    #[serde(rename = "not finished")]
    NotFinished,
    /// The motion leaves every bound from every start that was drawn.
    #[serde(rename = "not made")]
    NotMade,
    /// It ended in an error.
    #[serde(rename = "failed")]
    Failed,
}

/// One case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Record {
    pub board: String,
    pub system: String,
    /// In parts of each column's spread, in per cent.
    pub noise: f64,
    pub state: State,
    /// "explained", "unexplained" or "too little data".
    pub verdict: String,
    /// Members of the truth that the law has not.
    pub missing: usize,
    /// Members of the law that are not in the truth.
    pub beside: usize,
    /// Those that are missing and stand in a form that is named as explaining as much.
    #[serde(default)]
    pub level: usize,
    /// Whether exactly the missing effects were named; nothing on the board of oscillators.
    pub named: Option<bool>,
    /// Normalised mean squared error on new motions from starts of the same range.
    pub within: Option<f64>,
    /// The same from starts beyond it.
    pub beyond: Option<f64>,
    /// Seconds of processor time, or the limit.
    pub seconds: f64,
    /// What was added.
    pub added: String,
    /// What is missing and what is beside, or why there is no answer.
    pub remark: String,
}

impl Record {
    pub(crate) fn new(board: &str, system: &str, noise: f64, state: State) -> Record {
        Record {
            board: board.to_string(),
            system: system.to_string(),
            noise,
            state,
            verdict: String::new(),
            missing: 0,
            beside: 0,
            level: 0,
            named: None,
            within: None,
            beyond: None,
            seconds: 0.0,
            added: String::new(),
            remark: String::new(),
        }
    }

    /// Whether the law has the terms of the truth and no other.
    pub(crate) fn is_exact(&self) -> bool {
        self.state == State::Done && self.missing == 0 && self.beside == 0
    }

    /// Whether all that it lacks of the truth is named as explaining as much as what it has.
    pub(crate) fn names_the_truth(&self) -> bool {
        self.state == State::Done && self.missing > 0 && self.level == self.missing
    }

    pub(crate) fn is_explained(&self) -> bool {
        self.state == State::Done && self.verdict == "explained"
    }

    /// Whether it is of the same case.
    pub(crate) fn is_of(&self, board: &str, system: &str, noise: f64) -> bool {
        self.board == board && self.system == system && self.noise == noise
    }

    /// Whether there is no use in running it again under a limit.
    pub(crate) fn stands(&self, limit: f64) -> bool {
        self.state != State::NotFinished || self.seconds >= limit
    }

    /// The case in a line for people.
    pub(crate) fn line(&self) -> String {
        let state = match (self.state, self.is_exact()) {
            (State::Done, true) => "the same terms",
            (State::Done, false) => "other terms",
            (State::NotFinished, _) => "not finished",
            (State::NotMade, _) => "not made",
            (State::Failed, _) => "failed",
        };
        let error = |error: Option<f64>| error.map_or("-".to_string(), |e| format!("{e:.1e}"));
        format!(
            "{:<11} {:<6} {:>4} %  {state:<14} {:<15} within {:>7} beyond {:>7} {:>7.1} s  {} | {}",
            self.board,
            self.system,
            self.noise,
            self.verdict,
            error(self.within),
            error(self.beyond),
            self.seconds,
            self.added,
            self.remark,
        )
    }
}

/// The cases of a file; none where there is no file. A line that was cut off is left out, and of
/// two lines of one case the later one counts.
pub(crate) fn records(path: &Path) -> Vec<Record> {
    let Ok(mut reader) = csv::ReaderBuilder::new().flexible(true).from_path(path) else {
        return Vec::new();
    };
    let mut out: Vec<Record> = Vec::new();
    for record in reader.deserialize::<Record>().flatten() {
        out.retain(|other| !other.is_of(&record.board, &record.system, record.noise));
        out.push(record);
    }
    out
}

/// A case as a line of the file, under a header or not.
///
/// # Errors
/// It cannot be written as one.
pub(crate) fn to_line(record: &Record, header: bool) -> Result<String, String> {
    let mut writer = csv::WriterBuilder::new().has_headers(header).from_writer(Vec::new());
    writer.serialize(record).map_err(|error| error.to_string())?;
    let bytes = writer.into_inner().map_err(|error| error.to_string())?;
    String::from_utf8(bytes).map_err(|error| error.to_string())
}

/// The case of a line without a header.
pub(crate) fn from_line(line: &str) -> Option<Record> {
    let reader = csv::ReaderBuilder::new().has_headers(false).from_reader(line.as_bytes());
    reader.into_deserialize::<Record>().next()?.ok()
}

/// Adds a case to a file, which is made where there is none.
///
/// # Errors
/// The file cannot be written.
pub(crate) fn keep(path: &Path, record: &Record) -> Result<(), String> {
    let failed = |error: &dyn std::fmt::Display| {
        format!("{}: {error}; give another file with --results", path.display())
    };
    let old = std::fs::read(path).unwrap_or_default();
    let mut line = to_line(record, old.is_empty()).map_err(|error| failed(&error))?;
    if old.last().is_some_and(|last| *last != b'\n') {
        line.insert(0, '\n');
    }
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(|error| failed(&error))?;
    }
    let file = OpenOptions::new().create(true).append(true).open(path);
    let mut file = file.map_err(|error| failed(&error))?;
    file.write_all(line.as_bytes()).map_err(|error| failed(&error))
}
