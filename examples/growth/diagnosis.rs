//! Growth of a diagnosis with the number of samples.

use std::time::Instant;

use super::trap::Trap;

/// Times that each is asked.
pub(crate) const TURNS: usize = 15;

/// Time of a diagnosis with the whole catalogue, in seconds.
pub(crate) struct Asked {
    /// That the model was fitted to; as many again are held out.
    pub samples: usize,
    /// Candidates times grid points.
    pub tried: usize,
    /// Effect that was named, for the reader to check.
    pub named: String,
    pub fastest: f64,
    pub median: f64,
}

pub(crate) fn by_samples() -> Vec<Asked> {
    [1_250, 2_500, 5_000, 10_000, 40_000].map(asked).into()
}

fn asked(samples: usize) -> Asked {
    let trap = Trap::new(samples);
    let mut times = Vec::new();
    let mut last = None;
    for _ in 0..TURNS {
        let clock = Instant::now();
        last = Some(trap.diagnose());
        times.push(clock.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    let (fastest, median) = (times[0], times[TURNS / 2]);
    let found = last.expect("it was asked");
    let named = found.ranking.first().map_or(String::new(), |leader| leader.effect.clone());
    println!("diagnosis of {samples} samples: {fastest:.3} s, median {median:.3} s, {named}");
    Asked { samples, tried: found.tests, named, fastest, median }
}
