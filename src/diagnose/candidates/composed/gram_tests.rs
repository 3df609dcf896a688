//! Sets on one Gram matrix.

use super::*;
use crate::diagnose::tuning::Tuning;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

const ROWS: usize = 400;

/// Columns at random; the last two are near the sum of the first two, apart from each other.
fn columns(count: usize, generator: &mut Pcg64) -> Vec<DVector<f64>> {
    let mut draw = || DVector::from_fn(ROWS, |_, _| StandardNormal.sample(generator));
    let mut all: Vec<DVector<f64>> = (0..count).map(|_| draw()).collect();
    let sum = &all[0] + &all[1];
    all.push(&sum + 0.3 * draw());
    all.push(&sum + 0.3 * draw());
    all
}

/// All columns with what is made of some of them, each times a number, and noise.
fn drawn(truth: &[(usize, f64)], noise: f64, seed: u64) -> (Vec<DVector<f64>>, DVector<f64>) {
    let mut generator = Pcg64::seed_from_u64(seed);
    let all = columns(60, &mut generator);
    let mut target: DVector<f64> =
        DVector::from_fn(ROWS, |_, _| StandardNormal.sample(&mut generator));
    target *= noise;
    for &(at, coefficient) in truth {
        target.axpy(coefficient, &all[at], 1.0);
    }
    (all, target)
}

/// Columns as members, known up to a coefficient.
fn members(all: &[DVector<f64>], most: f64) -> Vec<(usize, f64, Vec<Known>)> {
    let limits = (-most, most);
    let member = |(kind, one): (usize, &DVector<f64>)| (kind, 10.0, vec![(one.clone(), limits)]);
    all.iter().enumerate().map(member).collect()
}

fn found(truth: &[(usize, f64)], noise: f64, seed: u64) -> (FoundSet, Vec<f64>) {
    let (all, target) = drawn(truth, noise, seed);
    let tuning = Tuning::default();
    let pool = Pool::of(members(&all, f64::INFINITY), &target, ROWS, &tuning.sets);
    let best = pool.search(&[]).swap_remove(0);
    let values = pool.coefficients(&best.members).expect("columns that stand apart");
    (best, values.into_iter().flatten().collect())
}

#[test]
fn sets_are_found_whole_with_their_numbers() {
    for seed in 0..8 {
        let (best, values) = found(&[(3, 2.0), (17, -1.0), (40, 0.5)], 0.3, seed);
        assert_eq!(best.members, [3, 17, 40], "seed {seed}");
        for (value, truth) in values.iter().zip([2.0, -1.0, 0.5]) {
            assert!((value - truth).abs() < 5.0 * 0.3 / (ROWS as f64).sqrt(), "{values:?}");
        }
    }
}

#[test]
fn what_stood_in_for_two_members_is_given_back() {
    for seed in 0..8 {
        // One column of the last two is nearly both of the first; with them it says nothing.
        let (best, _) = found(&[(0, 1.0), (1, 1.0), (9, 0.7)], 0.1, seed);
        assert_eq!(best.members, [0, 1, 9], "seed {seed}");
    }
}

#[test]
fn nothing_is_found_in_noise() {
    for seed in 0..20 {
        assert!(found(&[], 1.0, seed).0.members.is_empty(), "seed {seed}");
    }
}

#[test]
fn the_search_may_begin_with_any_set() {
    let tuning = Tuning::default();
    for seed in 0..4 {
        let (all, target) = drawn(&[(3, 2.0), (17, -1.0), (40, 0.5)], 0.3, seed);
        let pool = Pool::of(members(&all, f64::INFINITY), &target, ROWS, &tuning.sets);
        for standing in [vec![50, 17, 2], vec![61], vec![40, 3]] {
            let best = pool.search(&standing).swap_remove(0);
            assert_eq!(best.members, [3, 17, 40], "seed {seed} from {standing:?}");
        }
    }
}

#[test]
fn no_coefficient_is_larger_than_its_column_is_known_for() {
    let tuning = Tuning::default();
    let (all, target) = drawn(&[(3, 2.0), (17, -1.0)], 0.3, 1);
    let pool = Pool::of(members(&all, 1.5), &target, ROWS, &tuning.sets);
    for one in pool.search(&[]) {
        let values = pool.coefficients(&one.members).expect("columns that stand apart");
        assert!(values.iter().flatten().all(|value| value.abs() <= 1.5), "{values:?}");
    }
}

