//! What is told of a case of the design, beside what is true.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Instant;

use leverrier::internals::diagnose::diagnosis::{RankedEffect, Verdict, diagnose};
use leverrier::internals::diagnose::refit::fitted_from_afar;
use leverrier::internals::diagnose::settling::settle;
use leverrier::internals::diagnose::{self, LawOnData};
use leverrier::internals::expr::{Term, build};
use leverrier::internals::fit::refit::{Integrator, Refitting, refitted};
use leverrier::internals::fit::segments::{longest_run, packed};
use leverrier::internals::fit::stepping::Aim;
use leverrier::internals::fit::train::Training;
use leverrier::internals::fit::{Law, Model, Monitor, Options, fit};
use leverrier::internals::spec::edit::insert;
use serde::{Deserialize, Serialize};

use super::design::{Colour, Kind, Plan};
use super::making::{CORRELATION, Made, Truth, made};

/// A member of a story: what is true, or what is told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Member {
    /// `viscous_drag(theta)`.
    pub label: String,
    /// Coefficients, then inner parameters.
    pub numbers: Vec<f64>,
    /// Their standard errors; none for what is true.
    pub errors: Vec<f64>,
    /// What is said to explain as much in its place.
    pub indistinguishable: Vec<String>,
}

/// One case of the design and what became of it: a line of the file of results.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Record {
    /// Its place in the design.
    pub number: usize,
    /// What kind of thing is hidden.
    pub kind: String,
    /// In which system.
    pub base: String,
    /// What is hidden.
    pub hidden: Vec<Member>,
    /// By how much of their spread the samples should move, and did.
    pub reach: (f64, f64),
    /// Noise in parts of each column's spread.
    pub noise: f64,
    /// What it is like.
    pub colour: String,
    /// Turns in a run.
    pub periods: f64,
    /// What the spec knows.
    pub known: String,
    /// What is measured.
    pub seen: String,
    /// The verdict; empty where the case could not be made or fitted.
    pub verdict: String,
    /// The story that is told.
    pub story: Vec<Member>,
    /// Why, in the program's words; or what failed.
    pub reason: String,
    /// Twice the logarithm of the likelihood that the truth gains over the model as it is, the
    /// least that any member gains over the truth without it; not a number where it was not needed.
    pub gain: Option<f64>,
    /// What it must gain to be identifiable: 25, and the price of its unknowns.
    pub price: f64,
    /// Twice the logarithm of the likelihood by which the told story falls short of the truth, and
    /// both errors on held-out runs; where another story is told.
    pub lacks: Option<(f64, f64, f64)>,
    /// Seconds of the fit and of the diagnosis.
    pub seconds: f64,
}

/// What became of a case, strictly.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Mark {
    /// The same names, and each number within five of its standard errors.
    Right,
    /// Another name that explains the data as well as the truth does, or that the program says it
    /// cannot tell from the true one.
    Equal,
    /// The same names, but a number farther off.
    Off,
    /// Everything that is hidden is told, and more.
    Beside,
    /// It is told that something acts that has no name here.
    Unexplained,
    /// It is told that nothing is missing.
    Nothing,
    /// It is told that there are too few data.
    TooLittle,
    /// A story with something in it that is not there.
    Wrong,
    /// The case could not be made or fitted, or took too long.
    Unmade,
}

impl Mark {
    /// In words.
    pub(crate) fn text(self) -> &'static str {
        match self {
            Mark::Right => "right",
            Mark::Equal => "equal within the noise",
            Mark::Off => "right name, number off",
            Mark::Beside => "right, and more beside",
            Mark::Unexplained => "unexplained",
            Mark::Nothing => "nothing missing",
            Mark::TooLittle => "too little data",
            Mark::Wrong => "wrong name",
            Mark::Unmade => "not made, or not finished",
        }
    }
}

