//! What the columns of a table are taken for: time, run, coordinates and what goes with them,
//! inputs, and what is left out.

use std::collections::{BTreeSet, HashMap, HashSet};

use super::rates::{self, Rate};
use super::words::{self, ByWhat, Named};
use crate::data::{self, Column, Table};
use crate::error::Result;
use crate::expr::Unit;

/// What run columns are called.
const RUN_NAMES: &[&str] = &[
    "run",
    "trial",
    "id",
    "experiment",
    "trajectory",
    "series",
    "versuch",
    "messreihe",
    "lauf",
    "essai",
    "série",
    "ensayo",
    "serie",
];

/// What goes with a coordinate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Partner {
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
    ("angle", "velocity", Partner::Velocity),
    ("theta", "velocity", Partner::Velocity),
    ("theta", "angular_velocity", Partner::Velocity),
    ("phi", "angular_velocity", Partner::Velocity),
    ("position", "velocity", Partner::Velocity),
    ("pos", "vel", Partner::Velocity),
    ("displacement", "velocity", Partner::Velocity),
    ("height", "velocity", Partner::Velocity),
    ("x", "v", Partner::Velocity),
    ("y", "v", Partner::Velocity),
    ("s", "v", Partner::Velocity),
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
    "r",
];

/// Coordinates of a first spec, at most: a polynomial of degree 4 in more of them has more terms
/// than a function space may have.
const MOST_COORDINATES: usize = 44;
/// Coordinates that are kept where there are more.
const KEPT: usize = 4;

/// Coordinates that are angles.
pub(super) const ANGLES: &[&str] = &["theta", "phi", "alpha", "angle", "psi"];

/// Why a column is left out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Why {
    /// It holds the errors of another, named where that is known.
    Error(String),
    /// It is another time, or a count of samples.
    Time,
    /// It belongs to another run than the time.
    OtherRun,
    /// It holds no numbers.
    Text,
    /// It may drive the motion, or cannot because cells are missing.
    MayDrive,
    /// One coordinate too many.
    TooMany,
    /// Nothing tells what it is.
    Unknown,
}

/// The column that is made where no column is a time.
const COUNT: &str = "sample";

/// What the columns were taken for.
pub(super) struct ColumnRoles<'a> {
    pub time: Named<'a>,
    /// Whether the time is a count of samples or pictures, or only rises as a time does.
    pub time_is: TimeIs,
    /// Seconds from one sample to the next, and the line of the file that says so, where no column
    /// holds the time.
    pub every: Option<(f64, String)>,
    /// Whether the size of its numbers tells the unit of the time.
    pub unit_guessed: bool,
    pub run: Option<&'a Column>,
    /// How many files there are, where a name means several: each is a run, or has runs of its own.
    pub files: usize,
    /// Coordinate and its partner.
    pub pairs: Vec<(Named<'a>, Option<Named<'a>>)>,
    pub role: Partner,
    /// What shows how the only coordinate changes, where no column is a coordinate.
    pub rate: Option<Rate<'a>>,
    /// Whether nothing but its place says that the coordinate is one.
    pub guessed: bool,
    pub inputs: Vec<Named<'a>>,
    /// The header of a column that is used, and the column of its standard errors.
    pub errors: Vec<(String, Named<'a>)>,
    pub left: Vec<(Named<'a>, Why)>,
    /// What no fit will accept, in sentences.
    pub wrong: Vec<String>,
}

/// What tells that a column is the time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TimeIs {
    Named,
    Counted,
    Rising,
}

impl<'a> ColumnRoles<'a> {
    /// Whether no column holds the time, and rows are counted.
    pub(super) fn is_counted(&self, table: &Table) -> bool {
        table.reading.counted().is_some() && self.time.column.name == COUNT
    }

    /// All columns of coordinates and of what goes with them.
    pub(super) fn used(&self) -> impl Iterator<Item = &Named<'a>> {
        let rate = self.rate.iter().map(|rate| &rate.named);
        self.pairs.iter().flat_map(|(q, v)| [Some(q), v.as_ref()]).flatten().chain(rate)
    }
}

