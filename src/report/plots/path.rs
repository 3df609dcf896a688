//! Coefficients along the path of L1 penalties.

use std::collections::HashMap;

use super::axes::Axis;
use super::figure::{Figure, Mark, Panel, SeriesInfo, Shape, Style};
use super::{PlotData, label};

/// Terms with a name; the others are faint.
const NAMED: usize = 7;

/// One figure: the larger the penalty, the fewer terms are left.
pub(super) fn figures(material: &PlotData) -> Vec<Figure> {
    let path = &material.model.path;
    let entries: Vec<_> = path.iter().filter(|e| e.lambda > 0.0 && e.lambda.is_finite()).collect();
    let mut terms: Vec<&str> = Vec::new();
    let mut largest: HashMap<&str, f64> = HashMap::new();
    for (term, value) in entries.iter().flat_map(|entry| &entry.coefficients) {
        let size = largest.entry(term).or_insert_with(|| {
            terms.push(term);
            0.0
        });
        if value.is_finite() {
            *size = size.max(value.abs());
        }
    }
    if entries.len() < 2 || terms.is_empty() {
        return Vec::new();
    }
    // Terms of the model first, then those that grow largest.
    let chosen = |term: &str| material.model.terms.iter().any(|own| own.term == term);
    terms.sort_by(|a, b| {
        chosen(b).cmp(&chosen(a)).then(largest[b].total_cmp(&largest[a])).then(a.cmp(b))
    });
    let caption = format!(
        "Every coefficient against the L1 penalty: from the right, where the penalty empties the model, to the left, where it hardly counts. {} of {} terms that \
         appear are in the model; the model's own numbers are fitted without a penalty.",
        terms.iter().filter(|term| chosen(term)).count(),
        terms.len(),
    );
    let title = "Coefficients along the regularization path".to_string();
    let mut figure = Figure::new("path", title, caption);
    let value = |term: &str, at: usize| {
        let own = entries[at].coefficients.iter().find(|(name, _)| name == term);
        own.map_or(0.0, |(_, value)| *value)
    };
    let x = Axis::logarithmic(entries.iter().map(|e| e.lambda)).words("penalty λ");
    let all = terms.iter().flat_map(|term| (0..entries.len()).map(|at| value(term, at)));
    let y = Axis::linear(all.chain([0.0]), 5).words("coefficient");
    let mut panel = Panel::new(1.0, x, y);
    panel.marks.push(Mark::Level { style: Style::Reference, y: 0.0 });
    for (rank, term) in terms.iter().enumerate().rev() {
        let named = rank < NAMED && (chosen(term) || rank < 3);
        let style = if named { Style::Series(rank as u8) } else { Style::Faint };
        let points = (0..entries.len()).map(|at| (entries[at].lambda, value(term, at))).collect();
        let about = SeriesInfo::named(&label::term(term));
        panel.marks.push(Mark::Line { style, points, about });
    }
    let mut faint = 0;
    for (rank, term) in terms.iter().enumerate() {
        if rank < NAMED && (chosen(term) || rank < 3) {
            let out = if chosen(term) { "" } else { " (not in the model)" };
            let text = format!("{}{out}", label::term(term));
            figure.key(Style::Series(rank as u8), Shape::Line, &text);
        } else {
            faint += 1;
        }
    }
    if faint > 0 {
        figure.key(Style::Faint, Shape::Line, &format!("{faint} more"));
    }
    figure.height += 14.0 * (figure.legend.len() / 4) as f64;
    figure.panels.push(panel);
    vec![figure]
}
