//! `leverrier studio`: the same in the browser.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::console::Console;
use crate::error::Result;
use crate::studio::{Options, serve};

/// Work on a spec in the browser: see where it fails, add what is missing, undo, export.
///
/// The page is served to this machine alone, at an address with a secret in it. It works on the
/// same files as the other commands, which may be used at the same time. Ctrl-C ends it; nothing
/// is lost by that, for files are written whole or not at all.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier studio pendulum.ham\n  \
    leverrier studio pendulum.ham --port 8321 --no-open")]
pub struct Arguments {
    /// The spec.
    pub spec: PathBuf,
    /// Port to serve on; by default one that is free.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub port: u16,
    /// Do not open a browser.
    #[arg(long)]
    pub no_open: bool,
}

/// Runs the command.
pub fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    let options = Options { spec: arguments.spec.clone(), port: arguments.port };
    serve(&options, |address| {
        let object = json!({ "format": "leverrier.studio/1", "address": address });
        let text = format!("{} is open at\n  {address}", arguments.spec.display());
        // A closed standard output is no reason to end: the browser may be open.
        let _ = console.result(&text, &object);
        console.message("Ctrl-C ends the studio.");
        if !arguments.no_open && has_browser() && open::that_detached(address).is_err() {
            console.message("No browser could be opened: open the address yourself.");
        }
    })
}

/// Whether there is a screen to open a browser on.
fn has_browser() -> bool {
    let set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    !cfg!(target_os = "linux") || set("DISPLAY") || set("WAYLAND_DISPLAY")
}
