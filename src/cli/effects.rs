//! `leverrier effects`: the catalogue.

use clap::Args;
use serde_json::{Value, json};

use super::console::{Console, set, usage};
use crate::error::Result;
use crate::report::layout::{WIDTH, table, wrapped};
use crate::spec::effects::{ActsOn, EffectKind, EffectRow, Scene, by_name, catalogue, hint_for};

/// List the physical effects that a model may lack, or explain one.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier effects\n  \
    leverrier effects viscous_drag")]
pub(super) struct Arguments {
    /// The effect to explain.
    pub name: Option<String>,
}

/// Runs the command.
pub(super) fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    let width = console.width().map_or(WIDTH, |width| usize::from(width).max(40));
    if let Some(name) = &arguments.name {
        let row = by_name(name)
            .ok_or_else(|| usage(format!("there is no effect `{name}`"), hint_for(name, &[])))?;
        let mut object = json!({ "format": "leverrier.effects/1" });
        set(&mut object, "effect", about(row));
        return console.result(&explained(row, width), &object);
    }
    let mut sections = Vec::new();
    for kind in EffectKind::ALL {
        let rows: Vec<Vec<String>> = catalogue()
            .filter(|row| row.kind == kind)
            .map(|row| {
                vec![row.name.to_string(), row.on.text().to_string(), row.physics.to_string()]
            })
            .collect();
        sections.push(table(&[kind.text(), "on", "physics"], rows, &[], width));
    }
    sections.push(format!(
        "{} effects; `leverrier effects NAME` explains one, and the statement `effect NAME(q)` of \
         a spec adds one.",
        catalogue().count()
    ));
    let object = json!({
        "format": "leverrier.effects/1",
        "effects": catalogue().map(about).collect::<Vec<_>>(),
    });
    console.result(&sections.join("\n\n"), &object)
}

/// Its statements for variables q, p (and r, s; observables o, u), inner parameters by name.
fn formula(row: &EffectRow) -> String {
    let names = |all: &[&str]| all.iter().map(|name| (*name).to_string()).collect();
    let scene = Scene {
        coordinates: if row.on.is_of_bodies() {
            names(&["x1", "y1", "x2", "y2"])
        } else {
            names(&["q", "r"])
        },
        momenta: if row.on.is_of_bodies() {
            names(&["px1", "py1", "px2", "py2"])
        } else {
            names(&["p", "s"])
        },
        observables: names(&["o", "u"]),
        time: "t".into(),
        ..Scene::default()
    };
    let arguments = arguments(row);
    let mut text = row.filled(&scene, &arguments).unwrap_or_default();
    for scan in row.parameters {
        text = text.replace(&row.parameter_name(scan.name, &arguments), scan.name);
    }
    text.replace(&format!("{}: ", row.term_name(&arguments)), "")
}

fn example(row: &EffectRow) -> Option<String> {
    row.detector.is_none().then(|| row.statement(&arguments(row), &[]))
}

/// Arguments for examples.
fn arguments(row: &EffectRow) -> Vec<String> {
    let names: &[&str] = match row.on {
        ActsOn::Coordinate => &["q"],
        ActsOn::Driven => &["q", "u"],
        ActsOn::Pair | ActsOn::OrderedPair => &["q", "r"],
        ActsOn::Observable => &["o"],
        ActsOn::ObservablePair => &["o", "u"],
        ActsOn::Body => &["x1", "y1"],
        ActsOn::BodyPair => &["(x1, y1)", "(x2, y2)"],
    };
    names.iter().map(|name| (*name).to_string()).collect()
}

fn explained(row: &EffectRow, width: usize) -> String {
    let mut lines = vec![format!("{} ({}, on {})", row.name, row.kind.text(), row.on.text())];
    let mut line = |what: &str, text: &str| {
        if !text.is_empty() {
            lines.push(wrapped(&format!("{what}: {text}"), width, 4));
        }
    };
    line("also called", &row.aliases.join(", "));
    line("physics", row.physics);
    line("in data", row.telltale);
    line("formula", &formula(row));
    for scan in row.parameters {
        let unit = scan.by.unit_text(Some("q"), Some("p"), Some("t"), Some("u"));
        let unit = unit.map_or("a pure number".to_string(), |unit| format!("in units of {unit}"));
        line("inner parameter", &format!("{}, {unit}", scan.name));
    }
    line("in a spec", &example(row).unwrap_or_default());
    line("found by", row.detector.unwrap_or_default());
    line("needs", &needs(row).join("; "));
    line("reference", row.reference);
    lines.join("\n")
}

fn needs(row: &EffectRow) -> Vec<String> {
    let mut needs = vec![row.on.text().to_string()];
    if !row.why_two.is_empty() {
        needs.push(row.why_two.to_string());
    }
    if row.angle {
        needs.push("coordinates that are angles (pure numbers)".to_string());
    }
    if row.positive {
        needs.push("coefficients that are not negative".to_string());
    }
    needs
}

fn about(row: &EffectRow) -> Value {
    json!({
        "name": row.name,
        "aliases": row.aliases,
        "kind": row.kind.text(),
        "on": row.on.text(),
        "formula": formula(row),
        "example": example(row),
        "parameters": row.parameters.iter().map(|scan| json!({
            "name": scan.name,
            "unit": scan.by.unit_text(Some("q"), Some("p"), Some("t"), Some("u")),
            "example": scan.example,
        })).collect::<Vec<_>>(),
        "physics": row.physics,
        "telltale": row.telltale,
        "reference": row.reference,
        "needs": needs(row),
        "detector": row.detector,
    })
}
