//! Data larger than memory: chunk by chunk the fit is that of the whole data.

use std::sync::atomic::{AtomicUsize, Ordering};

use leverrier::internals::data::{
    Dataset, FileSource, InMemory, Layout, Mapping, ObservableMap, Source, dataset, head,
    memory_needed, read, survey, survey_file, to_csv, to_parquet,
};
use leverrier::internals::dynamics::Dynamics;
use leverrier::internals::error::{Error, ErrorKind, Result};
use leverrier::internals::eval::Backend;
use leverrier::internals::expr::{Compiled, build};
use leverrier::internals::fit::pass::{Problem, Sums, settle_and_linearise};
use leverrier::internals::fit::segments::typical_step;
use leverrier::internals::fit::stream::{Stream, Whole};
use leverrier::internals::fit::train::Training;
use leverrier::internals::fit::{Model, Monitor, Options, Silent, fit, fit_stream};
use leverrier::internals::simulate::{
    NoiseLevel, Simulator, add_noise, consecutive_pairs, drop_samples,
};
use nalgebra::DMatrix;

const HENON_HEILES: &str = "coordinates q[1..2]\nmomenta p[1..2]\n\
    T = (p[1]^2 + p[2]^2)/2\nV = (q[1]^2 + q[2]^2)/2 + q[1]^2*q[2] - q[2]^3/3\n";
pub(super) const SPACE: &str = "coordinates q[1..2]\nmomenta p[1..2]\n\
    T = span{ tensor(p; 3) }\nV = span{ tensor(q; 3) }\n";
pub(super) const SWING: &str = "coordinates q\nmomenta p\nT = p^2/2\nV = -1.3*cos(q)\n";
pub(super) const SWING_SPACE: &str =
    "coordinates q\nmomenta p\nT = span{ p^2 }\nV = span{ poly(q; 4), cos(q) }\n";

/// Ten trajectories of a law.
pub(super) fn trajectories(law: &str, samples: usize, dt: f64, sigma: f64) -> Dataset {
    let law = build("law", law).expect("a sound spec");
    let degrees = law.system.degrees();
    let times: Vec<f64> = (0..samples).map(|i| i as f64 * dt).collect();
    // A swing tells its cosine from a parabola only if it is wide.
    let amplitude = if degrees == 1 { 1.4 } else { 0.28 };
    let starts: Vec<Vec<f64>> = (0..10)
        .map(|i| {
            let angle = |c: usize| 2.4 * i as f64 + 1.7 * c as f64 + 0.3;
            (0..2 * degrees).map(|c| amplitude * angle(c).sin()).collect()
        })
        .collect();
    let simulator = Simulator::known(&law.system);
    let runs = simulator.trajectories(&starts, &times).expect("bounded motion");
    let mut data = runs.dataset(&law.system);
    if sigma > 0.0 {
        add_noise(&mut data, &vec![NoiseLevel::Absolute(sigma); 2 * degrees], 1).expect("positive");
    }
    data
}

pub(super) fn pairs(sigma: f64) -> Dataset {
    let mut data = consecutive_pairs(&trajectories(HENON_HEILES, 401, 0.1, 0.0));
    if sigma > 0.0 {
        add_noise(&mut data, &[NoiseLevel::Absolute(sigma); 4], 1).expect("positive");
    }
    data
}

fn space(text: &str) -> Compiled {
    build("space", text).expect("a sound spec")
}

fn streamed(space: &Compiled, source: &dyn Source, sample: usize, options: &Options) -> Model {
    let found = survey(source, sample, 3, &|_| true).expect("sound data");
    fit_stream(&space.system, source, &found, options, &Silent).expect("a model")
}

