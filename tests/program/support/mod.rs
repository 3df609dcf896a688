//! The program, the studio and a browser, as several test files use them.

pub(crate) mod browser;
pub(crate) mod http;
pub(crate) mod program;
pub(crate) mod studio;
