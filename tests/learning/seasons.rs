//! Records with a hole after every few samples, as those of stars by seasons.

use std::fs;

use leverrier::{Law, Spec};

/// Samples of a season, and seasons.
const SEASON: usize = 10;
const SEASONS: usize = 30;

/// A damped oscillator with stiffness 1.0001 and damping 0.02, seen in seasons, with its own motion
/// in each of them (`released`) or one motion through all.
fn law(seed: u64, released: bool) -> Law {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    let mut generator = rand_pcg::Pcg64::seed_from_u64(seed);
    let mut text = String::from("t,x\n");
    for sample in 0..SEASON * SEASONS {
        let (season, night) = (sample / SEASON, sample % SEASON);
        let time = 5.3 * season as f64 + 0.2 * night as f64;
        // Each released motion begins a little earlier than the time that has passed.
        let moved = if released { time - 1.3 * season as f64 } else { time };
        let draw: f64 = StandardNormal.sample(&mut generator);
        let value = (-0.01 * moved).exp() * moved.cos() + 0.02 * draw;
        text += &format!("{time},{value}\n");
    }
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("d.csv"), text).expect("written");
    let spec = "coordinates x\nmomenta p\ntime t\ndata \"d.csv\" { time t  p not measured }\n\
                T = p^2/2\nV = span{ poly(x; 3) }\nforce x += span{ -p }\n";
    fs::write(folder.path().join("s.ham"), spec).expect("written");
    let spec = Spec::open(folder.path().join("s.ham")).expect("a spec");
    spec.fit(&spec.data().expect("data")).expect("a law")
}

fn number(law: &Law, label: &str) -> Option<(f64, f64)> {
    let term = law.terms().iter().find(|term| term.term == label)?;
    Some((term.coefficient, term.standard_error))
}

#[test]
fn a_motion_is_followed_from_season_to_season() {
    let mut pulls = 0.0;
    for seed in 0..6 {
        let law = law(seed, false);
        let (stiffness, error) = number(&law, "x^2").expect("a spring");
        let (drag, of_drag) = number(&law, "-p").expect("drag");
        assert_eq!(law.terms().len(), 2, "{:?}", law.terms());
        // Of a season alone the stiffness is known to a few percent, and the drag not at all.
        assert!(error < 5e-4 && of_drag < 2e-3, "{error} {of_drag}");
        pulls += ((stiffness - 0.500_05) / error).powi(2) + ((drag - 0.02) / of_drag).powi(2);
    }
    // The mean of twelve squares that are each one by themselves.
    assert!((0.2..2.4).contains(&(pulls / 12.0)), "{pulls}");
}

#[test]
fn a_motion_that_begins_anew_in_every_season_is_not_joined() {
    for seed in 0..6 {
        let law = law(seed, true);
        let (stiffness, error) = number(&law, "x^2").expect("a spring");
        assert!(((stiffness - 0.500_05) / error).abs() < 4.0, "{stiffness} {error}");
        assert!(error > 1e-3, "{error}");
    }
}
