//! The gradient of a dense polynomial of 48 terms at a million points.

use std::path::Path;

use leverrier::internals::eval::{Backend, Evaluator, Inputs, compile};
use leverrier::internals::expr::{Expr, Function, Graph, Symbol};
use serde_json::Value;

use crate::Asked;
use crate::page::{Section, ratio, time};
use crate::python::{CASADI, HEYOKA, JAX, Package, Peer, Python, number};
use crate::turns::{Turn, clocked, fastest};

const POINTS: usize = 1_000_000;
/// A virtual machine is given fewer.
const FEW: usize = 50_000;
/// Evaluations that are measured together.
const AT_ONCE: usize = 20;
const SIDE: usize = 7;
const TERMS: usize = SIDE * SIDE - 1;

fn coefficient(k: usize) -> f64 {
    0.1 * (1.7 * k as f64).sin()
}

/// Builds the expression, derives it and compiles it.
fn ours(functions: bool, backend: Backend) -> Box<dyn Evaluator> {
    let mut graph = Graph::new();
    let variables = [Symbol::Coordinate(0), Symbol::Coordinate(1)];
    let [x, y] = variables.map(|symbol| graph.symbol(symbol));
    let mut parts = Vec::new();
    for k in 1..=TERMS {
        let c = graph.symbol(Symbol::Coefficient(k));
        let powers = [(k / SIDE) as f64, (k % SIDE) as f64];
        parts.push((1.0, graph.product(1.0, &[(c, 1.0), (x, powers[0]), (y, powers[1])])));
    }
    if functions {
        let product = graph.multiply(x, y);
        for (name, inside) in [("sin", x), ("exp", y), ("sin", product)] {
            if let Some(function) = Function::by_name(name) {
                parts.push((0.3, graph.apply(function, inside)));
            }
        }
    }
    let energy = graph.linear(0.0, &parts);
    let outputs: Vec<Expr> =
        variables.iter().map(|&symbol| graph.derivative(energy, symbol)).collect();
    let uniform = (1..=TERMS).map(Symbol::Coefficient).collect();
    let inputs = Inputs { varying: variables.to_vec(), uniform };
    compile(&graph, &inputs, &outputs, backend)
}

/// Horner's scheme in both variables, one point after the other.
fn by_hand(c: &[f64; SIDE * SIDE], functions: bool, points: &[f64], out: &mut [f64]) {
    let (xs, ys) = points.split_at(points.len() / 2);
    let (by_x, by_y) = out.split_at_mut(xs.len());
    for (((&x, &y), by_x), by_y) in xs.iter().zip(ys).zip(by_x).zip(by_y) {
        let (mut value_x, mut value_y) = (0.0, 0.0);
        for i in (0..SIDE).rev() {
            let row = &c[i * SIDE..(i + 1) * SIDE];
            let (mut value, mut slope) = (row[SIDE - 1], 0.0);
            for j in (0..SIDE - 1).rev() {
                slope = slope * y + value;
                value = value * y + row[j];
            }
            if i > 0 {
                value_x = value_x * x + i as f64 * value;
            }
            value_y = value_y * x + slope;
        }
        if functions {
            let common = 0.3 * (x * y).cos();
            value_x += 0.3 * x.cos() + y * common;
            value_y += 0.3 * y.exp() + x * common;
        }
        (*by_x, *by_y) = (value_x, value_y);
    }
}

fn write(path: &Path, numbers: &[f64]) -> Result<(), String> {
    let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
    std::fs::write(path, bytes).map_err(|error| error.to_string())
}

/// Largest difference from ours as a part of the larger of 1 and the value.
fn difference(path: &Path, own: &[f64]) -> Result<f64, String> {
    let bytes = std::fs::read(path).map_err(|error| error.to_string())?;
    let theirs = bytes.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap_or([0; 8])));
    if bytes.len() != 8 * own.len() {
        return Err(format!("{} numbers instead of {}", bytes.len() / 8, own.len()));
    }
    Ok(theirs.zip(own).fold(0.0, |most, (a, b)| {
        let apart = (a - b).abs() / b.abs().max(1.0);
        if apart <= most { most } else { apart }
    }))
}

/// Shown as, argument of the script, package, whether it gets few points.
const PEERS: [(&str, &str, Package, bool); 5] = [
    ("heyoka compiled function", "heyoka", HEYOKA, false),
    ("heyoka, `fast_math`", "heyoka-fast", HEYOKA, false),
    ("JAX", "jax", JAX, false),
    ("CasADi, its virtual machine", "casadi", CASADI, true),
    ("CasADi, C by the C compiler, `-O3 -march=native`", "casadi-c", CASADI, true),
];

