//! A trap with a drag that its model does not know of: what a diagnosis is timed on.

use leverrier::internals::data::Dataset;
use leverrier::internals::diagnose;
use leverrier::internals::diagnose::diagnosis::{Diagnosis, diagnose};
use leverrier::internals::expr::{Compiled, build};
use leverrier::internals::fit::{Model, Options, Silent, fit};
use leverrier::internals::simulate::Simulator;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

const VARIABLES: &str = "coordinates x, y\nmomenta px, py\n";
const LAW: &str = "T = (px^2 + py^2)/2\nV = x^2/2 + 0.7*y^2\nforce x += -0.04*px\n";
const SPACE: &str = "T = (px^2 + py^2)/2\nV = span{ x^2, y^2 }\n";
/// Samples of a run.
const RUN: usize = 250;

/// A model that was learned without the drag, and measurements.
pub(crate) struct Trap {
    learned: Compiled,
    model: Model,
    training: Dataset,
    held_out: Dataset,
}

impl Trap {
    /// With so many noisy samples, and as many again that are held out.
    pub(crate) fn new(samples: usize) -> Trap {
        let truth = build("truth", &format!("{VARIABLES}{LAW}")).expect("a sound spec");
        let mut generator = Pcg64::seed_from_u64(1);
        let starts: Vec<Vec<f64>> = (0..2 * samples / RUN)
            .map(|_| (0..4).map(|_| generator.random_range(-1.0..1.0)).collect())
            .collect();
        let times: Vec<f64> = (0..RUN).map(|i| 0.1 * i as f64).collect();
        let simulator = Simulator::known(&truth.system);
        let motion = simulator.trajectories(&starts, &times).expect("it stays finite");
        let mut data = motion.dataset(&truth.system);
        for x in data.runs.iter_mut().flat_map(|run| run.values.iter_mut()).flatten() {
            let draw: f64 = StandardNormal.sample(&mut generator);
            *x += 0.01 * draw;
        }
        let split = data.split_held_out(0.5, 1);
        let text = format!("{VARIABLES}{SPACE}");
        let learned = build("learned", &text).expect("a sound spec");
        let options = Options::default();
        let model = fit(&learned.system, &split.training, &options, &Silent).expect("a model");
        Trap { learned, model, training: split.training, held_out: split.held_out }
    }

    /// Asks the whole catalogue what is missing.
    pub(crate) fn diagnose(&self) -> Diagnosis {
        let Trap { learned, model, training, held_out } = self;
        let law = model.law(&learned.system).expect("its own");
        let options = diagnose::Options::default();
        diagnose(learned, &law, training, held_out, &options, &Silent).expect("an answer")
    }
}