impl Record {
    /// A case before it is run.
    pub(crate) fn of(plan: &Plan) -> Record {
        Record {
            number: plan.number,
            kind: plan.kind.text().to_string(),
            base: plan.base.name.to_string(),
            hidden: plan.labels().into_iter().map(|one| member(one, &[], &[])).collect(),
            reach: (plan.reach, 0.0),
            noise: plan.noise,
            colour: plan.colour.text().to_string(),
            periods: plan.periods,
            known: plan.known.text().to_string(),
            seen: plan.seen.text().to_string(),
            verdict: String::new(),
            story: Vec::new(),
            reason: String::new(),
            gain: None,
            price: 0.0,
            lacks: None,
            seconds: 0.0,
        }
    }

    /// Whether it is of a kind.
    pub(crate) fn is(&self, kind: Kind) -> bool {
        self.kind == kind.text()
    }

    /// Whether the data could tell what is hidden, by the likelihood of the truth. Where that is
    /// not known, because the case was not finished or the truth could not be fitted, they could.
    pub(crate) fn identifiable(&self) -> bool {
        match self.gain {
            Some(gain) => gain > self.price || gain < -25.0,
            // What was found is so by its own numbers: squares of them over their errors.
            None => self.reason != RUNS_AWAY,
        }
    }

    /// What is told of the physics: a shifted clock of a filtered velocity is a fault that is
    /// there.
    fn told(&self) -> Vec<&Member> {
        let filtered = self.colour == "filtered velocity";
        let of_filter = |label: &str| filtered && label.starts_with("clock_shift(p");
        let hidden = |label: &str| self.hidden.iter().any(|one| one.label == label);
        let keep = |one: &&Member| hidden(&one.label) || !of_filter(&one.label);
        self.story.iter().filter(keep).collect()
    }

    /// What became of it.
    pub(crate) fn mark(&self) -> Mark {
        let told = self.told();
        if self.verdict.is_empty() {
            return Mark::Unmade;
        }
        if told.is_empty() {
            return match self.verdict.as_str() {
                "unexplained" => Mark::Unexplained,
                "too little data" => Mark::TooLittle,
                _ if self.hidden.is_empty() => Mark::Right,
                _ => Mark::Nothing,
            };
        }
        let says = |truth: &Member| told.iter().find(|one| one.label == truth.label);
        let all_there = self.hidden.iter().all(|truth| says(truth).is_some());
        if all_there && !self.hidden.is_empty() {
            if told.len() > self.hidden.len() {
                return Mark::Beside;
            }
            let near = |truth: &Member| {
                says(truth).is_some_and(|one| {
                    let exact = self.noise == 0.0 && are_alike(&truth.numbers, &one.numbers);
                    exact || deviations(truth, one).all(|off| off <= 5.0)
                })
            };
            return if self.hidden.iter().all(near) { Mark::Right } else { Mark::Off };
        }
        let admits = |truth: &Member| {
            says(truth).is_some()
                || told.iter().any(|one| one.indistinguishable.contains(&truth.label))
        };
        let same = !self.hidden.is_empty()
            && told.len() == self.hidden.len()
            && self.hidden.iter().all(admits);
        let as_good = |(lacks, error, of_truth): (f64, f64, f64)| {
            lacks < 6.0 && (error < 1.01 * of_truth || error >= HUGE)
        };
        if same || self.lacks.is_some_and(as_good) { Mark::Equal } else { Mark::Wrong }
    }

    /// Whether the first member of the story is one that is hidden, or said to be as good.
    pub(crate) fn first_is_right(&self) -> bool {
        let of = |truth: &Member, one: &Member| one.label == truth.label;
        let told = self.told();
        let first = told.first();
        first.is_some_and(|one| self.hidden.iter().any(|truth| of(truth, one)))
    }

    /// For each number of a story with the right names, how far it is from the truth in standard
    /// errors.
    pub(crate) fn deviations(&self) -> Vec<f64> {
        if !matches!(self.mark(), Mark::Right | Mark::Off) {
            return Vec::new();
        }
        let mut all = Vec::new();
        for truth in &self.hidden {
            if let Some(one) = self.story.iter().find(|one| one.label == truth.label) {
                all.extend(deviations(truth, one));
            }
        }
        all
    }
}

