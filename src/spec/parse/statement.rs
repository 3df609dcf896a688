//! Statements: each begins with a word that says what it is.

use nom::Parser;
use nom::branch::alt;
use nom::combinator::{cut, opt};
use nom::multi::{many0, separated_list0, separated_list1};
use nom::sequence::{delimited, preceded};

use super::expression::{
    RESERVED, comprehension, expression, keyword, mark, name, quoted, range, relation, unit,
    variable,
};
use super::token::TokenKind;
use super::{Fault, Parsed, Tokens};
use crate::data::Interpolation;
use crate::diagnostic::{Diagnostic, Span};
use crate::spec::ast::*;

/// Every word that begins a statement.
pub(super) const STATEMENTS: [&str; 23] = [
    "system",
    "coordinates",
    "momenta",
    "velocities",
    "time",
    "input",
    "hidden",
    "state",
    "data",
    "constant",
    "let",
    "param",
    "T",
    "V",
    "H",
    "L",
    "force",
    "sensor",
    "measure",
    "body",
    "effect",
    "candidates",
    "constrain",
];

/// statement = system | variables | time | input | hidden | state | data | constant | parameter
///           | energy | force | sensor | measure | body | effect | candidates | constrain ;
pub(super) fn statement(input: Tokens) -> Parsed<Statement> {
    let Some(first) = input.first() else { return Err(Fault::expected(input, "a statement")) };
    let (rest, kind) = match first.text {
        "system" => cut(system).parse(input)?,
        "coordinates" | "momenta" | "velocities" => cut(variables).parse(input)?,
        "time" => cut(time).parse(input)?,
        "input" => cut(self::input).parse(input)?,
        "hidden" => cut(hidden).parse(input)?,
        "state" => cut(state).parse(input)?,
        "data" => cut(data).parse(input)?,
        "constant" | "let" => cut(constant).parse(input)?,
        "param" => cut(parameter).parse(input)?,
        "T" | "V" | "H" | "L" => cut(energy).parse(input)?,
        "force" => cut(force).parse(input)?,
        "sensor" => cut(sensor).parse(input)?,
        "measure" => cut(measure).parse(input)?,
        "body" => cut(body).parse(input)?,
        "effect" => cut(effect).parse(input)?,
        "candidates" => cut(candidates).parse(input)?,
        "constrain" => cut(constrain).parse(input)?,
        other => return Err(unknown_statement(other, first.kind, first.span)),
    };
    let site = Site(Span::new(first.span.start, rest.taken));
    Ok((rest, Statement { kind, site, effect: None }))
}

fn unknown_statement(word: &str, kind: TokenKind, span: Span) -> nom::Err<Fault> {
    let known = format!("statements begin with {}", STATEMENTS.join(", "));
    let near = crate::spec::nearest(word, STATEMENTS);
    let hint = match near {
        Some(near) if kind == TokenKind::Word => format!("did you mean `{near}`?"),
        _ => known,
    };
    Fault::fatal(
        Diagnostic::error(span, "no statement begins like this")
            .label(format!("`{word}` is not the name of a statement"))
            .hint(hint),
    )
}

/// system = "system" , quoted ;
fn system(input: Tokens) -> Parsed<StatementKind> {
    let (rest, title) = preceded(keyword("system"), quoted).parse(input)?;
    Ok((rest, StatementKind::System(title)))
}

/// variables = ( "coordinates" | "momenta" | "velocities" ) , declaration , { "," , declaration } ;
fn variables(input: Tokens) -> Parsed<StatementKind> {
    let role = alt((
        keyword("coordinates").map(|()| Role::Coordinates),
        keyword("momenta").map(|()| Role::Momenta),
        keyword("velocities").map(|()| Role::Velocities),
    ));
    let (rest, (role, list)) = (role, separated_list1(mark(","), cut(declaration))).parse(input)?;
    Ok((rest, StatementKind::Variables { role, list }))
}

/// declaration = name , [ "[" , range , "]" ] , [ unit ] ;
fn declaration(input: Tokens) -> Parsed<Declaration> {
    let (rest, name) = name(input)?;
    // A bracket with dots in it is a range of indices, any other one a unit.
    let (rest, range) = if holds_dots(rest) {
        opt(delimited(mark("["), range, cut(mark("]")))).parse(rest)?
    } else {
        (rest, None)
    };
    let (rest, unit) = opt(unit).parse(rest)?;
    let site = Site(Span::new(input.place().start, rest.taken));
    Ok((rest, Declaration { name, range, unit, site }))
}

