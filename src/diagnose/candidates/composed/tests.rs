//! Scores without a pass are those of a pass, and what is the same is asked once.

use super::entries::{Change, Motion};
use super::expression::{Composed, Factor};
use super::first_order::unknowns;
use super::front::joint;
use super::idle::without_idle_terms;
use super::leaves::Leaves;
use super::named::of_unknowns;
use super::refine::refined_leaders;
use super::search::Search;
use super::shapes::SHAPES;
use super::states::Along;
use crate::data::Dataset;
use crate::diagnose::candidates::candidates;
use crate::diagnose::law_on_data::LawOnData;
use crate::diagnose::options::Options;
use crate::diagnose::settling::{Settled, settle};
use crate::expr::{Place, Scope, System, build};
use crate::fit::Law;
use crate::fit::column::Column;
use crate::simulate::Simulator;

const PENDULUM: &str = "coordinates q\nmomenta p\nT = p^2/2\nV = -cos(q)\n";

/// Runs of a law in which everything is known, the last digits in some disorder.
fn measured(text: &str) -> Dataset {
    let system = build("truth", text).expect("a spec").system;
    let simulator = Simulator::new(&system, &[], &[], &[]).expect("a law");
    let starts = [vec![1.2, 0.1], vec![-0.4, 0.9], vec![0.7, -0.8]];
    let times: Vec<f64> = (0..96).map(|i| 0.1 * f64::from(i)).collect();
    let mut data = simulator.trajectories(&starts, &times).expect("a motion").dataset(&system);
    for (at, x) in data.runs.iter_mut().flat_map(|r| r.values.iter_mut().flatten()).enumerate() {
        *x += 1e-4 * (at as f64 * 1.7).sin();
    }
    data
}

fn settled<'a>(text: &str, data: &'a Dataset, options: &'a Options) -> Settled<'a> {
    let law = Law::known(build("model", text).expect("a spec").system).expect("a law");
    let law = law.with_noise(vec![1e-3; 2]).with_window(16);
    settle(LawOnData::of(law, data, options))
}

/// A law of the terms q^2, with a coefficient, and q^4.
fn bowl(square: f64) -> Law {
    let text = "coordinates q\nmomenta p\nT = p^2/2\nV = span{ q^2, q^4 }\n";
    let system = build("model", text).expect("a spec").system;
    let ids = system.term_ids();
    let terms = vec![(ids[0], square), (ids[1], 0.25)];
    let known = Law::known(build("model", PENDULUM).expect("a spec").system).expect("a law");
    let how = (known.stepping(), 16);
    Law::new(system, terms, Vec::new(), vec![1e-3; 2], how).expect("a law")
}

/// The place in the table of a shape.
fn shape(template: &str) -> usize {
    SHAPES.iter().position(|shape| shape.template == template).expect("a shape")
}

/// A product of shapes of coordinate and momentum.
fn term(place: Place, factors: &[(usize, &str, f64)]) -> Composed {
    let factor = |&(leaf, template, number): &(usize, &str, f64)| Factor {
        leaf,
        shape: shape(template),
        numbers: [number, 0.0],
    };
    Composed { place, factors: factors.iter().map(factor).collect(), length: 0.0, price: 0.0 }
}

