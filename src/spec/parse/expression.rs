//! Expressions: sums, products, powers, calls, function spaces and their index ranges.

use nom::Parser;
use nom::branch::alt;
use nom::combinator::{cut, opt};
use nom::error::ParseError;
use nom::multi::{many0, separated_list0, separated_list1};
use nom::sequence::{delimited, preceded};

use super::token::{DEEPEST, TokenKind, too_deep};
use super::{Fault, Parsed, Tokens};
use crate::diagnostic::Span;
use crate::spec::ast::*;

/// Words that cannot be names.
pub(super) const RESERVED: [&str; 8] = ["for", "in", "where", "and", "sum", "span", "terms", "of"];

/// A mark: `(`, `+=`, ...
pub(super) fn mark<'a>(text: &'static str) -> impl Fn(Tokens<'a>) -> Parsed<'a, ()> {
    move |input| match input.first() {
        Some(token) if token.kind == TokenKind::Mark && token.text == text => {
            Ok((nom::Input::take_from(&input, 1), ()))
        }
        _ => Err(Fault::expected(input, format!("`{text}`"))),
    }
}

/// A fixed word.
pub(super) fn keyword<'a>(text: &'static str) -> impl Fn(Tokens<'a>) -> Parsed<'a, ()> {
    move |input| match input.first() {
        Some(token) if token.kind == TokenKind::Word && token.text == text => {
            Ok((nom::Input::take_from(&input, 1), ()))
        }
        _ => Err(Fault::expected(input, format!("`{text}`"))),
    }
}

/// name = word ;
pub(super) fn name(input: Tokens) -> Parsed<Word> {
    match input.first() {
        Some(token) if token.kind == TokenKind::Word && !RESERVED.contains(&token.text) => {
            let word = Word { text: token.text.to_string(), site: Site(token.span) };
            Ok((nom::Input::take_from(&input, 1), word))
        }
        _ => Err(Fault::expected(input, "a name")),
    }
}

/// quoted = '"' , text , '"' ;
pub(super) fn quoted(input: Tokens) -> Parsed<Word> {
    match input.first() {
        Some(token) if token.kind == TokenKind::Text => {
            let word = Word { text: token.text.to_string(), site: Site(token.span) };
            Ok((nom::Input::take_from(&input, 1), word))
        }
        _ => Err(Fault::expected(input, "a text in quotes")),
    }
}

/// unit = "[" , text without "]" , "]" ;
pub(super) fn unit(input: Tokens) -> Parsed<UnitText> {
    let (inside, ()) = mark("[")(input)?;
    let Some(length) = inside.rest.iter().position(|token| token.text == "]") else {
        return Err(Fault::expected(inside, "`]`"));
    };
    let (after, inner) = nom::Input::take_split(&inside, length);
    let (rest, ()) = mark("]")(after)?;
    let span = match (inner.rest.first(), inner.rest.last()) {
        (Some(first), Some(last)) => first.span.join(last.span),
        _ => return Err(Fault::expected(inside, "a unit")),
    };
    // Spaces between the pieces are told from products by their meaning, not their number.
    let text = input.source.get(span.range()).unwrap_or_default();
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    Ok((rest, Word { text, site: Site(span) }))
}

/// Runs a production one level deeper, and refuses to go too deep.
fn deeper<'a, T>(
    input: Tokens<'a>,
    production: impl Fn(Tokens<'a>) -> Parsed<'a, T>,
) -> Parsed<'a, T> {
    if input.depth >= 3 * DEEPEST {
        return Err(Fault::fatal(too_deep(input.place())));
    }
    let (rest, value) = production(Tokens { depth: input.depth + 1, ..input })?;
    Ok((Tokens { depth: input.depth, ..rest }, value))
}

/// Where a production began and what it took.
fn from_to(input: Tokens, rest: Tokens) -> Site {
    Site(Span::new(input.place().start, rest.taken))
}

/// expression = term , { ( "+" | "-" ) , term } ;
pub(super) fn expression(input: Tokens) -> Parsed<Expression> {
    deeper(input, |input| {
        let sign = alt((mark("+").map(|()| false), mark("-").map(|()| true)));
        let (rest, first) = term(input)?;
        let (rest, more) = many0((sign, cut(term))).parse(rest)?;
        Ok((rest, chain(from_to(input, rest), first, more, ExpressionKind::Sum)))
    })
}

/// term = factor , { ( "*" | "/" ) , factor } ;
fn term(input: Tokens) -> Parsed<Expression> {
    let sign = alt((mark("*").map(|()| false), mark("/").map(|()| true)));
    let (rest, first) = factor(input)?;
    let (rest, more) = many0((sign, cut(factor))).parse(rest)?;
    Ok((rest, chain(from_to(input, rest), first, more, ExpressionKind::Product)))
}

fn chain(
    site: Site,
    first: Expression,
    more: Vec<(bool, Expression)>,
    kind: fn(Vec<(bool, Expression)>) -> ExpressionKind,
) -> Expression {
    if more.is_empty() {
        return first;
    }
    let mut parts = vec![(false, first)];
    parts.extend(more);
    Expression { kind: kind(parts), site }
}

