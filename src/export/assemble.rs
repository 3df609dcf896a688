//! From a law to the forms that are printed and exported.

use super::{Export, ExportedIntegrator, IntegratorKind, Pretty, PrettyNumber, Provenance};
use crate::dynamics::{Method, MethodKind};
use crate::fit::Law;
use crate::simplify::{self, Simplified, SimplifyOptions};

/// The simplified form of a law, learned or known.
///
/// `ranges`: largest |value| of each state component in the data (q, then p); 0 where unknown.
pub fn simplified(law: &Law, ranges: &[f64]) -> Simplified {
    simplify::simplify(
        law,
        &SimplifyOptions { ranges: ranges.to_vec(), ..SimplifyOptions::default() },
    )
}

/// The simplified form as the exporters take it.
pub fn pretty(simplified: &Simplified) -> Pretty {
    let numbers = simplified.numbers.iter().map(|number| PrettyNumber {
        value: number.value,
        standard_error: number.standard_error,
        snapped: number.snapped.map(|nice| nice.to_string()),
    });
    Pretty {
        graph: simplified.graph.clone(),
        parts: simplified.parts.iter().map(|part| (part.place, part.pretty)).collect(),
        numbers: numbers.collect(),
        notes: notes(simplified),
    }
}

/// What was done to the printed form that a reader should know.
pub fn notes(simplified: &Simplified) -> Vec<String> {
    let snaps = simplified.snaps.iter().map(|snap| {
        let measured = simplify::uncertain(snap.from, snap.standard_error, 10);
        let distance = if snap.sigmas > 0.0 {
            format!("{:.1} standard errors away", snap.sigmas)
        } else {
            "within rounding".to_string()
        };
        format!("{} is printed as {}: measured {measured}, {distance}", snap.what, snap.to.text)
    });
    snaps.chain(simplified.parts.iter().flat_map(|part| part.shape.iter().cloned())).collect()
}

/// A law as the exporters take it.
pub fn export<'a>(law: &'a Law, pretty: &'a Pretty) -> Export<'a> {
    Export {
        law,
        pretty,
        integrator: integrator(law.stepping().method),
        provenance: Provenance::default(),
        start: None,
    }
}

fn integrator(method: Method) -> ExportedIntegrator {
    let row = method.row();
    ExportedIntegrator {
        name: row.name.to_string(),
        order: row.order,
        kind: match &row.kind {
            MethodKind::Splitting(weights) => {
                IntegratorKind::Splitting { weights: weights.to_vec() }
            }
            MethodKind::Implicit(t) => IntegratorKind::Implicit(t),
            MethodKind::Explicit(t) => IntegratorKind::Explicit(t),
        },
    }
}
