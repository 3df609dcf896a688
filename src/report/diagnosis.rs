//! Comparison and diagnosis as text for people.

use serde::Serialize;

use super::layout::{WIDTH, table, wrapped};
use super::present;
use crate::diagnose::comparison::{Comparison, ResidualMap};
use crate::diagnose::diagnosis::{Diagnosis, RankedEffect, Verdict};
use crate::diagnose::discover::Discovery;
use crate::diagnose::times::times;
use crate::simplify::{significant, uncertain};

/// Maps that are drawn; the others have a row in the table.
const DRAWN: usize = 3;
/// p-value above which a map is not drawn.
const TELLING: f64 = 0.01;
/// Rows of the table of energies.
const RUNS: usize = 12;
/// Columns of a drawn force, on each side of zero.
const HALF: usize = 20;

/// Where a model fails. `how` says how the data were split, `terms` where the model comes from.
pub fn compare_text(
    comparison: &Comparison,
    how: &str,
    terms: &str,
    time_unit: &str,
    width: Option<u16>,
) -> String {
    let width = width.map_or(WIDTH, |width| usize::from(width).max(40));
    let mut sections = vec![wrapped(&format!("Split: {how} The model: {terms}."), width, 2)];
    let findings = comparison.findings.iter();
    sections.push(
        findings.map(|f| wrapped(&format!("- {f}"), width, 2)).collect::<Vec<_>>().join("\n"),
    );
    let duration =
        if time_unit.is_empty() { "time".to_string() } else { format!("time [{time_unit}]") };
    let rows = comparison.horizons.iter().map(|h| {
        vec![
            h.samples.to_string(),
            significant(h.duration, 4),
            times(h.training),
            h.held_out.map_or(String::new(), times),
            times(h.baseline),
            if h.diverged > 0 { format!("{} diverged", h.diverged) } else { String::new() },
        ]
    });
    let header = ["samples", duration.as_str(), "training", "held out", "persistence", ""];
    sections.push(format!(
        "Error by length of prediction, in units of the noise (1 is the noise floor):\n{}",
        table(&header, rows.collect(), &[0, 1, 2, 3, 4], width)
    ));
    let noise = comparison.noise_floor.iter();
    let of = |noise: &Option<f64>| match noise {
        Some(noise) => significant(*noise, 3),
        None => "not measured".to_string(),
    };
    let noise: Vec<String> = noise.map(|(name, noise)| format!("{name} {}", of(noise))).collect();
    sections.push(wrapped(&format!("Noise (standard deviation): {}.", noise.join(", ")), width, 2));
    let rows: Vec<Vec<String>> = comparison
        .energy
        .iter()
        .take(RUNS)
        .map(|e| {
            vec![
                e.run.clone(),
                significant(e.first, 4),
                significant(e.last, 4),
                uncertain(e.rate, e.rate_error, 4),
                if e.rate_error > 0.0 {
                    format!("{:.1}", e.rate / e.rate_error)
                } else {
                    String::new()
                },
            ]
        })
        .collect();
    if !rows.is_empty() {
        let header = ["run", "initial energy", "final energy", "dH/dt", "in standard errors"];
        let more = comparison.energy.len().saturating_sub(RUNS);
        let more = if more > 0 { format!("\n... and {more} more runs") } else { String::new() };
        sections.push(format!("{}{more}", table(&header, rows, &[1, 2, 3, 4], width)));
    }
    let mut maps: Vec<&ResidualMap> = comparison.maps.iter().collect();
    maps.sort_by(|a, b| a.p_value.total_cmp(&b.p_value).then(b.deviance.total_cmp(&a.deviance)));
    let rows = maps.iter().map(|map| {
        vec![
            map.on.clone(),
            map.against.clone(),
            format!("{:.1}", map.deviance),
            map.degrees.to_string(),
            p_value_text(map.p_value),
        ]
    });
    let header = ["force on", "as a function of", "deviance", "degrees of freedom", "p-value"];
    if !maps.is_empty() {
        sections.push(table(&header, rows.collect(), &[2, 3, 4], width));
    }
    // A map whose bands hold zero everywhere would only take up the screen.
    let telling = maps.iter().filter(|map| map.p_value < TELLING);
    sections.extend(telling.take(DRAWN).map(|map| drawn(map, width)));
    sections.retain(|section| !section.is_empty());
    sections.join("\n\n")
}

