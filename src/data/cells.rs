//! The cells of a column, as text or as numbers.

use std::borrow::Cow;

use super::cell::{Cell, format_number, parse_cell};

/// The cells of a column, kept in one piece: of text, or of numbers where the file has them.
#[derive(Debug, Clone, PartialEq)]
pub struct Cells(Storage);

#[derive(Debug, Clone, PartialEq)]
enum Storage {
    Text {
        text: String,
        ends: Vec<usize>,
    },
    /// NaN where nothing was measured.
    Numbers(Vec<f64>),
    /// Something that is neither: what, and how many.
    Unread(&'static str, usize),
}

impl Default for Cells {
    fn default() -> Self {
        Cells(Storage::Numbers(Vec::new()))
    }
}

impl Cells {
    /// Cells of a kind that cannot be read.
    pub fn unreadable(what: &'static str, count: usize) -> Cells {
        Cells(Storage::Unread(what, count))
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        match &self.0 {
            Storage::Text { ends, .. } => ends.len(),
            Storage::Numbers(numbers) => numbers.len(),
            Storage::Unread(_, count) => *count,
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The cell of a row as text, counted from 0; empty beyond the last.
    pub fn get(&self, row: usize) -> Cow<'_, str> {
        match &self.0 {
            Storage::Text { text, ends } => Cow::Borrowed(piece(text, ends, row)),
            Storage::Numbers(numbers) => {
                numbers.get(row).map_or(Cow::Borrowed(""), |x| Cow::Owned(format_number(*x)))
            }
            Storage::Unread(..) => Cow::Borrowed(""),
        }
    }

    /// What the cell of a row says as a number.
    pub fn number(&self, row: usize, decimal_comma: bool) -> Cell {
        match &self.0 {
            Storage::Text { text, ends } => parse_cell(piece(text, ends, row), decimal_comma),
            Storage::Numbers(numbers) => match numbers.get(row) {
                Some(number) if number.is_finite() => Cell::Number(*number),
                Some(number) if number.is_infinite() => Cell::Infinite,
                _ => Cell::Missing,
            },
            Storage::Unread(..) => Cell::Text,
        }
    }

    /// All cells as text, from the first row to the last.
    pub fn iter(&self) -> impl Iterator<Item = Cow<'_, str>> {
        (0..self.len()).map(|row| self.get(row))
    }

    /// What the cells are, when they are neither text nor numbers.
    pub(super) fn unread(&self) -> Option<&'static str> {
        match self.0 {
            Storage::Unread(what, _) => Some(what),
            _ => None,
        }
    }

    /// The numbers, when the file had numbers.
    pub(super) fn as_numbers(&self) -> Option<&[f64]> {
        match &self.0 {
            Storage::Numbers(numbers) => Some(numbers),
            _ => None,
        }
    }

    pub(super) fn push(&mut self, cell: &str) {
        self.become_text();
        if let Storage::Text { text, ends } = &mut self.0 {
            text.push_str(cell);
            ends.push(text.len());
        }
    }

    pub(super) fn push_number(&mut self, number: f64) {
        match &mut self.0 {
            Storage::Numbers(numbers) => numbers.push(number),
            _ => self.push(&format_number(number)),
        }
    }

    pub(super) fn push_missing(&mut self) {
        self.push_number(f64::NAN);
    }

    /// Appends cells that cannot be read.
    pub(super) fn push_unread(&mut self, what: &'static str, count: usize) {
        self.0 = Storage::Unread(what, self.len() + count);
    }

    pub(super) fn extend_numbers(&mut self, more: impl Iterator<Item = f64>) {
        match &mut self.0 {
            Storage::Numbers(numbers) => numbers.extend(more),
            _ => more.for_each(|number| self.push_number(number)),
        }
    }

    /// Appends the cells of another piece of the same column.
    pub(super) fn append(&mut self, more: Cells) {
        match (&mut self.0, more.0) {
            (Storage::Numbers(mine), Storage::Numbers(others)) => mine.extend(others),
            (_, Storage::Unread(what, count)) => self.push_unread(what, count),
            (_, others) => {
                let others = Cells(others);
                others.iter().for_each(|cell| self.push(&cell));
            }
        }
    }

    fn become_text(&mut self) {
        if !matches!(self.0, Storage::Text { .. }) {
            let (mut text, mut ends) = (String::new(), Vec::with_capacity(self.len()));
            for cell in self.iter() {
                text.push_str(&cell);
                ends.push(text.len());
            }
            self.0 = Storage::Text { text, ends };
        }
    }
}

fn piece<'a>(text: &'a str, ends: &[usize], row: usize) -> &'a str {
    let end = ends.get(row).copied().unwrap_or(text.len());
    let start = match row.checked_sub(1) {
        Some(before) => ends.get(before).copied().unwrap_or(end),
        None => 0,
    };
    text.get(start..end).unwrap_or("")
}

impl From<Vec<f64>> for Cells {
    fn from(numbers: Vec<f64>) -> Self {
        Cells(Storage::Numbers(numbers))
    }
}

impl<T: AsRef<str>> FromIterator<T> for Cells {
    fn from_iter<I: IntoIterator<Item = T>>(cells: I) -> Self {
        let mut out = Cells(Storage::Text { text: String::new(), ends: Vec::new() });
        for cell in cells {
            out.push(cell.as_ref());
        }
        out
    }
}

/// A number of a column; not a number where the column has none.
pub(super) fn entry(column: &[f64], row: usize) -> f64 {
    column.get(row).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_come_back_as_they_were_put_in() {
        let mut cells = Cells::default();
        for cell in ["a", "", "bc"] {
            cells.push(cell);
        }
        assert_eq!(cells.iter().collect::<Vec<_>>(), ["a", "", "bc"]);
        assert_eq!(cells.get(7), "");
    }

    #[test]
    fn numbers_become_text_when_text_comes() {
        let mut cells = Cells::default();
        cells.extend_numbers([1.0, f64::NAN, 0.5].into_iter());
        cells.append(["x"].into_iter().collect());
        assert_eq!(cells.iter().collect::<Vec<_>>(), ["1", "", "0.5", "x"]);
        assert_eq!(cells.number(1, false), Cell::Missing);
        assert_eq!(cells.number(2, false), Cell::Number(0.5));
        assert_eq!(cells.number(3, false), Cell::Text);
    }
}
