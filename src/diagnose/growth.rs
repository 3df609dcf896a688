//! A story held against longer and longer segments, its noise and its numbers taken anew where it
//! no longer follows them.

use super::autocorrelation::correlated_noise;
use super::misfit::error_of;
use super::noise_floor::noise_of;
use super::refit::{Precision, fitted};
use super::settling::{Settled, settle};
use super::steps::noise_of_steps;
use super::story::{Question, SAME_SQUARES, Story};
use super::window::{doubled, longest};
use crate::fit::pass::Sums;

impl<'a> Story<'a> {
    /// Fits all numbers, and holds the story against longer and longer segments as long as it
    /// leaves noise.
    pub(super) fn fitted_again(mut self, question: &Question<'a, '_>) -> Story<'a> {
        self.refit_afresh();
        self.grow(question);
        self
    }

    /// Holds a story of several changes that were found together against longer and longer segments
    /// as long as it leaves noise. Of stories that follow whole runs that is told which leaves
    /// least: none may be behind for having been fitted to shorter segments.
    pub(super) fn hold_together(&mut self, question: &Question<'a, '_>) {
        self.measure_noise(question);
        self.grow_together(question);
    }

    /// The same with the noise as it is.
    pub(super) fn grow_together(&mut self, question: &Question<'a, '_>) {
        self.grow(question);
        if self.explains {
            self.refit();
        }
        let law = self.model.law.clone();
        self.take_numbers(&law);
    }

    /// Takes the noise from the shortest predictions of this story: before a precise sensor a
    /// strong force shows even there, and is taken for noise as long as the model lacks it.
    pub(super) fn measure_noise(&mut self, question: &Question<'a, '_>) {
        // What is left of whole runs is noise already.
        if self.model.autocorrelation_time > 1.0 {
            return;
        }
        let tuning = &self.model.tuning().noise_floor;
        for _ in 0..tuning.stories {
            let noise = noise_of(&self.model);
            let moved = noise.iter().zip(self.model.law.noise());
            let moved = moved.map(|(new, old)| (new / old).ln().abs()).fold(0.0, f64::max);
            if moved < tuning.moved || question.monitor.stopped() {
                return;
            }
            let settled = self.hold_against(noise.into());
            if self.excess_of(&self.sums) > 0.0 {
                self.refit_from(&settled);
            }
        }
    }

    /// Holds the story against longer segments as long as it leaves noise, its numbers fitted
    /// again where they no longer do. What its integrator leaves is noise.
    pub(super) fn grow(&mut self, question: &Question) {
        self.explains = self.leaves_white_noise(question)
            || !question.monitor.stopped() && self.leaves_correlated_noise();
        while let Some(noise) = noise_of_steps(&self.model, question.model) {
            self.model.at_steps = true;
            self.hold_against(noise.into());
            self.explains = self.leaves_white_noise(question);
        }
    }

    /// Whether it leaves noise of segments of every length, up to whole runs; the longest of them
    /// are kept.
    fn leaves_white_noise(&mut self, question: &Question) -> bool {
        let (mut refitted, mut settled) = (false, None);
        loop {
            if self.excess_of(&self.sums) > 0.0 {
                // Numbers that were fitted to short segments need not hold for long ones.
                if !refitted && !question.monitor.stopped() {
                    refitted = match settled.take() {
                        Some(settled) => self.refit_from(&settled),
                        None => self.refit(),
                    };
                    if refitted {
                        continue;
                    }
                }
                self.raise_negligible(self.model.law.window(), question);
                if self.excess_of(&self.sums) > 0.0 {
                    return false;
                }
            }
            let Some(window) = doubled(&self.model) else { return true };
            let longer = settle(self.model.with_window(window));
            if !self.follows(&longer.sums, window, question) {
                return false;
            }
            self.model = self.model.with_window(window);
            self.sums = longer.sums.clone();
            (refitted, settled) = (false, Some(longer));
        }
    }

    /// Whether all that it leaves of whole runs is noise of a short memory, larger than it looks
    /// over short segments; the story is then held against that.
    fn leaves_correlated_noise(&mut self) -> bool {
        let tuning = self.model.tuning();
        let near = |error: f64| error < tuning.autocorrelation.largest;
        if tuning.autocorrelation.largest <= tuning.verdict.reaches || !near(error_of(&self.sums).0)
        {
            return false;
        }
        let settled = settle(self.model.with_window(longest(&self.model)));
        if !near(error_of(&settled.sums).0) {
            return false;
        }
        let Some(found) = fitted(&settled, &self.model.law, Precision::Ranking) else {
            return false;
        };
        let model = settled.model.with_law(found.law);
        let Some(noise) = correlated_noise(&model, self.members.len()) else { return false };
        self.model = model;
        self.hold_against(noise);
        self.excess_of(&self.sums) == 0.0
    }

    /// Whether it keeps to longer segments, by what it leaves of them.
    fn follows(&mut self, longer: &Sums, window: usize, question: &Question) -> bool {
        let ((_, lost), (error, more)) = (error_of(&self.sums), error_of(longer));
        let largest = self.model.tuning().ranking.largest_error;
        let near = |story: &Story| error < largest.max(story.negligible.sqrt());
        if more <= lost && !near(self) {
            self.raise_negligible(window, question);
        }
        more <= lost && near(self)
    }

    /// Takes for negligible what is nothing beside what the model without a change leaves of
    /// segments of a length: clean data say more digits than an integrator keeps.
    fn raise_negligible(&mut self, window: usize, question: &Question) {
        if self.members.is_empty() || question.monitor.stopped() {
            return;
        }
        let baseline = question.model.with_noise(self.model.noise());
        let sums = settle(baseline.with_window(window)).sums;
        let part = self.model.tuning().verdict.negligible;
        let negligible = part * sums.loss / sums.rows.max(1) as f64;
        if negligible.is_finite() {
            self.negligible = self.negligible.max(negligible);
        }
    }

    /// The story over segments of so many samples, its numbers fitted again where they can be.
    pub(super) fn over(&self, window: usize) -> Story<'a> {
        let mut story = self.clone();
        story.model = self.model.with_window(window);
        story.refit_afresh();
        story
    }

    /// Fits all numbers again, over segments of the present length; whether that helps. They are
    /// fitted to the end when the story is concluded.
    fn refit(&mut self) -> bool {
        let settled = settle(self.model.clone());
        self.refit_from(&settled)
    }

    /// The same after its best states were looked for, whatever it left before.
    fn refit_afresh(&mut self) {
        let settled = settle(self.model.clone());
        self.sums = settled.sums.clone();
        self.refit_from(&settled);
    }

    /// The same from the best states of its model. Numbers that are the best already get their
    /// errors.
    fn refit_from(&mut self, settled: &Settled) -> bool {
        let Some(found) = fitted(settled, &self.model.law, Precision::Ranking) else {
            return false;
        };
        if found.sums.diverged > self.sums.diverged {
            return false;
        }
        let better = found.sums.loss < self.sums.loss;
        if better || found.sums.loss - self.sums.loss <= SAME_SQUARES * self.sums.loss {
            self.model = self.model.with_law(found.law);
            self.sums = found.sums;
        }
        better
    }
}
