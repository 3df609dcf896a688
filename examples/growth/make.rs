//! Noisy transitions of the Hénon-Heiles system, written as fast as a disk takes them.

use std::fs::File;
use std::path::Path;

use leverrier::internals::data::{Clock, Dataset, Layout, ParquetWriter, Run};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;
use rayon::prelude::*;

/// Time between the two samples of a transition.
const STEP: f64 = 0.1;
/// Standard deviation of the noise on every number.
pub(crate) const SIGMA: f64 = 0.005;
/// Transitions that are made at a time.
const BLOCK: u64 = 1 << 17;

/// Writes transitions with energies between 1/12 and 1/6.
pub(crate) fn write(path: &Path, transitions: u64) {
    let observables: Vec<String> = ["q1", "q2", "p1", "p2"].map(String::from).to_vec();
    let file = File::create(path).expect("a file that can be written");
    let mut writer = ParquetWriter::new(path, file, &observables, &Layout::default(), true)
        .expect("a file that can be written");
    let blocks: Vec<u64> = (0..transitions.div_ceil(BLOCK)).collect();
    for blocks in blocks.chunks(8) {
        let made: Vec<Dataset> = blocks
            .par_iter()
            .map(|block| {
                let count = BLOCK.min(transitions - block * BLOCK);
                let runs = pairs(*block, count);
                Dataset { observables: observables.clone(), runs, inputs: Vec::new() }
            })
            .collect();
        for data in &made {
            writer.push(data).expect("room on the disk");
        }
    }
    writer.finish().expect("room on the disk");
}

fn pairs(block: u64, count: u64) -> Vec<Run> {
    let mut generator = Pcg64::seed_from_u64(block);
    let noise = Normal::new(0.0, SIGMA).expect("a positive width");
    (0..count)
        .map(|at| {
            let start = loop {
                let mut within = |low: f64, high: f64| generator.random_range(low..high);
                let state =
                    [within(-1.0, 1.0), within(-0.5, 1.0), within(-1.0, 1.0), within(-1.0, 1.0)];
                if (1.0 / 12.0..1.0 / 6.0).contains(&energy(state)) {
                    break state;
                }
            };
            let end = later(start);
            let mut measured = |x: f64| x + noise.sample(&mut generator);
            Run {
                name: (block * BLOCK + at + 1).to_string(),
                times: vec![0.0, STEP],
                values: (0..4).map(|i| vec![measured(start[i]), measured(end[i])]).collect(),
                lines: vec![0; 2],
                clock: Clock::default(),
                inputs: Vec::new(),
                groups: Vec::new(),
                errors: Vec::new(),
            }
        })
        .collect()
}

fn energy([q1, q2, p1, p2]: [f64; 4]) -> f64 {
    0.5 * (p1 * p1 + p2 * p2 + q1 * q1 + q2 * q2) + q1 * q1 * q2 - q2 * q2 * q2 / 3.0
}

/// Two steps of the fourth-order method of Forest and Ruth: far below the noise.
fn later(mut state: [f64; 4]) -> [f64; 4] {
    let root = 2f64.cbrt();
    let outer = 1.0 / (2.0 - root);
    for _ in 0..2 {
        for part in [outer, -root * outer, outer] {
            let step = part * STEP / 2.0;
            let [q1, q2, p1, p2] = &mut state;
            *q1 += 0.5 * step * *p1;
            *q2 += 0.5 * step * *p2;
            *p1 -= step * (*q1 + 2.0 * *q1 * *q2);
            *p2 -= step * (*q2 + *q1 * *q1 - *q2 * *q2);
            *q1 += 0.5 * step * *p1;
            *q2 += 0.5 * step * *p2;
        }
    }
    state
}
