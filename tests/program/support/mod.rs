//! The program, the studio and a browser, as several test files use them.

pub mod browser;
pub mod http;
pub mod program;
pub mod studio;
