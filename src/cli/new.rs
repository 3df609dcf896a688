//! `leverrier new`: looks at a file of measurements and writes a first spec.

mod rates;
mod roles;
mod text;
mod words;

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use self::roles::{ColumnRoles, guess};
use self::text::{Style, spec};
use super::console::Console;
use super::console::usage;
use super::project::refuse_overwrite;
use crate::data::{self, NamedFile, Table, write_atomically};
use crate::error::Result;
use crate::expr::{self, FunctionSpace};

/// Look at the columns of a data file and write a first spec for it.
///
/// Guesses which columns are time, run, coordinates, velocities or momenta, and inputs, from their
/// names and units; says what it assumed, and asks where it cannot know. What it has no use for
/// is left out by name. The spec is a plain text to be edited.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier new swings.csv                 writes swings.ham\n  \
    leverrier new swings.csv -o bench.ham\n  \
    leverrier new swings.parquet\n  \
    leverrier new rig.mat#swings             a variable of several, or a sheet\n  \
    leverrier new \"swing_*.csv\"             every file is a run\n\n\
    Column names that are understood: t, time; run, trial, id; theta with omega; x with v (x1 \
    with\nv1, x with x_dot or vx); q with p; theta, x, q and the like alone. Units are taken from \
    headers such\nas `theta [rad]`. A rate or an acceleration alone, such as a gyroscope's, is measured as one.")]
pub(super) struct Arguments {
    /// The file of measurements, or a pattern in quotation marks that stands for several.
    #[arg(required = true)]
    pub data: Vec<PathBuf>,
    /// The spec to write; by default the data's name with the ending .ham.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Overwrite a spec that exists.
    #[arg(long)]
    pub force: bool,
}

/// Runs the command.
pub(super) fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    let [data] = arguments.data.as_slice() else {
        return Err(usage(
            "this is more than one file, which a spec names by a pattern",
            "write the pattern between quotation marks, as in `leverrier new \"swing_*.csv\"`",
        ));
    };
    let files = data::files_of(data)?;
    let Some((first, rest)) = files.split_first() else { return Ok(()) };
    let table = data::read(&first.path)?;
    let path = arguments.output.clone().unwrap_or_else(|| spec_beside(data));
    if path == *data {
        return Err(usage("the spec would take the place of the data", "name it with -o"));
    }
    refuse_overwrite(&path, arguments.force)?;
    let mut roles = guess(&table)?;
    roles.files = if first.name.is_some() { files.len() } else { 0 };
    // What is written must be a spec that can be fitted: what cannot stand in it is left to say.
    let mut made = None;
    let styles = [
        Style { units: true, inputs: true },
        Style { units: true, inputs: false },
        Style { units: false, inputs: true },
        Style { units: false, inputs: false },
    ];
    for style in styles {
        let (text, assumed) = spec(&roles, &table, data, &path, style);
        match (expr::build(&path.display().to_string(), &text), made.take()) {
            (Ok(compiled), _) => {
                made = Some(Ok((text, assumed, compiled)));
                break;
            }
            // The first says most.
            (Err(_), Some(earlier)) => made = Some(earlier),
            (Err(error), None) => made = Some(Err(error)),
        }
    }
    let Some(made) = made else { return Ok(()) };
    let (text, assumed, compiled) = made?;
    let mut warnings = constant_columns(&table, &roles);
    warnings.extend(roles.wrong.iter().cloned());
    warnings.extend(unlike(&table, rest));
    write_atomically(&path, text.as_bytes())?;
    for warning in &warnings {
        console.warning(warning);
    }
    let object = json!({
        "format": "leverrier.new/1",
        "path": path.display().to_string(),
        "spec": text,
        "assumed": assumed,
        "warnings": warnings,
        "function_space": FunctionSpace::new(&compiled).terms.len(),
    });
    let mut lines = vec![format!("{} written. Assumed:", path.display())];
    lines.extend(assumed.iter().map(|line| format!("  {line}")));
    lines.push(format!("Edit it, then run `leverrier fit {}`.", path.display()));
    console.result(&lines.join("\n"), &object)
}

/// The spec of data that are called so: `swings.ham` of `swings.csv.gz`, `swing.ham` of
/// `swing_*.csv`.
fn spec_beside(data: &Path) -> PathBuf {
    let file = data::file_of(data);
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let plain = data::stem(&name).replace(['*', '?'], "");
    let plain = match plain.trim_matches(['_', '-', '.', ' ']) {
        "" => "data",
        plain => plain,
    };
    file.with_file_name(format!("{plain}.ham"))
}

/// Files that have other columns than the first of them, each in a sentence.
fn unlike(table: &Table, rest: &[NamedFile]) -> Vec<String> {
    let headers = |table: &Table| -> Vec<(String, Option<String>)> {
        table.columns.iter().map(|column| (column.header.clone(), column.unit.clone())).collect()
    };
    let of = |file: &NamedFile| match data::head(&file.path, 1) {
        Ok(other) if headers(&other) == headers(table) => None,
        Ok(other) => Some(format!(
            "{} has the columns {}, and {} {}: they are no files of one kind.",
            file.path.display(),
            data::listed(&other),
            table.path.display(),
            data::listed(table)
        )),
        Err(error) => Some(error.to_string()),
    };
    rest.iter().filter_map(of).collect()
}

/// A name in small letters, and the index behind it: `q[1]` and `q_1` are `q` and `1`.
fn parted(name: &str) -> (String, String) {
    let lower = name.trim().to_lowercase().replace(['[', ']', ' '], "");
    let stem = lower.trim_end_matches(|c: char| c.is_ascii_digit());
    let index = lower.get(stem.len()..).unwrap_or_default().to_string();
    (stem.trim_end_matches('_').to_string(), index)
}

/// Columns of the guess that never change.
fn constant_columns(table: &Table, roles: &ColumnRoles) -> Vec<String> {
    let of_column = |named: &words::Named| {
        let column = named.column;
        let numbers = table.numbers(column).ok()?;
        let mut known = numbers.iter().filter(|x| !x.is_nan());
        let first = known.next()?;
        let constant = numbers.len() > 1 && known.all(|x| x == first);
        constant.then(|| {
            format!("`{}` is always {first}: nothing can be learned from it.", column.header)
        })
    };
    roles.used().filter_map(of_column).collect()
}
