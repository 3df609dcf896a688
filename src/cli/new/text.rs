//! The text of a first spec.

use std::collections::HashSet;
use std::path::Path;

use super::rates::{Derivative, Rate};
use super::roles::{ANGLES, ColumnRoles, Partner, TimeIs, Why};
use super::words::{Named, is_count};
use crate::data::{self, Table};
use crate::expr::Unit;

/// What a spec may have in it, so that it can be fitted.
#[derive(Debug, Clone, Copy)]
pub(super) struct Style {
    pub units: bool,
    pub inputs: bool,
}

/// Columns that are left out, by name, at most: files may have thousands.
const NAMED: usize = 40;
/// Columns that a first spec shows as what may drive the motion.
const SHOWN_INPUTS: usize = 3;

/// A column's name as a name of the mini-language, other than those that are taken.
fn word(name: &str, taken: &mut HashSet<String>) -> String {
    let mut out: String = name
        .trim()
        .chars()
        .filter(|c| !matches!(c, '{' | '}'))
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
    let stem = out.clone();
    let mut number = 2;
    while !taken.insert(out.clone()) {
        out = format!("{stem}_{number}");
        number += 1;
    }
    out
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

/// What a column is called in the `data` statement: by its name, or by its header where another
/// column has that name, too.
fn reference(named: &Named, table: &Table) -> String {
    let column = named.column;
    let same =
        |other: &&crate::data::Column| other.name == column.name || other.header == column.name;
    let alone = table.columns.iter().filter(same).count() == 1;
    (if alone { &column.name } else { &column.header }).clone()
}

/// A variable of the spec, with its column.
struct Variable<'g, 'a> {
    named: Option<&'g Named<'a>>,
    name: String,
    /// The unit of the spec, and that of the file.
    unit: Option<String>,
    in_file: Option<String>,
    /// The column of its standard errors.
    error: Option<&'g Named<'a>>,
}

impl Variable<'_, '_> {
    fn declared(&self) -> String {
        format!("{}{}", self.name, bracketed(self.unit.as_ref()))
    }

    /// What the `data` statement has to say of it.
    fn item(&self, table: &Table) -> Option<String> {
        let column = reference(self.named?, table);
        let other = self.in_file.as_ref().filter(|unit| Some(*unit) != self.unit.as_ref());
        if column == self.name && other.is_none() && self.error.is_none() {
            return None;
        }
        let error = self.error.map_or_else(String::new, |error| {
            let own = error.unit.as_ref().filter(|unit| Some(*unit) != self.in_file.as_ref());
            let own = own.filter(|_| self.in_file.is_some());
            format!(" error {}{}", quoted(&reference(error, table)), bracketed(own))
        });
        Some(format!("{} = {}{}{error}", self.name, quoted(&column), bracketed(other)))
    }
}

/// The unit that a column has in the spec: angles are in radians inside functions.
fn unit_of(named: &Named) -> Option<String> {
    let turns = named.unit.as_deref().is_some_and(|unit| {
        let parsed = Unit::parse(unit);
        unit.contains("rev") || unit.contains("turn") || parsed.is_err()
    });
    if turns {
        return named.unit.as_deref().map(|unit| unit.replace("rev", "rad").replace("turn", "rad"));
    }
    named.unit.as_deref().map(|unit| unit.replace("deg", "rad"))
}

/// The unit of the inertia of a coordinate, so that its energy is in the unit of that of the first:
/// none where both are in one unit, or where a unit is too long to be squared.
fn inertia(first: &str, own: &str) -> Option<String> {
    let simple = |unit: &str| unit == "1" || unit.chars().all(char::is_alphabetic);
    if first == own || !simple(first) || !simple(own) {
        return None;
    }
    let squared = |unit: &str| if unit == "1" { unit.to_string() } else { format!("{unit}^2") };
    Some(match own {
        "1" => squared(first),
        own => format!("{}/{own}^2", squared(first)),
    })
}

/// The unit of time of the spec: the second where parts of it are in the file.
fn unit_of_time(unit: &str) -> String {
    match unit {
        "min" | "h" | "d" | "day" | "year" => unit.to_string(),
        _ => "s".to_string(),
    }
}

/// The text of the spec, and what it assumes in sentences.
pub(super) fn spec(
    roles: &ColumnRoles,
    table: &Table,
    data: &Path,
    path: &Path,
    style: Style,
) -> (String, Vec<String>) {
    let assumed = assumed(roles, style);
    let error = |named: &Named| {
        let own = roles.errors.iter().find(|(of, _)| *of == named.column.header);
        own.map(|(_, error)| error)
    };
    // Units are all or nothing: half of them would only be half checked.
    let all =
        style.units && roles.time.unit.is_some() && roles.used().all(|named| named.unit.is_some());
    let time_unit = roles.time.unit.clone().filter(|_| all);
    let spec_time = time_unit.as_deref().map(unit_of_time);
    let mut taken: HashSet<String> = HashSet::new();
    taken.insert("t".to_string());
    let mut coordinates: Vec<Variable> = Vec::new();
    let mut seconds: Vec<Variable> = Vec::new();
    let first_unit = roles.pairs.first().and_then(|(q, _)| unit_of(q)).filter(|_| all);
    // Of each coordinate, where it is in another unit than the first.
    let mut inertias: Vec<Option<String>> = Vec::new();
    for (q, v) in &roles.pairs {
        let unit = unit_of(q).filter(|_| all);
        let other = first_unit.as_deref().zip(unit.as_deref());
        let inertia = other.and_then(|(first, own)| inertia(first, own));
        inertias.push(inertia.clone());
        let in_file = q.unit.clone().filter(|_| all);
        let name = word(&with_group(q, roles), &mut taken);
        let rate = unit.as_ref().zip(spec_time.as_ref()).map(|(q, t)| match q.as_str() {
            "1" => format!("1/{t}"),
            q => format!("{q}/{t}"),
        });
        let second = match v {
            Some(v) => Variable {
                named: Some(v),
                name: word(&with_group(v, roles), &mut taken),
                // Momenta may have the unit of a mass in them.
                unit: match roles.role {
                    Partner::Momentum => v.unit.clone().filter(|_| all),
                    _ => rate,
                },
                in_file: v.unit.clone().filter(|_| all),
                error: error(v),
            },
            // That of a velocity: the mass is a plain 1.
            None => {
                let name = word(&format!("p_{name}"), &mut taken);
                // Times a moment of inertia, where that has a unit.
                let unit = match inertia {
                    Some(inertia) => rate.map(|rate| format!("{inertia}*{rate}")),
                    None => rate,
                };
                Variable { named: None, name, unit, in_file: None, error: None }
            }
        };
        coordinates.push(Variable { named: Some(q), name, unit, in_file, error: error(q) });
        seconds.push(second);
    }
    let measure = roles.rate.as_ref().map(|rate| {
        let unit = rate.unit_of_coordinate().filter(|_| all);
        let per_time = unit.as_ref().zip(spec_time.as_ref()).map(|(q, t)| format!("{q}/{t}"));
        let per_time_squared =
            unit.as_ref().zip(spec_time.as_ref()).map(|(q, t)| format!("{q}/{t}^2"));
        let name = word(rate.coordinate(), &mut taken);
        let momentum = word(&format!("p_{name}"), &mut taken);
        let hidden = |name, unit| Variable { named: None, name, unit, in_file: None, error: None };
        coordinates.push(hidden(name, unit));
        seconds.push(hidden(momentum, per_time.clone()));
        inertias.push(None);
        Variable {
            named: Some(&rate.named),
            name: word(&with_group(&rate.named, roles), &mut taken),
            unit: match rate.derivative {
                Derivative::First => per_time,
                Derivative::Second => per_time_squared,
            },
            in_file: rate.named.unit.clone().filter(|_| all),
            error: error(&rate.named),
        }
    });
    let mut inputs: Vec<Variable> = Vec::new();
    for named in roles.inputs.iter().filter(|_| style.inputs) {
        let unit = named.unit.clone().filter(|_| all);
        inputs.push(Variable {
            named: Some(named),
            name: word(&with_group(named, roles), &mut taken),
            in_file: unit.clone(),
            unit,
            error: None,
        });
    }

    let time = reference(&roles.time, table);
    let unit = bracketed(time_unit.as_ref());
    let mut items = match &roles.every {
        Some((seconds, _)) => format!("every {}{unit}", data::format_number(*seconds)),
        None => format!("time {}{unit}", quoted(&time)),
    };
    if let Some(run) = roles.run {
        items.push_str(&format!("  run {}", quoted(&run.name)));
    }
    for variable in coordinates.iter().zip(&seconds).flat_map(|(q, v)| [q, v]) {
        if let Some(item) = variable.item(table) {
            items.push_str(&format!("  {item}"));
        }
        if variable.named.is_none() {
            items.push_str(&format!("  {} not measured", variable.name));
        }
    }
    for item in measure.iter().chain(&inputs).filter_map(|variable| variable.item(table)) {
        items.push_str(&format!("  {item}"));
    }
    let momenta: Vec<String> = coordinates
        .iter()
        .zip(&seconds)
        .map(|(q, v)| match roles.role {
            Partner::Velocity => format!("p_{}", q.name),
            _ => v.name.clone(),
        })
        .collect();
    let kinetic: Vec<String> = momenta
        .iter()
        .zip(&inertias)
        .map(|(p, inertia)| match inertia {
            Some(unit) if roles.role != Partner::Momentum => format!("{p}^2/(2 [{unit}])"),
            _ => format!("{p}^2/2"),
        })
        .collect();
    let names: Vec<String> = coordinates.iter().map(|q| q.name.clone()).collect();
    let space = function_space(roles, &coordinates, all);
    let (keyword, about) = match roles.role {
        Partner::Velocity => ("velocities ", "measured velocities; momenta are called p_..."),
        Partner::Momentum => ("momenta    ", "the momenta that belong to them"),
        Partner::Nothing => ("momenta    ", "not measured: they are found along the way"),
    };
    let list = |variables: &[Variable]| {
        variables.iter().map(Variable::declared).collect::<Vec<_>>().join(", ")
    };
    let what_moves = match (&roles.rate, roles.guessed) {
        (Some(_), _) => "what moves; where it is, no column shows",
        (None, true) => "is this what moves? Nothing says so",
        (None, false) => "what moves",
    };
    let measured = match (&roles.rate, &measure, names.first()) {
        (Some(rate), Some(measure), Some(q)) => stated_measure(rate, measure, q),
        _ => String::new(),
    };
    let stated_time = match (&spec_time, &time_unit) {
        (Some(spec), Some(file)) if spec != file => format!("time t [{spec}]\n"),
        _ => String::new(),
    };
    let first = names.first().map_or("", String::as_str);
    let stem = path.file_stem().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let file = file_name(data, path);
    let text = format!(
        "# A first spec for {file}, to be edited. Text behind a # is a comment.\n\
         #   leverrier check {own}     shows what it means\n\
         #   leverrier fit {own}       learns the unknown part\n\n\
         system \"{title}\"\n\n\
         {read}\
         coordinates {coordinates}    # {what_moves}\n\
         {keyword} {seconds}    # {about}\n\
         {stated_time}{stated_inputs}\
         data \"{path}\" {{ {items} }}\n\
         {time_question}{measured}{left}\n\
         # The energy is T + V. What is known is written as it is; what is unknown is a\n\
         # span{{...}}: a list of terms, each of which gets a coefficient if the data ask for it.\n\
         T = {kinetic}\n\
         V = span{{ {space} }}\n\n\
         {forces}\
         # Friction and other forces that are not in the energy (remove the # to try it):\n\
         # force {first} += span{{ -{momentum} }}\n{suggested}",
        read = comments(table.reading.notes().iter().chain(&roles.wrong).map(String::as_str)),
        own = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
        title = stem.replace('"', "'"),
        coordinates = list(&coordinates),
        seconds = list(&seconds),
        stated_inputs = stated_inputs(&inputs),
        path = file.replace('"', "'"),
        time_question = time_question(roles, table),
        left = left_out(roles, style),
        kinetic = kinetic.join(" + "),
        space = space.join(", "),
        forces = forces(&inputs, &names),
        momentum = momenta.first().map_or("", String::as_str),
        suggested = suggested(roles, style, first, &mut taken),
    );
    (text, assumed)
}

/// The terms of the potential energy that a first fit chooses from.
fn function_space(roles: &ColumnRoles, coordinates: &[Variable], all: bool) -> Vec<String> {
    if let ([q], Some(rate)) = (coordinates, &roles.rate) {
        // Without a term of first order there is no force at zero: that is where zero lies.
        let name = &q.name;
        let powers = (2..=4).map(|power| format!("{name}^{power}"));
        return powers.chain(rate.turns.then(|| format!("cos({name})"))).collect();
    }
    let names: Vec<&str> = coordinates.iter().map(|q| q.name.as_str()).collect();
    let mut space = vec![format!("poly({}; 4)", names.join(", "))];
    for q in coordinates {
        let Some(named) = q.named else { continue };
        let degrees = named.unit.as_deref().is_some_and(|unit| unit.contains("deg"));
        let angle = named.parts().iter().any(|(stem, _)| ANGLES.contains(&stem.as_str()))
            || named.unit.as_deref() == Some("rad");
        // Without a unit of time nothing is converted: no cosine of degrees.
        if (degrees && all) || (angle && !degrees) {
            space.push(format!("cos({})", q.name));
            space.push(format!("sin({})", q.name));
        }
    }
    space
}

/// What a column shows of the coordinate `q`, and what is asked about it.
fn stated_measure(rate: &Rate, measure: &Variable, q: &str) -> String {
    let header = data::visible(&rate.named.column.header);
    let mut out = format!("# Zero of {q} is where no force acts.");
    if rate.others > 0 {
        out.push_str(&format!(
            " `{header}` varies most of {} columns of its kind.\n# Is it this one?",
            rate.others + 1
        ));
    }
    out.push('\n');
    let declared = measure.declared();
    match rate.derivative {
        Derivative::First => out.push_str(&format!("measure {declared} = rate({q})\n")),
        Derivative::Second => {
            let scale = |unit: &Option<String>| Some(Unit::parse(unit.as_deref()?).ok()?.scale);
            let ratio = scale(&measure.in_file).zip(scale(&measure.unit));
            let mean = ratio.map_or(rate.mean, |(file, spec)| rate.mean * file / spec);
            out.push_str(&format!(
                "# At rest an accelerometer may show gravity, and an offset.\n\
                 param at_rest = {}{}\n\
                 measure {declared} = rate(rate({q})) + at_rest\n",
                data::short(mean),
                bracketed(measure.unit.as_ref()),
            ));
        }
    }
    out
}

/// The name of a column, with the body that it belongs to where there are several.
fn with_group(named: &Named, roles: &ColumnRoles) -> String {
    let several = roles.used().any(|other| other.group != named.group);
    if several && !named.group.is_empty() && !super::words::is_run(&named.group) {
        return format!("{}_{}", named.name, named.group);
    }
    named.name.clone()
}

fn assumed(roles: &ColumnRoles, style: Style) -> Vec<String> {
    let mut assumed = vec![match (&roles.every, roles.time_is) {
        (Some((seconds, _)), _) => {
            format!("samples are {} s apart", data::format_number(*seconds))
        }
        (None, TimeIs::Named) => format!("time is `{}`", roles.time.column.header),
        (None, TimeIs::Counted) => {
            format!("time is counted in steps of `{}`", roles.time.column.header)
        }
        (None, TimeIs::Rising) => {
            format!("time is `{}`, because it rises", roles.time.column.header)
        }
    }];
    match roles.run {
        Some(run) => assumed.push(format!("`{}` tells the runs apart", run.header)),
        None if roles.files > 0 => assumed.push(format!("{} files are a run each", roles.files)),
        None => assumed.push("all rows are one run".to_string()),
    }
    for (q, v) in &roles.pairs {
        let its = match (v, roles.role) {
            (Some(v), Partner::Momentum) => format!("and `{}` its momentum", v.column.header),
            (Some(v), _) => format!("and `{}` its velocity", v.column.header),
            (None, _) => "whose velocity is not measured".to_string(),
        };
        assumed.push(format!("`{}` is a coordinate {its}", q.column.header));
    }
    if let Some(rate) = &roles.rate {
        let derivative = match (rate.derivative, rate.turns) {
            (Derivative::First, true) => "rate of an angle",
            (Derivative::First, false) => "velocity of a place",
            (Derivative::Second, true) => "acceleration of an angle",
            (Derivative::Second, false) => "acceleration of a place",
        };
        let header = &rate.named.column.header;
        assumed.push(format!("`{header}` is the {derivative} that no column shows"));
    }
    if roles.role != Partner::Momentum {
        assumed.push("every mass is 1 (change T in the spec if you know better)".to_string());
    }
    for (of, named) in &roles.errors {
        assumed.push(format!("`{}` holds the standard errors of `{of}`", named.column.header));
    }
    for named in roles.inputs.iter().filter(|_| style.inputs) {
        assumed.push(format!("`{}` drives the motion", named.column.header));
    }
    for (named, _) in roles.left.iter().take(NAMED) {
        assumed.push(format!("`{}` is not used", named.column.header));
    }
    if let Some(more) = roles.left.len().checked_sub(NAMED + 1) {
        assumed.push(format!("{} more columns are not used", more + 1));
    }
    assumed
}

fn comments<'a>(lines: impl Iterator<Item = &'a str>) -> String {
    lines.map(|line| format!("# {}\n", data::visible(line))).collect()
}