/// The same terms, and coefficients within a small part of their standard errors. They are not
/// equal to rounding as a single pass is: the weights come from the noise estimate of the round
/// before, which for the one is that of the sample, and may differ by some per cent.
fn assert_same(one: &Model, other: &Model) {
    assert_eq!(one.terms.len(), other.terms.len());
    for (a, b) in one.terms.iter().zip(&other.terms) {
        assert_eq!((&a.place, &a.term), (&b.place, &b.term));
        let apart = (a.coefficient - b.coefficient).abs();
        assert!(apart <= 0.03 * a.standard_error, "{}: {a:?} {b:?}", a.term);
        assert!((a.standard_error / b.standard_error - 1.0).abs() < 0.05, "{a:?} {b:?}");
    }
    for (a, b) in one.noise.iter().zip(&other.noise) {
        let ratio = a.standard_deviation / b.standard_deviation;
        assert!((ratio - 1.0).abs() < 0.01, "{a:?} {b:?}");
    }
}

/// What a pass leaves: R'R of all folds, loss, residuals, squares and degrees of freedom.
fn left(problem: &Problem, training: &Training, whole: &Dynamics) -> (DMatrix<f64>, Sums) {
    let law = training.law();
    let coefficients = whole.active().iter().filter_map(|&id| law.coefficient(id));
    let inner = whole.parameters().iter().filter_map(|&id| law.parameter(id));
    let theta: Vec<f64> = coefficients.chain(inner).collect();
    let mut states = training.states.clone();
    let linearised = settle_and_linearise(problem, (whole, &theta), (whole, &theta), &mut states);
    let factor = linearised.merged();
    let mut all = factor.design();
    let columns = all.ncols();
    all = all.insert_column(columns, 0.0);
    all.set_column(columns, &factor.target());
    (all.transpose() * &all, linearised.sums)
}

#[test]
fn a_pass_over_chunks_leaves_what_a_pass_in_memory_leaves() {
    let long = trajectories(SWING, 700, 0.1, 0.01);
    let mut gaps = long.clone();
    drop_samples(&mut gaps, 0.05, 4);
    // Where steps of time differ, the number of steps of the integrator is that of a block of
    // segments: chunks make other blocks, and the numbers agree to the integrator's error only.
    let cases = [
        (pairs(0.005), SPACE, 2, 1e-10),
        (long.clone(), SWING_SPACE, 2, 1e-10),
        (long, SWING_SPACE, 9, 1e-10),
        (gaps, SWING_SPACE, 9, 1e-3),
    ];
    for (data, text, window, near) in cases {
        let space = space(text);
        let options = Options { window: Some(window), ..Options::default() };
        let mut training = Training::new(&space.system, &data, &options).expect("enough data");
        // Somewhere near a law, not at one.
        let mut law = training.law().clone();
        for (k, id) in space.system.term_ids().into_iter().enumerate() {
            law = law.with_term(id, 0.3 / (1.0 + k as f64)).expect("its own term");
        }
        training.start_from(&law);
        let whole = Dynamics::whole(&space.system, Backend::Batched);
        let weights = vec![20.0; data.observables.len()];
        let held = training.problem(&weights);
        let (gram, sums) = left(&held, &training, &whole);
        for samples in [600, 5000] {
            let source = InMemory::new(&data, samples);
            let found = survey(&source, 2000, 3, &|_| true).expect("sound data");
            let whole_source = Whole(&source);
            let typical = typical_step(&data);
            let stream = Stream::new(&whole_source, &space.system, &found, typical, &Silent);
            let streamed = Problem { stream: Some(&stream), ..held };
            let (other, others) = left(&streamed, &training, &whole);
            let scale = gram.amax();
            let apart = (&gram - other).amax() / scale;
            assert!(apart < near, "window {window}: {apart}");
            assert_eq!(sums.rows, others.rows);
            assert!((sums.loss / others.loss - 1.0).abs() < near);
            for (a, b) in sums.freedom.iter().zip(&others.freedom) {
                assert!((a / b - 1.0).abs() < near);
            }
            assert_eq!(stream.counts().2, training.segments.list.len());
        }
    }
}

