//! Runs one after the other in memory.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

use rayon::prelude::*;

use super::record::{PackedInput, Record};
use super::{Clock, Dataset, MeasuredInput, Run};

/// What was measured, run after run in one column for each observable.
///
/// The runs of a data set lie wherever they were read to, and a pass over many short ones waits
/// for memory at each of them; here they lie in the order in which they are needed. That takes as
/// much memory again as the numbers of the data set.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Packed {
    record: Arc<Record>,
    typical: OnceLock<f64>,
    /// What the times of each run are counted from; empty where all are from zero.
    clocks: Vec<Clock>,
    /// Of each [grouping](super::Mapping::groups) the group of every run: the first run of it, and
    /// its name.
    groups: Vec<Vec<(usize, String)>>,
    /// `[observable][sample]`, standard errors as parts of the middle one; empty for observables
    /// that have none, and altogether where none has.
    errors: Vec<Vec<f64>>,
    /// First guesses of observables that no column holds, laid out as `values` are; empty where
    /// there are none.
    guessed: OnceLock<Vec<Vec<f64>>>,
}

/// Runs of each pile that one thread copies at a time.
const SIDE_BY_SIDE: usize = 64;

impl Packed {
    /// All runs of a data set, dealt like cards on so many piles: each pile lies together.
    pub fn of(dataset: &Dataset, piles: usize) -> Packed {
        let runs = &dataset.runs;
        // Runs are read in the order in which they were made, and each has its pile to go to.
        let piles = piles.max(1);
        let deal = piles * SIDE_BY_SIDE;
        let sizes = |runs: &[Run]| {
            let mut sizes = vec![0; piles];
            for dealt in runs.chunks(piles) {
                sizes.iter_mut().zip(dealt).for_each(|(size, run)| *size += run.times.len());
            }
            (sizes, runs.iter().map(|run| run.values.len()).max())
        };
        let sizes: Vec<(Vec<usize>, Option<usize>)> = runs.par_chunks(deal).map(sizes).collect();
        let observables = sizes.iter().filter_map(|part| part.1).max().unwrap_or(0);
        let driving = MeasuredInput::places(&dataset.inputs).1;
        let samples = sizes.iter().flat_map(|part| &part.0).sum();
        // Zeros that nobody has written yet: the threads share the work of making room for them.
        let mut times = vec![0.0; samples];
        let mut values: Vec<Vec<f64>> =
            (0..observables + driving).map(|_| vec![0.0; samples]).collect();
        let mut places = vec![[0; 2]; runs.len()];
        let columns = std::iter::once(&mut times).chain(&mut values);
        let rooms = rooms(sizes.iter().map(|part| part.0.as_slice()).collect(), columns.collect());
        let dealt = runs.par_chunks(deal).zip(places.par_chunks_mut(deal));
        rooms.into_par_iter().zip(dealt).for_each(|(mut room, (runs, places))| {
            for (at, (run, place)) in runs.iter().zip(places).enumerate() {
                *place = room.put(run, observables, at % piles);
            }
        });
        let far = runs.iter().any(|run| run.clock != Clock::default());
        let clocks = if far { runs.iter().map(|run| run.clock).collect() } else { Vec::new() };
        let groups = groups(runs);
        let record = Arc::new(Record { times, values, places, ..Record::default() });
        let mut packed = Packed { record, clocks, groups, ..Packed::default() };
        packed.errors = packed.errors(runs, observables);
        packed.driven_by(observables, &dataset.inputs)
    }

