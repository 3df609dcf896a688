//! Every row of the table of exporters, over models of every kind.

use std::collections::HashMap;
use std::path::Path;
use std::process::Command;

use crate::export_cases::{Case, case, cases, reference};
use leverrier::internals::export::{EXPORTERS, IntegratorKind, Output, exporter};
use leverrier::internals::expr::Symbol;
use rayon::prelude::*;

pub(crate) fn files(output: Output) -> Vec<(String, String)> {
    match output {
        Output::Text(text) => vec![("text".to_string(), text)],
        Output::Files(files) => files,
    }
}

fn run_export(name: &str, case: &Case) -> Vec<(String, String)> {
    let row = exporter(name).unwrap();
    files((row.export)(&case.export()).unwrap())
}

pub(crate) fn write(folder: &Path, files: &[(String, String)]) {
    for (path, text) in files {
        let path = folder.join(path);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
}

/// Whether a program is installed; says so when it is not.
pub(crate) fn installed(program: &str) -> bool {
    let found = Command::new(program).arg("--version").output().is_ok_and(|o| o.status.success());
    if !found {
        eprintln!("{program} is not installed: its part of the test is left out");
    }
    found
}

#[track_caller]
pub(crate) fn run(command: &mut Command) -> String {
    let output = command.output().unwrap();
    assert!(
        output.status.success(),
        "{command:?}\n{}\n{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn every_exporter_writes_every_model() {
    for row in EXPORTERS {
        assert!(!row.description.is_empty() && !row.writes.is_empty());
        for case in cases() {
            let written = files((row.export)(&case.export()).unwrap());
            assert_eq!(written, files((row.export)(&case.export()).unwrap()), "{}", row.name);
            for (path, text) in &written {
                let place = format!("{}, {}, {path}", row.name, case.law.system().name);
                assert!(text.ends_with('\n') && text.len() > 20, "{place}");
                let numbers = text.split(|c: char| !c.is_ascii_alphanumeric());
                for word in numbers {
                    assert!(!["NaN", "nan"].contains(&word), "{place}:\n{text}");
                    assert!(word != "undefined", "{place}:\n{text}");
                }
            }
            let all: String = written.iter().map(|(_, text)| text.as_str()).collect();
            let system = case.law.system();
            let momenta = system.mechanical().into_iter().map(|i| &system.momenta[i]);
            for variable in system.coordinates.iter().chain(momenta) {
                let tex = leverrier::internals::export::letters::name(&variable.name);
                let letters = tex.trim_start_matches('\\').split('_').next().unwrap_or("");
                // MathML writes Greek letters as characters.
                let greek = row.name == "mathml" && tex.starts_with('\\');
                assert!(
                    all.contains(&variable.name) || all.contains(letters) || greek,
                    "{} does not mention {}",
                    row.name,
                    variable.name
                );
            }
        }
    }
}

#[test]
fn an_unknown_format_is_named_with_those_that_exist() {
    let error = exporter("fortran").err().unwrap();
    assert_eq!(error.kind(), leverrier::internals::error::ErrorKind::UnknownName);
    assert!(error.to_string().contains("fortran") && error.to_string().contains("latex"));
}

#[test]
fn models_that_do_not_fit_are_errors() {
    for row in EXPORTERS {
        let mut wrong = case("pendulum");
        let first = wrong.law.support()[0];
        wrong.law = wrong.law.with_term(first, f64::NAN).unwrap();
        assert!((row.export)(&wrong.export()).is_err(), "{}", row.name);
        let mut wrong = case("damped rotor");
        wrong.kind = crate::export_cases::leapfrog();
        assert!((row.export)(&wrong.export()).is_err(), "{}", row.name);
    }
}

/// Largest difference of each line's numbers from the reference integrator's states.
fn largest_difference(csv: &str, case: &Case, steps: usize) -> f64 {
    let mut largest: f64 = 0.0;
    let truth = reference(case, steps);
    let rows: Vec<Vec<f64>> = csv
        .lines()
        .filter(|line| line.starts_with(|c: char| c.is_ascii_digit() || c == '-'))
        .map(|line| line.split(',').skip(1).map(|x| x.parse().unwrap()).collect())
        .collect();
    assert_eq!(rows.len(), steps + 1);
    for (row, state) in rows.iter().zip(&truth) {
        for (a, b) in row.iter().zip(state) {
            largest = largest.max((a - b).abs());
        }
    }
    largest
}

/// Generated projects build offline, pass their own tests, and follow the model for 10,000 steps.
#[test]
fn the_rust_simulator_agrees_with_the_model() {
    cases().into_par_iter().for_each(|case| {
        let project = tempfile::tempdir().unwrap();
        write(project.path(), &run_export("rust", &case));
        if installed("rustfmt") {
            let sources = ["src/lib.rs", "src/main.rs", "tests/checks.rs"];
            run(Command::new("rustfmt")
                .args(["--edition", "2021", "--check"])
                .args(sources)
                .current_dir(&project));
        }
        let cargo = |arguments: &[&str]| {
            let program = std::env::var("CARGO").unwrap_or("cargo".to_string());
            run(Command::new(program)
                .args([&[arguments[0], "--offline", "--quiet"], &arguments[1..]].concat())
                .current_dir(&project)
                .env_remove("CARGO_TARGET_DIR")
                .env("RUSTFLAGS", "-D warnings"))
        };
        cargo(&["test"]);
        let steps = 10_000;
        let duration = (steps as f64 * case.law.stepping().longest).to_string();
        let csv = cargo(&["run", "--", "--duration", &duration]);
        let header: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
        assert_eq!(header.len(), 1 + 2 * case.law.system().degrees());
        let error = largest_difference(&csv, &case, steps);
        // A rounding error a step, each carried on with the phase of a regular orbit.
        let bound = 1e-16 * steps as f64;
        assert!(error <= bound, "{}: {error:e} after {steps} steps", case.law.system().name);
    });
}

#[test]
fn the_rust_simulator_says_what_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let case = case("damped rotor");
    write(folder.path(), &run_export("rust", &case));
    let cargo = std::env::var("CARGO").unwrap_or("cargo".to_string());
    run(Command::new(&cargo)
        .args(["build", "--offline", "--quiet"])
        .current_dir(folder.path())
        .env("CARGO_TARGET_DIR", folder.path().join("target")));
    let program = folder.path().join("target/debug/simulate_damped_rotor");
    let help = run(Command::new(&program).arg("--help"));
    for option in ["--start", "--t0", "--duration", "--step", "--every"] {
        assert!(help.contains(option), "{help}");
    }
    for (arguments, message) in [
        (vec!["--stepp", "1"], "--stepp"),
        (vec!["--step"], "needs a value"),
        (vec!["--step", "-1"], "above 0"),
        (vec!["--start", "1"], "2 values, not 1"),
        (vec!["--start", "1,x"], "`x`"),
        (vec!["--every", "0"], "above 0"),
        (vec!["--duration", "inf"], "`inf`"),
    ] {
        let output = Command::new(&program).args(&arguments).output().unwrap();
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{text}");
        assert!(text.contains(message) && output.stdout.is_empty(), "{text}");
    }
    let output = Command::new(&program)
        .args(["--start=0.3,0.5", "--step", "0.3", "--duration", "1", "--every", "2"])
        .output()
        .unwrap();
    let csv = String::from_utf8(output.stdout).unwrap();
    let times: Vec<&str> = csv.lines().skip(1).map(|l| l.split(',').next().unwrap()).collect();
    assert_eq!(times, ["0", "0.6", "1"]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("account for"));
}

#[test]
fn the_c_model_agrees_with_the_model() {
    if !installed("gcc") {
        return;
    }
    for case in cases() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), &run_export("c", &case));
        run(Command::new("gcc")
            .args([
                "-std=c99",
                "-O1",
                "-Wall",
                "-Wextra",
                "-Werror",
                "-pedantic",
                "-ffp-contract=off",
            ])
            .args(["-o", "example", "example.c", "model.c", "-lm"])
            .current_dir(folder.path()));
        let csv = run(Command::new(folder.path().join("example")).arg("2000"));
        let error = largest_difference(&csv, &case, 2000);
        assert!(error <= 1e-12, "{}: {error:e}", case.law.system().name);
    }
}

