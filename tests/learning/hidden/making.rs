//! From a plan of the design to measurements, and to the spec of one who does not know.

use std::sync::Arc;

use leverrier::internals::data::Dataset;
use leverrier::internals::expr::{System, Term};
use leverrier::internals::simulate::Simulator;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

use super::bases::Base;
use super::design::{Colour, Known, Plan, Seen, What};
use super::strangers::STRANGERS;
use super::wholes::{NUMBERS, PARTNERS};
use super::{Case, HELD_OUT, compiled, difference, spreads};

/// A case of the design, made.
pub(crate) struct Made {
    /// The measurements and the spec.
    pub case: Case,
    /// What is hidden, member for member.
    pub truth: Vec<Truth>,
    /// By how much of their spread the samples moved in fact.
    pub moved: f64,
}

/// One thing that is hidden.
#[derive(Debug, Clone)]
pub(crate) struct Truth {
    /// As a story would name it.
    pub label: String,
    /// The statement that says it; empty for a number, and where no statement does.
    pub statement: String,
    /// Its true numbers: coefficients, then inner parameters; empty where no statement says it.
    pub numbers: Vec<f64>,
}

/// Turn of a unit oscillator.
const TURN: f64 = std::f64::consts::TAU;
/// Samples of the velocity filter's clock between two that are kept.
const FINE: usize = 10;
/// What the velocity filter keeps of its last output.
const MEMORY: f64 = 0.8;
/// What one deviation of correlated noise keeps of the one before it.
pub(crate) const CORRELATION: f64 = 0.7;
/// Runs that strengths are found with.
const TRIAL_RUNS: usize = 3;
/// Terms of one effect have coefficients that differ: this ratio from one to the next.
const RATIO: f64 = 0.5;

/// How a record is sampled.
struct Sampling {
    runs: usize,
    step: f64,
    samples: usize,
}

impl Sampling {
    /// The longer a run, the fewer there are, and the sparser their samples.
    fn of(plan: &Plan) -> Sampling {
        let (runs, per_turn) = match plan.periods {
            x if x < 8.0 => (8, 32.0),
            x if x < 20.0 => (6, 20.0),
            x if x < 50.0 => (4, 16.0),
            x if x < 100.0 => (2, 12.0),
            _ => (2, 8.0),
        };
        let one = plan.seen == Seen::LongRun;
        // One run instead of several short ones is as long as they together, up to a point.
        let turns = if one { (plan.periods * runs as f64).min(200.0) } else { plan.periods };
        Sampling {
            runs: if one { 1 } else { runs },
            step: TURN / per_turn,
            samples: (turns * per_turn).round() as usize,
        }
    }

    fn times(&self, plan: &Plan) -> Vec<f64> {
        let mut generator = Pcg64::seed_from_u64(plan.seed ^ 0x71e5);
        let irregular = plan.seen == Seen::Irregular && !matches!(plan.what, What::Stranger(_));
        let mut shift =
            |i: usize| if irregular && i > 0 { generator.random_range(-0.35..0.35) } else { 0.0 };
        (0..self.samples).map(|i| self.step * (i as f64 + shift(i))).collect()
    }
}

/// What the spec of one who asks says below the variables.
fn spec_of(plan: &Plan) -> String {
    let body = match (&plan.what, plan.known) {
        (What::Number(row), _) => {
            let number = &NUMBERS[*row];
            format!("constant {} = {}\n{}", number.name, number.was, number.law)
        }
        (_, Known::All) => plan.base.law.to_string(),
        (_, Known::Half) => half(plan.base).to_string(),
        (_, Known::None) => plan.base.space.to_string(),
    };
    format!("{}{body}", plan.base.variables)
}

/// A spec of a base in which some numbers are known; of one with a single number, the potential.
fn half(base: &Base) -> &'static str {
    match (base.name, base.starts.len()) {
        ("pendulum", _) => "T = span{ p^2 }\nV = -cos(q)\n",
        ("oscillator", _) => "T = span{ p^2 }\nV = q^2/2\n",
        ("Duffing", _) => "T = p^2/2\nV = q^2/2 + span{ q^4 }\n",
        ("trap", _) => "T = (px^2 + py^2)/2\nV = x^2/2 + span{ y^2 }\n",
        ("Kepler", _) => "T = span{ px^2 + py^2 }\nV = -1/sqrt(x^2 + y^2)\n",
        ("Henon-Heiles", _) => "T = (px^2 + py^2)/2\nV = (x^2 + y^2)/2 + span{ x^2*y, y^3 }\n",
        ("chain", _) => {
            "T = sum(p[i]^2/2 for i in 1..5)\n\
             V = q[1]^2/2 + q[5]^2/2 + span{ (q[i+1] - q[i])^2 for i in 1..4 }\n"
        }
        ("two bodies", _) if base.variables.contains("px1") => {
            "T = (px1^2 + py1^2)/2 + (px2^2 + py2^2)/2\n\
             V = (x1^2 + y1^2)/2 + span{ x2^2 + y2^2 }\n"
        }
        _ => base.law,
    }
}

