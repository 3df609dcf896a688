//! Specs made from other specs by what their grammar is made of: statements, names, numbers, units
//! and operators change places, so that most of what comes out is read and gets to the lowering.

use rand::RngExt as _;
use rand_pcg::Pcg64;

/// Names and marks that stand in for others.
const NAMES: &[&str] = &[
    "coordinates",
    "momenta",
    "velocities",
    "time",
    "input",
    "hidden",
    "state",
    "param",
    "constant",
    "force",
    "sensor",
    "effect",
    "body",
    "T",
    "V",
    "H",
    "L",
    "span",
    "poly",
    "pairs",
    "rate",
    "sum",
    "abs",
    "per",
    "run",
    "not",
    "measured",
    "q",
    "x",
    "p",
    "t",
];
const NUMBERS: &[&str] = &[
    "0",
    "1",
    "2",
    "3",
    "-1",
    "0.5",
    "1e-300",
    "1e300",
    "1e400",
    "2147483648",
    "99999999999",
    "1/3",
];
const UNITS: &[&str] = &[
    "[m]",
    "[m/s]",
    "[km/h]",
    "[kg*m/s]",
    "[1]",
    "[rad]",
    "[m^2147483647]",
    "[s^-1]",
    "[N*m*s]",
    "[",
];
const MARKS: &[&str] = &["+", "-", "*", "/", "^", "=", "+=", ">=", "..", ",", ";", ":", "(", ")"];
const STATEMENTS: &[&str] = &[
    "velocities v [m/s]",
    "momenta p_z [kg*m/s]",
    "coordinates z[1..3] [m]",
    "hidden z = 0.1 with p_z",
    "state w { w' = -w }",
    "input u [m] { spline }",
    "param k per run = 1 in 0..2",
    "let e = q^2/2",
    "force q += span{ rate(q), sum(q[i] for i in 1..3) }",
    "effect viscous_drag(q)",
    "constrain terms of V >= 0",
    "constrain 0 <= k <= 1",
    "candidates { a: force q += q; b: V += span{ q^3 } }",
    "body b = (x, y)",
    "sensor p += span{ 1 }",
    "holonomic q^2 = 1",
];

/// What a text is made of, blanks and comments left out; a line's end is a piece too.
fn pieces(text: &str) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for line in text.lines() {
        let mut rest = line.split('#').next().unwrap_or_default();
        while let Some(first) = rest.chars().next() {
            let of = |same: fn(char) -> bool| rest.find(|c| !same(c)).unwrap_or(rest.len());
            let length = match first {
                '"' => rest.get(1..).and_then(|all| all.find('"')).map_or(rest.len(), |at| at + 2),
                // A unit stands behind a blank, an index does not.
                ' ' if rest.starts_with(" [") => rest.find(']').map_or(rest.len(), |at| at + 1),
                c if c.is_alphabetic() || c == '_' => of(|c| c.is_alphanumeric() || c == '_'),
                c if c.is_ascii_digit() => of(|c| c.is_ascii_digit()),
                '+' | '<' | '>' | '=' | '!' if rest.get(1..2) == Some("=") => 2,
                _ if rest.starts_with("..") => 2,
                c => c.len_utf8(),
            };
            let (piece, after) = rest.split_at(length);
            if !piece.trim().is_empty() {
                out.push(piece.to_string());
            }
            rest = after;
        }
        out.push("\n".to_string());
    }
    out
}

/// The statements of a text, roughly: what stands between ends of lines that no bracket spans.
fn statements(text: &str) -> Vec<Vec<String>> {
    let mut out = vec![Vec::new()];
    let mut depth = 0i32;
    for piece in pieces(text) {
        match piece.as_str() {
            "(" | "{" | "[" => depth += 1,
            ")" | "}" | "]" => depth -= 1,
            "\n" | ";" if depth <= 0 => {
                out.push(Vec::new());
                continue;
            }
            _ => {}
        }
        if let Some(last) = out.last_mut() {
            last.push(piece);
        }
    }
    out.retain(|one| one.iter().any(|piece| piece != "\n"));
    out
}

fn one_of<'a, T: ?Sized>(from: &[&'a T], random: &mut Pcg64) -> &'a T {
    from[random.random_range(0..from.len())]
}

/// A text with some of its parts changed, or exchanged for those of another.
pub(crate) fn changed(seeds: &[Vec<u8>], random: &mut Pcg64) -> Vec<u8> {
    let text = |random: &mut Pcg64| {
        let bytes = &seeds[random.random_range(0..seeds.len())];
        statements(&String::from_utf8_lossy(bytes))
    };
    let (mut spec, other) = (text(random), text(random));
    for _ in 0..random.random_range(1..6) {
        if spec.is_empty() {
            break;
        }
        let at = random.random_range(0..spec.len());
        match random.random_range(0..12) {
            0 => drop(spec.remove(at)),
            1 => spec.insert(at, spec[random.random_range(0..spec.len())].clone()),
            2 => {
                let to = random.random_range(0..spec.len());
                spec.swap(at, to);
            }
            3 if !other.is_empty() => {
                spec.insert(at, other[random.random_range(0..other.len())].clone());
            }
            4 => spec.insert(at, pieces(one_of(STATEMENTS, random))),
            _ => within(&mut spec[at], &other, random),
        }
    }
    let lines = spec.iter().map(|statement| statement.join(" ").replace(" [ ", "["));
    lines.collect::<Vec<String>>().join("\n").into_bytes()
}

/// One piece of a statement changed, by one of its kind for the most part.
fn within(statement: &mut Vec<String>, other: &[Vec<String>], random: &mut Pcg64) {
    if statement.is_empty() {
        return;
    }
    let at = random.random_range(0..statement.len());
    let first = statement[at].trim_start().chars().next().unwrap_or(' ');
    let named = |c: char| c.is_alphabetic() || c == '_';
    match random.random_range(0..8) {
        0 => drop(statement.remove(at)),
        1 => statement.insert(at, statement[random.random_range(0..statement.len())].clone()),
        // An item more in a list, as large as it comes.
        2 => {
            let end = (at + random.random_range(1..6)).min(statement.len());
            let item: Vec<String> = statement[at..end].to_vec();
            statement.splice(end..end, std::iter::once(",".to_string()).chain(item));
        }
        3 if named(first) => {
            let all: Vec<&String> = other.iter().flatten().collect();
            let names = all.into_iter().filter(|one| one.starts_with(named));
            let names: Vec<&String> = names.collect();
            if !names.is_empty() {
                statement[at].clone_from(names[random.random_range(0..names.len())]);
            }
        }
        4 => {
            let function = one_of(&["sin", "sqrt", "log", "abs", "rate", "exp"], random);
            let inner = std::mem::take(&mut statement[at]);
            let around = [function, "(", &inner, ")"].map(str::to_string);
            statement.splice(at..=at, around);
        }
        _ => {
            let kind = match first {
                '[' => UNITS,
                c if named(c) => NAMES,
                c if c.is_ascii_digit() => NUMBERS,
                _ => MARKS,
            };
            statement[at] = one_of(kind, random).to_string();
        }
    }
}
