//! Messages about a text, drawn under the lines that they speak of.

use ariadne::{CharSet, Color, Config, IndexType, Label, Report, ReportKind, Source};

use crate::diagnostic::{Diagnostic, Severity, Span};

impl Diagnostic {
    /// Draws the message under the lines of `text` that it speaks of.
    ///
    /// `name` is what the text is called (a file's path). Spans that reach past
    /// the end of the text are cut to it.
    pub fn render(&self, name: &str, text: &str, colour: bool) -> String {
        let cut = |span: Span| {
            let end = span.end.min(text.len());
            (name, span.start.min(end)..end)
        };
        let kind = match self.severity {
            Severity::Error => ReportKind::Error,
            Severity::Warning => ReportKind::Warning,
            Severity::Note => ReportKind::Advice,
        };
        let config = Config::default()
            .with_color(colour)
            .with_index_type(IndexType::Byte)
            .with_char_set(if colour { CharSet::Unicode } else { CharSet::Ascii });
        let label = if self.label.is_empty() { "here" } else { &self.label };
        let mut report = Report::build(kind, cut(self.span))
            .with_config(config)
            .with_message(&self.message)
            .with_label(Label::new(cut(self.span)).with_message(label).with_color(Color::Red));
        for (span, label) in &self.related {
            report = report
                .with_label(Label::new(cut(*span)).with_message(label).with_color(Color::Blue));
        }
        if let Some(hint) = &self.hint {
            report = report.with_help(hint);
        }
        let mut out = Vec::new();
        match report.finish().write((name, Source::from(text)), &mut out) {
            Ok(()) => String::from_utf8_lossy(&out).trim_end().to_string(),
            Err(_) => self.to_string(),
        }
    }
}
