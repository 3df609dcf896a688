//! `leverrier design`: the next run worth measuring.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::console::{Console, set, usage};
use super::progress::Progress;
use super::splitting::SplitArguments;
use super::values::{example, number_or_range, range_of};
use super::workspace::Workspace;
use crate::diagnose::Options;
use crate::diagnose::design::{self, Allowed, Proposal};
use crate::error::Result;
use crate::expr::System;
use crate::facade::components::{matching, state_names};
use crate::facade::design::{Asked, DURATIONS, Measured, Purpose, STEPS, purpose, values_between};
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
pub(super) struct Arguments {
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

/// Runs the command.
pub(super) fn run(arguments: &Arguments, console: &Console) -> Result<()> {
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
    let (all, training) = (&workspace.dataset, &workspace.split.training);
    let measured = Measured { all, training, held_out: workspace.held_out() };
    let Arguments { between, coefficient, .. } = arguments;
    let asked = Asked { between, coefficient: coefficient.as_deref() };
    let purpose = purpose(&workspace.spec, &law, &measured, &asked, &options, &progress)?;
    let Purpose { rivals, goal, why } = purpose;
    let window = law.window();
    let plan = design::design(&rivals, &goal, all, window, &allowed, &options, &progress)?;
    drop(progress);
    let spec = workspace.spec.name();
    let simulate = simulating(&plan.best, spec);
    let text = design_text(&plan, &why, spec, &simulate, console.width());
    let mut object = json!({
        "format": "leverrier.design/2",
        "system": workspace.spec.system().name,
        "split": workspace.split_json(),
        "terms_from": terms,
        "why": why,
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

impl Arguments {
    fn allowed(&self, system: &System) -> Result<Allowed> {
        let positive = |what: &str, text: &Option<String>, count: usize| -> Result<Vec<f64>> {
            let Some(text) = text else { return Ok(Vec::new()) };
            values_between(what, &number_or_range(text)?, count)
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
    let names = state_names(system);
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
