//! The benchmark of composed terms: an expression that no catalogue has is hidden in simulated
//! measurements, and the symbolic search must compose it again.
//!
//! ```console
//! $ cargo run --release --example composed                # 60 cases
//! $ cargo run --release --example composed -- pendulum    # those of one system
//! $ cargo run --release --example composed -- 0.01 -v     # one noise; the whole front
//! $ cargo run --release --example composed -- reach=1     # samples moved by their spread
//! ```

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a benchmark that fails stops"
)]

#[allow(dead_code, reason = "the tests use the rest")]
#[path = "../../tests/learning/hidden/mod.rs"]
mod hidden;

use std::sync::Arc;
use std::time::Instant;

use hidden::{Case, case_reaching};
use leverrier::internals::diagnose::candidates::composed::{Composition, composition};
use leverrier::internals::diagnose::noise_floor::noise_floor;
use leverrier::internals::diagnose::refit::fitted_from_afar;
use leverrier::internals::diagnose::settling::settle;
use leverrier::internals::diagnose::{self, LawOnData};
use leverrier::internals::expr::{Scope, build};
use leverrier::internals::fit::segments::packed;
use leverrier::internals::fit::stepping::Aim;
use leverrier::internals::fit::train::Training;
use leverrier::internals::fit::{Law, Model, Options, Silent};
use leverrier::internals::spec::edit::insert;

use hidden::terms::{Hidden, hidden_terms};

/// Noise in parts of each column's spread.
const NOISES: [f64; 2] = [0.001, 0.01];

/// Hidden terms move the samples by this part of their spread.
const REACH: f64 = 0.2;

/// What became of one hidden term.
struct Outcome {
    /// The chosen place of the front.
    chosen: String,
    /// Whether its text is that of the hidden term.
    form: bool,
    /// Fall of the training deviance that it lacks beside the hidden term itself.
    lacking: f64,
    /// Error on held-out runs with it and with the hidden term, in units of the noise.
    held_out: (f64, f64),
    /// Place of the hidden term's form on the front.
    place: Option<usize>,
    distinct: usize,
    seconds: f64,
    front: Vec<String>,
}

impl Outcome {
    /// Whether the chosen place is the hidden term, or equals it within the noise.
    fn right(&self) -> bool {
        self.form || (self.lacking < 6.0 && self.held_out.0 < 1.01 * self.held_out.1)
    }
}

/// What a statement leaves of the training runs and the error that it has on held-out ones, all
/// numbers fitted; over segments of `window` samples.
fn left(
    case: &Case,
    model: &Model,
    noise: &[f64],
    statement: &str,
    window: usize,
) -> (f64, f64, f64) {
    let text = insert(&case.text, statement);
    let compiled = build("learned", &text).unwrap_or_else(|error| panic!("{text}\n{error}"));
    let law = model.law(&case.compiled.system).expect("the model's own system");
    let system = &compiled.system;
    let standing = case.compiled.system.terms.len();
    let each = law.coefficient_of_each_term();
    let value = |k: usize| if k < standing { each[k] } else { 1e-3 };
    let terms = system.term_ids().into_iter().enumerate().map(|(k, id)| (id, value(k))).collect();
    let parameters = system.parameters.iter().map(|p| p.start).collect();
    let how = (law.stepping(), law.window().min(window));
    let law = Law::new(system.clone(), terms, parameters, noise.to_vec(), how)
        .expect("a law of its own system");
    // What is added may ask for another integrator.
    let options = Options::default();
    let measured = Arc::new(packed(&case.training, &options.tuning.segments));
    let mut training =
        Training::from_law(&law, measured, &options).expect("a law of its own system");
    training.choose_integrator(Aim::Round);
    let law = law.with_stepping(training.law().stepping());
    let options = diagnose::Options::default();
    let on = |data, law: &Law| LawOnData::of(law.clone().with_window(window), data, &options);
    let model = LawOnData::of(law, &case.training, &options);
    let model = fitted_from_afar(&model).map(|near| near.with_window(window));
    let Some(model) = model.and_then(|near| fitted_from_afar(&near)) else {
        return (f64::INFINITY, f64::INFINITY, 1.0);
    };
    let training = settle(on(&case.training, &model.law)).sums;
    let held_out = settle(on(&case.held_out, &model.law)).sums;
    let error = (held_out.loss / held_out.rows.max(1) as f64).sqrt();
    (training.loss, error, training.loss / training.rows.max(1) as f64)
}

/// A statement without spaces and without the numbers in it that are not whole.
fn skeleton(statement: &str) -> String {
    let body = statement.rsplit(": ").next().unwrap_or_default();
    let place = statement.split(" +=").next().unwrap_or_default();
    let mut out = format!("{place}:");
    let mut number = String::new();
    for letter in body.chars().chain(std::iter::once(' ')) {
        if letter.is_ascii_digit() || letter == '.' {
            number.push(letter);
            continue;
        }
        if !number.is_empty() {
            out += if number.contains('.') { "#" } else { &number };
            number.clear();
        }
        // The coefficient has a sign of its own.
        let leading = letter == '-' && out.ends_with(':');
        if !letter.is_whitespace() && letter != '}' && !leading {
            out.push(letter);
        }
    }
    out
}

