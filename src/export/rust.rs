//! A standalone simulator: a Cargo project without dependencies.
//!
//! What does not depend on the model stands in `templates/simulator` as it is written out.

use std::fmt::Write;

use super::code::{self, Dialect, number};
use super::escape::{rust_doc as doc, rust_string as literal};
use super::model::{Identifiers, Model, identifier};
use super::number::with_uncertainty;
use super::{Export, IntegratorKind, Output};
use crate::dynamics::Tableau;
use crate::error::Result;
use crate::expr::{Expr, FUNCTIONS, Function, Symbol};

const DIALECT: Dialect = Dialect { apply, whole_power, power };

const MAIN: &str = include_str!("templates/simulator/main.rs.txt");
const INPUTS: &str = include_str!("templates/simulator/inputs.rs.txt");
const TESTS: &str = include_str!("templates/simulator/checks.rs.txt");
const SPLITTING: &str = include_str!("templates/simulator/splitting.rs.txt");
const IMPLICIT: &str = include_str!("templates/simulator/implicit.rs.txt");
const EXPLICIT: &str = include_str!("templates/simulator/explicit.rs.txt");

/// Words of Rust, and names that the generated code uses itself; those of functions stand in
/// their rows.
const KEYWORDS: &[&str] = &[
    "as",
    "async",
    "await",
    "break",
    "const",
    "continue",
    "crate",
    "dyn",
    "else",
    "enum",
    "extern",
    "false",
    "fn",
    "for",
    "gen",
    "if",
    "impl",
    "in",
    "let",
    "loop",
    "match",
    "mod",
    "move",
    "mut",
    "pub",
    "ref",
    "return",
    "self",
    "static",
    "struct",
    "super",
    "trait",
    "true",
    "type",
    "unsafe",
    "use",
    "where",
    "while",
    "abstract",
    "become",
    "box",
    "do",
    "final",
    "macro",
    "override",
    "priv",
    "try",
    "typeof",
    "unsized",
    "virtual",
    "yield",
    "qs",
    "ps",
    "time",
    "input",
    "out",
    "_",
    "NAME",
    "DEGREES",
    "SIZE",
    "COORDINATES",
    "MOMENTA",
    "TIME",
    "STEP",
    "START",
    "START_TIME",
    "METHOD",
    "ORDER",
    "SYMMETRIC",
    "CONSERVATIVE",
    "SMOOTH",
];

/// Names that a symbol of the model must not have. Methods of f64 are not among them.
fn reserved() -> impl Iterator<Item = &'static str> {
    let defined = FUNCTIONS.iter().filter(|row| row.rust.definition.is_some());
    KEYWORDS.iter().copied().chain(defined.map(|row| row.rust.name))
}

fn apply(function: Function, argument: &str, atom: bool) -> String {
    let target = function.row().rust;
    match target.definition {
        Some(_) => format!("{}({argument})", target.name),
        None => call(target.name, argument, "", atom),
    }
}

fn whole_power(base: &str, exponent: i32, atom: bool) -> String {
    call("powi", base, &exponent.to_string(), atom)
}

fn power(base: &str, exponent: &str, atom: bool) -> String {
    call("powf", base, exponent, atom)
}

/// A method of f64; a bare number has no type of its own to call it on.
fn call(method: &str, on: &str, with: &str, atom: bool) -> String {
    if on.trim_start_matches('-').parse::<f64>().is_ok() {
        let comma = if with.is_empty() { "" } else { ", " };
        format!("f64::{method}({on}{comma}{with})")
    } else if atom {
        format!("{on}.{method}({with})")
    } else {
        format!("({on}).{method}({with})")
    }
}

/// Writes the project.
pub(super) fn export(export: &Export) -> Result<Output> {
    let model = Model::new(export)?;
    let package = package_name(&export.system().name);
    let own = format!("{package}::");
    let integrator = match &export.integrator.kind {
        IntegratorKind::Splitting { weights } => {
            SPLITTING.replace("const WEIGHTS: [f64; 0] = [];", &array("WEIGHTS", weights))
        }
        IntegratorKind::Implicit(tableau) => with_tableau(IMPLICIT, tableau),
        IntegratorKind::Explicit(tableau) => with_tableau(EXPLICIT, tableau),
    };
    let lib = format!(
        "//! Equations of motion and integrator of a model that was learned from measurements.\n//!\n{}\n\
         {}pub mod integrator;\npub mod model;\n",
        comment("//! ", &export.provenance.lines()),
        if export.system().inputs.is_empty() { "" } else { "pub mod inputs;\n" },
    );
    let mut files = vec![
        ("Cargo.toml", manifest(&package)),
        (".cargo/config.toml", FLAGS.to_string()),
        ("src/lib.rs", lib),
        ("src/model.rs", model_file(export, &model)),
        ("src/integrator.rs", integrator),
        ("src/main.rs", main_file(export).replace("simulator::", &own)),
        ("tests/checks.rs", checks(export, &own)),
    ];
    if !export.system().inputs.is_empty() {
        files.push(("src/inputs.rs", inputs_file(export)));
    }
    Ok(Output::Files(files.into_iter().map(|(path, text)| (path.to_string(), text)).collect()))
}