/// What is asked about the time.
fn time_question(roles: &ColumnRoles, table: &Table) -> String {
    let header = data::visible(&roles.time.column.header);
    if let Some((_, line)) = &roles.every {
        return format!("# How far apart samples are is told by the line `{line}`. Is that so?\n");
    }
    if roles.is_counted(table) {
        return format!(
            "# No column holds the time. How far apart are two samples? Write it in the place of\n\
             # `time {header}`, as in `every 10 [ms]`; until then the unit of time is one step.\n"
        );
    }
    match (roles.time_is, &roles.time.unit) {
        (_, Some(unit)) if roles.unit_guessed => format!(
            "# `{header}` has no unit; its numbers are as large as dates are in [{unit}]. Is that so?\n"
        ),
        (TimeIs::Counted, _) if is_count(&roles.time) => format!(
            "# `{header}` counts: how many of it are a second? Until that is said, the unit of \
             time is one step.\n"
        ),
        (TimeIs::Rising, _) => {
            format!("# is `{header}` the time? Nothing says so but that it rises.\n")
        }
        (_, None) => format!(
            "# in which unit is `{header}`? Behind its name in brackets, as in `time t [s]`, units \
             are checked.\n"
        ),
        _ => String::new(),
    }
}

/// What is left out, each with its reason or a question.
fn left_out(roles: &ColumnRoles, style: Style) -> String {
    let mut out = String::new();
    let dropped =
        roles.inputs.iter().filter(|_| !style.inputs).map(|named| (named, &Why::MayDrive));
    let left = roles.left.iter().map(|(named, why)| (named, why)).chain(dropped);
    let count = left.clone().count();
    for (named, why) in left.take(NAMED) {
        let header = data::visible(&named.column.header);
        out.push_str(&match why {
            Why::Error(of) if of.is_empty() => {
                format!("# `{header}` holds errors of a measurement. Left out.\n")
            }
            Why::Error(of) => format!("# `{header}` holds the errors of {of}. Left out.\n"),
            Why::Time => format!("# `{header}` is another time, or a count. Left out.\n"),
            Why::OtherRun => format!("# `{header}` belongs to another run. Left out.\n"),
            Why::Text => format!("# `{header}` holds no numbers. Left out.\n"),
            Why::MayDrive => format!("# does `{header}` drive the motion? Left out.\n"),
            Why::TooMany => format!("# `{header}` is one coordinate too many. Left out.\n"),
            Why::Unknown => format!("# is `{header}` something that moves? Left out.\n"),
        });
    }
    if let Some(more) = count.checked_sub(NAMED + 1) {
        out.push_str(&format!("# and {} more columns. Left out.\n", more + 1));
    }
    out
}

