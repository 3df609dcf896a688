//! Where in a table of cells its header, its units and its rows stand.
//!
//! Instruments write what they please above their numbers: who measured when, with which settings,
//! names of bodies above those of columns, units below them; and sums below. What is sought is the
//! first long block of rows that look alike; the header is what stands right above it.

use csv::StringRecord;

use super::cell::{Cell, parse_cell};
use super::mapping::TIME_NAMES;
use super::moment::{Order, moment};
use super::unit_words::known_unit;

/// What a cell is, as far as the layout goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Number,
    Missing,
    Text,
}

fn kind(cell: &str) -> Kind {
    match parse_cell(cell, true) {
        Cell::Number(_) | Cell::Infinite | Cell::TooLarge => Kind::Number,
        Cell::Missing => Kind::Missing,
        Cell::Text if moment(cell, Order::DayFirst).is_some() => Kind::Number,
        Cell::Text if moment(cell, Order::MonthFirst).is_some() => Kind::Number,
        Cell::Text => Kind::Text,
    }
}

/// Whether a cell is neither a number, nor a time, nor missing.
pub(super) fn is_text(cell: &str) -> bool {
    kind(cell) == Kind::Text
}

/// How many cells a row has up to its last that is not empty.
pub(super) fn filled(row: &StringRecord) -> usize {
    let last = row.iter().enumerate().filter(|(_, cell)| !cell.is_empty()).last();
    last.map_or(0, |(at, _)| at + 1)
}

/// Places of rows in a table.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Layout {
    /// The row of names; none where numbers begin at once.
    pub header: Option<usize>,
    /// A row of names that several columns share, above the header.
    pub above: Option<usize>,
    /// A row of units below the header.
    pub units: Option<usize>,
    /// The first row of measurements.
    pub first: usize,
    /// How many columns the rows have.
    pub width: usize,
    /// Whether the first column holds numbers.
    pub counts: bool,
    /// How well the rows are divided: how many there are, and how much of them is numbers.
    pub fit: f64,
}

/// What a row of measurements looks like: its width, and where it has text.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Pattern(Vec<Kind>);

impl Pattern {
    fn of(row: &StringRecord) -> Pattern {
        Pattern(row.iter().take(filled(row)).map(kind).collect())
    }

    fn count(&self, what: Kind) -> usize {
        self.0.iter().filter(|kind| **kind == what).count()
    }

    /// Whether it may be a row of measurements.
    fn measures(&self) -> bool {
        let numbers = self.count(Kind::Number);
        numbers > 0 && numbers >= self.count(Kind::Text)
    }

    /// Whether two rows are of one table; what is missing may be anything.
    fn agrees(&self, other: &Pattern) -> bool {
        let (a, b) = (&self.0, &other.0);
        let shared = a.len().min(b.len());
        // Cells that are empty at the end are not there in every format.
        let near = a.len().abs_diff(b.len()) <= a.len().max(b.len()) / 2;
        let alike = |(a, b): (&Kind, &Kind)| a == b || [*a, *b].contains(&Kind::Missing);
        near && shared > 0 && a.iter().zip(b).all(alike)
    }
}

/// Whether a row may be one of measurements.
pub(super) fn measures(row: &StringRecord) -> bool {
    Pattern::of(row).measures()
}

/// Whether the first row is the header of the rows that begin right below it, as in most files.
pub(super) fn is_plain(rows: &[StringRecord]) -> bool {
    let [first, second, rest @ ..] = rows else { return false };
    let (head, row) = (Pattern::of(first), Pattern::of(second));
    // Settings above a header begin with words where rows begin with numbers. So may rows, by the
    // names of runs.
    let begins = |row: &StringRecord| row.iter().next().map(kind);
    let alike = |other: &&StringRecord| {
        let (a, b) = (begins(other), begins(second));
        a == b || [a, b].contains(&Some(Kind::Missing))
    };
    let alike = rest.iter().filter(alike).count();
    head.count(Kind::Number) == 0
        && head.count(Kind::Text) > 0
        && row.measures()
        && filled(first) == filled(second)
        && (2 * alike >= rest.len() || names_a_time(first))
}