/// Whether units allow that a column goes with a coordinate: a velocity times a time is a length.
fn agree(coordinate: &Named, other: &Named, partner: Partner) -> bool {
    let parse = |named: &Named| named.unit.as_deref().and_then(|unit| Unit::parse(unit).ok());
    let (Some(q), Some(v)) = (parse(coordinate), parse(other)) else { return true };
    match partner {
        Partner::Velocity => {
            let time = q.over(v);
            Unit::parse("s").is_ok_and(|s| time.is_some_and(|time| time.same_kind(s)))
        }
        Partner::Momentum => !q.same_kind(v) || q.is_number(),
        Partner::Nothing => true,
    }
}

/// Whether a column never falls, but for a few steps back where runs begin.
fn rises(table: &Table, column: &Column) -> bool {
    let Ok(numbers) = table.numbers(column) else { return false };
    let known: Vec<f64> = numbers.into_iter().filter(|x| !x.is_nan()).collect();
    let up = known.array_windows().filter(|[a, b]| b > a).count();
    known.len() > 1 && 10 * up >= 9 * (known.len() - 1)
}

/// Takes every column for something.
///
/// # Errors
/// There is nothing but one column of numbers.
pub(super) fn guess(table: &Table) -> Result<ColumnRoles<'_>> {
    let nothing = |message: String, hint: &str| {
        Err(table.error(table.reading.header_line(), None, message, hint))
    };
    let all: Vec<Named> = table.columns.iter().map(Named::new).collect();
    let (numeric, text): (Vec<&Named>, Vec<&Named>) =
        all.iter().partition(|named| table.is_numeric(named.column));
    let likeness = |named: &Named| match words::likeness_to_time(named) {
        sure @ 6.. => sure,
        unsure if unsure > 0 && rises(table, named.column) => unsure,
        _ => 0,
    };
    let likely: Vec<(u32, &Named)> =
        numeric.iter().map(|named| (likeness(named), *named)).filter(|row| row.0 > 0).collect();
    let most = likely.iter().map(|row| row.0).max();
    let named = likely.iter().find(|row| Some(row.0) == most).map(|row| row.1);
    let rising = || numeric.iter().copied().find(|named| rises(table, named.column));
    let Some(time) = named.or_else(rising) else {
        return nothing(
            format!(
                "no column looks like the time, and none rises as a time does; there are {}",
                data::listed(table)
            ),
            "add a column with the time of every sample, and call it `t` or `time`",
        );
    };
    let time_is = match most {
        Some(3..) => TimeIs::Named,
        Some(_) => TimeIs::Counted,
        None => TimeIs::Rising,
    };
    let run = run_column(table, &all, time);
    let is_run = |named: &Named| run.is_some_and(|run| run.header == named.column.header);
    let mut left: Vec<(Named, Why)> = Vec::new();
    let mut rest: Vec<&Named> = Vec::new();
    let keys: HashSet<&str> = numeric.iter().map(|named| named.key.as_str()).collect();
    let mut own_run = words::is_run(&time.group).then_some(time.group.as_str());
    for named in numeric.iter().copied() {
        if named.column.header == time.column.header || is_run(named) {
            continue;
        }
        let group = named.group.as_str();
        let of_run = words::is_run(group);
        let other = of_run && own_run.is_some_and(|own| own != group);
        if of_run && own_run.is_none() {
            own_run = Some(group);
        }
        let error = words::error_of(named).filter(|of| {
            // `sigma` alone, or `delta 1`, may be a quantity by itself.
            let greek = ["sigma", "delta", "δ", "Δ"].iter().any(|g| named.key.starts_with(g));
            !greek || of.is_empty() || keys.iter().any(|key| key == of)
        });
        if other {
            left.push((named.clone(), Why::OtherRun));
        } else if let Some(of) = error {
            left.push((named.clone(), Why::Error(of)));
        } else if let Some(of) = small_part(named, &numeric) {
            left.push((named.clone(), Why::Error(of)));
        } else if words::likeness_to_time(named) >= 3 || words::is_count(named) {
            left.push((named.clone(), Why::Time));
        } else {
            rest.push(named);
        }
    }
    let pairs = paired(&rest);
    let momenta = pairs.iter().all(|pair| pair.2 == Partner::Momentum);
    let role = match (pairs.is_empty(), momenta) {
        (true, _) => Partner::Nothing,
        (_, true) => Partner::Momentum,
        _ => Partner::Velocity,
    };
    let mut guessed = false;
    let mut pairs: Vec<(Named, Option<Named>)> =
        pairs.into_iter().map(|pair| (pair.0.clone(), Some(pair.1.clone()))).collect();
    let mut rate = None;
    if pairs.is_empty() {
        let mut columns = alone(&rest);
        if columns.is_empty() {
            rate = rates::strongest(&rest, table);
        }
        if columns.is_empty() && rate.is_none() {
            guessed = rest.len() > 1;
            let moves = rest.iter().find(|named| words::drives(named).is_none());
            columns.extend(moves.or(rest.first()).copied());
        }
        pairs = columns.into_iter().map(|column| (column.clone(), None)).collect();
        if let [(q, v)] = pairs.as_mut_slice() {
            *v = rate_by_unit(q, &rest).cloned();
        }
    }
    let role = if pairs.iter().any(|pair| pair.1.is_some()) && role == Partner::Nothing {
        Partner::Velocity
    } else {
        role
    };
    if pairs.is_empty() && rate.is_none() {
        return nothing(
            format!(
                "there is no column of numbers beside the time; there are {}",
                data::listed(table)
            ),
            "add a column of what moves, such as `theta` or `x`",
        );
    }
    if pairs.len() > MOST_COORDINATES {
        for (q, v) in pairs.split_off(KEPT) {
            left.extend([Some(q), v].into_iter().flatten().map(|named| (named, Why::TooMany)));
        }
    }
    let mut time = time.clone();
    let mut unit_guessed = false;
    if time.unit.is_none() && time_is != TimeIs::Counted {
        time.unit = unit_of_date(table, time.column).map(str::to_string);
        unit_guessed = time.unit.is_some();
    }
    let counted = table.reading.counted().filter(|_| time.column.name == COUNT);
    let every = counted.and_then(|counted| counted.every.zip(counted.told_by.clone()));
    if every.is_some() {
        time.unit = Some("s".to_string());
    }
    let mut roles = ColumnRoles {
        time,
        every,
        unit_guessed,
        time_is,
        run,
        files: 0,
        pairs,
        role,
        rate,
        guessed,
        inputs: Vec::new(),
        errors: Vec::new(),
        left: Vec::new(),
        wrong: Vec::new(),
    };
    let taken: HashSet<String> = roles.used().map(|named| named.column.header.clone()).collect();
    let gone: HashSet<String> = left.iter().map(|row| row.0.column.header.clone()).collect();
    for named in rest {
        if taken.contains(&named.column.header) || gone.contains(&named.column.header) {
            continue;
        }
        let numbers = table.numbers(named.column);
        let complete = numbers.is_ok_and(|numbers| numbers.iter().all(|x| !x.is_nan()));
        match words::drives(named) {
            Some(ByWhat::Name) if complete && roles.inputs.len() < MOST_INPUTS => {
                roles.inputs.push(named.clone());
            }
            Some(_) => left.push((named.clone(), Why::MayDrive)),
            None => left.push((named.clone(), Why::Unknown)),
        }
    }
    for (named, why) in std::mem::take(&mut left) {
        match &why {
            Why::Error(of) if let Some(column) = measured_with(&roles, table, &named, of) => {
                roles.errors.push((column, named));
            }
            _ => left.push((named, why)),
        }
    }
    let text = text.into_iter().filter(|named| !is_run(named));
    left.extend(text.map(|named| (named.clone(), Why::Text)));
    // In the order of the file.
    let place: HashMap<&str, usize> =
        table.columns.iter().enumerate().map(|(at, c)| (c.header.as_str(), at)).collect();
    left.sort_by_key(|(named, _)| place.get(named.column.header.as_str()).copied());
    roles.left = left;
    // A wrong cell is refused by `check` and by every fit, in these words; the spec stands until
    // then.
    let wrong = roles.used().chain([&roles.time]).chain(&roles.inputs).filter_map(|named| {
        let error = table.numbers(named.column).err()?;
        Some(format!("Before the first fit, put this right: {error}."))
    });
    roles.wrong = wrong.collect();
    Ok(roles)
}

