//! Data in parts: what many processes leave is what one leaves.

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use leverrier::internals::data::{Dataset, Layout, survey_file, to_csv, to_parquet};
use leverrier::internals::data::{FileSource, Mapping, ObservableMap};
use leverrier::internals::expr::build;
use leverrier::internals::fit::fit_stream;
use leverrier::{
    Engine, Error, ErrorKind, Law, LocalParts, Method, Options, Part, PartPlace, PartSampling,
    PartSurvey, PassFactor, PassRequest, Result, Silent, Spec, Trainer,
};
use sha2::{Digest, Sha256};

use super::stream::{SPACE, SWING, SWING_SPACE, pairs, trajectories};

fn written(folder: &Path, name: &str, data: &Dataset) -> PathBuf {
    let path = folder.join(name);
    let layout = Layout::default();
    let bytes = match name.ends_with("csv") {
        true => to_csv(&path, data, &layout),
        false => to_parquet(&path, data, &layout),
    };
    std::fs::write(&path, bytes.expect("finite")).expect("written");
    path
}

/// Some runs of a data set.
fn some(data: &Dataset, runs: std::ops::Range<usize>) -> Dataset {
    Dataset { runs: data.runs[runs].to_vec(), ..data.clone() }
}

/// All rows of a data set, cut into so many files wherever that falls.
fn cut(folder: &Path, data: &Dataset, parts: usize) -> Vec<Part> {
    let rows: Vec<(usize, usize)> = (data.runs.iter().enumerate())
        .flat_map(|(run, of)| (0..of.times.len()).map(move |at| (run, at)))
        .collect();
    let each = rows.len().div_ceil(parts);
    let file = |(at, rows): (usize, &[(usize, usize)])| {
        let mut part = Dataset { runs: Vec::new(), ..data.clone() };
        for &(run, row) in rows {
            let of = &data.runs[run];
            if part.runs.last().is_none_or(|last| last.name != of.name) {
                let mut empty = of.clone();
                (empty.times, empty.lines) = (Vec::new(), Vec::new());
                empty.values.iter_mut().for_each(Vec::clear);
                part.runs.push(empty);
            }
            let last = part.runs.last_mut().expect("begun");
            last.times.push(of.times[row]);
            last.lines.push(0);
            for (all, values) in last.values.iter_mut().zip(&of.values) {
                all.push(values[row]);
            }
        }
        Part::File(written(folder, &format!("part-{at:02}.parquet"), &part))
    };
    rows.chunks(each).enumerate().map(file).collect()
}

fn with_runs(space: &str) -> Spec {
    Spec::parse(&format!("{space}data \"x\" {{ run run }}\n")).expect("a sound spec")
}

fn fitted(spec: &Spec, parts: Vec<Part>, options: &Options) -> (Law, leverrier::Data) {
    spec.fit_parts(&LocalParts::new(spec, parts), options, &Silent).expect("a law")
}

fn bits(law: &Law) -> Vec<(String, u64, u64)> {
    let of = |term: &leverrier::LearnedTerm| {
        (term.term.clone(), term.coefficient.to_bits(), term.standard_error.to_bits())
    };
    law.terms().iter().map(of).collect()
}

/// Coefficients apart by a small part of their standard errors.
fn near(one: &Law, other: &Law, part: f64) {
    assert_eq!(one.terms().len(), other.terms().len());
    for (a, b) in one.terms().iter().zip(other.terms()) {
        assert_eq!(a.term, b.term);
        let apart = (a.coefficient - b.coefficient).abs() / a.standard_error;
        assert!(apart < part, "{}: {apart}", a.term);
    }
}

/// Options that draw a sample of a part of the data.
fn sampled(samples: usize) -> Options {
    let mut options = Options::default();
    options.tuning.course.sampled = samples;
    options
}

