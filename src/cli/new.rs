//! `leverrier new`: looks at a file of measurements and writes a first spec.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::console::Console;
use super::console::usage;
use super::project::refuse_overwrite;
use crate::data::{self, Column, Table, write_atomically};
use crate::error::Result;
use crate::expr::{self, FunctionSpace, Unit};

/// Look at the columns of a data file and write a first spec for it.
///
/// Guesses which columns are time, run, coordinates, and velocities or momenta, from their
/// names; says what it assumed. The spec is a plain text to be edited.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier new swings.csv                 writes swings.ham\n  \
    leverrier new swings.csv -o bench.ham\n  \
    leverrier new swings.parquet\n  \
    leverrier new rig.mat#swings             a variable of several, or a sheet\n\n\
    Column names that are understood: t, time; run, trial, id; theta with omega; x with v (x1 \
    with\nv1, x with x_dot or vx); q with p; theta, x, q and the like alone. Units are taken from \
    headers such\nas `theta [rad]`.")]
pub(super) struct Arguments {
    /// The file of measurements.
    pub data: PathBuf,
    /// The spec to write; by default the data's name with the ending .ham.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Overwrite a spec that exists.
    #[arg(long)]
    pub force: bool,
}

/// What run columns are called.
const RUN_NAMES: &[&str] = &["run", "trial", "id", "experiment", "trajectory", "series"];

/// What goes with a coordinate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Partner {
    Velocity,
    Momentum,
    /// No column: positions alone are measured.
    Nothing,
}

/// Names that go together, without the index behind them: coordinate, its partner, and what
/// the partner is. A new habit is one row here. `*` is any name.
const PARTNERS: &[(&str, &str, Partner)] = &[
    ("theta", "omega", Partner::Velocity),
    ("phi", "omega", Partner::Velocity),
    ("alpha", "omega", Partner::Velocity),
    ("angle", "angular_velocity", Partner::Velocity),
    ("angle", "omega", Partner::Velocity),
    ("angle", "rate", Partner::Velocity),
    ("position", "velocity", Partner::Velocity),
    ("pos", "vel", Partner::Velocity),
    ("displacement", "velocity", Partner::Velocity),
    ("x", "v", Partner::Velocity),
    ("q", "v", Partner::Velocity),
    ("q", "p", Partner::Momentum),
    ("x", "p", Partner::Momentum),
    ("theta", "p", Partner::Momentum),
    ("*", "*_dot", Partner::Velocity),
    ("*", "*dot", Partner::Velocity),
    ("*", "d*", Partner::Velocity),
    ("*", "d*_dt", Partner::Velocity),
    ("*", "d*dt", Partner::Velocity),
    ("*", "v*", Partner::Velocity),
    ("*", "v_*", Partner::Velocity),
    ("*", "p*", Partner::Momentum),
    ("*", "p_*", Partner::Momentum),
];

/// Names of columns that drive a motion rather than follow it.
const DRIVING: &[&str] = &["u", "force", "torque", "voltage", "current", "input", "command"];

/// Coordinates that are known by their name, where no column goes with any.
const ALONE: &[&str] = &[
    "theta",
    "phi",
    "psi",
    "alpha",
    "angle",
    "position",
    "pos",
    "displacement",
    "deflection",
    "height",
    "x",
    "y",
    "z",
    "q",
];

/// Coordinates of a first spec, at most: a polynomial of degree 4 in more of them has more terms
/// than a function space may have.
const MOST_COORDINATES: usize = 44;

/// Coordinates that are angles.
const ANGLES: &[&str] = &["theta", "phi", "alpha", "angle", "psi"];

/// What the columns were taken for.
struct ColumnRoles<'a> {
    time: &'a Column,
    run: Option<&'a Column>,
    /// Coordinate and its partner.
    pairs: Vec<(&'a Column, Option<&'a Column>)>,
    role: Partner,
    unused: Vec<&'a Column>,
}

impl<'a> ColumnRoles<'a> {
    /// All columns of coordinates and of what goes with them.
    fn used(&self) -> impl Iterator<Item = &'a Column> {
        self.pairs.iter().flat_map(|&(q, v)| [Some(q), v]).flatten()
    }
}