/// The header of the column whose standard errors another holds: the one that its name says, or
/// the one before it. None where it is not used, or where its errors are not to be used: in
/// another kind of unit, as parts of the value are, missing beside a value, or not above zero.
fn measured_with(roles: &ColumnRoles, table: &Table, named: &Named, of: &str) -> Option<String> {
    let before = table.columns.array_windows::<2>();
    let before = before.map(|[a, b]| (a, b)).find(|row| row.1.header == named.column.header);
    let is_meant = |other: &&Named| match of {
        "" => before.is_some_and(|row| row.0.header == other.column.header),
        of => other.is_called(of),
    };
    let used = roles.used().find(is_meant)?;
    if roles.errors.iter().any(|(taken, _)| *taken == used.column.header) || is_relative(named) {
        return None;
    }
    let unit = |named: &Named| named.unit.as_deref().and_then(|unit| Unit::parse(unit).ok());
    let of_one_kind = match (unit(used), unit(named)) {
        (Some(value), Some(error)) => value.same_kind(error),
        (None, Some(_)) => false,
        (_, None) => true,
    };
    let values = table.numbers(used.column).ok()?;
    let errors = table.numbers(named.column).ok()?;
    let sound = values.iter().zip(&errors).all(|(value, error)| value.is_nan() || *error > 0.0);
    (of_one_kind && sound).then(|| used.column.header.clone())
}

