//! Equations of motion: compiled, integrated, and differentiated exactly.
//!
//! [`Dynamics`] compiles a [`System`](crate::expr::System); [`advance`] moves a [`Batch`] of
//! trajectories by any row of [`METHODS`], together with the Jacobian of the discrete map.

mod adjoint;
mod batch;
mod equations;
mod explicit;
mod flow;
mod implicit;
mod integrate;
mod methods;
mod observe;
mod splitting;
mod steps;
pub mod systems;
mod trajectory;

pub use adjoint::{PulledBack, Recording, pull_back, pull_back_observed};
pub use batch::{Batch, Scratch};
pub use equations::Dynamics;
pub use integrate::advance;
pub use methods::{Kind, METHODS, Method, MethodRow, Tableau};
pub use observe::observe;
pub use steps::{StepChoice, choose_steps};
pub use trajectory::{Pace, Stop, Trajectory, finest_method, simulate};
