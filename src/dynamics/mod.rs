//! Equations of motion: compiled, integrated, and differentiated exactly.
//!
//! [`Dynamics`] compiles a [`System`](crate::expr::System) with some of its learned terms;
//! [`advance`] moves a [`Batch`] of trajectories by any row of [`METHODS`], together with the
//! Jacobian of the discrete map; [`pull_back`] is the transpose of that Jacobian. [`observe`]
//! says what is measured of a state, [`choose_steps`] what to integrate with, and [`simulate`]
//! follows whole trajectories.
//!
//! Everything is laid out lane by lane: a state is `[2n][lanes]`, a tangent
//! `[2n][2n + P][lanes]`, coordinates before momenta, columns of the initial state before those
//! of theta. 128 lanes, or a multiple, suit the batched evaluator and the caches best.

mod adjoint;
mod batch;
mod drive;
mod equations;
mod events;
mod explicit;
mod flow;
mod gradient;
mod holonomic;
mod implicit;
mod instrument;
mod integrate;
mod internal;
mod lanes;
mod local;
mod margins;
mod methods;
mod observe;
mod splitting;
mod steps;
mod switches;
pub mod systems;
mod taylor;
mod trajectory;

pub use adjoint::{PulledBack, Recording, pull_back, pull_back_observed};
pub(crate) use batch::KeptScratch;
pub use batch::{Batch, Scratch};
pub use drive::Drive;
pub use equations::Dynamics;
pub use events::advance;
pub(crate) use local::{Couplings, LANES, TangentPattern};
pub use methods::{METHODS, Method, MethodKind, MethodRow, Tableau};
pub use observe::observe;
pub use steps::{StepChoice, choose_steps};
pub use taylor::{TaylorRun, taylor};
pub use trajectory::{StepControl, Stop, Trajectory, finest_method, simulate};