#[test]
fn a_member_whose_coefficient_would_be_negative_has_no_place() {
    let tuning = Tuning::default();
    let (all, target) = drawn(&[(3, 2.0), (17, -1.0)], 0.3, 1);
    let mut own = members(&all, f64::INFINITY);
    own[17].2[0].1 = (0.0, f64::INFINITY);
    let best = Pool::of(own, &target, ROWS, &tuning.sets).search(&[]).swap_remove(0);
    assert!(best.members.contains(&3) && !best.members.contains(&17), "{:?}", best.members);
}

#[test]
fn two_that_tell_little_alone_are_found_among_many_alike() {
    let tuning = Tuning::default();
    for seed in 0..4 {
        let mut generator = Pcg64::seed_from_u64(seed);
        let mut draw = || DVector::from_fn(ROWS, |_, _| StandardNormal.sample(&mut generator));
        let (large, small, noise): (DVector<f64>, DVector<f64>, DVector<f64>) =
            (draw(), draw(), draw());
        // Two columns explain the target with opposite signs, and hardly anything alone;
        // sixty others explain a third of it, each by itself.
        let target = &small + 0.01 * noise;
        let mut all = vec![8.0 * &large + &small, 8.0 * &large - &small];
        all.extend((0..60).map(|_| &small + 1.4 * draw()));
        let pool = Pool::of(members(&all, f64::INFINITY), &target, ROWS, &tuning.sets);
        let best = pool.search(&[]).swap_remove(0);
        assert_eq!(best.members, [0, 1], "seed {seed}");
    }
}

#[test]
fn a_set_holds_those_of_fewer_kinds_of_members() {
    let tuning = Tuning::default();
    let (all, target) = drawn(&[(3, 2.0)], 0.3, 1);
    let mut own = members(&all, f64::INFINITY);
    // The second and the fourth differ in their inner numbers alone.
    own[3].0 = own[1].0;
    let pool = Pool::of(own, &target, ROWS, &tuning.sets);
    let set = |members: &[usize]| FoundSet { members: members.to_vec(), cost: 0.0, saved: 0.0 };
    assert!(pool.holds(&set(&[0, 3, 5]), &set(&[0, 1])));
    assert!(!pool.holds(&set(&[0, 1]), &set(&[0, 3, 5])));
    assert!(!pool.holds(&set(&[0, 2, 5]), &set(&[0, 1])));
}

#[test]
fn what_members_cost_is_no_part_of_the_misfit() {
    let tuning = Tuning::default();
    let (all, target) = drawn(&[(3, 2.0)], 0.3, 1);
    let misfit = |dearer: f64| {
        let mut own = members(&all, f64::INFINITY);
        own[3].1 += dearer;
        let pool = Pool::of(own, &target, ROWS, &tuning.sets);
        let set = pool.found(vec![3]).expect("a set of one column");
        (set.cost, pool.misfit(&FoundSet { cost: set.cost - 5.0, saved: 5.0, ..set.clone() }))
    };
    let ((cost, own), (dear, same)) = (misfit(0.0), misfit(7.0));
    assert!((dear - cost - 14.0).abs() < 1e-9 && (own - same).abs() < 1e-9);
}

#[test]
fn members_may_be_added_to_a_pool() {
    let tuning = Tuning::default();
    let (all, target) = drawn(&[(3, 2.0), (17, -1.0)], 0.3, 1);
    let mut first = members(&all, f64::INFINITY);
    let second = first.split_off(25);
    let whole = Pool::of(members(&all, f64::INFINITY), &target, ROWS, &tuning.sets);
    let parts = Pool::of(first, &target, ROWS, &tuning.sets).with(second, &target);
    assert!((whole.gram - parts.gram).amax() < 1e-12);
    assert!((whole.heights - parts.heights).amax() < 1e-9);
}

