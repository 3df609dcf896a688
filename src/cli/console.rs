//! Where results, messages and errors go.

use std::io::{self, IsTerminal, Write};
use std::path::Path;

use serde_json::{Value, json};

use super::Format;
use crate::diagnostic::Diagnostic;
use crate::error::{Error, ErrorKind, Result};
use crate::project::Listener;

/// More errors than this of one spec are counted rather than shown.
const SHOWN: usize = 20;
/// Longer lines of a spec are not drawn.
const LONGEST_LINE: usize = 400;

/// Standard output for results, standard error for everything else.
pub(super) struct Console {
    format: Format,
}

impl Console {
    pub(super) fn new(format: Format) -> Self {
        Console { format }
    }

    pub(super) fn is_json(&self) -> bool {
        self.format == Format::Json
    }

    /// Columns of the terminal that results are read on; `None` when they go elsewhere.
    pub(super) fn width(&self) -> Option<u16> {
        if !io::stdout().is_terminal() {
            return None;
        }
        comfy_table::Table::new().width()
    }

    /// Prints a result: the text for people, or the object for programs.
    pub(super) fn result(&self, text: &str, object: &Value) -> Result<()> {
        match self.format {
            Format::Text => self.text(text),
            Format::Json => self.text(&pretty(object)),
        }
    }

    /// Writes text to standard output, ending its last line.
    pub(super) fn text(&self, text: &str) -> Result<()> {
        let failed = |error| Error::file("write", Path::new("standard output"), error);
        let mut out = io::stdout().lock();
        let end = if text.is_empty() || text.ends_with('\n') { "" } else { "\n" };
        out.write_all(text.as_bytes())
            .and_then(|()| out.write_all(end.as_bytes()))
            .and_then(|()| out.flush())
            .map_err(failed)
    }

    /// A message beside the result. Programs get none: what matters is in the object.
    pub(super) fn message(&self, text: &str) {
        if self.format == Format::Text {
            self.stderr(text);
        }
    }

    pub(super) fn warning(&self, text: &str) {
        let mark = if coloured() { "\x1b[33mWarning:\x1b[0m" } else { "Warning:" };
        self.message(&format!("{mark} {text}"));
    }

    /// Warnings and notes about a spec.
    pub(super) fn diagnostics(&self, name: &str, text: &str, diagnostics: &[Diagnostic]) {
        for diagnostic in diagnostics.iter().take(SHOWN) {
            self.message(&drawn(diagnostic, name, text));
        }
    }

    pub(super) fn error(&self, error: &Error) {
        if self.format == Format::Json {
            return self.stderr(&pretty(&error_object(error)));
        }
        if let Error::Spec { name, text, diagnostics } = error {
            for diagnostic in diagnostics.iter().take(SHOWN) {
                self.stderr(&drawn(diagnostic, name, text));
            }
            if let Some(more) = diagnostics.len().checked_sub(SHOWN).filter(|more| *more > 0) {
                self.stderr(&format!("and {more} more errors"));
            }
            if !diagnostics.is_empty() {
                return;
            }
        }
        let mark = if coloured() { "\x1b[31mError:\x1b[0m" } else { "Error:" };
        self.stderr(&format!("{mark} {error}"));
    }

    /// Nothing can be done about a standard error that cannot be written.
    fn stderr(&self, text: &str) {
        let _ = writeln!(io::stderr().lock(), "{text}");
    }
}

impl Listener for Console {
    fn diagnostics(&self, name: &str, text: &str, diagnostics: &[Diagnostic]) {
        Console::diagnostics(self, name, text, diagnostics);
    }

    fn warning(&self, text: &str) {
        Console::warning(self, text);
    }
}

/// Whether standard error takes colours: <https://no-color.org>.
pub(super) fn coloured() -> bool {
    let unwanted = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    let dumb = std::env::var_os("TERM").is_some_and(|value| value == "dumb");
    io::stderr().is_terminal() && !unwanted && !dumb
}

/// The command line is wrong: what is wrong, and what to do.
pub(super) fn usage(message: impl Into<String>, hint: impl Into<String>) -> Error {
    Error::new(ErrorKind::Usage, message, hint)
}