/// Trajectories of a system, a coefficient for each of its terms; `None` where they run away.
fn motion(
    system: &System,
    starts: &[Vec<f64>],
    times: &[f64],
    coefficients: &[f64],
) -> Option<Dataset> {
    let active = system.term_ids();
    let parameters: Vec<f64> = system.parameters.iter().map(|p| p.start).collect();
    let simulator = Simulator::new(system, &active, coefficients, &parameters).ok()?;
    let data = simulator.trajectories(starts, times).ok()?.dataset(system);
    let mut all = data.runs.iter().flat_map(|run| run.values.iter().flatten());
    all.all(|x| x.abs() < 50.0).then_some(data)
}

/// The strength at which what is hidden moves the samples by `reach`; where nothing moves them so
/// far, the least one that moves them nearly as far as any does.
fn strength_for(reach: f64, plain: &Dataset, data: impl Fn(f64) -> Option<Dataset>) -> Option<f64> {
    let moved = |strength: f64| data(strength).map(|data| difference(plain, &data));
    let mut tried: Vec<(f64, f64)> = Vec::new();
    let mut strength = 3e-6;
    while strength < 20.0 {
        let Some(by) = moved(strength) else { break };
        tried.push((strength, by));
        if by >= reach {
            break;
        }
        strength *= 2.0;
    }
    let &(last, farthest) = tried.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    if farthest < reach {
        return tried.iter().find(|(_, by)| *by >= 0.9 * farthest).map(|(strength, _)| *strength);
    }
    let (mut low, mut high) = (0.5 * last, last);
    for _ in 0..6 {
        let middle = (low * high).sqrt();
        if moved(middle).is_some_and(|by| by < reach) { low = middle } else { high = middle }
    }
    Some(high)
}

/// Coefficients of the terms of one statement: no two of them equal.
fn weights(system: &System) -> Vec<f64> {
    (0..system.terms.len()).map(|i| RATIO.powi(i as i32)).collect()
}

/// Clean measurements with what is hidden in them, at the strength of the plan.
struct Clean {
    data: Dataset,
    truth: Vec<Truth>,
    moved: f64,
}