/// The last line of the program's help, and the same behind one on inputs.
const LAST_OPTION: &str = r#"         \x20 --help               this text\n","#;
const INPUT_OPTION: &str = r#"         \x20 --inputs FILE        what drives the motion: times, then {inputs},\n\
         \x20                      separated by commas, with a header\n\
         \x20 --help               this text\n","#;

/// The program, which reads what drives the motion where something does.
fn main_file(export: &Export) -> String {
    if export.system().inputs.is_empty() {
        return MAIN.to_string();
    }
    let mut text = MAIN
        .replace("use simulator::integrator", "use simulator::inputs;\nuse simulator::integrator");
    text = text.replace(LAST_OPTION, INPUT_OPTION);
    text = text.replace(
        "        name = model::NAME,\n",
        "        name = model::NAME,\n        inputs = inputs::INPUTS.join(\", \"),\n",
    );
    text = text.replace(
        "            \"--energy-bound\",\n        ];",
        "            \"--energy-bound\",\n            \"--inputs\",\n        ];",
    );
    text.replace(
        "            \"--t0\" =>",
        "            \"--inputs\" => inputs::read(&value).map_err(Failure::Usage)?,\n            \"--t0\" =>",
    )
}

/// What drives the motion: its names, and what reads it.
fn inputs_file(export: &Export) -> String {
    let inputs = &export.system().inputs;
    let count = inputs.len();
    let names = literals(inputs.iter().map(|input| match &input.variable.unit_text {
        Some(unit) => format!("{} [{unit}]", input.variable.name),
        None => input.variable.name.clone(),
    }));
    let between = literals(inputs.iter().map(|input| input.between.keyword().to_string()));
    INPUTS
        .replace(
            "pub const INPUTS: [&str; 0] = [];",
            &format!("#[rustfmt::skip]\npub const INPUTS: [&str; {count}] = [\n{names}];"),
        )
        .replace(
            "pub const BETWEEN: [&str; 0] = [];",
            &format!("#[rustfmt::skip]\npub const BETWEEN: [&str; {count}] = [\n{between}];"),
        )
}

/// The project's tests, which know the internal states.
fn checks(export: &Export, own: &str) -> String {
    let system = export.system();
    let internal: Vec<String> = (0..system.degrees())
        .filter(|&i| system.internal(i).is_some())
        .map(|i| i.to_string())
        .collect();
    let tests = TESTS.replace("simulator::", own);
    if internal.is_empty() {
        return tests;
    }
    let (count, list) = (internal.len(), internal.join(", "));
    let array = format!("#[rustfmt::skip]\nconst INTERNAL: [usize; {count}] = [{list}];");
    tests.replace("const INTERNAL: [usize; 0] = [];", &array)
}

/// How the generated project is compiled.
const FLAGS: &str = "\
# The parts of a step follow one upon the other: to pack numbers of different parts into one
# register takes longer than it saves, a tenth of the time of a small system.
[build]
rustflags = [\"-C\", \"no-vectorize-slp\"]
";

fn manifest(package: &str) -> String {
    format!(
        "[package]\nname = \"{package}\"\nversion = \"0.1.0\"\nedition = \"2021\"\n\
         description = \"Simulates a model that was learned from measurements\"\n\
         publish = false\n\n# No dependencies: this builds wherever Rust is.\n[dependencies]\n\n\
         # The project stands alone even inside another one's folder.\n[workspace]\n"
    )
}

/// A name that Cargo takes for a package and Rust for a crate.
fn package_name(name: &str) -> String {
    let mut out = String::from("simulate");
    for word in name.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty()) {
        let word = identifier(word).to_ascii_lowercase();
        if out.len() + word.len() < 50 {
            let _ = write!(out, "_{word}");
        }
    }
    out
}

fn comment(start: &str, lines: &[String]) -> String {
    lines.iter().map(|line| format!("{start}{}\n", doc(line))).collect()
}

