//! From data to a law: files, fits, what is missing of a model, and how it is shown.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a panic is how a test fails"
)]

mod bad_data;
mod boards;
mod changes;
mod clock;
mod clothes;
mod composed;
mod data;
mod design;
mod detectors;
mod diagnosis;
mod driven;
mod errors;
#[allow(dead_code, reason = "the example of the same name uses the rest")]
mod hidden;
mod hidden_effects;
mod hidden_parts;
mod holonomic;
mod instruments;
mod kinks;
mod lagrangian;
mod local;
mod measurements;
mod measures;
mod paper;
mod parquet_data;
mod parts;
mod per_run;
mod plots;
mod reach;
mod recovery;
mod seasons;
mod settling;
mod stored_files;
mod stories;
mod stream;
mod trainer;
mod unfit_data;
