//! What the program promises where things go wrong: the short forms of the habits of
//! docs/reliability.md. Their long forms are those of the example `reliability`.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a panic is how a test fails"
)]

mod choices;
mod clothes;
mod fuzz;
mod grammar;
#[allow(dead_code, reason = "the benchmark of hidden effects uses the rest")]
#[path = "../learning/hidden/mod.rs"]
mod hidden;
mod killing;
mod mutated;
mod promises;
mod runs;
mod short;
#[allow(dead_code, reason = "the numeric tests use the rest")]
#[path = "../numerics/support.rs"]
mod support;
#[allow(dead_code, reason = "the page says what each is")]
mod targets;
mod twins;
mod versions;
