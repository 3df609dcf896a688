//! `leverrier new`
use super::console::Console;
use crate::error::Result;
/// New.
#[derive(clap::Args)]
pub struct Arguments {}
pub fn run(_: &Arguments, _: &Console) -> Result<()> {
    Ok(())
}
