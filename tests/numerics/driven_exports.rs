//! Generated simulators of driven systems: they follow what they are given.

use std::path::Path;
use std::process::Command;

use leverrier::Spec;

use crate::exporters::{installed, run};

const SPEC: &str = "system \"cart\"; coordinates x [m]; momenta p [kg*m/s]; time t [s]
input u [N] { linear }
T = p^2/(2*2 [kg])
V = 3 [N/m]*x^2/2
force x += 0.7*u + 0.3*delayed(u, 0.02 [s]) - 0.1 [1/s]*p";
const STEPS: usize = 400;

/// Times and values of the input, and where the motion goes by the library.
fn truth() -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let law = Spec::parse(SPEC).unwrap().known_law().unwrap();
    let step = 0.01;
    let times: Vec<f64> = (0..=STEPS).map(|i| step * i as f64).collect();
    let input: Vec<f64> = times.iter().map(|t| (3.0 * t).sin() + 0.5).collect();
    let motion = law.predict_driven(&[0.4, -0.2], &times, &times, &[&input]).unwrap();
    (times, input, motion.states().last().unwrap().clone())
}

/// The last line of a program's output, without its time.
fn last(csv: &str) -> Vec<f64> {
    let line = csv.lines().last().unwrap();
    line.split(',').skip(1).map(|x| x.parse().unwrap()).collect()
}

fn close(found: &[f64], truth: &[f64], tolerance: f64, what: &str) {
    for (a, b) in found.iter().zip(truth) {
        assert!((a - b).abs() < tolerance, "{what}: {found:?}, not {truth:?}");
    }
}

/// A file of the input, with another column in between.
fn written(folder: &Path, times: &[f64], input: &[f64]) -> std::path::PathBuf {
    let mut text = "t,note,u\n".to_string();
    for (t, u) in times.iter().zip(input) {
        text += &format!("{t},7,{u}\n");
    }
    let path = folder.join("inputs.csv");
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn the_rust_simulator_reads_its_inputs() {
    let folder = tempfile::tempdir().unwrap();
    let (times, input, truth) = truth();
    let law = Spec::parse(SPEC).unwrap().known_law().unwrap();
    law.to_rust(folder.path().join("cart")).unwrap();
    let project = folder.path().join("cart");
    if installed("rustfmt") {
        let sources = ["src/lib.rs", "src/main.rs", "src/inputs.rs"];
        run(Command::new("rustfmt")
            .args(["--edition", "2021", "--check"])
            .args(sources)
            .current_dir(&project));
    }
    let cargo = std::env::var("CARGO").unwrap_or("cargo".to_string());
    run(Command::new(&cargo)
        .args(["build", "--offline", "--quiet"])
        .current_dir(&project)
        .env("CARGO_TARGET_DIR", folder.path().join("target"))
        .env("RUSTFLAGS", "-D warnings"));
    let program = folder.path().join("target/debug/simulate_cart");
    let path = written(folder.path(), &times, &input);
    let arguments = ["--start=0.4,-0.2", "--step", "0.01", "--duration", "4", "--every", "400"];
    let csv = run(Command::new(&program).args(arguments).arg("--inputs").arg(&path));
    close(&last(&csv), &truth, 1e-9, "rust");
    let short = folder.path().join("short.csv");
    std::fs::write(&short, "t,u\n0,1\n0,2\n").unwrap();
    for (path, message) in [(short.as_path(), "do not ascend"), (Path::new("none.csv"), "none.csv")]
    {
        let output = Command::new(&program).arg("--inputs").arg(path).output().unwrap();
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && text.contains(message), "{text}");
    }
}

#[test]
fn the_c_model_takes_a_function() {
    if !installed("gcc") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (times, input, truth) = truth();
    let law = Spec::parse(SPEC).unwrap().known_law().unwrap();
    law.to_c(folder.path().join("cart")).unwrap();
    let list = |values: &[f64]| values.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    let program = format!(
        "#include <stdio.h>\n#include \"model.h\"\n\
         static const double ts[] = {{{}}}, us[] = {{{}}};\n\
         double model_input(int input, int order, double time) {{\n\
         int i;\n\
         (void)input; (void)order;\n\
         if (time < 0) time = 0;\n\
         i = (int)(time / 0.01 + 1e-9);\n\
         if (i > {last}) i = {last};\n\
         return us[i] + (us[i + 1] - us[i]) * (time - ts[i]) / (ts[i + 1] - ts[i]);\n}}\n\
         int main(void) {{\n double q[1] = {{0.4}}, p[1] = {{-0.2}};\n int n;\n\
         for (n = 0; n < {STEPS}; n++) if (model_step(q, p, n * 0.01, 0.01)) return 1;\n\
         printf(\"0,%.17g,%.17g\\n\", q[0], p[0]);\n return 0;\n}}\n",
        list(&times),
        list(&input),
        last = STEPS - 1,
    );
    let project = folder.path().join("cart");
    std::fs::write(project.join("own.c"), program).unwrap();
    let flags = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-pedantic"];
    for source in ["example.c", "own.c"] {
        run(Command::new("gcc")
            .args(flags)
            .args(["-o", "program", source, "model.c", "-lm"])
            .current_dir(&project));
    }
    close(&last(&run(&mut Command::new(project.join("program")))), &truth, 1e-9, "c");
}

#[test]
fn the_python_module_takes_a_function() {
    let has_sympy = Command::new("python3").args(["-c", "import sympy"]).output();
    if !has_sympy.is_ok_and(|output| output.status.success()) {
        eprintln!("sympy is not installed: the test is left out");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (_, _, truth) = truth();
    let law = Spec::parse(SPEC).unwrap().known_law().unwrap();
    std::fs::write(folder.path().join("model.py"), law.to_python().unwrap()).unwrap();
    let script = "import model, math\n\
        f = lambda t: math.sin(3*max(t, 0)) + 0.5\n\
        assert 'delayed(u, 0.02)' in str(model.driving), model.driving\n\
        u = lambda t: (f(t), f(t - 0.02))\n\
        rows = model.simulate([0.4, -0.2], steps=4000, step=0.001, t=0.0, inputs=u)\n\
        print(0, *rows[-1][1], sep=',')\n\
        try: model.simulate()\n\
        except TypeError as error: assert 'inputs' in str(error)\n\
        else: raise SystemExit('no inputs were asked for')\n";
    let printed = run(Command::new("python3").args(["-c", script]).current_dir(folder.path()));
    // Straight lines between the samples are that far from the sine.
    close(&last(&printed), &truth, 1e-4, "python");
}