fn clean(plan: &Plan, starts: &[Vec<f64>], times: &[f64]) -> Option<Clean> {
    let Plan { base, reach, .. } = *plan;
    let law = |more: &str| format!("{}{}{more}\n", base.variables, base.law);
    let bare = compiled("truth", &law("")).system;
    let trial = &starts[..starts.len().min(TRIAL_RUNS)];
    let plain = motion(&bare, trial, times, &[])?;
    let truth = |label: &str, numbers: Vec<f64>, statement: &str| Truth {
        label: label.to_string(),
        statement: statement.to_string(),
        numbers,
    };
    let (data, hidden) = match &plan.what {
        What::Nothing => (motion(&bare, starts, times, &[])?, Vec::new()),
        What::Statements(all) => {
            let mut strengths = Vec::new();
            for (_, statement) in all {
                let system = compiled("truth", &law(statement)).system;
                let of = |strength: f64| {
                    let each = weights(&system).iter().map(|w| w * strength).collect::<Vec<f64>>();
                    motion(&system, trial, times, &each)
                };
                strengths.push((strength_for(reach, &plain, of)?, system));
            }
            let together: Vec<&str> = all.iter().map(|(_, statement)| statement.as_str()).collect();
            let system = compiled("truth", &law(&together.join("\n"))).system;
            // Effects that are tame one by one need not be so together.
            let mut part = 1.0;
            let data = loop {
                let of = |term: &Term| {
                    let own = |(s, one): &(f64, Arc<System>)| {
                        let place = one.terms.iter().position(|other| other.name == term.name)?;
                        Some(part * s * weights(one)[place])
                    };
                    strengths.iter().find_map(own)
                };
                let each: Option<Vec<f64>> = system.terms.iter().map(of).collect();
                let each = each?;
                match motion(&system, starts, times, &each) {
                    Some(data) => break data,
                    None if part > 0.1 => part *= 0.5,
                    None => return None,
                }
            };
            let hidden = all.iter().zip(&strengths).map(|((label, statement), (s, one))| {
                let coefficients = weights(one).into_iter().map(|w| part * w * s);
                let inner = one.parameters.iter().map(|parameter| parameter.start);
                truth(label, coefficients.chain(inner).collect(), statement)
            });
            (data, hidden.collect())
        }
        What::Number(row) => {
            let number = &NUMBERS[*row];
            let sign = if plan.seed.is_multiple_of(2) { 1.0 } else { -1.0 };
            // Never as far as zero.
            let value = |off: f64| number.was * (sign * off.min(0.7)).exp();
            let of = |off: f64, starts: &[Vec<f64>]| {
                let (head, name) = (base.variables, number.name);
                let text = format!("{head}constant {name} = {}\n{}", value(off), number.law);
                motion(&compiled("truth", &text).system, starts, times, &[])
            };
            let off = strength_for(reach, &plain, |off| of(off, trial))?;
            let label = format!("number({})", number.name);
            (of(off, starts)?, vec![truth(&label, vec![value(off)], "")])
        }
        What::Partner(row) => {
            let partner = &PARTNERS[*row];
            let seen = base.starts.len() / 2;
            let (coordinates, momenta) = base.variables.split_once('\n')?;
            let variables = format!("{coordinates}, h\n{}, ph\n", momenta.trim_end());
            let mut generator = Pcg64::seed_from_u64(plan.seed ^ 0x4a11);
            let mut draw = |i: usize| {
                let (a, b) = partner.starts[i];
                generator.random_range(a..b)
            };
            let with = |start: &Vec<f64>, q: f64, p: f64| {
                [&start[..seen], &[q], &start[seen..], &[p]].concat()
            };
            let starts: Vec<Vec<f64>> =
                starts.iter().map(|start| with(start, draw(0), draw(1))).collect();
            let of = |strength: f64, starts: &[Vec<f64>]| {
                let text = format!(
                    "{variables}{}",
                    partner.law.replace("STRENGTH", &strength.to_string())
                );
                let mut data = motion(&compiled("truth", &text).system, starts, times, &[])?;
                for place in [2 * seen + 1, seen] {
                    data.observables.remove(place);
                    data.runs.iter_mut().for_each(|run| {
                        run.values.remove(place);
                    });
                }
                Some(data)
            };
            let trial = &starts[..starts.len().min(TRIAL_RUNS)];
            let strength = strength_for(reach, &plain, |strength| of(strength, trial))?;
            (of(strength, &starts)?, vec![truth(partner.name, Vec::new(), "")])
        }
        What::Stranger(row) => {
            let stranger = &STRANGERS[*row];
            let tame = |data: Dataset| {
                let mut all = data.runs.iter().flat_map(|run| run.values.iter().flatten());
                all.all(|x| x.abs() < 50.0).then_some(data)
            };
            let trials = stranger.motion(base, trial, times, plan.seed);
            let plain = trials(0.0);
            let strength = strength_for(reach, &plain, |strength| tame(trials(strength)))?;
            let all = stranger.motion(base, starts, times, plan.seed);
            (tame(all(strength))?, vec![truth(stranger.name, Vec::new(), "")])
        }
    };
    let whole = motion(&bare, starts, times, &[])?;
    let moved = if hidden.is_empty() { 0.0 } else { difference(&whole, &data) };
    Some(Clean { data, truth: hidden, moved })
}

/// Makes a case; `None` where what is hidden runs away at any strength.
pub(crate) fn made(plan: &Plan) -> Option<Made> {
    let sampling = Sampling::of(plan);
    let mut generator = Pcg64::seed_from_u64(plan.seed ^ 0x9e37_79b9);
    let mut draw = || {
        plan.base.starts.iter().map(|&(a, b)| generator.random_range(a..b)).collect::<Vec<f64>>()
    };
    let starts: Vec<Vec<f64>> = (0..sampling.runs).map(|_| draw()).collect();
    let filtered = plan.colour == Colour::Filtered;
    let kept = sampling.times(plan);
    let times = if filtered { between(&kept) } else { kept };
    let Clean { mut data, truth, moved } = clean(plan, &starts, &times)?;
    let sigma = spoil(&mut data, plan, filtered);
    if plan.seen == Seen::Irregular {
        lose(&mut data, plan.seed);
    }
    if plan.seen == Seen::Positions {
        let degrees = plan.base.starts.len() / 2;
        for run in &mut data.runs {
            run.values[degrees..].iter_mut().for_each(|column| column.fill(f64::NAN));
        }
    }
    let text = spec_of(plan);
    let split = data.split_held_out(HELD_OUT, plan.seed);
    let case = Case {
        compiled: compiled("learned", &text),
        text,
        training: split.training,
        held_out: split.held_out,
        noise: sigma,
    };
    Some(Made { case, truth, moved })
}

