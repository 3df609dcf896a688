//! A fit as text for people: the Hamiltonian first, then how sure all of it is.

use super::layout::{WIDTH, counted, cut, table, wrapped};
use super::present::included;
use super::warnings::sentence;
use super::{FitReport, present};
use crate::fit::Model;
use crate::fit::distribution::Distribution;
use crate::simplify::{Style, significant, uncertain};

/// Rows of the table of coefficients that are shown; all are in the model file.
const COEFFICIENTS: usize = 60;
/// Values of a number that groups of runs have for themselves; all are in the model file.
const VALUES: usize = 30;
/// Rows of the Pareto front.
const FRONT: usize = 12;
/// Runners-up.
const RUNNERS_UP: usize = 4;
/// Exchanges, and sentences on what cannot be learned.
const SENTENCES: usize = 8;

/// The report of a fit, ready to print; `width` is that of the terminal, if it is one.
pub fn fit_text(report: &FitReport, width: Option<u16>) -> String {
    let width = width.map_or(WIDTH, |width| usize::from(width).max(40));
    let model = report.model;
    let mut sections = vec![warnings(model, width), hamiltonian(report, width)];
    sections.push(coefficients(model, width));
    sections.push(parameters(model, width));
    sections.extend(model.distributions.iter().map(|found| distribution(found, width)));
    sections.push(hidden(model, width));
    sections.push(quality(report, width));
    sections.push(front(model, width));
    sections.push(runners_up(model, width));
    sections.push(doubts(model, width));
    sections.push(circumstances(report, width));
    sections.retain(|section| !section.is_empty());
    sections.join("\n\n")
}

/// What is said first: why the numbers may not be what they look like.
fn warnings(model: &Model, width: usize) -> String {
    let lines = model.warnings.iter().map(|found| format!("Warning: {}", sentence(found)));
    lines.map(|line| wrapped(&line, width, 2)).collect::<Vec<_>>().join("\n")
}

fn hamiltonian(report: &FitReport, width: usize) -> String {
    let mut lines = vec![report.system.name.clone(), String::new()];
    for line in report.simplified.text(Style::default()).lines() {
        lines.push(wrapped(&format!("  {line}"), width, 6));
    }
    let notes = present::notes(&report.simplified);
    if !notes.is_empty() {
        lines.push(String::new());
        lines.extend(notes.iter().take(SENTENCES).map(|note| wrapped(note, width, 2)));
        if notes.len() > SENTENCES {
            lines.push(format!("... and {} more numbers snapped", notes.len() - SENTENCES));
        }
    }
    lines.join("\n")
}

/// Three significant digits, zeros too: `1.00`.
fn three(value: f64) -> String {
    match value.abs() {
        size if (0.01..0.9995).contains(&size) => format!("{value:.3}"),
        size if (0.9995..9.995).contains(&size) => format!("{value:.2}"),
        size if (9.995..99.95).contains(&size) => format!("{value:.1}"),
        _ => significant(value, 3),
    }
}

fn unit(text: &Option<String>) -> String {
    text.as_ref()
        .map_or(String::new(), |unit| if unit == "1" { String::new() } else { unit.clone() })
}

fn coefficients(model: &Model, width: usize) -> String {
    if nothing_to_learn(model) {
        return wrapped(
            "There was nothing to learn: the spec has no `span{...}` and no `param`. What follows \
             says how well the law as it stands goes with the data.",
            width,
            0,
        );
    }
    if model.terms.is_empty() {
        return "No term of the function space is in the model.".to_string();
    }
    let rows = model.terms.iter().map(|term| {
        let name = term.name.as_ref().map_or(String::new(), |name| format!("{name}: "));
        vec![
            term.place.clone(),
            format!("{name}{}", term.term),
            uncertain(term.coefficient, term.standard_error, 10),
            unit(&term.unit),
            included(term),
        ]
    });
    let header = ["part", "term", "coefficient", "unit", "included"];
    table(&header, cut(rows.collect(), COEFFICIENTS, 5), &[2, 4], width)
}

fn parameters(model: &Model, width: usize) -> String {
    let own = |name: &str| model.distributions.iter().any(|found| found.name == name);
    let mut shared = model.parameters.iter().filter(|parameter| !own(&parameter.name)).peekable();
    if shared.peek().is_none() {
        return String::new();
    }
    let rows = shared.map(|parameter| {
        vec![
            parameter.name.clone(),
            uncertain(parameter.value, parameter.standard_error, 10),
            unit(&parameter.unit),
        ]
    });
    table(&["parameter", "value", "unit"], rows.collect(), &[1], width)
}

