//! Text of a user, made harmless for where it stands: one function for each target language and
//! position. Exporters apply them where text is emitted, and nowhere else.
//!
//! Numbers need none of this, and names become identifiers by
//! `identifier` or LaTeX by [`letters::name`](super::letters::name).

use crate::data::is_invisible;

/// One visible line: whatever could end it, or change the order in which it reads, is a space.
///
/// Line separators, control characters, the controls of writing direction and what has no width:
/// compilers take some for the end of a line or refuse them, and people cannot see them.
pub(super) fn line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() || is_invisible(c) { ' ' } else { c }).collect()
}

/// The line with a backslash before every one of `marks`.
fn backslashed(text: &str, marks: &[char]) -> String {
    let mut out = String::with_capacity(text.len());
    for c in line(text).chars() {
        if marks.contains(&c) {
            out.push('\\');
        }
        out.push(c);
    }
    out
}

/// In a doc comment of Rust, which is Markdown: no code block (it would run as a test), no link,
/// no element of HTML.
pub(super) fn rust_doc(text: &str) -> String {
    backslashed(text, &['\\', '`', '[', ']', '<', '>', '~']).trim().to_string()
}

/// As a string literal of Rust, quotes included.
pub(super) fn rust_string(text: &str) -> String {
    format!("\"{}\"", backslashed(text, &['"', '\\']))
}

/// In a comment of C, which it can neither end nor open anew.
pub(super) fn c_comment(text: &str) -> String {
    line(text).replace("*/", "* /").replace("/*", "/ *")
}

/// Behind `#` in Python.
pub(super) fn python_comment(text: &str) -> String {
    line(text)
}

/// In a docstring of Python between `"""`.
pub(super) fn python_docstring(text: &str) -> String {
    backslashed(text, &['"', '\\'])
}

/// As a string literal of Python, quotes included.
pub(super) fn python_string(text: &str) -> String {
    format!("\"{}\"", backslashed(text, &['"', '\\']))
}

/// In the text of a LaTeX document, outside of mathematics: what LaTeX would take as a command is
/// escaped. Letters beyond ASCII stay, for the document to say which of them it knows.
pub fn latex(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let text = line(text);
    // Behind the end of a row, or an item, these would be an argument.
    if text.trim_start().starts_with(['[', '*']) {
        out.push_str("{}");
    }
    for c in text.chars() {
        match c {
            '\\' => out.push_str(r"\textbackslash{}"),
            '~' => out.push_str(r"\textasciitilde{}"),
            '^' => out.push_str(r"\textasciicircum{}"),
            '<' => out.push_str(r"\textless{}"),
            '>' => out.push_str(r"\textgreater{}"),
            '|' => out.push_str(r"\textbar{}"),
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => {
                out.push('\\');
                out.push(c);
            }
            c => out.push(c),
        }
    }
    out
}

/// As [`latex`], for documents that plain LaTeX compiles: letters beyond those of Western Europe
/// are question marks.
pub(super) fn plain_latex(text: &str) -> String {
    let known = |c: char| if c.is_ascii() || ('\u{a1}'..='\u{ff}').contains(&c) { c } else { '?' };
    latex(&line(text).chars().map(known).collect::<String>())
}

/// A template with its places filled in one pass: what is put in is not searched for places.
///
/// A place is `@` and a word of small letters and underscores; one without a text stays.
pub(super) fn fill(template: &str, texts: &[(&str, &str)]) -> String {
    let mut out = String::with_capacity(template.len());
    let mut pieces = template.split('@');
    out.push_str(pieces.next().unwrap_or(""));
    for piece in pieces {
        let length = piece.find(|c: char| c != '_' && !c.is_ascii_lowercase());
        let (name, rest) = piece.split_at(length.unwrap_or(piece.len()));
        match texts.iter().find(|(place, _)| *place == name) {
            Some((_, text)) => out.push_str(text),
            None => {
                out.push('@');
                out.push_str(name);
            }
        }
        out.push_str(rest);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn text_cannot_give_commands() {
        assert_eq!(latex(r"50% of \a_{b}"), r"50\% of \textbackslash{}a\_\{b\}");
        assert_eq!(latex("[2cm] a [b]"), "{}[2cm] a [b]");
        assert_eq!(latex("a\nb\u{2028}c\u{202e}d"), "a b c d");
    }

    #[test]
    fn literals_cannot_be_left() {
        assert_eq!(rust_string("a\"\\\nb"), "\"a\\\"\\\\ b\"");
        assert_eq!(python_string("\"\"\"\\"), "\"\\\"\\\"\\\"\\\\\"");
    }

    #[test]
    fn doc_comments_hold_no_code() {
        assert_eq!(rust_doc("    ```\nfn main() {}"), "\\`\\`\\` fn main() {}");
        assert_eq!(rust_doc("q[1] <script>"), "q\\[1\\] \\<script\\>");
    }

    #[test]
    fn places_are_filled_once() {
        let texts = [("a", "@b"), ("b", "x"), ("a_b", "y")];
        assert_eq!(fill("@a @b @a_b @c a@", &texts), "@b x y @c a@");
    }

    proptest! {
        #[test]
        fn every_text_stays_where_it_stands(text in "[\\PC\n\r\t*/\\\\\"]{0,20}") {
            let comment = c_comment(&text);
            prop_assert!(!comment.contains("*/") && !comment.contains("/*"), "{}", comment);
            for one in [rust_doc(&text), comment, python_comment(&text), latex(&text)] {
                prop_assert!(!one.chars().any(|c| c.is_control() || is_invisible(c)), "{:?}", one);
            }
            for literal in [rust_string(&text), python_string(&text)] {
                // The first quote that no backslash stands before is the last character.
                let inside = &literal[1..];
                let mut escaped = false;
                let end = inside.char_indices().find(|&(_, c)| {
                    let ends = c == '"' && !escaped;
                    escaped = c == '\\' && !escaped;
                    ends
                });
                prop_assert_eq!(end.map(|(at, _)| at + 1), Some(inside.len()), "{}", literal);
            }
        }
    }
}
