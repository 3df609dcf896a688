//! What is known, part by part, each with the version at which it last changed.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use serde::Serialize;
use tokio::sync::watch;

/// Parts as JSON texts. Whoever has read up to a version is given what came later.
pub(super) struct StatusBoard {
    parts: Mutex<BTreeMap<&'static str, (u64, Arc<str>)>>,
    version: watch::Sender<u64>,
}

impl StatusBoard {
    pub(super) fn new() -> Self {
        StatusBoard { parts: Mutex::new(BTreeMap::new()), version: watch::Sender::new(0) }
    }

    /// Puts a part up. What is as it was keeps its version.
    pub(super) fn post(&self, name: &'static str, part: &impl Serialize) {
        let Ok(text) = serde_json::to_string(part) else { return };
        let mut parts = self.parts.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        if parts.get(name).is_some_and(|(_, old)| **old == *text) {
            return;
        }
        // Under the lock, so that nobody reads the version without the part.
        self.version.send_modify(|version| {
            *version += 1;
            parts.insert(name, (*version, text.into()));
        });
    }

    /// `{"version": ..., "parts": {...}}` of what changed after a version.
    pub(super) fn since(&self, seen: u64) -> String {
        let parts = self.parts.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let mut out = format!("{{\"version\":{},\"parts\":{{", *self.version.borrow());
        let mut first = true;
        for (name, (version, text)) in parts.iter() {
            if *version > seen {
                out += if first { "" } else { "," };
                out += &format!("\"{name}\":{text}");
                first = false;
            }
        }
        out + "}}"
    }

    /// Waits for a version after `seen`.
    pub(super) async fn after(&self, seen: u64) {
        // The sender lives as long as the board, so there is no error.
        let _ = self.version.subscribe().wait_for(|version| *version != seen).await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_changed_is_told() {
        let board = StatusBoard::new();
        board.post("a", &1);
        board.post("b", &"x");
        assert_eq!(board.since(0), r#"{"version":2,"parts":{"a":1,"b":"x"}}"#);
        board.post("a", &1);
        assert_eq!(board.since(2), r#"{"version":2,"parts":{}}"#);
        board.post("a", &2);
        assert_eq!(board.since(2), r#"{"version":3,"parts":{"a":2}}"#);
    }
}
