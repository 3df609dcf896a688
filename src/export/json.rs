//! Everything about a model, for programs. `docs/export-json.md` describes the format.

use serde_json::{Map, Value, json};

use super::model::Model;
use super::tex::TexWriter;
use super::{Export, IntegratorKind, Output};
use crate::dynamics::Tableau;
use crate::error::Result;
use crate::expr::{Expr, Graph, Names, Node, Place, Symbol, System, Variable};
use crate::fit::distribution::Distribution;

/// Name and version of the format.
pub(super) const FORMAT: &str = "leverrier.export/1";

/// Writes the model.
pub(super) fn export(export: &Export) -> Result<Output> {
    let model = Model::new(export)?;
    let system = export.system();
    let names = system.names();
    let learned: Vec<Value> = model
        .constants
        .iter()
        .map(|constant| {
            let mut entry = json!({
                "name": constant.name,
                "value": finite(constant.value),
                "standard_error": finite(constant.standard_error),
                "unit": constant.unit,
            });
            if let Symbol::Coefficient(k) = constant.symbol {
                let term = &system.terms[k];
                entry["term"] = json!(constant.meaning);
                entry["place"] = place(term.place, system, &names);
                entry["expression"] = expression(&system.graph, term.expr, &names, &[]);
            }
            let own = |found: &&Distribution| found.name == constant.name;
            if let (Symbol::Parameter(_), Some(found)) =
                (constant.symbol, export.law.distributions().iter().find(own))
            {
                entry["per"] = json!(found.per);
                entry["spread"] = json!(finite(found.spread));
                entry["values"] = json!(found.values);
            }
            entry
        })
        .collect();
    let (coefficients, parameters) = learned.split_at(export.law.support().len());
    let pretty_names = Names { coefficients: Vec::new(), ..names.clone() };
    let parts: Vec<Value> = export
        .pretty
        .parts
        .iter()
        .map(|&(at, expr)| {
            let graph = &export.pretty.graph;
            let mut entry = expression(graph, expr, &pretty_names, &export.pretty.numbers);
            entry["place"] = place(at, system, &names);
            entry
        })
        .collect();
    let numbers: Vec<Value> = export
        .pretty
        .numbers
        .iter()
        .enumerate()
        .map(|(j, number)| {
            json!({
                "name": pretty_names.of(Symbol::Coefficient(j)),
                "value": finite(number.value),
                "standard_error": finite(number.standard_error),
                "snapped": number.snapped,
            })
        })
        .collect();
    let plain = |expr| expression(&model.graph, expr, &names, &[]);
    let list = |exprs: &[Expr]| -> Vec<Value> { exprs.iter().map(|&expr| plain(expr)).collect() };
    let (start_time, start) = export.start_or_default();
    let provenance = &export.provenance;
    let source = |(name, hash): &(String, String)| json!({ "name": name, "sha256": hash });
    let value = json!({
        "format": FORMAT,
        "system": system.name,
        "coordinates": variables(&system.coordinates),
        "momenta": variables(&system.momenta),
        "measures": system.measures.iter().map(|measure| json!({
            "name": measure.variable.name,
            "unit": measure.variable.unit_text,
            "expression": measure.text,
            "period": measure.period,
        })).collect::<Vec<_>>(),
        "time": variables(std::slice::from_ref(&system.time))[0],
        "coefficients": coefficients,
        "parameters": parameters,
        "equations": {
            "energy": plain(model.energy),
            "forces": list(&model.forces),
            "velocities": list(&model.velocities),
            "accelerations": list(&model.accelerations),
            "conservative": model.conservative,
        },
        "readable": { "parts": parts, "numbers": numbers, "notes": export.pretty.notes },
        "integrator": integrator(export),
        "noise": export.noise().iter().map(|(name, deviation)| json!({
            "observable": name,
            "standard_deviation": finite(*deviation),
        })).collect::<Vec<_>>(),
        "start": { "time": start_time, "state": start },
        "provenance": {
            "leverrier": provenance.version,
            "spec": source(&provenance.spec),
            "data": provenance.data.as_ref().map(source),
            "seed": provenance.seed,
        },
    });
    Ok(Output::Text(format!("{value:#}\n")))
}

/// A number, or null where there is none.
fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

fn variables(variables: &[Variable]) -> Vec<Value> {
    variables
        .iter()
        .map(|variable| json!({ "name": variable.name, "unit": variable.unit_text }))
        .collect()
}

fn place(place: Place, system: &System, names: &Names) -> Value {
    match place {
        Place::Kinetic => json!("T"),
        Place::Potential => json!("V"),
        Place::Hamiltonian => json!("H"),
        Place::Force(i) => json!({ "force": names.of(Symbol::Coordinate(i)) }),
        Place::Rate(i) => json!({ "rate": names.of(Symbol::Coordinate(i)) }),
        Place::Sensor(i) => json!({ "sensor": system.observables().get(i) }),
    }
}

fn expression(graph: &Graph, expr: Expr, names: &Names, numbers: &[super::PrettyNumber]) -> Value {
    json!({
        "text": graph.text(expr, names),
        "tree": tree(graph, expr, names),
        "latex": TexWriter { graph, names, numbers }.expression(expr),
    })
}

fn tree(graph: &Graph, expr: Expr, names: &Names) -> Value {
    match graph.node(expr) {
        Node::Number(number) => json!({ "number": finite(number.value()) }),
        Node::Symbol(symbol) => json!({ "symbol": names.of(*symbol) }),
        Node::Sum { constant, terms } => {
            let terms: Vec<Value> = terms
                .iter()
                .map(|&(term, factor)| {
                    json!({ "factor": finite(factor.value()), "of": tree(graph, term, names) })
                })
                .collect();
            json!({ "sum": terms, "constant": finite(constant.value()) })
        }
        Node::Product(parts) => {
            let parts: Vec<Value> = parts
                .iter()
                .map(|&(base, exponent)| {
                    json!({ "base": tree(graph, base, names), "exponent": exponent.value() })
                })
                .collect();
            json!({ "product": parts })
        }
        Node::Power(base, exponent) => {
            json!({ "power": tree(graph, *base, names), "exponent": tree(graph, *exponent, names) })
        }
        Node::Apply(function, argument) => {
            json!({ "function": function.row().name, "of": tree(graph, *argument, names) })
        }
    }
}

fn integrator(export: &Export) -> Value {
    let integrator = &export.integrator;
    let mut out = Map::new();
    out.insert("name".into(), json!(integrator.name));
    out.insert("order".into(), json!(integrator.order));
    out.insert("step".into(), json!(export.step()));
    let tableau = |tableau: &Tableau| json!({ "matrix": tableau.matrix, "weights": tableau.weights, "nodes": tableau.nodes });
    let (kind, value) = match &integrator.kind {
        IntegratorKind::Splitting { weights } => ("splitting", json!({ "weights": weights })),
        IntegratorKind::Implicit(t) => ("implicit", tableau(t)),
        IntegratorKind::Explicit(t) => ("explicit", tableau(t)),
    };
    out.insert(kind.into(), value);
    Value::Object(out)
}