#[test]
fn noisy_pairs_give_the_model_that_memory_gives() {
    let data = pairs(0.005);
    let space = space(SPACE);
    let whole = fit(&space.system, &data, &Options::default(), &Silent).expect("a model");
    assert_eq!(whole.terms.len(), 6);
    // Chunks of odd sizes, a sample of a quarter of the data.
    for samples in [700, 4096] {
        let model = streamed(&space, &InMemory::new(&data, samples), 2000, &Options::default());
        assert_same(&whole, &model);
        assert_eq!(model.evidence.samples, 8000);
        assert_eq!(model.evidence.runs, 4000);
        assert_eq!(model.evidence.segments, 4000);
        assert_eq!(model.evidence.residuals, whole.evidence.residuals);
        assert_eq!(model.evidence.searched_first, Some(2000));
    }
}

#[test]
fn clean_pairs_give_the_coefficients_to_rounding() {
    let data = pairs(0.0);
    let space = space(SPACE);
    let model = streamed(&space, &InMemory::new(&data, 1000), 2000, &Options::default());
    let truth = [0.5, 0.5, 0.5, -1.0 / 3.0, 0.5, 1.0];
    assert_eq!(model.terms.len(), 6);
    let mut learned: Vec<f64> = model.terms.iter().map(|t| t.coefficient).collect();
    let mut truth = truth.to_vec();
    learned.sort_by(f64::total_cmp);
    truth.sort_by(f64::total_cmp);
    for (a, b) in learned.iter().zip(&truth) {
        assert!((a - b).abs() < 1e-10, "{learned:?}");
    }
}

#[test]
fn long_runs_are_cut_where_memory_cuts_them() {
    let data = trajectories(SWING, 3000, 0.1, 0.01);
    let space = space(SWING_SPACE);
    let options = Options { window: Some(9), ..Options::default() };
    let whole = fit(&space.system, &data, &options, &Silent).expect("a model");
    let folder = tempfile::tempdir().expect("a folder");
    let layout = Layout::default();
    for name in ["x.csv", "x.parquet"] {
        let path = folder.path().join(name);
        let bytes = match name {
            "x.csv" => to_csv(&path, &data, &layout),
            _ => to_parquet(&path, &data, &layout),
        };
        std::fs::write(&path, bytes.expect("finite")).expect("written");
        // Every chunk ends inside a run.
        let source =
            FileSource::new(&path, &asked(&["q", "p"]), false).expect("sound").with_chunks(333);
        let model = streamed(&space, &source, 3000, &options);
        assert_same(&whole, &model);
        assert_eq!(model.evidence.segments, whole.evidence.segments, "{name}");
        assert_eq!(model.evidence.residuals, whole.evidence.residuals, "{name}");
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let data = pairs(0.005);
    let space = space(SPACE);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| streamed(&space, &InMemory::new(&data, 900), 1500, &Options::default()))
    };
    let one = on(1);
    for threads in [2, 5] {
        assert_eq!(on(threads), one);
    }
}

fn asked(observables: &[&str]) -> Mapping {
    Mapping {
        groups: Vec::new(),
        inputs: Vec::new(),
        time: None,
        every: None,
        file: None,
        run: Some("run".to_string()),
        observables: observables.iter().map(|name| ObservableMap::plain(*name)).collect(),
    }
}

/// All chunks of a source put together, run by run: name, times, values.
fn together(source: &dyn Source) -> Result<Vec<(String, Vec<f64>, String)>> {
    let mut runs: Vec<(String, Vec<f64>, Vec<Vec<f64>>)> = Vec::new();
    let mut pass = source.pass()?;
    while let Some(chunk) = pass.next()? {
        for piece in &chunk.pieces {
            if piece.begins {
                let columns = vec![Vec::new(); chunk.values.len()];
                runs.push((piece.name.to_string(), Vec::new(), columns));
            }
            let run = runs.last_mut().expect("begun");
            assert_eq!(run.0, piece.name.to_string());
            run.1.extend(&chunk.times[piece.samples.clone()]);
            for (all, values) in run.2.iter_mut().zip(&chunk.values) {
                all.extend(&values[piece.samples.clone()]);
            }
        }
    }
    assert!((pass.fraction() - 1.0).abs() < 1e-12);
    Ok(runs.into_iter().map(|(name, times, values)| (name, times, format!("{values:?}"))).collect())
}