#[test]
fn a_score_is_that_of_a_pass_over_the_data() {
    let data = measured("coordinates q\nmomenta p\nT = p^2/2\nV = -cos(q) + 0.002*q^4\n");
    let options = Options::default();
    let settled = settled(PENDULUM, &data, &options);
    let leaves = Leaves::of(settled.model.system(), &options.tuning.composed);
    let search = Search::of(&settled, &leaves, &[], 0.12, Along::Model, &[]);
    let mut scope = Scope::of(&build("model", PENDULUM).expect("a spec"));
    let cases = [
        (term(Place::Potential, &[(0, "{x}^4", 0.0)]), "V += span{ term: q^4 }"),
        (
            term(Place::Force(0), &[(0, "{x}^2", 0.0), (1, "{x}", 0.0)]),
            "force q += span{ term: q^2*p }",
        ),
        (term(Place::Kinetic, &[(1, "{x}^4", 0.0)]), "T += span{ term: p^4 }"),
        (
            term(Place::Hamiltonian, &[(0, "sin({a}*{x})", 3.0), (1, "{x}", 0.0)]),
            "H += span{ term: sin(3*q)*p }",
        ),
        (term(Place::Sensor(1), &[(0, "{x}^2", 0.0)]), "sensor p += span{ term: q^2 }"),
    ];
    for (term, statement) in cases {
        let fall =
            search.responses.fall(&term.action(&search.jets.nodes, search.responses.channels));
        let extension = scope.extension(statement).expect("a statement");
        let mut system = System::clone(settled.model.system());
        let (_, own) = extension.terms().next().expect("a term");
        let probe = extension.import(own, &mut system.graph, &Default::default());
        let scores = settled.probe(system, &[probe]).expect("a score").scores;
        let expected = scores.group(&[Column::new(0)]).deviance * scores.variance;
        assert!((fall / expected - 1.0).abs() < 2e-3, "{statement}: {fall}, {expected} by a pass");
    }
}

#[test]
fn a_form_between_two_points_of_its_grid_is_among_the_leaders() {
    let data =
        measured("coordinates q\nmomenta p\nT = p^2/2\nV = -cos(q) - 0.02*exp(-(q/0.5)^2)\n");
    let mut options = Options::default();
    options.tuning.composed.refined = 1;
    let settled = settled(PENDULUM, &data, &options);
    let leaves = Leaves::of(settled.model.system(), &options.tuning.composed);
    let mut search = Search::of(&settled, &leaves, &[], 0.12, Along::Model, &[]);
    // At this length the other is nearer, and takes the one place there is.
    let forms = [("exp(-{x}^2)", 0.0), ("exp(-({x}/{a})^2)", 1.2)];
    let forms = forms.map(|(form, number)| term(Place::Potential, &[(0, form, number)]));
    let found = search.scored(forms.to_vec());
    assert!(found[0].fall > found[1].fall, "{} {}", found[0].fall, found[1].fall);
    let terms = refined_leaders(&search, found);
    let (best, _) = terms.first().expect("a term");
    let [length] = best.numbers()[..] else { panic!("{best:?}") };
    assert!((length / 0.5 - 1.0).abs() < 0.05, "{length}");
    // Where leaves are no numbers, nothing is moved.
    search.jets.ranges.fill((f64::INFINITY, f64::NEG_INFINITY));
    let terms = refined_leaders(&search, search.scored(forms.to_vec()));
    assert!(terms.iter().all(|(one, _)| forms.contains(one)));
}

#[test]
fn forces_act_where_the_motion_was_measured() {
    let data = measured(
        "coordinates q\nmomenta p\nT = p^2/2\nV = -cos(q)\n\
         force q = -0.8*p*sqrt(0.01 + p^2) - 0.6*q^2*p\n",
    );
    let options = Options::default();
    let settled = settled(PENDULUM, &data, &options);
    let leaves = Leaves::of(settled.model.system(), &options.tuning.composed);
    let search = Search::of(&settled, &leaves, &[], 0.06, Along::Measured, &[]);
    let responses = &search.responses;
    let drag = term(Place::Force(0), &[(1, "{x}", 0.0), (1, "sqrt({a}^2 + {x}^2)", 0.1)]);
    let other = term(Place::Force(0), &[(0, "{x}^2", 0.0), (1, "{x}", 0.0)]);
    let of =
        |term: &Composed| responses.column(&term.action(&search.jets.nodes, responses.channels));
    let (columns, target) = ([of(&drag), of(&other)], responses.target());
    let both = joint(&[&columns[0], &columns[1]], &target).expect("two directions");
    assert!((both[0] / -0.8 - 1.0).abs() < 0.02 && (both[1] / -0.6 - 1.0).abs() < 0.02, "{both:?}");
}