/// Whether numbers are the same to one part in a million.
fn are_alike(truth: &[f64], told: &[f64]) -> bool {
    truth.iter().zip(told).all(|(truth, told)| (told - truth).abs() <= 1e-6 * truth.abs())
}

/// How far the numbers of a member are from the true ones, in standard errors.
fn deviations<'a>(truth: &'a Member, told: &'a Member) -> impl Iterator<Item = f64> + 'a {
    let both = truth.numbers.iter().zip(told.numbers.iter().zip(&told.errors));
    both.map(|(truth, (value, error))| (value - truth).abs() / error.max(1e-300))
}

/// Why a case cannot be made.
const RUNS_AWAY: &str = "what is hidden runs away at any strength";

/// Waits for so many seconds, and no longer.
struct Patience(Instant, f64);

impl Monitor for Patience {
    fn stage(&self, _: &str, _: f64) {}

    fn stopped(&self) -> bool {
        self.0.elapsed().as_secs_f64() > self.1
    }
}

/// Runs a case of the design, for so many seconds at most.
pub(crate) fn scored(plan: &Plan, patience: f64) -> Record {
    let mut record = Record::of(plan);
    let Some(made) = made(plan) else {
        record.reason = RUNS_AWAY.to_string();
        return record;
    };
    let Made { case, truth, moved } = &made;
    record.reach.1 = *moved;
    record.hidden = truth.iter().map(|one| member(one.label.clone(), &one.numbers, &[])).collect();
    let clock = Patience(Instant::now(), patience);
    let (system, options) = (&case.compiled.system, Options::default());
    let told = fit(system, &case.training, &options, &clock).and_then(|model| {
        let law = model.law(system).expect("the case's own");
        let (training, held_out) = (&case.training, &case.held_out);
        let how = diagnose::Options::default();
        let told = diagnose(&case.compiled, &law, training, held_out, &how, &clock)?;
        Ok((model, told))
    });
    record.seconds = clock.0.elapsed().as_secs_f64();
    let (model, told) = match told {
        Ok(told) if !clock.stopped() => told,
        Ok(_) => {
            record.reason = format!("not finished in {patience} s");
            return record;
        }
        Err(error) => {
            record.reason = error.to_string();
            return record;
        }
    };
    record.verdict = match told.verdict {
        Verdict::Missing => "missing",
        Verdict::NothingMissing => "nothing missing",
        Verdict::ExplainedInPart => "explained in part",
        Verdict::Unexplained => "unexplained",
        Verdict::TooLittleData => "too little data",
        Verdict::Interrupted => "interrupted",
    }
    .to_string();
    record.reason.clone_from(&told.reason);
    for (at, one) in told.story.iter().chain(&told.partial).enumerate() {
        let mut told_of = member(one.effect.clone(), &one.coefficient, &one.standard_error);
        told_of.indistinguishable.clone_from(&one.indistinguishable);
        if at == 0 && told.story.len() == 1 {
            told_of.indistinguishable.extend(told.indistinguishable.iter().cloned());
        }
        record.story.push(told_of);
    }
    let unknowns: usize = truth.iter().map(|one| one.numbers.len()).max().unwrap_or(0);
    let samples = (case.training.samples() * case.noise.len()).max(2) as f64;
    record.price = 25.0 + unknowns as f64 * samples.ln();
    judge(&mut record, &made, &model, &told.story);
    // Deviations that go with one another say as little as so many fewer that do not.
    if plan.colour == Colour::Correlated {
        let fewer = (1.0 - CORRELATION) / (1.0 + CORRELATION);
        record.gain = record.gain.map(|gain| fewer * gain);
        record.lacks = record.lacks.map(|(lacks, error, truth)| (fewer * lacks, error, truth));
    }
    record
}

/// What JSON can hold of a number.
fn finite(x: f64) -> f64 {
    if x.is_nan() { HUGE } else { x.clamp(-HUGE, HUGE) }
}

/// Stands for what is not finite in a file of results.
const HUGE: f64 = 1e30;

fn member(label: String, numbers: &[f64], errors: &[f64]) -> Member {
    let finite = |all: &[f64]| all.iter().map(|&x| finite(x)).collect();
    Member {
        label,
        numbers: finite(numbers),
        errors: finite(errors),
        indistinguishable: Vec::new(),
    }
}

