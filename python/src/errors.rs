//! Errors of the library as exceptions of the package.

use leverrier::{Error, Severity};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The exception for an error: `leverrier.errors` chooses its class by the kind.
pub fn exception(py: Python<'_>, error: &Error) -> PyErr {
    made(py, error).unwrap_or_else(|failed| failed)
}

fn made(py: Python<'_>, error: &Error) -> PyResult<PyErr> {
    let fields = PyDict::new(py);
    fields.set_item("kind", format!("{:?}", error.kind()))?;
    fields.set_item("message", message(error))?;
    fields.set_item("hint", error.hint())?;
    match error {
        Error::Data(wrong) => {
            let file = wrong.file.display().to_string();
            fields.set_item("file", (!file.is_empty()).then_some(file))?;
            fields.set_item("line", wrong.line)?;
            fields.set_item("row_group", wrong.row_group)?;
            fields.set_item("column", &wrong.column)?;
        }
        Error::File { path, .. } => fields.set_item("file", path.display().to_string())?,
        Error::Refused { path: Some(path), .. } => {
            fields.set_item("file", path.display().to_string())?;
        }
        Error::Spec { name, text, .. } => {
            fields.set_item("file", name)?;
            fields.set_item("text", text)?;
        }
        _ => {}
    }
    let mut diagnostics = Vec::new();
    for one in error.diagnostics() {
        let row = PyDict::new(py);
        let text = if let Error::Spec { text, .. } = error { text } else { "" };
        let (line, column) = one.place(text);
        let severity = match one.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
            Severity::Note => "note",
        };
        row.set_item("severity", severity)?;
        row.set_item("message", &one.message)?;
        row.set_item("label", &one.label)?;
        row.set_item("hint", &one.hint)?;
        row.set_item("line", line)?;
        row.set_item("column", column)?;
        row.set_item("span", (one.span.start, one.span.end))?;
        diagnostics.push(row);
    }
    fields.set_item("diagnostics", diagnostics)?;
    let made = py.import("leverrier.errors")?.call_method1("from_native", (fields,))?;
    Ok(PyErr::from_value(made))
}

/// What is wrong, without the remedy.
fn message(error: &Error) -> String {
    let whole = error.to_string();
    match error {
        Error::Spec { diagnostics, .. } => match diagnostics.first() {
            Some(first) => first.message.clone(),
            None => whole,
        },
        Error::Data(wrong) => wrong.message.clone(),
        Error::Refused { message, .. } => message.clone(),
        _ => whole,
    }
}

/// A result of the library as one of Python.
pub trait OrRaise<T> {
    fn or_raise(self, py: Python<'_>) -> PyResult<T>;
}

impl<T> OrRaise<T> for leverrier::Result<T> {
    fn or_raise(self, py: Python<'_>) -> PyResult<T> {
        self.map_err(|error| exception(py, &error))
    }
}
