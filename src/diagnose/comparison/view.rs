//! What there is to see of a model on its data: predictions, phase portraits, energies,
//! residual forces over phase space. Plain data; drawing them is the report's work.

use serde::Serialize;

use super::energies;
use super::plane::{ForcePlane, force_planes};
use super::predictions::{CompiledLaw, Prediction, predictions};
use crate::diagnose::law_on_data::LawOnData;
use crate::diagnose::tuning::Comparison;
use crate::error::Result;
use crate::expr::{Observed, Variable};
use crate::fit::segments::longest_run;

/// Everything that pictures of a model on its data are drawn from.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct View {
    /// Name of the system.
    pub system: String,
    /// The state: coordinates, then momenta.
    pub state: Vec<Quantity>,
    /// What is measured: coordinates, then momenta or velocities.
    pub observables: Vec<Quantity>,
    /// The time.
    pub time: Quantity,
    /// Standard deviation of the noise of each observable.
    pub noise: Vec<f64>,
    /// Predictions of all runs: those that the model was trained on, then held-out ones.
    pub predictions: Vec<Prediction>,
    /// Whether momenta are measured, rather than velocities.
    pub momenta_measured: bool,
    /// Energy of the model at the measured states, along every run.
    pub energies: Vec<EnergySeries>,
    /// Energy of the model over planes of its phase space.
    pub portraits: Vec<Portrait>,
    /// The missing force over the plane of each coordinate.
    pub planes: Vec<ForcePlane>,
}

/// A name with its unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quantity {
    /// As written in the spec.
    pub name: String,
    /// As written in the spec; none where none was given.
    pub unit: Option<String>,
}

impl Quantity {
    fn of(variable: &Variable) -> Quantity {
        Quantity { name: variable.name.clone(), unit: variable.unit_text.clone() }
    }
}

/// How the model's energy goes along the measurements of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EnergySeries {
    /// Name of the run.
    pub run: String,
    /// Whether the model was not trained on it.
    pub held_out: bool,
    /// (time, energy), sorted by time: one for each stretch that a state was found for.
    pub points: Vec<(f64, f64)>,
}

/// H over a plane of the phase space, the other components of the state held.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Portrait {
    /// Component of the state that goes across: an index into [`View::state`].
    pub across: usize,
    /// Component that goes up.
    pub up: usize,
    /// The other components, and where they are held: (index, value).
    pub held: Vec<(usize, f64)>,
    /// Values across, ascending.
    pub columns: Vec<f64>,
    /// Values up, ascending.
    pub rows: Vec<f64>,
    /// H, `[row][column]`; NaN (null in JSON) where it is not finite.
    pub energy: Vec<Vec<f64>>,
    /// Energies that the motion reaches, but for the outermost percent; none without data.
    pub reached: Option<(f64, f64)>,
}

/// What there is to see. `training` are the runs that the model was trained on.
///
/// # Errors
///
/// When the data do not suffice to ask for a residual force.
pub fn view(training: &LawOnData, held_out: Option<&LawOnData>) -> Result<View> {
    let system = training.system();
    let momenta_measured = system.observed == Observed::Momenta;
    let mut all = predictions(training, false);
    let seen = all.len();
    if let Some(model) = held_out {
        all.extend(predictions(model, true));
    }
    let planes = force_planes(training, &|row| {
        all[..seen].iter().flat_map(|p| p.states[row].iter().copied()).collect()
    })?;
    let quantities = |a: &[Variable], b: &[Variable]| -> Vec<Quantity> {
        a.iter().chain(b).map(Quantity::of).collect()
    };
    Ok(View {
        system: system.name.clone(),
        state: quantities(&system.coordinates, &system.momenta),
        observables: system.observed_variables().map(Quantity::of).collect(),
        time: Quantity::of(&system.time),
        noise: training.law.noise().to_vec(),
        momenta_measured,
        energies: [(Some(training), false), (held_out, true)]
            .into_iter()
            .flat_map(|(model, held_out)| model.map(|c| series(c, held_out)).unwrap_or_default())
            .collect(),
        portraits: portraits(training, &all),
        predictions: all,
        planes,
    })
}