#[test]
fn residuals_that_resemble_each_other_count_as_fewer() {
    const LENGTH: usize = 20;
    let lengths = [LENGTH; ROWS / LENGTH];
    let tuning = Tuning::default();
    let (mut white, mut alike) = (0.0, 0.0);
    for seed in 0..16 {
        let mut generator = Pcg64::seed_from_u64(seed);
        let mut draw = |_: usize| -> f64 { StandardNormal.sample(&mut generator) };
        let mut in_stretches = || {
            let each: Vec<f64> = (0..lengths.len()).map(&mut draw).collect();
            DVector::from_fn(ROWS, |row, _| each[row / LENGTH])
        };
        let (column, same) = (in_stretches(), in_stretches());
        let noise = DVector::from_fn(ROWS, |row, _| draw(row));
        let of = |rest: DVector<f64>| {
            let target = &column + 0.3 * rest;
            let own = members(std::slice::from_ref(&column), f64::INFINITY);
            Pool::of(own, &target, ROWS, &tuning.sets).inflation(&[0], &target, &lengths) / 16.0
        };
        white += of(noise);
        alike += of(same);
    }
    // One number a stretch says as much as all of it; the mean of 16 estimates from 20 stretches.
    assert!((0.8..1.7).contains(&white), "{white}");
    assert!((14.0..26.0).contains(&alike), "{alike}");
}

#[test]
fn the_best_of_each_size_is_remembered() {
    let (all, target) = drawn(&[(3, 2.0), (17, -1.0), (40, 0.5)], 1e-4, 5);
    let mut tuning = Tuning::default();
    tuning.sets.kept = 3;
    let pool = Pool::of(members(&all, f64::INFINITY), &target, ROWS, &tuning.sets);
    let found = pool.search(&[]);
    let best = |size: usize| found.iter().find(|one| one.members.len() == size);
    assert_eq!(best(3).expect("a set").members, [3, 17, 40]);
    assert_eq!(best(2).expect("a pair").members, [3, 17]);
    assert_eq!(best(1).expect("one").members, [3]);
}

#[test]
fn what_leaves_as_little_takes_the_place_of_a_member_whatever_it_costs() {
    let (mut all, target) = drawn(&[(3, 2.0), (17, -1.0)], 0.3, 5);
    // Nearly the same as a member, in twice; and one that falls behind.
    let mut generator = Pcg64::seed_from_u64(11);
    for part in [1e-3, 1e-3, 0.5] {
        let mut draw = || -> f64 { StandardNormal.sample(&mut generator) };
        let other = DVector::from_fn(ROWS, |row, _| all[17][row] + part * draw());
        all.push(other);
    }
    let near = all.len() - 3;
    let mut members = members(&all, f64::INFINITY);
    (members[near].1, members[near + 1].1) = (40.0, 60.0);
    let tuning = Tuning::default();
    let pool = Pool::of(members, &target, ROWS, &tuning.sets);
    let best = pool.search(&[]).swap_remove(0);
    assert_eq!(best.members, [3, 17]);
    let of = |most, wanted: &dyn Fn(usize) -> bool| -> Vec<Set> {
        let found = pool.exchanges(&best, 17, (most, 6.0), wanted);
        found.into_iter().map(|one| one.members).collect()
    };
    assert_eq!(of(8, &|_| true), [[3, near], [3, near + 1]]);
    assert_eq!(of(1, &|_| true), [[3, near]]);
    assert_eq!(of(8, &|at| at != near), [[3, near + 1]]);
    assert!(pool.exchanges(&best, 3, (8, 6.0), |_| true).is_empty());
}

#[test]
fn a_set_has_two_of_those_kinds_alone_that_may_be_there_twice() {
    let tuning = Tuning::default();
    let (all, target) = drawn(&[(3, 2.0), (17, -1.0)], 0.3, 2);
    let mut own = members(&all, f64::INFINITY);
    own[17].0 = own[3].0;
    let kind = own[3].0;
    let once = Pool::of(own.clone(), &target, ROWS, &tuning.sets);
    assert!(once.search(&[]).iter().all(|one| !one.members.starts_with(&[3, 17])));
    let twice =
        Pool::of(own, &target, ROWS, &tuning.sets).taking_twice([kind].into_iter().collect());
    let best = twice.search(&[]).swap_remove(0);
    assert_eq!(best.members, [3, 17]);
    let one = FoundSet { members: vec![3], cost: 0.0, saved: 0.0 };
    assert!(twice.holds(&best, &one) && !twice.holds(&one, &best));
}
