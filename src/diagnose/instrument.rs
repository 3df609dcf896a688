//! Faults of the instrument that no term of a model describes: single readings that are wrong,
//! and readings that are rounded. Both show in the residuals or in the readings themselves.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, DiscreteCDF, Normal, Poisson};

use super::law_on_data::LawOnData;
use super::noise_floor::shortest;
use super::settling::settle;
use super::tuning::Tuning;

/// A fault that was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Detection {
    /// A row of the catalogue: `outliers` or `quantisation`.
    pub effect: String,
    /// The column.
    pub on: String,
    /// Outliers: the part of the readings that are. Quantisation: the part of the noise (standard
    /// deviation) that rounding makes.
    pub share: f64,
    /// Outliers: how far off they are in the median. Quantisation: the step. In the unit of the
    /// column.
    pub size: f64,
    /// p-value: the probability that noise does as well.
    pub p_value: f64,
    /// What was found and what to do, as a sentence.
    pub sentence: String,
}

/// Faults of every column, in the order of the columns.
pub fn detect(model: &LawOnData) -> Vec<Detection> {
    let tuning = model.tuning();
    let names = model.system().observables();
    let window = model.law.window().clamp(tuning.instrument.shortest, tuning.instrument.longest);
    let residuals = settle(model.with_window(window)).residuals();
    let floor = shortest(model);
    let mut found = Vec::new();
    for (i, name) in names.iter().enumerate() {
        let known = (model.law.noise()[i], model.law.resolution()[i]);
        let series: Vec<&[f64]> =
            residuals.iter().filter_map(|segment| Some(segment.get(i)?.as_slice())).collect();
        found.extend(outliers(name, &series, known, names.len(), tuning));
        found.extend(quantisation(name, i, model, floor[i]));
    }
    found
}

/// Readings that stand out from their neighbours further than normal noise lets them.
fn outliers(
    name: &str,
    series: &[&[f64]],
    (noise, resolution): (f64, f64),
    columns: usize,
    tuning: &Tuning,
) -> Option<Detection> {
    let Tuning { instrument, verdict, .. } = tuning;
    // What the model does wrong is smooth from sample to sample and drops out here; each value
    // has one and a half times the variance of the noise.
    let deviations: Vec<Vec<f64>> =
        series.iter().map(|r| r.windows(3).map(|w| w[1] - 0.5 * (w[0] + w[2])).collect()).collect();
    let mut sizes: Vec<f64> =
        deviations.iter().flatten().filter(|d| d.is_finite()).map(|d| d.abs()).collect();
    let count = sizes.len();
    if count < instrument.readings {
        return None;
    }
    // The median absolute deviation, which outliers do not move, over that of a normal number of
    // variance one, 1 / 1.4826.
    let scale = 1.4826 * *sizes.select_nth_unstable_by(count / 2, f64::total_cmp).1;
    if scale * noise <= verdict.resolved * resolution || scale <= 0.0 {
        return None;
    }
    let mut far: Vec<f64> = Vec::new();
    for d in &deviations {
        for (at, &x) in d.iter().enumerate() {
            let beside = [at.checked_sub(1), Some(at + 1)];
            let spike = beside
                .into_iter()
                .filter_map(|near| d.get(near?).copied())
                .filter(|y| y.is_finite())
                .all(|y| y * x < 0.0 && y.abs() < instrument.spike * x.abs());
            if x.abs() > instrument.far * scale && spike {
                far.push(x.abs() * noise);
            }
        }
    }
    // The scale itself is uncertain: the median absolute deviation of n normal numbers has the
    // relative standard error 1.17 / sqrt(n), of which two are allowed for; and it is not quite the
    // same along a segment, for which it gives a twentieth.
    let sure = 0.95 * (1.0 - 2.4 / (count as f64).sqrt()).max(0.5);
    let tail = 2.0 * Normal::standard().sf(instrument.far * sure);
    let expected = count as f64 * tail;
    let p_value = match (far.len(), Poisson::new(expected)) {
        (0, _) | (_, Err(_)) => 1.0,
        (found, Ok(poisson)) => poisson.sf(found as u64 - 1),
    };
    if p_value * columns as f64 > instrument.significant {
        return None;
    }
    let share = far.len() as f64 / count as f64;
    let middle = far.len() / 2;
    let size = *far.select_nth_unstable_by(middle, f64::total_cmp).1;
    Some(Detection {
        effect: "outliers".to_string(),
        on: name.to_string(),
        share,
        size,
        p_value,
        sentence: format!(
            "column {name} has {:.2} % outliers: {} of {count} readings stand out from their \
             neighbours, by {size:.3} in the median; the loss `huber` of a fit counts them less",
            100.0 * share,
            far.len(),
        ),
    })
}

