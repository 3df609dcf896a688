//! Equations as LaTeX: a fragment, and a document that compiles.

use std::collections::HashMap;
use std::fmt::Write;

use super::escape::plain_latex as text;
use super::letters;
use super::model::Model;
use super::number::Measured;
use super::tex::TexWriter;
use super::{Export, Output};
use crate::error::Result;
use crate::expr::{Expr, Graph, Measure, Names, Place, Symbol, System};

/// Values of a number that runs have for themselves; all are in the model file.
const VALUES: usize = 80;

/// One equation, its right side in as many lines as it needs.
pub(super) struct Equation {
    pub left: String,
    pub right: Vec<String>,
}

/// The equations as people read them: T, V, H, the forces, then the equations of motion.
pub(super) fn equations(export: &Export) -> Result<Vec<Equation>> {
    // A model that does not belong to its spec is an error here as in every other format.
    Model::new(export)?;
    let system = export.system();
    let pretty = export.pretty;
    let mut graph: Graph = pretty.graph.clone();
    let names = Names { coefficients: Vec::new(), ..system.names() };
    let n = system.degrees();
    let zero = graph.number(0.0);
    let part = |place| pretty.part(place).unwrap_or(zero);
    let kinetic = part(Place::Kinetic);
    let potential = part(Place::Potential);
    let rest = part(Place::Hamiltonian);
    let energy = graph.sum(&[kinetic, potential, rest]);
    let forces: Vec<Expr> = (0..n).map(|i| part(Place::Force(i))).collect();
    let gradient = graph.gradient(energy, &system.state());
    let slopes: Vec<Expr> = (0..n).map(|i| graph.subtract(forces[i], gradient[i])).collect();
    let learned = (0..system.parameters.len()).map(Symbol::Parameter);
    let learned: HashMap<Symbol, f64> =
        learned.zip(export.law.parameters().iter().copied()).collect();
    let constraints: Vec<Expr> = (system.constraints.iter())
        .map(|constraint| graph.import(&system.graph, constraint.expr, &learned))
        .collect();
    let coordinates = &system.state()[..n];
    let normals: Vec<Vec<Expr>> =
        constraints.iter().map(|&constraint| graph.gradient(constraint, coordinates)).collect();

    let writer = TexWriter { graph: &graph, names: &names, numbers: &pretty.numbers };
    let equation = |left: String, expr| Equation { left, right: writer.lines(expr) };
    let mut out = Vec::new();
    let split = !writer.graph.is_zero(kinetic) || !writer.graph.is_zero(potential);
    if split {
        out.push(equation("T".to_string(), kinetic));
        out.push(equation("V".to_string(), potential));
        if writer.graph.is_zero(rest) {
            out.push(Equation { left: "H".to_string(), right: vec!["T + V".to_string()] });
        } else {
            let mut right = writer.lines(rest);
            let sign = if right[0].starts_with('-') { " " } else { " + " };
            right[0] = format!("T + V{sign}{}", right[0]);
            out.push(Equation { left: "H".to_string(), right });
        }
    } else {
        out.push(equation("H".to_string(), rest));
    }
    let variable = |symbol| letters::name(&names.of(symbol));
    for (i, &force) in forces.iter().enumerate().filter(|(_, f)| !writer.graph.is_zero(**f)) {
        out.push(equation(format!("F_{{{}}}", variable(Symbol::Coordinate(i))), force));
    }
    for i in 0..n {
        let law = system.internal(i).map(|_| part(Place::Rate(i))).unwrap_or(gradient[n + i]);
        out.push(equation(letters::dotted(&names.of(Symbol::Coordinate(i))), law));
    }
    for (i, &slope) in slopes.iter().enumerate() {
        if system.internal(i).is_some() {
            continue;
        }
        let mut moved = equation(letters::dotted(&names.of(Symbol::Momentum(i))), slope);
        for (j, of) in normals.iter().enumerate().filter(|(_, of)| !graph.is_zero(of[i])) {
            let multiplier = multiplier(j, normals.len());
            moved.right.push(format!("+ {multiplier} \\left({}\\right)", writer.expression(of[i])));
        }
        out.push(moved);
    }
    for &constraint in &constraints {
        out.push(equation("0".to_string(), constraint));
    }
    // The instrument comes last: it moves nothing.
    for (i, name) in system.observables().iter().enumerate() {
        if let Some(expr) = pretty.part(Place::Sensor(i)) {
            let name = letters::name(name);
            let mut right = writer.lines(expr);
            let sign = if right[0].starts_with('-') { " " } else { " + " };
            right[0] = format!("{name}{sign}{}", right[0]);
            out.push(Equation { left: format!("{name}_{{\\mathrm{{measured}}}}"), right });
        }
    }
    out.extend(system.measures.iter().map(|measure| equation_of(measure, system, &names)));
    Ok(out)
}

/// The Lagrange multiplier of a constraint, one of so many.
fn multiplier(which: usize, of: usize) -> String {
    if of == 1 { "\\lambda".to_string() } else { format!("\\lambda_{{{}}}", which + 1) }
}

/// What a column shows, with dots for rates.
fn equation_of(measure: &Measure, system: &System, names: &Names) -> Equation {
    let writer = TexWriter { graph: &system.graph, names, numbers: &[] };
    let right = match (measure.direction, measure.on_curve) {
        (Some([y, x]), _) => {
            let (y, x) = (writer.expression(y), writer.expression(x));
            vec![format!("\\operatorname{{atan2}}({y}, {x})")]
        }
        (None, Some(expr)) => writer.lines(expr),
        (None, None) => vec![format!("\\texttt{{{}}}", text(&measure.text))],
    };
    Equation { left: letters::name(&measure.variable.name), right }
}

