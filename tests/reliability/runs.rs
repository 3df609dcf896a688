//! Whole small runs on specs and measurements that nobody would write: learned, held against the
//! data, asked what is missing, exported. Each ends with a result or a sentence, and in time.

use std::fmt::Write as _;
use std::path::Path;
use std::time::{Duration, Instant};

use leverrier::{Data, Law, Monitor, Options, Result, Spec};

use super::choices::Choices;

/// A run is told to stop after this time.
const ENOUGH: Duration = Duration::from_secs(4);

const FUNCTIONS: &[&str] = &["sin", "cos", "exp", "log", "sqrt", "abs", "tanh", "sign", "atan"];
const EFFECTS: &[&str] = &[
    "viscous_drag",
    "coulomb_friction",
    "constant_force",
    "harmonic_drive",
    "cubic_spring",
    "quadratic_drag",
    "sensor_offset",
    "periodic_substrate",
];

/// The text of a spec and of a table that it may read.
pub(crate) fn made(choices: &mut Choices) -> (String, String) {
    let names = choices.pick(&[&["q"][..], &["x", "y"], &["q"], &["theta"], &["a", "b", "c"]]);
    let momenta: Vec<String> = names.iter().map(|name| format!("p_{name}")).collect();
    let velocities = choices.one_in(4);
    let seconds: Vec<String> = match velocities {
        true => names.iter().map(|name| format!("v_{name}")).collect(),
        false => momenta.clone(),
    };
    let mut text = format!("coordinates {}\n", names.join(", "));
    let kind = if velocities { "velocities" } else { "momenta" };
    let _ = writeln!(text, "{kind} {}\ntime t", seconds.join(", "));
    let runs = choices.below(4) + 1;
    let input = choices.one_in(6);
    if input {
        let how = choices.pick(&["hold", "linear", "spline", "band_limited"]);
        let _ = writeln!(text, "input u {{ {how} }}");
    }
    let unmeasured = choices.one_in(5);
    let none = if unmeasured { format!("  {} not measured", seconds[0]) } else { String::new() };
    let run = if runs > 1 { "  run run" } else { "" };
    let _ = writeln!(text, "data \"data.csv\" {{ time t{run}{none} }}");
    let parameter = choices.one_in(4);
    if parameter {
        let per = if choices.one_in(4) { " per run" } else { "" };
        let bounds = choices.pick(&["", " in 0.1..5", " in 0..", " in -2..2"]);
        let _ = writeln!(text, "param k{per} = {}{bounds}", choices.number().abs());
    }
    if choices.one_in(12) {
        text.push_str("hidden z = 0.1 with p_z\n");
    }
    if choices.one_in(12) {
        let _ = writeln!(text, "state w {{ w' = {} - w }}", names[0]);
    }
    let of_momenta: Vec<&str> = momenta.iter().map(String::as_str).collect();
    let inner = if parameter { Some("k") } else { None };
    let kinetic = match choices.below(4) {
        0 | 1 => momenta.iter().map(|p| format!("{p}^2/2")).collect::<Vec<_>>().join(" + "),
        2 => format!("span{{ {} }}", terms(choices, &of_momenta, None)),
        _ => expression(choices, &of_momenta, inner, 2),
    };
    let _ = writeln!(text, "T = {kinetic}");
    let potential = match choices.below(4) {
        0..=2 => format!("span{{ {} }}", terms(choices, names, inner)),
        _ => expression(choices, names, inner, 3),
    };
    let _ = writeln!(text, "V = {potential}");
    let all: Vec<&str> = names.iter().copied().chain(of_momenta.iter().copied()).collect();
    if choices.one_in(3) {
        let force = match choices.below(3) {
            0 => format!("span{{ {} }}", terms(choices, &all, inner)),
            1 if input => "u".to_string(),
            _ => expression(choices, &all, inner, 2),
        };
        let _ = writeln!(text, "force {} += {force}", names[0]);
    }
    if choices.one_in(4) {
        let _ = writeln!(text, "effect {}({})", choices.pick(EFFECTS), names[0]);
    }
    (text, table(choices, names, &seconds, runs, (input, unmeasured)))
}

fn terms(choices: &mut Choices, of: &[&str], inner: Option<&str>) -> String {
    let count = choices.below(3) + 1;
    let one = |choices: &mut Choices| match choices.below(5) {
        0 => format!("poly({}; {})", of.join(", "), choices.below(4) + 1),
        1 => format!("trig({}; {})", of[0], choices.below(2) + 1),
        2 => format!("{}^{}", of[0], choices.below(6) + 1),
        3 => format!("tensor({}; 2)", of[0]),
        _ => expression(choices, of, inner, 2),
    };
    (0..count).map(|_| one(choices)).collect::<Vec<_>>().join(", ")
}

