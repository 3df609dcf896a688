//! Progress and interruption: how a long computation talks to whoever started it.

use std::sync::atomic::{AtomicBool, Ordering};

/// What a long computation reports to and asks.
///
/// ```
/// use leverrier::{Monitor, Options, Spec};
///
/// struct Bar;
///
/// impl Monitor for Bar {
///     fn stage(&self, what: &str, fraction: f64) {
///         eprintln!("{:3.0} % {what}", 100.0 * fraction);
///     }
/// }
///
/// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
/// let law = spec.fit_monitored(&spec.data()?, &Options::default(), &Bar)?;
/// # assert_eq!(law.terms().len(), 1);
/// # Ok::<(), leverrier::Error>(())
/// ```
pub trait Monitor: Sync {
    /// A stage begins: a few words, and how far the whole has come (0 to 1).
    fn stage(&self, what: &str, fraction: f64);

    /// A pass over data larger than memory is done: transitions, and seconds that they took.
    fn passed(&self, _transitions: u64, _seconds: f64) {}

    /// Whether to stop as soon as there is something to keep.
    fn stopped(&self) -> bool {
        false
    }

    /// Whether to stop at once: passes over the data end where they are, and what they would have
    /// said is not looked at. Only where [`stopped`](Monitor::stopped) is true, too, and from then
    /// on for good.
    fn halted(&self) -> bool {
        false
    }
}

/// Reports nothing and never stops.
///
/// ```
/// use leverrier::{Monitor, Silent};
///
/// assert!(!Silent.stopped());
/// ```
pub struct Silent;

impl Monitor for Silent {
    fn stage(&self, _: &str, _: f64) {}
}

/// Stops when the flag is raised, by a Ctrl-C handler for one.
///
/// ```
/// use std::sync::atomic::{AtomicBool, Ordering};
///
/// use leverrier::{Flag, Monitor};
///
/// let raised = AtomicBool::new(false);
/// raised.store(true, Ordering::Relaxed);
/// assert!(Flag(&raised).stopped());
/// ```
pub struct Flag<'a>(pub &'a AtomicBool);

impl Monitor for Flag<'_> {
    fn stage(&self, _: &str, _: f64) {}

    fn stopped(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
