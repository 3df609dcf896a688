//! Messages that point into a user's text: a place, a label and a hint.

use std::fmt;
use std::ops::Range;

use serde::Serialize;

/// A half-open range of bytes in a source text.
///
/// ```
/// let error = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = foo").unwrap_err();
/// let diagnostic = &error.diagnostics()[0];
/// assert_eq!(diagnostic.span.end - diagnostic.span.start, 3); // foo
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default, Serialize)]
pub struct Span {
    /// First byte.
    pub start: usize,
    /// The byte after the last one.
    pub end: usize,
}

impl Span {
    /// Line and column of its start in a text, both counted from 1; columns in characters.
    pub(crate) fn line_and_column(self, text: &str) -> (usize, usize) {
        let before = text.get(..self.start).unwrap_or("");
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
        (line, column)
    }

    /// The bytes `start .. end`.
    pub(crate) fn new(start: usize, end: usize) -> Self {
        Span { start, end }
    }

    /// The smallest span that holds both.
    pub(crate) fn join(self, other: Span) -> Span {
        Span::new(self.start.min(other.start), self.end.max(other.end))
    }

    /// The same bytes as a range to index a text with.
    ///
    /// ```
    /// let text = "coordinates q; momenta p\nT = p^2/2\nV = foo";
    /// let error = leverrier::Spec::parse(text).unwrap_err();
    /// assert_eq!(text.get(error.diagnostics()[0].span.range()), Some("foo"));
    /// ```
    pub fn range(self) -> Range<usize> {
        self.start..self.end
    }
}

/// How bad it is: an error stops the command, a warning and a note do not.
///
/// ```
/// let error = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = foo").unwrap_err();
/// let diagnostic = &error.diagnostics()[0];
/// assert_eq!(diagnostic.severity, leverrier::Severity::Error);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Something worth knowing; nothing has to be done.
    Note,
    /// The command goes on, but its result may not be what was meant.
    Warning,
    /// The command stops.
    Error,
}

/// One message about a user's text.
///
/// ```
/// let error = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = foo").unwrap_err();
/// let diagnostic = &error.diagnostics()[0];
/// println!("{} {:?}", diagnostic.message, diagnostic.hint);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnostic {
    /// How bad it is.
    pub severity: Severity,
    /// A sentence that says what is wrong.
    pub message: String,
    /// The place that it speaks of.
    pub span: Span,
    /// What stands at that place.
    pub label: String,
    /// What to do about it.
    pub hint: Option<String>,
    /// Other places that matter (the first definition of a name, for one).
    pub related: Vec<(Span, String)>,
}

impl Diagnostic {
    /// A message without label, hint or related places.
    pub(crate) fn new(severity: Severity, span: Span, message: impl Into<String>) -> Self {
        Diagnostic {
            severity,
            message: message.into(),
            span,
            label: String::new(),
            hint: None,
            related: Vec::new(),
        }
    }

    /// An error: [`Diagnostic::new`] with [`Severity::Error`].
    pub(crate) fn error(span: Span, message: impl Into<String>) -> Self {
        Self::new(Severity::Error, span, message)
    }

    /// A warning: [`Diagnostic::new`] with [`Severity::Warning`].
    pub(crate) fn warning(span: Span, message: impl Into<String>) -> Self {
        Self::new(Severity::Warning, span, message)
    }

    /// Says what stands at the place.
    pub(crate) fn label(mut self, label: impl Into<String>) -> Self {
        self.label = label.into();
        self
    }

    /// Says what to do about it.
    pub(crate) fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// Adds another place that matters, with what stands there.
    pub(crate) fn related(mut self, span: Span, label: impl Into<String>) -> Self {
        self.related.push((span, label.into()));
        self
    }

    /// Line and column of its place in `text`, both counted from 1; columns in characters.
    ///
    /// ```
    /// let text = "coordinates q; momenta p\nT = p^2/2\nV = foo";
    /// let error = leverrier::Spec::parse(text).unwrap_err();
    /// assert_eq!(error.diagnostics()[0].place(text), (3, 5));
    /// ```
    pub fn place(&self, text: &str) -> (usize, usize) {
        self.span.line_and_column(text)
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)?;
        if let Some(hint) = &self.hint {
            write!(f, " ({hint})")?;
        }
        Ok(())
    }
}