    /// Standard errors of all observables; 1 where a run gives none.
    fn errors(&self, runs: &[Run], observables: usize) -> Vec<Vec<f64>> {
        fn of(run: &Run, observable: usize) -> Option<&[f64]> {
            run.errors.get(observable).filter(|errors| !errors.is_empty()).map(Vec::as_slice)
        }
        let any = |observable: &usize| runs.iter().any(|run| of(run, *observable).is_some());
        if !(0..observables).any(|observable| any(&observable)) {
            return Vec::new();
        }
        let column = |observable: usize| {
            if !any(&observable) {
                return Vec::new();
            }
            let own = runs.iter().map(|run| of(run, observable).unwrap_or_default());
            let mut column = self.column_of(own);
            column.iter_mut().filter(|error| error.is_nan()).for_each(|error| *error = 1.0);
            column
        };
        (0..observables).map(column).collect()
    }

    /// The standard errors of what a run shows of an observable, as parts of the middle one of all;
    /// nothing where there are none.
    pub fn errors_of(&self, observable: usize, run: usize) -> &[f64] {
        let column = self.errors.get(observable).map_or(&[][..], Vec::as_slice);
        column.get(self.samples_of(run)).unwrap_or_default()
    }

    /// The same with inputs, whose columns stand behind those of so many observables.
    pub fn driven_by(mut self, observables: usize, inputs: &[MeasuredInput]) -> Packed {
        let places = MeasuredInput::places(inputs).0;
        let packed = |(place, input): (usize, &MeasuredInput)| PackedInput {
            column: observables + place,
            between: input.between,
        };
        let inputs = places.into_iter().zip(inputs).map(packed).collect();
        Arc::make_mut(&mut self.record).inputs = inputs;
        self
    }

    /// How many inputs drive the runs, and the number of coefficients that polynomials of all of
    /// them have.
    pub fn driven(&self) -> (usize, usize) {
        let inputs = &self.record.inputs;
        let powers = inputs.iter().map(|input| input.between.coefficients()).max();
        (inputs.len(), powers.unwrap_or(0))
    }

    /// Coefficients, lowest power first, of an input in the time since a sample of a run, until the
    /// next sample; where nothing is followed beyond that sample (`ends`), as it came there.
    pub fn driving(&self, input: usize, run: usize, sample: usize, ends: bool, out: &mut [f64]) {
        self.record.driving(input, run, sample, ends, out);
    }

    /// What was recorded, for those who look inputs up at other times than those of a motion.
    pub fn record(&self) -> &Arc<Record> {
        &self.record
    }

    /// Columns that are one run already, `[observable][sample]`.
    pub fn run_of(times: Vec<f64>, values: Vec<Vec<f64>>) -> Packed {
        let places = vec![[0, times.len()]];
        let record = Arc::new(Record { times, values, places, ..Record::default() });
        Packed { record, ..Packed::default() }
    }

    /// How many runs there are.
    pub fn runs(&self) -> usize {
        self.record.places.len()
    }

    /// The group of a run by one of the groupings of the data, as the first run that belongs to it;
    /// itself where the data know of no groups.
    pub fn group_of(&self, by: usize, run: usize) -> usize {
        self.groups.get(by).and_then(|of| of.get(run)).map_or(run, |group| group.0)
    }

    /// The name of that group.
    pub fn group_name(&self, by: usize, run: usize) -> String {
        let group = self.groups.get(by).and_then(|of| of.get(run));
        group.map_or_else(|| (run + 1).to_string(), |group| group.1.clone())
    }

    /// How many samples there are in all.
    pub fn samples(&self) -> usize {
        self.record.times.len()
    }

    /// Number of samples of the longest run.
    pub fn longest_run(&self) -> usize {
        self.record.places.iter().map(|[start, end]| end - start).max().unwrap_or(0)
    }

    /// The same columns of several runs: which clock each has, for `clock_of`. All samples belong
    /// to each of the runs.
    pub fn runs_of(times: Vec<f64>, values: Vec<Vec<f64>>, clocks: Vec<Clock>) -> Packed {
        let places = vec![[0, times.len()]; clocks.len()];
        let record = Arc::new(Record { times, values, places, ..Record::default() });
        Packed { record, clocks, ..Packed::default() }
    }

