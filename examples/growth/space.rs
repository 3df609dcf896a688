//! Growth with the function space and with the degrees of freedom, on data in memory.

use std::time::Instant;

use leverrier::internals::data::{Clock, Dataset, Run};
use leverrier::internals::dynamics::{Dynamics, Method};
use leverrier::internals::eval::Backend;
use leverrier::internals::expr::build;
use leverrier::internals::fit::first_order::correlations;
use leverrier::internals::fit::pass::linearise;
use leverrier::internals::fit::train::Training;
use leverrier::internals::fit::{Law, Options, Stepping, support};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::stages::processor_seconds;

/// Seconds of processor time.
pub(crate) struct Cost {
    /// What was varied: terms or degrees of freedom.
    pub size: usize,
    /// Terms of the function space.
    pub terms: usize,
    /// Linearising by all terms, states eliminated, factorised: for each transition.
    pub pass: Option<f64>,
    /// One search of the support on the factor.
    pub search: Option<f64>,
    /// The gradient by all terms, for each transition: a step of the first-order trainer.
    pub gradient: f64,
}

/// Pairs of states near the origin; what they are of does not matter to the cost.
fn pairs(degrees: usize, count: usize) -> Dataset {
    let mut generator = Pcg64::seed_from_u64(1);
    let mut names: Vec<String> = Vec::new();
    for letter in ["q", "p"] {
        names.extend((1..=degrees).map(|i| format!("{letter}[{i}]")));
    }
    let runs = (0..count)
        .map(|at| Run {
            name: at.to_string(),
            times: vec![0.0, 0.1],
            values: (0..2 * degrees)
                .map(|_| {
                    let x: f64 = generator.random_range(-0.8..0.8);
                    vec![x, x + generator.random_range(-0.05..0.05)]
                })
                .collect(),
            lines: vec![0; 2],
            clock: Clock::default(),
            inputs: Vec::new(),
            groups: Vec::new(),
            errors: Vec::new(),
        })
        .collect();
    Dataset { observables: names, runs, inputs: Vec::new() }
}

fn cost(spec: &str, size: usize, degrees: usize, pairs_of: usize, factorised: bool) -> Cost {
    let space = build("space", spec).expect("a sound spec");
    let terms = space.system.terms.len();
    let data = pairs(degrees, pairs_of);
    let options = Options::default();
    let per = |seconds: f64| seconds / pairs_of as f64;
    let (mut pass, mut search) = (None, None);
    if factorised {
        let training = Training::new(&space.system, &data, &options).expect("enough data");
        let whole = Dynamics::whole(&space.system, Backend::Batched);
        let weights = vec![200.0; 2 * degrees];
        let theta = vec![0.01; whole.unknowns()];
        let problem = training.problem(&weights);
        let mut merged = None;
        pass = Some(per(seconds(|| {
            merged = Some(linearise(&problem, &whole, &theta, &training.states).merged());
        })));
        if let Some(factor) = merged.filter(|_| terms <= 600) {
            let columns = support::Columns {
                terms,
                companions: vec![Vec::new(); terms],
                forced: Vec::new(),
                required: Vec::new(),
                bounds: space.system.terms.iter().map(|t| t.bounds).collect(),
                complexity: vec![1; terms],
                costs: vec![2.0 * (terms as f64).ln(); terms],
            };
            let criterion = leverrier::internals::fit::criterion::Criterion { floor: 1e-6 };
            let tuning = &options.tuning.support;
            let problem =
                support::SearchProblem { factor: &factor, columns: &columns, criterion, tuning };
            search = Some(seconds(|| {
                support::quick_search(problem);
            }));
        }
    }
    let stepping =
        Stepping { method: Method::by_name("leapfrog").expect("a method"), longest: 0.1 };
    let each = space.system.term_ids().into_iter().map(|id| (id, 0.01)).collect();
    let law = Law::new(space.system.clone(), each, Vec::new(), Vec::new(), (stepping, 2));
    let law = law.expect("its own terms");
    let gradient = per(seconds(|| {
        correlations(&space.system, Some(&law), &data, &options).expect("finite");
    }));
    println!("{size}: {terms} terms, {pass:?} and {gradient:.3e} s a transition, {search:?} s");
    Cost { size, terms, pass, search, gradient }
}

/// The least processor time of three goes, so that other work on the machine does not count;
/// of short ones the wall clock's, which is finer.
fn seconds(mut work: impl FnMut()) -> f64 {
    let mut least = f64::INFINITY;
    for _ in 0..3 {
        let (clock, before) = (Instant::now(), processor_seconds());
        work();
        let (wall, processor) = (clock.elapsed().as_secs_f64(), processor_seconds() - before);
        least = least.min(if processor > 0.5 { processor } else { wall });
        if wall > 20.0 {
            break;
        }
    }
    least
}

/// Function spaces of two degrees of freedom: tensor products of growing degree.
pub(crate) fn by_terms(largest: usize) -> Vec<Cost> {
    [3, 7, 15, 31, 70]
        .into_iter()
        .map(|degree| {
            let spec = format!(
                "coordinates q[1..2]\nmomenta p[1..2]\n\
                 T = span{{ tensor(p; {degree}) }}\nV = span{{ tensor(q; {degree}) }}\n"
            );
            let terms = 2 * ((degree + 1) * (degree + 1) - 1);
            let pairs = match terms {
                0..=600 => 8192,
                _ => 4096,
            };
            cost(&spec, terms, 2, pairs, terms <= largest)
        })
        .collect()
}

/// Chains of masses and springs: the terms grow with the degrees of freedom.
pub(crate) fn by_degrees() -> Vec<Cost> {
    [1, 2, 5, 20, 100]
        .into_iter()
        .map(|n| {
            let springs = if n == 1 {
                String::new()
            } else {
                format!("(q[i+1] - q[i])^2 for i in 1..{}, ", n - 1)
            };
            let spec = format!(
                "coordinates q[1..{n}]\nmomenta p[1..{n}]\n\
                 T = span{{ p[i]^2 for i in 1..{n} }}\n\
                 V = span{{ {springs}q[i]^2 for i in 1..{n} }}\n"
            );
            cost(&spec, n, n, if n > 50 { 256 } else { 4096 }, true)
        })
        .collect()
}