/// Whether the bracket that opens here has dots between its ends, outside inner brackets.
fn holds_dots(input: Tokens) -> bool {
    let mut depth = 0;
    for token in input.rest {
        match token.text {
            "[" | "(" | "{" => depth += 1,
            "]" | ")" | "}" => depth -= 1,
            ".." if depth == 1 => return true,
            _ => {}
        }
        if depth == 0 {
            break;
        }
    }
    false
}

/// time = "time" , name , [ unit ] ;
fn time(input: Tokens) -> Parsed<StatementKind> {
    let (rest, (name, unit)) = preceded(keyword("time"), (name, opt(unit))).parse(input)?;
    Ok((rest, StatementKind::Time { name, unit }))
}

/// input = "input" , name , [ unit ] , "{" , between , "}" ;
fn input(input: Tokens) -> Parsed<StatementKind> {
    let (rest, (name, unit)) = preceded(keyword("input"), (name, opt(unit))).parse(input)?;
    if mark("{")(rest).is_err() {
        return Err(Fault::fatal(
            Diagnostic::error(
                name.site.0,
                format!("what `{}` does between samples is not said", name.text),
            )
            .label("this input")
            .hint(format!(
                "write `{{ hold }}` behind it if it keeps its value until the next sample, or \
                     one of {}",
                ways()
            )),
        ));
    }
    let (rest, between) = delimited(mark("{"), between, mark("}")).parse(rest)?;
    Ok((rest, StatementKind::Input { name, unit, between }))
}

/// between = "hold" | "linear" | "spline" | "band_limited" ;
fn between(input: Tokens) -> Parsed<Between> {
    let place = input.place();
    let (rest, word) = name(input)?;
    let Some(interpolation) = Interpolation::by_keyword(&word.text) else {
        let near = crate::spec::nearest(&word.text, Interpolation::ALL.map(Interpolation::keyword));
        let hint = match near {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("write one of {}", ways()),
        };
        return Err(Fault::fatal(
            Diagnostic::error(place, format!("`{}` does not say what an input does", word.text))
                .label("between two samples")
                .hint(hint),
        ));
    };
    Ok((rest, Between { interpolation, word }))
}

fn ways() -> String {
    Interpolation::ALL.map(Interpolation::keyword).join(", ")
}

/// hidden = "hidden" , hidden_start , [ "with" , hidden_start ] ;
fn hidden(input: Tokens) -> Parsed<StatementKind> {
    let (rest, coordinate) = preceded(keyword("hidden"), hidden_start).parse(input)?;
    let (rest, momentum) = opt(preceded(keyword("with"), cut(hidden_start))).parse(rest)?;
    Ok((rest, StatementKind::Hidden(coordinate, momentum)))
}

/// hidden_start = name , [ unit ] , [ "=" , expression ] ;
fn hidden_start(input: Tokens) -> Parsed<HiddenStart> {
    let (rest, (name, unit)) = (name, opt(unit)).parse(input)?;
    let (rest, start) = opt(preceded(mark("="), cut(expression))).parse(rest)?;
    let site = Site(Span::new(input.place().start, rest.taken));
    Ok((rest, HiddenStart { name, unit, start, site }))
}

/// state = "state" , hidden_start , "{" , name , "'" , "=" , expression , "}" ;
fn state(input: Tokens) -> Parsed<StatementKind> {
    let (rest, of) = preceded(keyword("state"), hidden_start).parse(input)?;
    let own = &of.name.text;
    if mark("{")(rest).is_err() {
        return Err(Fault::fatal(
            Diagnostic::error(of.name.site.0, format!("the rate of `{own}` is not given"))
                .label("this internal state")
                .hint(format!("write its law behind it, as in `{{ {own}' = rate(x) - {own} }}`")),
        ));
    }
    let (rest, (name, ())) = preceded(mark("{"), (name, mark("'"))).parse(rest)?;
    if name.text != *own {
        return Err(Fault::fatal(
            Diagnostic::error(name.site.0, format!("this is the rate of `{}`", name.text))
                .label(format!("the rate of `{own}` is needed here"))
                .hint(format!("write `{own}' = ...`; every state has a statement of its own")),
        ));
    }
    let (rest, ((), rate, ())) = (mark("="), cut(expression), mark("}")).parse(rest)?;
    Ok((rest, StatementKind::State { of, rate }))
}

