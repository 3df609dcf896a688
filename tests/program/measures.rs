//! A motion that is seen by a radar: from the simulated readings to a report and an export.

use std::fs;

use crate::support::program::{good, json};

const HEAD: &str = "system \"radar\"
coordinates x [m], y [m]
momenta p_x [kg*m/s], p_y [kg*m/s]
time t [s]
measure range [m] = sqrt(x^2 + y^2)
measure bearing [rad] = atan2(y, x)
T = (p_x^2 + p_y^2)/(2*2 [kg])
";

#[test]
fn what_a_radar_sees_is_simulated_fitted_and_reported() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path();
    let data = "data \"seen.csv\" { time t [s]  run run  bearing = azimuth [deg]";
    let truth = format!(
        "{HEAD}{data} }}\nV = 8 [N/m]*(x^2 + y^2)/2\nforce x += -0.2 [1/s]*p_x\nforce y += -0.2 [1/s]*p_y\n"
    );
    let nothing = "x not measured, y not measured, p_x not measured, p_y not measured";
    let space = format!("{HEAD}{data}  {nothing} }}\nV = span{{ k: (x^2 + y^2)/2, x, y }}\n");
    fs::write(path.join("truth.ham"), truth).expect("written");
    fs::write(path.join("radar.ham"), space).expect("written");
    let starts = ["--start=1,0,0,2", "--start=-0.7,0.5,1,1.5", "--start=0.2,-1.2,2,0.1"];
    let rest = ["--duration=12", "--dt=0.1", "--seed=3", "-o", "seen.csv"];
    let noise = ["--noise", "range=0.004", "--noise", "bearing=0.004"];
    good(path, &[&["simulate", "truth.ham"][..], &starts, &noise, &rest].concat());
    let text = fs::read_to_string(path.join("seen.csv")).expect("made");
    let header = "run,t [s],x [m],y [m],p_x [kg*m/s],p_y [kg*m/s],range [m],azimuth\n";
    assert!(text.starts_with(header), "{}", &text[..80]);
    let checked = good(path, &["check", "radar.ham"]);
    assert!(checked.out.contains("measure: bearing [rad] = atan2(y, x)"), "{}", checked.out);
    assert!(!checked.err.contains("never measured"), "{}", checked.err);
    let fitted = json(path, &["fit", "radar.ham"], "leverrier.fit/1");
    let terms = fitted["model"]["terms"].as_array().expect("terms");
    assert_eq!(terms.len(), 1, "{fitted}");
    let told = good(path, &["diagnose", "radar.ham"]);
    assert!(told.out.contains("viscous_drag(x, y)"), "{}", told.out);
    let compared = good(path, &["compare", "radar.ham"]);
    assert!(!compared.out.contains("NaN"), "{}", compared.out);
    good(path, &["report", "radar.ham", "-o", "radar.html"]);
    let latex = good(path, &["export", "radar.ham", "latex"]);
    assert!(latex.out.contains("\\operatorname{atan2}(y, x)"), "{}", latex.out);
    let exported = good(path, &["export", "radar.ham", "json"]);
    assert!(exported.out.contains("\"expression\": \"atan2(y, x)\""), "{}", exported.out);
}
