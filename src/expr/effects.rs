//! Effects of the catalogue on the variables of a system.

use super::system::System;
use super::unit::Unit;
use crate::spec::effects::{self, Instance, Scene};

impl System {
    /// The names that an effect meets.
    pub fn scene(&self) -> Scene {
        let names = |list: &[super::system::Variable]| -> Vec<String> {
            list.iter().map(|variable| variable.name.clone()).collect()
        };
        Scene {
            coordinates: names(&self.coordinates),
            momenta: names(&self.momenta),
            observables: self.observables(),
            time: self.time.name.clone(),
        }
    }
}

/// Every effect of the catalogue on every choice of arguments where it makes sense.
///
/// Effects of angles are left out for coordinates that have another unit than that of a
/// pure number.
pub fn instances(system: &System) -> Vec<Instance> {
    let angle = |name: &String| {
        let variable = system.coordinates.iter().find(|variable| variable.name == *name);
        variable.and_then(|variable| variable.unit).is_none_or(Unit::is_number)
    };
    let mut out = effects::instances(&system.scene());
    out.retain(|instance| !instance.effect.angle || instance.arguments.iter().all(angle));
    out
}
