//! A progress bar for what takes over a second, and Ctrl-C.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Mutex, OnceLock};
use std::thread::JoinHandle;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::error::{Error, Result};
use crate::fit::Monitor;

/// Set by the first Ctrl-C; the second ends the process.
static STOPPED: AtomicBool = AtomicBool::new(false);
/// Set some time later, where the command has not ended by then.
static HALTED: AtomicBool = AtomicBool::new(false);
/// Whether what goes on has nothing to keep before its end.
static AT_ONCE: AtomicBool = AtomicBool::new(false);
static HANDLER: OnceLock<()> = OnceLock::new();
/// The bar that a message must not be written into.
static BAR: Mutex<Option<ProgressBar>> = Mutex::new(None);

/// Exit code after a second Ctrl-C: 128 and the number of the signal.
const INTERRUPTED: i32 = 130;
/// What is nearly done when the signal comes is brought to its end within this time.
const GRACE: Duration = Duration::from_millis(700);
/// Shorter work shows no bar.
const PATIENCE: Duration = Duration::from_secs(1);
const STEPS: u64 = 1000;

/// Shows how far a computation has come, and asks it to stop on Ctrl-C.
pub(super) struct Progress {
    bar: ProgressBar,
    end: Option<Sender<()>>,
    shower: Option<JoinHandle<()>>,
}

impl Progress {
    pub(super) fn new() -> Self {
        HANDLER.get_or_init(|| {
            // Without a handler Ctrl-C ends the process at once, as it would anyway.
            let _ = ctrlc::set_handler(|| {
                let again = STOPPED.swap(true, Ordering::Relaxed);
                if again || AT_ONCE.load(Ordering::Relaxed) {
                    std::process::exit(INTERRUPTED);
                }
                std::thread::spawn(|| {
                    std::thread::sleep(GRACE);
                    HALTED.store(true, Ordering::Relaxed);
                });
                let say =
                    || eprintln!("\nStopping with the best so far; Ctrl-C again ends at once.");
                match BAR.lock().ok().and_then(|bar| bar.clone()) {
                    Some(bar) => bar.suspend(say),
                    None => say(),
                }
            });
        });
        let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template("{bar:30} {percent:>3} %  {elapsed}  {msg}")
        {
            bar.set_style(style);
        }
        if let Ok(mut shown) = BAR.lock() {
            *shown = Some(bar.clone());
        }
        let (end, ended) = channel();
        let shower = std::io::stderr().is_terminal().then(|| {
            let bar = bar.clone();
            std::thread::spawn(move || {
                if ended.recv_timeout(PATIENCE) == Err(std::sync::mpsc::RecvTimeoutError::Timeout) {
                    bar.set_draw_target(ProgressDrawTarget::stderr());
                    bar.enable_steady_tick(Duration::from_millis(200));
                }
            })
        });
        Progress { bar, end: Some(end), shower }
    }
}

impl Progress {
    /// What follows has nothing to keep before its end: the next Ctrl-C ends the process.
    ///
    /// # Errors
    ///
    /// There was one already.
    pub(super) fn nothing_to_keep(&self) -> Result<()> {
        AT_ONCE.store(true, Ordering::Relaxed);
        if self.stopped() { Err(Error::Interrupted) } else { Ok(()) }
    }
}

impl Monitor for Progress {
    fn stage(&self, what: &str, fraction: f64) {
        self.bar.set_message(what.to_string());
        self.bar.set_position((fraction.clamp(0.0, 1.0) * STEPS as f64) as u64);
    }

    fn stopped(&self) -> bool {
        STOPPED.load(Ordering::Relaxed)
    }

    fn halted(&self) -> bool {
        HALTED.load(Ordering::Relaxed)
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        drop(self.end.take());
        if let Some(shower) = self.shower.take() {
            let _ = shower.join();
        }
        if let Ok(mut shown) = BAR.lock() {
            *shown = None;
        }
        AT_ONCE.store(false, Ordering::Relaxed);
        self.bar.finish_and_clear();
    }
}
