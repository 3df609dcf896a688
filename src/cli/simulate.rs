//! `leverrier simulate`: trajectories of a law, and data sets made of them.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::console::{Console, set, usage};
use super::project::{Spec, read_inputs, refuse_overwrite};
use super::values::{example, noise, range_of, state};
use crate::data::{Dataset, Layout, concatenate, to_bytes, to_csv, write_atomically};
use crate::error::Result;
use crate::expr::{DataColumns, System};
use crate::facade::components::matching;
use crate::report::layout::counted;
use crate::simulate::{
    InitialDistribution, InputRecord, IntegratorChoice, Interval, Simulator, add_noise,
    consecutive_pairs, draw, drop_samples,
};

/// More numbers than this are refused rather than kept in memory.
const MOST_NUMBERS: usize = 200_000_000;

/// Make trajectories from a fitted model, or from a spec in which everything is known.
///
/// Integrates to the limit of double precision; adds noise and gaps if asked to. The file
/// has the columns that the spec's `data` line reads, so that `fit` can take it as it is.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier simulate pendulum.ham --start theta=1.4,omega=0 --duration 20 --dt 0.1\n  \
    leverrier simulate pendulum.ham --start 1.4,0 --dt 0.1 --samples 200 --noise 0.01 -o swings.csv\n  \
    leverrier simulate pendulum.ham --runs 8 --sample theta=-2..2 --sample omega=-1..1 \\\n      \
    --duration 10 --dt 0.05 --noise 1% --seed 3 -o runs.csv\n  \
    leverrier simulate henon-heiles.ham --start 0.1,0.2,0.35,0.1 --duration 1e5 --samples 1001 \\\n      \
    --method taylor --check-energy -o long.csv\n  \
    leverrier simulate henon-heiles.ham --pairs --runs 5000 --sample q[1]=-1..1 \\\n      \
    --sample q[2]=-0.5..1 --sample p=-1..1 --energy 1/12..1/6 --dt 0.1 -o pairs.csv")]
pub(super) struct Arguments {
    /// The spec.
    pub spec: PathBuf,
    /// An initial state: `q=0.1,p=0` or all numbers in order, `0.1,0`. Repeat it for more runs.
    /// With --sample: the components that are the same in all runs.
    #[arg(long, value_name = "STATE", allow_hyphen_values = true)]
    pub start: Vec<String>,
    /// Draw initial states: `q[1]=-1..1`; `q=-1..1` for all of a family. Repeat it for others.
    #[arg(long, value_name = "NAME=LOW..HIGH", allow_hyphen_values = true)]
    pub sample: Vec<String>,
    /// With --sample: how many runs.
    #[arg(long, visible_alias = "starts", value_name = "N")]
    pub runs: Option<usize>,
    /// With --sample: only states with an energy in this range.
    #[arg(long, value_name = "LOW..HIGH", allow_hyphen_values = true)]
    pub energy: Option<String>,
    /// Time from the first to the last sample of a run.
    #[arg(long, value_name = "TIME")]
    pub duration: Option<f64>,
    /// Time between samples.
    #[arg(long, value_name = "TIME")]
    pub dt: Option<f64>,
    /// Samples of a run, the first included.
    #[arg(long, value_name = "N")]
    pub samples: Option<usize>,
    /// Time of the first sample.
    #[arg(long, value_name = "TIME", default_value_t = 0.0, allow_hyphen_values = true)]
    pub from: f64,
    /// What drives the motion: a file with the columns of the spec's inputs. Each of its runs is
    /// followed from every start, and sampled at its own times where no others are asked for.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["pairs", "method"])]
    pub inputs: Option<PathBuf>,
    /// Every run is one transition: two samples, --dt apart.
    #[arg(long, conflicts_with_all = ["duration", "samples"])]
    pub pairs: bool,
    /// Every two neighbouring samples become a run, with independent noise.
    #[arg(long, conflicts_with = "pairs")]
    pub consecutive_pairs: bool,
    /// Gaussian noise: its standard deviation, `1%` of each column's spread, or `theta=0.01`.
    #[arg(long, value_name = "SIGMA")]
    pub noise: Vec<String>,
    /// Lose this part of the samples, 0 to 1.
    #[arg(long, value_name = "FRACTION")]
    pub gaps: Option<f64>,
    /// Seed of starts, noise and gaps: the same seed makes the same file.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// How to integrate. `chosen`: equal steps of the cheapest method that reaches the limit of
    /// double precision. `taylor`: Taylor series in steps as long as they allow, the fastest way
    /// through long motions; for laws without kinks and jumps.
    #[arg(long, value_name = "METHOD", value_parser = ["chosen", "taylor"], default_value = "chosen")]
    pub method: String,
    /// With --method taylor: error of one step as a part of the largest component, from 0 (the
    /// rounding of numbers) to 0.01.
    #[arg(long, value_name = "PART", allow_hyphen_values = true)]
    pub tolerance: Option<f64>,
    /// Say how well the energy is kept, and in how many steps.
    #[arg(long)]
    pub check_energy: bool,
    /// The model file, if it is not beside the spec.
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// The file, as CSV, or as Parquet if it ends in .parquet; by default standard output.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Overwrite a file that exists.
    #[arg(long)]
    pub force: bool,
}

