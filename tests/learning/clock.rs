//! Where the clock of the measurements starts: seconds since 1970 are a time like any other.

use std::path::Path;

use leverrier::internals::data::{
    Dataset, FileSource, Layout, Mapping, ObservableMap, Source, dataset, read_bytes, survey_file,
    to_csv, to_parquet,
};
use leverrier::internals::expr::build;
use leverrier::internals::fit::{Model, Options, Silent, fit, fit_stream};
use leverrier::internals::simulate::{NoiseLevel, Simulator, add_noise};

const SWING: &str = "coordinates q\nmomenta p\nT = p^2/2\nV = -1.3*cos(q)\n";
const SPACE: &str = "coordinates q\nmomenta p\nT = p^2/2\nV = span{ poly(q; 4), cos(q) }\n";

fn mapping() -> Mapping {
    let observables = ["q", "p"].map(ObservableMap::plain).to_vec();
    Mapping { run: Some("run".to_string()), observables, ..Mapping::default() }
}

/// Six swings sampled every 0.1 as a file has them, with the clock set to `origin`, a whole number.
fn file(law: &str, origin: u64, sigma: f64) -> String {
    let law = build("law", law).expect("a sound spec");
    let times: Vec<f64> = (0..60).map(|i| origin as f64 + i as f64 / 10.0).collect();
    let starts: Vec<Vec<f64>> =
        (0..6).map(|i| vec![1.4 * (2.4 * f64::from(i)).sin(), 0.3 * f64::from(i) - 0.7]).collect();
    let simulator = Simulator::new(&law.system, &[], &[], &[]).expect("a simulator");
    let mut data = simulator.trajectories(&starts, &times).expect("bounded").dataset(&law.system);
    if sigma > 0.0 {
        add_noise(&mut data, &[NoiseLevel::Absolute(sigma); 2], 5).expect("positive");
    }
    text(&data, |sample| format!("{}.{}", origin + sample as u64 / 10, sample % 10))
}

/// The data set as a file with such texts for its times.
fn text(data: &Dataset, time: impl Fn(usize) -> String) -> String {
    let mut text = "run,t,q,p\n".to_string();
    for run in &data.runs {
        for sample in 0..run.times.len() {
            let (q, p) = (run.values[0][sample], run.values[1][sample]);
            text += &format!("{},{},{q:?},{p:?}\n", run.name, time(sample));
        }
    }
    text
}

/// The same rows with the clock set forward.
fn moved(text: &str, by: u64) -> String {
    let row = |line: &str| {
        let mut cells: Vec<String> = line.split(',').map(str::to_string).collect();
        if let Some((whole, part)) = cells[1].split_once('.') {
            let whole: u64 = whole.parse().expect("a whole number");
            cells[1] = format!("{}.{part}", whole + by);
        }
        cells.join(",") + "\n"
    };
    text.lines().map(row).collect()
}

fn load(text: &str) -> Dataset {
    let table = read_bytes(Path::new("data.csv"), text.as_bytes()).expect("a table");
    dataset(&table, &mapping()).expect("a data set").0
}

fn learn(space: &str, data: &Dataset) -> Model {
    let space = build("space", space).expect("a sound spec");
    fit(&space.system, data, &Options::default(), &Silent).expect("a model")
}

fn assert_same(one: &Model, other: &Model) {
    assert_eq!(one.terms.len(), other.terms.len(), "{:?} {:?}", one.terms, other.terms);
    for (a, b) in one.terms.iter().zip(&other.terms) {
        let apart = (a.coefficient - b.coefficient).abs();
        println!("{} moves by {apart:.1e}, its error is {:.1e}", a.term, a.standard_error);
        assert_eq!((&a.place, &a.term), (&b.place, &b.term));
        assert!(apart <= (1e-3 * a.standard_error).max(1e-14 * a.coefficient.abs()), "{a:?} {b:?}");
    }
}

#[test]
fn steps_are_those_of_the_digits_and_times_those_of_the_file() {
    let plain = file(SWING, 0, 0.0);
    for by in [1_000_000, 1_700_000_000] {
        let data = load(&moved(&plain, by));
        for run in &data.runs {
            assert_eq!(run.clock.origin, by as f64);
            assert_eq!(run.clock.rounding, 0.0);
            for (sample, since) in run.times.iter().enumerate() {
                assert_eq!(*since, sample as f64 / 10.0);
                let written: f64 =
                    format!("{}.{}", by + sample as u64 / 10, sample % 10).parse().expect("a time");
                assert_eq!(run.time(sample), written);
            }
        }
        // What is written is what was read.
        let layout = Layout::default();
        let written = to_csv(Path::new("again.csv"), &data, &layout).expect("text");
        assert_eq!(load(&String::from_utf8(written).expect("text")), data);
    }
    assert!(load(&plain).runs.iter().all(|run| run.clock == Default::default()));
}

