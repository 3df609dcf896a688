//! The equations of motion of the models that a training comes by.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::blocking::BLOCKING;
use super::law::Law;
use super::options::Options;
use super::stepping;
use crate::dynamics::Dynamics;
use crate::eval::Backend;
use crate::expr::{System, TermId};

/// Dynamics of one system by their terms, each compiled once.
#[derive(Debug, Clone, Default)]
pub(super) struct Compiled(Arc<Mutex<HashMap<Vec<TermId>, Arc<Dynamics>>>>);

impl Compiled {
    /// The motion by all terms, and all that first steps by it need.
    pub(super) fn whole(system: &System, options: &Options) -> Compiled {
        let compiled = Compiled::default();
        let whole = compiled.of_all(system);
        whole.prepare(options.method.unwrap_or_else(|| stepping::usual(whole.separable())));
        compiled
    }

    /// The motion by all terms.
    pub(super) fn of_all(&self, system: &System) -> Arc<Dynamics> {
        self.by(system, system.term_ids())
    }

    /// The motion by the terms of a law of the system.
    pub(super) fn of(&self, law: &Law) -> Arc<Dynamics> {
        self.by(law.system(), law.support().to_vec())
    }

    fn by(&self, system: &System, terms: Vec<TermId>) -> Arc<Dynamics> {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if known.len() > BLOCKING.dynamics {
            known.retain(|terms, _| terms.len() == system.terms.len());
        }
        let compile = || {
            let positions = terms.iter().map(|id| id.position()).collect();
            Arc::new(Dynamics::of_runs(system, positions, Vec::new(), Backend::default()))
        };
        known.entry(terms.clone()).or_insert_with(compile).clone()
    }
}