/// What groups of runs have for themselves: how it is distributed, and the value of each.
fn distribution(found: &Distribution, width: usize) -> String {
    let unit = unit(&found.unit);
    let with_runs = found.values.iter().any(|value| value.runs > 1);
    let rows = found.values.iter().map(|value| {
        let text = match value.is_determined() {
            true => uncertain(value.value, value.standard_error, 10),
            false => "not determined".to_string(),
        };
        let mut row = vec![value.group.clone(), text, unit.clone()];
        row.extend(with_runs.then(|| value.runs.to_string()));
        row
    });
    let mut header = vec![found.per.as_str(), found.name.as_str(), "unit"];
    header.extend(with_runs.then_some("runs"));
    let right: &[usize] = if with_runs { &[1, 3] } else { &[1] };
    let rows = cut(rows.collect(), VALUES, header.len());
    let sentence = wrapped(&present::distribution(found), width, 0);
    format!("{sentence}\n\n{}", table(&header, rows, right, width))
}

/// Where the parts that nobody measures were, in the first runs.
fn hidden(model: &Model, width: usize) -> String {
    const RUNS: usize = 4;
    let of_one = model.hidden.iter().take_while(|part| part.run == model.hidden[0].run).count();
    let recorded = model.hidden.iter().take(RUNS * of_one);
    let rows: Vec<Vec<String>> = recorded
        .map(|part| {
            vec![
                part.name.clone(),
                part.run.clone(),
                significant(part.values.0, 6),
                significant(part.values.1, 6),
                unit(&part.unit),
            ]
        })
        .collect();
    if rows.is_empty() {
        return String::new();
    }
    table(&["hidden", "run", "at its start", "at its end", "unit"], rows, &[2, 3], width)
}

fn quality(report: &FitReport, width: usize) -> String {
    let model = report.model;
    let rows = model.noise.iter().enumerate().map(|(row, noise)| {
        if report.measured.get(row) == Some(&false) {
            return vec![noise.observable.clone(), String::new(), "not measured".to_string()];
        }
        let below = noise.standard_deviation <= 2.0 * noise.resolution;
        vec![
            noise.observable.clone(),
            significant(noise.standard_deviation, 3),
            if below { "at the rounding of the data".to_string() } else { String::new() },
        ]
    });
    let mut text = table(&["noise of", "standard deviation", ""], rows.collect(), &[1], width);
    let evidence = &model.evidence;
    let sentence = format!(
        "The residuals are {} times the noise (root mean square of {}; {} in {}, cut into {}).",
        three(evidence.error),
        counted(evidence.residuals, "residual"),
        counted(evidence.samples, "sample"),
        counted(evidence.runs, "run"),
        counted(evidence.segments, "segment"),
    );
    text.push_str("\n\n");
    text.push_str(&wrapped(&sentence, width, 0));
    if let Some(samples) = evidence.searched_first {
        let sentence = format!(
            "Terms were first searched for on {} drawn at random, then chosen and fitted on all.",
            counted(samples, "sample"),
        );
        text.push('\n');
        text.push_str(&wrapped(&sentence, width, 0));
    }
    if evidence.diverged > 0 {
        let sentence = format!(
            "{} diverged under this model and did not count: something is missing \
             in the function space, or it is too large for these data.",
            counted(evidence.diverged, "segment"),
        );
        text.push('\n');
        text.push_str(&wrapped(&sentence, width, 0));
    }
    text
}

fn front(model: &Model, width: usize) -> String {
    if model.front.len() < 2 {
        return String::new();
    }
    let best = model.front.iter().map(|point| point.criterion).fold(f64::INFINITY, f64::min);
    let mut points: Vec<_> = model.front.iter().collect();
    points.sort_by_key(|point| point.terms.len());
    let chosen = points.iter().position(|point| point.chosen).unwrap_or(0);
    let first = (chosen + 1 + FRONT / 3).min(points.len()).saturating_sub(FRONT);
    let mut rows = Vec::new();
    for (at, point) in points.iter().enumerate().skip(first).take(FRONT) {
        let before = at.checked_sub(1).and_then(|at| points.get(at));
        let change = before.map_or_else(
            || plain_list(&point.terms, 4),
            |before| difference(&before.terms, &point.terms),
        );
        rows.push(vec![
            if point.chosen { "->".to_string() } else { String::new() },
            point.terms.len().to_string(),
            three(point.error),
            format!("{:.1}", point.criterion - best),
            change,
        ]);
    }
    let header = ["", "terms", "error", "criterion", "change from the row above"];
    format!(
        "Error (in units of the noise) against number of terms:\n{}",
        table(&header, rows, &[1, 2, 3], width)
    )
}

