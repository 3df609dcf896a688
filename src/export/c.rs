//! The model and its integrator in C99.

use std::fmt::Write;

use super::code::{self, Dialect, number};
use super::escape::c_comment as comment;
use super::model::{Identifiers, Model};
use super::number::with_uncertainty;
use super::{Export, IntegratorKind, Output};
use crate::dynamics::Tableau;
use crate::error::Result;
use crate::expr::{Expr, FUNCTIONS, Function, Symbol};

const DIALECT: Dialect = Dialect { apply, whole_power, power };

const SPLITTING: &str = include_str!("templates/c/splitting.c.txt");
const IMPLICIT: &str = include_str!("templates/c/implicit.c.txt");
const EXPLICIT: &str = include_str!("templates/c/explicit.c.txt");
const EXAMPLE: &str = include_str!("templates/c/example.c.txt");

/// Words of C, and names that the file uses itself; those of functions stand in their rows.
const KEYWORDS: &[&str] = &[
    "auto",
    "break",
    "case",
    "char",
    "const",
    "continue",
    "default",
    "do",
    "double",
    "else",
    "enum",
    "extern",
    "float",
    "for",
    "goto",
    "if",
    "inline",
    "int",
    "long",
    "register",
    "restrict",
    "return",
    "short",
    "signed",
    "sizeof",
    "static",
    "struct",
    "switch",
    "typedef",
    "union",
    "unsigned",
    "void",
    "volatile",
    "while",
    "pow",
    "qs",
    "ps",
    "time",
    "out",
    "solve",
    "evaluate",
    "jacobian",
    "is_finite_state",
    "main",
    "NAN",
    "INFINITY",
    "HUGE_VAL",
    "DEGREES",
    "SIZE",
    "STAGES",
    "UNKNOWNS",
    "PARTS",
    "WEIGHTS",
    "MATRIX",
    "NODES",
    "M_PI",
    "EOF",
    "NULL",
    "MODEL_H",
    "MODEL_DEGREES",
    "MODEL_STEP",
    "MODEL_INPUTS",
    "model_input",
    "FP_NAN",
    "FP_ZERO",
    "FP_INFINITE",
    "linux",
    "unix",
];

/// Names that a symbol of the model must not have.
fn reserved() -> impl Iterator<Item = &'static str> {
    KEYWORDS.iter().copied().chain(FUNCTIONS.iter().map(|row| row.c.name))
}

fn apply(function: Function, argument: &str, _: bool) -> String {
    format!("{}({argument})", function.row().c.name)
}

fn whole_power(base: &str, exponent: i32, _: bool) -> String {
    format!("pow({base}, {exponent}.0)")
}

fn power(base: &str, exponent: &str, _: bool) -> String {
    format!("pow({base}, {exponent})")
}

/// Writes `model.h`, `model.c` and `example.c`.
pub(super) fn export(export: &Export) -> Result<Output> {
    let model = Model::new(export)?;
    let files = [
        ("model.h", header(export)),
        ("model.c", source(export, &model)),
        ("example.c", example(export)),
    ];
    Ok(Output::Files(files.into_iter().map(|(path, text)| (path.to_string(), text)).collect()))
}

/// A program that simulates; what drives the motion is left to its user.
fn example(export: &Export) -> String {
    if export.system().inputs.is_empty() {
        return EXAMPLE.to_string();
    }
    let driving = "/* What drives the motion: nothing does yet. Put your own here. */\n\
        double model_input(int input, int order, double time) {\n    (void)input;\n    \
        (void)order;\n    (void)time;\n    return 0.0;\n}\n\nint main(";
    EXAMPLE.replacen("int main(", driving, 1)
}

