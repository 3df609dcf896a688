//! From a fitted model to the forms that are printed and exported.

use serde_json::{Value, json};

use crate::diagnose::missing::Diagnosis;
use crate::dynamics::{Kind, Method, Tableau};
use crate::export::{self, Export, Integrator, IntegratorKind, Pretty, PrettyNumber, Provenance};
use crate::expr::{Place, Symbol};
use crate::fit::Law;
use crate::simplify::{self, Options, Simplified, Style};

/// The simplified form of a law, learned or known.
///
/// `ranges`: largest |value| of each state component in the data (q, then p); 0 where unknown.
pub fn simplified(law: &Law, ranges: &[f64]) -> Simplified {
    simplify::simplify(law, &Options { ranges: ranges.to_vec(), ..Options::default() })
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

fn integrator(method: Method) -> Integrator {
    let row = method.row();
    let tableau = |t: &Tableau| export::Tableau {
        matrix: t.matrix.to_vec(),
        weights: t.weights.to_vec(),
        nodes: t.nodes.to_vec(),
    };
    Integrator {
        name: row.name.to_string(),
        order: row.order,
        kind: match &row.kind {
            Kind::Splitting(weights) => IntegratorKind::Splitting { weights: weights.to_vec() },
            Kind::Implicit(t) => IntegratorKind::Implicit(tableau(t)),
            Kind::Explicit(t) => IntegratorKind::Explicit(tableau(t)),
        },
    }
}

/// The equations with their numbers, for programs.
pub fn equations_json(simplified: &Simplified, style: Style) -> Value {
    let plain = Style { uncertainties: false, digits: 17 };
    json!({
        "text": simplified.text(style),
        "parts": simplified.parts.iter().map(|part| json!({
            "place": place_name(simplified, part.place),
            "text": simplified.part_text(part, style),
        })).collect::<Vec<_>>(),
        "snapped": simplified.snaps.iter().map(|snap| json!({
            "what": snap.what,
            "value": snap.from,
            "standard_error": finite(snap.standard_error),
            "printed": snap.to.text,
            "printed_value": snap.to.value,
            "standard_errors_away": finite(snap.sigmas),
        })).collect::<Vec<_>>(),
        "notes": simplified.parts.iter().flat_map(|part| part.shape.clone()).collect::<Vec<_>>(),
        "digits": simplified.text(plain),
    })
}

fn place_name(simplified: &Simplified, place: Place) -> String {
    match place {
        Place::Kinetic => "T".to_string(),
        Place::Potential => "V".to_string(),
        Place::Hamiltonian => "H".to_string(),
        Place::Force(i) => format!("force {}", simplified.names.of(Symbol::Coordinate(i))),
        Place::Sensor(i) => {
            let degrees = simplified.names.coordinates.len();
            let symbol =
                if i < degrees { Symbol::Coordinate(i) } else { Symbol::Momentum(i - degrees) };
            format!("sensor {}", simplified.names.of(symbol))
        }
    }
}

/// How many effects were tested, and what the p-values are corrected for.
pub fn tested(diagnosis: &Diagnosis) -> String {
    format!(
        "{} effects of the catalogue were tested, with {} choices of where they act and of their \
         inner parameters; p-values are corrected for that many tests (look-elsewhere correction).",
        diagnosis.candidates, diagnosis.tried
    )
}

/// JSON has no infinity: null.
pub fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}
