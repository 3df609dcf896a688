//! Equations of motion: compiled, integrated, and differentiated exactly.
//!
//! [`Dynamics`] compiles a [`System`](crate::expr::System); [`advance`] moves a [`Batch`] of
//! trajectories by any row of [`METHODS`], together with the Jacobian of the discrete map.

mod batch;
mod equations;
mod flow;
mod integrate;
mod methods;
mod observe;
mod splitting;
pub mod systems;

pub use batch::{Batch, Scratch};
pub use equations::Dynamics;
pub use integrate::advance;
pub use methods::{Kind, METHODS, Method, MethodRow, Tableau};
pub use observe::observe;
