//! A measured record, and how well a law follows it from its input alone.

use std::path::Path;

use leverrier::Law;

/// One input and one output over time.
pub(crate) struct Record {
    pub times: Vec<f64>,
    pub input: Vec<f64>,
    pub output: Vec<f64>,
}

impl Record {
    /// The columns of a file of comma-separated values whose first is the time; none where there
    /// is no such file.
    pub(crate) fn read(path: &Path, input: &str, output: &str) -> Option<Record> {
        let text = std::fs::read_to_string(path).ok()?;
        let mut lines = text.lines();
        let header: Vec<&str> = lines.next()?.split(',').collect();
        let column = |name: &str| {
            let plain = |cell: &&str| cell.split('[').next().unwrap_or(cell).trim() == name;
            header.iter().position(plain)
        };
        let (u, y) = (column(input)?, column(output)?);
        let mut record = Record { times: Vec::new(), input: Vec::new(), output: Vec::new() };
        for line in lines.filter(|line| !line.is_empty()) {
            let cells: Vec<f64> =
                line.split(',').map(|cell| cell.parse().expect("a number")).collect();
            record.times.push(cells[0]);
            record.input.push(cells[u]);
            record.output.push(cells[y]);
        }
        Some(record)
    }

    /// Some of its rows, counted from 0.
    pub(crate) fn part(&self, start: usize, end: usize) -> Record {
        let cut = |all: &[f64]| all[start..end.min(all.len())].to_vec();
        Record { times: cut(&self.times), input: cut(&self.input), output: cut(&self.output) }
    }
}

/// What the law shows at each time, from a state at the first.
fn follow(law: &Law, record: &Record, start: &[f64; 2], samples: usize) -> Vec<f64> {
    let times = &record.times[..samples];
    let motion =
        law.predict_driven(start, times, &record.times, &[&record.input]).expect("a motion");
    motion.column("q").expect("the coordinate")
}

/// Root mean square of measured minus simulated over the whole record; the initial state is that
/// which fits the first `free` outputs best (Gauss-Newton, derivatives by differences).
pub(crate) fn rms(law: &Law, record: &Record, free: usize) -> f64 {
    let square = law.terms().iter().find(|term| term.term == "p^2").expect("a mass").coefficient;
    let mass = 0.5 / square;
    let pace = (record.output[1] - record.output[0]) / (record.times[1] - record.times[0]);
    let mut start = [record.output[0], mass * pace];
    let spread = record.output.iter().fold(0.0f64, |most, y| most.max(y.abs()));
    let step = record.times[1] - record.times[0];
    let sizes = [1e-4 * spread, 1e-4 * mass * spread / (10.0 * step)];
    for _ in 0..6 {
        let here = follow(law, record, &start, free);
        let column = |k: usize| -> Vec<f64> {
            let mut moved = start;
            moved[k] += sizes[k];
            let there = follow(law, record, &moved, free);
            there.iter().zip(&here).map(|(a, b)| (a - b) / sizes[k]).collect()
        };
        let (a, b) = (column(0), column(1));
        let rest: Vec<f64> = record.output.iter().zip(&here).map(|(y, x)| y - x).collect();
        let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
        let (aa, ab, bb) = (dot(&a, &a), dot(&a, &b), dot(&b, &b));
        let (ar, br) = (dot(&a, &rest), dot(&b, &rest));
        let determinant = aa * bb - ab * ab;
        start[0] += (bb * ar - ab * br) / determinant;
        start[1] += (aa * br - ab * ar) / determinant;
    }
    let all = follow(law, record, &start, record.times.len());
    let squares: f64 = record.output.iter().zip(&all).map(|(y, x)| (y - x).powi(2)).sum();
    (squares / all.len() as f64).sqrt()
}