    /// What the times of a run are counted from.
    pub fn clock_of(&self, run: usize) -> Clock {
        self.clocks.get(run).copied().unwrap_or_default()
    }

    /// Sample times of a run since its clock's origin, in the spec's time unit, strictly
    /// increasing.
    pub fn times_of(&self, run: usize) -> &[f64] {
        self.record.times_of(run)
    }

    /// What a run shows of an observable; nothing where it was never measured.
    pub fn values_of(&self, observable: usize, run: usize) -> &[f64] {
        self.column(observable).get(self.samples_of(run)).unwrap_or_default()
    }

    /// What may stand for an observable of a run that no column holds, as a first guess; nothing
    /// where there is none.
    pub fn guessed_of(&self, observable: usize, run: usize) -> &[f64] {
        let columns = self.guessed.get().map_or(&[][..], Vec::as_slice);
        let column = columns.get(observable).map_or(&[][..], Vec::as_slice);
        column.get(self.samples_of(run)).unwrap_or_default()
    }

    /// Sets such guesses, if nobody did: columns of [`Packed::column_of`], empty for those that
    /// have none.
    pub fn guess(&self, by: impl FnOnce() -> Vec<Vec<f64>>) {
        // Nobody waits for them: who guesses on many threads may be given work that asks for the
        // same, and the first come stay.
        if self.guessed.get().is_none() {
            let _ = self.guessed.set(by());
        }
    }

    /// The values of every run as one column.
    pub fn column_of<'a>(&self, runs: impl Iterator<Item = &'a [f64]>) -> Vec<f64> {
        let mut column = vec![f64::NAN; self.samples()];
        for (run, values) in runs.enumerate() {
            let place = column.get_mut(self.samples_of(run));
            if let Some(place) = place.filter(|place| place.len() == values.len()) {
                place.copy_from_slice(values);
            }
        }
        column
    }

    /// What all runs show of an observable, pile after pile.
    pub fn column(&self, observable: usize) -> &[f64] {
        self.record.values.get(observable).map_or(&[], Vec::as_slice)
    }

    /// The median interval between consecutive samples of a run; 0 when there is none.
    pub fn typical_step(&self) -> f64 {
        let runs = || (0..self.runs()).map(|run| self.times_of(run));
        *self.typical.get_or_init(|| typical_step(runs()))
    }

    fn samples_of(&self, run: usize) -> Range<usize> {
        self.record.samples_of(run)
    }
}

/// Of each grouping the group that every run belongs to: its first run, and its name.
fn groups(runs: &[Run]) -> Vec<Vec<(usize, String)>> {
    let count = runs.iter().map(|run| run.groups.len()).max().unwrap_or(0);
    let mut all = Vec::with_capacity(count);
    for by in 0..count {
        let mut first: HashMap<&str, usize> = HashMap::new();
        for (at, run) in runs.iter().enumerate() {
            first.entry(run.group(by)).or_insert(at);
        }
        let group = |(at, run): (usize, &Run)| {
            let name = run.group(by);
            (first.get(name).copied().unwrap_or(at), name.to_string())
        };
        all.push(runs.iter().enumerate().map(group).collect());
    }
    all
}

/// The median interval between consecutive times of runs; 0 when there is none.
pub fn typical_step<'a>(runs: impl Iterator<Item = &'a [f64]>) -> f64 {
    let mut steps: Vec<f64> = runs
        .flat_map(|times| times.array_windows().map(|[before, after]| after - before))
        .collect();
    if steps.is_empty() {
        return 0.0;
    }
    let middle = steps.len() / 2;
    *steps.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// What is still empty of a part of each pile.
struct Room<'a> {
    /// Of each pile the first sample that is empty.
    starts: Vec<usize>,
    /// `[pile][column]`, the times first.
    columns: Vec<&'a mut [f64]>,
}