/// Runs the command.
pub(super) fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    let table = data::read(&arguments.data)?;
    let path = arguments.output.clone();
    let path = path.unwrap_or_else(|| data::file_of(&arguments.data).with_extension("ham"));
    if path == arguments.data {
        return Err(usage("the spec would take the place of the data", "name it with -o"));
    }
    refuse_overwrite(&path, arguments.force)?;
    let guess = guess(&table)?;
    let (text, assumed) = spec(&guess, &arguments.data, &path);
    // What is written must be a spec that can be fitted.
    let compiled = expr::build(&path.display().to_string(), &text)?;
    let warnings = constant_columns(&table, &guess);
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

/// A name in small letters, and the index behind it: `q[1]` and `q_1` are `q` and `1`.
fn parted(name: &str) -> (String, String) {
    let lower = name.trim().to_lowercase().replace(['[', ']', ' '], "");
    let stem = lower.trim_end_matches(|c: char| c.is_ascii_digit());
    let index = lower[stem.len()..].to_string();
    (stem.trim_end_matches('_').to_string(), index)
}

/// Columns that may be looked up by their names, for files of many columns.
#[derive(Default)]
struct ColumnIndex {
    /// Positions by the name in small letters.
    whole: HashMap<String, BTreeSet<usize>>,
    /// Positions by the name in small letters and the index behind it.
    parted: HashMap<(String, String), BTreeSet<usize>>,
}

impl ColumnIndex {
    fn new(columns: &[&Column]) -> Self {
        let mut index = ColumnIndex::default();
        for (at, column) in columns.iter().enumerate() {
            index.whole.entry(whole(&column.name)).or_default().insert(at);
            index.parted.entry(parted(&column.name)).or_default().insert(at);
        }
        index
    }

    /// Takes a column out, once it has its place.
    fn remove(&mut self, at: usize, column: &Column) {
        if let Some(positions) = self.whole.get_mut(&whole(&column.name)) {
            positions.remove(&at);
        }
        if let Some(positions) = self.parted.get_mut(&parted(&column.name)) {
            positions.remove(&at);
        }
    }

    /// The first column that goes with the coordinate at `own`, and what it is.
    fn partner(&self, own: usize, coordinate: &Column) -> Option<(usize, Partner)> {
        let name = whole(&coordinate.name);
        let (stem, index) = parted(&coordinate.name);
        let first = |positions: Option<&BTreeSet<usize>>| {
            positions.and_then(|positions| positions.iter().copied().find(|&at| at != own))
        };
        let mut best: Option<(usize, Partner)> = None;
        for (coordinates, others, partner) in PARTNERS {
            let at = if *coordinates == "*" {
                let by_name = first(self.whole.get(&others.replace('*', &name)));
                let key = (others.replace('*', &stem), index.clone());
                by_name.into_iter().chain(first(self.parted.get(&key))).min()
            } else if stem == *coordinates {
                first(self.parted.get(&((*others).to_string(), index.clone())))
            } else {
                None
            };
            // Of two rows that name the same column the first says what it is.
            if let Some(at) = at
                && best.is_none_or(|(earlier, _)| at < earlier)
            {
                best = Some((at, *partner));
            }
        }
        best
    }
}

/// Coordinates and what goes with them, in the order of the columns. Its time grows in
/// proportion to their number.
fn paired<'a>(columns: &[&'a Column]) -> Vec<(&'a Column, &'a Column, Partner)> {
    let mut index = ColumnIndex::new(columns);
    let mut taken = vec![false; columns.len()];
    let mut pairs = Vec::new();
    for (own, &coordinate) in columns.iter().enumerate() {
        if taken.get(own) == Some(&true) {
            continue;
        }
        let Some((at, partner)) = index.partner(own, coordinate) else { continue };
        let Some(&other) = columns.get(at) else { continue };
        for (at, column) in [(own, coordinate), (at, other)] {
            index.remove(at, column);
            if let Some(taken) = taken.get_mut(at) {
                *taken = true;
            }
        }
        pairs.push((coordinate, other, partner));
    }
    pairs
}

