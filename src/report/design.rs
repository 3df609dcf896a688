//! The next run worth measuring, as text for people.

use super::layout::{WIDTH, counted, table, wrapped};
use crate::diagnose::design::{Expected, Named, Plan, Proposal};
use crate::simplify::{significant, uncertain};

/// Alternatives that are shown.
const ALTERNATIVES: usize = 5;

/// Why a run is designed, the run, what it would bring, and what else would do.
///
/// `simulate` is the command that simulates the best run.
pub fn design_text(
    plan: &Plan,
    why: &str,
    spec: &str,
    simulate: &str,
    width: Option<u16>,
) -> String {
    let width = width.map_or(WIDTH, |width| usize::from(width).max(40));
    let why = format!("{why}{}", so_far(plan));
    let mut sections = vec![wrapped(&why, width, 2)];
    let best = &plan.best;
    let observed = if best.observed.iter().zip(&best.start).all(|(a, b)| a.name == b.name) {
        String::new()
    } else {
        format!("\n  where {} is shown", values(&best.observed))
    };
    let from = if best.from == 0.0 {
        String::new()
    } else {
        format!(", from t = {}", significant(best.from, 6))
    };
    sections.push(format!(
        "Measure a run that starts at\n  {}{observed}\nand lasts {}{from}, with a sample every {} \
         ({} samples).",
        values(&best.start),
        significant(best.duration, 6),
        significant(best.step, 6),
        best.samples,
    ));
    sections.extend(brings(plan, width));
    sections.extend(alternatives(plan, width));
    let bounds = |bounds: &[crate::diagnose::design::Bound]| {
        let of = bounds.iter().map(|b| {
            format!("{} = {}..{}", b.name, significant(b.lower, 4), significant(b.upper, 4))
        });
        of.collect::<Vec<_>>().join(", ")
    };
    sections.push(wrapped(
        &format!(
            "Starts within {}; motion within {}. {} were tried; {}.",
            bounds(&plan.start_bounds),
            bounds(&plan.motion_bounds),
            counted(plan.evaluated, "run"),
            plan.stop
        ),
        width,
        2,
    ));
    let then = if plan.rivals.is_empty() { "fit" } else { "diagnose" };
    sections.push(format!(
        "What the fitted model expects of it:\n  {}\nOnce it is measured, append it to the data \
         as a run of its own, and\n  leverrier {then} {spec}",
        simulate
    ));
    sections.join("\n\n")
}

/// How far the rivals are apart before the run.
fn so_far(plan: &Plan) -> String {
    let behind = plan.rivals.iter().filter(|rival| rival.excess_deviance > 0.0);
    let parts: Vec<String> =
        behind.map(|rival| format!("{} {}", rival.effect, odds(rival.excess_deviance))).collect();
    match plan.rivals.iter().find(|rival| rival.excess_deviance <= 0.0) {
        Some(first) if !parts.is_empty() => format!(
            " So far all measurements together favour {}, against {}.",
            first.effect,
            parts.join(", against ")
        ),
        _ => String::new(),
    }
}

fn values(of: &[Named]) -> String {
    let pairs = of.iter().map(|n| format!("{} = {}", n.name, significant(n.value, 6)));
    pairs.collect::<Vec<_>>().join(", ")
}

/// What the best run would bring, beside a repeat of an earlier one.
fn brings(plan: &Plan, width: usize) -> Vec<String> {
    let repeat = plan.repeat.as_ref();
    if let Some(sought) = &plan.coefficient {
        let error = |x: Option<f64>| match x {
            Some(x) if x.is_finite() => significant(x, 3),
            _ => "unknown".to_string(),
        };
        let mut sentence = format!(
            "The standard error of {} (now {}) would go from {} to {}",
            sought.what,
            uncertain(sought.value, sought.standard_error, 4),
            error(Some(sought.standard_error)),
            error(plan.best.expected.standard_error)
        );
        if let Some(repeat) = repeat {
            let again = error(repeat.standard_error);
            sentence.push_str(&format!("; a repeat of an earlier run would take it to {again}"));
        }
        return vec![wrapped(&format!("{sentence}."), width, 2)];
    }
    let gains = &plan.best.expected.gains;
    let rows: Vec<Vec<String>> = gains
        .iter()
        .enumerate()
        .map(|(i, gain)| {
            let again = repeat.and_then(|r| r.gains.get(i)).map(|g| significant(g.deviance, 3));
            vec![
                gain.truth.clone(),
                gain.against.clone(),
                significant(gain.deviance, 3),
                odds(gain.deviance),
                percent(gain.power),
                again.unwrap_or_default(),
            ]
        })
        .collect();
    let header =
        ["true effect", "alternative", "deviance", "odds", "decided", "deviance of a repeat"];
    let mut out = vec![format!(
        "Expected, with both effects fitted to all measurements and the new run:\n{}",
        table(&header, rows, &[2, 3, 4, 5], width)
    )];
    if !plan.indistinguishable.is_empty() {
        let sentences = plan.indistinguishable.iter().map(|(truth, against)| {
            let text = format!(
                "If {truth} is true, no run within these bounds rules out {against}, which can produce the same motion."
            );
            wrapped(&text, width, 2)
        });
        out.extend(sentences);
    }
    out
}

fn alternatives(plan: &Plan, width: usize) -> Option<String> {
    if plan.alternatives.is_empty() {
        return None;
    }
    let row = |run: &Proposal| {
        vec![
            values(&run.start),
            significant(run.duration, 4),
            significant(run.step, 4),
            run.samples.to_string(),
            least(&run.expected, plan),
            if run.at_rest { "at rest".to_string() } else { String::new() },
        ]
    };
    let rows: Vec<Vec<String>> = plan.alternatives.iter().take(ALTERNATIVES).map(row).collect();
    let brings = if plan.coefficient.is_some() { "standard error" } else { "least deviance" };
    let header = ["start", "duration", "step", "samples", brings, ""];
    Some(format!("Alternatives:\n{}", table(&header, rows, &[1, 2, 3, 4], width)))
}

/// The standard error, or the growth of the deviance for the pair where it is least.
fn least(expected: &Expected, plan: &Plan) -> String {
    if let Some(error) = expected.standard_error {
        return significant(error, 3);
    }
    let alike = |a: &str, b: &str| {
        plan.indistinguishable.iter().any(|(truth, against)| truth == a && against == b)
    };
    let all = plan.indistinguishable.len() == expected.gains.len();
    let counted = expected.gains.iter().filter(|g| all || !alike(&g.truth, &g.against));
    significant(counted.map(|g| g.deviance).fold(f64::INFINITY, f64::min), 3)
}

/// exp(deviance / 2) to 1.
fn odds(deviance: f64) -> String {
    let digits = 0.5 * deviance / std::f64::consts::LN_10;
    if digits < 4.0 {
        format!("{} to 1", significant(10f64.powf(digits), 2))
    } else {
        format!("10^{digits:.0} to 1")
    }
}

fn percent(probability: f64) -> String {
    match 100.0 * probability {
        p if p > 99.0 => "> 99 %".to_string(),
        p if p < 1.0 => "< 1 %".to_string(),
        p => format!("{p:.0} %"),
    }
}
