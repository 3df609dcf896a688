//! `leverrier studio`: the same in the browser.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use serde_json::json;
use tempfile::NamedTempFile;

use super::console::Console;
use super::report::reproduce;
use crate::error::Result;
use crate::studio::{StudioOptions, serve};

/// Work on a spec in the browser: see where it fails, add what is missing, undo, export.
///
/// The page is served to this machine alone, at an address with a secret in it. It works on the
/// same files as the other commands, which may be used at the same time. Ctrl-C ends it; nothing
/// is lost by that, for files are written whole or not at all.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier studio pendulum.ham\n  \
    leverrier studio pendulum.ham --port 8321 --no-open")]
pub(super) struct Arguments {
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
pub(super) fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    let options = StudioOptions { spec: arguments.spec.clone(), port: arguments.port, reproduce };
    serve(&options, |address| {
        let object = json!({ "format": "leverrier.studio/1", "address": address });
        let text = format!("{} is open at\n  {address}", arguments.spec.display());
        // A closed standard output is no reason to end: the browser may be open.
        let _ = console.result(&text, &object);
        console.message("Ctrl-C ends the studio.");
        if !arguments.no_open && has_browser() && !opened(address) {
            console.message("No browser could be opened: open the address yourself.");
        }
    })
}

/// Serves the studio of a spec without a word on the console: for tests that send it requests.
/// `ready` is told the address.
///
/// # Errors
/// As those of the command.
pub fn served(spec: &Path, ready: impl FnOnce(&str)) -> Result<()> {
    serve(&StudioOptions { spec: spec.to_path_buf(), port: 0, reproduce }, ready)
}

/// How long a browser may take to start and read where to go.
const STARTING: Duration = Duration::from_secs(60);

/// Opens the address in a browser; whether that went well.
///
/// Everybody on the machine can read the arguments of its programs. So the browser is given a
/// file that only its owner can read, which sends it on to the address with the secret.
fn opened(address: &str) -> bool {
    let Ok(file) = signpost(address) else { return false };
    let done = open::that_detached(file.path()).is_ok();
    std::thread::spawn(move || {
        std::thread::sleep(STARTING);
        drop(file);
    });
    done
}

/// A page that leads to an address; the file is deleted when it is dropped.
fn signpost(address: &str) -> std::io::Result<NamedTempFile> {
    // On Unix these are made so that nobody else can read them.
    let mut file = tempfile::Builder::new().prefix("leverrier-").suffix(".html").tempfile()?;
    write!(
        file,
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n\
         <meta name=\"referrer\" content=\"no-referrer\">\n\
         <meta http-equiv=\"refresh\" content=\"0; url={address}\">\n\
         <title>Leverrier studio</title></head>\n\
         <body><p><a href=\"{address}\">Open the studio</a></p></body></html>\n"
    )?;
    file.flush()?;
    Ok(file)
}

/// Whether there is a screen to open a browser on.
fn has_browser() -> bool {
    let set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    !cfg!(target_os = "linux") || set("DISPLAY") || set("WAYLAND_DISPLAY")
}
