//! Real measurements, which are not part of the project.

use std::path::{Path, PathBuf};

/// A file of real measurements, if it is there: in `data` below the folder that the
/// variable `LEVERRIER_SHARED` names, or below a folder `shared` beside the checkout (or
/// beside the folder that holds it).
pub(crate) fn shared_data(name: &str) -> Option<PathBuf> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let named = std::env::var_os("LEVERRIER_SHARED").map(PathBuf::from);
    let beside = here.ancestors().skip(1).take(2).map(|at| at.join("shared"));
    let found = named
        .into_iter()
        .chain(beside)
        .map(|folder| folder.join("data").join(name))
        .find(|path| path.is_file());
    if found.is_none() {
        println!("{name} is absent; set LEVERRIER_SHARED to the folder that has data/{name}");
    }
    found
}
