//! Two implementations of one thing, held against each other on random expressions and data: the
//! evaluators to the bit where that is promised, the stream and the table in memory as a whole.

use leverrier::internals::eval::{Backend, Inputs, InstructionSet, compile, compile_for};
use leverrier::internals::expr::{Expr, Graph, Symbol};
use proptest::prelude::Strategy;
use proptest::strategy::ValueTree as _;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;

use crate::support::{Shape, rounding, shape};

/// A source of expressions that is the same on every machine.
fn runner(seed: u64) -> TestRunner {
    let bytes: Vec<u8> = super::choices::bytes(seed, 32);
    TestRunner::new_with_rng(Config::default(), TestRng::from_seed(RngAlgorithm::ChaCha, &bytes))
}

/// Random expressions at random points, evaluated by everything that evaluates.
///
/// The portable evaluator and machine code give the same bits on every instruction set; the
/// reference gives them too, but for its own order of sums, to rounding; and so does the graph.
pub(crate) fn evaluators_agree(seed: u64) {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut runner = runner(seed);
    let count = random.random_range(1..4);
    let shapes: Vec<Shape> =
        (0..count).map(|_| shape().new_tree(&mut runner).expect("a shape").current()).collect();
    let mut graph = Graph::new();
    let outputs: Vec<Expr> = shapes.iter().map(|shape| shape.build(&mut graph)).collect();
    let inputs = Inputs {
        varying: vec![Symbol::Momentum(0), Symbol::Coordinate(0), Symbol::Time],
        uniform: vec![Symbol::Coefficient(0), Symbol::Parameter(0)],
    };
    let lanes = [1, 7, 127, 128, 129, 300][random.random_range(0..6)];
    let size = [1.2, 1.2, 30.0, 1e6][random.random_range(0..4)];
    let points: Vec<f64> = (0..3 * lanes).map(|_| size * random.random_range(-1.0..1.0)).collect();
    let uniform = [random.random_range(-2.0..2.0), random.random_range(-2.0..2.0)];
    let evaluated = |backend, set: Option<InstructionSet>| {
        let function = match set {
            Some(set) => compile_for(&graph, &inputs, &outputs, backend, set),
            None => compile(&graph, &inputs, &outputs, backend),
        };
        let mut out = vec![7.0; outputs.len() * lanes];
        function.evaluate(&points, &uniform, lanes, &mut out, &mut Vec::new());
        out
    };
    let reference = evaluated(Backend::Reference, None);
    let portable = evaluated(Backend::Batched, None);
    for backend in [Backend::Batched, Backend::Machine] {
        for set in InstructionSet::available() {
            let other = evaluated(backend, Some(set));
            for (at, (a, b)) in portable.iter().zip(&other).enumerate() {
                let same = a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
                assert!(same, "seed {seed}, {backend:?} {set:?}, {at}: {b:e} against {a:e}");
            }
        }
    }
    for (row, &output) in outputs.iter().enumerate() {
        for lane in 0..lanes {
            let of = |symbol| match symbol {
                Symbol::Momentum(0) => points[lane],
                Symbol::Coordinate(0) => points[lanes + lane],
                Symbol::Time => points[2 * lanes + lane],
                Symbol::Coefficient(0) => uniform[0],
                Symbol::Parameter(0) => uniform[1],
                _ => f64::NAN,
            };
            let truth = graph.value(output, &of);
            let near = rounding(&graph, output, &of);
            for found in [&reference, &portable] {
                let value = found[row * lanes + lane];
                let agree = match truth.is_finite() && near.is_finite() {
                    true => (value - truth).abs() <= near,
                    // Overflow may come earlier or later; what is undefined stays so.
                    false => !truth.is_nan() || !value.is_finite(),
                };
                assert!(agree, "seed {seed}: {value:e} against {truth:e}");
            }
        }
    }
}

/// The same random table read in chunks of any size, and whole.
pub(crate) fn streams_agree(seed: u64) {
    use leverrier::internals::data::{FileSource, Mapping, ObservableMap, Source as _, read};
    let mut random = Pcg64::seed_from_u64(seed);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("data.csv");
    let mut text = "run,t,x,y\n".to_string();
    for run in 0..random.random_range(1..6) {
        let mut time: f64 = random.random_range(-5.0..5.0);
        for _ in 0..random.random_range(2..40) {
            time += random.random_range(0.001..0.5);
            let (x, y): (f64, f64) = (random.random(), random.random());
            let hole = random.random_range(0..12) == 0;
            text += &format!(
                "r{run},{time},{x},{}\n",
                if hole { String::new() } else { y.to_string() }
            );
        }
    }
    std::fs::write(&path, text).expect("written");
    let observables = ["x", "y"].map(ObservableMap::plain).to_vec();
    let mapping = Mapping { run: Some("run".to_string()), observables, ..Mapping::default() };
    let table = read(&path).expect("a table");
    let (whole, _) = leverrier::internals::data::dataset(&table, &mapping).expect("sound data");
    let chunk = random.random_range(1..60);
    let source = FileSource::new(&path, &mapping, false).expect("a source").with_chunks(chunk);
    let mut pass = source.pass().expect("a pass");
    let mut found: Vec<u64> = Vec::new();
    while let Some(chunk) = pass.next().expect("sound data") {
        found.extend(chunk.times.iter().map(|t| t.to_bits()));
    }
    let held: Vec<u64> =
        whole.runs.iter().flat_map(|run| run.times.iter().map(|t| t.to_bits())).collect();
    assert_eq!(found, held, "seed {seed}, chunks of {chunk}");
}

/// Whole fits of random small specs with machine code and with the portable evaluators, in
/// processes of their own: the same text to the last digit. How many of them came to a law.
pub(crate) fn whole_fits_agree(seeds: std::ops::Range<u64>) -> usize {
    use super::choices::{Choices, bytes};
    let mut laws = 0;
    for seed in seeds {
        let folder = tempfile::tempdir().expect("a folder");
        let (text, table) = super::runs::made(&mut Choices::new(&bytes(seed, 400)));
        std::fs::write(folder.path().join("s.ham"), &text).expect("written");
        std::fs::write(folder.path().join("data.csv"), table).expect("written");
        let learned = |backend: &str, threads: &str| {
            let mut command = std::process::Command::new(super::killing::program());
            command.args(["fit", "s.ham", "-o", "m.json", "--threads", threads]);
            command.env("LEVERRIER_BACKEND", backend).current_dir(folder.path());
            let output = command.output().expect("the program runs");
            let file = std::fs::read_to_string(folder.path().join("m.json")).ok();
            let _ = std::fs::remove_file(folder.path().join("m.json"));
            (file, String::from_utf8_lossy(&output.stderr).into_owned())
        };
        let one = learned("machine", "2");
        assert_eq!(one, learned("batched", "1"), "seed {seed}\n{text}");
        laws += usize::from(one.0.is_some());
    }
    laws
}
