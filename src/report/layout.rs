//! Tables and paragraphs that fit a terminal.

use comfy_table::{CellAlignment, ContentArrangement, Table, presets};

/// Width of text that goes elsewhere than to a terminal.
pub const WIDTH: usize = 100;

/// A table without borders. The columns listed in `right` hold numbers.
pub fn table(header: &[&str], rows: Vec<Vec<String>>, right: &[usize], width: usize) -> String {
    let mut table = Table::new();
    table
        .load_style(presets::NOTHING)
        .set_content_arrangement(ContentArrangement::Dynamic)
        .set_width(u16::try_from(width).unwrap_or(u16::MAX))
        .force_no_tty()
        .set_header(header.to_vec())
        .add_rows(rows);
    for &at in right {
        if let Some(column) = table.column_mut(at) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table.trim_fmt()
}

/// Breaks text between words; lines after the first are indented by `indent` blanks.
///
/// A sum is broken before a sign, so that no line ends in one. Words that are too long stay
/// whole.
pub fn wrapped(text: &str, width: usize, indent: usize) -> String {
    let mut lines: Vec<String> = Vec::new();
    for paragraph in text.split('\n') {
        let mut line = String::new();
        let mut words = 0;
        let mut pieces = paragraph.split(' ').peekable();
        while let Some(word) = pieces.next() {
            let sign = matches!(word, "+" | "-");
            let mut piece = word.to_string();
            if sign && let Some(next) = pieces.next() {
                piece = format!("{word} {next}");
            }
            let long = line.chars().count() + 1 + piece.chars().count() > width;
            if words > 0 && long {
                lines.push(std::mem::replace(&mut line, " ".repeat(indent)));
                words = 0;
            }
            if words > 0 {
                line.push(' ');
            }
            line.push_str(&piece);
            words += 1;
        }
        lines.push(line);
    }
    lines.join("\n")
}

/// `1 term`, `2 terms`.
pub fn counted(count: usize, noun: &str) -> String {
    if count == 1 { format!("1 {noun}") } else { format!("{count} {noun}s") }
}

/// At most `most` rows, and a row that says how many more there are.
pub fn cut(mut rows: Vec<Vec<String>>, most: usize, columns: usize) -> Vec<Vec<String>> {
    let count = rows.len();
    if count > most + 1 {
        rows.truncate(most);
        let mut rest = vec![String::new(); columns];
        if let Some(first) = rest.get_mut(1) {
            *first = format!("... {} more", count - most);
        }
        rows.push(rest);
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_break_before_their_signs() {
        let text = wrapped("H = aaaa + bbbb - cccc", 13, 4);
        assert_eq!(text, "H = aaaa\n    + bbbb\n    - cccc");
        assert!(
            wrapped("a word_that_is_far_too_long b", 8, 2).contains("word_that_is_far_too_long")
        );
    }
}
