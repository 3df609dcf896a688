//! Progress and interruption: how a long computation talks to whoever started it.

use std::sync::atomic::{AtomicBool, Ordering};

/// What a long computation reports to and asks.
pub trait Monitor: Sync {
    /// A stage begins: a few words, and how far the whole has come (0 to 1).
    fn stage(&self, what: &str, fraction: f64);

    /// A pass over data larger than memory is done: transitions, and seconds that they took.
    fn passed(&self, _transitions: u64, _seconds: f64) {}

    /// Whether to stop as soon as there is something to keep.
    fn stopped(&self) -> bool {
        false
    }
}

/// Reports nothing and never stops.
pub struct Silent;

impl Monitor for Silent {
    fn stage(&self, _: &str, _: f64) {}
}

/// Stops when the flag is raised, by a Ctrl-C handler for one.
pub struct Flag<'a>(pub &'a AtomicBool);

impl Monitor for Flag<'_> {
    fn stage(&self, _: &str, _: f64) {}

    fn stopped(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
