//! A driven system, from a file of its input to the effect that is missing.

use std::fmt::Write;
use std::fs;

use crate::support::program::{good, json, run};

const TRUTH: &str = "system \"shaker\"
coordinates x [m]
momenta p [kg*m/s]
time t [s]
input f [N] { linear }
constant m = 2 [kg]
T = p^2/(2*m)
V = 3 [N/m]*x^2
force x += f - 0.4 [1/s]*p
";

const SPEC: &str = "system \"shaker\"
coordinates x [m]
momenta p [kg*m/s]
time t [s]
input f [N] { linear }
data \"shaken.csv\" { time t [s]  run run  p not measured }
constant m = 2 [kg]
T = p^2/(2*m)
V = span{ x^2 }
force x += f
";

#[test]
fn simulate_fit_and_diagnose_a_driven_system() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path();
    let mut inputs = String::from("run,t [s],f [N]\n");
    for run in 1..=6 {
        for i in 0..200 {
            let t = 0.1 * f64::from(i);
            let f = (0.7 * t * (1.0 + 0.1 * f64::from(run))).sin()
                + (2.3 * t + f64::from(run)).cos()
                + 0.5 * (4.1 * t).sin();
            let _ = writeln!(inputs, "{run},{t},{f}");
        }
    }
    fs::write(path.join("inputs.csv"), inputs).expect("written");
    let truth = TRUTH.replace("time t", "data \"shaken.csv\" { time t [s]  run run }\ntime t");
    fs::write(path.join("truth.ham"), truth).expect("written");
    fs::write(path.join("shaker.ham"), SPEC).expect("written");
    let made = run(path, &["simulate", "truth.ham", "--start=0.2,0", "--dt=0.1", "--samples=9"]);
    assert_ne!(made.code, Some(0));
    assert!(made.err.contains("what drives the motion is not given: f"), "{}", made.err);
    let make = ["simulate", "truth.ham", "--start=0.2,0", "--inputs", "inputs.csv"];
    good(path, &[&make[..], &["--noise", "x=0.002", "--seed=4", "-o", "shaken.csv"]].concat());
    let text = fs::read_to_string(path.join("shaken.csv")).expect("made");
    assert!(text.starts_with("run,t [s],x [m],p [kg*m/s],f [N]\n1,0,"), "{}", &text[..60]);
    assert_eq!(text.lines().count(), 1201);

    let fitted = json(path, &["fit", "shaker.ham"], "leverrier.fit/1");
    assert_eq!(fitted["model"]["terms"].as_array().map(Vec::len), Some(1), "{fitted}");
    let compared = good(path, &["compare", "shaker.ham"]);
    assert!(compared.out.contains("times the noise"), "{}", compared.out);
    let told = good(path, &["diagnose", "shaker.ham"]);
    assert!(told.out.contains("viscous_drag(x)"), "{}", told.out);
    good(path, &["add", "shaker.ham", "viscous_drag(x)"]);
    let fitted = json(path, &["fit", "shaker.ham"], "leverrier.fit/1");
    let terms = fitted["model"]["terms"].as_array().expect("terms");
    let number = |name: &str| {
        let term = terms.iter().find(|term| term["term"] == name).expect("learned");
        term["coefficient"].as_f64().expect("a number")
    };
    assert!((number("x^2") - 3.0).abs() < 0.02, "{fitted}");
    let drag = terms.iter().find(|term| term["place"] == "force x").expect("learned");
    let size = drag["coefficient"].as_f64().expect("a number").abs();
    assert!((size - 0.4).abs() < 0.02 || (size - 0.8).abs() < 0.04, "{drag}");
    let latex = good(path, &["export", "shaker.ham", "latex"]);
    assert!(latex.out.contains("f(t)") || !latex.out.contains("force"), "{}", latex.out);
    good(path, &["export", "shaker.ham", "c", "-o", "shaker"]);
    let header = fs::read_to_string(path.join("shaker/model.h")).expect("written");
    assert!(header.contains("double model_input(int input"), "{header}");
}
