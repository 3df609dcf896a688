//! Forces with a kink, in data that were computed: no method has an order across one, and what the
//! integrator leaves is no effect.

use std::fs;

use leverrier::{Discovery, DiscoveryOptions, Silent, Spec, Verdict};

/// Fine steps of the classical method of Runge and Kutta, from a start, at so many times.
fn motion(
    force: fn(f64, f64) -> f64,
    mut state: [f64; 2],
    step: f64,
    samples: usize,
) -> Vec<[f64; 2]> {
    const FINE: usize = 200;
    let h = step / FINE as f64;
    let rate = |[x, v]: [f64; 2]| [v, force(x, v)];
    let moved = |[x, v]: [f64; 2], [a, b]: [f64; 2], h: f64| [x + h * a, v + h * b];
    let mut all = vec![state];
    while all.len() < samples {
        for _ in 0..FINE {
            let a = rate(state);
            let b = rate(moved(state, a, h / 2.0));
            let c = rate(moved(state, b, h / 2.0));
            let d = rate(moved(state, c, h));
            let mean = |i: usize| (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]) / 6.0;
            state = moved(state, [mean(0), mean(1)], h);
        }
        all.push(state);
    }
    all
}

/// What `discover` finds in four such motions of `x'' = force`, beside all polynomials of degree 4.
fn found(force: fn(f64, f64) -> f64, starts: [[f64; 2]; 4]) -> Discovery {
    let mut text = String::from("t,run,x,v\n");
    for (run, start) in starts.into_iter().enumerate() {
        for (sample, [x, v]) in motion(force, start, 0.075, 200).into_iter().enumerate() {
            text += &format!("{},{run},{x},{v}\n", 0.075 * sample as f64);
        }
    }
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("d.csv"), text).expect("written");
    let spec = "coordinates x\nvelocities v\ndata \"d.csv\" { time t  run run }\nT = v^2/2\n\
                V = span{ poly(x; 4) }\n";
    fs::write(folder.path().join("s.ham"), spec).expect("written");
    let spec = Spec::open(folder.path().join("s.ham")).expect("a spec");
    let (training, held_out) = spec.data().expect("data").split(0.25, 0).expect("two parts");
    let options = DiscoveryOptions::default();
    spec.discover(&training, &held_out, &options, &Silent).expect("a law")
}

#[test]
fn a_force_with_a_kink_is_found_in_computed_data() {
    let force = |x: f64, v: f64| -x - 0.8 * x.powi(3) - 0.2 * v + 0.6 * (1.0 + v.abs()).ln();
    let found = found(force, [[0.38, 1.19], [0.83, -0.82], [-0.6, 1.1], [-1.3, 0.2]]);
    let terms: Vec<&str> = found.law().terms().iter().map(|term| term.term.as_str()).collect();
    let text = found.law().spec().text();
    assert_eq!(found.verdict(), Verdict::NothingMissing, "{text}");
    assert_eq!(terms.len(), 4, "{terms:?}");
    assert!(text.contains("effect viscous_drag(x)"), "{text}");
    assert!(text.contains("log(1 + abs(p_x))"), "{text}");
}

#[test]
fn a_force_as_large_as_all_that_is_known_is_found() {
    let force = |x: f64, v: f64| -2.0 * x - 0.5 * x * v.abs();
    for last in [[-1.3, 0.2], [-1.5, 0.96]] {
        let found = found(force, [[0.38, 1.19], [0.83, -0.82], [-0.6, 1.1], last]);
        let terms = found.law().terms();
        let text = found.law().spec().text();
        assert_eq!(found.verdict(), Verdict::NothingMissing, "{text}");
        assert_eq!(terms.len(), 2, "{text}");
        assert!(text.contains("x*abs(p_x)"), "{text}");
        assert!((terms[1].coefficient.abs() - 0.5).abs() < 1e-3, "{text}");
    }
}
