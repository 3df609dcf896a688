//! The parser. Its functions are the productions of `grammar/leverrier.ebnf`.
//!
//! Text is cut into tokens, tokens into statements, and each statement is parsed by
//! itself, so that one mistake does not hide the next.

mod expression;
mod statement;
mod token;

use std::iter::{Copied, Enumerate};

use nom::error::{ErrorKind, ParseError};
use nom::{IResult, Input, Needed};

use super::ast::{Statement, SyntaxTree};
use crate::diagnostic::{Diagnostic, Span};
pub use statement::may_name;
use token::{Token, TokenKind};

/// What is left of one statement.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tokens<'a> {
    rest: &'a [Token<'a>],
    source: &'a str,
    /// Where the statement ends in the text.
    end: usize,
    /// Where the last token taken ends.
    taken: usize,
    /// How many productions stand inside each other.
    depth: usize,
}

/// Why a production does not match: what was expected at the furthest place reached.
#[derive(Debug, Clone)]
pub(super) struct Fault {
    at: Span,
    expected: Vec<String>,
    /// A message that says more than what was expected.
    diagnostic: Option<Box<Diagnostic>>,
}

type Parsed<'a, T> = IResult<Tokens<'a>, T, Fault>;

impl<'a> Input for Tokens<'a> {
    type Item = Token<'a>;
    type Iter = Copied<std::slice::Iter<'a, Token<'a>>>;
    type IterIndices = Enumerate<Self::Iter>;

    fn input_len(&self) -> usize {
        self.rest.len()
    }

    fn take(&self, index: usize) -> Self {
        Tokens { rest: self.rest.get(..index).unwrap_or(self.rest), ..*self }
    }

    fn take_from(&self, index: usize) -> Self {
        let last = index.checked_sub(1).and_then(|last| self.rest.get(last));
        let taken = last.map_or(self.taken, |last| last.span.end);
        Tokens { rest: self.rest.get(index..).unwrap_or_default(), taken, ..*self }
    }

    fn take_split(&self, index: usize) -> (Self, Self) {
        (self.take_from(index), self.take(index))
    }

    fn position<P: Fn(Self::Item) -> bool>(&self, predicate: P) -> Option<usize> {
        self.rest.iter().position(|&token| predicate(token))
    }

    fn iter_elements(&self) -> Self::Iter {
        self.rest.iter().copied()
    }

    fn iter_indices(&self) -> Self::IterIndices {
        self.iter_elements().enumerate()
    }

    fn slice_index(&self, count: usize) -> Result<usize, Needed> {
        match self.rest.len() {
            enough if enough >= count => Ok(count),
            short => Err(Needed::new(count - short)),
        }
    }
}

impl<'a> ParseError<Tokens<'a>> for Fault {
    fn from_error_kind(input: Tokens<'a>, _: ErrorKind) -> Self {
        Fault { at: input.place(), expected: Vec::new(), diagnostic: None }
    }

    fn append(_: Tokens<'a>, _: ErrorKind, other: Self) -> Self {
        other
    }

    fn or(mut self, other: Self) -> Self {
        match self.at.start.cmp(&other.at.start) {
            std::cmp::Ordering::Less => other,
            std::cmp::Ordering::Greater => self,
            std::cmp::Ordering::Equal => {
                self.expected.extend(other.expected);
                self.diagnostic = self.diagnostic.or(other.diagnostic);
                self
            }
        }
    }
}

impl Fault {
    fn expected(input: Tokens, what: impl Into<String>) -> nom::Err<Fault> {
        nom::Err::Error(Fault { at: input.place(), expected: vec![what.into()], diagnostic: None })
    }

    fn fatal(diagnostic: Diagnostic) -> nom::Err<Fault> {
        nom::Err::Failure(Fault {
            at: diagnostic.span,
            expected: Vec::new(),
            diagnostic: Some(Box::new(diagnostic)),
        })
    }

