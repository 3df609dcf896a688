//! The printed form of a law as programs read it.

use serde_json::{Value, json};

use crate::expr::{Place, Symbol};
use crate::simplify::{Simplified, Style};

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
        Place::Rate(i) => format!("rate {}", simplified.names.of(Symbol::Coordinate(i))),
        Place::Sensor(i) => {
            let degrees = simplified.names.coordinates.len();
            let symbol =
                if i < degrees { Symbol::Coordinate(i) } else { Symbol::Momentum(i - degrees) };
            format!("sensor {}", simplified.names.of(symbol))
        }
    }
}

/// JSON has no infinity: null.
pub fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}
