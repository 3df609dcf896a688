//! Terms without a name of their own: what to say when no named effect explains the misfit.

use super::grid::Reach;
use super::{Candidate, Origin, one_of, terms_of};
use crate::data::Dataset;
use crate::diagnose::tuning::Candidates;
use crate::expr::Scope;
use crate::spec::effects::ScanBy;

/// A statement whose inner parameters stand between braces.
struct Draft {
    label: String,
    on: Vec<String>,
    statement: String,
    scans: Vec<(&'static str, ScanBy)>,
}

/// Bumps of the potential and forces that are products of powers, on every coordinate.
pub fn unnamed(scope: &mut Scope, dataset: &Dataset, tuning: &Candidates) -> Vec<Candidate> {
    let system = scope.compiled().system.clone();
    let names = |list: &[crate::expr::Variable]| -> Vec<String> {
        list.iter().map(|variable| variable.name.clone()).collect()
    };
    let (coordinates, momenta) = (names(&system.coordinates), names(&system.momenta));
    let mut drafts: Vec<Draft> = Vec::new();
    for (q, p) in coordinates.iter().zip(&momenta) {
        drafts.push(Draft {
            label: format!("bump at some {q}"),
            on: vec![q.clone()],
            statement: format!("V += span{{ unnamed: exp(-(({q} - {{at}})/{{width}})^2) }}"),
            scans: vec![("at", ScanBy::Position), ("width", ScanBy::Length)],
        });
        for total in 2..=tuning.unnamed_degree {
            for power in 0..=total {
                let product = [(q, total - power), (p, power)]
                    .into_iter()
                    .filter(|(_, power)| *power > 0)
                    .map(|(x, power)| if power == 1 { x.clone() } else { format!("{x}^{power}") })
                    .collect::<Vec<_>>()
                    .join("*");
                drafts.push(Draft {
                    label: format!("force {product} on {q}"),
                    on: vec![q.clone()],
                    statement: format!("force {q} += span{{ unnamed: {product} }}"),
                    scans: Vec::new(),
                });
            }
        }
    }
    if coordinates.len() <= tuning.bump_coordinates {
        for (i, x) in coordinates.iter().enumerate() {
            for y in &coordinates[i + 1..] {
                drafts.push(Draft {
                    label: format!("bump at some {x}, {y}"),
                    on: vec![x.clone(), y.clone()],
                    statement: format!(
                        "V += span{{ unnamed: \
                         exp(-(({x} - {{at}})^2 + ({y} - {{across}})^2)/{{width}}^2) }}"
                    ),
                    scans: vec![
                        ("at", ScanBy::Position),
                        ("across", ScanBy::Position),
                        ("width", ScanBy::Length),
                    ],
                });
            }
        }
    }
    let reach = Reach::of(&system, dataset, tuning);
    let standing = system.parameters.len();
    // A spec may have such terms already.
    let held = system.terms.iter().filter_map(|term| term.name.as_deref());
    let held = held.filter(|name| name.starts_with("unnamed")).count();
    let name = if held == 0 { "unnamed".to_string() } else { format!("unnamed_{}", held + 1) };
    let candidate = |draft: Draft| {
        let mut statement = draft.statement.replace("unnamed:", &format!("{name}:"));
        let mut parameters = Vec::new();
        for (parameter, _) in &draft.scans {
            let own = format!("{parameter}_of_{name}");
            statement = statement.replace(&format!("{{{parameter}}}"), &own);
            parameters.push(own);
        }
        let lines: Vec<String> = parameters.iter().map(|own| format!("param {own} = 1")).collect();
        let extension = scope.extension(&format!("{}\n{statement}", lines.join("\n"))).ok()?;
        let terms = terms_of(&extension, |term| term.name.as_deref() == Some(name.as_str()));
        let ids = extension.parameters().map(|(id, ..)| id);
        let ids = ids.filter(|id| id.position() >= standing).collect();
        let scans: Vec<ScanBy> = draft.scans.iter().map(|(_, by)| *by).collect();
        let first = draft.on.first().map_or("", String::as_str);
        let grid = reach.grid(&scans, first);
        (!terms.is_empty()).then(|| Candidate {
            origin: Origin::Unnamed { statement, parameters },
            label: draft.label,
            on: draft.on,
            arguments: Vec::new(),
            choice: 0.0,
            second: None,
            extension,
            terms,
            parameters: ids,
            grid,
        })
    };
    let mut all: Vec<Candidate> = drafts.into_iter().filter_map(candidate).collect();
    one_of(&mut all);
    all
}