fn expression(choices: &mut Choices, of: &[&str], inner: Option<&str>, depth: usize) -> String {
    let kind = if depth == 0 { choices.below(3) } else { choices.below(8) };
    let part = |choices: &mut Choices| expression(choices, of, inner, depth.saturating_sub(1));
    match kind {
        0 | 1 => choices.pick(of).to_string(),
        2 => match inner {
            Some(inner) if choices.one_in(2) => inner.to_string(),
            _ => format!("{}", choices.number().abs()),
        },
        3 => format!("({} + {})", part(choices), part(choices)),
        4 => format!("({} - {})", part(choices), part(choices)),
        5 => format!("{}*{}", part(choices), part(choices)),
        6 => format!("({})^{}", part(choices), choices.pick(&["2", "3", "(-1)", "0.5", "4"])),
        _ => format!("{}({})", choices.pick(FUNCTIONS), part(choices)),
    }
}

/// A table of such columns, measured well or badly.
fn table(
    choices: &mut Choices,
    names: &[&str],
    seconds: &[String],
    runs: usize,
    (input, unmeasured): (bool, bool),
) -> String {
    let mut header = vec!["t".to_string()];
    header.extend(names.iter().map(|name| name.to_string()));
    header.extend(seconds.iter().skip(usize::from(unmeasured)).cloned());
    if input {
        header.push("u".to_string());
    }
    let values = header.len() - 1;
    if runs > 1 {
        header.insert(0, "run".to_string());
    }
    let mut text = header.join(",") + "\n";
    let samples = choices.pick(&[12, 3, 2, 24, 40, 1]);
    let step = choices.pick(&[0.1, 0.1, 1.0, 1e-3, 1e4]);
    let origin = choices.pick(&[0.0, 0.0, 0.0, 1e6, -3.0]);
    let size = choices.pick(&[1.0, 1.0, 1e-3, 1e3, 1e9]);
    let (noise, holes) = (choices.pick(&[0.01, 0.0, 0.3]), choices.one_in(5));
    for run in 0..runs {
        let (turn, phase) = (1.0 + 0.1 * choices.number().clamp(-9.0, 9.0), run as f64);
        let kind = choices.below(10);
        for sample in 0..samples {
            let time = step * sample as f64;
            let mut cells = Vec::new();
            if runs > 1 {
                cells.push(format!("r{run}"));
            }
            cells.push(format!("{}", origin + time));
            for column in 0..values {
                let own = turn * sample as f64 * 0.1 + phase + 1.6 * column as f64;
                let clean = match kind {
                    0..=6 => size * own.sin(),
                    7 => size,
                    8 => size * f64::from(choices.byte()),
                    _ => choices.number(),
                };
                let value = clean + size * noise * (f64::from(choices.byte()) / 128.0 - 1.0);
                let hole = holes && choices.one_in(5);
                cells.push(if hole { String::new() } else { format!("{value}") });
            }
            text += &(cells.join(",") + "\n");
        }
    }
    text
}

/// Says that it has had enough.
struct Until(Instant);

impl Monitor for Until {
    fn stage(&self, _: &str, _: f64) {}

    fn stopped(&self) -> bool {
        Instant::now() > self.0
    }
}

/// One whole run in a folder; what came of it. Whoever asks for it looks at the time.
pub(crate) fn run(choices: &mut Choices, folder: &Path) -> Result<()> {
    let (text, table) = made(choices);
    std::fs::write(folder.join("data.csv"), &table).expect("a temporary folder can be written");
    let done = carried_out(&text, folder);
    if let Err(error) = &done {
        let said = error.to_string();
        assert!(said.len() > 10 && !said.contains("report it"), "{said}\n{text}\n{table}");
    }
    done
}

fn carried_out(text: &str, folder: &Path) -> Result<()> {
    let monitor = Until(Instant::now() + ENOUGH);
    let spec = Spec::parse(text)?;
    let data = Data::open(folder.join("data.csv"), &spec)?;
    let law = spec.fit_monitored(&data, &Options::default(), &monitor)?;
    let finite = law.terms().iter().all(|term| term.coefficient.is_finite());
    assert!(finite, "{:?}\n{text}", law.terms());
    let again = Law::from_model_json(&law.model_json()?, &spec)?;
    assert_eq!(again.terms(), law.terms(), "{text}");
    exported(&law)?;
    let (training, held_out) = data.split(0.25, 0)?;
    law.compare(&held_out)?;
    law.diagnose_monitored(&training, &held_out, &Default::default(), &monitor)?;
    Ok(())
}

/// Every export of text; a law without terms may have nothing to export.
fn exported(law: &Law) -> Result<()> {
    law.to_latex()?;
    law.to_latex_document()?;
    law.to_mathml()?;
    law.to_python()?;
    law.to_json()?;
    Ok(())
}
