//! Guards of the hot paths: how many instructions they take, counted by valgrind, so that no
//! clock and no load of the machine matters.
//!
//! Valgrind has no AVX-512: what is counted is the AVX2 code, in the profile of the tests. Where
//! valgrind is not installed the test says so and counts nothing.

use std::process::Command;

use leverrier::internals::data::{Clock, Dataset, Run};
use leverrier::internals::dynamics::systems::SYSTEMS;
use leverrier::internals::dynamics::{Batch, Dynamics, Method, Scratch, advance, taylor};
use leverrier::internals::eval::{Backend, Evaluator, Inputs, InstructionSet, apply, compile};
use leverrier::internals::expr::{Function, Graph, Symbol, System, build};
use leverrier::internals::fit::{Options, Silent, fit};

/// Names the path that a run under valgrind takes, and how often.
const TASK: &str = "LEVERRIER_COUNT";
/// A path may take this much more than when it was pinned: compilers differ.
const MARGIN: f64 = 1.25;

/// One path, its unit of work, how many units a repetition does, and the instructions of a
/// unit when it was pinned.
struct Path {
    name: &'static str,
    unit: &'static str,
    units: f64,
    pinned: f64,
    run: fn(usize),
}

const PATHS: [Path; 7] = [
    Path {
        name: "tape",
        unit: "a point of the dense gradient of degree 6",
        units: 1024.0,
        pinned: 150.0,
        run: |times| gradient(Backend::Batched, times),
    },
    Path {
        name: "machine",
        unit: "a point of the dense gradient of degree 6",
        units: 1024.0,
        pinned: 38.4,
        run: |times| gradient(Backend::Machine, times),
    },
    Path {
        name: "sines",
        unit: "the sine of a number in a long row",
        units: 1024.0,
        pinned: 18.6,
        run: sines,
    },
    Path {
        name: "steps",
        unit: "a step of the fourth-order method on Henon-Heiles",
        units: 1000.0,
        pinned: 89.0,
        run: steps,
    },
    Path {
        name: "series",
        unit: "a unit of time of Henon-Heiles by Taylor series",
        units: 100.0,
        pinned: 6600.0,
        run: |times| {
            let row = SYSTEMS.iter().find(|row| row.name == "Henon-Heiles").unwrap();
            let dynamics = Dynamics::known(&(row.build)(), Backend::Machine);
            let span = [0.0, 100.0 * times as f64];
            taylor(&dynamics, &[], row.start, &span, 0.0).unwrap();
        },
    },
    Path {
        name: "tangents",
        unit: "a step of one trajectory with tangents by 6 terms",
        units: 640.0,
        pinned: 970.0,
        run: tangents,
    },
    Path {
        name: "sparse",
        unit: "a mass of a transition of a chain, in a whole fit by sparse algebra",
        units: (CHAIN * CHAIN_PAIRS) as f64,
        pinned: 1_060_000.0,
        run: sparse_chain,
    },
];

/// Masses of the chain, and transitions that it is fitted to.
const CHAIN: usize = 16;
const CHAIN_PAIRS: usize = 24;

fn gradient(backend: Backend, times: usize) {
    let mut graph = Graph::new();
    let variables = [Symbol::Coordinate(0), Symbol::Coordinate(1)];
    let [x, y] = variables.map(|symbol| graph.symbol(symbol));
    let parts: Vec<_> = (1..49)
        .map(|k| {
            let c = graph.symbol(Symbol::Coefficient(k));
            (1.0, graph.product(1.0, &[(c, 1.0), (x, (k / 7) as f64), (y, (k % 7) as f64)]))
        })
        .collect();
    let energy = graph.linear(0.0, &parts);
    let outputs = variables.map(|symbol| graph.derivative(energy, symbol));
    let uniform = (1..49).map(Symbol::Coefficient).collect();
    let inputs = Inputs { varying: variables.to_vec(), uniform };
    let function: Box<dyn Evaluator> = compile(&graph, &inputs, &outputs, backend);
    let points: Vec<f64> = (0..2048).map(|i| (0.37 * f64::from(i)).sin()).collect();
    let (mut out, mut workspace) = (vec![0.0; 2048], Vec::new());
    for _ in 0..times {
        function.evaluate(&points, &[0.3; 48], 1024, &mut out, &mut workspace);
    }
    assert!(out.iter().all(|x| x.is_finite()));
}

