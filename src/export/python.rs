//! A Python module of SymPy expressions with a small simulator.

use std::fmt::Write;

use super::escape::{fill, python_comment, python_docstring, python_string as literal};
use super::model::{Identifiers, Model};
use super::{Export, Output};
use crate::error::Result;
use crate::expr::{Expr, FUNCTIONS, Function, Names, Place, Symbol, System, Variable};

const TEMPLATE: &str = include_str!("templates/model.py.txt");

/// Words of Python, and names of the module; those of functions stand in their rows.
const KEYWORDS: &[&str] = &[
    "False",
    "None",
    "True",
    "and",
    "as",
    "assert",
    "async",
    "await",
    "break",
    "class",
    "continue",
    "def",
    "del",
    "elif",
    "else",
    "except",
    "finally",
    "for",
    "from",
    "global",
    "if",
    "import",
    "in",
    "is",
    "lambda",
    "nonlocal",
    "not",
    "or",
    "pass",
    "raise",
    "return",
    "try",
    "while",
    "with",
    "yield",
    "sympy",
    "math",
    "kinetic",
    "potential",
    "hamiltonian",
    "forces",
    "coordinates",
    "momenta",
    "time",
    "coefficients",
    "energy",
    "velocities",
    "accelerations",
    "field",
    "simulate",
    "driving",
    "inputs",
    "TypeError",
    "numbers",
    "abs",
    "float",
    "list",
    "max",
    "print",
    "range",
    "zip",
    "ArithmeticError",
    "SEPARABLE",
    "STEP",
    "START",
    "START_TIME",
    "_",
];

/// Names that a symbol of the model must not have.
fn reserved() -> impl Iterator<Item = &'static str> {
    KEYWORDS.iter().copied().chain(FUNCTIONS.iter().map(|row| row.sympy))
}

/// Writes the module.
pub(super) fn export(export: &Export) -> Result<Output> {
    let model = Model::new(export)?;
    let system = export.system();
    let identifiers = Identifiers::new(export, &model, reserved(), false);
    let n = system.degrees();
    let list = |symbols: &mut dyn Iterator<Item = Symbol>| -> Vec<String> {
        symbols.map(|symbol| identifiers.of(symbol).to_string()).collect()
    };
    let names = Names {
        coordinates: list(&mut (0..n).map(Symbol::Coordinate)),
        momenta: list(&mut (0..n).map(Symbol::Momentum)),
        inputs: list(&mut (0..system.inputs.len()).map(|i| Symbol::Input(i, 0))),
        parameters: list(&mut (0..system.parameters.len()).map(Symbol::Parameter)),
        coefficients: list(&mut (0..system.terms.len()).map(Symbol::Coefficient)),
    };
    let mut whole = system.clone();
    let parts = ModuleParts::new(export, &mut whole)?;
    let python = |expr: Expr| {
        let text = whole.graph.text(expr, &names);
        // A rate of an input is a symbol of its own.
        let mut text = text;
        for &symbol in model.inputs.iter().rev() {
            text = text.replace(&names.of(symbol), identifiers.of(symbol));
        }
        // Time has no entry in `Names`: it is always t there.
        translate(&text, identifiers.of(Symbol::Time))
    };

    let mut symbols = String::new();
    let _ = writeln!(symbols, "coordinates = [\n{}]", symbol_list(&system.coordinates));
    let _ = writeln!(symbols, "momenta = [\n{}]", symbol_list(&system.momenta));
    for (list, names) in [("coordinates", &names.coordinates), ("momenta", &names.momenta)] {
        for (i, name) in names.iter().enumerate() {
            let _ = writeln!(symbols, "{name} = {list}[{i}]");
        }
    }
    let time = identifiers.of(Symbol::Time);
    let _ = writeln!(
        symbols,
        "time = {time} = sympy.Symbol({}, real=True)",
        literal(&system.time.name)
    );
    let plain = system.names();
    symbols += "# What drives the motion, in the order in which `inputs` gives it.\ndriving = [\n";
    for &symbol in &model.inputs {
        let name = literal(&plain.of(symbol));
        let _ = writeln!(symbols, "    sympy.Symbol({name}, real=True),");
    }
    symbols += "]\n";
    for (i, &symbol) in model.inputs.iter().enumerate() {
        let _ = writeln!(symbols, "{} = driving[{i}]", identifiers.of(symbol));
    }
    for constant in &model.constants {
        let name = identifiers.of(constant.symbol);
        let _ = writeln!(
            symbols,
            "{name} = sympy.Symbol({}, real=True)  # {}",
            literal(&constant.name),
            python_comment(&constant.meaning)
        );
    }
    let mut values = String::new();
    for constant in &model.constants {
        let error = if constant.standard_error.is_finite() {
            format!("{:?}", constant.standard_error)
        } else {
            "None".to_string()
        };
        let name = identifiers.of(constant.symbol);
        let _ = writeln!(values, "    {name}: ({:?}, {error}),", constant.value);
    }
    let forces: String = parts
        .forces
        .iter()
        .map(|&force| format!("    sympy.sympify({}),\n", python(force)))
        .collect();
    let (start_time, start) = export.start_or_default();
    let separable = {
        let graph = &model.graph;
        (0..n).all(|i| {
            model.velocities.iter().all(|&v| !graph.depends_on(v, Symbol::Coordinate(i)))
                && model.accelerations.iter().all(|&a| !graph.depends_on(a, Symbol::Momentum(i)))
        })
    };
    let provenance: String = export
        .provenance
        .lines()
        .iter()
        .map(|line| format!("{}\n", python_docstring(line)))
        .collect();
    let text = fill(
        TEMPLATE,
        &[
            ("name", &python_docstring(&system.name)),
            ("provenance", provenance.trim_end()),
            ("functions", &functions(&model)),
            ("symbols", &symbols),
            ("values", &values),
            ("kinetic", &python(parts.kinetic)),
            ("potential", &python(parts.potential)),
            ("rest", &python(parts.rest)),
            ("forces", &forces),
            ("start", &format!("{start:?}")),
            ("start_time", &format!("{start_time:?}")),
            ("step", &format!("{:?}", export.step())),
            ("separable", if separable { "True" } else { "False" }),
        ],
    );
    Ok(Output::Text(text))
}