/// Weighs the truth against the model as it is, and against what is told in its place.
fn judge(record: &mut Record, made: &Made, model: &Model, story: &[RankedEffect]) {
    let Made { case, truth, .. } = made;
    if truth.is_empty() {
        return;
    }
    let scale = Weighing::of(made, model);
    let Some(bare) = scale.left(&case.text, &[]) else { return };
    if truth.iter().any(|one| one.numbers.is_empty()) {
        // No term says it: what the model as it is leaves above the noise.
        let excess = bare.loss - bare.rows;
        record.gain = Some(finite(excess));
        record.price = 25.0 + 5.0 * (2.0 * bare.rows).sqrt();
        if !story.is_empty() {
            let found = scale.story(story);
            record.lacks = found.map(|found| {
                let spread = (2.0 * found.rows).sqrt();
                let lacks = 2.0 * ((found.loss - found.rows) / spread).max(0.0);
                (finite(lacks), finite(found.held_out), 1.0)
            });
        }
        return;
    }
    let right = matches!(record.mark(), Mark::Right);
    let sure = |one: &Member| {
        let ratios = one.numbers.iter().zip(&one.errors).map(|(x, error)| (x / error).powi(2));
        ratios.fold(0.0, f64::max)
    };
    let least = record.story.iter().map(sure).fold(f64::INFINITY, f64::min);
    let is_number = truth.iter().any(|one| one.statement.is_empty());
    if right && !is_number && least > record.price {
        return;
    }
    let Some(best) = scale.truth(truth, None) else { return };
    let without = |place: usize| match truth.len() {
        1 => Some(bare.loss),
        _ => scale.truth(truth, Some(place)).map(|left| left.loss),
    };
    let gains = (0..truth.len()).filter_map(without).map(|loss| loss - best.loss);
    record.gain = Some(finite(gains.fold(f64::INFINITY, f64::min)));
    if !right && !story.is_empty() {
        let found = scale.story(story);
        record.lacks = found.map(|found| {
            (finite(found.loss - best.loss), finite(found.held_out), finite(best.held_out))
        });
    }
}

/// The label of a member, and what its numbers start at.
type Start = (String, Vec<f64>);

/// What a law leaves of the training runs, over all of their length, and its error on others.
struct Left {
    loss: f64,
    rows: f64,
    held_out: f64,
}

/// Fits laws to a case, and weighs them by its true noise.
struct Weighing<'a> {
    made: &'a Made,
    model: &'a Model,
    noise: Vec<f64>,
}

