//! Composed terms as candidates: statements of the language.

use super::expression::Composed;
use super::leaves::Leaves;
use crate::diagnose::candidates::{Candidate, Origin, terms_of};
use crate::expr::{Place, Scope, System};

/// The candidate that adds some terms; `None` where the language does not take them, as where
/// units forbid it. Inner numbers are unknowns, unless they are `fixed`.
pub(super) fn candidate_of(
    scope: &mut Scope,
    leaves: &Leaves,
    terms: &[Composed],
    fixed: bool,
) -> Option<Candidate> {
    let system = &scope.compiled().system;
    let free = free_prefix(system);
    let (mut statements, mut parameters) = (Vec::new(), Vec::new());
    let (mut label, mut values, mut written) = (Vec::new(), Vec::new(), Vec::new());
    for (place, term) in terms.iter().enumerate() {
        let first = parameters.len();
        let numbers = term.numbers();
        let names: Vec<String> =
            (0..numbers.len()).map(|i| format!("{free}{}", first + i + 1)).collect();
        let text = term.text(&leaves.list, &names);
        let texts: Vec<String> = numbers.iter().map(|&number| number_text(number)).collect();
        let name = format!("{free}_{}", place + 1);
        statements.push(term.statement(system, &name, &text));
        let filled = filled(&text, &names, &texts);
        label.push(format!("{} {filled}", place_name(system, term.place)));
        // A parameter's unit is not checked where it has none; a number's is.
        let with_units = texts.iter().zip(term.units(&leaves.list));
        written.extend(with_units.map(|(text, unit)| {
            if unit.is_empty() { text.clone() } else { format!("{text} [{unit}]") }
        }));
        parameters.extend(names);
        values.extend(numbers);
    }
    let statement = statements.join("\n");
    let standing = system.parameters.len();
    let mut lines = Vec::new();
    let lowered = if fixed {
        filled(&statement, &parameters, &written)
    } else {
        lines.extend(parameters.iter().zip(&values).map(|(n, v)| format!("param {n} = {v:.12e}")));
        let bare = |text: String, name: &String| text.replace(&format!("{{{name}}}"), name);
        parameters.iter().fold(statement.clone(), bare)
    };
    lines.push(lowered);
    let on = acted_on(system, leaves, terms);
    let extension = scope.extension(&lines.join("\n")).ok()?;
    let own = |name: &str| name.strip_prefix(&free).is_some_and(|rest| rest.starts_with('_'));
    let found = terms_of(&extension, |term| term.name.as_deref().is_some_and(own));
    if found.len() != terms.len() {
        return None;
    }
    let ids = extension.parameters().map(|(id, ..)| id);
    let ids = ids.filter(|id| id.position() >= standing).collect();
    let price: f64 = terms.iter().map(|term| term.price).sum();
    Some(Candidate {
        origin: Origin::Unnamed {
            statement,
            parameters: if fixed { Vec::new() } else { parameters },
        },
        label: label.join(", "),
        on,
        arguments: Vec::new(),
        extension,
        terms: found,
        parameters: ids,
        grid: vec![if fixed { Vec::new() } else { values }],
        choice: price,
        second: None,
    })
}

/// A name that nothing in the system begins with.
fn free_prefix(system: &System) -> String {
    let parameters = system.parameters.iter().map(|parameter| &parameter.name);
    let terms = system.terms.iter().filter_map(|term| term.name.as_ref());
    let taken: Vec<&String> = parameters.chain(terms).collect();
    let mut prefix = "composed".to_string();
    while taken.iter().any(|name| name.starts_with(&prefix)) {
        prefix += "_more";
    }
    prefix
}

/// A text with numbers in place of names between braces.
fn filled(text: &str, names: &[String], numbers: &[String]) -> String {
    let fill = |text: String, (name, number): (&String, &String)| {
        text.replace(&format!("{{{name}}}"), number)
    };
    // What is subtracted may be negative.
    names.iter().zip(numbers).fold(text.to_string(), fill).replace("- -", "+ ")
}

/// A number to seven digits.
fn number_text(number: f64) -> String {
    let rounded: f64 = format!("{number:.6e}").parse().unwrap_or(number);
    let plain = (1e-4..1e7).contains(&rounded.abs()) || rounded == 0.0;
    if plain { format!("{rounded}") } else { format!("{rounded:e}") }
}

fn place_name(system: &System, place: Place) -> String {
    match place {
        Place::Kinetic => "T".to_string(),
        Place::Potential => "V".to_string(),
        Place::Hamiltonian => "H".to_string(),
        Place::Force(i) => format!("force on {}:", system.coordinates[i].name),
        Place::Rate(i) => format!("rate of {}:", system.coordinates[i].name),
        Place::Sensor(i) => format!("sensor {}:", system.observables()[i]),
    }
}

/// Names of the coordinates and observables that terms act on.
fn acted_on(system: &System, leaves: &Leaves, terms: &[Composed]) -> Vec<String> {
    let n = system.degrees();
    let mut on = Vec::new();
    for term in terms {
        match term.place {
            Place::Force(i) | Place::Rate(i) => on.push(system.coordinates[i].name.clone()),
            Place::Sensor(i) => on.push(system.observables()[i].clone()),
            _ => {
                for factor in &term.factors {
                    let of = (0..2 * n).filter(|&i| leaves.list[factor.leaf].depends(i));
                    on.extend(of.map(|i| system.coordinates[i % n].name.clone()));
                }
            }
        }
    }
    on.sort();
    on.dedup();
    on
}