/// Writes the equations as one `align*` of amsmath.
pub(super) fn fragment(export: &Export) -> Result<Output> {
    Ok(Output::Text(align(&equations(export)?)))
}

fn align(equations: &[Equation]) -> String {
    let rows: Vec<String> = equations
        .iter()
        .map(|equation| {
            let right = equation.right.join(" \\\\\n    &");
            format!("{} &= {right}", equation.left)
        })
        .collect();
    format!("\\begin{{align*}}\n{}\n\\end{{align*}}\n", rows.join(" \\\\\n"))
}

/// Writes a whole document.
pub(super) fn document(export: &Export) -> Result<Output> {
    let model = Model::new(export)?;
    let system = export.system();
    let mut out = String::from(
        "\\documentclass{article}\n\\usepackage[T1]{fontenc}\n\\usepackage[utf8]{inputenc}\n\
         \\usepackage{amsmath}\n\\usepackage[margin=25mm]{geometry}\n\\allowdisplaybreaks\n\
         \\begin{document}\n",
    );
    let title = if system.name.is_empty() { "A learned model" } else { &system.name };
    let _ = writeln!(out, "\\section*{{{}}}\n", text(title));
    out += &align(&equations(export)?);
    for note in &export.pretty.notes {
        let _ = writeln!(out, "\n\\noindent {}", text(note));
    }
    if !model.constants.is_empty() {
        out += "\n\\subsection*{Learned numbers}\n\n\\noindent Digits in parentheses are the standard error of the last digits";
        out += "; a question mark stands for one that is unknown.\n\n";
        let names = system.names();
        let rows: Vec<[String; 4]> = model
            .constants
            .iter()
            .map(|constant| {
                let measured = Measured::new(constant.value, constant.standard_error);
                let meaning = match constant.symbol {
                    Symbol::Coefficient(k) => {
                        let graph = &system.graph;
                        let writer = TexWriter { graph, names: &names, numbers: &[] };
                        format!("${}$", writer.expression(system.terms[k].expr))
                    }
                    _ => text(&constant.meaning),
                };
                [
                    format!("${}$", letters::name(&constant.name)),
                    format!("${}$", measured.tex()),
                    constant.unit.as_deref().map(text).unwrap_or_default(),
                    meaning,
                ]
            })
            .collect();
        out += &table("llll", &["", "value", "unit", "term"], &rows);
    }
    for found in export.law.distributions() {
        let rows: Vec<[String; 3]> = (found.values.iter().take(VALUES))
            .map(|value| {
                let number = match value.is_determined() {
                    true => format!("${}$", Measured::new(value.value, value.standard_error).tex()),
                    false => "not determined".to_string(),
                };
                [text(&value.group), number, found.unit.as_deref().map(text).unwrap_or_default()]
            })
            .collect();
        let (per, name) = (text(&found.per), letters::name(&found.name));
        let _ = write!(out, "\n\\subsection*{{Values of ${name}$ of each {per}}}\n\n");
        out += &table("lll", &["", "value", "unit"], &rows);
        if let Some(more) = found.values.len().checked_sub(VALUES).filter(|more| *more > 0) {
            let _ = writeln!(out, "\n\\noindent {more} more are in the model file.");
        }
    }
    let mut snapped: Vec<&str> =
        export.pretty.numbers.iter().filter_map(|number| number.snapped.as_deref()).collect();
    snapped.sort_unstable();
    snapped.dedup();
    if !snapped.is_empty() {
        let _ = writeln!(
            out,
            "\n\\noindent Learned numbers within their uncertainty of a nice one are written so: {}.",
            text(&snapped.join(", "))
        );
    }
    let noise = export.noise();
    if !noise.is_empty() {
        out += "\n\\subsection*{Noise}\n\n";
        let rows: Vec<[String; 2]> = noise
            .iter()
            .filter(|(_, deviation)| deviation.is_finite())
            .map(|(name, deviation)| {
                let (digits, exponent) = super::number::significant(*deviation, 3);
                let measured = Measured { digits, uncertainty: None, exponent };
                [format!("${}$", letters::name(name)), format!("${}$", measured.tex())]
            })
            .collect();
        out += &table("ll", &["", "standard deviation"], &rows);
    }
    out += "\n\\subsection*{Origin}\n\n{\\footnotesize\n";
    let mut facts = export.provenance.lines();
    facts.push(format!(
        "integrated by {} (order {}), step {}",
        export.integrator.name,
        export.integrator.order,
        export.step()
    ));
    for fact in facts {
        let _ = writeln!(out, "\\noindent {}\\\\", text(&fact));
    }
    out += "}\n\\end{document}\n";
    Ok(Output::Text(out))
}

fn table<const N: usize>(columns: &str, head: &[&str; N], rows: &[[String; N]]) -> String {
    let mut out = String::new();
    // A page takes about forty rows; a table does not break by itself.
    for rows in rows.chunks(40) {
        let _ = writeln!(
            out,
            "\\noindent\\begin{{tabular}}{{{columns}}}\n{} \\\\ \\hline",
            head.join(" & ")
        );
        for row in rows {
            let _ = writeln!(out, "{} \\\\", row.join(" & "));
        }
        out += "\\end{tabular}\n\n";
    }
    out
}