/// A name in small letters.
fn whole(name: &str) -> String {
    name.trim().to_lowercase()
}

fn guess(table: &Table) -> Result<ColumnRoles<'_>> {
    let is = |column: &Column, names: &[&str]| names.contains(&column.name.to_lowercase().as_str());
    let wrong = |message: String, hint: String| {
        table.error(table.reading.header_line(), None, message, hint)
    };
    let numeric: Vec<&Column> = table.columns.iter().filter(|c| table.is_numeric(c)).collect();
    let headers = || data::listed(table);
    let time = numeric
        .iter()
        .find(|c| is(c, data::TIME_NAMES))
        .or_else(|| numeric.iter().find(|c| c.name.to_lowercase().starts_with("time")));
    let Some(&time) = time else {
        return Err(wrong(
            format!("no column looks like the time; there are {}", headers()),
            "call it `t` or `time`".to_string(),
        ));
    };
    let kept = |c: &&Column| table.reading.runs() == Some(c.header.as_str());
    let run = table.columns.iter().find(kept);
    let run = run.or_else(|| table.columns.iter().find(|c| is(c, RUN_NAMES)));
    let rest: Vec<&Column> = numeric
        .iter()
        .copied()
        .filter(|c| c.header != time.header && run.is_none_or(|run| run.header != c.header))
        .collect();
    let pairs = paired(&rest);
    let momenta = pairs.iter().all(|pair| pair.2 == Partner::Momentum);
    let (pairs, role): (Vec<(&Column, Option<&Column>)>, Partner) = if pairs.is_empty() {
        (alone(&rest).into_iter().map(|column| (column, None)).collect(), Partner::Nothing)
    } else {
        let role = if momenta { Partner::Momentum } else { Partner::Velocity };
        (pairs.iter().map(|pair| (pair.0, Some(pair.1))).collect(), role)
    };
    if pairs.is_empty() {
        return Err(wrong(
            format!(
                "no column looks like a coordinate, and no two like one and its velocity or \
                 momentum; there are {}",
                headers()
            ),
            "call them for example `theta` and `omega`, `x` and `v`, or `q` and `p`".to_string(),
        ));
    }
    if pairs.len() > MOST_COORDINATES {
        return Err(wrong(
            format!(
                "{} columns look like coordinates, and a first spec is written for at most \
                 {MOST_COORDINATES}",
                pairs.len()
            ),
            "keep the columns of one system, or write the spec by hand, with a smaller function \
             space"
                .to_string(),
        ));
    }
    let mut guess = ColumnRoles { time, run, pairs, role, unused: Vec::new() };
    // A wrong cell is told now, not by the first fit.
    for column in guess.used().chain([guess.time]) {
        table.numbers(column)?;
    }
    let used: HashSet<&str> = guess.used().map(|column| column.header.as_str()).collect();
    guess.unused = rest.into_iter().filter(|c| !used.contains(c.header.as_str())).collect();
    Ok(guess)
}

/// The columns that are left, where they are coordinates by themselves: all have the name of one,
/// or there is no other. A further column could be what goes with one of them.
fn alone<'a>(columns: &[&'a Column]) -> Vec<&'a Column> {
    let is = |column: &Column, names: &[&str]| names.contains(&parted(&column.name).0.as_str());
    let columns: Vec<&Column> = columns.iter().copied().filter(|c| !is(c, DRIVING)).collect();
    let named = |column: &&Column| is(column, ALONE);
    if columns.len() == 1 || columns.iter().all(named) { columns } else { Vec::new() }
}

/// A column's name as a name of the mini-language.
fn word(name: &str) -> String {
    let mut out: String = name
        .trim()
        .chars()
        .map(|c| if c.is_alphanumeric() { c } else { '_' })
        .collect::<String>()
        .trim_matches('_')
        .to_string();
    if !out.starts_with(char::is_alphabetic) {
        out.insert_str(0, "x_");
    }
    if !crate::spec::may_name(&out) || out == "pi" {
        out.push_str("_1");
    }
    out
}