#[test]
fn one_part_gives_the_bits_of_a_streamed_fit() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = written(folder.path(), "pairs.parquet", &pairs(0.005));
    let options = sampled(2000);
    let spec = with_runs(SPACE);
    let (law, sample) = fitted(&spec, vec![Part::File(path.clone())], &options);
    let mapping = Mapping {
        groups: Vec::new(),
        inputs: Vec::new(),
        time: None,
        every: None,
        file: None,
        run: Some("run".to_string()),
        observables: spec.observables().iter().map(ObservableMap::plain).collect(),
    };
    let source = FileSource::new(&path, &mapping, false).expect("sound");
    let survey = survey_file(&source, 2000, 0, &|_| true).expect("sound");
    let system = build("space", SPACE).expect("sound").system;
    let model = fit_stream(&system, &source, &survey, &options, &Silent).expect("a model");
    let streamed: Vec<(String, u64, u64)> = (model.terms.iter())
        .map(|t| (t.term.clone(), t.coefficient.to_bits(), t.standard_error.to_bits()))
        .collect();
    assert_eq!(bits(&law), streamed);
    assert_eq!(law.terms().len(), 6);
    assert_eq!(sample.samples(), 2000);
}

/// Passes over the parts in an order of its own, and sends everything as bytes.
struct Elsewhere<'a> {
    spec: &'a Spec,
    parts: Vec<Part>,
    order: Vec<usize>,
    threads: usize,
    requests: Mutex<Vec<(Vec<u8>, Vec<PartPlace>)>>,
}

impl<'a> Elsewhere<'a> {
    fn new(spec: &'a Spec, parts: Vec<Part>, order: Vec<usize>, threads: usize) -> Self {
        Elsewhere { spec, parts, order, threads, requests: Mutex::default() }
    }

    fn each(&self, one: impl Fn(usize) -> Result<Vec<u8>> + Sync + Send) -> Result<Vec<u8>> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.threads).build();
        let mut leaves = vec![Vec::new(); self.parts.len()];
        for &at in &self.order {
            leaves[at] = pool.as_ref().expect("threads").install(|| one(at))?;
        }
        Part::merge_in_order(leaves, |a, b| Part::merge_bytes(&a, &b))
    }
}

impl Engine for Elsewhere<'_> {
    fn survey(&self, sampling: PartSampling, _: &dyn Fn(f64) -> bool) -> Result<PartSurvey> {
        let one =
            |at: usize| self.spec.survey_part(&self.parts[at], at as u32, sampling)?.to_bytes();
        PartSurvey::from_bytes(&self.each(one)?)
    }

    fn pass(
        &self,
        request: &PassRequest,
        places: &[PartPlace],
        _: &dyn Fn(f64) -> bool,
    ) -> Result<PassFactor> {
        let bytes = request.to_bytes()?;
        self.requests.lock().expect("sound").push((bytes.clone(), places.to_vec()));
        let one = |at: usize| {
            let request = PassRequest::from_bytes(&bytes)?;
            self.spec.pass_part(&self.parts[at], &request, places[at])?.to_bytes()
        };
        PassFactor::from_bytes(&self.each(one)?)
    }
}