#[test]
fn the_python_module_has_the_models_numbers() {
    if !installed("python3") {
        return;
    }
    let has_sympy = Command::new("python3")
        .args(["-c", "import sympy"])
        .output()
        .is_ok_and(|o| o.status.success());
    if !has_sympy {
        eprintln!("sympy is not installed: modules are compiled, not run");
    }
    for case in cases() {
        let folder = tempfile::tempdir().unwrap();
        let written = run_export("python", &case);
        std::fs::write(folder.path().join("model.py"), &written[0].1).unwrap();
        run(Command::new("python3")
            .args(["-m", "py_compile", "model.py"])
            .current_dir(folder.path()));
        if !has_sympy {
            continue;
        }
        let script = "import model\n\
            f = model.field(model.START, model.START_TIME)\n\
            print(repr(model.energy(model.START, model.START_TIME)), *map(repr, map(float, f)), sep=',')\n\
            rows = model.simulate(steps=20)\n\
            assert len(rows) == 21\n\
            assert all(s is None or s >= 0 for _, s in model.coefficients.values())\n";
        let printed = run(Command::new("python3").args(["-c", script]).current_dir(folder.path()));
        let values: Vec<f64> = printed.trim().split(',').map(|x| x.parse().unwrap()).collect();
        let equations = crate::export_cases::Equations::new(&case);
        let (t, state) = (case.start.0, case.start.1.clone());
        let mut expected = vec![equations.energy(&state, t)];
        expected.extend(equations.field(&state, t));
        for (a, b) in values.iter().zip(&expected) {
            assert!(
                (a - b).abs() <= 1e-13 * b.abs().max(1.0),
                "{}: {a} {b}",
                case.law.system().name
            );
        }
    }
}

