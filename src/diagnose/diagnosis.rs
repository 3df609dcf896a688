//! What is missing from a model: the way from candidates to a verdict.
//!
//! Each phase is a file, entered once, in this order; what a phase finds is handed on as plain
//! data:
//!
//! 1. `noise_floor`: the noise of the instrument, which the misfit is measured in (`settling` finds
//!    the best states that a law can start from, `misfit` says what it leaves then);
//! 2. [`candidates`](super::candidates): what may be missing, lowered onto the system;
//! 3. `scan`: a score test of every candidate at every point of its grid (`columns` are what each
//!    would do to the predictions, `score_test` the statistics of them);
//! 4. `refit`: the significant ones fitted with everything that the model has;
//! 5. `evidence` and `ranking`: what each is worth on training and on held-out runs;
//! 6. `search`: stories, which are sets of changes that are judged as one (`story`); those of
//!    several changes are found `together`, on one Gram matrix;
//! 7. `verdict`: whether one holds over whole runs, seen and unseen;
//! 8. `hidden`: where none does, parts that move and that nobody measures. A body among bodies that
//!    attract each other is asked for first: where it is obvious, nothing else need be;
//! 9. `in_part`: where there are none of these either, which effects would be believed all the same
//!    (`doubts`).

use serde::Serialize;

use super::candidates::{candidates, left_out};
use super::comparison::ResidualMap;
use super::doubts::holds;
pub use super::effect::RankedEffect;
use super::hidden::{Unseen, look_for_states};
use super::in_part::{InPart, in_part};
use super::law_on_data::{LawOnData, Measurements};
use super::noise_floor::shortest;
use super::options::Options;
use super::ranking::{Ranking, ranking};
use super::search::{beginnings, held_against_all, stories};
use super::story::{Question, Story};
use super::sufficiency::lacking_beside;
use super::verdict::judge;
use crate::data::Dataset;
use crate::error::Result;
use crate::expr::{Compiled, Scope, TermId};
use crate::fit::{Law, Monitor};

/// What is missing from a model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// The answer in a word.
    pub verdict: Verdict,
    /// Why, in a sentence.
    pub reason: String,
    /// Leaders, the best first.
    pub ranking: Vec<RankedEffect>,
    /// What these data cannot distinguish from the first leader, or from a story of several
    /// members: labels, those of one story joined; empty when it stands alone.
    pub indistinguishable: Vec<String>,
    /// The changes that together explain the data over whole runs; empty where none do.
    pub story: Vec<RankedEffect>,
    /// Coefficients of the model's own terms where they were fitted together with the story and are
    /// far from the model's.
    #[serde(skip)]
    pub beside_story: Vec<(TermId, f64)>,
    /// Where a part is explained: named changes that are clear beside what they leave, with errors
    /// that count it; what does as well in the place of each is in its `indistinguishable`.
    pub partial: Vec<RankedEffect>,
    /// The members of the story after the first.
    pub further: Vec<RankedEffect>,
    /// The best term without a name, where the verdict is that something unnamed is missing.
    pub unnamed: Option<RankedEffect>,
    /// Whether that term alone explains more than the named effects together.
    pub unnamed_explains_more: bool,
    /// The force that is left when all that has a name is in the model, where it shows most.
    pub shape: Option<ResidualMap>,
    /// Candidates that were tested.
    pub candidates: usize,
    /// Candidates times the grid points of their inner parameters.
    pub tests: usize,
    /// Error on held-out runs over a segment, in units of the noise, before anything is added.
    pub held_out_error: f64,
    /// Noise of each observable, as predictions over few samples show it.
    pub noise_floor: Vec<f64>,
}

/// The answer in a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// A named effect explains what the model misses.
    Missing,
    /// Named effects explain a part of what the model misses, and are clear beside what is left.
    ExplainedInPart,
    /// What is left is noise.
    NothingMissing,
    /// Something is missing that the catalogue does not have.
    Unexplained,
    /// The data do not suffice to say.
    TooLittleData,
    /// It was interrupted before everything was looked at.
    Interrupted,
}

impl Diagnosis {
    /// Puts the leader first that a story begins with.
    pub(super) fn begin_with(&mut self, member: &RankedEffect) {
        match self.ranking.iter().position(|leader| leader.effect == member.effect) {
            Some(place) => {
                if place > self.indistinguishable.len() {
                    self.indistinguishable.clear();
                } else if place > 0 {
                    self.indistinguishable[place - 1] = self.ranking[0].effect.clone();
                }
                self.ranking[..=place].rotate_right(1);
                if let Some(leader) = self.ranking.first_mut() {
                    leader.clone_from(member);
                }
            }
            None => {
                self.indistinguishable.clear();
                self.ranking.insert(0, member.clone());
            }
        }
    }

    /// What a ranking of so many candidates says, nothing being missing until it is judged.
    fn of(ranking: &Ranking, candidates: usize, noise_floor: &[f64]) -> Diagnosis {
        let effects = || ranking.effects.iter().map(|one| &one.refit.effect);
        let close = effects().take(ranking.close).skip(1);
        Diagnosis {
            verdict: Verdict::NothingMissing,
            candidates,
            tests: ranking.tests,
            held_out_error: ranking.before,
            noise_floor: noise_floor.to_vec(),
            indistinguishable: close.map(|effect| effect.effect.clone()).collect(),
            ranking: effects().cloned().collect(),
            ..Diagnosis::too_little(format!(
                "none of {} tests finds more than noise explains",
                ranking.tests
            ))
        }
    }

