//! The program as its users meet it: the command line, the examples, the README and the studio.

mod bad_input;
mod commands;
mod design;
mod diagnosis;
mod examples;
mod large_data;
#[path = "../learning/measurements.rs"]
mod measurements;
mod readme;
mod real;
mod report;
mod situations;
mod studio;
mod studio_browser;
mod support;
