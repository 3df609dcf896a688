//! In the place of Parquet where the feature is off: its files are known, and refused.

use std::path::Path;

use super::table::{Table, wrong};
use super::{Dataset, Layout};
use crate::error::{Error, ErrorKind, Result};

/// The first bytes of a Parquet file.
pub(super) const MAGIC: &[u8] = b"PAR1";

fn refused<T>(path: &Path) -> Result<T> {
    Err(wrong(
        path,
        None,
        None,
        "this is a Parquet file, and Parquet is left out of this program",
        "build it with the feature `parquet`, or save the file as CSV",
    ))
}

pub(super) fn read(path: &Path) -> Result<Table> {
    refused(path)
}

pub(super) fn read_bytes(path: &Path, _: &[u8]) -> Result<Table> {
    refused(path)
}

pub(super) fn to_parquet(path: &Path, _: &Dataset, _: &Layout) -> Result<Vec<u8>> {
    Err(Error::new(
        ErrorKind::NotBuiltIn,
        format!(
            "{} would be a Parquet file, and Parquet is left out of this program",
            path.display()
        ),
        "build it with the feature `parquet`, or choose a name that ends in .csv",
    ))
}

/// There are none: no file is opened.
pub(super) enum Blocks {}

impl Blocks {
    pub(super) fn open(path: &Path) -> Result<Blocks> {
        refused(path)
    }

    pub(super) fn headers(&self) -> Table {
        match *self {}
    }

    pub(super) fn rows(&self) -> u64 {
        match *self {}
    }

    pub(super) fn only(&mut self, _: impl Fn(&super::Column) -> bool) {
        match *self {}
    }

    pub(super) fn next(&mut self, _: usize) -> Result<Option<Table>> {
        match *self {}
    }

    pub(super) fn fraction(&self) -> f64 {
        match *self {}
    }
}
