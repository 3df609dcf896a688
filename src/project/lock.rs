//! One command at a time on a spec: whoever writes its ledger, its text or its model holds a lock.

use std::fs::{File, OpenOptions, TryLockError};
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::data::{can_remove, is_at};
use crate::error::{Error, Result};
use crate::fit::Monitor;

/// How often a command that waits looks whether the other is done.
const LOOK: Duration = Duration::from_millis(50);

/// The lock of a spec, held until it is dropped.
///
/// It is the operating system's, on a file beside the ledger: where a process is killed, the
/// system gives the lock back; a file that is left over locks nothing.
#[must_use]
#[derive(Debug)]
pub(crate) struct Lock {
    /// `None` where the folder or its file system takes no locks: nothing is written there either,
    /// or nobody can be kept out.
    held: Option<(File, PathBuf)>,
}

impl Lock {
    /// `pendulum.ham` has its lock in `pendulum.lock` while a command works on it.
    pub(crate) fn path(spec: &Path) -> PathBuf {
        spec.with_extension("lock")
    }

    /// Takes the lock of a spec. Where another process (or another part of this one) holds it,
    /// `wait` is told so once, and this waits.
    ///
    /// # Errors
    /// The monitor stopped it while it waited.
    pub(crate) fn take(
        spec: &Path,
        monitor: &dyn Monitor,
        wait: impl FnOnce(&str),
    ) -> Result<Self> {
        let path = Self::path(spec);
        let mut wait = Some(wait);
        loop {
            // A lock for nothing would be left in a folder that has no such spec.
            let file = match spec.exists() {
                true => OpenOptions::new().create(true).truncate(false).write(true).open(&path),
                false => return Ok(Lock { held: None }),
            };
            let Ok(file) = file else { return Ok(Lock { held: None }) };
            match file.try_lock() {
                Ok(()) if is_at(&file, &path) => return Ok(Lock { held: Some((file, path)) }),
                // Whoever held it has removed it: it is another file's name now.
                Ok(()) => continue,
                Err(TryLockError::WouldBlock) => {}
                Err(TryLockError::Error(_)) => return Ok(Lock { held: None }),
            }
            if let Some(wait) = wait.take() {
                wait(&format!(
                    "Another command is at work on {}; waiting until it is done.",
                    spec.display()
                ));
            }
            monitor.stage("waiting for another command on this spec", 0.0);
            if monitor.stopped() {
                return Err(Error::Interrupted);
            }
            std::thread::sleep(LOOK);
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        let Some((file, path)) = self.held.take() else { return };
        // Before the lock is given back: nobody else can hold it under this name.
        if can_remove() {
            let _ = std::fs::remove_file(path);
        }
        let _ = file.unlock();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

    use super::*;
    use crate::fit::{Flag, Silent};

    fn spec() -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().expect("a folder");
        let spec = folder.path().join("s.ham");
        std::fs::write(&spec, "coordinates q\n").expect("written");
        (folder, spec)
    }

    #[test]
    fn one_at_a_time_and_nothing_left_behind() {
        let (_folder, spec) = spec();
        let (inside, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    for _ in 0..20 {
                        let lock = Lock::take(&spec, &Silent, |_| {}).expect("a lock");
                        most.fetch_max(inside.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
                        std::thread::yield_now();
                        inside.fetch_sub(1, Ordering::SeqCst);
                        drop(lock);
                    }
                });
            }
        });
        assert_eq!(most.into_inner(), 1);
        assert!(!can_remove() || !Lock::path(&spec).exists());
    }

    #[test]
    fn who_waits_is_told_once_and_can_give_up() {
        let (_folder, spec) = spec();
        let _lock = Lock::take(&spec, &Silent, |_| {}).expect("a lock");
        let (stopped, mut told) = (AtomicBool::new(true), Vec::new());
        let second = Lock::take(&spec, &Flag(&stopped), |what| told.push(what.to_string()));
        assert!(matches!(second, Err(Error::Interrupted)));
        assert!(told.len() == 1 && told[0].contains("s.ham"), "{told:?}");
    }

    #[test]
    fn a_file_that_was_left_over_locks_nothing() {
        let (_folder, spec) = spec();
        std::fs::write(Lock::path(&spec), "").expect("written");
        let told = |what: &str| panic!("{what}");
        drop(Lock::take(&spec, &Silent, told).expect("a lock"));
        let nowhere = Path::new("no such folder/s.ham");
        drop(Lock::take(nowhere, &Silent, told).expect("no lock is needed"));
    }
}
