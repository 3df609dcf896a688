//! Tables of the report.

use std::fmt::Write;

use super::{HistoryEntry, Page};
use crate::data::DataReport;
use crate::diagnose::comparison::Comparison;
use crate::diagnose::diagnosis::Diagnosis;
use crate::fit::Model;
use crate::fit::distribution::Distribution;
use crate::report::plots::{escaped, measured, number, plain, tenths, term, unit};
use crate::report::present::included;

/// Rows of a table; the others are counted.
const MOST: usize = 40;

/// A table: its head, its rows, and the columns that stand to the right.
pub(crate) struct Table {
    pub head: Vec<&'static str>,
    pub rows: Vec<Vec<String>>,
    pub numbers: Vec<usize>,
}

impl Table {
    /// The first rows, and how many are left out.
    pub(crate) fn shown(&self) -> (&[Vec<String>], usize) {
        let most = self.rows.len().min(MOST);
        (&self.rows[..most], self.rows.len() - most)
    }

    /// Nothing without rows.
    pub(crate) fn html(&self) -> String {
        if self.rows.is_empty() {
            return String::new();
        }
        let class = |at: usize| if self.numbers.contains(&at) { " class=\"number\"" } else { "" };
        let mut out = String::from("<div class=\"scroll\"><table>\n<thead><tr>");
        for (at, cell) in self.head.iter().enumerate() {
            let _ = write!(out, "<th scope=\"col\"{}>{}</th>", class(at), escaped(cell));
        }
        out += "</tr></thead>\n<tbody>\n";
        let (rows, more) = self.shown();
        for row in rows {
            out += "<tr>";
            for (at, cell) in row.iter().enumerate() {
                let _ = write!(out, "<td{}>{}</td>", class(at), escaped(cell));
            }
            out += "</tr>\n";
        }
        out += "</tbody></table></div>\n";
        if more > 0 {
            let _ = writeln!(out, "<p class=\"soft\">and {more} more</p>");
        }
        out
    }
}

