//! Files and folders under names of their own, beside those that they are meant for. What a killed
//! program leaves of them is swept by the next one that writes there.
//!
//! Whoever makes one holds a lock of the operating system on it, which the system gives back where
//! a process ends, however it ends. So what nobody holds is left over.

use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// How names of temporary files begin; the number of the process and a number of its own follow.
const PREFIX: &str = ".leverrier-";
/// Names that are tried: so many would have to be in use by this process at once.
const NAMES: u32 = 10_000;
/// The file in a temporary folder that is locked in the folder's place.
const MARK: &str = "lock";
/// The folder in a temporary folder that gets the name it is meant for.
const INSIDE: &str = "inside";

/// A file which goes away unless it gets the name that it is meant for.
pub(super) struct TemporaryFile {
    path: PathBuf,
    pub file: File,
    renamed: bool,
}

impl TemporaryFile {
    pub(super) fn create(folder: &Path) -> io::Result<Self> {
        let make = |path: &Path| Ok((path.to_path_buf(), File::create_new(path)?));
        let (path, file) = named(folder, make)?;
        Ok(TemporaryFile { path, file, renamed: false })
    }

    pub(super) fn rename(mut self, target: &Path) -> io::Result<()> {
        fs::rename(&self.path, target)?;
        self.renamed = true;
        Ok(())
    }
}