#[test]
fn neither_order_nor_threads_nor_the_way_change_a_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = pairs(0.005);
    let part = |at: usize| {
        let runs = some(&data, at * 800..(at + 1) * 800);
        // Files and tables in memory.
        Part::File(written(folder.path(), &format!("{at}.parquet"), &runs))
    };
    let parts: Vec<Part> = (0..5).map(part).collect();
    let spec = with_runs(SPACE);
    let options = sampled(2000);
    let (law, sample) = fitted(&spec, parts.clone(), &options);
    assert_eq!(law.terms().len(), 6);
    assert!(sample.warnings().is_empty(), "{:?}", sample.warnings());
    for (order, threads) in [(vec![4, 2, 0, 1, 3], 1), (vec![3, 4, 1, 2, 0], 3)] {
        let engine = Elsewhere::new(&spec, parts.clone(), order, threads);
        let (other, _) = spec.fit_parts(&engine, &options, &Silent).expect("a law");
        assert_eq!(bits(&law), bits(&other));
        assert_eq!(law.model_json().expect("fitted"), other.model_json().expect("fitted"));
    }
    // The law of one file with all rows, whose sample is another.
    let all = Part::File(written(folder.path(), "all.parquet", &data));
    let (whole, _) = fitted(&spec, vec![all.clone()], &options);
    near(&law, &whole, 0.05);
    // A pass at the same numbers is the same to rounding, however the rows are cut.
    let one = Elsewhere::new(&spec, vec![all.clone()], vec![0], 1);
    spec.fit_parts(&one, &options, &Silent).expect("a law");
    let requests = one.requests.into_inner().expect("sound");
    assert!(requests.len() > 1);
    for (bytes, _) in &requests {
        let request = PassRequest::from_bytes(bytes).expect("sound");
        let whole = spec.pass_part(&all, &request, PartPlace::default()).expect("sound");
        let passes = parts.iter().enumerate().map(|(at, part)| {
            let (runs, samples) = (800 * at as u64, 1600 * at as u64);
            let before =
                PartPlace { runs_before: runs, samples_before: samples, ..Default::default() };
            let place = PartPlace { number: at as u32, ..before };
            spec.pass_part(part, &request, place).expect("sound")
        });
        let parts = Part::merge_in_order(passes.collect(), PassFactor::merge).expect("neighbours");
        assert_eq!((whole.transitions(), parts.transitions()), (4000, 4000));
        let unknowns = whole.unknowns();
        for probe in 0..unknowns {
            let mut change = vec![0.0; unknowns];
            change[probe] = 0.3;
            change[(probe + 1) % unknowns] -= 0.1;
            let (a, b) = (whole.squares(&change), parts.squares(&change));
            let (a, b) = (a.expect("as many"), b.expect("as many"));
            assert!((a / b - 1.0).abs() < 1e-10, "{a} {b}");
        }
        assert_eq!(whole.squares(&[]), None);
    }
}

#[test]
fn runs_that_cross_borders_are_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = trajectories(SWING, 700, 0.1, 0.01);
    let spec = with_runs(SWING_SPACE);
    // Steps as asked for: those that are chosen depend on the sample.
    let (method, longest_step) = (Method::by_name("forest-ruth"), Some(0.1));
    let options = Options { window: Some(9), method, longest_step, ..sampled(3000) };
    let whole = Part::File(written(folder.path(), "all.parquet", &data));
    let (whole, about) = fitted(&spec, vec![whole], &options);
    assert!(about.warnings().is_empty());
    // Runs begin and end anywhere; some parts have one run alone, which goes on before and after.
    for parts in [3, 31] {
        let (law, sample) = fitted(&spec, cut(folder.path(), &data, parts), &options);
        near(&law, &whole, 0.2);
        let json = law.model_json().expect("fitted");
        for count in ["\"runs\":10,", "\"samples\":7000,"] {
            assert!(json.replace(": ", ":").contains(count), "{count} {json}");
        }
        let told = sample.warnings().join(" ");
        assert!(told.contains("go on from one part of the data to the next at"), "{told}");
    }
    // In the wrong order they are several runs, and that is said.
    let mut parts = cut(folder.path(), &data, 31);
    parts.swap(1, 9);
    let (_, sample) = fitted(&spec, parts, &options);
    let told = sample.warnings().join(" ");
    assert!(told.contains("do not follow each other"), "{told}");
    assert!(told.contains("is taken as several runs"), "{told}");
}