/// Runs the command.
pub(super) fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    let integrator = arguments.integrator()?;
    let spec = Spec::open(&arguments.spec)?;
    console.diagnostics(spec.name(), spec.text(), spec.warnings());
    if let Some(path) = &arguments.output {
        refuse_overwrite(path, arguments.force)?;
    }
    let system = spec.system();
    let law = spec.law(arguments.model.as_deref())?;
    let mut simulator = law.numbers().simulator();
    let records = arguments.records(&spec)?;
    let times = match records.first() {
        Some(record) if arguments.is_sampled_as_driven() => record.times(),
        _ => arguments.times()?,
    };
    let starts = arguments.starts(system, &simulator)?;
    let noise = noise(system, &arguments.noise)?;
    if starts.len().saturating_mul(times.len()).saturating_mul(2 * system.degrees()) > MOST_NUMBERS
    {
        return Err(usage(
            format!("{} runs of {} samples do not fit in memory", starts.len(), times.len()),
            "ask for fewer",
        ));
    }
    let mut driven = Vec::new();
    for record in &records {
        let times = match arguments.is_sampled_as_driven() {
            true => record.times(),
            false => times.clone(),
        };
        simulator = simulator.driven_by(record.clone());
        driven.push(simulator.trajectories(&starts, &times)?);
    }
    let first = match driven.is_empty() {
        true => simulator.trajectories_by(integrator, &starts, &times)?,
        false => driven.remove(0),
    };
    let mut data = first.dataset(system);
    let sets: Vec<Dataset> =
        std::iter::once(data.clone()).chain(driven.iter().map(|one| one.dataset(system))).collect();
    if !records.is_empty() {
        data = with_inputs(concatenate(&sets)?, &records, starts.len());
    }
    let trajectories = first;
    if arguments.consecutive_pairs {
        data = consecutive_pairs(&data);
    }
    let sigmas = add_noise(&mut data, &noise, arguments.seed)?;
    if let Some(fraction) = arguments.gaps {
        if !(0.0..1.0).contains(&fraction) {
            return Err(usage("--gaps must be from 0 to below 1", "0.1 loses every tenth"));
        }
        drop_samples(&mut data, fraction, arguments.seed);
    }

    let (drift, integration) = (trajectories.drift, &trajectories.integration);
    let mut object = json!({
        "format": "leverrier.simulate/1",
        "system": system.name,
        "runs": data.runs.len(),
        "samples": data.samples(),
        "observables": data.observables,
        "noise": sigmas,
        "seed": arguments.seed,
        "integrator": {
            "method": integration.method,
            "order": integration.order,
            "steps": integration.steps,
            "steps_per_sample": integration.per_sample,
            "reason": integration.reason,
        },
        "energy_drift": { "largest": drift.largest, "relative": drift.relative },
        "path": arguments.output.as_ref().map(|path| path.display().to_string()),
    });
    if arguments.check_energy {
        let relative =
            drift.relative.map_or(String::new(), |r| format!(" ({r:.1e} of the energy)"));
        console.message(&format!(
            "The energy of every run stays within {:.1e}{relative} of its first value; {} of order {}, {}{}.",
            drift.largest,
            integration.method,
            integration.order,
            counted(integration.steps, "step"),
            integration.per_sample.map_or(String::new(), |n| format!(", {n} a sample")),
        ));
    }
    let path = arguments.output.clone().unwrap_or_else(|| "standard output".into());
    let (mut written, mut layout) = in_columns(&data, system, spec.compiled().data.first());
    if !records.is_empty() {
        inputs_in_columns(&mut written, &mut layout, system, spec.compiled().data.first());
    }
    match &arguments.output {
        Some(_) => {
            write_atomically(&path, &to_bytes(&path, &written, &layout)?)?;
            let what = format!(
                "{} in {}",
                counted(data.samples(), "sample"),
                counted(data.runs.len(), "run")
            );
            console.result(&format!("{what} written to {}", path.display()), &object)
        }
        None if console.is_json() => {
            set(&mut object, "data", data.runs.iter().map(run_object).collect());
            console.result("", &object)
        }
        None => console.text(&String::from_utf8_lossy(&to_csv(&path, &written, &layout)?)),
    }
}