impl Drop for TemporaryFile {
    fn drop(&mut self) {
        if !self.renamed {
            // What cannot be removed is left: there is nobody to tell.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// A folder which goes away with all that is left in it.
pub(super) struct TemporaryFolder {
    path: PathBuf,
    /// The lock.
    _mark: File,
}

impl TemporaryFolder {
    pub(super) fn create(parent: &Path) -> io::Result<Self> {
        let make = |path: &Path| {
            fs::create_dir(path)?;
            let mark = path.join(MARK);
            match File::create_new(&mark) {
                Ok(file) => Ok((mark, file)),
                // Swept before it was locked, and perhaps a file of another thread by now: as good
                // as a name that is taken.
                Err(error)
                    if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) =>
                {
                    Err(io::Error::from(ErrorKind::AlreadyExists))
                }
                Err(error) => {
                    let _ = fs::remove_dir(path);
                    Err(error)
                }
            }
        };
        let (mark, file) = named(parent, make)?;
        let path = mark.parent().map_or_else(PathBuf::new, Path::to_path_buf);
        Ok(TemporaryFolder { path, _mark: file })
    }

    /// The folder to be written and renamed; it is not there yet.
    pub(super) fn inside(&self) -> PathBuf {
        self.path.join(INSIDE)
    }
}

impl Drop for TemporaryFolder {
    fn drop(&mut self) {
        remove_folder(&self.path);
    }
}

/// Removes a temporary folder, its lock after all else: where that is cut short, the rest can still
/// be told for what it is.
fn remove_folder(path: &Path) {
    let _ = fs::remove_dir_all(path.join(INSIDE));
    let _ = fs::remove_file(path.join(MARK));
    let _ = fs::remove_dir(path);
}

/// Makes something in a folder under a name that nothing has yet, and holds its lock; `make` gives
/// the file that is locked.
fn named(
    folder: &Path,
    make: impl Fn(&Path) -> io::Result<(PathBuf, File)>,
) -> io::Result<(PathBuf, File)> {
    sweep(folder);
    let mut taken = io::Error::from(ErrorKind::AlreadyExists);
    for number in 0..NAMES {
        let path = folder.join(format!("{PREFIX}{}-{number}", std::process::id()));
        match make(&path) {
            // Where a file system takes no locks, nothing is swept either.
            Ok((locked, file)) if !can_remove() || file.lock().is_err() => {
                return Ok((locked, file));
            }
            Ok((locked, file)) if is_at(&file, &locked) => return Ok((locked, file)),
            // Swept in the moment before it was locked.
            Ok(_) => {}
            Err(error) if error.kind() == ErrorKind::AlreadyExists => taken = error,
            Err(error) => return Err(error),
        }
    }
    Err(taken)
}

/// Removes the temporary files and folders that killed programs left in a folder. What cannot be
/// looked at or removed stays: it is in nobody's way.
fn sweep(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten().filter(|entry| can_remove() && is_ours(&entry.file_name())) {
        let (path, Ok(kind)) = (entry.path(), entry.file_type()) else { continue };
        let lock = if kind.is_dir() { path.join(MARK) } else { path.clone() };
        match fs::symlink_metadata(&lock) {
            Ok(about) if about.is_file() => {
                let Ok(file) = File::open(&lock) else { continue };
                if file.try_lock().is_err() || !is_at(&file, &lock) {
                    continue;
                }
                match kind.is_dir() {
                    true => remove_folder(&path),
                    false => drop(fs::remove_file(&path)),
                }
            }
            // Killed before there was a lock: only a folder with nothing in it is removed so.
            Err(error) if error.kind() == ErrorKind::NotFound && kind.is_dir() => {
                let _ = fs::remove_dir(&path);
            }
            _ => {}
        }
    }
}

/// Whether a name is one that [`named`] gives.
fn is_ours(name: &std::ffi::OsStr) -> bool {
    let number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    name.to_str()
        .and_then(|name| name.strip_prefix(PREFIX))
        .and_then(|rest| rest.split_once('-'))
        .is_some_and(|(process, own)| number(process) && number(own))
}

/// Whether a name can be taken from a file that is open, and files be told from one another.
pub(crate) const fn can_remove() -> bool {
    cfg!(unix)
}

/// Whether the file is still the one with this name.
#[cfg(unix)]
pub(crate) fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (file.metadata(), fs::metadata(path)) {
        (Ok(own), Ok(there)) => (own.dev(), own.ino()) == (there.dev(), there.ino()),
        _ => false,
    }
}

/// Where files that are open are never removed, a name stays with its file.
#[cfg(not(unix))]
pub(crate) fn is_at(_: &File, _: &Path) -> bool {
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap().flatten();
        let mut names: Vec<String> =
            entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    #[test]
    fn what_is_left_over_is_swept_and_what_is_in_use_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        let (file, temporary) =
            (TemporaryFile::create(path).unwrap(), TemporaryFolder::create(path).unwrap());
        fs::create_dir_all(temporary.inside().join("src")).unwrap();
        fs::write(temporary.inside().join("src/lib.rs"), "code").unwrap();
        let used = names(path);
        assert_eq!(used.len(), 2, "{used:?}");
        // What processes of other numbers left, at every stage of their work.
        fs::write(path.join(".leverrier-1-0"), "half a fi").unwrap();
        fs::create_dir(path.join(".leverrier-1-1")).unwrap();
        fs::create_dir_all(path.join(".leverrier-1-2/inside/src")).unwrap();
        fs::write(path.join(".leverrier-1-2/inside/src/main.rs"), "half").unwrap();
        fs::write(path.join(".leverrier-1-2/lock"), "").unwrap();
        // What only looks alike.
        let others = [".leverrier-notes", ".leverrier-1-x", ".leverrier-1", "leverrier-1-0"];
        others.iter().for_each(|name| fs::write(path.join(name), "").unwrap());
        fs::create_dir(path.join(".leverrier-1-3")).unwrap();
        fs::write(path.join(".leverrier-1-3/mine"), "").unwrap();
        sweep(path);
        let mut kept: Vec<String> = others.iter().map(|name| name.to_string()).collect();
        kept.push(".leverrier-1-3".to_string());
        kept.extend(used);
        kept.sort();
        assert!(!can_remove() || names(path) == kept, "{:?}", names(path));
        assert!(temporary.inside().join("src/lib.rs").exists());
        file.rename(&path.join("whole")).unwrap();
        drop(temporary);
        assert!(path.join("whole").exists());
        let left = names(path);
        assert_eq!(left.iter().filter(|name| is_ours(name.as_str().as_ref())).count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn threads_that_sweep_take_nothing_from_each_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        std::thread::scope(|scope| {
            for thread in 0..4 {
                scope.spawn(move || {
                    for turn in 0..100 {
                        let temporary = TemporaryFolder::create(path).unwrap();
                        fs::create_dir(temporary.inside()).unwrap();
                        let target = path.join(format!("folder-{thread}-{turn}"));
                        fs::rename(temporary.inside(), target).unwrap();
                        let file = TemporaryFile::create(path).unwrap();
                        file.rename(&path.join(format!("{thread}-{turn}"))).unwrap();
                    }
                });
            }
        });
        assert_eq!(names(path).len(), 800);
    }
}
