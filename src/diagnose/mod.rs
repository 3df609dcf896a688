//! Where a model fails, and what is missing.
//!
//! [`diagnosis`] is the way from candidates to a verdict, a file for each phase. A new kind of
//! candidate goes to `candidates`, a new view of the misfit to `comparison`, a new criterion for
//! the next run to `design`; numbers to tune stand in `tuning`.

pub mod candidates;
mod columns;
pub mod comparison;
pub mod context;
pub mod design;
pub mod diagnosis;
pub mod discover;
mod evidence;
pub mod instrument;
mod misfit;
pub mod noise_floor;
mod ranking;
mod refit;
pub mod scan;
mod score_test;
mod search;
mod story;
pub mod sufficiency;
pub mod tuning;
mod verdict;
mod window;