#[test]
fn the_origin_of_time_changes_no_number() {
    for sigma in [0.0, 0.01] {
        let plain = file(SWING, 0, sigma);
        let model = learn(SPACE, &load(&plain));
        for by in [1_000_000, 1_700_000_000] {
            assert_same(&model, &learn(SPACE, &load(&moved(&plain, by))));
        }
    }
}

#[test]
fn a_drive_keeps_the_time_of_the_clock() {
    let driven = "coordinates q\nmomenta p\ntime t\nT = p^2/2\nV = -1.3*cos(q)\n\
                  force q += 0.2*sin(2.5*t)\n";
    let space = "coordinates q\nmomenta p\ntime t\nT = p^2/2\nV = span{ cos(q) }\n\
                 force q += span{ sin(2.5*t), cos(2.5*t) }\n";
    for origin in [0, 1_000_000, 1_700_000_000] {
        let model = learn(space, &load(&file(driven, origin, 1e-3)));
        let of = |term: &str| {
            let found = model.terms.iter().find(|t| t.term.contains(term));
            found.map_or(0.0, |t| t.coefficient)
        };
        assert!((of("sin(2.5") - 0.2).abs() < 0.005, "{origin}: {:?}", model.terms);
        assert!(of("cos(2.5").abs() < 0.005, "{origin}: {:?}", model.terms);
    }
}

#[test]
fn a_stream_counts_times_as_memory_does() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("data.csv");
    let text = moved(&file(SWING, 0, 0.01), 1_700_000_000);
    std::fs::write(&path, &text).expect("written");
    let data = load(&text);
    for samples in [7, 64, 100_000] {
        let source = FileSource::new(&path, &mapping(), false).expect("a source");
        let source = source.with_chunks(samples);
        let (mut times, mut origins): (Vec<f64>, Vec<f64>) = Default::default();
        let mut pass = source.pass().expect("a pass");
        while let Some(chunk) = pass.next().expect("sound data") {
            times.extend(&chunk.times);
            origins.extend(chunk.pieces.iter().map(|piece| piece.clock.origin));
        }
        let held: Vec<f64> = data.runs.iter().flat_map(|run| run.times.clone()).collect();
        assert_eq!(times, held, "{samples}");
        assert!(origins.iter().all(|origin| *origin == 1_700_000_000.0), "{samples}");
    }
    let space = build("space", SPACE).expect("a sound spec");
    let learned = |path: &Path| {
        let source = FileSource::new(path, &mapping(), false).expect("a source").with_chunks(90);
        let found = survey_file(&source, 1000, 3, &|_| true).expect("a survey");
        fit_stream(&space.system, &source, &found, &Options::default(), &Silent).expect("a model")
    };
    let far = learned(&path);
    std::fs::write(&path, file(SWING, 0, 0.01)).expect("written");
    assert_same(&learned(&path), &far);
}

/// A column of doubles has lost the digits: what that costs is not taken for motion.
#[test]
fn rounding_of_a_column_of_doubles_is_counted() {
    let far = load(&moved(&file(SWING, 0, 0.0), 1_700_000_000));
    let bytes = to_parquet(Path::new("data.parquet"), &far, &Layout::default()).expect("bytes");
    let table = read_bytes(Path::new("data.parquet"), &bytes).expect("a table");
    let rounded = dataset(&table, &mapping()).expect("a data set").0;
    assert!(rounded.runs.iter().all(|run| (1e-8..1e-6).contains(&run.clock.rounding)));
    let model = learn(SPACE, &rounded);
    let cos = model.terms.iter().find(|t| t.term == "cos(q)").expect("the cosine");
    assert_eq!(model.terms.len(), 1, "{:?}", model.terms);
    assert!((cos.coefficient + 1.3).abs() < 5.0 * cos.standard_error.max(1e-9), "{cos:?}");
    assert!(model.noise.iter().all(|noise| noise.resolution > 1e-8), "{:?}", model.noise);
}
