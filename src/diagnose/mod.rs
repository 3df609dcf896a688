//! Where a model fails, and what is missing.
//!
//! [`diagnosis`] is the way from candidates to a verdict, a file for each phase. A new kind of
//! candidate goes to `candidates`, a new view of the misfit to `comparison`, a new criterion for
//! the next run to `design`; numbers to tune stand in `tuning`, a field of the [`Options`].

pub mod autocorrelation;
pub mod candidates;
mod clearness;
mod columns;
pub mod comparison;
mod description;
pub mod design;
pub mod diagnosis;
pub mod discover;
mod doubts;
mod effect;
mod evidence;
mod function_space;
mod growth;
pub mod hidden;
mod in_part;
pub mod instrument;
pub mod law_on_data;
mod misfit;
mod naming;
pub mod noise_floor;
pub mod options;
mod ranking;
pub mod refit;
mod rest;
mod restarting;
mod rounding;
pub mod scan;
mod score_test;
mod search;
pub mod settling;
mod steps;
mod story;
pub mod sufficiency;
pub mod times;
mod together;
pub mod tuning;
mod tuning_check;
mod verdict;
mod whiteness;
mod window;

pub use law_on_data::{LawOnData, Measurements};
pub use options::Options;
