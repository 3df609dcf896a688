//! What a data set holds, as text for people.

use comfy_table::{CellAlignment, ContentArrangement};

use super::layout::counted;
use crate::data::{DataReport, Sampling, short};

impl DataReport {
    /// The report for people, as plain text without a newline at the end.
    pub fn to_text(&self) -> String {
        let mut lines = Vec::new();
        if let Some(source) = &self.source {
            let files = match source.files {
                1 => String::new(),
                files => format!("{}, ", counted(files, "file")),
            };
            lines.push(format!(
                "{}: {files}{}, {}",
                source.file.display(),
                counted(source.rows, "row"),
                source.reading.sentence()
            ));
        }
        let runs = self.streamed.map_or(self.runs.len(), |s| s.runs as usize);
        lines.push(format!(
            "{} in {}; {}",
            counted(self.samples, "sample"),
            counted(runs, "run"),
            self.sampling.sentence()
        ));
        lines.push(self.column_table());
        if let Some(streamed) = &self.streamed {
            lines.push(format!(
                "Counts and ranges are those of all data; noise, gaps and warnings are judged on \
                 {} drawn at random.",
                counted(streamed.sampled_samples, "sample"),
            ));
        }
        if self.runs.len() > 1 && self.streamed.is_none() {
            lines.push(self.run_table());
        }
        if !self.gaps.is_empty() {
            lines.push(self.gap_table());
        }
        lines.extend(self.warnings.iter().map(|w| format!("Warning: {w}")));
        lines.join("\n")
    }

    /// What a place in the file is called.
    fn place(&self) -> &'static str {
        self.source.as_ref().map_or("line", |source| source.reading.noun())
    }

    fn column_table(&self) -> String {
        let number = |value: Option<f64>| value.map_or("-".to_string(), short);
        let rows = self.columns.iter().map(|column| {
            vec![
                column.name.clone(),
                column.header.clone().unwrap_or_else(|| "-".to_string()),
                column.measured.to_string(),
                column.missing.to_string(),
                number(column.minimum),
                number(column.maximum),
                number(column.mean),
                number(column.spread),
                number(column.rough_noise),
            ]
        });
        let header = [
            "observable",
            "column",
            "measured",
            "missing",
            "minimum",
            "maximum",
            "mean",
            "spread",
            "noise below, roughly",
        ];
        drawn(&header, rows, 2)
    }

    fn run_table(&self) -> String {
        let rows = self.runs.iter().take(SHOWN).map(|run| {
            vec![
                run.name.clone(),
                run.samples.to_string(),
                short(run.start),
                short(run.end),
                format!("{} to {}", run.lines.0, run.lines.1),
            ]
        });
        let places = format!("{}s", self.place());
        let header = ["run", "samples", "start", "end", &places];
        with_rest(drawn(&header, rows, 1), self.runs.len(), "run")
    }

    fn gap_table(&self) -> String {
        let rows = self.gaps.iter().take(SHOWN).map(|gap| {
            vec![
                gap.run.clone(),
                gap.after_line.to_string(),
                short(gap.start),
                short(gap.end),
                format!("{:.1}", gap.steps),
            ]
        });
        let after = format!("after {}", self.place());
        let header = ["gap in run", &after, "start", "end", "median steps"];
        with_rest(drawn(&header, rows, 1), self.gaps.len(), "gap")
    }
}

/// How many runs or gaps are shown to people; the others are in the JSON output.
const SHOWN: usize = 12;

impl Sampling {
    fn sentence(&self) -> String {
        if self.is_regular {
            format!("one every {}", short(self.median))
        } else {
            format!(
                "irregular, one every {} in the median (from {} to {})",
                short(self.median),
                short(self.minimum),
                short(self.maximum)
            )
        }
    }
}

fn with_rest(table: String, count: usize, noun: &str) -> String {
    match count.checked_sub(SHOWN) {
        Some(rest) if rest > 0 => {
            format!("{table}\n and {}", counted(rest, &format!("more {noun}")))
        }
        _ => table,
    }
}

/// A table without borders; the columns from number `right` on are numbers.
fn drawn(header: &[&str], rows: impl Iterator<Item = Vec<String>>, right: usize) -> String {
    let mut table = comfy_table::Table::new();
    table
        .load_style(comfy_table::presets::NOTHING)
        .set_content_arrangement(ContentArrangement::Disabled)
        .force_no_tty()
        .set_header(header.to_vec())
        .add_rows(rows);
    for column in table.column_iter_mut().skip(right) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table.trim_fmt()
}