/// Whether momenta are velocities, so that differences of positions measure them.
pub(crate) fn may_be_filtered(plan: &Plan) -> bool {
    let turns = |statement: &str| {
        let head = statement.split('(').next().unwrap_or_default();
        ["position_dependent_mass", "coupled_momenta", "relativistic_kinetic"]
            .iter()
            .chain(&["inertial_coupling", "rotating_frame", "clock_shift", "sensor"])
            .any(|name| head.contains(name))
            || statement.starts_with('H')
            || statement.starts_with('T')
    };
    let plain = match &plan.what {
        What::Statements(all) => !all.iter().any(|(_, statement)| turns(statement)),
        What::Number(_) => false,
        _ => true,
    };
    plain && plan.seen != Seen::Positions && plan.seen != Seen::Irregular
}

/// A finer clock between some times.
fn between(times: &[f64]) -> Vec<f64> {
    let mut fine: Vec<f64> = times
        .windows(2)
        .flat_map(|pair| (0..FINE).map(|i| pair[0] + (pair[1] - pair[0]) * i as f64 / FINE as f64))
        .collect();
    fine.extend(times.last());
    fine
}

/// Adds the instrument's noise; returns its standard deviations.
fn spoil(data: &mut Dataset, plan: &Plan, filtered: bool) -> Vec<f64> {
    let mut sigma: Vec<f64> = spreads(data).iter().map(|spread| plan.noise * spread).collect();
    let mut generator = Pcg64::seed_from_u64(plan.seed ^ 0x0153);
    let mut normal = || -> f64 { StandardNormal.sample(&mut generator) };
    let degrees = sigma.len() / 2;
    // Of the differences of two readings, and of what the filter makes of them.
    let gain = (2.0 * (1.0 - MEMORY).powi(2) / (1.0 + MEMORY)).sqrt();
    for run in &mut data.runs {
        if filtered {
            let step = run.times[1] - run.times[0];
            let (positions, velocities) = run.values.split_at_mut(degrees);
            for (row, (q, v)) in positions.iter_mut().zip(velocities).enumerate() {
                q.iter_mut().for_each(|q| *q += sigma[row] * normal());
                let mut filter = v[0];
                for k in 1..q.len() {
                    filter = MEMORY * filter + (1.0 - MEMORY) * (q[k] - q[k - 1]) / step;
                    v[k] = filter;
                }
                sigma[degrees + row] = gain * sigma[row] / step;
            }
            // The filter's first readings are not settled.
            let keep: Vec<usize> = (2 * FINE..run.times.len()).step_by(FINE).collect();
            take(run, &keep);
            continue;
        }
        for (values, &sigma) in run.values.iter_mut().zip(&sigma) {
            let mut before = normal();
            for x in values {
                match plan.colour {
                    Colour::Quantised if sigma > 0.0 => {
                        // A step whose rounding has this deviation.
                        let step = sigma * 12.0f64.sqrt();
                        *x = (*x / step).round() * step;
                    }
                    Colour::Correlated => {
                        before =
                            CORRELATION * before + (1.0 - CORRELATION.powi(2)).sqrt() * normal();
                        *x += sigma * before;
                    }
                    _ => *x += sigma * normal(),
                }
            }
        }
    }
    sigma
}

/// Keeps some samples of a run.
fn take(run: &mut leverrier::internals::data::Run, keep: &[usize]) {
    run.times = keep.iter().map(|&k| run.times[k]).collect();
    run.lines = keep.iter().map(|&k| run.lines[k]).collect();
    for column in &mut run.values {
        *column = keep.iter().map(|&k| column[k]).collect();
    }
}

/// Loses two stretches of every run, and single cells.
fn lose(data: &mut Dataset, seed: u64) {
    let mut generator = Pcg64::seed_from_u64(seed ^ 0x105e);
    for run in &mut data.runs {
        let count = run.times.len();
        let gap = count / 12;
        let mut from = || generator.random_range(1..count - gap);
        let gaps = [from(), from()];
        let lost = |k: &usize| gaps.iter().any(|&from| (from..from + gap).contains(k));
        let keep: Vec<usize> = (0..count).filter(|k| !lost(k)).collect();
        take(run, &keep);
        for column in &mut run.values {
            for cell in column.iter_mut() {
                if generator.random_range(0.0..1.0) < 0.03 {
                    *cell = f64::NAN;
                }
            }
        }
    }
}
