//! Two effects at once, and whether the loop finds both and nothing else.

use leverrier::internals::diagnose::discover::{Discovery, DiscoveryOptions, discover};
use leverrier::internals::fit::Silent;

use super::bases::base;
use super::case;

/// Two effects hidden in one base.
pub(crate) struct Pair {
    /// Name of the base.
    pub base: &'static str,
    /// What is hidden, with numbers.
    pub statement: &'static str,
    /// Labels of the two effects, sorted.
    pub effects: [&'static str; 2],
}

/// The pairs of the benchmark.
pub(crate) static PAIRS: &[Pair] = &[
    Pair {
        base: "pendulum",
        statement: "force q += span{ hidden_drag: -0.05*p, hidden_tilt: 0.08*cos(q) }",
        effects: ["tilt(q)", "viscous_drag(q)"],
    },
    Pair {
        base: "trap",
        statement: "V += span{ hidden_stiffness: 0.1*x^4 }\n\
                    force x += span{ hidden_friction: -0.04*sign(px) }",
        effects: ["coulomb_friction(x)", "cubic_stiffness(x)"],
    },
    Pair {
        base: "trap",
        statement: "V += span{ hidden_coupling: 0.1*x*y }\n\
                    force x += span{ hidden_drive: 0.08*cos(1.7*t) }",
        effects: ["bilinear_coupling(x, y)", "harmonic_drive(x)"],
    },
];

impl Pair {
    /// What the loop finds, and its labels, sorted: where the data could not tell a step's effect
    /// from a hidden one, the hidden one's.
    pub(crate) fn discovered(&self, noise: f64, seed: u64) -> (Discovery, Vec<String>) {
        let base = base(self.base);
        let case = case(base, self.statement, noise, seed);
        let options = DiscoveryOptions::default();
        let (text, training, held_out) = (&case.text, &case.training, &case.held_out);
        let found = discover("learned", text, training, held_out, &options, &Silent)
            .unwrap_or_else(|error| panic!("{error}"));
        let mut labels: Vec<String> = found
            .steps
            .iter()
            .map(|step| {
                let same = |name: &&&str| step.indistinguishable.iter().any(|o| o == **name);
                self.effects.iter().find(same).map_or(step.effect.clone(), |name| name.to_string())
            })
            .collect();
        labels.sort_unstable();
        (found, labels)
    }
}
