//! From a fitted model to the forms that are printed and exported.

use nalgebra::DMatrix;
use serde_json::{Value, json};

use crate::diagnose::missing::Diagnosis;
use crate::dynamics::{Kind, Method, Tableau};
use crate::export::{self, Export, Integrator, IntegratorKind, Pretty, PrettyNumber, Provenance};
use crate::expr::{Place, Symbol, System};
use crate::fit::Model;
use crate::simplify::{self, Fitted, Options, Simplified, Style};

/// The simplified form of a fitted model.
///
/// `ranges`: largest |value| of each state component in the data (q, then p); 0 where unknown.
/// A model of another system is simplified as if nothing had been learned.
pub fn simplified(system: &System, model: &Model, ranges: &[f64]) -> Simplified {
    let (active, coefficients) = model.active(system).unwrap_or_default();
    let parameters = model.parameter_values(system);
    let covariance = model.full_covariance(system);
    let fitted = Fitted {
        system,
        active: &active,
        coefficients: &coefficients,
        parameters: &parameters,
        covariance: &covariance,
    };
    of_law(&fitted, ranges)
}

/// The simplified form of any law, learned or known.
pub fn of_law(fitted: &Fitted, ranges: &[f64]) -> Simplified {
    simplify::simplify(fitted, &Options { ranges: ranges.to_vec(), ..Options::default() })
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

/// A law as the exporters take it. `errors` are the standard errors of the coefficients, then
/// of all parameters; the integrator takes steps of `step`, in the spec's unit of time.
pub fn export<'a>(
    fitted: &Fitted<'a>,
    errors: &'a [f64],
    pretty: &'a Pretty,
    method: Method,
    step: f64,
) -> Export<'a> {
    let (standard_errors, parameter_errors) =
        errors.split_at(fitted.active.len().min(errors.len()));
    Export {
        system: fitted.system,
        active: fitted.active,
        coefficients: fitted.coefficients,
        standard_errors,
        parameters: fitted.parameters,
        parameter_errors,
        pretty,
        integrator: integrator(method),
        step,
        noise: Vec::new(),
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

/// Square roots of the diagonal.
pub fn standard_errors(covariance: &DMatrix<f64>) -> Vec<f64> {
    covariance.diagonal().iter().map(|variance| variance.sqrt()).collect()
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