/// The unit of a header, where the mini-language knows it.
fn unit(column: &Column) -> Option<String> {
    column.unit.clone().filter(|unit| Unit::parse(unit).is_ok())
}

fn bracketed(unit: Option<&String>) -> String {
    unit.map_or(String::new(), |unit| format!(" [{unit}]"))
}

/// A name of a column as it may stand in a `data` statement.
fn quoted(name: &str) -> String {
    let plain = name.chars().all(|c| c.is_alphanumeric() || c == '_')
        && name.starts_with(char::is_alphabetic)
        && crate::spec::may_name(name);
    if plain { name.to_string() } else { format!("\"{}\"", name.replace('"', "'")) }
}

/// The text of the spec, and what it assumes in sentences.
fn spec(guess: &ColumnRoles, data: &Path, path: &Path) -> (String, Vec<String>) {
    let mut assumed = vec![format!("time is `{}`", guess.time.header)];
    match guess.run {
        Some(run) => assumed.push(format!("`{}` tells the runs apart", run.header)),
        None => assumed.push("all rows are one run".to_string()),
    }
    let name_of = |q: &Column, v: Option<&Column>| match v {
        Some(v) => (word(&q.name), word(&v.name)),
        None => (word(&q.name), format!("p_{}", word(&q.name))),
    };
    let names: Vec<(String, String)> = guess.pairs.iter().map(|&(q, v)| name_of(q, v)).collect();
    let time_unit = unit(guess.time);
    // Units are all or nothing: half of them would only be half checked.
    let all = time_unit.is_some() && guess.used().all(|column| unit(column).is_some());
    let shown = |column: &Column| unit(column).filter(|_| all);
    for (q, v) in &guess.pairs {
        let its = match (v, guess.role) {
            (Some(v), Partner::Momentum) => format!("and `{}` its momentum", v.header),
            (Some(v), _) => format!("and `{}` its velocity", v.header),
            (None, _) => "whose velocity is not measured".to_string(),
        };
        assumed.push(format!("`{}` is a coordinate {its}", q.header));
    }
    if guess.role != Partner::Momentum {
        assumed.push("every mass is 1 (change T in the spec if you know better)".to_string());
    }
    for column in &guess.unused {
        assumed.push(format!("`{}` is not used", column.header));
    }
    let list = |second: bool| -> String {
        let one = |((q, v), (name_q, name_v)): (&(&Column, Option<&Column>), &(String, String))| {
            let name = if second { name_v } else { name_q };
            let unit = match v {
                Some(v) => shown(if second { v } else { q }),
                // That of a velocity: the mass is a plain 1.
                None if second => shown(q).zip(shown(guess.time)).map(|(q, t)| format!("{q}/{t}")),
                None => shown(q),
            };
            // Degrees are converted: angles are in radians inside functions.
            let unit = unit.map(|unit| unit.replace("deg", "rad"));
            format!("{name}{}", bracketed(unit.as_ref()))
        };
        guess.pairs.iter().zip(&names).map(one).collect::<Vec<_>>().join(", ")
    };
    // What is named behind a # stays with the file, slashes and all.
    let inside = data::file_of(data);
    let same_folder = inside.parent() == path.parent();
    let file = match (data.to_str(), inside.parent().and_then(Path::to_str)) {
        (Some(name), Some("")) => name.to_string(),
        (Some(name), Some(folder)) => {
            name.strip_prefix(folder).unwrap_or(name).trim_start_matches('/').to_string()
        }
        _ => data.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
    };
    let file = if same_folder { file } else { absolute(data) };
    let stem = path.file_stem().map_or_else(String::new, |n| n.to_string_lossy().into_owned());

    let mut items =
        format!("time {}{}", quoted(&guess.time.name), bracketed(shown(guess.time).as_ref()));
    if let Some(run) = guess.run {
        items.push_str(&format!("  run {}", quoted(&run.name)));
    }
    for ((q, v), (name_q, name_v)) in guess.pairs.iter().zip(&names) {
        for (column, name) in [Some(*q), *v].into_iter().flatten().zip([name_q, name_v]) {
            let degrees = shown(column).filter(|unit| unit.contains("deg"));
            if *name != column.name || degrees.is_some() {
                let header = quoted(&column.name);
                items.push_str(&format!("  {name} = {header}{}", bracketed(degrees.as_ref())));
            }
        }
    }
    let momenta: Vec<String> = names
        .iter()
        .map(|(q, v)| if guess.role == Partner::Velocity { format!("p_{q}") } else { v.clone() })
        .collect();
    let kinetic: Vec<String> = momenta.iter().map(|p| format!("{p}^2/2")).collect();
    let coordinates: Vec<String> = names.iter().map(|(q, _)| q.clone()).collect();
    let mut space = vec![format!("poly({}; 4)", coordinates.join(", "))];
    for (q, (column, _)) in coordinates.iter().zip(&guess.pairs) {
        let turns = shown(column).is_some_and(|unit| unit == "rad" || unit == "deg");
        if turns || ANGLES.contains(&parted(q).0.as_str()) {
            space.push(format!("cos({q})"));
            space.push(format!("sin({q})"));
        }
    }
    let (keyword, about) = match guess.role {
        Partner::Velocity => ("velocities ", "measured velocities; momenta are called p_..."),
        Partner::Momentum => ("momenta    ", "the momenta that belong to them"),
        Partner::Nothing => ("momenta    ", "not measured: they are found along the way"),
    };
    let text = format!(
        "# A first spec for {file}, to be edited. Text behind a # is a comment.\n\
         #   leverrier check {own}     shows what it means\n\
         #   leverrier fit {own}       learns the unknown part\n\n\
         system \"{title}\"\n\n\
         coordinates {coordinates}    # what moves\n\
         {keyword} {seconds}    # {about}\n\
         data \"{path}\" {{ {items} }}\n\n\
         # The energy is T + V. What is known is written as it is; what is unknown is a\n\
         # span{{...}}: a list of terms, each of which gets a coefficient if the data ask for it.\n\
         T = {kinetic}\n\
         V = span{{ {space} }}\n\n\
         # Friction and other forces that are not in the energy (remove the # to try it):\n\
         # force {first} += span{{ -{momentum} }}\n{inputs}",
        inputs = inputs(&guess.unused, coordinates.first().map_or("", String::as_str)),
        own = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
        title = stem.replace('"', "'"),
        coordinates = list(false),
        seconds = list(true),
        path = file.replace('"', "'"),
        kinetic = kinetic.join(" + "),
        space = space.join(", "),
        first = coordinates.first().map_or("", String::as_str),
        momentum = momenta.first().map_or("", String::as_str),
    );
    (text, assumed)
}

