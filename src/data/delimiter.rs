//! What stands between two cells, found from the first lines of a file.

use std::borrow::Cow;

use serde::Serialize;

/// What stands between two cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Delimiter {
    /// `,`
    Comma,
    /// A tab.
    Tab,
    /// `;`, as spreadsheets write where the comma is the decimal sign.
    Semicolon,
    /// `|`
    Bar,
    /// Any run of blanks and tabs.
    Blanks,
}

/// Every delimiter: its character in a line, and its name. The first of two that fit
/// equally well is taken, so a comma with a blank after it is a comma, and a decimal
/// comma between semicolons is no delimiter.
const DELIMITERS: &[(Delimiter, char, &str)] = &[
    (Delimiter::Tab, '\t', "tab"),
    (Delimiter::Semicolon, ';', "semicolon"),
    (Delimiter::Bar, '|', "vertical bar"),
    COMMA,
    (Delimiter::Blanks, '\t', "blanks"),
];

/// What a file of one column is taken to have.
const COMMA: (Delimiter, char, &str) = (Delimiter::Comma, ',', "comma");

/// How many lines are looked at.
const LOOKED_AT: usize = 200;

impl Delimiter {
    /// All of them, those first that are hardest to mistake.
    pub(super) fn all() -> impl Iterator<Item = Delimiter> {
        DELIMITERS.iter().map(|row| row.0)
    }

    /// The name that people know it by.
    pub fn name(self) -> &'static str {
        self.row().2
    }

    /// The character that separates cells in a [`Delimiter::tidy`] line.
    pub(super) fn byte(self) -> u8 {
        u8::try_from(self.row().1).unwrap_or(b',')
    }

    /// The delimiter called so (`,`, `;`, `|`, a tab or a blank): what a line
    /// `sep=;` at the top of a spreadsheet's file says.
    pub(super) fn from_char(character: char) -> Option<Self> {
        DELIMITERS
            .iter()
            .find(|row| row.1 == character)
            .map(|row| row.0)
            .or((character == ' ').then_some(Delimiter::Blanks))
    }

    fn row(self) -> &'static (Delimiter, char, &'static str) {
        DELIMITERS.iter().find(|row| row.0 == self).unwrap_or(&COMMA)
    }

    /// The line with a single character between cells. Blanks inside quotes, inside
    /// brackets and before a bracket (`t [s]`) separate nothing.
    pub(super) fn tidy(self, line: &str) -> Cow<'_, str> {
        if self != Delimiter::Blanks {
            return Cow::Borrowed(line);
        }
        let mut tidy = String::with_capacity(line.len());
        let (mut quoted, mut depth) = (false, 0_usize);
        let mut characters = line.trim().chars().peekable();
        while let Some(character) = characters.next() {
            match character {
                '"' => quoted = !quoted,
                '[' | '(' => depth += 1,
                ']' | ')' => depth = depth.saturating_sub(1),
                _ => {}
            }
            if quoted || depth > 0 || !character.is_whitespace() {
                tidy.push(character);
                continue;
            }
            while characters.next_if(|c| c.is_whitespace()).is_some() {}
            let bracket = matches!(characters.peek(), Some('[' | '('));
            tidy.push(if bracket { ' ' } else { '\t' });
        }
        Cow::Owned(tidy)
    }

    /// How many cells a line has, with and without empty ones at its end.
    fn count(self, line: &str) -> (usize, usize) {
        let line = self.tidy(line);
        let mark = self.row().1;
        let (mut quoted, mut cells, mut filled) = (false, 1, 0);
        for character in line.chars() {
            if character == '"' {
                quoted = !quoted;
            }
            if character == mark && !quoted {
                cells += 1;
            } else if !character.is_whitespace() {
                filled = cells;
            }
        }
        (cells, filled)
    }

    /// The delimiter under which most lines have as many cells as the first.
    /// A file of one column has none; then it is taken to be a comma.
    pub(super) fn sniff(lines: &[&str]) -> Self {
        let Some((header, rows)) = lines.split_first() else {
            return Delimiter::Comma;
        };
        let rows = rows.get(..LOOKED_AT).unwrap_or(rows);
        let mut best = (Delimiter::Comma, None);
        for (delimiter, _, _) in DELIMITERS {
            let (cells, filled) = delimiter.count(header);
            if filled < 2 {
                continue;
            }
            let fits = rows
                .iter()
                .filter(|row| {
                    let (row_cells, row_filled) = delimiter.count(row);
                    row_cells == cells || row_cells == filled || row_filled == filled
                })
                .count();
            if best.1.is_none_or(|most| fits > most) {
                best = (*delimiter, Some(fits));
            }
        }
        best.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_delimiter_is_found() {
        let rows: &[(&[&str], Delimiter)] = &[
            (&["t,x", "0,1"], Delimiter::Comma),
            (&["t, x", "0, 1"], Delimiter::Comma),
            (&["t\tx", "0\t1"], Delimiter::Tab),
            (&["t;x", "0,5;1,5"], Delimiter::Semicolon),
            (&["t\tx", "0,5\t1,5"], Delimiter::Tab),
            (&["t x", "0,5   1,5"], Delimiter::Blanks),
            (&["  t [s]   x [m]", "  0.0     1.0"], Delimiter::Blanks),
            (&["t [s], x [m]", "0,1"], Delimiter::Comma),
            (&["t|x", "0|1"], Delimiter::Bar),
            (&["\"a;b\",t", "1,2"], Delimiter::Comma),
            (&["t,x", "0,1,"], Delimiter::Comma),
            (&["t"], Delimiter::Comma),
            (&[], Delimiter::Comma),
        ];
        for (lines, expected) in rows {
            assert_eq!(Delimiter::sniff(lines), *expected, "{lines:?}");
        }
    }

    #[test]
    fn blanks_become_one_tab() {
        assert_eq!(Delimiter::Blanks.tidy("  t (a b)   \"x y\"  z "), "t (a b)\t\"x y\"\tz");
    }
}