/// Finds the layout of the first rows of a table.
pub(super) fn find(rows: &[StringRecord]) -> Option<Layout> {
    let patterns: Vec<Pattern> = rows.iter().map(Pattern::of).collect();
    // The longest block of rows that agree with its first; of two as long the first.
    let mut best: Option<(usize, usize)> = None;
    let mut at = 0;
    while let Some(pattern) = patterns.get(at) {
        let rest = patterns.get(at..).unwrap_or_default();
        let width = |other: &&Pattern| other.0.len() == pattern.0.len();
        let length = if pattern.measures() {
            rest.iter().take_while(|other| other.measures() && pattern.agrees(other)).count()
        } else {
            0
        };
        let same = rest.iter().take(length).filter(width).count();
        // A table of one column is what metadata look like, too.
        let weight = same * pattern.count(Kind::Number).min(8);
        if length > 0 && best.is_none_or(|(_, most)| weight > most) {
            best = Some((at, weight));
        }
        at += length.max(1);
    }
    let (mut first, weight) = best?;
    let block = patterns.get(first)?;
    // Blocks that agree with it, but for a wrong cell between them, begin the table.
    for (at, pattern) in patterns.iter().enumerate().take(first) {
        let pair = patterns.get(at + 1).is_none_or(|next| next.measures() && next.agrees(block));
        if pattern.measures() && pattern.agrees(block) && (pair || at + 2 >= first) {
            first = at;
            break;
        }
    }
    // A row with a wrong cell is a row, too.
    let begins = |at: usize| patterns.get(at).and_then(|pattern| pattern.0.first().copied());
    let wide = |at: usize| patterns.get(at).map(|pattern| pattern.0.len());
    while let Some(above) = first.checked_sub(1)
        && begins(above) == Some(Kind::Number)
        && begins(first) == Some(Kind::Number)
        && wide(above) == wide(first)
    {
        first = above;
    }
    let width = patterns.iter().skip(first).filter(|p| p.measures()).map(|p| p.0.len()).max()?;
    let numbers: usize = patterns.iter().skip(first).map(|p| p.count(Kind::Number)).sum();
    let texts: usize = patterns.iter().skip(first).map(|p| p.count(Kind::Text)).sum();
    let part = numbers as f64 / (numbers + texts).max(1) as f64;
    let mut layout = Layout {
        header: None,
        above: None,
        units: None,
        first,
        width,
        counts: block.0.first() == Some(&Kind::Number),
        fit: if width > 1 { weight as f64 * part } else { 0.0 },
    };
    layout.find_header(rows, &patterns);
    Some(layout)
}

impl Layout {
    fn find_header(&mut self, rows: &[StringRecord], patterns: &[Pattern]) {
        // From below: rows of lines are no names.
        let drawn = |row: &StringRecord| {
            row.iter().all(|cell| !cell.contains(|c: char| c.is_alphanumeric() || c == '°'))
                && row.iter().any(|cell| cell.len() > 2)
        };
        let mut above = (0..self.first).rev().filter(|at| rows.get(*at).is_some_and(|r| !drawn(r)));
        let Some(mut header) = above.next() else { return };
        let row = |at: usize| rows.get(at);
        let count = |at: usize| row(at).map_or(0, filled);
        let is_names = |at: usize| {
            let kinds = patterns.get(at).map_or(&[][..], |pattern| &pattern.0);
            kinds.iter().find(|kind| **kind != Kind::Missing) == Some(&Kind::Text)
        };
        // Rows as wide as the table that follow each other: names, units, how they were processed.
        let block: Vec<usize> = [header]
            .into_iter()
            .chain(above.clone())
            .take(4)
            .take_while(|at| is_names(*at) && (count(*at) == self.width || *at == header))
            .collect();
        let names_time = |at: &usize| row(*at).is_some_and(names_a_time);
        let named = block.iter().copied().find(names_time);
        if let Some(named) = named.filter(|named| *named != header) {
            // Units may be written for some of the columns only.
            let between = (named + 1..=header).filter(|at| row(*at).is_some_and(has_units));
            self.units = between.max();
            header = named;
        } else if let Some(names) = above.clone().next()
            && row(header).is_some_and(are_units)
            && is_names(names)
            && count(names) >= count(header)
            && count(names) <= self.width.max(count(header)) + 1
        {
            self.units = Some(header);
            header = names;
        }
        let next = above.find(|at| *at < header);
        // A sentence above a table of several columns names none of them.
        if self.width > 1
            && count(header) == 1
            && row(header).is_none_or(|names| names.len() < self.width)
            || !is_names(header)
        {
            self.units = None;
            return;
        }
        self.header = Some(header);
        self.above = next.filter(|at| is_names(*at) && count(*at) <= self.width);
    }
}

