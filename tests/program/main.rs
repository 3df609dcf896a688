//! The program as its users meet it: the command line, the examples, the README and the studio.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a panic is how a test fails"
)]

mod bad_input;
mod commands;
mod design;
mod diagnosis;
mod driven;
mod examples;
mod headers;
mod hostile_files;
mod interrupts;
mod large_data;
#[path = "../learning/measurements.rs"]
mod measurements;
mod measures;
mod readme;
mod real;
mod records;
mod report;
mod side_by_side;
mod situations;
mod studio;
mod studio_browser;
mod support;
