//! The files of a folder: what they hold, whether they changed, and which may be read.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::data::file_of;
use crate::error::{Error, ErrorKind, Result};
use crate::project::{Spec, digest};

/// Larger specs are not taken from the page, nor shown in it.
pub(super) const LARGEST: usize = 1 << 20;

/// The text of a spec, which need not compile.
pub(super) fn read_spec(path: &Path) -> Result<String> {
    let failed = |error| Error::file("read", path, error);
    let about = std::fs::metadata(path).map_err(failed)?;
    if !about.is_file() || about.len() > LARGEST as u64 {
        let message = "the studio shows specs that are files of at most 1 MB";
        return Err(failed(std::io::Error::other(message)));
    }
    std::fs::read_to_string(path).map_err(failed)
}

/// SHA-256 of a text in hexadecimal digits.
pub(super) fn hash(text: &str) -> String {
    digest(Path::new(""), text.as_bytes()).sha256
}

/// When files were written last, and how long they are: enough to look closer.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct FileStamps(Vec<Option<(SystemTime, u64)>>);

impl FileStamps {
    /// Of a spec, its model, its ledger and its data.
    pub(super) fn of(spec: &Path, data: &[PathBuf]) -> FileStamps {
        let stamp = |path: &Path| {
            let about = std::fs::metadata(path).ok()?;
            Some((about.modified().ok()?, about.len()))
        };
        let beside = ["model.json", "ledger.json"].map(|end| spec.with_extension(end));
        let data = data.iter().map(|path| file_of(path));
        let own = [spec.to_path_buf()].into_iter().chain(beside);
        FileStamps(own.chain(data).map(|path| stamp(&path)).collect())
    }
}

/// Which data may be read: what the spec named when the studio was started, and what lies in
/// its folder. A text that is typed into a page gets no farther.
pub(super) struct AllowedFolder {
    folder: PathBuf,
    first: Vec<PathBuf>,
}

impl AllowedFolder {
    pub(super) fn new(spec: &Path) -> AllowedFolder {
        let folder = match spec.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let first = Spec::open(spec).and_then(|spec| spec.data_files(None)).unwrap_or_default();
        AllowedFolder {
            folder: folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf()),
            first: first.iter().filter_map(|path| file_of(path).canonicalize().ok()).collect(),
        }
    }

    /// # Errors
    /// The data lie elsewhere.
    pub(super) fn check(&self, spec: &Spec) -> Result<()> {
        // A name for which there is no file, or a file that is not there, is for the reader to
        // complain about, if it were inside.
        let names = spec.named(None).unwrap_or_default();
        let paths = spec.data_files(None);
        let paths = paths.unwrap_or_else(|_| names.into_iter().map(|name| name.path).collect());
        if paths.iter().all(|path| self.holds(&file_of(path))) {
            return Ok(());
        }
        Err(Error::new(
            ErrorKind::Forbidden,
            "the data lie outside the spec's folder, where the studio does not read",
            "copy them beside the spec, or start the studio anew with the spec as it is",
        ))
    }

    fn holds(&self, path: &Path) -> bool {
        let real = path.canonicalize().or_else(|_| match (path.parent(), path.file_name()) {
            (Some(parent), Some(name)) => parent.canonicalize().map(|parent| parent.join(name)),
            _ => Ok(path.to_path_buf()),
        });
        real.is_ok_and(|path| path.starts_with(&self.folder) || self.first.contains(&path))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_elsewhere_are_not_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let inner = folder.path().join("inner");
        std::fs::create_dir(&inner).expect("a folder");
        std::fs::write(folder.path().join("out.csv"), "t,q,p\n").expect("written");
        let spec = inner.join("s.ham");
        let text = |data: &str| {
            format!("coordinates q; momenta p\ndata \"{data}\" {{ time t }}\nT = p^2/2\nV = q^2\n")
        };
        let write = |data: &str| std::fs::write(&spec, text(data)).expect("written");
        let pass =
            |allowed: &AllowedFolder| allowed.check(&Spec::open(&spec).expect("a spec")).is_ok();
        write("in.csv");
        let allowed = AllowedFolder::new(&spec);
        assert!(pass(&allowed));
        write("../out.csv");
        assert!(!pass(&allowed) && pass(&AllowedFolder::new(&spec)));
        write("/etc/hostname");
        assert!(!pass(&allowed));
        write("../missing.csv");
        assert!(!pass(&allowed));
        // What is named behind a # does not lead out of the folder either.
        write("in.mat#swings");
        assert!(pass(&allowed));
        write("../out.mat#swings");
        assert!(!pass(&allowed));
        write("in.mat#/../../out.csv");
        assert!(pass(&allowed));
    }
}