/// data = "data" , quoted , [ "{" , { data_item , [ "," | ";" ] } , "}" ] ;
fn data(input: Tokens) -> Parsed<StatementKind> {
    let (rest, file) = preceded(keyword("data"), quoted).parse(input)?;
    let Ok((mut rest, ())) = mark("{")(rest) else {
        return Ok((rest, StatementKind::Data { file, items: Vec::new() }));
    };
    let mut items = Vec::new();
    loop {
        if let Ok((rest, ())) = mark("}")(rest) {
            return Ok((rest, StatementKind::Data { file, items }));
        }
        let (after, item) = cut(data_item).parse(rest)?;
        items.push(item);
        (rest, _) = opt(alt((mark(","), mark(";")))).parse(after)?;
    }
}

/// data_item = "time" , column , [ unit ] | "every" , expression | "run" , column | "pairs"
///           | variable , ( "=" , column , [ unit ] , error_column | "not" , "measured" ) ;
fn data_item(input: Tokens) -> Parsed<DataItem> {
    let word = input.first().map_or("", |token| token.text);
    // A column may be called `"="`, in quotes.
    let assigned =
        input.rest.get(1).is_some_and(|token| token.kind == TokenKind::Mark && token.text == "=");
    let unmeasured = input.rest.get(1).is_some_and(|token| token.text == "not");
    let (rest, kind) = match word {
        "time" if !assigned => {
            let (rest, ((), column, unit)) = (keyword("time"), column, opt(unit)).parse(input)?;
            (rest, DataItemKind::Time { column, unit })
        }
        "every" if !assigned && !unmeasured => {
            let (rest, period) = preceded(keyword("every"), cut(expression)).parse(input)?;
            (rest, DataItemKind::Every(period))
        }
        "run" if !assigned => {
            let (rest, column) = preceded(keyword("run"), column).parse(input)?;
            (rest, DataItemKind::Run(column))
        }
        "pairs" if !assigned => {
            let (rest, ()) = keyword("pairs")(input)?;
            (rest, DataItemKind::Pairs)
        }
        _ => {
            let (rest, variable) = variable(input)?;
            if let Ok((rest, ())) = keyword("not")(rest) {
                let (rest, ()) = cut(keyword("measured")).parse(rest)?;
                (rest, DataItemKind::NotMeasured(variable))
            } else {
                let (rest, ((), column, unit)) = (mark("="), column, opt(unit)).parse(rest)?;
                let (rest, error) = error_column(rest)?;
                (rest, DataItemKind::Column { variable, column, unit, error })
            }
        }
    };
    let site = Site(Span::new(input.place().start, rest.taken));
    Ok((rest, DataItem { kind, site }))
}

/// error_column = [ "error" , column , [ unit ] ] ;
fn error_column(input: Tokens) -> Parsed<Option<ErrorColumn>> {
    // What is called `error` may be measured, too.
    let names_column = input.rest.get(1).is_some_and(|next| match next.kind {
        TokenKind::Word => next.text != "not",
        kind => kind == TokenKind::Text,
    });
    if !names_column || keyword("error")(input).is_err() {
        return Ok((input, None));
    }
    let (rest, (column, unit)) = preceded(keyword("error"), (column, opt(unit))).parse(input)?;
    Ok((rest, Some(ErrorColumn { column, unit })))
}

/// column = name | quoted ;
fn column(input: Tokens) -> Parsed<Word> {
    alt((name, quoted)).parse(input)
}

/// constant = ( "constant" | "let" ) , name , "=" , expression ;
fn constant(input: Tokens) -> Parsed<StatementKind> {
    let word = alt((keyword("constant").map(|()| false), keyword("let").map(|()| true)));
    let (rest, (by_let, name, (), value)) = (word, name, mark("="), expression).parse(input)?;
    Ok((rest, StatementKind::Constant { name, value, by_let }))
}

/// parameter = "param" , name , ( starts | "per" , column , [ starts ] ) , [ "in" , limits ] ;
fn parameter(input: Tokens) -> Parsed<StatementKind> {
    let (rest, ((), name)) = (keyword("param"), name).parse(input)?;
    let (rest, per) = opt(preceded(keyword("per"), cut(column))).parse(rest)?;
    let (rest, starts) = match &per {
        Some(_) => opt(starts).parse(rest)?,
        None => starts.map(Some).parse(rest)?,
    };
    let (rest, bounds) = opt(preceded(keyword("in"), cut(limits))).parse(rest)?;
    let starts = starts.unwrap_or_default();
    Ok((rest, StatementKind::Parameter { name, per, starts, bounds }))
}

/// starts = "=" , expression , { "," , expression } ;
fn starts(input: Tokens) -> Parsed<Vec<Expression>> {
    let (rest, ((), first)) = (mark("="), expression).parse(input)?;
    let (rest, more) = many0(preceded(mark(","), cut(expression))).parse(rest)?;
    Ok((rest, std::iter::once(first).chain(more).collect()))
}

