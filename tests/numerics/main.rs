//! The language, its expressions, their evaluation and integration, and the laws that are
//! simplified and exported.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a panic is how a test fails"
)]

mod bodies;
mod derivatives;
mod driven;
mod driven_exports;
mod effects;
mod elementary;
mod evaluators;
mod export_cases;
mod exporters;
mod extension;
mod functions;
mod holonomic;
mod hostile_text;
mod instruction_counts;
mod integrators;
mod internal_states;
mod lagrangian;
mod language;
mod meaning;
mod measures;
mod numbers;
mod probes;
mod rules;
mod simplify;
mod suite;
mod support;
mod switching;
mod taylor;
mod trajectories;