#[test]
fn the_latex_document_compiles() {
    let pdflatex = installed("pdflatex");
    for case in cases() {
        let document = &run_export("latex-document", &case)[0].1;
        for environment in ["document", "align*", "tabular"] {
            let begin = document.matches(&format!("\\begin{{{environment}}}")).count();
            let end = document.matches(&format!("\\end{{{environment}}}")).count();
            assert!(begin == end && begin > 0, "{environment} in {document}");
        }
        let fragment = &run_export("latex", &case)[0].1;
        assert!(document.contains(fragment.as_str()));
        if !pdflatex {
            continue;
        }
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("model.tex"), document).unwrap();
        let log = run(Command::new("pdflatex")
            .args(["-interaction=nonstopmode", "-halt-on-error", "model.tex"])
            .current_dir(folder.path()));
        assert!(!log.contains("Overfull \\hbox (1"), "{log}");
    }
}

#[test]
fn mathml_is_one_element_an_equation() {
    for case in cases() {
        let text = &run_export("mathml", &case)[0].1;
        let equations = text.matches("<math").count();
        assert_eq!(equations, text.matches("</math>").count());
        assert!(equations > 2 * case.law.system().degrees(), "{text}");
        for element in ["mrow", "mfrac", "msup", "msub"] {
            let open = text.matches(&format!("<{element}>")).count()
                + text.matches(&format!("<{element} ")).count();
            assert_eq!(open, text.matches(&format!("</{element}>")).count(), "{element}: {text}");
        }
    }
}

/// The value of an expression tree of the JSON format.
fn value(tree: &serde_json::Value, of: &HashMap<String, f64>) -> f64 {
    let number = |key: &str| tree[key].as_f64().unwrap();
    if let Some(x) = tree.get("number") {
        return x.as_f64().unwrap();
    }
    if let Some(name) = tree.get("symbol") {
        return of[name.as_str().unwrap()];
    }
    if let Some(terms) = tree.get("sum") {
        let terms = terms.as_array().unwrap().iter();
        let sum: f64 = terms.map(|t| t["factor"].as_f64().unwrap() * value(&t["of"], of)).sum();
        return sum + number("constant");
    }
    if let Some(parts) = tree.get("product") {
        let parts = parts.as_array().unwrap().iter();
        return parts
            .map(|p| value(&p["base"], of).powf(p["exponent"].as_f64().unwrap()))
            .product();
    }
    if let Some(base) = tree.get("power") {
        return value(base, of).powf(value(&tree["exponent"], of));
    }
    let function =
        leverrier::internals::expr::Function::by_name(tree["function"].as_str().unwrap()).unwrap();
    (function.row().value)(value(&tree["of"], of))
}

#[test]
fn json_holds_the_equations_of_motion() {
    for case in cases() {
        let text = &run_export("json", &case)[0].1;
        let json: serde_json::Value = serde_json::from_str(text).unwrap();
        assert_eq!(json["format"], "leverrier.export/1");
        let mut of = HashMap::new();
        let names = case.law.system().names();
        for (i, symbol) in case.law.system().state().into_iter().enumerate() {
            of.insert(names.of(symbol), case.start.1[i]);
        }
        of.insert(names.of(Symbol::Time), case.start.0);
        for learned in ["coefficients", "parameters"] {
            for number in json[learned].as_array().unwrap() {
                let name = number["name"].as_str().unwrap().to_string();
                of.insert(name, number["value"].as_f64().unwrap());
            }
        }
        let equations = crate::export_cases::Equations::new(&case);
        let energy = value(&json["equations"]["energy"]["tree"], &of);
        let expected = equations.energy(&case.start.1, case.start.0);
        assert!((energy - expected).abs() <= 1e-13 * expected.abs().max(1.0));
        let field = equations.field(&case.start.1, case.start.0);
        let lists = ["velocities", "accelerations"]
            .iter()
            .flat_map(|list| json["equations"][list].as_array().unwrap().clone());
        for (entry, expected) in lists.zip(field) {
            let value = value(&entry["tree"], &of);
            assert!((value - expected).abs() <= 1e-12 * expected.abs().max(1.0));
        }
        let kind = match case.kind {
            IntegratorKind::Splitting { .. } => "splitting",
            IntegratorKind::Implicit(_) => "implicit",
            IntegratorKind::Explicit(_) => "explicit",
        };
        assert!(json["integrator"][kind]["weights"].is_array());
    }
}