/// Whether a column holds parts of a value rather than a quantity in a unit of its own.
fn is_relative(named: &Named) -> bool {
    let header = &named.column.header;
    header.contains('%') || words::words(header).iter().any(|word| word.starts_with("rel"))
}

/// The unit of a time whose numbers are as large as dates are: days since 1900, as sheets count
/// them, or seconds, milliseconds and so on since 1970.
fn unit_of_date(table: &Table, column: &Column) -> Option<&'static str> {
    let numbers = table.numbers(column).ok()?;
    let first = *numbers.iter().find(|x| !x.is_nan())?;
    let last = *numbers.iter().rev().find(|x| !x.is_nan())?;
    // From 2000 to 2064.
    let since_1970 = |unit: f64| (9.4e8..3.0e9).contains(&(first * unit));
    match () {
        () if (36_526.0..60_000.0).contains(&first) && (last - first).abs() < 2.0 => Some("day"),
        () if since_1970(1.0) => Some("s"),
        () if since_1970(1e-3) => Some("ms"),
        () if since_1970(1e-6) => Some("us"),
        () if since_1970(1e-9) => Some("ns"),
        () => None,
    }
}

/// The only column whose unit is that of a velocity of the coordinate.
fn rate_by_unit<'n, 'a>(q: &Named, columns: &[&'n Named<'a>]) -> Option<&'n Named<'a>> {
    let fits = |named: &&&Named| {
        let known = q.unit.is_some() && named.unit.as_deref().is_some_and(|unit| unit != "1");
        known && named.column.header != q.column.header && agree(q, named, Partner::Velocity)
    };
    let mut found = columns.iter().filter(fits);
    let first = found.next()?;
    found.next().is_none().then_some(*first)
}

/// The name of the column whose errors another holds by its name: `u_x` or `s_x` beside `x`, and
/// `dx` where it has the unit of `x`, which no velocity has.
fn small_part(named: &Named, all: &[&Named]) -> Option<String> {
    let of = |prefix: &str| {
        let rest = named.key.strip_prefix(prefix)?;
        let same =
            |other: &&&Named| other.key == rest && other.column.header != named.column.header;
        all.iter().find(same).copied()
    };
    let by_name = ["u_", "s_", "delta_"].into_iter().find_map(of);
    let by_unit = of("d").filter(|other| named.unit.is_some() && other.unit == named.unit);
    by_name.or(by_unit).map(|other| other.name.clone())
}

/// Inputs that a first spec has, at most.
const MOST_INPUTS: usize = 3;

