//! From text to words, numbers and marks, grouped into statements.

use nom::branch::alt;
use nom::bytes::complete::{tag, take_while, take_while1};
use nom::character::complete::{anychar, digit1, one_of};
use nom::combinator::{opt, peek, recognize};
use nom::{IResult, Parser};

use super::Tokens;
use crate::diagnostic::{Diagnostic, Span};

/// How many brackets may stand inside each other.
pub(super) const DEEPEST: usize = 100;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum TokenKind {
    Word,
    Number(f64),
    /// A quoted text; the token's text is what stands between the quotes.
    Text,
    Mark,
    Newline,
}

/// The smallest piece of text that means something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Token<'a> {
    pub kind: TokenKind,
    pub text: &'a str,
    pub span: Span,
    /// Whether white space stands before it: `q[1]` is an index, `9.81 [m]` a unit.
    pub spaced: bool,
}

/// Marks of more than one character; longer ones first.
const MARKS: [&str; 8] = ["..", "+=", "<=", ">=", "==", "!=", "**", "->"];

fn blank(input: &str) -> IResult<&str, &str> {
    let comment = recognize((tag("#"), take_while(|c: char| c != '\n')));
    let space = take_while1(|c: char| c.is_whitespace() && c != '\n');
    let byte_order_mark = tag("\u{feff}");
    recognize(nom::multi::many0_count(alt((comment, space, byte_order_mark)))).parse(input)
}

fn word(input: &str) -> IResult<&str, &str> {
    recognize((
        take_while1(|c: char| c.is_alphabetic() || c == '_'),
        take_while(|c: char| c.is_alphanumeric() || c == '_'),
    ))
    .parse(input)
}

/// `1`, `.5`, `2.5e-3`; the dots of `1..5` are none of it.
fn number(input: &str) -> IResult<&str, &str> {
    let exponent = |input| {
        recognize((one_of("eE"), opt(one_of("+-")), digit1::<&str, nom::error::Error<&str>>))
            .parse(input)
    };
    let fraction = |input| recognize((tag("."), digit1)).parse(input);
    let bare_dot = |input| -> IResult<&str, &str> {
        let (rest, dot) = tag(".").parse(input)?;
        let (rest, _) = peek(nom::combinator::not(tag("."))).parse(rest)?;
        Ok((rest, dot))
    };
    alt((
        recognize((digit1, opt(alt((fraction, bare_dot))), opt(exponent))),
        recognize((fraction, opt(exponent))),
    ))
    .parse(input)
}

fn mark(input: &str) -> IResult<&str, &str> {
    for mark in MARKS {
        if let Some(rest) = input.strip_prefix(mark) {
            return Ok((rest, mark));
        }
    }
    recognize(anychar).parse(input)
}

/// Cuts the whole text into tokens.
pub(super) fn tokens<'a>(source: &'a str, diagnostics: &mut Vec<Diagnostic>) -> Vec<Token<'a>> {
    let mut out = Vec::new();
    let mut rest = source;
    loop {
        let spaced = match blank(rest) {
            Ok((after, skipped)) => {
                rest = after;
                !skipped.is_empty()
            }
            Err(_) => false,
        };
        if rest.is_empty() {
            return out;
        }
        let start = source.len() - rest.len();
        let (kind, text, after) = next(rest, start, diagnostics);
        let span = Span::new(start, source.len() - after.len());
        out.push(Token { kind, text, span, spaced });
        rest = after;
    }
}

fn next<'a>(
    rest: &'a str,
    start: usize,
    diagnostics: &mut Vec<Diagnostic>,
) -> (TokenKind, &'a str, &'a str) {
    if let Some(after) = rest.strip_prefix('\n') {
        return (TokenKind::Newline, "\n", after);
    }
    if let Some(after) = rest.strip_prefix('"') {
        let end = after.find(['"', '\n']).unwrap_or(after.len());
        let (text, tail) = after.split_at(end);
        let Some(tail) = tail.strip_prefix('"') else {
            let span = Span::new(start, start + 1 + end);
            diagnostics.push(
                Diagnostic::error(span, "a text in quotes does not end")
                    .label("it starts here")
                    .hint("close it with `\"` on the same line"),
            );
            return (TokenKind::Text, text, tail);
        };
        return (TokenKind::Text, text, tail);
    }
    if let Ok((after, text)) = number(rest) {
        let value: f64 = text.parse().unwrap_or(f64::NAN);
        if !value.is_finite() {
            let span = Span::new(start, start + text.len());
            diagnostics.push(
                Diagnostic::error(span, "this number is too large")
                    .label("not below 1.8e308")
                    .hint("choose units in which it is smaller"),
            );
            return (TokenKind::Number(1.0), text, after);
        }
        return (TokenKind::Number(value), text, after);
    }
    if let Ok((after, text)) = word(rest) {
        return (TokenKind::Word, text, after);
    }
    match mark(rest) {
        Ok((after, text)) => (TokenKind::Mark, text, after),
        Err(_) => (TokenKind::Mark, rest, ""),
    }
}

/// Statements that begin with a word of their own and go on with a name or a text.
const OPENERS: [&str; 14] = [
    "system",
    "coordinates",
    "momenta",
    "velocities",
    "hidden",
    "state",
    "data",
    "constant",
    "let",
    "param",
    "force",
    "sensor",
    "effect",
    "constrain",
];

