//! The equations of motion of the models that a training comes by.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::options::Options;
use super::stepping;
use crate::dynamics::Dynamics;
use crate::eval::Backend;
use crate::expr::System;

/// Dynamics by their terms, each compiled once.
#[derive(Debug, Clone, Default)]
pub(super) struct Compiled(Arc<Mutex<HashMap<Vec<usize>, Arc<Dynamics>>>>);

/// More of them than this are forgotten.
const MOST: usize = 8;

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
        self.of(system, &(0..system.terms.len()).collect::<Vec<usize>>())
    }

    /// The motion by some terms.
    pub(super) fn of(&self, system: &System, terms: &[usize]) -> Arc<Dynamics> {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if known.len() > MOST {
            known.retain(|terms, _| terms.len() == system.terms.len());
        }
        let compile = || Arc::new(Dynamics::new(system, terms, Backend::default()));
        known.entry(terms.to_vec()).or_insert_with(compile).clone()
    }
}