/// limits = [ expression ] , ".." , [ expression ] ;
fn limits(input: Tokens) -> Parsed<Limits> {
    let (rest, (lower, (), upper)) = (opt(expression), mark(".."), opt(expression)).parse(input)?;
    let site = Site(Span::new(input.place().start, rest.taken));
    Ok((rest, Limits { lower, upper, site }))
}

/// energy = ( "T" | "V" | "H" | "L" ) , ( "=" | "+=" ) , expression ;
fn energy(input: Tokens) -> Parsed<StatementKind> {
    let (rest, part) = energy_part(input)?;
    let (rest, adds) = assignment(rest)?;
    let (rest, value) = expression(rest)?;
    Ok((rest, StatementKind::Energy { part, adds, value }))
}

fn energy_part(input: Tokens) -> Parsed<EnergyPart> {
    alt((
        keyword("T").map(|()| EnergyPart::Kinetic),
        keyword("V").map(|()| EnergyPart::Potential),
        keyword("H").map(|()| EnergyPart::Hamiltonian),
        keyword("L").map(|()| EnergyPart::Lagrangian),
    ))
    .parse(input)
}

fn assignment(input: Tokens) -> Parsed<bool> {
    alt((mark("=").map(|()| false), mark("+=").map(|()| true))).parse(input)
}

/// force = "force" , variable , ( "=" | "+=" ) , expression , [ comprehension ] ;
fn force(input: Tokens) -> Parsed<StatementKind> {
    let (rest, coordinate) = preceded(keyword("force"), variable).parse(input)?;
    let (rest, adds) = assignment(rest)?;
    let (rest, value) = expression(rest)?;
    let (rest, comprehension) = opt(comprehension).parse(rest)?;
    Ok((rest, StatementKind::Force { coordinate, adds, value, comprehension }))
}

/// sensor = "sensor" , variable , "+=" , expression , [ comprehension ] ;
fn sensor(input: Tokens) -> Parsed<StatementKind> {
    let (rest, observable) = preceded(keyword("sensor"), variable).parse(input)?;
    if mark("=")(rest).is_ok() {
        return Err(Fault::fatal(
            Diagnostic::error(rest.place(), "a sensor adds to what it measures")
                .label("`=` stands here")
                .hint(format!("write `sensor {observable} += ...`")),
        ));
    }
    let (rest, ()) = mark("+=")(rest)?;
    let (rest, (value, comprehension)) = (expression, opt(comprehension)).parse(rest)?;
    Ok((rest, StatementKind::Sensor { observable, value, comprehension }))
}

/// measure = "measure" , name , [ unit ] , "=" , expression , [ "{" , "wrapped" , "}" ] ;
fn measure(input: Tokens) -> Parsed<StatementKind> {
    let (rest, (name, unit)) = preceded(keyword("measure"), (name, opt(unit))).parse(input)?;
    let (rest, value) = preceded(mark("="), expression).parse(rest)?;
    let wrapped = delimited(mark("{"), cut(keyword("wrapped")), cut(mark("}")));
    let (rest, wrapped) = opt(wrapped).parse(rest)?;
    Ok((rest, StatementKind::Measure { name, unit, value, wrapped: wrapped.is_some() }))
}

/// body = "body" , name , "=" , coordinates_of_body ;
fn body(input: Tokens) -> Parsed<StatementKind> {
    let (rest, (name, ())) = preceded(keyword("body"), (name, mark("="))).parse(input)?;
    let (rest, coordinates) = coordinates_of_body(rest)?;
    Ok((rest, StatementKind::Body { name, coordinates }))
}

/// coordinates_of_body = "(" , variable , { "," , variable } , ")" ;
fn coordinates_of_body(input: Tokens) -> Parsed<Vec<Expression>> {
    delimited(mark("("), separated_list1(mark(","), variable), mark(")")).parse(input)
}

/// argument = variable | coordinates_of_body ;
fn argument(input: Tokens) -> Parsed<Argument> {
    if mark("(")(input).is_err() {
        return variable.map(Argument::Variable).parse(input);
    }
    let (rest, list) = cut(coordinates_of_body).parse(input)?;
    let site = Site(Span::new(input.place().start, rest.taken));
    Ok((rest, Argument::Body(list, site)))
}

