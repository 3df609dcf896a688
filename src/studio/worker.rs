//! The thread that works: requests first, then what the page wants to see of the model.

use std::time::Duration;

use super::engine::Engine;
use super::wire;
use crate::error::{Error, Result};

/// How often it looks whether another program wrote the files.
const LOOK: Duration = Duration::from_millis(700);

/// Works until the process ends.
pub(super) fn run(mut engine: Engine) {
    let mut told = 0;
    let opened = engine.open(true);
    tell(&engine, &mut told, opened.map(|()| String::new()));
    loop {
        let busy = engine.studio.held().is_some() && background(&mut engine, &mut told);
        let patience = if busy { Duration::ZERO } else { LOOK };
        if let Some(request) = engine.studio.jobs.next(patience) {
            engine.studio.board.post("busy", &true);
            let done = engine.carry_out(&request);
            engine.studio.jobs.done();
            engine.studio.board.post("busy", &false);
            tell(&engine, &mut told, done);
        } else if engine.changed() {
            let opened = engine.open(true);
            let what = "The files were changed by another program, and read again.";
            tell(&engine, &mut told, opened.map(|()| what.to_string()));
        }
    }
}

/// One step of what the page wants to see; whether there was one.
fn background(engine: &mut Engine, told: &mut u64) -> bool {
    let stepped = match engine.compare() {
        Ok(false) => engine.diagnose(),
        stepped => stepped,
    };
    engine.studio.jobs.forget();
    stepped.unwrap_or_else(|error| {
        // What failed would fail again.
        engine.diagnosis_cancelled = true;
        let given_up = matches!(error, Error::Interrupted);
        engine.studio.board.post("missing", &wire::undiagnosed("stopped"));
        if !given_up {
            tell(engine, told, Err(error));
        }
        false
    })
}

/// Says what was done, or why not.
fn tell(engine: &Engine, told: &mut u64, done: Result<String>) {
    if engine.studio.jobs.is_waiting() && matches!(done, Err(Error::Interrupted)) {
        return;
    }
    *told += 1;
    let message = match &done {
        Ok(text) if text.is_empty() => return,
        Ok(text) => wire::Message::done(*told, text),
        Err(Error::Interrupted) => wire::Message::done(*told, "Cancelled; nothing was written."),
        Err(error) => wire::Message::failed(*told, error),
    };
    engine.studio.board.post("message", &message);
}