fn plain_list(terms: &[String], most: usize) -> String {
    let mut text = terms.iter().take(most).cloned().collect::<Vec<_>>().join(", ");
    if terms.len() > most {
        text.push_str(&format!(" and {} more", terms.len() - most));
    }
    text
}

/// `+ q^3, - q^4`: what comes and what goes.
fn difference(from: &[String], to: &[String]) -> String {
    let new = to.iter().filter(|term| !from.contains(term)).map(|term| format!("+ {term}"));
    let gone = from.iter().filter(|term| !to.contains(term)).map(|term| format!("- {term}"));
    let all: Vec<String> = new.chain(gone).collect();
    if all.is_empty() { "the same terms".to_string() } else { plain_list(&all, 6) }
}

fn runners_up(model: &Model, width: usize) -> String {
    let own: Vec<String> = match model.front.iter().find(|point| point.chosen) {
        Some(point) => point.terms.clone(),
        None => model.terms.iter().map(|term| term.term.clone()).collect(),
    };
    let rows: Vec<Vec<String>> = model
        .runners_up
        .iter()
        .take(RUNNERS_UP)
        .map(|runner| {
            let terms: Vec<String> = runner.terms.iter().map(|(term, _)| term.clone()).collect();
            vec![format!("{:+.1}", runner.difference), difference(&own, &terms)]
        })
        .collect();
    if rows.is_empty() {
        return String::new();
    }
    table(&["criterion", "runner-up, as a change of the model"], rows, &[0], width)
}

/// What these data leave open.
fn doubts(model: &Model, width: usize) -> String {
    let exchanges = model.alternatives.iter().map(|exchange| {
        format!(
            "These data can hardly distinguish {} from {} (criterion {:+.1}).",
            exchange.term, exchange.instead, exchange.difference
        )
    });
    let mut lines: Vec<String> = exchanges.take(SENTENCES).collect();
    lines.extend(model.unlearnable.iter().take(SENTENCES).map(|sentence| format!("{sentence}.")));
    let rest = model.alternatives.len().saturating_sub(SENTENCES)
        + model.unlearnable.len().saturating_sub(SENTENCES);
    if rest > 0 {
        lines.push(format!("... and {rest} more such sentences in the model file."));
    }
    lines.iter().map(|line| wrapped(line, width, 2)).collect::<Vec<_>>().join("\n")
}

fn circumstances(report: &FitReport, width: usize) -> String {
    let model = report.model;
    let evidence = &model.evidence;
    let mut lines = vec![
        format!(
            "Learned: {} ({} bytes) from a function space of {}; {} tried, chosen by the {}.",
            counted(evidence.learned, "number"),
            8 * evidence.learned,
            counted(evidence.function_space, "term"),
            counted(evidence.supports_tried, "model"),
            evidence.selection,
        ),
        format!(
            "Integrated with {} in steps of at most {}: {}.",
            model.integrator.method,
            significant(model.integrator.longest_step, 4),
            model.integrator.reason.trim_end_matches('.'),
        ),
        format!(
            "Training {}; {}, {} in the last; {}.",
            model.stop.sentence.trim_end_matches('.'),
            counted(model.stop.rounds, "round"),
            counted(model.stop.iterations, "iteration"),
            seconds(report.elapsed),
        ),
    ];
    if nothing_to_learn(model) {
        lines = vec![lines.swap_remove(1)];
    }
    lines.iter().map(|line| wrapped(line, width, 2)).collect::<Vec<_>>().join("\n")
}

/// Whether everything was known.
fn nothing_to_learn(model: &Model) -> bool {
    model.evidence.function_space == 0 && model.parameters.is_empty()
}

/// `12 ms`, `3.4 s`, `2 min 5 s`.
pub fn seconds(elapsed: f64) -> String {
    if elapsed < 0.9995 {
        format!("{:.0} ms", 1000.0 * elapsed)
    } else if elapsed < 60.0 {
        format!("{elapsed:.1} s")
    } else {
        format!("{} min {:.0} s", (elapsed / 60.0).floor(), elapsed % 60.0)
    }
}
