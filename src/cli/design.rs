//! `leverrier design`: the next run worth measuring.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::console::{Console, set, usage};
use super::progress::Progress;
use super::splitting::SplitArguments;
use super::values::{example, matching, number_or_range, range_of};
use super::workspace::Workspace;
use crate::diagnose::design::rival::Rival;
use crate::diagnose::design::{self, Allowed, Goal, Proposal};
use crate::diagnose::diagnosis::{self, RankedEffect, Verdict};
use crate::diagnose::{LawOnData, Options};
use crate::error::Result;
use crate::expr::System;
use crate::facade::effect::NamedEffect;
use crate::fit::Law;
use crate::report::design_text;
use crate::simplify::significant;
use crate::simulate::Interval;

/// Say which run to measure next.
///
/// It is the one that best tells apart the effects between which `diagnose` cannot decide, or
/// the one that best measures the coefficient that is known worst.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier design pendulum.ham\n  \
    leverrier design pendulum.ham --within theta=-2..2 --within omega=0..0 --duration 20\n  \
    leverrier design pendulum.ham --between viscous_drag coulomb_friction\n  \
    leverrier design pendulum.ham --coefficient \"cos(theta)\" --step 0.02..0.2\n\n\
    What is left open is as in the measurements so far: where they went, how long their runs\n\
    last, how often they sample.")]
pub struct Arguments {
    /// The spec.
    pub spec: PathBuf,
    /// Where the run may start: `q=-1..1`; `q=-1..1` for all of a family. Repeat it for others.
    #[arg(long, value_name = "NAME=LOW..HIGH", allow_hyphen_values = true)]
    pub within: Vec<String>,
    /// What the motion may not leave: `q=-2..2`. Repeat it for others.
    #[arg(long, value_name = "NAME=LOW..HIGH", allow_hyphen_values = true)]
    pub stay: Vec<String>,
    /// Time from the first to the last sample, or a range of it to choose from.
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    pub duration: Option<String>,
    /// Time between samples, or a range of it to choose from.
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    pub step: Option<String>,
    /// Time of the first sample; it matters where a force depends on time.
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    pub from: Option<f64>,
    /// The effects to tell apart, two or more.
    #[arg(long, value_name = "EFFECT", num_args = 1.., conflicts_with = "coefficient")]
    pub between: Vec<String>,
    /// The coefficient or inner parameter to measure: its name, or its term.
    #[arg(long, value_name = "NAME")]
    pub coefficient: Option<String>,
    #[command(flatten)]
    pub splitting: SplitArguments,
}

/// Rivals that are compared, at most.
const RIVALS: usize = 4;
/// Values of a range that are tried.
const DURATIONS: usize = 3;
const STEPS: usize = 3;

/// What the run is for, the models that it is designed with, and why.
struct Purpose {
    goal: Goal,
    rivals: Vec<Rival>,
    why: String,
}

/// Runs the command.
pub fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    if arguments.between.len() == 1 {
        return Err(usage(
            "one effect has no alternative to be distinguished from",
            "name two or more after --between",
        ));
    }
    let workspace = Workspace::open(&arguments.spec, &arguments.splitting.asked()?, console)?;
    let allowed = arguments.allowed(workspace.spec.system())?;
    let progress = Progress::new();
    let (model, terms) = workspace.model(&progress)?;
    let (law, options) = (workspace.spec.learned(&model)?, Options::default());
    let purpose = purpose(arguments, &workspace, &law, &options, &progress)?;
    let Purpose { rivals, goal, .. } = &purpose;
    let (data, window) = (&workspace.dataset, law.window());
    let plan = design::design(rivals, goal, data, window, &allowed, &options, &progress)?;
    drop(progress);
    let spec = workspace.spec.name();
    let simulate = simulating(&plan.best, spec);
    let text = design_text(&plan, &purpose.why, spec, &simulate, console.width());
    let mut object = json!({
        "format": "leverrier.design/2",
        "system": workspace.spec.system().name,
        "split": workspace.split_json(),
        "terms_from": terms,
        "why": purpose.why,
    });
    if let (Some(object), Value::Object(fields)) = (object.as_object_mut(), json!(plan)) {
        object.extend(fields);
    }
    set(&mut object, "simulate", json!(simulate));
    console.result(&text, &object)
}