/// Shares whole columns out, pile after pile, to parts of the runs; `sizes` are the samples that
/// each part has for each pile.
fn rooms<'a>(sizes: Vec<&[usize]>, columns: Vec<&'a mut Vec<f64>>) -> Vec<Room<'a>> {
    let mut rest: Vec<&mut [f64]> = columns.into_iter().map(Vec::as_mut_slice).collect();
    let piles = sizes.first().map_or(0, |sizes| sizes.len());
    let empty = || Room {
        starts: Vec::with_capacity(piles),
        columns: Vec::with_capacity(piles * rest.len()),
    };
    let mut rooms: Vec<Room> = sizes.iter().map(|_| empty()).collect();
    let mut start = 0;
    for pile in 0..piles {
        for (room, sizes) in rooms.iter_mut().zip(&sizes) {
            let size = sizes.get(pile).copied().unwrap_or(0);
            room.starts.push(start);
            room.columns.extend(rest.iter_mut().filter_map(|all| all.split_off_mut(..size)));
            start += size;
        }
    }
    rooms
}

impl Room<'_> {
    /// Copies a run to where its pile is empty; gives its samples.
    fn put(&mut self, run: &Run, observables: usize, pile: usize) -> [usize; 2] {
        let samples = run.times.len();
        let measured = (0..observables).map(|observable| run.values.get(observable));
        let measured = std::iter::once(Some(&run.times)).chain(measured);
        let measured = measured.chain(run.inputs.iter().map(Some));
        let missing = std::iter::repeat(None);
        let width = self.columns.len() / self.starts.len();
        let columns = self.columns.iter_mut().skip(pile * width).take(width);
        for (column, values) in columns.zip(measured.chain(missing)) {
            let Some(place) = column.split_off_mut(..samples) else { continue };
            match values {
                Some(values) => place.copy_from_slice(values),
                None => place.fill(f64::NAN),
            }
        }
        let Some(empty) = self.starts.get_mut(pile) else { return [0, 0] };
        let start = std::mem::replace(empty, *empty + samples);
        [start, start + samples]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_lie_one_after_the_other() {
        let run = |length: usize, columns: usize| Run {
            name: String::new(),
            times: (0..length).map(|i| i as f64).collect(),
            values: (0..columns).map(|c| vec![(10 * length + c) as f64; length]).collect(),
            lines: vec![0; length],
            clock: Clock::default(),
            inputs: Vec::new(),
            groups: Vec::new(),
            errors: Vec::new(),
        };
        // More runs than one thread copies, of different lengths, one of them without a column.
        let mut runs: Vec<Run> = (0..7 * SIDE_BY_SIDE + 4).map(|i| run(1 + i % 4, 2)).collect();
        runs[5] = run(3, 1);
        let dataset =
            Dataset { observables: vec!["q".into(), "p".into()], runs, inputs: Vec::new() };
        let packed = Packed::of(&dataset, 3);
        assert_eq!(packed.runs(), dataset.runs.len());
        assert_eq!(packed.samples(), dataset.samples());
        assert_eq!(packed.longest_run(), 4);
        assert_eq!(packed.typical_step(), 1.0);
        for (at, run) in dataset.runs.iter().enumerate() {
            assert_eq!(packed.times_of(at), run.times);
            assert_eq!(packed.values_of(0, at), run.values[0]);
            match run.values.get(1) {
                Some(values) => assert_eq!(packed.values_of(1, at), values),
                None => assert!(packed.values_of(1, at).iter().all(|x| x.is_nan())),
            }
            assert!(packed.values_of(2, at).is_empty());
        }
        // Runs of one pile lie next to each other.
        let pile: Vec<f64> =
            [0, 3, 6].iter().flat_map(|&run| packed.times_of(run).to_vec()).collect();
        assert_eq!(packed.record.times[..pile.len()], pile);
        assert_eq!(packed.column(0).len(), packed.samples());
        assert_eq!(Packed::of(&Dataset::default(), 16).runs(), 0);
    }
}