/// T, V, what else is in H, and the forces, learned terms included.
struct ModuleParts {
    kinetic: Expr,
    potential: Expr,
    rest: Expr,
    forces: Vec<Expr>,
}

impl ModuleParts {
    fn new(export: &Export, system: &mut System) -> Result<ModuleParts> {
        let mut part = |place, known| {
            let mut sum = vec![known];
            for (id, term, _) in export.law.terms() {
                let Some(term) = term.part(place) else { continue };
                let coefficient = system.graph.symbol(Symbol::Coefficient(id.position()));
                sum.push(system.graph.multiply(coefficient, term));
            }
            system.graph.sum(&sum)
        };
        Ok(ModuleParts {
            kinetic: part(Place::Kinetic, export.system().kinetic),
            potential: part(Place::Potential, export.system().potential),
            rest: part(Place::Hamiltonian, export.system().hamiltonian),
            forces: system.force(export.law.support())?,
        })
    }
}

fn functions(model: &Model) -> String {
    let names: Vec<&str> = model.functions().iter().map(|f| f.row().sympy).collect();
    if names.is_empty() {
        String::new()
    } else {
        format!("from sympy import {}\n", names.join(", "))
    }
}

fn symbol_list(variables: &[Variable]) -> String {
    variables
        .iter()
        .map(|variable| {
            let unit =
                variable.unit_text.as_ref().map(|unit| format!("  # {}", python_comment(unit)));
            let name = literal(&variable.name);
            format!("    sympy.Symbol({name}, real=True),{}\n", unit.unwrap_or_default())
        })
        .collect()
}

/// Text of the mini-language in Python: `^` is `**`, and functions have SymPy's names.
fn translate(text: &str, time: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        if c.is_ascii_alphabetic() || c == '_' {
            let length =
                rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(rest.len());
            let (word, behind) = rest.split_at(length);
            match Function::by_name(word).filter(|_| behind.starts_with('(')) {
                Some(function) => out += function.row().sympy,
                None if word == "t" => out += time,
                None => out += word,
            }
            rest = behind;
        } else if c.is_ascii_digit() {
            // A number as a whole: its `e` is no name.
            let length = rest
                .char_indices()
                .find(|&(i, c)| {
                    let exponent_sign = c == '-' && rest[..i].ends_with('e');
                    !(c.is_ascii_digit() || c == '.' || c == 'e' || exponent_sign)
                })
                .map_or(rest.len(), |(i, _)| i);
            out += &rest[..length];
            rest = &rest[length..];
        } else {
            if c == '^' {
                out += "**"
            } else {
                out.push(c)
            }
            rest = &rest[c.len_utf8()..];
        }
    }
    out
}