/// factor = ( "-" | "+" ) , factor | power ;
fn factor(input: Tokens) -> Parsed<Expression> {
    deeper(input, |input| {
        if let Ok((rest, ())) = mark("-")(input) {
            let (rest, inner) = cut(factor).parse(rest)?;
            let kind = ExpressionKind::Negate(Box::new(inner));
            return Ok((rest, Expression { kind, site: from_to(input, rest) }));
        }
        if let Ok((rest, ())) = mark("+")(input) {
            return cut(factor).parse(rest);
        }
        power(input)
    })
}

/// power = quantity , [ "^" , factor ] ;
fn power(input: Tokens) -> Parsed<Expression> {
    let (rest, base) = quantity(input)?;
    let (rest, exponent) = opt(preceded(mark("^"), cut(factor))).parse(rest)?;
    let expression = match exponent {
        None => base,
        Some(exponent) => Expression {
            kind: ExpressionKind::Power(Box::new(base), Box::new(exponent)),
            site: from_to(input, rest),
        },
    };
    Ok((rest, expression))
}

/// quantity = primary , [ unit ] ;
fn quantity(input: Tokens) -> Parsed<Expression> {
    let (rest, inner) = primary(input)?;
    let has_unit =
        rest.first().is_some_and(|token| token.text == "[" && token.kind == TokenKind::Mark);
    if !has_unit {
        return Ok((rest, inner));
    }
    let (rest, unit) = cut(unit).parse(rest)?;
    let kind = ExpressionKind::Quantity(Box::new(inner), unit);
    Ok((rest, Expression { kind, site: from_to(input, rest) }))
}

/// primary = number | sum_over | span | call | variable | "(" , expression , ")" ;
fn primary(input: Tokens) -> Parsed<Expression> {
    match input.first().map(|token| (token.kind, token.text)) {
        Some((TokenKind::Number(_), _)) => number(input),
        Some((TokenKind::Word, "sum")) => sum_over(input),
        Some((TokenKind::Word, "span")) => span(input),
        Some((TokenKind::Word, word)) if !RESERVED.contains(&word) => {
            alt((call, variable)).parse(input)
        }
        Some((TokenKind::Mark, "(")) => {
            let (rest, inner) =
                delimited(mark("("), cut(expression), cut(mark(")"))).parse(input)?;
            Ok((rest, Expression { site: from_to(input, rest), ..inner }))
        }
        _ => Err(Fault::expected(input, "a number, a name or `(`")),
    }
}

/// number = digits , [ "." , digits ] , [ exponent ] ;
fn number(input: Tokens) -> Parsed<Expression> {
    match input.first().map(|token| (token.kind, token.span)) {
        Some((TokenKind::Number(value), span)) => {
            let kind = ExpressionKind::Number(value);
            Ok((nom::Input::take_from(&input, 1), Expression { kind, site: Site(span) }))
        }
        _ => Err(Fault::expected(input, "a number")),
    }
}

/// sum_over = "sum" , "(" , expression , comprehension , ")" ;
fn sum_over(input: Tokens) -> Parsed<Expression> {
    let (rest, ()) = keyword("sum")(input)?;
    let (rest, (body, comprehension)) =
        cut(delimited(mark("("), (expression, comprehension), mark(")"))).parse(rest)?;
    let kind = ExpressionKind::SumOver { body: Box::new(body), comprehension };
    Ok((rest, Expression { kind, site: from_to(input, rest) }))
}

/// span = "span" , "{" , [ item , { "," , item } , [ "," ] ] , "}" ;
fn span(input: Tokens) -> Parsed<Expression> {
    let (rest, ()) = keyword("span")(input)?;
    let (rest, ()) = cut(mark("{")).parse(rest)?;
    let (rest, items) = separated_list0(mark(","), item).parse(rest)?;
    let (rest, _) = opt(mark(",")).parse(rest)?;
    // A wrong item ends the list quietly; parsing it again says what is wrong with it.
    let (rest, ()) = match mark("}")(rest) {
        Ok(closed) => closed,
        Err(fault) => match (item(rest), rest.first().map(|token| token.text)) {
            (Err(nom::Err::Error(inner)), Some("," | "}") | None) => {
                return Err(nom::Err::Failure(inner));
            }
            (Err(inner), _) if items.is_empty() => return Err(cut_only(inner)),
            _ => {
                return Err(cut_only(fault.map(|fault| fault.or(Fault::comma(rest)))));
            }
        },
    };
    Ok((rest, Expression { kind: ExpressionKind::Span(items), site: from_to(input, rest) }))
}

/// item = [ name , ":" ] , expression , [ comprehension , [ "alike" ] ] ;
fn item(input: Tokens) -> Parsed<Item> {
    let (rest, label) = opt((name, mark(":")).map(|(name, ())| name)).parse(input)?;
    let (rest, body) = expression(rest)?;
    let (rest, comprehension) = opt(comprehension).parse(rest)?;
    let (rest, alike) = match comprehension {
        Some(_) => opt(keyword("alike")).parse(rest)?,
        None => (rest, None),
    };
    let (alike, site) = (alike.is_some(), from_to(input, rest));
    Ok((rest, Item { name: label, body, comprehension, alike, site }))
}