/// How the remedy of an error is spelt on the command line, where it has an option there.
pub(super) fn options_for(kind: ErrorKind) -> Option<&'static str> {
    Some(match kind {
        ErrorKind::AlreadyExists => "--force, -o",
        ErrorKind::ChangedMeanwhile => "--force; `leverrier history --show NUMBER` prints a text",
        ErrorKind::DataNotNamed => "--data FILE",
        ErrorKind::EnergyRange => "--energy, --sample",
        ErrorKind::MemoryLimit => "--trainer first-order, --memory",
        ErrorKind::Port => "--port",
        ErrorKind::TaylorSeries => "leave --method out",
        ErrorKind::Threads => "--threads",
        _ => return None,
    })
}

/// The process's exit code: 1 failed, 2 wrong usage.
pub(super) fn exit_code(error: &Error) -> u8 {
    match error.kind() {
        ErrorKind::Usage
        | ErrorKind::UnknownName
        | ErrorKind::Ambiguous
        | ErrorKind::InvalidArgument
        | ErrorKind::NotApplicable
        | ErrorKind::NothingToDo
        | ErrorKind::DataNotNamed
        | ErrorKind::EnergyRange
        | ErrorKind::AlreadyExists
        | ErrorKind::ChangedMeanwhile
        | ErrorKind::Port => 2,
        _ => 1,
    }
}

pub(super) fn is_broken_pipe(error: &Error) -> bool {
    matches!(error, Error::File { source, .. } if source.kind() == io::ErrorKind::BrokenPipe)
}

/// Writes a field of an object.
pub(super) fn set(object: &mut Value, field: &str, value: Value) {
    if let Some(fields) = object.as_object_mut() {
        fields.insert(field.to_string(), value);
    }
}

pub(super) fn pretty(object: &Value) -> String {
    serde_json::to_string_pretty(object).unwrap_or_default()
}

/// A diagnostic under the line it speaks of; on one line where that line is too long to draw.
fn drawn(diagnostic: &Diagnostic, name: &str, text: &str) -> String {
    let span = diagnostic.span;
    let end = span.end.min(text.len());
    let start = span.start.min(end);
    let before = text.get(..start).and_then(|t| t.rfind('\n')).map_or(0, |at| at + 1);
    let after = text.get(end..).and_then(|t| t.find('\n')).map_or(text.len(), |at| end + at);
    if after - before <= LONGEST_LINE {
        return diagnostic.render(name, text, coloured());
    }
    let (line, column) = diagnostic.place(text);
    format!("Error: {name}, line {line}, column {column}: {diagnostic}")
}

/// `leverrier.error/1`.
fn error_object(error: &Error) -> Value {
    let mut object = json!({
        "format": "leverrier.error/1",
        "message": error.to_string(),
        "hint": null,
        "exit_code": exit_code(error),
        "file": null,
        "line": null,
        "row_group": null,
        "column": null,
        "diagnostics": [],
    });
    match error {
        Error::Spec { name, text, diagnostics } => {
            set(&mut object, "file", json!(name));
            set(
                &mut object,
                "diagnostics",
                diagnostics.iter().map(|diagnostic| diagnostic_object(diagnostic, text)).collect(),
            );
        }
        Error::Data(data) => {
            set(&mut object, "message", json!(data.message));
            set(&mut object, "hint", json!(data.hint));
            set(&mut object, "file", json!(data.file.display().to_string()));
            set(&mut object, "line", json!(data.line));
            set(&mut object, "row_group", json!(data.row_group));
            set(&mut object, "column", json!(data.column));
        }
        Error::Refused { path, message, hint, .. } => {
            set(&mut object, "message", json!(message));
            set(&mut object, "hint", json!(hint));
            if let Some(path) = path {
                set(&mut object, "file", json!(path.display().to_string()));
            }
        }
        Error::File { path, .. } => set(&mut object, "file", json!(path.display().to_string())),
        Error::Interrupted => {}
    }
    object
}

/// A diagnostic with its place in lines and columns.
pub(super) fn diagnostic_object(diagnostic: &Diagnostic, text: &str) -> Value {
    let (line, column) = diagnostic.place(text);
    json!({
        "severity": diagnostic.severity,
        "message": diagnostic.message,
        "label": diagnostic.label,
        "hint": diagnostic.hint,
        "line": line,
        "column": column,
        "span": diagnostic.span,
    })
}
