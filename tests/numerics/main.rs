//! The language, its expressions, their evaluation and integration, and the laws that are
//! simplified and exported.

mod derivatives;
mod effects;
mod elementary;
mod evaluators;
mod export_cases;
mod exporters;
mod instruction_counts;
mod integrators;
mod language;
mod meaning;
mod probes;
mod rules;
mod simplify;
mod suite;
mod support;
mod taylor;
mod trajectories;