    /// What was found before an interruption: the best candidates, and no verdict on them.
    fn interrupted(self) -> Diagnosis {
        let reason = match self.ranking.first() {
            Some(first) => format!(
                "interrupted before everything was looked at; the best candidate so far was {}{}",
                first.effect,
                first.gain()
            ),
            None => format!(
                "interrupted before any candidate was fitted; {} tests had been made",
                self.tests
            ),
        };
        Diagnosis { verdict: Verdict::Interrupted, reason, ..self }
    }

    /// Nothing can be said, for this reason.
    pub fn too_little(reason: String) -> Diagnosis {
        Diagnosis {
            verdict: Verdict::TooLittleData,
            reason,
            ranking: Vec::new(),
            indistinguishable: Vec::new(),
            story: Vec::new(),
            beside_story: Vec::new(),
            partial: Vec::new(),
            further: Vec::new(),
            unnamed: None,
            unnamed_explains_more: false,
            shape: None,
            candidates: 0,
            tests: 0,
            held_out_error: f64::NAN,
            noise_floor: Vec::new(),
        }
    }
}

/// Asks what a law misses.
///
/// `spec` is that of the law's system; `training` are the runs that the law was fitted to,
/// `held_out` others.
///
/// # Errors
///
/// When the law belongs to another spec, the data do not suffice to score a candidate, or a number
/// of the options is none that a diagnosis can go by.
pub fn diagnose(
    spec: &Compiled,
    law: &Law,
    training: &Dataset,
    held_out: &Dataset,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Diagnosis> {
    let mut so_far = None;
    let answer = asked(spec, law, (training, held_out), options, monitor, &mut so_far);
    if !monitor.stopped() {
        return answer;
    }
    // Where passes ended early, an answer or an error says nothing but that.
    let found = if monitor.halted() { so_far } else { Some(answer?) };
    Ok(found.unwrap_or_else(|| Diagnosis::too_little(String::new())).interrupted())
}

/// The same, to its end; `so_far` is what had been found at the end of every phase.
fn asked(
    spec: &Compiled,
    law: &Law,
    (training, held_out): (&Dataset, &Dataset),
    options: &Options,
    monitor: &dyn Monitor,
    so_far: &mut Option<Diagnosis>,
) -> Result<Diagnosis> {
    options.check()?;
    spec.system.positions(law.support())?;
    let tuning = &options.tuning;
    let model = LawOnData::of(law.clone(), training, options).heeding(monitor);
    let held_out = model.with_data(&Measurements::of(held_out, options)).data;
    let model = model.with_noise(shortest(&model));
    if let Some(reason) = lacking_beside(&model, &held_out) {
        return Ok(Diagnosis::too_little(reason));
    }
    let mut scope = Scope::of(&spec.with_system(model.system()));
    let unseen = Unseen::of(&model);
    let question = Question { scope: &scope, model: &model, held_out: &held_out, monitor };
    if let Some(diagnosis) = unseen.obvious(&question)? {
        return Ok(diagnosis);
    }
    monitor.stage("scoring candidates", 0.1);
    let mut all = candidates(&mut scope, training, &tuning.candidates);
    all.extend(left_out(&scope, &model.law, tuning.candidates.left_out));
    let first = ranking(&model, &held_out, &all, tuning.ranking.first_refits, monitor)?;
    let mut diagnosis = Diagnosis::of(&first, all.len(), model.law.noise());
    *so_far = Some(diagnosis.clone());
    if monitor.halted() {
        return Ok(diagnosis);
    }
    let question = Question { scope: &scope, model: &model, held_out: &held_out, monitor };
    // Explanations are looked for on a part of many data.
    let most = tuning.states.searched;
    let (few, few_held_out) = (model.thinned(most), Measurements { most, ..held_out.clone() });
    let all = question;
    let question = Question { model: &few, held_out: &few_held_out, ..all };
    let baseline = Story::baseline(&question);
    let beginnings = beginnings(&question, &baseline, &first);
    if !beginnings.iter().any(holds) && unseen.look(&all, &first, &mut diagnosis)? {
        return Ok(diagnosis);
    }
    let stories = stories(&question, &baseline, beginnings)?;
    if monitor.halted() {
        return Ok(diagnosis);
    }
    let stories = held_against_all(stories, &all);
    let rejected = judge(&all, &mut diagnosis, stories);
    if diagnosis.verdict == Verdict::Unexplained && !monitor.stopped() {
        look_for_states(&all, rejected.first(), &mut diagnosis)?;
    }
    if diagnosis.verdict == Verdict::Unexplained && !monitor.stopped() {
        monitor.stage("what is clear of it", 0.95);
        if let Some(InPart { members, reason, shape }) = in_part(&question, &all, &baseline)? {
            diagnosis.verdict = Verdict::ExplainedInPart;
            diagnosis.partial = members;
            diagnosis.reason = reason;
            diagnosis.shape = shape;
            diagnosis.unnamed = None;
            diagnosis.unnamed_explains_more = false;
        }
    }
    Ok(diagnosis)
}