fn array(name: &str, values: &[f64]) -> String {
    let items: String = values.iter().map(|&x| format!("    {},\n", number(x))).collect();
    format!("#[rustfmt::skip]\nconst {name}: [f64; {}] = [\n{items}];", values.len())
}

fn with_tableau(template: &str, tableau: &Tableau) -> String {
    template
        .replace(
            "const STAGES: usize = 0;",
            &format!("const STAGES: usize = {};", tableau.weights.len()),
        )
        .replace("const MATRIX: [f64; 0] = [];", &array("MATRIX", tableau.matrix))
        .replace("const WEIGHTS: [f64; 0] = [];", &array("WEIGHTS", tableau.weights))
        .replace("const NODES: [f64; 0] = [];", &array("NODES", tableau.nodes))
}

fn literals(names: impl Iterator<Item = String>) -> String {
    names.map(|name| format!("    {},\n", literal(&name))).collect()
}

fn model_file(export: &Export, model: &Model) -> String {
    let system = export.system();
    let n = system.degrees();
    let names = Identifiers::new(export, model, reserved(), true);
    let (start_time, start) = export.start_or_default();
    let mut out = format!("//! The model {}.\n//!\n", doc(&system.name));
    out += "//! dq/dt = dH/dp and dp/dt = F - dH/dq.\n\n";
    if !model.inputs.is_empty() {
        out += "use crate::inputs::input;\n\n";
    }
    let _ = writeln!(
        out,
        "/// What the model is called.\npub const NAME: &str = {};",
        literal(&system.name)
    );
    let _ = writeln!(out, "/// Degrees of freedom.\npub const DEGREES: usize = {n};");
    out += "/// Components of the state: q, then p.\npub const SIZE: usize = 2 * DEGREES;\n";
    for (what, name, variables) in [
        ("Names of the coordinates.", "COORDINATES", &system.coordinates),
        ("Names of the momenta.", "MOMENTA", &system.momenta),
    ] {
        let items = literals(variables.iter().map(|variable| match &variable.unit_text {
            Some(unit) => format!("{} [{unit}]", variable.name),
            None => variable.name.clone(),
        }));
        let _ = write!(
            out,
            "/// {what}\n#[rustfmt::skip]\npub const {name}: [&str; DEGREES] = [\n{items}];\n"
        );
    }
    let _ = writeln!(
        out,
        "/// Name of the time.\npub const TIME: &str = {};",
        literal(&system.time.name)
    );
    let _ = writeln!(
        out,
        "/// Step of the integrator that the model was fitted with.\npub const STEP: f64 = {};",
        number(export.step())
    );
    let items: String = start.iter().map(|&x| format!("    {},\n", number(x))).collect();
    let _ = writeln!(
        out,
        "/// A typical start.\n#[rustfmt::skip]\npub const START: [f64; SIZE] = [\n{items}];"
    );
    let _ = writeln!(
        out,
        "/// Time of the start.\npub const START_TIME: f64 = {};",
        number(start_time)
    );
    let integrator = &export.integrator;
    let _ = writeln!(
        out,
        "/// Name of the integrator.\npub const METHOD: &str = {};",
        literal(&integrator.name)
    );
    let _ =
        writeln!(out, "/// Order of the integrator.\npub const ORDER: u32 = {};", integrator.order);
    let symmetric = !matches!(integrator.kind, IntegratorKind::Explicit(_));
    let _ = writeln!(
        out,
        "/// A step forward and the same step backward cancel.\npub const SYMMETRIC: bool = {symmetric};"
    );
    let _ = writeln!(
        out,
        "/// The energy is a constant of the motion.\npub const CONSERVATIVE: bool = {};",
        model.conservative
    );
    let _ = writeln!(
        out,
        "/// The equations have no jump or kink.\npub const SMOOTH: bool = {};\n",
        model.smooth
    );
    for constant in &model.constants {
        let unit = constant.unit.as_ref().map(|unit| format!(" [{unit}]"));
        let value = with_uncertainty(constant.value, constant.standard_error);
        let about = format!("{}: {value}{}", constant.meaning, unit.unwrap_or_default());
        let _ = writeln!(
            out,
            "/// {}\npub const {}: f64 = {};",
            doc(&about),
            names.of(constant.symbol),
            number(constant.value),
        );
    }
    if !model.constants.is_empty() {
        out.push('\n');
    }
    for definition in model.functions().iter().filter_map(|f| f.row().rust.definition) {
        out += definition;
        out.push('\n');
    }
    let functions = Functions { model, names: &names };
    out += &functions.scalar("The energy H.", "energy", model.energy);
    out += &functions.scalar(
        "What the energy changes by in time: power of the forces outside H, and dH/dt.",
        "power",
        model.power,
    );
    out += &functions.vector("Velocities dq/dt = dH/dp.", "velocity", "DEGREES", &model.velocities);
    out += &functions.vector("dp/dt = F - dH/dq.", "acceleration", "DEGREES", &model.accelerations);
    out += &functions.vector(
        "Forces F outside the energy.",
        "outside_force",
        "DEGREES",
        &model.forces,
    );
    if matches!(integrator.kind, IntegratorKind::Implicit(_)) {
        out += &functions.vector(
            "Derivatives of dq/dt, dp/dt by q, p: row after row.",
            "jacobian",
            "SIZE * SIZE",
            &model.jacobian,
        );
    }
    out.truncate(out.trim_end().len());
    out.push('\n');
    out
}