/// A map of the missing force with its bands of two standard errors.
fn drawn(map: &ResidualMap, width: usize) -> String {
    let known = || map.points.iter().filter(|p| p.1.is_finite() && p.2.is_finite());
    let most = known().fold(0.0, |most: f64, p| most.max(p.1.abs() + p.2));
    let rows: Vec<Vec<String>> = known()
        .map(|&(at, force, error)| {
            vec![significant(at, 3), uncertain(force, error, 4), bar(force, error, most)]
        })
        .collect();
    if rows.is_empty() {
        return String::new();
    }
    let title = format!("missing force on {} (o), and its band of two standard errors", map.on);
    table(&[map.against.as_str(), "force", title.as_str()], rows, &[0, 1], width.max(100))
}

/// `      |  --o--  `: zero, a value and its band, on a scale that reaches `most`.
fn bar(force: f64, error: f64, most: f64) -> String {
    let place = |x: f64| {
        let share = if most > 0.0 { (x / most).clamp(-1.0, 1.0) } else { 0.0 };
        (HALF as f64 * (1.0 + share)).round() as usize
    };
    let (low, at, high) = (place(force - 2.0 * error), place(force), place(force + 2.0 * error));
    let line: String = (0..=2 * HALF)
        .map(|i| match i {
            i if i == at => 'o',
            HALF => '|',
            i if (low..=high).contains(&i) => '-',
            _ => ' ',
        })
        .collect();
    // Leading blanks would be trimmed from the table.
    format!(":{line}:")
}

/// A p-value.
fn p_value_text(p: f64) -> String {
    if p < 1e-12 { "< 1e-12".to_string() } else { significant(p, 2) }
}

/// What the loop did, for people.
pub fn discovery_text(
    found: &Discovery,
    how: &str,
    written: bool,
    spec: &str,
    width: Option<u16>,
) -> String {
    let width = width.map_or(WIDTH, |width| usize::from(width).max(40));
    let (before, after) = found.held_out_error;
    let count = match found.steps.len() {
        0 => "Nothing was added".to_string(),
        1 => "One effect was added".to_string(),
        many => format!("{many} effects were added"),
    };
    let count = match found.verdict {
        _ if found.interrupted => format!("Interrupted. {count}"),
        Verdict::ExplainedInPart if found.steps.len() == 1 => {
            format!("{count}, which explains a part of what is missing")
        }
        Verdict::ExplainedInPart => format!("{count}, which explain a part of what is missing"),
        _ => count,
    };
    // What was interrupted may end before it is held against other runs.
    let error = match before.is_nan() || after.is_nan() {
        true => "the error on held-out runs was not computed".to_string(),
        false => format!(
            "the error on held-out runs went from {} to {} times the noise",
            times(before),
            times(after)
        ),
    };
    let stop = found.stop.trim_end_matches('.');
    let mut sections =
        vec![wrapped(&format!("{count}: {error}. Why it stopped: {stop}."), width, 2)];
    let rows: Vec<Vec<String>> = found
        .steps
        .iter()
        .map(|step| {
            let numbers = step.coefficient.iter().zip(&step.standard_error);
            let numbers: Vec<String> = numbers.map(|(&x, &s)| uncertain(x, s, 4)).collect();
            vec![
                step.effect.clone(),
                numbers.join(", "),
                p_value_text(step.p_value),
                present::first_few(&step.indistinguishable, ", "),
            ]
        })
        .collect();
    if !rows.is_empty() {
        let header = ["added", "coefficient", "p-value", "indistinguishable from"];
        sections.push(table(&header, rows, &[1, 2], width));
        for one in &found.instead {
            let sentence = present::cannot_distinguish(&one.of.join(" and "), &one.others);
            sections.push(wrapped(&sentence, width, 2));
        }
        let place =
            if written { format!("Written to {spec}:") } else { "To be added:".to_string() };
        let written = found.steps.iter().filter(|step| !step.snippet.is_empty());
        let lines: Vec<String> = written.map(|step| format!("  {}", step.snippet)).collect();
        if !lines.is_empty() {
            sections.push(format!("{place}\n{}", lines.join("\n")));
        }
    }
    sections.push(wrapped(&format!("Split: {how}"), width, 2));
    sections.join("\n\n")
}

/// What a diagnosis is of.
pub struct DiagnosisContext<'a> {
    /// How the data were split.
    pub how: &'a str,
    /// Where the model comes from.
    pub terms: &'a str,
    /// Path of the spec.
    pub spec: &'a str,
    /// Faults of the instrument that no term describes, as sentences.
    pub detections: &'a [&'a str],
}