/// A table without the columns that no row has anything in.
fn table(head: &[&'static str], mut rows: Vec<Vec<String>>, numbers: &[usize]) -> Table {
    let filled: Vec<usize> = (0..head.len())
        .filter(|&at| rows.iter().any(|row| row.get(at).is_some_and(|cell| !cell.is_empty())))
        .collect();
    for row in &mut rows {
        *row = filled.iter().map(|&at| std::mem::take(&mut row[at])).collect();
    }
    Table {
        head: filled.iter().map(|&at| head[at]).collect(),
        rows,
        numbers: (0..filled.len()).filter(|&at| numbers.contains(&filled[at])).collect(),
    }
}

/// Coefficients and inner parameters of the law.
pub(crate) fn coefficients(model: &Model) -> Table {
    let rows: Vec<Vec<String>> = model
        .terms
        .iter()
        .map(|learned| {
            let name = learned.name.as_ref().map_or(String::new(), |name| format!("{name}: "));
            vec![
                learned.place.clone(),
                name + &term(&learned.term),
                measured(learned.coefficient, learned.standard_error, 8),
                unit(learned.unit.as_deref()),
                included(learned),
            ]
        })
        .chain(model.parameters.iter().map(|parameter| {
            vec![
                "inner parameter".to_string(),
                plain(&parameter.name),
                measured(parameter.value, parameter.standard_error, 8),
                unit(parameter.unit.as_deref()),
                String::new(),
            ]
        }))
        .collect();
    table(&["part", "term", "coefficient", "unit", "chosen on resampled data"], rows, &[2, 4])
}

/// The values of a number that groups of runs have for themselves.
pub(crate) fn own_values(found: &Distribution) -> Table {
    let rows: Vec<Vec<String>> = found
        .values
        .iter()
        .map(|value| {
            let number = match value.is_determined() {
                true => measured(value.value, value.standard_error, 8),
                false => "not determined".to_string(),
            };
            let unit = unit(found.unit.as_deref());
            vec![plain(&value.group), number, unit, value.runs.to_string()]
        })
        .collect();
    table(&["one for each", "value", "unit", "runs"], rows, &[1, 3])
}

/// Noise of every observable.
pub(crate) fn noise(page: &Page) -> Table {
    let view = page.material.view;
    let rows: Vec<Vec<String>> = view
        .observables
        .iter()
        .zip(&view.noise)
        .enumerate()
        .map(|(row, (quantity, noise))| {
            let measured = page.data.columns.get(row).is_none_or(|column| column.measured > 0);
            let noise = if measured { number(*noise, 3) } else { "not measured".to_string() };
            vec![plain(&quantity.name), noise, unit(quantity.unit.as_deref())]
        })
        .collect();
    table(&["noise of", "standard deviation", "unit"], rows, &[1])
}

/// Errors by length of prediction.
pub(crate) fn horizons(comparison: &Comparison) -> Table {
    let times = |error: f64| number(error, 3);
    let rows: Vec<Vec<String>> = comparison
        .horizons
        .iter()
        .map(|h| {
            vec![
                h.samples.to_string(),
                number(h.duration, 4),
                times(h.training),
                h.held_out.map_or(String::new(), times),
                times(h.baseline),
                if h.diverged > 0 { h.diverged.to_string() } else { String::new() },
            ]
        })
        .collect();
    let head = ["samples", "time", "training", "held out", "persistence", "diverged"];
    table(&head, rows, &[0, 1, 2, 3, 4, 5])
}

/// Residual forces, the most telling first.
pub(crate) fn forces(comparison: &Comparison) -> Table {
    let mut maps: Vec<_> = comparison.maps.iter().collect();
    maps.sort_by(|a, b| a.p_value.total_cmp(&b.p_value).then(b.deviance.total_cmp(&a.deviance)));
    let rows: Vec<Vec<String>> = maps
        .iter()
        .map(|map| {
            vec![
                plain(&map.on),
                plain(&map.against),
                tenths(map.deviance),
                map.degrees.to_string(),
                p_value_text(map.p_value),
            ]
        })
        .collect();
    let head = ["force on", "against", "deviance", "degrees of freedom", "p-value"];
    table(&head, rows, &[2, 3, 4])
}

fn p_value_text(p: f64) -> String {
    if p < 1e-12 { "< 10⁻¹²".to_string() } else { number(p, 2) }
}

/// The leaders of a diagnosis.
pub(crate) fn leaders(diagnosis: &Diagnosis) -> Table {
    let rows: Vec<Vec<String>> = diagnosis
        .ranking
        .iter()
        .map(|leader| {
            let numbers = leader.coefficient.iter().zip(&leader.standard_error);
            let numbers: Vec<String> = numbers.map(|(&x, &s)| measured(x, s, 4)).collect();
            vec![
                leader.effect.clone(),
                numbers.join(", "),
                tenths(leader.deviance),
                p_value_text(leader.p_value),
                number(leader.held_out_error_before, 3),
                number(leader.held_out_error_after, 3),
            ]
        })
        .collect();
    let head = ["effect", "coefficient", "deviance", "p-value", "held-out error before", "after"];
    table(&head, rows, &[1, 2, 3, 4, 5])
}

/// Models that came close.
pub(crate) fn runners_up(model: &Model) -> Table {
    let rows: Vec<Vec<String>> = model
        .runners_up
        .iter()
        .take(8)
        .map(|runner| {
            let terms: Vec<String> = runner.terms.iter().take(12).map(|(t, _)| term(t)).collect();
            let more = if runner.terms.len() > 12 { ", …" } else { "" };
            let terms = if terms.is_empty() { "none".to_string() } else { terms.join(", ") + more };
            let sign = if runner.difference < 0.0 { "" } else { "+" };
            vec![format!("{sign}{}", tenths(runner.difference)), terms]
        })
        .collect();
    table(&["criterion", "terms of the runner-up"], rows, &[0])
}

/// The ledger.
pub(crate) fn ledger(history: &[HistoryEntry]) -> Table {
    let error = |error: Option<f64>| error.map_or(String::new(), |e| number(e, 3));
    let rows: Vec<Vec<String>> = history
        .iter()
        .map(|entry| {
            vec![
                entry.date.clone(),
                entry.action.clone(),
                error(entry.before),
                error(entry.after),
                if entry.undone { "taken back".to_string() } else { String::new() },
            ]
        })
        .collect();
    table(&["time (UTC)", "action", "held-out error before", "after", ""], rows, &[2, 3])
}

/// What was measured.
pub(crate) fn columns(data: &DataReport) -> Table {
    let value = |x: Option<f64>| x.map_or("–".to_string(), |x| number(x, 5));
    let rows: Vec<Vec<String>> = data
        .columns
        .iter()
        .map(|column| {
            vec![
                plain(&column.name),
                column.header.clone().unwrap_or_default(),
                column.measured.to_string(),
                column.missing.to_string(),
                value(column.minimum),
                value(column.maximum),
                value(column.mean),
                value(column.spread),
            ]
        })
        .collect();
    let head =
        ["observable", "column", "measured", "missing", "minimum", "maximum", "mean", "spread"];
    table(&head, rows, &[2, 3, 4, 5, 6, 7])
}

/// Where samples are missing.
pub(crate) fn gaps(data: &DataReport) -> Table {
    let rows: Vec<Vec<String>> = data
        .gaps
        .iter()
        .map(|gap| {
            vec![
                gap.run.clone(),
                gap.after_line.to_string(),
                number(gap.start, 6),
                number(gap.end, 6),
                tenths(gap.steps),
            ]
        })
        .collect();
    let head = ["gap in run", "after line", "from", "to", "median steps"];
    table(&head, rows, &[1, 2, 3, 4])
}

/// Names and values.
pub(crate) fn facts(facts: &[(String, String)]) -> String {
    let mut out = String::from("<div class=\"scroll\"><table>\n<tbody>\n");
    for (name, value) in facts {
        let hash = value.len() >= 64 && value.split(' ').any(|word| word.len() == 64);
        let class = if hash { " class=\"hash\"" } else { "" };
        let _ = writeln!(
            out,
            "<tr><th scope=\"row\">{}</th><td><code{class}>{}</code></td></tr>",
            escaped(name),
            escaped(value)
        );
    }
    out + "</tbody></table></div>\n"
}
