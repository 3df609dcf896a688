//! Data sets made by a law: trajectories near machine precision, then what an instrument
//! does to them.

mod draw;
mod driven;
mod held;
mod inputs;
mod instrument;
mod trajectory;

pub use draw::{InitialDistribution, Interval, draw};
pub use inputs::InputRecord;
pub use instrument::{NoiseLevel, add_noise, consecutive_pairs, drop_samples};
pub use trajectory::{
    EnergyConservation, IntegrationRecord, IntegratorChoice, Simulator, Trajectories,
};