fn stated_inputs(inputs: &[Variable]) -> String {
    let one = |input: &Variable| {
        format!("input {} {{ linear }}    # measured, and drives the motion\n", input.declared())
    };
    inputs.iter().map(one).collect()
}

/// What inputs do: each may push every coordinate.
fn forces(inputs: &[Variable], coordinates: &[String]) -> String {
    if inputs.is_empty() {
        return String::new();
    }
    let names: Vec<&str> = inputs.iter().map(|input| input.name.as_str()).collect();
    let mut out = format!(
        "# What drives the motion. Does it push there? If {} only followed the motion, remove it.\n",
        names.join(", ")
    );
    for coordinate in coordinates {
        out.push_str(&format!("force {coordinate} += span{{ {} }}\n", names.join(", ")));
    }
    out.push('\n');
    out
}

/// Lines for the first columns that are left over, should one of them drive the motion.
fn suggested(
    roles: &ColumnRoles,
    style: Style,
    coordinate: &str,
    taken: &mut HashSet<String>,
) -> String {
    let left = roles.left.iter().filter(|(_, why)| matches!(why, Why::MayDrive | Why::Unknown));
    let left = left.map(|(named, _)| named);
    let dropped = roles.inputs.iter().filter(|_| !style.inputs);
    let mut lines = String::new();
    for named in left.chain(dropped).take(SHOWN_INPUTS) {
        let name = word(&named.name, taken);
        // A column with another name than the input would have to be named in the data block.
        if name == named.column.name {
            lines.push_str(&format!(
                "# input {name} {{ linear }}\n# force {coordinate} += {name}\n"
            ));
        }
    }
    if lines.is_empty() {
        return lines;
    }
    format!(
        "\n# What drives the motion, if it was measured: its column, and what it does between \
         samples\n# (hold, linear, spline or band_limited).\n{lines}"
    )
}

/// The name of the data file as the spec has it.
fn file_name(data: &Path, path: &Path) -> String {
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
    if same_folder { file } else { absolute(data) }
}

fn absolute(path: &Path) -> String {
    std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf()).display().to_string()
}
