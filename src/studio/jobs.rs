//! What the worker is asked to do: one thing that changes files at a time.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard};
use std::time::Duration;

use serde::Deserialize;

/// A request of the user.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case")]
pub(super) enum JobRequest {
    /// Learn the spec as `leverrier fit` does.
    Learn,
    /// Write the text into the spec, if it still is as `base` (a SHA-256) says; then learn.
    Save { text: String, base: String, learn: bool },
    /// Add an effect.
    Add { effect: String },
    /// Remove an effect or a named term.
    Remove { effect: String },
    /// Take the last revision back; `force` also if the spec was edited since.
    Undo { force: bool },
    /// Ask what is missing, after that was cancelled.
    Diagnose,
}

/// The request that waits or is being carried out, and whether it is to be given up.
pub(super) struct JobQueue {
    state: Mutex<State>,
    arrived: Condvar,
    cancelled: AtomicBool,
    /// Whether a request waits: work in the background makes way for it.
    waiting: AtomicBool,
}

#[derive(Default)]
struct State {
    next: Option<JobRequest>,
    busy: bool,
}

impl JobQueue {
    pub(super) fn new() -> Self {
        JobQueue {
            state: Mutex::new(State::default()),
            arrived: Condvar::new(),
            cancelled: AtomicBool::new(false),
            waiting: AtomicBool::new(false),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    /// Takes a request, or refuses it while another waits or is worked on.
    pub(super) fn ask(&self, request: JobRequest) -> bool {
        let mut state = self.state();
        if state.busy || state.next.is_some() {
            return false;
        }
        self.cancelled.store(false, Ordering::Relaxed);
        self.waiting.store(true, Ordering::Relaxed);
        state.next = Some(request);
        self.arrived.notify_all();
        true
    }

    /// Gives up what is being done.
    pub(super) fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// The next request, if one comes in time. It is busy until [`JobQueue::done`].
    pub(super) fn next(&self, patience: Duration) -> Option<JobRequest> {
        let state = self.state();
        let waited = self.arrived.wait_timeout_while(state, patience, |state| state.next.is_none());
        let (mut state, _) = waited.unwrap_or_else(|poisoned| poisoned.into_inner());
        let request = state.next.take()?;
        state.busy = true;
        self.waiting.store(false, Ordering::Relaxed);
        Some(request)
    }

    pub(super) fn done(&self) {
        self.state().busy = false;
        self.cancelled.store(false, Ordering::Relaxed);
    }

    /// Whether what is being done was given up; in the background also when a request waits.
    pub(super) fn stopped(&self, background: bool) -> bool {
        self.cancelled.load(Ordering::Relaxed) || background && self.waiting.load(Ordering::Relaxed)
    }

    pub(super) fn is_waiting(&self) -> bool {
        self.waiting.load(Ordering::Relaxed)
    }

    /// Forgets that the background's work was given up.
    pub(super) fn forget(&self) {
        self.cancelled.store(false, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_request_at_a_time() {
        let jobs = JobQueue::new();
        assert!(jobs.ask(JobRequest::Learn) && !jobs.ask(JobRequest::Learn) && jobs.stopped(true));
        assert_eq!(jobs.next(Duration::ZERO), Some(JobRequest::Learn));
        assert!(!jobs.ask(JobRequest::Learn) && !jobs.stopped(true));
        jobs.cancel();
        assert!(jobs.stopped(false));
        jobs.done();
        assert!(!jobs.stopped(true) && jobs.next(Duration::ZERO).is_none());
        assert!(jobs.ask(JobRequest::Undo { force: false }));
    }

    #[test]
    fn requests_are_read() {
        let read = |text| serde_json::from_str::<JobRequest>(text).expect("a request");
        assert_eq!(read(r#"{"do":"learn"}"#), JobRequest::Learn);
        assert_eq!(read(r#"{"do":"undo","force":true}"#), JobRequest::Undo { force: true });
    }
}