#[test]
fn open_scales_and_narrowed_spaces_reach_the_workers() {
    let folder = tempfile::tempdir().expect("a folder");
    // Positions alone, nothing known: a unit of mass settles the scale.
    let mut data = trajectories(SWING, 300, 0.1, 0.001);
    for run in &mut data.runs {
        run.values[1].iter_mut().for_each(|p| *p = f64::NAN);
    }
    let spec = with_runs(SWING_SPACE);
    // Segments and steps as asked for: those that are chosen depend on the sample.
    let (method, longest_step) = (Method::by_name("forest-ruth"), Some(0.1));
    let options = Options { window: Some(9), method, longest_step, ..sampled(1500) };
    let (law, _) = fitted(&spec, cut(folder.path(), &data, 3), &options);
    let whole = Part::File(written(folder.path(), "all.parquet", &data));
    let (other, _) = fitted(&spec, vec![whole], &options);
    assert!((law.coefficient("p^2").expect("set") - 0.5).abs() < 1e-12);
    assert!((law.coefficient("cos(q)").expect("learned") + 1.3).abs() < 0.05);
    near_but_fixed(&law, &other);
    // A screened space: the workers learn which terms are left.
    let data = pairs(0.005);
    let spec = with_runs(SPACE);
    let parts = vec![
        Part::File(written(folder.path(), "a.parquet", &some(&data, 0..2000))),
        Part::File(written(folder.path(), "b.parquet", &some(&data, 2000..4000))),
    ];
    let options = Options { trainer: Trainer::FirstOrder, ..sampled(3000) };
    let (law, _) = fitted(&spec, parts, &options);
    assert_eq!(law.terms().len(), 6);
    assert!((law.coefficient("q[1]^2*q[2]").expect("learned") - 1.0).abs() < 0.05);
}

/// [`near`] for terms of which one has a coefficient that was set.
fn near_but_fixed(one: &Law, other: &Law) {
    assert_eq!(one.terms().len(), other.terms().len());
    for (a, b) in one.terms().iter().zip(other.terms()) {
        let apart = (a.coefficient - b.coefficient).abs();
        assert!(apart <= 0.2 * a.standard_error, "{a:?} {b:?}");
    }
}

#[test]
fn what_is_damaged_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = pairs(0.005);
    let spec = with_runs(SPACE);
    let sound = written(folder.path(), "sound.parquet", &some(&data, 0..2000));
    let broken = written(folder.path(), "broken.parquet", &some(&data, 2000..4000));
    let mut bytes = std::fs::read(&broken).expect("there");
    // In the pages, behind the first mark.
    bytes[10..200].fill(0xff);
    std::fs::write(&broken, bytes).expect("written");
    let engine = LocalParts::new(&spec, vec![Part::File(sound.clone()), Part::File(broken)]);
    let error = spec.fit_parts(&engine, &sampled(2000), &Silent).expect_err("damaged");
    let Error::Data(error) = error else { panic!("{error}") };
    assert!(error.file.ends_with("broken.parquet"), "{error:?}");
    assert_eq!(error.row_group, Some(1));
    // A file that goes away between two passes.
    let gone = Part::File(folder.path().join("gone.parquet"));
    let engine = LocalParts::new(&spec, vec![Part::File(sound), gone]);
    let error = spec.fit_parts(&engine, &sampled(2000), &Silent).expect_err("not there");
    assert_eq!(error.kind(), ErrorKind::File);
    let error = spec.fit_parts(&LocalParts::new(&spec, vec![]), &sampled(9), &Silent);
    assert_eq!(error.expect_err("no parts").kind(), ErrorKind::InvalidArgument);
}

/// Bytes with a sum that fits them: only what they say can be wrong.
fn resealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let sum = Sha256::digest(&bytes[22..]);
    bytes[6..22].copy_from_slice(&sum[..16]);
    bytes
}