#[test]
fn chunks_hold_what_the_whole_file_holds() {
    let mut data = trajectories(SWING, 57, 0.1, 0.0);
    data.runs[3].values[1][5] = f64::NAN;
    data.runs[4].name = "a b".to_string();
    let layout = Layout::default();
    let folder = tempfile::tempdir().expect("a folder");
    let csv = to_csv(&folder.path().join("x"), &data, &layout).expect("finite");
    let text = String::from_utf8(csv.clone()).expect("text");
    let files: Vec<(&str, Vec<u8>)> = vec![
        ("plain.csv", csv),
        ("comments.csv", format!("# a bench\n\n{}", text.replace("\n7,", "\n# x\n\n7,")).into()),
        ("lines.csv", text.replace('\n', "\r\n").into()),
        ("comma.csv", text.replace(',', ";").replace('.', ",").into()),
        ("x.parquet", to_parquet(&folder.path().join("x"), &data, &layout).expect("finite")),
    ];
    for (name, bytes) in files {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("written");
        let (all, report) =
            dataset(&read(&path).expect("sound"), &asked(&["q", "p"])).expect("sound");
        let expected: Vec<(String, Vec<f64>, String)> = all
            .runs
            .iter()
            .map(|run| (run.name.clone(), run.times.clone(), format!("{:?}", run.values)))
            .collect();
        for samples in [4, 50, 57, 58, 1000] {
            let source = FileSource::new(&path, &asked(&["q", "p"]), false)
                .expect("sound")
                .with_chunks(samples);
            assert_eq!(together(&source).expect("sound"), expected, "{name}, {samples}");
            let found = survey_file(&source, 100, 1, &|_| true).expect("sound");
            assert_eq!((found.runs, found.samples), (10, 570));
            assert_eq!(found.longest, 57);
            for (ours, whole) in found.report.columns.iter().zip(&report.columns) {
                assert_eq!(
                    (ours.measured, ours.missing, ours.minimum, ours.maximum),
                    (whole.measured, whole.missing, whole.minimum, whole.maximum)
                );
                let near = |a: Option<f64>, b: Option<f64>| {
                    (a.expect("measured") - b.expect("measured")).abs() < 1e-12
                };
                assert!(near(ours.mean, whole.mean) && near(ours.spread, whole.spread));
            }
            let digest = |r: &leverrier::internals::data::DataReport| {
                r.source.clone().expect("a file").sha256
            };
            assert_eq!(digest(&found.report), digest(&report));
        }
        assert!(memory_needed(&path).expect("sound") > 570 * 100);
        assert_eq!(head(&path, 10).expect("sound").columns.len(), 4);
    }
}

#[test]
fn every_run_is_as_likely_to_be_in_the_sample() {
    let data = pairs(0.0);
    let mut counts = vec![0; data.runs.len()];
    for seed in 0..200 {
        let found = survey(&InMemory::new(&data, 512), 800, seed, &|_| true).expect("sound");
        assert_eq!(found.sample.samples(), 800);
        for run in &found.sample.runs {
            let at = data.runs.iter().position(|r| r.name == run.name).expect("one of them");
            counts[at] += 1;
        }
    }
    // 200 draws of a tenth: 20 on average, with a standard deviation of 4.2.
    assert!(counts.iter().all(|count| (2..=45).contains(count)), "{counts:?}");
    let first: i32 = counts[..2000].iter().sum();
    assert!((38_000..42_000).contains(&first), "{first}");
}

