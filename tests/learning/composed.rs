//! Terms that no catalogue has, hidden in simulated measurements and composed again. `cargo run
//! --release --example composed` runs more of them.

use crate::hidden::bases::base;
use crate::hidden::{Case, case, case_reaching};
use leverrier::internals::diagnose::candidates::composed::{Composition, composition};
use leverrier::internals::diagnose::noise_floor::noise_floor;
use leverrier::internals::diagnose::{LawOnData, Options};
use leverrier::internals::expr::Scope;
use leverrier::internals::fit::Silent;

fn search(case: &Case, expressions: usize) -> Composition {
    let model = case.fit();
    let law = model.law_of(&case.compiled.system).unwrap();
    let mut options = Options::default();
    options.tuning.composed.expressions = expressions;
    let model = LawOnData::of(law, &case.training, &options);
    let model = model.with_noise(noise_floor(&model));
    composition(&mut Scope::of(&case.compiled), &model, &Silent).unwrap()
}

/// Statements of the front, without the name of the term; the chosen one first.
fn front(found: &Composition) -> Vec<String> {
    let statement = |candidate: &leverrier::internals::diagnose::candidates::Candidate| {
        candidate.snippet(&candidate.grid[0]).replace("composed_1: ", "")
    };
    found.candidates.iter().map(statement).collect()
}

#[test]
fn terms_of_every_kind_are_composed_again() {
    // With some noise another expression does as well, and is chosen by its length: where it is,
    // the true one stands on the front beside it.
    let rows = [
        ("trap", "V += span{ x^2*y^2 }", "V += span{ x^2*y^2 }", 0.01),
        ("pendulum", "V += span{ exp(-q^2) }", "V += span{ exp(-q^2) }", 0.01),
        ("trap", "force x += span{ -x^2*px }", "force x += span{ x^2*px }", 0.01),
        (
            "Kepler",
            "V += span{ x*y/(x^2 + y^2)^(5/2) }",
            "V += span{ x*y*(x^2 + y^2)^(-5/2) }",
            0.001,
        ),
    ];
    let mut tried = 0;
    let mut first = 0;
    let mut missed = Vec::new();
    for (name, hidden, statement, noise) in rows {
        for seed in [1, 2] {
            let found = search(&case_reaching(0.2, base(name), hidden, noise, seed), 150_000);
            assert!(found.distinct >= 100_000, "{name}: {} distinct", found.distinct);
            let front = front(&found);
            tried += 1;
            match front.iter().position(|one| one == statement) {
                Some(place) => first += usize::from(place == 0),
                None => missed.push(format!("{name}, {seed}: {front:?}")),
            }
        }
    }
    assert!(4 * missed.len() <= tried, "of {tried}: {missed:#?}");
    assert!(2 * first >= tried, "{first} of {tried} are first");
}

#[test]
fn inner_numbers_are_learned() {
    let hidden = "force q += span{ tanh(p/0.3) }";
    let found = search(&case_reaching(0.2, base("pendulum"), hidden, 0.01, 1), 30_000);
    let first = &found.candidates[0];
    assert!(first.label.contains("tanh(p/"), "{}", first.label);
    assert!((first.grid[0][0] - 0.3).abs() < 0.05, "{:?}", first.grid);
    assert_eq!(first.parameters.len(), 1);
    assert!(first.choice > 7.0);
}

#[test]
fn nothing_is_composed_where_nothing_is_hidden() {
    for (name, seed) in [("pendulum", 1), ("Duffing", 2), ("trap", 3)] {
        let found = search(&case(base(name), "", 0.01, seed), 60_000);
        assert!(found.candidates.is_empty(), "{name}: {:?}", front(&found));
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let case = case_reaching(0.2, base("Duffing"), "V += span{ abs(q)^(3/2) }", 0.01, 1);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| front(&search(&case, 20_000)))
    };
    let one = with(1);
    assert!(!one.is_empty());
    assert_eq!(one, with(3));
}