impl<'a> Weighing<'a> {
    fn of(made: &'a Made, model: &'a Model) -> Weighing<'a> {
        // Without noise, what the fit takes for it; where nothing was measured, anything.
        let own = model.noise.iter().map(|noise| noise.standard_deviation);
        let noise = made.case.noise.iter().zip(own);
        let noise = noise.map(|(&noise, own)| if noise > 0.0 { noise } else { own.max(1e-9) });
        Weighing { made, model, noise: noise.collect() }
    }

    /// The truth, or the truth without one of its members.
    fn truth(&self, truth: &[Truth], without: Option<usize>) -> Option<Left> {
        let kept = || truth.iter().enumerate().filter(|(at, _)| Some(*at) != without);
        let mut text = self.made.case.text.clone();
        let mut starts = Vec::new();
        for (_, one) in kept() {
            match one.label.strip_prefix("number(").and_then(|name| name.strip_suffix(')')) {
                Some(name) => {
                    let head = format!("constant {name} = ");
                    let lines = text.lines().map(|line| match line.starts_with(&head) {
                        true => format!("param {name} = {}\n", one.numbers[0]),
                        false => format!("{line}\n"),
                    });
                    text = lines.collect();
                }
                None => {
                    text = insert(&text, &one.statement);
                    starts.push((one.label.clone(), one.numbers.clone()));
                }
            }
        }
        self.left(&text, &starts)
    }

    /// A story that was told.
    fn story(&self, story: &[RankedEffect]) -> Option<Left> {
        let mut members: Vec<&RankedEffect> = story.iter().collect();
        // Numbers first, and the last in the text before those that stand before it.
        members.sort_by_key(|one| {
            let at = one.number.as_ref().map(|change| (change.line, change.column));
            (at.is_none(), std::cmp::Reverse(at))
        });
        let text = self.made.case.text.clone();
        let text = members.iter().fold(text, |text, one| one.written_into(&text));
        let statements = members.iter().filter(|one| one.number.is_none());
        let starts: Vec<Start> =
            statements.map(|one| (one.effect.clone(), one.coefficient.clone())).collect();
        self.left(&text, &starts)
    }

    /// A spec with some members more than that of the case.
    fn left(&self, text: &str, starts: &[Start]) -> Option<Left> {
        let case = &self.made.case;
        let compiled = build("weighed", text).ok()?;
        let system = &compiled.system;
        let law = self.model.law(&case.compiled.system)?;
        let each = law.coefficient_of_each_term();
        // A term of the spec starts where its model has it, others at their own numbers.
        let mut met: HashMap<&str, usize> = HashMap::new();
        let own: Vec<Option<f64>> = (system.terms.iter())
            .map(|term| {
                let standing = &case.compiled.system.terms;
                let alike = |other: &Term| {
                    other.place == term.place
                        && other.label == term.label
                        && other.effect == term.effect
                };
                if let Some(at) = standing.iter().position(alike) {
                    return Some(each[at]);
                }
                // What has no name of the catalogue stands alone.
                let effect = term.effect.as_deref().unwrap_or_default();
                let is_own = |(label, _): &&Start| label == effect || effect.is_empty();
                let (_, numbers) = starts.iter().find(is_own)?;
                let place = met.entry(effect).or_insert(0);
                *place += 1;
                numbers.get(*place - 1).copied()
            })
            .collect();
        let value = |k: usize| own[k].unwrap_or(1e-3);
        let terms = system.term_ids().into_iter().enumerate().map(|(k, id)| (id, value(k)));
        let parameters = system.parameters.iter().map(|p| p.start).collect();
        let how = (law.stepping(), law.window());
        let law =
            Law::new(system.clone(), terms.collect(), parameters, self.noise.clone(), how).ok()?;
        // What is added may ask for another integrator.
        let options = Options::default();
        let mut training = Training::from_law(
            &law,
            Arc::new(packed(&case.training, &options.tuning.segments)),
            &options,
        )
        .ok()?;
        training.choose_integrator(Aim::Round);
        let law = law.with_stepping(training.law().stepping());
        let options = diagnose::Options::default();
        let whole = longest_run(&case.training).min(options.tuning.states.longest);
        let short = LawOnData::of(law, &case.training, &options);
        let tuning = &options.fit;
        let (integrator, least) = (Integrator::Kept, tuning.refit.converged.into());
        let at_once = |law: &Law| {
            let how =
                Refitting { start: None, integrator, least, tuning, monitor: &leverrier::Silent };
            let law = law.clone().with_window(whole);
            Some(refitted(&law, &short.data.packed, how).ok()?.law)
        };
        // As it starts, and fitted in two ways: where nothing is to be learned, there is nothing
        // to fit, and long runs have many minima.
        let near = at_once(&short.law);
        let far = fitted_from_afar(&short).and_then(|model| at_once(&model.law));
        let laws: Vec<Law> = [Some(short.law.clone()), near, far].into_iter().flatten().collect();
        let of = |data, law: &Law| {
            let law = law.clone().with_noise(self.noise.clone()).with_window(whole);
            settle(LawOnData::of(law, data, &options)).sums
        };
        let left = laws.iter().map(|law| {
            let (sums, others) = (of(&case.training, law), of(&case.held_out, law));
            let held_out = (others.loss / others.rows.max(1) as f64).sqrt();
            Left { loss: sums.loss, rows: sums.rows.max(1) as f64, held_out }
        });
        left.min_by(|a, b| a.loss.total_cmp(&b.loss))
    }
}