/// Statements that stand in the braces of `candidates`, on lines of their own.
const ADDITIONS: [&str; 8] = ["param", "T", "V", "H", "L", "force", "sensor", "constrain"];

/// Whether a statement plainly begins here, whatever bracket is still open.
fn begins_statement(tokens: &[Token]) -> bool {
    let mut ahead = tokens.iter().filter(|token| token.kind != TokenKind::Newline);
    let (Some(first), Some(second)) = (ahead.next(), ahead.next()) else { return false };
    if first.kind != TokenKind::Word {
        return false;
    }
    if OPENERS.contains(&first.text) {
        return matches!(second.kind, TokenKind::Word | TokenKind::Text);
    }
    ["T", "V", "H", "L"].contains(&first.text) && ["=", "+="].contains(&second.text)
}

/// Marks after which a line goes on.
const CONTINUED: [&str; 9] = ["+", "-", "*", "/", "^", "=", "+=", ",", ":"];

/// Groups tokens into statements: they end at a `;` or a line end outside every bracket.
///
/// A statement whose brackets do not match is reported and left out, and so is one
/// that nests too deeply.
pub(super) fn statements<'a>(
    tokens: &[Token<'a>],
    lost: &mut Vec<String>,
    diagnostics: &mut Vec<Diagnostic>,
) -> Vec<Vec<Token<'a>>> {
    let mut out = Vec::new();
    let mut current: Vec<Token> = Vec::new();
    let mut open: Vec<Token> = Vec::new();
    let mut depth_reported = false;
    let mut sound = true;
    let mut finish = |current: &mut Vec<Token<'a>>, sound: &mut bool| {
        let statement = std::mem::take(current);
        let Some(first) = statement.first() else { return };
        if std::mem::replace(sound, true) {
            out.push(statement);
        } else {
            lost.push(first.text.to_string());
        }
    };
    let mut rest = tokens;
    while let Some((&token, after)) = rest.split_first() {
        let here = std::mem::replace(&mut rest, after);
        if token.kind == TokenKind::Newline {
            let unfinished = !open.is_empty()
                || current.last().is_some_and(|last| {
                    last.kind == TokenKind::Mark && CONTINUED.contains(&last.text)
                });
            let among_candidates = open.len() == 1
                && current.first().is_some_and(|first| first.text == "candidates")
                && (here.iter().find(|token| token.kind != TokenKind::Newline))
                    .is_some_and(|next| ADDITIONS.contains(&next.text));
            if unfinished && (among_candidates || !begins_statement(here)) {
                continue;
            }
            if let Some(bracket) = open.first() {
                diagnostics.push(never_closed(bracket));
                sound = false;
                open.clear();
            }
            depth_reported = false;
            finish(&mut current, &mut sound);
            continue;
        }
        if token.kind == TokenKind::Mark {
            match token.text {
                "(" | "[" | "{" => {
                    open.push(token);
                    if open.len() > DEEPEST && !std::mem::replace(&mut depth_reported, true) {
                        diagnostics.push(too_deep(token.span));
                        sound = false;
                    }
                }
                ")" | "]" | "}" => match open.pop() {
                    Some(bracket) if closes(bracket.text, token.text) => {}
                    Some(bracket) => {
                        diagnostics.push(
                            Diagnostic::error(token.span, "brackets do not match")
                                .label(format!(
                                    "`{}` does not close `{}`",
                                    token.text, bracket.text
                                ))
                                .hint("close brackets in the reverse order of opening them")
                                .related(bracket.span, "opened here"),
                        );
                        sound = false;
                    }
                    None => {
                        diagnostics.push(
                            Diagnostic::error(
                                token.span,
                                format!("`{}` closes nothing", token.text),
                            )
                            .label("no bracket is open here")
                            .hint("remove it, or open a bracket before it"),
                        );
                        sound = false;
                    }
                },
                ";" if open.is_empty() => {
                    finish(&mut current, &mut sound);
                    continue;
                }
                _ => {}
            }
        }
        current.push(token);
    }
    if let (Some(bracket), true) = (open.first(), !depth_reported) {
        diagnostics.push(never_closed(bracket));
        sound = false;
    }
    finish(&mut current, &mut sound);
    out
}

fn closes(open: &str, close: &str) -> bool {
    matches!((open, close), ("(", ")") | ("[", "]") | ("{", "}"))
}

fn never_closed(bracket: &Token) -> Diagnostic {
    Diagnostic::error(bracket.span, format!("`{}` is never closed", bracket.text))
        .label("opened here")
        .hint("add the closing bracket before the next statement")
}

/// The diagnostic for what nests deeper than [`DEEPEST`].
pub(super) fn too_deep(span: Span) -> Diagnostic {
    Diagnostic::error(span, format!("this nests more than {DEEPEST} levels deep"))
        .label("one level too many")
        .hint("take parentheses away, or give a part a name with `constant`")
}

impl<'a> Tokens<'a> {
    /// The next token.
    pub(crate) fn first(&self) -> Option<Token<'a>> {
        self.rest.first().copied()
    }

    /// The place of the next token; behind the statement, an empty place at its end.
    pub(crate) fn place(&self) -> Span {
        self.first().map_or(Span::new(self.end, self.end), |token| token.span)
    }
}