fn header(export: &Export) -> String {
    let mut out = format!("/*\n * The model {}.\n *\n", comment(&export.system().name));
    for line in export.provenance.lines() {
        let _ = writeln!(out, " * {}", comment(&line));
    }
    out += " *\n * dq/dt = dH/dp and dp/dt = F - dH/dq.\n */\n#ifndef MODEL_H\n#define MODEL_H\n\n";
    let _ = writeln!(
        out,
        "/* Degrees of freedom. */\n#define MODEL_DEGREES {}",
        export.system().degrees()
    );
    let _ = writeln!(
        out,
        "/* Step of the integrator ({}) that the model was fitted with. */\n#define MODEL_STEP {}\n",
        comment(&export.integrator.name),
        number(export.step())
    );
    for (what, variables) in [("q", &export.system().coordinates), ("p", &export.system().momenta)]
    {
        for (i, variable) in variables.iter().enumerate() {
            let unit = variable.unit_text.as_ref().map(|u| format!(" [{u}]")).unwrap_or_default();
            let _ = writeln!(
                out,
                "/* {what}[{i}] is {}. */",
                comment(&(variable.name.clone() + &unit))
            );
        }
    }
    let inputs = &export.system().inputs;
    if !inputs.is_empty() {
        let _ = writeln!(out, "\n/* Inputs. */\n#define MODEL_INPUTS {}", inputs.len());
        for (i, input) in inputs.iter().enumerate() {
            let unit = input.variable.unit_text.as_ref();
            let unit = unit.map(|unit| format!(" [{unit}]")).unwrap_or_default();
            let name = input.variable.name.clone() + &unit;
            let between = input.between.keyword().replace('_', "-");
            let _ = writeln!(
                out,
                "/* Input {i} is {}, measured, and {between} between samples. */",
                comment(&name)
            );
        }
        out += "\n/* What drives the motion, a function of the program that uses this one: the value of an\n \
* input at a time, or its derivative by time of an order above 0. Where an input jumps, a step\n \
* should end. */\n\
double model_input(int input, int order, double time);\n";
    }
    out += "\n/* A typical start; returns its time. */\n\
double model_start(double q[MODEL_DEGREES], double p[MODEL_DEGREES]);\n\n\
/* The energy H. */\n\
double model_energy(const double qs[MODEL_DEGREES], const double ps[MODEL_DEGREES], double time);\n\n\
/* dq/dt. */\n\
void model_velocity(const double qs[MODEL_DEGREES], const double ps[MODEL_DEGREES], double time,\n\
                    double out[MODEL_DEGREES]);\n\n\
/* dp/dt. */\n\
void model_acceleration(const double qs[MODEL_DEGREES], const double ps[MODEL_DEGREES], double time,\n\
                        double out[MODEL_DEGREES]);\n\n\
/* Advances the state from time t by h; 0, or 1 when there is no finite result. */\n\
int model_step(double q[MODEL_DEGREES], double p[MODEL_DEGREES], double t, double h);\n\n\
#endif\n";
    out
}

fn source(export: &Export, model: &Model) -> String {
    let names = Identifiers::new(export, model, reserved(), true);
    let mut out = String::from(
        "#include \"model.h\"\n\n#include <math.h>\n\n#define DEGREES MODEL_DEGREES\n\n",
    );
    for constant in &model.constants {
        let unit = constant.unit.as_ref().map(|unit| format!(" [{unit}]")).unwrap_or_default();
        let _ = writeln!(
            out,
            "/* {}: {}{} */\n#define {} ({})",
            comment(&constant.meaning),
            with_uncertainty(constant.value, constant.standard_error),
            comment(&unit),
            names.of(constant.symbol),
            number(constant.value),
        );
    }
    out.push('\n');
    for definition in model.functions().iter().filter_map(|f| f.row().c.definition) {
        out += definition;
        out.push('\n');
    }
    let (time, start) = export.start_or_default();
    out += "double model_start(double q[DEGREES], double p[DEGREES]) {\n";
    let (q, p) = start.split_at(export.system().degrees());
    for (name, values) in [("q", q), ("p", p)] {
        for (i, &value) in values.iter().enumerate() {
            let _ = writeln!(out, "    {name}[{i}] = {};", number(value));
        }
    }
    let _ = writeln!(out, "    return {};\n}}\n", number(time));

    let body = FunctionBody { model, names: &names };
    out += &body.scalar("double model_energy", model.energy);
    out += &body.vector("void model_velocity", "DEGREES", &model.velocities);
    out += &body.vector("void model_acceleration", "DEGREES", &model.accelerations);
    if matches!(export.integrator.kind, IntegratorKind::Implicit(_)) {
        out += "/* Derivatives of dq/dt, dp/dt by q, p: row after row. */\n";
        out += &body.vector("static void jacobian", "4 * DEGREES * DEGREES", &model.jacobian);
    }
    out += "static int is_finite_state(const double q[DEGREES], const double p[DEGREES]) {\n    \
            int i;\n    for (i = 0; i < DEGREES; i++) {\n        \
            if (!isfinite(q[i]) || !isfinite(p[i])) {\n            return 0;\n        }\n    }\n    \
            return 1;\n}\n\n";
    out += &match &export.integrator.kind {
        IntegratorKind::Splitting { weights } => {
            let parts = format!("#define PARTS {}\n", weights.len());
            format!("{parts}{}\n{SPLITTING}", array("WEIGHTS", weights))
        }
        IntegratorKind::Implicit(tableau) => format!("{}\n{IMPLICIT}", arrays(tableau)),
        IntegratorKind::Explicit(tableau) => format!("{}\n{EXPLICIT}", arrays(tableau)),
    };
    out
}

