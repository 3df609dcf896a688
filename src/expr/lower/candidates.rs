//! The user's own effects: listed, and checked before anybody adds them.

use std::collections::HashSet;

use super::Lowering;
use crate::diagnostic::{Diagnostic, Severity, Span};
use crate::spec::MOST_CANDIDATES;
use crate::spec::ast::{EnergyPart, StatementKind, SyntaxTree};
use crate::spec::resolve::resolve;

/// An effect that a spec declares with `candidates`; `effect NAME` adds it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DeclaredCandidate {
    /// Its name in the spec.
    pub name: String,
    /// Its statements, as they were written.
    pub statements: Vec<String>,
    /// Where it is declared.
    pub span: Span,
}

/// The candidates of a spec, in the order of its text.
pub(super) fn list(spec: &SyntaxTree, text: &str) -> Vec<DeclaredCandidate> {
    let lists = spec.statements.iter().filter_map(|statement| match &statement.kind {
        StatementKind::Candidates(list) => Some(list),
        _ => None,
    });
    let written = |span: Span| text.get(span.range()).unwrap_or_default().to_string();
    lists
        .flatten()
        .map(|candidate| DeclaredCandidate {
            name: candidate.name.text.clone(),
            statements: candidate.statements.iter().map(|s| written(s.site.0)).collect(),
            span: candidate.site.0,
        })
        .collect()
}

/// What is wrong with candidates, each taken by itself with the declarations of the spec.
pub(super) fn check(spec: &SyntaxTree) -> Vec<Diagnostic> {
    let mut out = Vec::new();
    let mut seen = HashSet::new();
    // Velocities in forces follow from these energies.
    let of_velocities = resolve(spec, &mut Vec::new()).has_lagrangian();
    let declarations: Vec<_> = (spec.statements.iter())
        .filter(|statement| match statement.kind {
            StatementKind::Variables { .. }
            | StatementKind::Time { .. }
            | StatementKind::Input { .. }
            | StatementKind::Hidden(..)
            | StatementKind::Measure { .. }
            | StatementKind::Data { .. }
            | StatementKind::Constant { .. }
            | StatementKind::Parameter { .. } => true,
            StatementKind::Energy { part, .. } => {
                of_velocities && matches!(part, EnergyPart::Kinetic | EnergyPart::Lagrangian)
            }
            _ => false,
        })
        .cloned()
        .collect();
    let lists = spec.statements.iter().filter_map(|statement| match &statement.kind {
        StatementKind::Candidates(list) => Some(list),
        _ => None,
    });
    for list in lists {
        for candidate in list.iter().take(MOST_CANDIDATES) {
            let mut alone =
                SyntaxTree { statements: declarations.clone(), lost: spec.lost.clone() };
            alone.statements.extend(candidate.statements.iter().cloned());
            for statement in alone.statements.iter_mut().skip(declarations.len()) {
                if let StatementKind::Energy { adds, .. } = &mut statement.kind {
                    *adds = true;
                }
            }
            let mut found = Vec::new();
            let resolved = resolve(&alone, &mut found);
            let mut lowering = Lowering::new(&resolved, None);
            lowering.run();
            found.append(&mut lowering.diagnostics);
            let inside = candidate.site.0;
            found.retain(|diagnostic| {
                diagnostic.severity == Severity::Error
                    && inside.start <= diagnostic.span.start
                    && diagnostic.span.end <= inside.end
                    && diagnostic.span.end > 0
                    && seen.insert((diagnostic.span, diagnostic.message.clone()))
            });
            out.append(&mut found);
        }
    }
    out
}