struct Functions<'a> {
    model: &'a Model,
    names: &'a Identifiers,
}

impl Functions<'_> {
    /// The lines of a function's body before its outputs, and its head's arguments.
    fn start(&self, body: &code::Body) -> (String, String) {
        let has = |kind: fn(&Symbol) -> bool| body.variables.iter().any(kind);
        let underscore = |used: bool| if used { "" } else { "_" };
        let q = underscore(has(|s| matches!(s, Symbol::Coordinate(_))));
        let p = underscore(has(|s| matches!(s, Symbol::Momentum(_))));
        let t = underscore(has(|s| s.is_of_time()));
        let arguments = format!("{q}qs: &[f64; DEGREES], {p}ps: &[f64; DEGREES], {t}time: f64");
        let mut lines = String::new();
        for &symbol in &body.variables {
            let name = self.names.of(symbol);
            let _ = match symbol {
                Symbol::Coordinate(i) => writeln!(lines, "    let {name} = qs[{i}];"),
                Symbol::Momentum(i) => writeln!(lines, "    let {name} = ps[{i}];"),
                Symbol::Delayed(i, order, by) => {
                    let by = self.names.delay(by);
                    writeln!(lines, "    let {name} = input({i}, {order}, time - {by});")
                }
                Symbol::Input(i, order) => {
                    writeln!(lines, "    let {name} = input({i}, {order}, time);")
                }
                _ => writeln!(lines, "    let {name} = time;"),
            };
        }
        for (name, text) in &body.locals {
            let _ = writeln!(lines, "    let {name} = {text};");
        }
        (arguments, lines)
    }

    fn scalar(&self, meaning: &str, name: &str, expr: Expr) -> String {
        let body = code::body(self.model, self.names, &DIALECT, &[expr]);
        let (arguments, lines) = self.start(&body);
        let value = body.outputs.concat();
        format!("/// {meaning}\npub fn {name}({arguments}) -> f64 {{\n{lines}    {value}\n}}\n\n")
    }

    fn vector(&self, meaning: &str, name: &str, size: &str, exprs: &[Expr]) -> String {
        let body = code::body(self.model, self.names, &DIALECT, exprs);
        let (arguments, lines) = self.start(&body);
        let mut values = String::new();
        // What is zero everywhere stays as it was made.
        for (i, value) in body.outputs.iter().enumerate().filter(|(_, value)| *value != "0.0") {
            let _ = writeln!(values, "    out[{i}] = {value};");
        }
        let head = format!("pub fn {name}({arguments}) -> [f64; {size}] {{");
        let head = if head.len() <= 100 {
            head
        } else {
            let arguments = arguments.replace(", ", ",\n    ");
            format!("pub fn {name}(\n    {arguments},\n) -> [f64; {size}] {{")
        };
        if values.is_empty() {
            return format!("/// {meaning}\n{head}\n    [0.0; {size}]\n}}\n\n");
        }
        format!(
            "/// {meaning}\n{head}\n{lines}    let mut out = [0.0; {size}];\n{values}    out\n}}\n\n"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_of_bare_numbers_name_their_type() {
        assert_eq!(call("ln", "0.0", "", true), "f64::ln(0.0)");
        assert_eq!(call("powf", "-2.0", "0.5", false), "f64::powf(-2.0, 0.5)");
        assert_eq!(call("sin", "1e-7", "", true), "f64::sin(1e-7)");
        assert_eq!(call("sin", "x", "", true), "x.sin()");
        assert_eq!(call("sin", "1.0 + x", "", false), "(1.0 + x).sin()");
    }

    #[test]
    fn packages_have_names_that_cargo_takes() {
        assert_eq!(package_name("Hénon-Heiles, 2"), "simulate_henon_heiles_x2");
        assert_eq!(package_name("\"\"/*"), "simulate");
        assert!(package_name(&"long ".repeat(50)).len() < 60);
    }
}
