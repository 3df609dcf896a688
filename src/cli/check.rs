//! `leverrier check`: what a spec means, and what its data hold.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::console::{Console, diagnostic_object, set};
use super::project::Spec;
use crate::error::Result;
use crate::expr::{FunctionSpace, Observed};
use crate::report::layout::WIDTH;

/// Show what a spec means: function space, units, what cannot be learned, and its data.
///
/// All errors of the spec are reported at once, each with its place and what to do.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier check pendulum.ham\n  \
    leverrier check pendulum.ham --no-data       the spec alone\n  \
    leverrier check pendulum.ham --data tuesday.csv")]
pub(super) struct Arguments {
    /// The spec.
    pub spec: PathBuf,
    /// Measurements to look at, instead of those that the spec names.
    #[arg(long, value_name = "FILE", conflicts_with = "no_data")]
    pub data: Option<PathBuf>,
    /// Do not look at the data.
    #[arg(long)]
    pub no_data: bool,
}

/// Runs the command.
pub(super) fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    let spec = Spec::open(&arguments.spec)?;
    let named = !spec.compiled().data.is_empty() || arguments.data.is_some();
    let data = (named && !arguments.no_data).then(|| spec.measurements(arguments.data.as_deref()));
    let space = FunctionSpace::new(spec.compiled());
    let width = console.width().unwrap_or(WIDTH as u16).max(40);
    let mut text = space.text(width);
    let mut object = json!({ "format": "leverrier.check/1" });
    if let (Some(object), Value::Object(fields)) = (object.as_object_mut(), json!(space)) {
        object.extend(fields);
    }
    set(
        &mut object,
        "observed",
        json!(match spec.system().observed {
            Observed::Momenta => "momenta",
            Observed::Velocities => "velocities",
        }),
    );
    set(
        &mut object,
        "time",
        json!({ "name": spec.system().time.name, "unit": spec.system().time.unit_text }),
    );
    let warnings = spec.warnings();
    set(
        &mut object,
        "warnings",
        warnings.iter().map(|warning| diagnostic_object(warning, spec.text())).collect(),
    );
    set(&mut object, "data", Value::Null);
    if let Some(Ok((_, about))) = &data {
        set(&mut object, "data", json!(about));
        text.push_str("\ndata\n");
        text.push_str(&about.to_text());
    } else if !named {
        text.push_str("\nThe spec names no data.\n");
    }
    console.diagnostics(spec.name(), spec.text(), warnings);
    match data {
        // A program gets one object: the error.
        Some(Err(error)) if console.is_json() => Err(error),
        Some(Err(error)) => {
            console.text(&text)?;
            Err(error)
        }
        _ => console.result(&text, &object),
    }
}