pub(crate) fn section(
    asked: &Asked,
    python: Result<&Python, &String>,
    functions: bool,
) -> Result<Section, String> {
    let (title, more) = if functions {
        ("Gradient with sin and exp", " + 0.3 (sin x + exp y + sin xy)")
    } else {
        ("Gradient of a polynomial", "")
    };
    let about = format!(
        "Both derivatives of the sum of 48 terms c x^i y^j, i and j up to 6{more}, at 1,000,000 \
         points (50,000 for CasADi) that lie column by column in memory. Compilation begins with \
         the sum and ends with a function that can be called. The coefficients are arguments of \
         our function and constants of the others. By hand: Horner's scheme, scalar Rust, \
         release."
    );
    let columns = [
        "who",
        "a point",
        "times ours",
        "compilation",
        "times ours",
        "largest difference from ours",
    ];
    let mut section = Section::new(title, &about, &columns);
    let points: Vec<f64> = (0..2 * POINTS).map(|i| (0.37 * i as f64).sin()).collect();
    let few: Vec<f64> = [&points[..FEW], &points[POINTS..POINTS + FEW]].concat();
    let coefficients: Vec<f64> = (1..=TERMS).map(coefficient).collect();
    let fastest_compilation = |backend: Backend| {
        let (function, mut compilation) = clocked(|| ours(functions, backend));
        for _ in 0..20 {
            compilation = clocked(|| ours(functions, backend)).1.min(compilation);
        }
        (function, compilation)
    };
    let (function, compilation) = fastest_compilation(Backend::Machine);
    let (portable, portable_compilation) = fastest_compilation(Backend::Batched);
    let (mut out, mut workspace) = (vec![0.0; 2 * POINTS], Vec::new());
    let (mut by_hand_out, mut portable_out) = (out.clone(), out.clone());
    let mut portable_workspace = Vec::new();
    let mut table = [0.0; SIDE * SIDE];
    (1..=TERMS).for_each(|k| table[k] = coefficient(k));

    let file = |name: &str| asked.folder.join(format!("{name}.f64"));
    write(&file("points"), &points)?;
    write(&file("few-points"), &few)?;
    let start = |(_, library, package, is_few): &(&str, &str, Package, bool)| {
        let python = python.map_err(String::clone)?;
        let from = file(if *is_few { "few-points" } else { "points" });
        let arguments = [
            library.to_string(),
            u8::from(functions).to_string(),
            from.display().to_string(),
            file(library).display().to_string(),
        ];
        python.start(package, "gradient.py", &arguments)
    };
    let mut peers: Vec<Result<(Peer, Value), String>> = PEERS.iter().map(start).collect();
    let answers: Vec<Value> = peers
        .iter()
        .map(|peer| peer.as_ref().map_or(Value::Null, |(_, answer)| answer.clone()))
        .collect();
    let mut turns: Vec<Turn> = vec![
        Box::new(|| {
            let mut once =
                || function.evaluate(&points, &coefficients, POINTS, &mut out, &mut workspace);
            Ok(clocked(|| (0..AT_ONCE).for_each(|_| once())).1 / (AT_ONCE * POINTS) as f64)
        }),
        Box::new(|| {
            let (out, workspace) = (&mut portable_out, &mut portable_workspace);
            let mut once = || portable.evaluate(&points, &coefficients, POINTS, out, workspace);
            Ok(clocked(|| (0..AT_ONCE).for_each(|_| once())).1 / (AT_ONCE * POINTS) as f64)
        }),
        Box::new(|| {
            let mut once = || by_hand(&table, functions, &points, &mut by_hand_out);
            Ok(clocked(|| (0..AT_ONCE).for_each(|_| once())).1 / (AT_ONCE * POINTS) as f64)
        }),
    ];
    for (peer, (_, _, _, is_few)) in peers.iter_mut().zip(&PEERS) {
        let count = if *is_few { FEW } else { POINTS };
        turns.push(Box::new(move || match peer {
            Ok((peer, _)) => Ok(peer.seconds()? / count as f64),
            Err(why) => Err(why.clone()),
        }));
    }
    let times = fastest(if asked.quick.is_some() { 3 } else { 30 }, &mut turns);
    drop(turns);

    let own = times[0].clone()?;
    section.row(&["Leverrier", &time(own), "1", &time(compilation), "1", ""]);
    let seconds = times[1].clone()?;
    section.row(&[
        "Leverrier, without machine code",
        &time(seconds),
        &ratio(seconds / own),
        &time(portable_compilation),
        &ratio(portable_compilation / compilation),
        if portable_out == out { "none" } else { "some" },
    ]);
    let hand = times[2].clone()?;
    let apart = out.iter().zip(&by_hand_out).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
    let apart = format!("{apart:.0e}");
    section.row(&["by hand", &time(hand), &ratio(hand / own), "", "", &apart]);
    let own_few = [&out[..FEW], &out[POINTS..POINTS + FEW]].concat();
    for (((who, library, _, is_few), seconds), answer) in
        PEERS.iter().zip(&times[3..]).zip(&answers)
    {
        match seconds {
            Ok(seconds) => {
                let whole = if *is_few { &own_few } else { &out };
                let apart = difference(&file(library), whole)?;
                let compile = number(answer, "compile");
                let who = match (*who, answer["version"].as_str()) {
                    (who, Some(version)) => format!("{who} ({version})"),
                    (who, None) => who.to_string(),
                };
                section.row(&[
                    &who,
                    &time(*seconds),
                    &ratio(seconds / own),
                    &time(compile),
                    &ratio(compile / compilation),
                    &format!("{apart:.0e}"),
                ]);
            }
            Err(why) => section.not_run(who, why),
        }
    }
    Ok(section)
}
