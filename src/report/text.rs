//! A fit as text for people: the Hamiltonian first, then how sure all of it is.

use super::FitReport;
use crate::simplify::{Style, uncertain};

/// The report of a fit, ready to print; `width` is that of the terminal, if it is one.
pub fn fit_text(report: &FitReport, _width: Option<u16>) -> String {
    let mut out = report.simplified.text(Style::default());
    out.push('\n');
    for term in &report.model.terms {
        out.push_str(&format!(
            "{} {} {}\n",
            term.place,
            term.term,
            uncertain(term.coefficient, term.standard_error, 10)
        ));
    }
    out
}