fn array(name: &str, values: &[f64]) -> String {
    let items: String = values.iter().map(|&x| format!("    {},\n", number(x))).collect();
    format!("static const double {name}[{}] = {{\n{items}}};\n", values.len())
}

fn arrays(tableau: &Tableau) -> String {
    format!(
        "#define STAGES {}\n{}{}{}",
        tableau.weights.len(),
        array("MATRIX", tableau.matrix),
        array("WEIGHTS", tableau.weights),
        array("NODES", tableau.nodes)
    )
}

struct FunctionBody<'a> {
    model: &'a Model,
    names: &'a Identifiers,
}

impl FunctionBody<'_> {
    fn lines(&self, body: &code::Body) -> String {
        let has = |kind: fn(&Symbol) -> bool| body.variables.iter().any(kind);
        let mut lines = String::new();
        for &symbol in &body.variables {
            let name = self.names.of(symbol);
            let _ = match symbol {
                Symbol::Coordinate(i) => writeln!(lines, "    const double {name} = qs[{i}];"),
                Symbol::Momentum(i) => writeln!(lines, "    const double {name} = ps[{i}];"),
                Symbol::Delayed(i, order, by) => {
                    let by = self.names.delay(by);
                    writeln!(
                        lines,
                        "    const double {name} = model_input({i}, {order}, time - {by});"
                    )
                }
                Symbol::Input(i, order) => {
                    writeln!(lines, "    const double {name} = model_input({i}, {order}, time);")
                }
                _ => writeln!(lines, "    const double {name} = time;"),
            };
        }
        for (name, text) in &body.locals {
            let _ = writeln!(lines, "    const double {name} = {text};");
        }
        for (argument, used) in [
            ("qs", has(|s| matches!(s, Symbol::Coordinate(_)))),
            ("ps", has(|s| matches!(s, Symbol::Momentum(_)))),
            ("time", has(|s| s.is_of_time())),
        ] {
            if !used {
                let _ = writeln!(lines, "    (void){argument};");
            }
        }
        lines
    }

    fn scalar(&self, head: &str, expr: Expr) -> String {
        let body = code::body(self.model, self.names, &DIALECT, &[expr]);
        format!(
            "{head}(const double qs[DEGREES], const double ps[DEGREES], double time) {{\n{}    return {};\n}}\n\n",
            self.lines(&body),
            body.outputs.concat()
        )
    }

    fn vector(&self, head: &str, size: &str, exprs: &[Expr]) -> String {
        let body = code::body(self.model, self.names, &DIALECT, exprs);
        let mut lines = self.lines(&body);
        for (i, value) in body.outputs.iter().enumerate() {
            let _ = writeln!(lines, "    out[{i}] = {value};");
        }
        let indent = " ".repeat(head.len() + 1);
        format!(
            "{head}(const double qs[DEGREES], const double ps[DEGREES], double time,\n\
             {indent}double out[{size}]) {{\n{lines}}}\n\n"
        )
    }
}
