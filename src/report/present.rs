//! A law and a diagnosis as programs read them.

use std::fmt::Write;

use crate::diagnose::diagnosis::{Diagnosis, RankedEffect};
use crate::fit::distribution::Distribution;
use crate::fit::model::LearnedTerm;
use crate::simplify::{significant, uncertain};

pub use crate::export::{equations_json, export, finite, notes, pretty, simplified};

/// How many effects were tested, and what the p-values are corrected for.
pub fn tested(diagnosis: &Diagnosis) -> String {
    format!(
        "{} effects of the catalogue were tested, with {} choices of where they act and of their \
         inner parameters; p-values are corrected for that many tests (look-elsewhere correction).",
        diagnosis.candidates, diagnosis.tests
    )
}

/// Which other explanations the data allow; `None` where the one that is told stands alone.
pub fn indistinguishable(diagnosis: &Diagnosis) -> Option<String> {
    let first = diagnosis.ranking.first()?;
    if diagnosis.indistinguishable.is_empty() {
        return None;
    }
    let story: Vec<&str> = diagnosis.story.iter().map(|member| member.effect.as_str()).collect();
    let own = if story.is_empty() { first.effect.clone() } else { story.join(" and ") };
    Some(cannot_distinguish(&own, &diagnosis.indistinguishable))
}

/// That the data allow other explanations than one; of many the first few are named.
pub fn cannot_distinguish(own: &str, others: &[String]) -> String {
    format!("These data cannot distinguish {own} from {}.", first_few(others, ", or from "))
}

/// The first of some names, and how many more there are.
pub fn first_few(names: &[String], between: &str) -> String {
    const FEW: usize = 4;
    let (first, more) = names.split_at(FEW.min(names.len()));
    let mut all = first.to_vec();
    match more.len() {
        0 => {}
        1 => all.extend_from_slice(more),
        count => all.push(format!("{count} others like these")),
    }
    all.join(between)
}

/// The effects that explain a part, with their numbers and what does as well in their place.
pub fn in_part(diagnosis: &Diagnosis) -> String {
    let with_numbers = |member: &RankedEffect| {
        let numbers = member.coefficient.iter().zip(&member.standard_error);
        let numbers: Vec<String> = numbers.map(|(&x, &s)| uncertain(x, s, 4)).collect();
        let mut text = format!("{} {}", member.effect, numbers.join(", "));
        if !member.indistinguishable.is_empty() {
            let others = first_few(&member.indistinguishable, " or ");
            text += &format!(" (or {others} in its place)");
        }
        text
    };
    let members: Vec<String> = diagnosis.partial.iter().map(with_numbers).collect();
    format!("What is clear of it: {}. More is missing.", members.join("; "))
}

/// How often a term is chosen when the data are resampled.
pub(crate) fn included(term: &LearnedTerm) -> String {
    term.inclusion.map_or("-".to_string(), |part| format!("{:.0} %", 100.0 * part))
}

/// How a number that groups of runs have for themselves is distributed, in a sentence or two.
pub fn distribution(found: &Distribution) -> String {
    let Distribution { name, per, mean, mean_error, spread, most_unusual, .. } = found;
    let unit = found.unit.as_ref().map_or(String::new(), |unit| format!(" {unit}"));
    if found.values.iter().all(|value| !value.is_determined()) {
        return format!("No {per} determines its {name}.");
    }
    let mean = uncertain(*mean, *mean_error, 10);
    let spread = match *spread > 0.0 {
        true => format!("spread {}{unit} (standard deviation)", significant(*spread, 3)),
        false => "no spread beyond the errors".to_string(),
    };
    let mut text =
        format!("{name} of each {per}: mean {mean}{unit}, which the printed law has; {spread}.");
    if let Some(one) = most_unusual {
        let side = if one.deviations < 0.0 { "below" } else { "above" };
        let _ = write!(
            text,
            " Most unusual is {per} {}, {:.1} standard deviations {side} the mean of the others.",
            one.group,
            one.deviations.abs()
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::first_few;

    #[test]
    fn of_many_names_the_first_are_said() {
        let all = |count: usize| (0..count).map(|i| format!("f{i}")).collect::<Vec<_>>();
        assert_eq!(first_few(&all(2), " or "), "f0 or f1");
        assert_eq!(first_few(&all(5), ", "), "f0, f1, f2, f3, f4");
        assert_eq!(first_few(&all(7), ", "), "f0, f1, f2, f3, 3 others like these");
    }
}