/// The column that tells runs apart: one of the usual names, in which cells stand more than once.
fn run_column<'a>(table: &'a Table, all: &[Named<'a>], time: &Named) -> Option<&'a Column> {
    if let Some(own) = table.reading.runs() {
        return table.columns.iter().find(|column| column.header == own);
    }
    let named = |named: &&Named| {
        let words = named.name.to_lowercase();
        let first = words.split([' ', '_', '#']).next().unwrap_or_default();
        RUN_NAMES.contains(&words.as_str()) || RUN_NAMES.contains(&first) && named.unit.is_none()
    };
    let several = |named: &&Named| {
        let distinct: HashSet<_> = named.column.cells.iter().collect();
        distinct.len() < table.rows()
    };
    let own = |named: &&Named| named.column.header != time.column.header;
    all.iter().filter(own).filter(named).find(several).map(|named| named.column)
}

/// Columns that are coordinates by themselves, by their names, else by their units.
fn alone<'n, 'a>(columns: &[&'n Named<'a>]) -> Vec<&'n Named<'a>> {
    let moves: Vec<&Named> =
        columns.iter().copied().filter(|named| words::drives(named).is_none()).collect();
    let named =
        |named: &&&Named| named.parts().iter().any(|(stem, _)| ALONE.contains(&stem.as_str()));
    let by_unit = |named: &&&Named| {
        named.unit.as_deref().is_some_and(|unit| {
            let like = |other: &str| {
                let (unit, other) = (Unit::parse(unit), Unit::parse(other));
                unit.is_ok_and(|unit| other.is_ok_and(|other| unit.same_kind(other)))
            };
            like("m") || like("px") || (like("rad") && unit != "1" && unit != "%")
        })
    };
    let by_name: Vec<&Named> = moves.iter().filter(named).copied().collect();
    if by_name.is_empty() { moves.iter().filter(by_unit).copied().collect() } else { by_name }
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
    fn new(columns: &[&Named]) -> Self {
        let mut index = ColumnIndex::default();
        for (at, column) in columns.iter().enumerate() {
            index.whole.entry(column.whole()).or_default().insert(at);
            for parts in column.parts() {
                index.parted.entry(parts).or_default().insert(at);
            }
        }
        index
    }

    /// Takes a column out, once it has its place.
    fn remove(&mut self, at: usize, column: &Named) {
        if let Some(positions) = self.whole.get_mut(&column.whole()) {
            positions.remove(&at);
        }
        for parts in column.parts() {
            if let Some(positions) = self.parted.get_mut(&parts) {
                positions.remove(&at);
            }
        }
    }

    /// The first column that goes with the coordinate at `own`, and what it is.
    fn partner(
        &self,
        own: usize,
        coordinate: &Named,
        columns: &[&Named],
    ) -> Option<(usize, Partner)> {
        let fits = |at: usize, partner: Partner| {
            at != own && columns.get(at).is_some_and(|other| agree(coordinate, other, partner))
        };
        let first = |positions: Option<&BTreeSet<usize>>, partner: Partner| {
            positions.and_then(|positions| positions.iter().copied().find(|&at| fits(at, partner)))
        };
        let mut best: Option<(usize, Partner)> = None;
        for (stem, index) in coordinate.parts() {
            for (coordinates, others, partner) in PARTNERS {
                let key = |stem: String| (stem, index.clone());
                let at = if *coordinates == "*" {
                    let whole =
                        format!("{}@{}", others.replace('*', &coordinate.key), coordinate.group);
                    let by_name = first(self.whole.get(&whole), *partner);
                    let by_stem = self.parted.get(&key(others.replace('*', &stem)));
                    by_name.into_iter().chain(first(by_stem, *partner)).min()
                } else if stem == *coordinates {
                    first(self.parted.get(&key((*others).to_string())), *partner)
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
        }
        best
    }
}

/// Coordinates and what goes with them, in the order of the columns. Its time grows in
/// proportion to their number.
fn paired<'n, 'a>(columns: &[&'n Named<'a>]) -> Vec<(&'n Named<'a>, &'n Named<'a>, Partner)> {
    let mut index = ColumnIndex::new(columns);
    let mut taken = vec![false; columns.len()];
    let mut pairs = Vec::new();
    for (own, &coordinate) in columns.iter().enumerate() {
        if taken.get(own) == Some(&true) {
            continue;
        }
        let Some((at, partner)) = index.partner(own, coordinate, columns) else { continue };
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
