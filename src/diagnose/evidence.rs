//! What a refitted effect is worth: on the runs that it was fitted to, and on held-out ones.

use super::misfit::error_of;
use super::refit::Refit;
use super::settling::{Parts, Settled};

/// A refit with the evidence for it.
pub struct Judged {
    /// The model with the effect.
    pub refit: Refit,
    /// Fall of the weighted squares of all segments.
    pub fall: f64,
    /// What is left of them for each residual, times the residuals for each independent one.
    pub variance: f64,
    /// What its unknowns and the choice among grid points cost (as in the trainer's criterion).
    pub price: f64,
    /// Fall of the weighted squares of held-out runs.
    held_out_fall: f64,
}

impl Judged {
    /// Judges a refit by all the data, and by all held-out data; where it was fitted to a part of
    /// the data, by a part of both.
    pub fn of(refit: Refit, data: &Parts, held_out: &Parts) -> Judged {
        match &data.part {
            Some(part) if !refit.whole => {
                let held_out_part = held_out.part.as_ref().unwrap_or(&held_out.all);
                let judged = Judged::by(refit, part, held_out_part);
                judged.scaled((part, held_out_part), (&data.all, &held_out.all))
            }
            _ => Judged::by(refit, &data.all, &held_out.all),
        }
    }

    /// Judges a refit by some data and some held-out data.
    pub fn by(mut refit: Refit, data: &Settled, held_out: &Settled) -> Judged {
        let left = refit.left_of(data);
        let far = refit.left_of_other(held_out);
        let ((before, lost), (after, more)) = (error_of(&held_out.sums), error_of(&far));
        let fall = (before.powi(2) - after.powi(2)) * far.freedom.iter().sum::<f64>();
        refit.effect.held_out_error_before = before;
        // Runs that it does not follow any more are no gain.
        refit.effect.held_out_error_after = if more > lost { f64::INFINITY } else { after };
        let least = data.model.tuning().ranking.least_variance;
        // Samples that are alike say one thing together.
        let each = data.model.autocorrelation_time;
        Judged {
            fall: data.sums.loss - left.loss,
            variance: (left.loss / left.rows.max(1) as f64).max(least) * each,
            price: price(&refit, left.rows),
            held_out_fall: if fall.is_finite() && more <= lost { fall } else { 0.0 },
            refit,
        }
    }

    /// What a part of training and held-out data says of all of them.
    fn scaled(mut self, part: (&Settled, &Settled), all: (&Settled, &Settled)) -> Judged {
        let times =
            |all: &Settled, part: &Settled| all.sums.rows as f64 / part.sums.rows.max(1) as f64;
        self.fall *= times(all.0, part.0);
        self.held_out_fall *= times(all.1, part.1);
        self.price = price(&self.refit, all.0.sums.rows);
        // The part has an error of its own; what the effect does to it is what counts.
        let (before, _) = error_of(&all.1.sums);
        let effect = &mut self.refit.effect;
        effect.held_out_error_after *= before / effect.held_out_error_before;
        effect.held_out_error_before = before;
        self
    }

    /// Deviance less price, when the weighted residuals have this variance.
    pub fn merit(&self, variance: f64) -> f64 {
        self.fall / variance - self.price
    }

    /// The same with what held-out runs say. They cost nothing: no number was fitted to them.
    pub fn evidence(&self, variance: f64) -> f64 {
        self.merit(variance) + self.held_out_fall / variance
    }
}

/// What the unknowns of a refit cost beside so many residuals.
fn price(refit: &Refit, rows: usize) -> f64 {
    refit.effect.coefficient.len() as f64 * (rows.max(1) as f64).ln() + refit.choice
}