    fn into_diagnostic(mut self, found: Option<Token>) -> Diagnostic {
        if let Some(diagnostic) = self.diagnostic {
            return *diagnostic;
        }
        self.expected.sort_unstable();
        self.expected.dedup();
        let wanted = match self.expected.as_slice() {
            [] => "something else".to_string(),
            [one] => one.clone(),
            [most @ .., last] => format!("{} or {last}", most.join(", ")),
        };
        let found_text = match found {
            None => "the end of the statement".to_string(),
            Some(token) if token.kind == TokenKind::Text => format!("\"{}\"", token.text),
            Some(token) => format!("`{}`", token.text),
        };
        let diagnostic = Diagnostic::error(self.at, format!("expected {wanted}"))
            .label(format!("found {found_text}"));
        match found.map(|token| token.text) {
            Some("**") => diagnostic.hint("a power is written `x^2`"),
            Some("[") => diagnostic.hint("an index follows its name without a space: `q[1]`"),
            Some("=") => diagnostic.hint("compare with `==`; one statement defines one thing"),
            Some("per") => diagnostic.hint("`per` stands behind the name: `param k per run = 1`"),
            _ => diagnostic,
        }
    }
}

/// spec = { statement , separator } ;
///
/// What could be read, and everything that is wrong with the rest.
pub fn spec(source: &str) -> (SyntaxTree, Vec<Diagnostic>) {
    let mut diagnostics = Vec::new();
    let tokens = token::tokens(source, &mut diagnostics);
    let mut out = SyntaxTree::default();
    for tokens in token::statements(&tokens, &mut out.lost, &mut diagnostics) {
        let end = tokens.last().map_or(0, |token| token.span.end);
        let start = tokens.first().map_or(0, |token| token.span.start);
        let input = Tokens { rest: &tokens, source, end, taken: start, depth: 0 };
        let fault = match statement::statement(input) {
            Ok((rest, statement)) if rest.rest.is_empty() => {
                out.statements.push(statement);
                continue;
            }
            Ok((rest, _)) => Fault {
                at: rest.place(),
                expected: vec!["the end of the statement".into()],
                diagnostic: None,
            },
            Err(nom::Err::Error(fault) | nom::Err::Failure(fault)) => fault,
            Err(nom::Err::Incomplete(_)) => {
                Fault { at: input.place(), expected: vec!["a statement".into()], diagnostic: None }
            }
        };
        out.lost.extend(tokens.first().map(|token| token.text.to_string()));
        let found = tokens.iter().find(|token| token.span.start >= fault.at.start).copied();
        diagnostics.push(fault.into_diagnostic(found));
    }
    diagnostics.sort_by_key(|diagnostic| diagnostic.span);
    (out, diagnostics)
}

/// The statements of a template, every site of them at one place in the user's text.
///
/// # Errors
/// Where the text is no sequence of statements.
pub(super) fn template(source: &str, span: Span) -> Result<Vec<Statement>, Diagnostic> {
    let mut diagnostics = Vec::new();
    let mut tokens = token::tokens(source, &mut diagnostics);
    tokens.iter_mut().for_each(|token| token.span = span);
    let mut out = Vec::new();
    for tokens in token::statements(&tokens, &mut Vec::new(), &mut diagnostics) {
        // Templates hold no units: nothing is looked up in the text by its place.
        let input =
            Tokens { rest: &tokens, source: "", end: span.end, taken: span.start, depth: 0 };
        match statement::statement(input) {
            Ok((rest, statement)) if rest.rest.is_empty() => out.push(statement),
            Err(nom::Err::Error(fault) | nom::Err::Failure(fault)) => {
                diagnostics.push(fault.into_diagnostic(None));
            }
            _ => diagnostics.push(
                Diagnostic::error(span, "this effect cannot be written for these variables")
                    .label("its statements do not end where they should")
                    .hint("write its terms yourself"),
            ),
        }
    }
    match diagnostics.into_iter().next() {
        Some(diagnostic) => Err(diagnostic),
        None => Ok(out),
    }
}

/// expression, as a whole text of its own.
pub fn expression(source: &str) -> Result<super::ast::Expression, Vec<Diagnostic>> {
    let text = format!("H = {source}");
    let (spec, diagnostics) = spec(&text);
    match spec.statements.into_iter().next().map(|statement| statement.kind) {
        Some(super::ast::StatementKind::Energy { value, .. }) if diagnostics.is_empty() => {
            Ok(value)
        }
        _ => Err(diagnostics),
    }
}