#[test]
fn what_cannot_be_streamed_is_said_with_its_place() {
    let folder = tempfile::tempdir().expect("a folder");
    let rows: &[(&str, Option<u64>, &str)] = &[
        ("run,t,q,p\n1,0,1,1\n1,1,1,1\n1,0.5,1,1\n", Some(4), "time goes back from 1 to 0.5"),
        ("run,t,q,p\n1,0,1,1\n1,1,1,1\n1,1,2,1\n", Some(4), "both at time 1"),
        ("run,t,q,p\n1,0,1,1\n1,,1,1\n", Some(3), "no time"),
        ("run,t,q,p\n1,0,1,1\n,1,1,1\n", Some(3), "no run"),
        ("run,t,q,p\n1,0,1,1\n1,1,x,1\n", Some(3), "not a number"),
        ("run,t,q,p\n1,0,1,1\n2,1,1,1\n3,0,1,1\n", None, "keep the rows of a run together"),
    ];
    for (text, line, says) in rows {
        let path = folder.path().join("x.csv");
        std::fs::write(&path, text).expect("written");
        let found = FileSource::new(&path, &asked(&["q", "p"]), false)
            .and_then(|source| survey_file(&source, 100, 1, &|_| true));
        let Err(Error::Data(error)) = found else { panic!("{text}: {found:?}") };
        assert_eq!(error.line, *line, "{error}");
        assert!(error.to_string().contains(says), "{error}");
    }
}

/// Stops at the given stage.
struct Stopping {
    stages: AtomicUsize,
    after: usize,
}

impl Monitor for Stopping {
    fn stage(&self, _: &str, _: f64) {
        self.stages.fetch_add(1, Ordering::Relaxed);
    }

    fn stopped(&self) -> bool {
        self.stages.load(Ordering::Relaxed) >= self.after
    }
}

#[test]
fn a_fit_that_is_stopped_keeps_the_best_so_far() {
    let data = pairs(0.005);
    let space = space(SPACE);
    let source = InMemory::new(&data, 500);
    let found = survey(&source, 2000, 3, &|_| true).expect("sound data");
    for after in [1, 2, 5, 17, 18, 19, 25, 40] {
        let monitor = Stopping { stages: AtomicUsize::new(0), after };
        let options = Options::default();
        let model = fit_stream(&space.system, &source, &found, &options, &monitor).expect("one");
        assert!(model.terms.iter().all(|t| t.coefficient.is_finite()), "{after}");
        assert!(model.evidence.error.is_finite(), "{after}");
    }
}

#[test]
fn a_file_that_vanishes_between_passes_is_said() {
    let data = pairs(0.005);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("x.parquet");
    let observables: Vec<&str> = data.observables.iter().map(String::as_str).collect();
    std::fs::write(&path, to_parquet(&path, &data, &Layout::default()).expect("finite"))
        .expect("written");
    let space = space(SPACE);
    let source = FileSource::new(&path, &asked(&observables), false).expect("sound");
    let found = survey_file(&source, 2000, 3, &|_| true).expect("sound data");
    std::fs::remove_file(&path).expect("removed");
    let gone = fit_stream(&space.system, &source, &found, &Options::default(), &Silent);
    assert!(matches!(gone, Err(Error::File { .. })), "{gone:?}");
}

#[test]
fn a_function_space_too_large_for_memory_is_said_with_its_size_and_the_trainer() {
    let data = pairs(0.005);
    let space = space(
        "coordinates q[1..2]\nmomenta p[1..2]\nT = span{ tensor(p; 20) }\nV = span{ tensor(q; 20) }\n",
    );
    let options = Options { memory: Some(64 << 20), ..Options::default() };
    let refused = fit(&space.system, &data, &options, &Silent);
    let Err(Error::Refused { kind: ErrorKind::MemoryLimit, message, hint, .. }) = refused else {
        panic!("{refused:?}")
    };
    assert!(message.contains("880 terms") && message.contains("64.0 MiB"), "{message}");
    assert!(hint.contains("first-order trainer"), "{hint}");
}
