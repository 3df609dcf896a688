//! Training.
pub mod factor;
pub mod gauss_newton;
pub mod loss;
pub mod monitor;
pub mod options;
pub mod pass;
pub mod path;
pub mod segments;
pub mod starts;
pub mod stepping;
pub mod support;
pub mod train;
pub mod uncertainty;
pub mod unseen;