/// Lines for the first columns that are left over, should one of them drive the motion.
fn inputs(unused: &[&Column], coordinate: &str) -> String {
    if unused.is_empty() {
        return String::new();
    }
    let mut out =
        "\n# What drives the motion, if it was measured: its column, and what it does between \
                   samples\n# (hold, linear, spline or band_limited).\n"
            .to_string();
    for column in unused.iter().take(SHOWN_INPUTS) {
        let name = word(&column.name);
        // A column with another name than the input would have to be named in the data block.
        if name == column.name {
            out.push_str(&format!("# input {name} {{ linear }}\n# force {coordinate} += {name}\n"));
        }
    }
    out
}

/// Columns that a first spec shows as what may drive the motion.
const SHOWN_INPUTS: usize = 3;

fn absolute(path: &Path) -> String {
    std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf()).display().to_string()
}

/// Columns of the guess that never change.
fn constant_columns(table: &Table, guess: &ColumnRoles) -> Vec<String> {
    let of_column = |column: &Column| {
        let numbers = table.numbers(column).ok()?;
        let mut known = numbers.iter().filter(|x| !x.is_nan());
        let first = known.next()?;
        let constant = numbers.len() > 1 && known.all(|x| x == first);
        constant.then(|| {
            format!("`{}` is always {first}: nothing can be learned from it.", column.header)
        })
    };
    guess.used().filter_map(of_column).collect()
}