/// comprehension = "for" , binding , { ( "," | "for" ) , binding } ,
///                 [ "where" , comparison , { "and" , comparison } ] ;
pub(super) fn comprehension(input: Tokens) -> Parsed<Comprehension> {
    let (rest, ()) = keyword("for")(input)?;
    let (rest, first) = cut(binding).parse(rest)?;
    // After a comma stands another index only if `in` follows; otherwise the next item.
    let another = alt((preceded(mark(","), binding), preceded(keyword("for"), cut(binding))));
    let (rest, more) = many0(another).parse(rest)?;
    let conditions = preceded(keyword("where"), cut(separated_list1(keyword("and"), comparison)));
    let (rest, conditions) = opt(conditions).parse(rest)?;
    let mut bindings = vec![first];
    bindings.extend(more);
    let site = from_to(input, rest);
    Ok((rest, Comprehension { bindings, conditions: conditions.unwrap_or_default(), site }))
}

/// binding = name , "in" , range ;
fn binding(input: Tokens) -> Parsed<Binding> {
    let (rest, (name, ())) = (name, keyword("in")).parse(input)?;
    let (rest, range) = cut(range).parse(rest)?;
    Ok((rest, Binding { name, range }))
}

/// range = expression , ".." , expression ;
pub(super) fn range(input: Tokens) -> Parsed<Range> {
    let (rest, (first, (), last)) = (expression, mark(".."), cut(expression)).parse(input)?;
    let site = from_to(input, rest);
    Ok((rest, Range { first: Box::new(first), last: Box::new(last), site }))
}

/// comparison = expression , relation , expression ;
fn comparison(input: Tokens) -> Parsed<Comparison> {
    let (rest, (left, relation, right)) = (expression, relation, cut(expression)).parse(input)?;
    Ok((rest, Comparison { left, relation, right }))
}

/// relation = "<" | "<=" | ">" | ">=" | "==" | "!=" ;
pub(super) fn relation(input: Tokens) -> Parsed<Relation> {
    let found = input
        .first()
        .and_then(|token| Relation::ALL.into_iter().find(|relation| relation.sign() == token.text));
    match found {
        Some(relation) => Ok((nom::Input::take_from(&input, 1), relation)),
        None => Err(Fault::expected(input, "a comparison such as `<=`")),
    }
}

/// call = name , "(" , [ expression , { "," , expression } ] , [ ";" , expression ] , ")" ;
fn call(input: Tokens) -> Parsed<Expression> {
    let (rest, (function, ())) = (name, mark("(")).parse(input)?;
    let arguments =
        (separated_list0(mark(","), expression), opt(preceded(mark(";"), cut(expression))));
    let (rest, (arguments, order)) = cut(arguments).parse(rest)?;
    let (rest, ()) = match mark(")")(rest) {
        Ok(closed) => closed,
        Err(_) if arguments.is_empty() => {
            expression(rest).map_err(cut_only)?;
            return Err(cut_only(Fault::expected(rest, "`)`")));
        }
        Err(fault) => {
            return Err(cut_only(fault.map(|fault| fault.or(Fault::comma(rest)))));
        }
    };
    let kind = ExpressionKind::Call { name: function.text, arguments, order: order.map(Box::new) };
    Ok((rest, Expression { kind, site: from_to(input, rest) }))
}

/// What was tried is meant: nothing else is tried in its place.
fn cut_only(error: nom::Err<Fault>) -> nom::Err<Fault> {
    match error {
        nom::Err::Error(fault) => nom::Err::Failure(fault),
        other => other,
    }
}

/// variable = name , [ "[" , ( range | expression ) , "]" ] ;
///
/// The bracket follows its name without a space; with one, it holds a unit.
pub(super) fn variable(input: Tokens) -> Parsed<Expression> {
    let (rest, word) = name(input)?;
    let indexed = rest.first().is_some_and(|token| token.text == "[" && !token.spaced);
    if !indexed {
        let kind = ExpressionKind::Name(word.text);
        return Ok((rest, Expression { kind, site: from_to(input, rest) }));
    }
    let name = word.text;
    let (rest, ()) = mark("[")(rest)?;
    let (rest, first) = cut(expression).parse(rest)?;
    let (rest, last) = opt(preceded(mark(".."), cut(expression))).parse(rest)?;
    let (rest, ()) = cut(mark("]")).parse(rest)?;
    let kind = match last {
        None => ExpressionKind::Index { name, index: Box::new(first) },
        Some(last) => {
            let site = Site(first.site.0.join(last.site.0));
            let range = Range { first: Box::new(first), last: Box::new(last), site };
            ExpressionKind::Slice { name, range }
        }
    };
    Ok((rest, Expression { kind, site: from_to(input, rest) }))
}

impl Fault {
    fn comma(input: Tokens) -> Fault {
        Fault { at: input.place(), expected: vec!["`,`".into()], diagnostic: None }
    }
}