fn sines(times: usize) {
    let from: Vec<f64> = (0..1024).map(|i| 0.37 * f64::from(i)).collect();
    let mut to = vec![0.0; 1024];
    for _ in 0..times {
        apply(InstructionSet::widest(), Function::by_name("sin").unwrap(), &from, &mut to);
    }
    assert!(to.iter().all(|x| x.abs() <= 1.0));
}

fn steps(times: usize) {
    let row = SYSTEMS.iter().find(|row| row.name == "Henon-Heiles").unwrap();
    let dynamics = Dynamics::known(&(row.build)(), Backend::Machine);
    let method = Method::by_name("forest-ruth").unwrap();
    let mut batch = Batch::new(2, 1);
    batch.set(0, 0.0, row.start);
    let mut scratch = Scratch::new();
    for _ in 0..times {
        advance(&dynamics, method, &mut batch, &[10.0], 1000, &[], &mut scratch);
    }
    assert!(batch.is_finite(0));
}

fn tangents(times: usize) {
    let system: System = crate::support::learned_system(false, true);
    let dynamics = Dynamics::whole(&system, Backend::Machine);
    let mut batch = Batch::with_tangents(2, 64, dynamics.unknowns());
    for lane in 0..64 {
        batch.set(lane, 0.0, &[0.1, 0.2, 0.01 * lane as f64, 0.1]);
    }
    let method = Method::by_name("forest-ruth").unwrap();
    let theta = vec![0.1; dynamics.unknowns()];
    let mut scratch = Scratch::new();
    for _ in 0..times {
        advance(&dynamics, method, &mut batch, &[0.1; 64], 10, &theta, &mut scratch);
    }
    assert!(batch.is_finite(0));
}

/// Fits a chain of masses and springs to pairs of states, so many times.
fn sparse_chain(times: usize) {
    let text = format!(
        "coordinates q[1..{CHAIN}]\nmomenta p[1..{CHAIN}]\n\
         T = span{{ p[i]^2 for i in 1..{CHAIN} }}\n\
         V = span{{ (q[i+1] - q[i])^2 for i in 1..{}, q[i]^2 for i in 1..{CHAIN} }}\n",
        CHAIN - 1
    );
    let system = build("chain", &text).unwrap().system;
    let data = Dataset {
        observables: ["q", "p"]
            .iter()
            .flat_map(|name| (1..=CHAIN).map(move |i| format!("{name}[{i}]")))
            .collect(),
        runs: (0..CHAIN_PAIRS).map(pair_of_chain).collect(),
        inputs: Vec::new(),
    };
    let mut options = Options { sparse: false, ..Options::default() };
    options.tuning.local.share = f64::INFINITY;
    for _ in 0..times {
        let model = fit(&system, &data, &options, &Silent).unwrap();
        assert_eq!(model.terms.len(), 3 * CHAIN - 1);
        assert!(model.path.is_empty(), "the dense factor was asked");
    }
}

/// Two samples of a chain in which every mass, spring and spring to the ground is one.
fn pair_of_chain(at: usize) -> Run {
    let error = |i: usize| 0.002 * ((37 * i + 91 * at) as f64).sin();
    let mut q: Vec<f64> = (0..CHAIN).map(|i| ((17 * i + 29 * at) as f64).sin()).collect();
    let mut p: Vec<f64> = (0..CHAIN).map(|i| ((23 * i + 41 * at) as f64).cos()).collect();
    let before: Vec<f64> = q.iter().chain(&p).copied().collect();
    for _ in 0..400 {
        q.iter_mut().zip(&p).for_each(|(q, p)| *q += 1.25e-4 * p);
        for i in 0..CHAIN {
            let [left, right] = [i.checked_sub(1), Some(i + 1)]
                .map(|j| j.and_then(|j| q.get(j)).map_or(0.0, |other| other - q[i]));
            p[i] += 2.5e-4 * (left + right - q[i]);
        }
        q.iter_mut().zip(&p).for_each(|(q, p)| *q += 1.25e-4 * p);
    }
    let after: Vec<f64> = q.into_iter().chain(p).collect();
    let both = |i: usize| vec![before[i] + error(2 * i), after[i] + error(2 * i + 1)];
    Run {
        name: at.to_string(),
        times: vec![0.0, 0.1],
        values: (0..2 * CHAIN).map(both).collect(),
        lines: vec![0; 2],
        clock: Clock::default(),
        inputs: Vec::new(),
        groups: Vec::new(),
        errors: Vec::new(),
    }
}

