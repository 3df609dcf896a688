//! The ledger: every revision of a spec, in a file beside it.

use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use crate::data::write_atomically;
use crate::error::{Error, Result};
use crate::facade::checked::Problems;

const FORMAT: &str = "leverrier.ledger/2";
/// Formats that are read. In the first, errors on held-out runs were called `unseen_error`.
const READ: [&str; 2] = ["leverrier.ledger/1", FORMAT];
/// The action of a revision that no command made.
pub(crate) const BY_HAND: &str = "edited by hand";

/// Error of a model on held-out runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HeldOutErrors {
    /// Root mean square in units of the noise, over `samples` at a time; null without held-out
    /// runs.
    #[serde(alias = "unseen_error")]
    pub held_out_error: Option<f64>,
    /// What `held_out_error` is when only noise is left: 1.
    pub noise_floor: f64,
    /// Length of the predictions that `held_out_error` is of.
    pub samples: usize,
    /// (samples, error) at every length of prediction.
    pub horizons: Vec<(usize, f64)>,
    /// The unit of the errors: observable and standard deviation of its noise.
    #[serde(default)]
    pub noise: Vec<(String, f64)>,
}

impl HeldOutErrors {
    /// Where nothing is held out.
    pub(crate) fn unknown() -> Self {
        HeldOutErrors {
            held_out_error: None,
            noise_floor: 1.0,
            samples: 0,
            horizons: Vec::new(),
            noise: Vec::new(),
        }
    }
}

/// A state of the spec.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Revision {
    /// `start`, `add viscous_drag(theta)`, `remove ...`.
    pub action: String,
    /// Seconds since 1970, UTC.
    pub time: u64,
    /// The spec after the action.
    pub spec: String,
    /// Whether it was taken back.
    pub undone: bool,
    /// Before and after the action; null for the start.
    pub before: Option<HeldOutErrors>,
    /// As `before`.
    pub after: Option<HeldOutErrors>,
}

/// All revisions of a spec, oldest first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Ledger {
    /// Always `leverrier.ledger/2`.
    pub format: String,
    /// Oldest first.
    pub revisions: Vec<Revision>,
}

impl Ledger {
    /// `pendulum.ham` has its ledger in `pendulum.ledger.json`.
    pub(crate) fn path(spec: &Path) -> PathBuf {
        spec.with_extension("ledger.json")
    }

    /// The ledger of a spec; an empty one where there is none yet.
    ///
    /// # Errors
    /// It cannot be read, or is damaged.
    pub fn open(spec: &Path) -> Result<Self> {
        let path = Self::path(spec);
        let bytes = match std::fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Ok(Ledger { format: FORMAT.to_string(), revisions: Vec::new() });
            }
            Err(error) => return Err(Error::file("read", &path, error)),
        };
        let wrong =
            |message: String| Error::model(&path, message, "move it away to begin a new ledger");
        let mut ledger: Ledger = serde_json::from_slice(&bytes)
            .map_err(|error| wrong(format!("this is not a ledger, or it is damaged ({error})")))?;
        if !READ.contains(&ledger.format.as_str()) {
            let found = &ledger.format;
            return Err(wrong(format!("its format is `{found}`, but this version reads {FORMAT}")));
        }
        if let Some(problem) = wrong_in_ledger(&ledger) {
            return Err(wrong(format!("the file is damaged: {problem}")));
        }
        ledger.format = FORMAT.to_string();
        Ok(ledger)
    }

    /// Writes it beside the spec, whole or not at all.
    ///
    /// # Errors
    /// The disk says no.
    pub fn write(&self, spec: &Path) -> Result<()> {
        let path = Self::path(spec);
        let mut bytes = serde_json::to_vec_pretty(self)
            .map_err(|error| Error::file("write", &path, std::io::Error::other(error)))?;
        bytes.push(b'\n');
        write_atomically(&path, &bytes)
    }

    /// The newest revision that was not taken back.
    pub(crate) fn current(&self) -> Option<usize> {
        self.revisions.iter().rposition(|revision| !revision.undone)
    }

    /// Takes the newest revision back; returns what it was, and the text to go back to.
    pub(crate) fn take_back(&mut self) -> Option<(String, String)> {
        let current = self.current()?;
        let previous = self.revisions.iter().take(current).rposition(|r| !r.undone)?;
        let restored = self.revisions.get(previous)?.spec.clone();
        let revision = self.revisions.get_mut(current)?;
        revision.undone = true;
        Some((revision.action.clone(), restored))
    }

    /// Takes note of a spec that is as an earlier revision left it: a command was ended before
    /// it wrote the spec, or between the spec and the ledger. What came later counts as undone.
    ///
    /// Returns what was undone that way, newest first.
    pub(crate) fn recover(&mut self, text: &str) -> Vec<String> {
        let found = self.revisions.iter().rposition(|r| !r.undone && r.spec == text);
        let Some(found) = found else { return Vec::new() };
        let later = self.revisions.iter_mut().skip(found + 1).rev().filter(|r| !r.undone);
        later
            .map(|revision| {
                revision.undone = true;
                revision.action.clone()
            })
            .collect()
    }

    /// Makes sure that a text is what the newest revision has: what was edited by hand since
    /// becomes a revision of its own.
    pub(crate) fn know(&mut self, text: &str) {
        self.recover(text);
        let known = self.current().and_then(|at| self.revisions.get(at));
        if known.is_some_and(|revision| revision.spec == text) {
            return;
        }
        let action = if known.is_none() { "start" } else { BY_HAND };
        self.push(action.to_string(), text.to_string(), None, None);
    }

    /// Adds a revision.
    pub(crate) fn push(
        &mut self,
        action: String,
        spec: String,
        before: Option<HeldOutErrors>,
        after: Option<HeldOutErrors>,
    ) {
        let time = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |past| past.as_secs());
        self.revisions.push(Revision { action, time, spec, undone: false, before, after });
    }
}