/// The steps of every column whose readings are whole steps that are not small against the noise.
pub fn coarse_steps(model: &LawOnData) -> Vec<Option<f64>> {
    let noise = model.law.noise().iter().enumerate();
    noise.map(|(row, &noise)| Some(steps(row, model, noise)?.step)).collect()
}

/// A column whose readings are whole steps.
struct Steps {
    step: f64,
    /// What multiples of it may be off by.
    slack: f64,
    readings: usize,
    /// Different values among them.
    values: usize,
}

/// The steps of a column; `None` where readings are not whole steps, or the steps are small against
/// the noise.
fn steps(row: usize, model: &LawOnData, noise: f64) -> Option<Steps> {
    let tuning = &model.tuning().instrument;
    let cells = model.data.dataset.runs.iter().filter_map(|run| run.values.get(row)).flatten();
    let mut values: Vec<f64> = cells.copied().filter(|x| x.is_finite()).collect();
    let readings = values.len();
    values.sort_by(f64::total_cmp);
    let slack = tuning.slack * (values.last()? - values.first()?);
    let step = common_step(&values, slack, tuning.step)?;
    values.dedup_by(|a, b| (*a - *b).abs() < 0.5 * step);
    let coarse = rounding(step) / noise >= tuning.coarse;
    let told = coarse && readings >= tuning.readings && values.len() > 1;
    told.then_some(Steps { step, slack, readings, values: values.len() })
}

/// The standard deviation of rounding to a step: a step over the square root of twelve.
fn rounding(step: f64) -> f64 {
    step / 12.0f64.sqrt()
}

/// Readings that are whole steps, where the steps are not small against the noise.
fn quantisation(name: &str, row: usize, model: &LawOnData, noise: f64) -> Option<Detection> {
    let system = model.system();
    let Steps { step, slack, readings, values } = steps(row, model, noise)?;
    let share = (rounding(step) / noise).min(1.0);
    let unit = system.coordinates.iter().chain(&system.momenta).chain(&system.velocities);
    let unit = unit.into_iter().find(|v| v.name == name).and_then(|v| v.unit_text.clone());
    let unit = unit.map_or(String::new(), |unit| format!(" {unit}"));
    Some(Detection {
        effect: "quantisation".to_string(),
        on: name.to_string(),
        share,
        size: step,
        // Each reading of a continuum falls on the grid by chance; fifty of them say enough.
        p_value: (2.0 * slack / step).powi(readings.min(50) as i32),
        sentence: format!(
            "column {name} is rounded to steps of {}{unit} ({values} values in {readings} readings), which \
             is {:.0} % of its noise: record it with more digits",
            short(step),
            100.0 * share,
        ),
    })
}

/// The largest step of which all differences of sorted values are multiples, but for `slack`;
/// none where they have no step that is so many `times` as large.
fn common_step(values: &[f64], slack: f64, times: f64) -> Option<f64> {
    let mut step = 0.0f64;
    for pair in values.windows(2) {
        let mut rest = pair[1] - pair[0];
        // Euclid's algorithm.
        while rest > slack {
            if step <= slack {
                step = rest;
                break;
            }
            let left = (rest - step * (rest / step).round()).abs();
            if left <= slack {
                break;
            }
            (rest, step) = (step, left);
            if step <= times * slack {
                return None;
            }
        }
    }
    (step > times * slack).then_some(step)
}

/// A step without the digits that rounding in binary adds.
fn short(x: f64) -> String {
    let digits = (5 - x.abs().log10().floor() as i32).clamp(0, 17) as usize;
    let text = format!("{x:.digits$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_string()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_step_of_a_column_is_found_from_its_values() {
        let of = |list: &[f64]| {
            let mut values = list.to_vec();
            values.sort_by(f64::total_cmp);
            let range = values[values.len() - 1] - values[0];
            let tuning = Tuning::default().instrument;
            common_step(&values, tuning.slack * range, tuning.step)
        };
        let close = |step: Option<f64>, is: f64| assert!((step.unwrap() - is).abs() < 1e-6 * is);
        close(of(&[0.0, 0.01, 0.03, 0.07, 0.08, 1.0]), 0.01);
        close(of(&[3.0, 5.0, 8.0, 5.0, -4.0]), 1.0);
        close(of(&[0.4, 1.0, 1.9]), 0.3);
        let angles: Vec<f64> = (0..200).map(|i| f64::to_radians(0.5 * f64::from(i))).collect();
        close(of(&angles), f64::to_radians(0.5));
        assert_eq!(of(&[0.0, 1.0, std::f64::consts::SQRT_2, 3.3333, 0.123_456_789]), None);
        assert_eq!(of(&[2.0, 2.0]), None);
        assert_eq!(short(0.1 + 0.2), "0.3");
        assert_eq!(short(5.0), "5");
    }
}