/// Whether a cell of a row is called as times usually are.
fn names_a_time(row: &StringRecord) -> bool {
    let is_time = |cell: &str| {
        let lower = cell.to_lowercase();
        let first = lower.split(|c: char| !c.is_alphanumeric()).find(|word| !word.is_empty());
        first.is_some_and(|word| TIME_NAMES.contains(&word))
    };
    row.iter().any(is_time)
}

/// Whether at least half of the cells of a row that are not empty are units.
fn has_units(row: &StringRecord) -> bool {
    let cells = || row.iter().filter(|cell| !cell.is_empty());
    let units =
        cells().filter(|cell| known_unit(cell.trim_matches(['[', ']', '(', ')'])).is_some());
    2 * units.count() >= cells().count()
}

/// Whether a row has units for cells: at least one, and nothing else.
pub(super) fn are_units(row: &StringRecord) -> bool {
    let inside = |cell: &str| {
        let cell = cell.trim();
        let open = cell.strip_prefix(['[', '(', '{', '<']);
        known_unit(open.and_then(|rest| rest.strip_suffix([']', ')', '}', '>'])).unwrap_or(cell))
    };
    row.iter().any(|cell| !cell.is_empty() && inside(cell).is_some_and(|unit| unit != "1"))
        && row.iter().all(|cell| cell.is_empty() || inside(cell).is_some())
}

/// Names of columns under names that several of them share: a name stands twice only if the shared
/// ones do not tell it apart.
pub(super) fn joined(header: &StringRecord, above: &StringRecord) -> StringRecord {
    let twice = |name: &str| header.iter().filter(|other| *other == name).count() > 1;
    let mut shared = "";
    let mut out = StringRecord::new();
    for (at, name) in header.iter().enumerate() {
        // A merged cell has its name in the first of its columns.
        shared = above.get(at).filter(|name| !name.is_empty()).unwrap_or(shared);
        if !name.is_empty() && twice(name) && !shared.is_empty() {
            out.push_field(&format!("{shared}: {name}"));
        } else {
            out.push_field(name);
        }
    }
    out
}

/// Rows at the end that are no measurements, such as means under a table: how many there are, of a
/// table whose first column holds numbers.
pub(super) fn footer<'a>(
    rows: impl DoubleEndedIterator<Item = &'a str>,
    cells: impl Fn(&str) -> StringRecord,
) -> usize {
    let said = |row: &&str| {
        let row = cells(row);
        let first = row.get(0).unwrap_or_default();
        let word = first.starts_with(|c: char| c.is_alphabetic()) && kind(first) == Kind::Text;
        word || first.is_empty() && row.iter().any(|cell| kind(cell) == Kind::Text)
    };
    rows.rev().take_while(said).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(text: &str) -> Vec<StringRecord> {
        text.lines().map(|line| line.split(',').collect()).collect()
    }

    #[test]
    fn the_header_stands_right_above_the_rows() {
        let table = [
            ("t,x\n0,1\n1,2\n", Some(0), None, 1),
            ("t,x\ns,m\n0,1\n1,2\n", Some(0), Some(1), 2),
            ("Mass,0.25\nLength,1.5\nt,x\n0,1\n1,2\n2,3\n", Some(2), None, 3),
            ("Run 1,\nt,x\n0,1\n1,2\n", Some(1), None, 2),
            ("measured in May\nt,x\n-----,-----\n0,1\n1,2\n", Some(1), None, 3),
            ("0,1\n1,2\n", None, None, 0),
            ("run,t,x\na,0,1\na,1,2\n", Some(0), None, 1),
            ("t,x\n0,1\n1,1.2*\n2,2\n3,3\n4,4\n", Some(0), None, 1),
        ];
        for (text, header, units, first) in table {
            let layout = find(&rows(text)).unwrap();
            assert_eq!(
                (layout.header, layout.units, layout.first),
                (header, units, first),
                "{text}"
            );
        }
        assert_eq!(find(&rows("t,x\n")), None);
    }

    #[test]
    fn runs_may_be_called_by_words_and_by_numbers() {
        assert!(is_plain(&rows("run,t,x\na,0,1\na,1,2\n01,0,1\n01,1,2\n01,2,3\n")));
        assert!(!is_plain(&rows("Rig,A\nMass,0.25\nt,x\n0,1\n1,2\n2,3\n3,4\n")));
    }

    #[test]
    fn shared_names_tell_columns_apart() {
        let [above, header] = ["A,,B,", "t,x,t,x"].map(|line| line.split(',').collect());
        let joined = joined(&header, &above);
        assert_eq!(joined.iter().collect::<Vec<_>>(), ["A: t", "A: x", "B: t", "B: x"]);
    }
}