/// The inputs as columns behind the observables; the runs of a record stand together.
fn with_inputs(mut data: Dataset, records: &[InputRecord], starts: usize) -> Dataset {
    let of_runs = records.iter().flat_map(|record| std::iter::repeat_n(record, starts));
    for (run, record) in data.runs.iter_mut().zip(of_runs) {
        run.values.extend(record.values(&run.times));
    }
    for (at, run) in data.runs.iter_mut().enumerate() {
        run.name = (at + 1).to_string();
    }
    data.observables.extend(records.iter().take(1).flat_map(InputRecord::names));
    data
}

fn run_object(run: &crate::data::Run) -> Value {
    json!({ "run": run.name, "times": run.times, "values": run.values })
}

impl Arguments {
    /// What drives the motion, run by run; nothing where nothing does.
    fn records(&self, spec: &Spec) -> Result<Vec<InputRecord>> {
        let Some(path) = &self.inputs else { return Ok(Vec::new()) };
        if spec.system().inputs.is_empty() {
            return Err(usage(
                "--inputs is for a spec with an `input`",
                "leave it out: nothing that is measured drives this system",
            ));
        }
        InputRecord::of_runs(spec.system(), &read_inputs(spec.compiled(), path)?)
    }

    /// Whether samples are taken when the inputs were.
    fn is_sampled_as_driven(&self) -> bool {
        self.inputs.is_some()
            && self.dt.is_none()
            && self.duration.is_none()
            && self.samples.is_none()
    }

    /// The times of the samples.
    fn times(&self) -> Result<Vec<f64>> {
        let positive = |name: &str, value: Option<f64>| match value {
            Some(x) if !(x.is_finite() && x > 0.0) => {
                Err(usage(format!("{name} must be positive"), "give a time, such as 0.1"))
            }
            _ => Ok(()),
        };
        positive("--dt", self.dt)?;
        positive("--duration", self.duration)?;
        if !self.from.is_finite() {
            return Err(usage("--from must be a finite time", "give a time, such as 0"));
        }
        if self.samples.is_some_and(|n| n < 2) {
            return Err(usage("--samples must be at least 2", "motion takes two samples"));
        }
        let (dt, samples) = match (self.dt, self.duration, self.samples) {
            (Some(dt), None, None) if self.pairs => (dt, 2),
            (Some(dt), None, Some(samples)) => (dt, samples),
            (Some(dt), Some(duration), None) => {
                let intervals = (duration / dt * (1.0 + 1e-12)).floor();
                if intervals >= MOST_NUMBERS as f64 {
                    return Err(usage("too many samples", "lengthen --dt"));
                }
                (dt, intervals as usize + 1)
            }
            (None, Some(duration), Some(samples)) => (duration / (samples - 1) as f64, samples),
            (None, None, None) | (None, _, None) | (None, None, _) if self.pairs => {
                return Err(usage("--pairs needs --dt", "give the time between the two"));
            }
            (Some(_), Some(_), Some(_)) => {
                return Err(usage(
                    "--dt, --duration and --samples together say it twice",
                    "leave one of them out",
                ));
            }
            _ => {
                return Err(usage(
                    "when to sample is not said",
                    "give two of --dt, --duration and --samples, such as --duration 20 --dt 0.1",
                ));
            }
        };
        if !(2..=MOST_NUMBERS).contains(&samples) {
            return Err(usage(
                format!("{samples} samples cannot be made"),
                "--duration must hold at least one --dt",
            ));
        }
        Ok((0..samples).map(|at| self.from + at as f64 * dt).collect())
    }

    /// What to integrate with.
    fn integrator(&self) -> Result<IntegratorChoice> {
        if self.method != "taylor" {
            return match self.tolerance {
                None => Ok(IntegratorChoice::Chosen),
                Some(_) => Err(usage(
                    "--tolerance goes with --method taylor",
                    "leave it out: equal steps reach the limit of double precision",
                )),
            };
        }
        let tolerance = self.tolerance.unwrap_or(0.0);
        if !(0.0..=0.01).contains(&tolerance) {
            return Err(usage(
                format!("--tolerance must be from 0 to 0.01, not {tolerance}"),
                "1e-9 is a fair choice; 0 is as accurate as numbers are",
            ));
        }
        Ok(IntegratorChoice::Taylor { tolerance })
    }