#[test]
fn what_jumps_does_to_first_order_what_it_does() {
    let jump = -0.01;
    let text = format!("{PENDULUM}force q += span{{ sign(p) }}\n");
    let truth = format!("{PENDULUM}force q += {jump}*sign(p)\n");
    let data = measured(&truth);
    let system = build("model", &text).expect("a spec").system;
    let known = Law::known(build("truth", &truth).expect("a spec").system).expect("a law");
    let (terms, how) = (vec![(system.term_ids()[0], 0.0)], (known.stepping(), 16));
    let law = Law::new(system, terms, Vec::new(), vec![1e-3; 2], how).expect("a law");
    let options = Options::default();
    let settled = settle(LawOnData::of(law, &data, &options));
    let leaves = Leaves::of(settled.model.system(), &options.tuning.composed);
    for along in [Along::Model, Along::Measured] {
        let search = Search::of(&settled, &leaves, &[], 0.3, along, &[]);
        let responses = &search.responses;
        let (law, channels) = (&settled.model.law, responses.channels);
        let own = of_unknowns(law, &[Column::new(0)], &responses.points, channels);
        let column = responses.column(own[0].as_ref().expect("an action"));
        let found = responses.target().dot(&column) / column.norm_squared();
        assert!((found / jump - 1.0).abs() < 0.01, "{along:?}: {found}");
        // Cubics through nodes so far apart leave 0.15.
        let left = (responses.target() - column * found).norm() / responses.target().norm();
        assert!(left < 0.06, "{along:?}: {left} is left");
    }
}

#[test]
fn what_stands_in_the_model_is_not_scored() {
    let text = "coordinates q\nmomenta p\nT = p^2/2\nV = span{ q^2, q^4 }\n";
    let data = measured("coordinates q\nmomenta p\nT = p^2/2\nV = q^2/2 + q^4/4 + 0.005*q^6\n");
    let system = build("model", text).expect("a spec").system;
    let ids = system.term_ids();
    let law = Law::known(build("model", PENDULUM).expect("a spec").system).expect("a law");
    let how = (law.stepping(), 16);
    let terms = vec![(ids[0], 0.5), (ids[1], 0.25)];
    let law = Law::new(system, terms, Vec::new(), vec![1e-3; 2], how).expect("a law");
    let options = Options::default();
    let settled = settle(LawOnData::of(law, &data, &options));
    let leaves = Leaves::of(settled.model.system(), &options.tuning.composed);
    let search =
        Search::of(&settled, &leaves, &Column::all(2).collect::<Vec<_>>(), 0.12, Along::Model, &[]);
    let fall = |power: &str| {
        let term = term(Place::Potential, &[(0, power, 0.0)]);
        search.responses.fall(&term.action(&search.jets.nodes, search.responses.channels))
    };
    assert_eq!(fall("{x}^2"), 0.0);
    assert!(fall("{x}^6") > 0.9 * search.responses.squares);
}

#[test]
fn what_terms_do_is_explained_again_where_it_is_restored() {
    let data = measured("coordinates q\nmomenta p\nT = p^2/2\nV = -cos(q) + 0.05*q^4\n");
    let with = "coordinates q\nmomenta p\nT = p^2/2\nV = -cos(q) + 0.05*q^4\n";
    let options = Options::default();
    let settled = settled(with, &data, &options);
    let leaves = Leaves::of(settled.model.system(), &options.tuning.composed);
    let quartic = term(Place::Potential, &[(0, "{x}^4", 0.0)]);
    let search = Search::of(&settled, &leaves, &[], 0.12, Along::Model, &[(quartic.clone(), 0.05)]);
    let left = |term: &Composed| {
        let action = term.action(&search.jets.nodes, search.responses.channels);
        1.0 - search.responses.fall(&action) / search.responses.squares
    };
    assert!(left(&quartic) < 1e-3, "{}", left(&quartic));
    assert!(left(&term(Place::Potential, &[(0, "{x}^6", 0.0)])) > 1e-2);
}

