//! The studio: a spec, its pictures and its doubts in a browser, on this machine only.
//!
//! A page asks ([`routes`]) behind a [`guard`]; one thread works ([`worker`]); what is known
//! stands on a [`board`] from which the page reads whatever is new. All state that matters lies
//! in the same files that the commands use.

mod archive;
mod board;
mod engine;
mod files;
mod guard;
mod jobs;
mod routes;
mod server;
mod wire;
mod worker;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::error::{Error, ErrorKind, Result};
use crate::project::page::Reproduce;
use board::StatusBoard;
use engine::Engine;
use guard::Guard;
use jobs::JobQueue;

/// What a studio is started with.
pub(crate) struct StudioOptions {
    /// The spec.
    pub spec: PathBuf,
    /// 0 takes one that is free.
    pub port: u16,
    /// How a report says that it is made again.
    pub reproduce: Reproduce,
}

/// What the page, its routes and the worker share.
pub(crate) struct Studio {
    /// The spec.
    path: PathBuf,
    reproduce: Reproduce,
    guard: Guard,
    board: StatusBoard,
    jobs: JobQueue,
    /// The model with all that is known of it; none before the first was learned.
    held: std::sync::Mutex<Option<Arc<engine::LearnedState>>>,
}

impl Studio {
    /// What is known now. A thread that panicked while it held the lock left it whole: it is
    /// only ever replaced.
    fn held(&self) -> Option<Arc<engine::LearnedState>> {
        self.held.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).clone()
    }

    fn hold(&self, held: Option<Arc<engine::LearnedState>>) {
        *self.held.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) = held;
    }
}

/// Serves until the process ends. `ready` is told the address, token and all, as soon as the
/// page can be opened.
///
/// # Errors
/// The spec cannot be read (it may well have errors), or the port is taken.
pub(crate) fn serve(options: &StudioOptions, ready: impl FnOnce(&str)) -> Result<()> {
    let path = options.spec.clone();
    files::read_spec(&path)?;
    let listener = server::listen(options.port)?;
    let port = listener.local_addr().map_err(|error| server_error(&error))?.port();
    let studio = Arc::new(Studio {
        guard: Guard::new(port)?,
        board: StatusBoard::new(),
        jobs: JobQueue::new(),
        held: std::sync::Mutex::new(None),
        path,
        reproduce: options.reproduce,
    });
    let address = format!("http://127.0.0.1:{port}/#{}", studio.guard.token());
    let engine = Engine::new(Arc::clone(&studio))?;
    std::thread::Builder::new()
        .name("worker".to_string())
        .spawn(move || worker::run(engine))
        .map_err(|error| server_error(&error))?;
    server::run(listener, studio, || ready(&address))
}

fn server_error(error: &std::io::Error) -> Error {
    Error::new(
        ErrorKind::System,
        format!("the studio cannot serve: {error}"),
        "start it again, or at another port",
    )
}

/// The name of a file without its folder.
fn name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}