fn series(model: &LawOnData, held_out: bool) -> Vec<EnergySeries> {
    // Where the model follows whole runs, these are cut more finely than for training, but not so
    // that a state is known from fewer than four samples.
    let window = model
        .law
        .window()
        .min((longest_run(&model.data.dataset) / model.tuning().comparison.energies).max(4));
    let finer = model.with_window(window);
    let runs = model.data.dataset.runs.iter().zip(energies(&finer));
    runs.map(|(run, points)| EnergySeries { run: run.name.clone(), held_out, points }).collect()
}

/// The plane of every coordinate and its momentum; of two coordinates, also the plane of both.
fn portraits(model: &LawOnData, predictions: &[Prediction]) -> Vec<Portrait> {
    let n = model.system().degrees();
    let tuning = &model.tuning().comparison;
    let law = CompiledLaw::new(model);
    let start = predictions.iter().find_map(|p| p.times.first().copied()).unwrap_or(0.0);
    let spans: Vec<Option<(f64, f64, f64)>> = (0..2 * n)
        .map(|row| span(predictions.iter().flat_map(|p| p.states[row].iter().copied())))
        .collect();
    let reached = reached(predictions, tuning.outermost);
    let mut planes: Vec<(usize, usize)> = (0..n.min(tuning.planes)).map(|i| (i, n + i)).collect();
    if n == 2 {
        planes.insert(0, (0, 1));
    }
    let mut out = Vec::new();
    for (across, up) in planes {
        let (Some(x), Some(y)) = (spans[across], spans[up]) else { continue };
        let (columns, rows) = (grid(x, tuning), grid(y, tuning));
        let others = (0..2 * n).filter(|row| *row != across && *row != up);
        // The potential's own landscape: no momentum.
        let middle = |row: usize| match spans[row] {
            Some((_, _, mean)) if row < n => mean,
            _ => 0.0,
        };
        let held: Vec<(usize, f64)> = others.map(|row| (row, middle(row))).collect();
        let mut state = vec![0.0; 2 * n];
        for &(row, value) in &held {
            state[row] = value;
        }
        let energy: Vec<Vec<f64>> = rows
            .iter()
            .map(|&y| {
                let states: Vec<Vec<f64>> = columns
                    .iter()
                    .map(|&x| {
                        let mut state = state.clone();
                        (state[across], state[up]) = (x, y);
                        state
                    })
                    .collect();
                law.energies(&states, start)
            })
            .collect();
        out.push(Portrait { across, up, held, columns, rows, energy, reached });
    }
    out
}

/// The energies of all predictions but the part `outermost` of them on either side.
fn reached(predictions: &[Prediction], outermost: f64) -> Option<(f64, f64)> {
    let mut all: Vec<f64> =
        predictions.iter().flat_map(|p| &p.energy).copied().filter(|e| e.is_finite()).collect();
    all.sort_by(f64::total_cmp);
    let last = all.len().checked_sub(1)?;
    let at = |share: f64| all[(share * last as f64).round() as usize];
    Some((at(outermost), at(1.0 - outermost)))
}

/// Smallest, largest and mean value; none where they do not vary.
fn span(values: impl Iterator<Item = f64>) -> Option<(f64, f64, f64)> {
    let (mut low, mut high, mut sum, mut count) = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0);
    for x in values.filter(|x| x.is_finite()) {
        (low, high) = (low.min(x), high.max(x));
        sum += x;
        count += 1.0;
    }
    // A spread that is rounding is none.
    let spread = high - low > 1e-12 * low.abs().max(high.abs());
    (count > 0.0 && spread && (high - low).is_finite()).then(|| (low, high, sum / count))
}

fn grid((low, high, _): (f64, f64, f64), tuning: &Comparison) -> Vec<f64> {
    let (points, margin) = (tuning.portrait_points, tuning.portrait_margin);
    let margin = margin * (high - low);
    let (low, high) = (low - margin, high + margin);
    (0..points).map(|i| low + (high - low) * i as f64 / (points - 1) as f64).collect()
}