#[test]
fn the_numbers_of_the_model_move_to_first_order_with_a_term() {
    let truth = "coordinates q\nmomenta p\nT = p^2/2\nV = 0.502*q^2 + 0.253*q^4 + 0.002*q^6\n";
    let data = measured(truth);
    let law = bowl(0.5);
    let options = Options::default();
    let settled = settle(LawOnData::of(law, &data, &options));
    let leaves = Leaves::of(settled.model.system(), &options.tuning.composed);
    let search =
        Search::of(&settled, &leaves, &Column::all(2).collect::<Vec<_>>(), 0.06, Along::Model, &[]);
    let responses = &search.responses;
    let sixth = term(Place::Potential, &[(0, "{x}^6", 0.0)]);
    let response = responses.response(&sixth.action(&search.jets.nodes, responses.channels));
    let size = response.column.dot(&responses.target()) / response.column.norm_squared();
    assert!((size / 0.002 - 1.0).abs() < 0.05, "{size}");
    let changes = responses.unknowns_beside(&(size * response.heights));
    let [(0, square), (1, fourth)] = changes[..] else { panic!("{changes:?}") };
    assert!((square - 0.002).abs() < 2e-4 && (fourth - 0.003).abs() < 3e-4, "{changes:?}");
}

#[test]
fn what_was_fitted_stands_beside_the_best_points_of_the_grids() {
    let data = measured("coordinates q\nmomenta p\nT = p^2/2\nV = -cos(q) + 0.05*q^4\n");
    let mut options = Options::default();
    options.tuning.sets.points = 1;
    let settled = settled(PENDULUM, &data, &options);
    let leaves = Leaves::of(settled.model.system(), &options.tuning.composed);
    let search = Search::of(&settled, &leaves, &[], 0.12, Along::Model, &[]);
    let mut scope = Scope::of(&build("model", PENDULUM).expect("a spec"));
    let all = candidates(&mut scope, &data, &options.tuning.candidates);
    let place = all.iter().position(|one| one.label == "harmonic_drive(q)").expect("a drive");
    let motion = Motion {
        search: &search,
        law: &settled.model.law,
        candidates: &all,
        spreads: &settled.model.spreads(),
        twice: true,
        tuning: &options.tuning.sets,
    };
    let drives = |fitted: &[(usize, Vec<f64>)]| -> Vec<Vec<f64>> {
        let entries = motion.named(fitted).into_iter();
        entries.filter(|one| one.change == Change::Named(place)).map(|one| one.values).collect()
    };
    let best = drives(&[]);
    assert_eq!(best.len(), 1);
    // Far from all that this motion knows, it explains nothing alone.
    let both = drives(&[(place, vec![0.01234])]);
    assert_eq!(both.len(), 2);
    assert!(both.contains(&vec![0.01234]) && both.contains(&best[0]), "{both:?}");
}

/// What the terms of a bowl save beside one of degree 6.
fn saved_beside_sixth(truth: &str) -> f64 {
    let data = measured(truth);
    let law = bowl(0.01);
    let options = Options::default();
    let settled = settle(LawOnData::of(law, &data, &options));
    let law = &settled.model.law;
    let kept: Vec<Column> = Column::all(2).collect();
    let leaves = Leaves::of(law.system(), &options.tuning.composed);
    let search = Search::of(&settled, &leaves, &kept, 0.06, Along::Model, &[]);
    let motion = Motion {
        search: &search,
        law,
        candidates: &[],
        spreads: &settled.model.spreads(),
        twice: true,
        tuning: &options.tuning.sets,
    };
    let entries = motion.composed(&[term(Place::Potential, &[(0, "{x}^6", 0.0)])]);
    let pool = motion.pool(&entries);
    let found = pool.search(&[0]);
    let before: Vec<f64> = found.iter().map(|one| one.cost).collect();
    let all = (&search.responses, &pool, &entries[..]);
    let after = without_idle_terms(found, all, law, &unknowns(law, &kept));
    let one = after.iter().find(|one| one.members == [0]).expect("the set of this term");
    assert!(before.iter().any(|before| (before - one.saved - one.cost).abs() < 1e-9));
    one.saved
}

#[test]
fn terms_that_idle_beside_a_set_are_saved() {
    let law = |v: &str| format!("coordinates q\nmomenta p\nT = p^2/2\nV = {v}\n");
    let rows: f64 = 500.0;
    let one = saved_beside_sixth(&law("0.25*q^4 + 0.01*q^6"));
    assert!(one > 3.0 && one < rows.ln() + 1.0, "{one}");
    let none = saved_beside_sixth(&law("0.02*q^2 + 0.25*q^4 + 0.01*q^6"));
    assert_eq!(none, 0.0);
}