/// The command that simulates a run.
fn simulating(run: &Proposal, spec: &str) -> String {
    let from = if run.from == 0.0 {
        String::new()
    } else {
        format!(" --from {}", significant(run.from, 12))
    };
    let start: Vec<String> =
        run.start.iter().map(|n| format!("{}={}", n.name, significant(n.value, 6))).collect();
    let start = start.join(",");
    format!(
        "leverrier simulate {spec} --start {start}{from} --duration {} --dt {}",
        significant(run.duration, 12),
        significant(run.step, 12)
    )
}

/// What to design for: what was asked for, or else what `diagnose` cannot decide.
fn purpose(
    arguments: &Arguments,
    workspace: &Workspace,
    law: &Law,
    options: &Options,
    progress: &Progress,
) -> Result<Purpose> {
    let spec = &workspace.spec;
    let model = LawOnData::of(law.clone(), &workspace.dataset, options);
    let with = |label: &str, statement: &str, start: &[f64]| {
        Rival::with_effect(&model, spec.compiled(), label, statement, start)
    };
    if !arguments.between.is_empty() {
        let mut rivals: Vec<Rival> = Vec::new();
        for text in &arguments.between {
            let mut asked = NamedEffect::new(text, spec.text(), spec.system())?;
            if asked.place(spec.text()).is_some() {
                return Err(usage(
                    format!("{} has `{}` already", spec.name(), asked.label),
                    "`leverrier remove` takes it out; rivals are judged by adding them",
                ));
            }
            if rivals.iter().any(|rival| rival.label == asked.label) {
                return Err(usage(
                    format!("`{}` is named twice", asked.label),
                    "name different effects after --between",
                ));
            }
            asked.scanned(spec.compiled(), model.clone())?;
            rivals.push(with(&asked.label, &asked.statement, &[])?);
        }
        let why = format!("The run that best distinguishes {}, as asked for.", listed(&rivals));
        return Ok(Purpose { goal: Goal::Rivals, rivals, why });
    }
    if let Some(name) = &arguments.coefficient {
        let rivals = vec![Rival::as_it_is(law, "the model")];
        let why = format!("The run that best measures {name}, as asked for.");
        return Ok(Purpose { goal: Goal::Coefficient(Some(name.clone())), rivals, why });
    }
    let worst = Goal::Coefficient(None);
    let measures = "so the run is the one that best measures the least known coefficient.";
    let as_it_is = || vec![Rival::as_it_is(law, "the model")];
    let Some(held_out) = workspace.held_out() else {
        let why = format!("There are too few measurements to say what is missing, {measures}");
        return Ok(Purpose { goal: worst, rivals: as_it_is(), why });
    };
    let training = &workspace.split.training;
    let base = spec.compiled();
    let found = diagnosis::diagnose(base, law, training, held_out, options, progress)?;
    let tied = |leader: &&RankedEffect| found.indistinguishable.contains(&leader.effect);
    let first = found.ranking.first();
    let mut rivals: Vec<Rival> = Vec::new();
    // A number of the spec is no statement that a rival could have.
    let effects = first.into_iter().chain(found.ranking.iter().skip(1).filter(tied));
    for leader in effects.filter(|leader| leader.number.is_none()).take(RIVALS) {
        rivals.push(with(&leader.effect, &leader.snippet, &leader.coefficient)?);
    }
    let close = 1 + found.ranking.iter().skip(1).filter(tied).count();
    let more = close.saturating_sub(rivals.len());
    let alone = rivals.len() == 1;
    let among = listed(&rivals);
    if rivals.len() > 1 {
        // The diagnosis held some runs out; all of them together may have the answer.
        let (data, window) = (&workspace.dataset, law.window());
        let standings = design::standings(&rivals, data, window, options)?;
        let close = options.tuning.ranking.indistinguishable;
        let mut excess = standings.iter().map(|standing| standing.excess_deviance);
        rivals.retain(|_| excess.next().is_some_and(|excess| excess <= close));
    }
    Ok(match (rivals.as_slice(), found.verdict) {
        ([_, _, ..], _) => {
            let more = match more {
                0 => String::new(),
                1 => " (one more comes close, and is left out)".to_string(),
                _ => format!(" ({more} more come close, and are left out)"),
            };
            let why = format!("These data cannot distinguish {}{more}.", listed(&rivals));
            Purpose { goal: Goal::Rivals, rivals, why }
        }
        ([Rival { label, .. }], _) => {
            let missing = if alone {
                format!("{label} is missing, and no other effect comes close: `leverrier add` it.")
            } else {
                format!(
                    "The training part alone cannot distinguish {among}, but all measurements together can: {label} is missing, and `leverrier add` adds it."
                )
            };
            let why = format!(
                "{missing} The run is the one that best measures the least known coefficient of the model with it."
            );
            Purpose { goal: worst, rivals, why }
        }
        (_, Verdict::Unexplained) => {
            let why = format!("What is missing is not in the catalogue, {measures}");
            Purpose { goal: worst, rivals: as_it_is(), why }
        }
        _ => {
            let why = format!("Nothing is missing, {measures}");
            Purpose { goal: worst, rivals: as_it_is(), why }
        }
    })
}