/// Fits a law to so many runs, each with a spring of its own.
fn fit_springs(runs: usize) {
    let text = "coordinates q; momenta p; param k per run = 3; T = p^2/2; V = k*q^2/2
        force q += span{ -p }";
    let system = build("springs", text).unwrap().system;
    let run = |at: usize| {
        let omega = 1.8 + 0.4 * (7 * at % 10) as f64 / 10.0;
        let times: Vec<f64> = (0..20).map(|i| 0.1 * i as f64).collect();
        let error = |i: usize| 0.01 * ((13 * i + 31 * at) as f64).sin();
        let q = (0..20).map(|i| (omega * times[i]).cos() + error(2 * i)).collect();
        let p = (0..20).map(|i| -omega * (omega * times[i]).sin() + error(2 * i + 1)).collect();
        Run {
            name: at.to_string(),
            values: vec![q, p],
            lines: vec![0; 20],
            clock: Clock::default(),
            inputs: Vec::new(),
            groups: Vec::new(),
            errors: Vec::new(),
            times,
        }
    };
    let data = Dataset {
        observables: vec!["q".to_string(), "p".to_string()],
        runs: (0..runs).map(run).collect(),
        inputs: Vec::new(),
    };
    // Segments of one length: their growth is another question.
    let options = Options { window: Some(20), ..Options::default() };
    let model = fit(&system, &data, &options, &Silent).unwrap();
    assert_eq!(model.distributions[0].values.len(), runs);
}

/// What a run under valgrind does; nothing otherwise.
#[test]
fn a_path_by_itself() {
    let Ok(task) = std::env::var(TASK) else { return };
    let (name, times) = task.split_once(' ').unwrap();
    if name == SPRINGS {
        return fit_springs(times.parse().unwrap());
    }
    let path = PATHS.iter().find(|path| path.name == name).unwrap();
    (path.run)(times.parse().unwrap());
}

/// The task of [`fit_springs`].
const SPRINGS: &str = "springs";

#[test]
fn numbers_of_runs_cost_as_much_for_each_of_many_runs_as_of_few() {
    if Command::new("valgrind").arg("--version").output().is_err() {
        println!("valgrind is not installed: no instruction was counted");
        return;
    }
    let [few, some, many] = [8, 16, 48].map(|runs| count(SPRINGS, runs));
    let (of_few, of_many) = ((some - few) / 8.0, (many - some) / 32.0);
    println!("instructions for a run more: {of_few:.0} of 8 to 16, {of_many:.0} of 16 to 48");
    assert!(of_many < MARGIN * of_few, "{of_many:.0} for {of_few:.0}");
}

/// Instructions of a path that is run so many times.
fn count(name: &str, times: usize) -> f64 {
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(std::env::current_exe().unwrap())
        .args(["--exact", "instruction_counts::a_path_by_itself", "--test-threads=1"])
        .env(TASK, format!("{name} {times}"))
        // Threads that wait count too.
        .env("RAYON_NUM_THREADS", "1")
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{name}: {text}");
    let line = text.lines().find(|line| line.contains("Collected :"));
    let number = line.and_then(|line| line.rsplit(' ').next());
    number.and_then(|number| number.parse().ok()).unwrap_or_else(|| panic!("no count in {text}"))
}

#[test]
fn hot_paths_take_no_more_instructions_than_they_did() {
    if Command::new("valgrind").arg("--version").output().is_err() {
        println!("valgrind is not installed: no instruction was counted");
        return;
    }
    if !cfg!(all(target_arch = "x86_64", target_os = "linux")) {
        println!("the counts are those of x86-64 on Linux: no instruction was counted");
        return;
    }
    let mut wrong = Vec::new();
    for path in &PATHS {
        // What starting and compiling takes is the same for few and for many.
        let found = (count(path.name, 12) - count(path.name, 2)) / (10.0 * path.units);
        println!("{}: {found:.1} instructions for {}", path.name, path.unit);
        if found > MARGIN * path.pinned {
            wrong.push(format!("{}: {found:.1}, pinned {}", path.name, path.pinned));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