#[test]
fn hostile_bytes_are_refused_and_nothing_panics() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = trajectories(SWING, 60, 0.1, 0.01);
    let spec = with_runs(SWING_SPACE);
    let file = Part::File(written(folder.path(), "x.csv", &data));
    let engine = Elsewhere::new(&spec, vec![file.clone()], vec![0], 1);
    spec.fit_parts(&engine, &Options::default(), &Silent).expect("a law");
    let (request, _) = engine.requests.into_inner().expect("sound").pop().expect("a pass");
    let sampling = PartSampling { most: 40, seed: 0 };
    let survey = spec.survey_part(&file, 0, sampling).expect("sound").to_bytes().expect("sound");
    let sound = PassRequest::from_bytes(&request).expect("sound");
    let factor = spec.pass_part(&file, &sound, PartPlace::default()).expect("sound");
    let factor = factor.to_bytes().expect("sound");
    let used = |bytes: &[u8]| {
        let survey = PartSurvey::from_bytes(bytes);
        let factor = PassFactor::from_bytes(bytes);
        let request = PassRequest::from_bytes(bytes);
        if let Ok(request) = &request {
            let _ = spec.pass_part(&file, request, PartPlace::default());
        }
        if let Ok(factor) = &factor {
            let next = factor.clone().merge(factor.clone());
            assert!(next.is_err(), "no part follows itself");
            let _ = factor.squares(&vec![1.0; factor.unknowns()]);
        }
        survey.is_ok() || factor.is_ok() || request.is_ok()
    };
    for whole in [&survey, &request, &factor] {
        assert!(used(whole));
        for end in [0, 3, 4, 6, 21, 22, whole.len() / 2, whole.len() - 1] {
            assert!(!used(&whole[..end]), "{end}");
        }
        let mut accepted = 0;
        let step = (whole.len() / 60).max(1);
        for at in (0..whole.len()).step_by(step) {
            for value in [0x00, 0x7f, 0xff] {
                let mut bytes = whole.clone();
                if bytes[at] == value {
                    continue;
                }
                bytes[at] = value;
                assert!(!used(&bytes), "{at}");
                // With a sum that fits, fields may be other ones that make sense.
                if at >= 22 {
                    accepted += usize::from(used(&resealed(bytes)));
                }
            }
        }
        assert!(accepted > 0);
        let mut longer = whole.clone();
        longer.push(0);
        assert!(!used(&resealed(longer)));
    }
    // A request of another spec, and merges of what does not go together.
    let other = with_runs("coordinates q\nmomenta p\nT = p^2/2\nV = span{ q^2 }\n");
    let error = other.pass_part(&file, &sound, PartPlace::default()).expect_err("of another");
    assert_eq!(error.kind(), ErrorKind::InvalidArgument);
    assert!(error.to_string().contains("another spec"), "{error}");
    assert!(Part::merge_bytes(&survey, &factor).is_err());
    assert!(Part::merge_bytes(&factor, &survey).is_err());
    let elsewhere = spec.survey_part(&file, 2, sampling).expect("sound");
    let first = PartSurvey::from_bytes(&survey).expect("sound");
    let error = first.merge(elsewhere).expect_err("part 1 is missing").to_string();
    assert!(error.contains("do not follow each other"), "{error}");
}

#[test]
fn parts_without_rows_change_nothing() {
    let data = pairs(0.005);
    let spec = with_runs(SPACE);
    let part = |runs: std::ops::Range<usize>| {
        let runs = some(&data, runs);
        let csv = to_csv(Path::new("x"), &runs, &Layout::default()).expect("finite");
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("x.csv");
        std::fs::write(&path, csv).expect("written");
        Part::Data(leverrier::Data::open(&path, &spec).expect("sound"))
    };
    let empty = || Part::Data(leverrier::Data::empty(&spec));
    let (law, _) = fitted(&spec, vec![part(0..2000), part(2000..4000)], &sampled(4000));
    let parts = vec![empty(), part(0..2000), empty(), part(2000..4000), empty()];
    let (other, sample) = fitted(&spec, parts, &sampled(4000));
    near(&law, &other, 0.05);
    assert!(sample.warnings().is_empty(), "{:?}", sample.warnings());
    let engine = LocalParts::new(&spec, vec![empty()]);
    let error = spec.fit_parts(&engine, &sampled(9), &Silent).expect_err("nothing");
    assert_eq!(error.kind(), ErrorKind::InsufficientData);
}