    /// The initial states.
    fn starts(&self, system: &System, simulator: &Simulator) -> Result<Vec<Vec<f64>>> {
        let names = state_names(system);
        if self.sample.is_empty() {
            if self.start.is_empty() {
                return Err(usage(
                    "no initial state is given",
                    format!("give one with --start {}", example(&names)),
                ));
            }
            if let Some(what) =
                self.energy.as_ref().map(|_| "--energy").or(self.runs.map(|_| "--runs"))
            {
                return Err(usage(
                    format!("{what} goes with --sample"),
                    "draw the initial states with --sample NAME=LOW..HIGH",
                ));
            }
            return self
                .start
                .iter()
                .map(|text| {
                    let state = state(text, &names)?;
                    let missing: Vec<&str> = state
                        .iter()
                        .zip(&names)
                        .filter(|(value, _)| value.is_none())
                        .map(|(_, name)| name.as_str())
                        .collect();
                    if missing.is_empty() {
                        return Ok(state.into_iter().flatten().collect());
                    }
                    Err(usage(
                        format!("the initial state `{text}` does not say {}", missing.join(", ")),
                        format!("give all of it, as in --start {}", example(&names)),
                    ))
                })
                .collect();
        }
        let mut intervals: Vec<Option<Interval>> = vec![None; names.len()];
        for text in &self.start {
            for (side, value) in intervals.iter_mut().zip(state(text, &names)?) {
                *side = value.map(|x| Interval { lower: x, upper: x }).or(*side);
            }
        }
        for text in &self.sample {
            let (name, range) = text.split_once('=').ok_or_else(|| {
                usage(format!("`{text}` is not a range"), "write --sample NAME=LOW..HIGH")
            })?;
            let range = range_of(range)?;
            let found = matching(&names, name.trim())?;
            for at in found {
                if let Some(side) = intervals.get_mut(at) {
                    *side = Some(range);
                }
            }
        }
        let missing: Vec<&str> = intervals
            .iter()
            .zip(&names)
            .filter(|(side, _)| side.is_none())
            .map(|(_, name)| name.as_str())
            .collect();
        if !missing.is_empty() {
            return Err(usage(
                format!("nothing is said about {}", missing.join(", ")),
                "give a --sample range or a --start value for every component of the state",
            ));
        }
        let energy = self.energy.as_deref().map(range_of).transpose()?;
        let sampling =
            InitialDistribution { intervals: intervals.into_iter().flatten().collect(), energy };
        draw(simulator, &sampling, self.runs.unwrap_or(1).max(1), self.from, self.seed)
    }
}

/// Names of the components of the state: coordinates, then momenta.
fn state_names(system: &System) -> Vec<String> {
    system.coordinates.iter().chain(&system.momenta).map(|v| v.name.clone()).collect()
}

/// The inputs, which stand behind the observables, in the columns and units that the spec's `data`
/// line reads.
fn inputs_in_columns(
    data: &mut Dataset,
    layout: &mut Layout,
    system: &System,
    columns: Option<&DataColumns>,
) {
    let columns = columns.map_or_else(|| system.input_columns(), |c| c.inputs.clone());
    let first = data.observables.len().saturating_sub(columns.len());
    for (at, (column, input)) in columns.iter().zip(&system.inputs).enumerate() {
        if let (Some(name), Some(plain)) =
            (data.observables.get_mut(first + at), column.candidates.first())
        {
            name.clone_from(plain);
        }
        let scaled = column.scale != 1.0;
        for run in data.runs.iter_mut().filter(|_| scaled) {
            if let Some(values) = run.values.get_mut(first + at) {
                values.iter_mut().for_each(|x| *x /= column.scale);
            }
        }
        layout.units.push(input.variable.unit_text.clone().filter(|_| !scaled));
    }
}

/// The data in the columns and units that the spec's `data` line reads.
fn in_columns(data: &Dataset, system: &System, columns: Option<&DataColumns>) -> (Dataset, Layout) {
    let mut out = data.clone();
    let observed = columns.map_or_else(|| system.observed_columns(), |c| c.observables.clone());
    let variables: Vec<_> = system.observed_variables().collect();
    let mut units = Vec::new();
    for (row, column) in observed.iter().enumerate() {
        // `q[1]` would read as a column `q` in a unit `1`.
        let plain = column.candidates.iter().find(|name| !name.contains('['));
        if let (Some(name), Some(plain)) = (out.observables.get_mut(row), plain) {
            name.clone_from(plain);
        }
        let scaled = column.scale != 1.0;
        if scaled {
            for run in &mut out.runs {
                if let Some(values) = run.values.get_mut(row) {
                    values.iter_mut().for_each(|x| *x /= column.scale);
                }
            }
        }
        units.push(variables.get(row).and_then(|v| v.unit_text.clone()).filter(|_| !scaled));
    }
    let time = columns.and_then(|c| c.time.as_ref());
    let scale = time.map_or(1.0, |time| time.scale);
    if scale != 1.0 {
        for run in &mut out.runs {
            run.times.iter_mut().for_each(|t| *t /= scale);
        }
    }
    let run = columns.and_then(|c| c.run.clone());
    let several = out.runs.len() > 1;
    let layout = Layout {
        run: run.or_else(|| several.then(|| "run".to_string())),
        time: time.map_or_else(|| system.time.name.clone(), |time| time.column.clone()),
        time_unit: system.time.unit_text.clone().filter(|_| scale == 1.0),
        units,
    };
    (out, layout)
}
