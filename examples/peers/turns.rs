//! Contestants take turns, so that what slows the machine down slows all of them.

use std::time::Instant;

/// One turn: seconds, or why there are none.
pub(crate) type Turn<'a> = Box<dyn FnMut() -> Result<f64, String> + 'a>;

/// The fastest of `rounds` turns of each, after one that does not count.
pub(crate) fn fastest(rounds: usize, contestants: &mut [Turn]) -> Vec<Result<f64, String>> {
    let mut best: Vec<Result<f64, String>> = contestants.iter().map(|_| Ok(f64::NAN)).collect();
    for round in 0..=rounds {
        for (best, turn) in best.iter_mut().zip(contestants.iter_mut()) {
            let Ok(so_far) = *best else { continue };
            *best = turn().map(|now| if round == 0 { f64::NAN } else { so_far.min(now) });
        }
    }
    best
}

/// Seconds of processor time that a call takes on this thread; of a clock on the wall where it
/// is short or the system does not tell.
pub(crate) fn clocked<T>(call: impl FnOnce() -> T) -> (T, f64) {
    let (clock, before) = (Instant::now(), processor_seconds());
    let value = call();
    let wall = clock.elapsed().as_secs_f64();
    let spent = processor_seconds().zip(before).map(|(after, before)| after - before);
    (value, spent.filter(|_| wall > COUNTED).unwrap_or(wall))
}

/// Seconds of a clock on the wall, for what runs in another process.
pub(crate) fn on_the_wall<T>(call: impl FnOnce() -> T) -> (T, f64) {
    let clock = Instant::now();
    let value = call();
    (value, clock.elapsed().as_secs_f64())
}

/// Linux counts the nanoseconds of each thread, but looks only every few milliseconds: what is
/// shorter than this is left to the clock, and to many turns.
const COUNTED: f64 = 0.05;

fn processor_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: f64 = text.split(' ').next()?.parse().ok()?;
    Some(1e-9 * nanoseconds)
}

/// Seconds of processor time that a call waits for in other processes.
pub(crate) fn of_children<T>(call: impl FnOnce() -> T) -> (T, f64) {
    let (clock, before) = (Instant::now(), children_seconds());
    let value = call();
    let wall = clock.elapsed().as_secs_f64();
    let spent = children_seconds().zip(before).map(|(after, before)| after - before);
    (value, spent.unwrap_or(wall))
}

/// Linux counts hundredths of a second.
fn children_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    let mut fields = text.rsplit(')').next()?.split_whitespace().skip(13);
    let mut field = || fields.next()?.parse::<f64>().ok();
    Some(0.01 * (field()? + field()?))
}
