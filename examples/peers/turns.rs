//! Contestants take turns, so that what slows the machine down slows all of them.

/// One turn: seconds, or why there are none.
pub type Turn<'a> = Box<dyn FnMut() -> Result<f64, String> + 'a>;

/// The fastest of `rounds` turns of each, after one that does not count.
pub fn fastest(rounds: usize, contestants: &mut [Turn]) -> Vec<Result<f64, String>> {
    let mut best: Vec<Result<f64, String>> = contestants.iter().map(|_| Ok(f64::NAN)).collect();
    for round in 0..=rounds {
        for (best, turn) in best.iter_mut().zip(contestants.iter_mut()) {
            let Ok(so_far) = *best else { continue };
            *best = turn().map(|now| if round == 0 { f64::NAN } else { so_far.min(now) });
        }
    }
    best
}

/// Seconds that a call takes.
pub fn clocked<T>(call: impl FnOnce() -> T) -> (T, f64) {
    let clock = std::time::Instant::now();
    let value = call();
    (value, clock.elapsed().as_secs_f64())
}
