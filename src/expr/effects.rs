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
        let bodies = self.bodies();
        Scene {
            groups: self.groups(&bodies),
            bodies,
            coordinates: names(&self.coordinates),
            momenta: names(&self.momenta),
            observables: self.observables(),
            time: self.time.name.clone(),
            // Their statements are expanded where the spec is known.
            velocities: false,
            inputs: (self.inputs.iter().filter(|input| !input.own))
                .map(|input| input.variable.name.clone())
                .collect(),
        }
    }
}

/// Every effect of the catalogue on every choice of arguments where it makes sense.
///
/// Effects of angles are left out for coordinates that have another unit than that of a
/// pure number, and effects of a distance for coordinates in different units.
pub fn instances(system: &System) -> Vec<Instance> {
    let unit =
        |name: &String| system.coordinates.iter().find(|variable| variable.name == *name)?.unit;
    let angle = |name: &String| unit(name).is_none_or(Unit::is_number);
    let one_unit = |names: &[String]| match names {
        [first, second] => unit(first).zip(unit(second)).is_none_or(|(a, b)| a.agrees(b)),
        _ => true,
    };
    let mut out = effects::instances(&system.scene());
    out.retain(|instance| !instance.effect.angle || instance.arguments.iter().all(angle));
    out.retain(|instance| !instance.effect.one_unit || one_unit(&instance.arguments));
    out
}