/// `a, b and c`.
fn listed(rivals: &[Rival]) -> String {
    let labels: Vec<&str> = rivals.iter().map(|rival| rival.label.as_str()).collect();
    match labels.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        _ => labels.concat(),
    }
}

impl Arguments {
    fn allowed(&self, system: &System) -> Result<Allowed> {
        let positive = |what: &str, text: &Option<String>, count: usize| -> Result<Vec<f64>> {
            let Some(text) = text else { return Ok(Vec::new()) };
            let range = number_or_range(text)?;
            if range.lower <= 0.0 {
                return Err(usage(
                    format!("{what} must be positive"),
                    "give a time, such as 20, or a range of it, such as 5..20",
                ));
            }
            Ok(between(&range, count))
        };
        if self.from.is_some_and(|from| !from.is_finite()) {
            return Err(usage("--from must be a finite time", "give a time, such as 0"));
        }
        Ok(Allowed {
            start: intervals("--within", &self.within, system)?,
            motion: intervals("--stay", &self.stay, system)?,
            from: self.from,
            durations: positive("--duration", &self.duration, DURATIONS)?,
            steps: positive("--step", &self.step, STEPS)?,
        })
    }
}

/// A bound for each component of the state, where one is given.
fn intervals(option: &str, texts: &[String], system: &System) -> Result<Vec<Option<Interval>>> {
    let names: Vec<String> =
        system.coordinates.iter().chain(&system.momenta).map(|v| v.name.clone()).collect();
    let mut out = vec![None; names.len()];
    for text in texts {
        let (name, range) = text.split_once('=').ok_or_else(|| {
            usage(
                format!("`{text}` bounds nothing"),
                format!(
                    "write {option} {}",
                    example(names.get(..1).unwrap_or_default()).replace("0.1", "-1..1")
                ),
            )
        })?;
        let range = range_of(range)?;
        for at in matching(&names, name.trim())? {
            if let Some(side) = out.get_mut(at) {
                *side = Some(range);
            }
        }
    }
    Ok(out)
}

/// Values from the lower to the upper end in equal ratios.
fn between(range: &Interval, count: usize) -> Vec<f64> {
    if range.lower == range.upper {
        return vec![range.lower];
    }
    let ratio = range.upper / range.lower;
    (0..count).map(|i| range.lower * ratio.powf(i as f64 / (count - 1) as f64)).collect()
}