/// The verdict of a diagnosis, and its ranking.
pub fn diagnosis_text(
    diagnosis: &Diagnosis,
    about: &DiagnosisContext,
    width: Option<u16>,
) -> String {
    let DiagnosisContext { how, terms, spec, detections } = *about;
    let width = width.map_or(WIDTH, |width| usize::from(width).max(40));
    let word = match diagnosis.verdict {
        Verdict::Missing => "Missing",
        Verdict::ExplainedInPart => "A part of what is missing is explained",
        Verdict::NothingMissing => "Nothing is missing",
        Verdict::Unexplained => "Something is missing that the catalogue does not have",
        Verdict::TooLittleData => "Too little data to say",
        Verdict::Interrupted => "Interrupted",
    };
    let mut sections = vec![
        wrapped(&format!("{word}: {}.", diagnosis.reason.trim_end_matches('.')), width, 2),
        wrapped(&format!("Split: {how} The model: {terms}."), width, 2),
    ];
    let rows = diagnosis.ranking.iter().map(|leader| {
        let numbers = leader.coefficient.iter().zip(&leader.standard_error);
        let numbers: Vec<String> = numbers.map(|(&x, &s)| uncertain(x, s, 4)).collect();
        vec![
            leader.effect.clone(),
            numbers.join(", "),
            p_value_text(leader.p_value),
            times(leader.held_out_error_before),
            times(leader.held_out_error_after),
        ]
    });
    if !diagnosis.ranking.is_empty() {
        let header = ["effect", "coefficient", "p-value", "held-out error before", "after"];
        sections.push(table(&header, rows.collect(), &[1, 2, 3, 4], width));
    }
    if let Some(sentence) = present::indistinguishable(diagnosis) {
        sections.push(wrapped(&sentence, width, 2));
    }
    if !diagnosis.partial.is_empty() {
        sections.push(wrapped(&present::in_part(diagnosis), width, 2));
    }
    let told = diagnosis.story.iter().chain(&diagnosis.partial);
    let numbers: Vec<String> = told.filter_map(number_text).collect();
    if !numbers.is_empty() {
        let lines: Vec<String> =
            numbers.iter().map(|one| wrapped(&format!("- {one}"), width, 2)).collect();
        sections.push(format!("Numbers of the spec that are off:\n{}", lines.join("\n")));
    }
    sections.extend(to_add(diagnosis, spec));
    sections.extend(unexplained(diagnosis, width));
    if !detections.is_empty() {
        let lines: Vec<String> =
            detections.iter().map(|found| wrapped(&format!("- {found}"), width, 2)).collect();
        sections.push(format!("In the instrument:\n{}", lines.join("\n")));
    }
    if diagnosis.tests > 0 {
        sections.push(wrapped(&present::tested(diagnosis), width, 2));
    }
    sections.join("\n\n")
}

/// `mass = 1 (line 4, column 17) should be 1.150(2)`.
fn number_text(leader: &RankedEffect) -> Option<String> {
    let change = leader.number.as_ref()?;
    let (value, error) = leader.coefficient.last().zip(leader.standard_error.last())?;
    let what = match change.known.is_named() {
        true => format!("{} = {}", change.name, change.was),
        false if change.name == "sqrt" => "the exponent 0.5 of sqrt".to_string(),
        false => change.was.to_string(),
    };
    let (line, column) = (change.line, change.column);
    let value = uncertain(*value, *error, 4);
    Some(format!("{what} (line {line}, column {column}) should be {value}"))
}

/// How to add what holds, or what is clear; nothing where nothing is.
fn to_add(diagnosis: &Diagnosis, spec: &str) -> Option<String> {
    let story = if diagnosis.story.is_empty() { &diagnosis.partial } else { &diagnosis.story };
    let named = |member: &RankedEffect| member.snippet.strip_prefix("effect ").map(str::to_string);
    match story.as_slice() {
        [] => None,
        [only] if named(only).is_some() => Some(format!(
            "To add it:\n  leverrier add {spec} \"{}\"\nwhich writes\n  {}",
            named(only).unwrap_or_default(),
            only.snippet
        )),
        members => {
            let lines = members.iter().flat_map(|member| member.snippet.lines());
            let lines: Vec<String> = lines.map(|line| format!("  {line}")).collect();
            let own = members.iter().filter(|member| member.left_out.is_some());
            let own: Vec<&str> = own.map(|member| member.effect.as_str()).collect();
            let mut text = format!("To add all of it:\n  leverrier discover {spec}");
            if !own.is_empty() {
                text += &format!("\nwhich learns what the spec has already\n  {}", own.join(", "));
            }
            if !lines.is_empty() {
                let which = if own.is_empty() { "which" } else { "and" };
                text += &format!("\n{which} writes\n{}", lines.join("\n"));
            }
            Some(text)
        }
    }
}

