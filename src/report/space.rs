//! A function space as text for people.

use std::fmt::Write;

use comfy_table::{CellAlignment, ContentArrangement, Table, presets};

use crate::expr::{FunctionSpace, SpaceVariable};

impl FunctionSpace {
    /// As text for people; `width` columns wide at most.
    pub fn text(&self, width: u16) -> String {
        let mut out = format!("{}\n", self.system);
        let lists = [
            ("coordinates", &self.coordinates),
            ("momenta", &self.momenta),
            ("velocities", &self.velocities),
        ];
        for (title, list) in lists {
            if list.is_empty() {
                continue;
            }
            let one = |v: &SpaceVariable| match &v.unit {
                Some(unit) => format!("{} [{unit}]", v.name),
                None => v.name.clone(),
            };
            let _ =
                writeln!(out, "  {title}: {}", list.iter().map(one).collect::<Vec<_>>().join(", "));
        }
        for input in &self.inputs {
            let unit = input.unit.as_ref().map(|unit| format!(" [{unit}]")).unwrap_or_default();
            let between = input.between_samples.replace('_', "-");
            let _ = writeln!(out, "  input: {}{unit}, {between} between samples", input.name);
        }
        for measure in &self.measures {
            let unit = measure.unit.as_ref().map(|unit| format!(" [{unit}]")).unwrap_or_default();
            let turns = if measure.period.is_some() { ", whole turns aside" } else { "" };
            let _ =
                writeln!(out, "  measure: {}{unit} = {}{turns}", measure.name, measure.expression);
        }
        if let Some(unit) = &self.energy_unit {
            let _ = writeln!(out, "  unit of H: [{unit}]");
        }
        if !self.known.is_empty() {
            out.push_str("\nknown\n");
            for part in &self.known {
                let _ = writeln!(out, "  {} = {}", part.place, part.expression);
            }
        }
        let _ = writeln!(out, "\nlearned: {} terms", self.terms.len());
        if !self.terms.is_empty() {
            let with_units = self.terms.iter().any(|term| term.unit.is_some());
            let with_bounds = self.terms.iter().any(|term| !term.bounds.is_empty());
            let with_effects = self.terms.iter().any(|term| term.effect.is_some());
            let mut table = plain_table(width);
            let mut header = vec!["", "coefficient", "term"];
            header.extend(with_units.then_some("unit"));
            header.extend(with_bounds.then_some("bounds"));
            header.extend(with_effects.then_some("effect"));
            table.set_header(header);
            for term in &self.terms {
                let mut row = vec![term.place.clone(), term.name.clone(), term.label.clone()];
                row.extend(with_units.then(|| term.unit.clone().unwrap_or_default()));
                row.extend(with_bounds.then(|| term.bounds.clone()));
                row.extend(with_effects.then(|| term.effect.clone().unwrap_or_default()));
                table.add_row(row);
            }
            push_table(&mut out, &table);
        }
        if !self.parameters.is_empty() {
            out.push_str("\nparameters\n");
            let mut table = plain_table(width);
            let with_groups = self.parameters.iter().any(|parameter| parameter.per.is_some());
            let mut header = vec!["", "start", "unit", "bounds"];
            header.extend(with_groups.then_some("one for each"));
            table.set_header(header);
            for parameter in &self.parameters {
                let starts: Vec<String> = parameter.starts.iter().map(f64::to_string).collect();
                let mut row = vec![parameter.name.clone(), starts.join(", ")];
                row.push(parameter.unit.clone().unwrap_or_default());
                row.push(parameter.bounds.clone());
                row.extend(with_groups.then(|| parameter.per.clone().unwrap_or_default()));
                table.add_row(row);
            }
            push_table(&mut out, &table);
        }
        if !self.couplings.is_empty() {
            out.push_str("\ncouplings\n");
            for sentence in &self.couplings {
                let _ = writeln!(out, "  - {sentence}");
            }
        }
        out.push_str("\ncannot be learned\n");
        for sentence in &self.cannot_be_learned {
            let _ = writeln!(out, "  - {sentence}");
        }
        out
    }
}

fn plain_table(width: u16) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_content_arrangement(ContentArrangement::Dynamic);
    table.set_width(width);
    if let Some(column) = table.column_mut(0) {
        column.set_cell_alignment(CellAlignment::Left);
    }
    table
}

fn push_table(out: &mut String, table: &Table) {
    for line in table.to_string().lines() {
        let _ = writeln!(out, "  {}", line.trim_end());
    }
}