/// effect = "effect" , name , [ "(" , [ argument , { "," , argument } ] ,
///          [ ";" , [ setting , { "," , setting } ] ] , ")" ] ;
fn effect(input: Tokens) -> Parsed<StatementKind> {
    let (rest, name) = preceded(keyword("effect"), name).parse(input)?;
    let Ok((rest, ())) = mark("(")(rest) else {
        let (arguments, settings) = (Vec::new(), Vec::new());
        return Ok((rest, StatementKind::Effect { name, arguments, settings }));
    };
    let (rest, arguments) = separated_list0(mark(","), argument).parse(rest)?;
    let (rest, settings) =
        opt(preceded(mark(";"), separated_list0(mark(","), setting))).parse(rest)?;
    let (rest, ()) = mark(")")(rest)?;
    let settings = settings.unwrap_or_default();
    Ok((rest, StatementKind::Effect { name, arguments, settings }))
}

/// setting = name , "=" , expression ;
fn setting(input: Tokens) -> Parsed<Setting> {
    let (rest, (name, (), value)) = (name, cut(mark("=")), cut(expression)).parse(input)?;
    let site = Site(Span::new(input.place().start, rest.taken));
    Ok((rest, Setting { name, value, site }))
}

/// candidates = "candidates" , "{" , { candidate } , "}" ;
fn candidates(input: Tokens) -> Parsed<StatementKind> {
    let (mut rest, ((), ())) = (keyword("candidates"), mark("{")).parse(input)?;
    let mut list = Vec::new();
    loop {
        if let Ok((rest, ())) = mark("}")(rest) {
            return Ok((rest, StatementKind::Candidates(list)));
        }
        let (after, one) = cut(candidate).parse(rest)?;
        list.push(one);
        rest = after;
    }
}

/// candidate = name , ":" , { addition , [ ";" ] } ;
fn candidate(input: Tokens) -> Parsed<Candidate> {
    let (mut rest, (name, ())) = (name, mark(":")).parse(input)?;
    let mut statements = Vec::new();
    let mut end = rest.taken;
    loop {
        let over = match rest.rest {
            [] => true,
            [first, ..] if first.text == "}" => true,
            [_, second, ..] => second.kind == TokenKind::Mark && second.text == ":",
            _ => false,
        };
        if over && !statements.is_empty() {
            let site = Site(Span::new(input.place().start, end));
            return Ok((rest, Candidate { name, statements, site }));
        }
        let (after, one) = cut(addition).parse(rest)?;
        statements.push(one);
        end = after.taken;
        (rest, _) = opt(mark(";")).parse(after)?;
    }
}

/// addition = parameter | energy | force | sensor | constrain ;
fn addition(input: Tokens) -> Parsed<Statement> {
    let (rest, kind) = match input.first().map_or("", |token| token.text) {
        "param" => cut(parameter).parse(input)?,
        "T" | "V" | "H" | "L" => cut(energy).parse(input)?,
        "force" => cut(force).parse(input)?,
        "sensor" => cut(sensor).parse(input)?,
        "constrain" => cut(constrain).parse(input)?,
        _ => {
            let words = "a statement that adds: `param`, `T`, `V`, `H`, `L`, `force`, `sensor` or `constrain`";
            return Err(Fault::expected(input, words));
        }
    };
    let site = Site(Span::new(input.place().start, rest.taken));
    Ok((rest, Statement { kind, site, effect: None }))
}

/// constrain = "constrain" , operand , relation , operand , [ relation , operand ] ;
fn constrain(input: Tokens) -> Parsed<StatementKind> {
    let (rest, first) = preceded(keyword("constrain"), operand).parse(input)?;
    let (rest, second) = (relation, cut(operand)).parse(rest)?;
    let (rest, third) = opt((relation, cut(operand))).parse(rest)?;
    let mut rest_of = vec![second];
    rest_of.extend(third);
    Ok((rest, StatementKind::Constrain { first, rest: rest_of }))
}

/// operand = "terms" , "of" , ( "T" | "V" | "H" | "L" | "force" , variable ) | expression ;
fn operand(input: Tokens) -> Parsed<Operand> {
    if keyword("terms")(input).is_err() {
        let (rest, value) = expression(input)?;
        return Ok((rest, Operand::Value(value)));
    }
    let target = alt((
        energy_part.map(Target::Energy),
        preceded(keyword("force"), cut(variable)).map(Target::Force),
    ));
    let (rest, ((), (), target)) = (keyword("terms"), keyword("of"), cut(target)).parse(input)?;
    let site = Site(Span::new(input.place().start, rest.taken));
    Ok((rest, Operand::Terms(target, site)))
}

/// Whether a word may name a variable, a constant or a parameter.
///
/// `L` is the Lagrangian where a statement begins, and everywhere else a length as good as any.
pub fn may_name(word: &str) -> bool {
    word == "L" || !STATEMENTS.contains(&word) && !RESERVED.contains(&word)
}