/// What the first effect of the ranking does not explain.
fn unexplained(diagnosis: &Diagnosis, width: usize) -> Vec<String> {
    let mut sections = Vec::new();
    if let (Some(first), Some(last)) = (diagnosis.ranking.first(), diagnosis.further.last()) {
        let names: Vec<&str> = diagnosis.further.iter().map(|l| l.effect.as_str()).collect();
        let sentence = format!(
            "With {} in the model, {} would take the error on held-out runs further, to {}.",
            first.effect,
            names.join(" and "),
            times(last.held_out_error_after),
        );
        sections.push(wrapped(&sentence, width, 2));
    }
    if let Some(unnamed) = &diagnosis.unnamed {
        let sentence = format!(
            "The best term outside the catalogue is {}{}. To add it, write into the spec:",
            unnamed.effect,
            unnamed.gain()
        );
        sections.push(format!("{}\n  {}", wrapped(&sentence, width, 2), unnamed.snippet));
    }
    if let Some(shape) = &diagnosis.shape {
        sections.push(drawn(shape, width));
    }
    sections
}

/// A coefficient before and after a revision of the spec.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CoefficientChange {
    /// Where the term stands: T, V, H, a force or a sensor.
    pub place: String,
    /// The term, or the name of an inner parameter.
    pub term: String,
    /// Its value before.
    pub before: f64,
    /// Standard error before.
    pub before_error: f64,
    /// `None` where the term left the model.
    pub after: Option<f64>,
    /// Standard error after; none where the term left.
    pub after_error: Option<f64>,
}

/// What a revision of a spec brought.
pub struct RevisionSummary<'a> {
    /// `add viscous_drag(theta)`.
    pub action: &'a str,
    /// How the data were split.
    pub how: &'a str,
    /// Samples and error on held-out runs, at every length of prediction.
    pub before: &'a [(usize, f64)],
    /// Samples and error after, for every length of prediction.
    pub after: &'a [(usize, f64)],
    /// How earlier numbers moved.
    pub moved: &'a [CoefficientChange],
    /// Terms of the effect: name, coefficient, standard error.
    pub effect: &'a [(String, f64, f64)],
    /// `None` where nothing can be said.
    pub supported: Option<bool>,
    /// Why it is supported or not, in a sentence.
    pub why: &'a str,
}

/// Before and after a revision of a spec.
pub fn revision_text(revised: &RevisionSummary, width: Option<u16>) -> String {
    let RevisionSummary { action, how, before, after, moved, effect, supported, why } = *revised;
    let width = width.map_or(WIDTH, |width| usize::from(width).max(40));
    let word = match supported {
        Some(true) => "The data support it",
        Some(false) => "The data do not support it",
        None => "It was not judged",
    };
    let mut sections = vec![
        wrapped(&format!("Done: {action}. {word}: {why}."), width, 2),
        wrapped(&format!("Split: {how}"), width, 2),
    ];
    let rows: Vec<Vec<String>> = before
        .iter()
        .zip(after)
        .map(|(old, new)| vec![old.0.to_string(), times(old.1), times(new.1), "1".to_string()])
        .collect();
    if !rows.is_empty() {
        sections.push(format!(
            "Error on held-out runs by length of prediction, in units of the noise:\n{}",
            table(&["samples", "before", "after", "noise floor"], rows, &[0, 1, 2, 3], width)
        ));
    }
    let new = effect.iter().map(|(name, x, s)| {
        vec![String::new(), name.clone(), "-".to_string(), uncertain(*x, *s, 6), String::new()]
    });
    let rows: Vec<Vec<String>> = moved
        .iter()
        .map(|m| {
            let after = m.after.zip(m.after_error);
            let shift = after.map_or(String::new(), |(x, _)| {
                if m.before_error > 0.0 {
                    format!("{:+.1}", (x - m.before) / m.before_error)
                } else {
                    String::new()
                }
            });
            vec![
                m.place.clone(),
                m.term.clone(),
                uncertain(m.before, m.before_error, 6),
                after.map_or("gone".to_string(), |(x, s)| uncertain(x, s, 6)),
                shift,
            ]
        })
        .chain(new)
        .collect();
    if !rows.is_empty() {
        let header = ["part", "term", "before", "after", "change, in standard errors"];
        sections.push(table(&header, rows, &[2, 3, 4], width));
    }
    if supported == Some(false) {
        sections.push("`leverrier undo` takes it back.".to_string());
    }
    sections.join("\n\n")
}