/// A snippet with the values of the parameters that it declares in their places.
fn plain(snippet: &str) -> String {
    let (mut text, mut declared) = (snippet.to_string(), Vec::new());
    while let Some((first, rest)) = text.split_once("; ") {
        let Some((name, value)) = first.strip_prefix("param ").and_then(|p| p.split_once(" = "))
        else {
            break;
        };
        let value: f64 = value.parse().expect("a number");
        declared.push((name.to_string(), format!("{value:.6}")));
        text = rest.to_string();
    }
    declared.iter().fold(text, |text, (name, value)| text.replace(name.as_str(), value))
}

fn run(hidden: &Hidden, reach: f64, noise: f64, seed: u64) -> Outcome {
    let case = case_reaching(reach, hidden.base, &hidden.statement, noise, seed);
    let model = case.fit();
    let options = diagnose::Options::default();
    let law = model.law(&case.compiled.system).expect("its own");
    let on_training = LawOnData::of(law, &case.training, &options);
    let on_training = on_training.with_noise(noise_floor(&on_training));
    let clock = Instant::now();
    let mut scope = Scope::of(&case.compiled);
    let Composition { candidates, distinct } =
        composition(&mut scope, &on_training, &Silent).expect("a search");
    let seconds = clock.elapsed().as_secs_f64();
    let statement = |i: usize| plain(&candidates[i].snippet(&candidates[i].grid[0]));
    let front: Vec<String> = (0..candidates.len()).map(statement).collect();
    let wanted = skeleton(&hidden.statement);
    let place = front.iter().position(|found| skeleton(found) == wanted);
    let window = 48;
    let floor = on_training.law.noise().to_vec();
    let (truth, best, variance) = left(&case, &model, &floor, &hidden.statement, window);
    let found = front.first().map(|found| left(&case, &model, &floor, found, window));
    let (found, error, _) = found.unwrap_or((f64::INFINITY, f64::INFINITY, 1.0));
    Outcome {
        chosen: front.first().cloned().unwrap_or_default(),
        form: place == Some(0),
        lacking: (found - truth) / variance.max(1e-12),
        held_out: (error, best),
        place,
        distinct,
        seconds,
        front,
    }
}

fn main() {
    let mut asked: Vec<String> = std::env::args().skip(1).collect();
    let verbose = asked.iter().any(|word| word == "-v");
    asked.retain(|word| word != "-v");
    let reach = asked.iter().find_map(|word| word.strip_prefix("reach=")?.parse().ok());
    asked.retain(|word| !word.starts_with("reach="));
    let noises: Vec<f64> = asked.iter().filter_map(|word| word.parse().ok()).collect();
    let words: Vec<&String> = asked.iter().filter(|word| word.parse::<f64>().is_err()).collect();
    let (mut right, mut forms, mut all) = (0, 0, 0);
    let (mut seconds, mut distinct) = (0.0, usize::MAX);
    for (number, hidden) in hidden_terms().iter().enumerate() {
        for &noise in if noises.is_empty() { &NOISES[..] } else { &noises[..] } {
            let named = |word: &&String| {
                hidden.base.name == word.as_str() || hidden.statement.contains(word.as_str())
            };
            if !words.iter().all(named) {
                continue;
            }
            let reach = reach.unwrap_or(REACH);
            let outcome = run(hidden, reach, noise, number as u64 + 1);
            all += 1;
            right += usize::from(outcome.right());
            forms += usize::from(outcome.form);
            seconds += outcome.seconds;
            distinct = distinct.min(outcome.distinct);
            println!(
                "{} {:<14} {noise:<6} {:<48} | {:<52} place {:?}, lacks {:.1}, held out {:.3} \
                 ({:.3}), {} in {:.1} s",
                if outcome.form {
                    "="
                } else if outcome.right() {
                    "~"
                } else {
                    "-"
                },
                hidden.base.name,
                hidden.statement,
                outcome.chosen.replace('\n', "; "),
                outcome.place,
                outcome.lacking,
                outcome.held_out.0,
                outcome.held_out.1,
                outcome.distinct,
                outcome.seconds,
            );
            if verbose {
                outcome
                    .front
                    .iter()
                    .for_each(|found| println!("      {}", found.replace('\n', "; ")));
            }
        }
    }
    println!(
        "{right} of {all} right, {forms} of them by the hidden form itself; at least {distinct} \
         distinct expressions, {:.1} s a case",
        seconds / f64::from(all.max(1))
    );
}