/// `2026-11-21 05:31` of seconds since 1970, UTC, by the Gregorian calendar.
pub(crate) fn date(seconds: u64) -> String {
    let leap = |year: u64| {
        year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400))
    };
    let (mut days, minutes) = (seconds / 86_400, seconds / 60 % 1440);
    let mut year = 1970;
    while days >= 365 + u64::from(leap(year)) && year < 9999 {
        days -= 365 + u64::from(leap(year));
        year += 1;
    }
    let february = 28 + u64::from(leap(year));
    let mut month = 1;
    for length in [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30] {
        if days < length {
            break;
        }
        days -= length;
        month += 1;
    }
    format!("{year}-{month:02}-{:02} {:02}:{:02}", days + 1, minutes / 60, minutes % 60)
}

/// The end of the year 9999, in seconds since 1970, UTC.
const LAST_SECOND: u64 = 253_402_300_799;

/// What is wrong with a ledger, in words that go on from "the file is damaged"; none where every
/// field is what its name says.
fn wrong_in_ledger(ledger: &Ledger) -> Option<String> {
    let mut problems = Problems::default();
    for revision in &ledger.revisions {
        problems.line("action", &revision.action);
        let dated = revision.time <= LAST_SECOND;
        problems.require(dated, || "a `time` is no date before the year 10000".to_string());
        for judged in revision.before.iter().chain(&revision.after) {
            for (name, _) in &judged.noise {
                problems.line("noise", name);
            }
        }
    }
    problems.first
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_follow_the_calendar() {
        for (seconds, text) in [
            (0, "1970-01-01 00:00"),
            (951_782_340, "2000-02-28 23:59"),
            (951_868_740, "2000-02-29 23:59"),
            (1_735_689_540, "2024-12-31 23:59"),
            (1_735_689_600, "2025-01-01 00:00"),
        ] {
            assert_eq!(date(seconds), text);
        }
    }

    #[test]
    fn going_back_skips_what_was_taken_back() {
        let mut ledger = Ledger { format: FORMAT.to_string(), revisions: Vec::new() };
        ledger.know("a");
        ledger.know("a");
        ledger.push("add x".into(), "b".into(), None, None);
        ledger.revisions[1].undone = true;
        ledger.push("add y".into(), "c".into(), None, None);
        assert_eq!(ledger.current(), Some(2));
        ledger.know("d");
        assert_eq!(ledger.revisions[3].action, BY_HAND);
        assert_eq!(ledger.take_back(), Some((BY_HAND.to_string(), "c".to_string())));
        assert_eq!(ledger.take_back(), Some(("add y".to_string(), "a".to_string())));
        assert_eq!(ledger.take_back(), None);
    }

    #[test]
    fn ledgers_of_the_first_format_are_read_and_written_as_the_second() {
        let folder = tempfile::tempdir().unwrap();
        let spec = folder.path().join("swings.ham");
        let old = r#"{"format": "leverrier.ledger/1", "revisions": [
            {"action": "start", "time": 1, "spec": "a", "undone": false,
             "before": null, "after": null},
            {"action": "add x", "time": 2, "spec": "b", "undone": false, "before":
             {"unseen_error": 9.5, "noise_floor": 1.0, "samples": 8, "horizons": [[8, 9.5]]},
             "after": null}]}"#;
        std::fs::write(Ledger::path(&spec), old).unwrap();
        let ledger = Ledger::open(&spec).unwrap();
        let before = ledger.revisions[1].before.as_ref().unwrap();
        assert_eq!(before.held_out_error, Some(9.5));
        ledger.write(&spec).unwrap();
        let written = std::fs::read_to_string(Ledger::path(&spec)).unwrap();
        assert!(written.contains(FORMAT) && written.contains("\"held_out_error\": 9.5"));
        assert_eq!(Ledger::open(&spec).unwrap(), ledger);
    }

    #[test]
    fn a_spec_that_is_as_it_was_earlier_takes_the_rest_back() {
        let mut ledger = Ledger { format: FORMAT.to_string(), revisions: Vec::new() };
        for (action, text) in [("start", "a"), ("add x", "b"), ("add y", "c")] {
            ledger.push(action.into(), text.into(), None, None);
        }
        assert!(ledger.recover("c").is_empty() && ledger.recover("unknown").is_empty());
        assert_eq!(ledger.recover("a"), ["add y", "add x"]);
        assert_eq!(ledger.current(), Some(0));
    }
}
