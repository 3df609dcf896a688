//! The habits for a few seconds each, with seeds that do not change.

use std::fs;

use crate::clothes::{self, GARMENTS, ROUNDING, Wearer};
use crate::hidden::bases::base;
use crate::killing::{
    Disk, experiments, good, in_a_read_only_folder, on_a_full_disk, prepared, ran,
    where_files_stay_small, while_a_file_changes,
};
use crate::promises::{Coverage, LAWS, kolmogorov_smirnov, p_values, told};
use crate::twins;

#[test]
fn commands_that_are_killed_lose_the_step_in_hand_alone() {
    for experiment in experiments() {
        let times = if experiment.writing.name == "discover" { 1 } else { 3 };
        (0..times).for_each(|seed| experiment.killed(seed));
    }
}

#[test]
fn a_full_disk_harms_nothing_that_was_there() {
    if let Some(refused) = on_a_full_disk(&[0, 3000]) {
        assert!(refused > 8, "{refused}");
    }
    if let Some(refused) = where_files_stay_small() {
        assert!(refused > 4, "{refused}");
    }
}

#[test]
fn a_folder_that_can_only_be_read_is_said_to_be() {
    in_a_read_only_folder();
}

#[test]
fn files_that_change_while_they_are_read_end_with_a_sentence() {
    // Cut off and whole again.
    let cut = |path: &std::path::Path, whole: &[u8], turn: usize| {
        let length = if turn.is_multiple_of(2) { whole.len() / 2 + turn % 97 } else { whole.len() };
        fs::write(path, &whole[..length]).expect("written");
    };
    while_a_file_changes("fit s.ham", 4, cut);
    while_a_file_changes("fit s.ham --memory 64MiB", 4, cut);
    // Gone and back.
    let gone = |path: &std::path::Path, whole: &[u8], turn: usize| match turn.is_multiple_of(2) {
        true => drop(fs::remove_file(path)),
        false => fs::write(path, whole).expect("written"),
    };
    while_a_file_changes("diagnose s.ham", 4, gone);
}

/// Measurements that come through a pipe are read as a file is.
#[cfg(unix)]
#[test]
fn a_file_that_is_a_pipe_is_read_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    prepared(path);
    let data = fs::read(path.join("swings.csv")).expect("measurements");
    let made = std::process::Command::new("mkfifo").arg(path.join("pipe.csv")).status();
    if !made.is_ok_and(|status| status.success()) {
        println!("skipped: no mkfifo");
        return;
    }
    for line in ["new pipe.csv -o new.ham --force", "fit s.ham --data pipe.csv -o m.json"] {
        std::thread::scope(|scope| {
            let pipe = path.join("pipe.csv");
            let data = &data;
            // Who reads may have had enough, or may not read at all.
            let writer = scope.spawn(move || fs::write(pipe, data));
            let output = ran(path, line);
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            let _ = fs::OpenOptions::new().read(true).write(true).open(path.join("pipe.csv"));
            drop(writer.join());
            assert!(crate::killing::done_or_refused(&output, line), "{line}: {said}");
        });
    }
    good(path, "history s.ham");
}

#[test]
fn clothes_change_no_number() {
    let duffing = Wearer::new(base("Duffing"), "", 0.01, 3);
    let positions = Wearer::new(base("trap"), "", 0.01, 4).positions_only();
    let pendulum = Wearer::new(base("pendulum"), "", 0.01, 5);
    let mut wrong = Vec::new();
    for (name, wearer) in [("Duffing", duffing), ("positions", positions), ("pendulum", pendulum)] {
        for garment in GARMENTS.iter().filter(|garment| (garment.fits)(&wearer)) {
            let moved = clothes::moved(&wearer, garment);
            if moved > ROUNDING {
                wrong.push(format!("{name}, {}: {moved:.1e} standard errors", garment.name));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn clothes_change_no_verdict() {
    let drag = Wearer::new(base("Duffing"), "effect viscous_drag(q)", 0.01, 6);
    let names = ["runs in another order", "seconds since 1970", "a run that is listed twice"];
    let scales = ["positions and momenta times 1,000", "time in thousandths"];
    for name in names.iter().chain(&scales) {
        let garment = GARMENTS.iter().find(|garment| garment.name == *name).expect("a garment");
        let (plain, dressed) = clothes::told(&drag, garment);
        assert_eq!(plain.as_deref(), Some("viscous_drag(q)"));
        assert_eq!(plain, dressed, "{name}");
    }
}

#[test]
fn intervals_hold_the_truth_as_often_as_they_say() {
    for law in LAWS {
        let found = Coverage::of(law, 0..25);
        let (share, intervals) = (found.share(1), found.intervals as f64);
        // Four standard errors of a share.
        let near = 4.0 * (0.95 * 0.05 / intervals).sqrt();
        assert!((share - 0.95).abs() < near, "{}: {share} of {intervals}", law.name);
        assert_eq!(found.lost, 0, "{}", law.name);
    }
}

#[test]
fn p_values_are_even_where_nothing_is_hidden() {
    for law in &LAWS[..2] {
        let (distance, chance) = kolmogorov_smirnov(&p_values(law, 0..40));
        assert!(chance > 1e-3, "{}: {distance} {chance}", law.name);
    }
}

#[test]
fn nothing_is_told_where_nothing_is_hidden() {
    let (missing, _) = told(&LAWS[0], 0..6, 0.0);
    assert_eq!(missing, 0);
}

#[test]
fn the_measure_of_evenness_is_right() {
    let even: Vec<f64> = (0..100).map(|at| (f64::from(at) + 0.5) / 100.0).collect();
    assert!((kolmogorov_smirnov(&even).0 - 0.005).abs() < 1e-12);
    assert!(kolmogorov_smirnov(&even).1 > 0.999);
    let squares: Vec<f64> = even.iter().map(|x| x * x).collect();
    // The distance of a square root from its argument is 1/4; the tables give 1.358 at 5 %.
    assert!((kolmogorov_smirnov(&squares).0 - 0.25).abs() < 0.01);
    assert!(kolmogorov_smirnov(&squares).1 < 1e-4);
}

#[test]
fn evaluators_and_streams_agree() {
    (0..300).for_each(twins::evaluators_agree);
    (0..40).for_each(twins::streams_agree);
}

#[test]
fn whole_fits_do_not_depend_on_the_evaluator() {
    assert!(twins::whole_fits_agree(0..6) > 0);
}

/// Whoever has no small disk to test on hears of it, and the rest is tested all the same.
#[test]
fn a_small_disk_is_small() {
    let Some(disk) = Disk::new(64) else { return };
    let written = fs::write(disk.path().join("large"), vec![0; 100 << 10]);
    assert!(written.is_err());
}
