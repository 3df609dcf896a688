//! What is fuzzed: bytes in, and nothing out but a result or a sentence. The tests try a few of
//! each, the example `reliability` as many as one likes.

use std::cell::RefCell;
use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Duration;

use leverrier::internals::data::{Mapping, ObservableMap, dataset, read_bytes};
use leverrier::internals::error::Error;
use leverrier::internals::expr::{FunctionSpace, build};
use leverrier::internals::project::Ledger;
use leverrier::internals::spec::spec as parse;
use leverrier::{Law, Spec};

use super::choices::Choices;
use super::runs;

/// One thing that is fuzzed.
pub(crate) struct Target {
    /// What it is called on the command line.
    pub name: &'static str,
    /// What it is, for the page.
    pub what: &'static str,
    /// Takes bytes; a panic is a find.
    pub run: fn(&[u8]),
    /// Inputs to begin with.
    pub seeds: fn() -> Vec<Vec<u8>>,
}

/// All of them. A new reader is a row here.
pub(crate) const TARGETS: &[Target] = &[
    Target { name: "spec", what: "texts of specs: parser and lowering", run: spec, seeds: specs },
    Target {
        name: "grammar",
        what: "specs with statements, names, numbers and units exchanged: parser and lowering",
        run: spec,
        seeds: specs,
    },
    Target { name: "text", what: "tables of text", run: text, seeds: tables },
    Target { name: "parquet", what: "Parquet files", run: parquet, seeds: parquets },
    Target {
        name: "files",
        what: "files of MATLAB, HDF5, NumPy, Excel and Arrow",
        run: files,
        seeds: stored,
    },
    Target {
        name: "damaged",
        what: "fits of small files of text, NumPy and Arrow",
        run: damaged,
        seeds: sound,
    },
    Target { name: "model", what: "model files", run: model, seeds: models },
    Target { name: "ledger", what: "ledgers", run: ledger, seeds: ledgers },
    Target { name: "request", what: "requests to the studio", run: request, seeds: requests },
    Target {
        name: "run",
        what: "whole runs: check, fit, compare, diagnose, export",
        run: whole_run,
        seeds: random_bytes,
    },
];

/// Words that are put into texts.
pub(crate) const WORDS: &[&str] = &[
    "coordinates ",
    "momenta ",
    "velocities ",
    "time t",
    "data \"d.csv\" { time t }",
    "param k = 1",
    " in 0..2",
    " per run",
    "T = ",
    "V = ",
    "H = ",
    "L = ",
    "force q += ",
    "effect ",
    "span{ ",
    " }",
    "poly(q; 4)",
    "tensor(",
    "pairs(",
    "trig(",
    "constrain ",
    ">= 0",
    "input u { hold }",
    "hidden z = 0.1 with p_z",
    "state w { w' = q - w }",
    "rate(q)",
    "let x = ",
    "sum(q[i] for i in 1..3)",
    "q[1..2]",
    "[m/s]",
    "[kg*m^2/s^2]",
    "not measured",
    "candidates { a: force q += q }",
    "sin(",
    "sqrt(",
    "^(1/2)",
    "1e400",
    "..",
    "#",
    "\n",
    "\"",
    "viscous_drag(q)",
    "body b = (x, y)",
    "bouc_wen(q)",
    "system \"s\"",
    "constant m = 2",
    "if i < j",
    "; ",
    "-",
    "*",
    "/",
    "null",
    "{",
    "[",
    ",",
    ":",
    "NaN",
    "\u{feff}",
    "\r\n",
    "\t",
    "1e-320",
    "18446744073709551616",
];

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// The files of a folder and the folders in it, at most so large, in the order of their names.
fn below(folder: &str, ending: &str, most: u64) -> Vec<Vec<u8>> {
    let mut paths = Vec::new();
    let mut open = vec![root().join(folder)];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
            let path = entry.path();
            let small = entry.metadata().is_ok_and(|about| about.len() <= most);
            match path.is_dir() {
                true => open.push(path),
                false if small && path.to_string_lossy().ends_with(ending) => paths.push(path),
                false => {}
            }
        }
    }
    paths.sort();
    paths.iter().filter_map(|path| fs::read(path).ok()).collect()
}

thread_local! {
    static FOLDER: RefCell<Option<tempfile::TempDir>> = const { RefCell::new(None) };
}

/// Does something in a folder of this thread.
fn in_folder<T>(work: impl FnOnce(&Path) -> T) -> T {
    FOLDER.with(|folder| {
        let mut folder = folder.borrow_mut();
        let folder = folder.get_or_insert_with(|| tempfile::tempdir().expect("a folder"));
        work(folder.path())
    })
}

fn specs() -> Vec<Vec<u8>> {
    let folders = ["tests/suite", "grammar", "examples"];
    folders.iter().flat_map(|folder| below(folder, ".ham", 8 << 10)).collect()
}

fn spec(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    // What is printed is read as the same; the spans of the copy are its own.
    let (tree, wrong) = parse(&text);
    if wrong.is_empty() {
        let printed = tree.to_string();
        let (again, wrong) = parse(&printed);
        assert!(wrong.is_empty(), "{text}\nprinted as\n{printed}\n{wrong:?}");
        assert_eq!(again.to_string(), printed, "{text}");
    }
    match build("spec", &text) {
        Ok(compiled) if compiled.system.terms.len() < 2000 => {
            let space = FunctionSpace::new(&compiled);
            assert_eq!(space.terms.len(), compiled.system.terms.len());
        }
        Ok(_) => {}
        Err(Error::Spec { diagnostics, .. }) => {
            assert!(!diagnostics.is_empty());
            for one in diagnostics {
                assert!(text.get(one.span.start..one.span.end).is_some(), "{one:?} in {text:?}");
                assert!(!one.message.is_empty());
            }
        }
        Err(other) => panic!("{other}"),
    }
}

fn mapping(run: Option<&str>) -> Mapping {
    let observables = ["x", "y"].map(ObservableMap::plain).to_vec();
    Mapping { run: run.map(str::to_string), observables, ..Mapping::default() }
}

/// Reads a file of such a name and makes what can be made of it.
fn read(name: &str, bytes: &[u8]) {
    match read_bytes(Path::new(name), bytes) {
        Ok(table) => {
            assert!(table.columns.iter().all(|column| column.cells.len() == table.rows()));
            for run in [None, Some("run")] {
                if let Ok((data, about)) = dataset(&table, &mapping(run)) {
                    assert_eq!(about.columns.len(), data.observables.len());
                    let rising = |run: &[f64]| run.windows(2).all(|pair| pair[0] < pair[1]);
                    assert!(data.runs.iter().all(|run| rising(&run.times)));
                }
            }
        }
        Err(error) => assert!(error.to_string().contains(name), "{error}"),
    }
}

fn tables() -> Vec<Vec<u8>> {
    let texts = [
        "t,x,y\n0,1,2\n0.1,1.5,2.5\n0.2,2,3\n",
        "# note\n\nrun;t [s];x [mm];y\na;0,1;1,5;2\na;0,2;1,6;\nb;0,1;-1;1e3\nb;0,3;4;5\n",
        "\u{feff}t\tx\ty\r\n0\t1\t\"2\"\r\n1\tNA\t3\r\n",
        "t x y\n0 1 2\n1 3 4\n2 5 6\n",
    ];
    let wide: Vec<u8> = texts[0].encode_utf16().flat_map(u16::to_le_bytes).collect();
    let marked = [&[0xff, 0xfe][..], &wide].concat();
    texts.iter().map(|text| text.as_bytes().to_vec()).chain([marked]).collect()
}

fn text(bytes: &[u8]) {
    read("data.csv", bytes);
}

fn parquets() -> Vec<Vec<u8>> {
    let table = read_bytes(Path::new("d.csv"), &tables()[1]).expect("a table");
    let (data, _) = dataset(&table, &mapping(Some("run"))).expect("a data set");
    let layout = leverrier::internals::data::Layout::default();
    vec![
        leverrier::internals::data::to_parquet(Path::new("d.parquet"), &data, &layout)
            .expect("finite numbers"),
    ]
}

fn parquet(bytes: &[u8]) {
    read("data.parquet", bytes);
}

/// Endings of names; the first byte of an input says which.
const ENDINGS: &[&str] = &["mat", "h5", "npy", "npz", "xlsx", "feather", "arrow", "arrows"];

fn stored() -> Vec<Vec<u8>> {
    let of_ending = |(at, ending): (usize, &&str)| {
        let files = below("tests/fixtures/files", &format!(".{ending}"), 16 << 10);
        files.into_iter().map(move |file| [&[at as u8][..], &file].concat())
    };
    ENDINGS.iter().enumerate().flat_map(of_ending).collect()
}

fn files(bytes: &[u8]) {
    let Some((which, rest)) = bytes.split_first() else { return };
    read(&format!("data.{}", ENDINGS[usize::from(*which) % ENDINGS.len()]), rest);
}

/// Files of the same pendulum; the first byte of an input says which it is made from.
const SOUND: &[&str] = &["flat.csv", "flat.feather", "records.npy"];

fn sound() -> Vec<Vec<u8>> {
    let file = |name: &&str| fs::read(root().join("tests/fixtures/files").join(name));
    let of = |(at, name)| [&[at as u8][..], &file(name).expect("a fixture")].concat();
    SOUND.iter().enumerate().map(of).collect()
}

/// Whatever a file holds, a fit of it ends with finite numbers or a sentence.
fn damaged(bytes: &[u8]) {
    let Some((which, rest)) = bytes.split_first() else { return };
    let name = SOUND[usize::from(*which) % SOUND.len()];
    in_folder(|folder| {
        let path = folder.join(name);
        fs::write(&path, rest).expect("written");
        let text = format!(
            "coordinates theta; velocities omega\ndata \"{name}\" {{ time t  run run }}\n\
             T = p_theta^2/2\nV = span{{ poly(theta; 4), cos(theta), sin(theta) }}\n"
        );
        let spec = Spec::parse(&text).expect("a spec");
        match leverrier::Data::open(&path, &spec).and_then(|data| spec.fit(&data)) {
            Ok(law) => assert!(law.terms().iter().all(|term| term.coefficient.is_finite())),
            Err(error) => assert!(error.to_string().len() > 10, "{error}"),
        }
    });
}

/// A spec with all kinds of numbers, and measurements of it.
const LEARNED: &str = "coordinates q; momenta p\nparam k = 1 in 0.5..2\nT = p^2/2\n\
                       V = span{ q^2, cos(k*q) }\nforce q += span{ drag: -p }\n";

fn learned() -> &'static (Spec, Law) {
    static LAW: OnceLock<(Spec, Law)> = OnceLock::new();
    LAW.get_or_init(|| {
        let spec = Spec::parse(LEARNED).expect("a spec");
        let times: Vec<f64> = (0..40).map(|at| 0.1 * f64::from(at)).collect();
        let of = |f: fn(f64) -> f64| times.iter().map(|t| f(*t)).collect::<Vec<f64>>();
        let (q, p) = (of(f64::cos), of(|t| -t.sin()));
        let data = leverrier::Data::from_slices(&spec, &times, &[&q, &p]).expect("measurements");
        let law = spec.fit(&data).expect("a law");
        (spec, law)
    })
}

fn models() -> Vec<Vec<u8>> {
    vec![learned().1.model_json().expect("a model file").into_bytes()]
}

fn model(bytes: &[u8]) {
    let (text, spec) = (String::from_utf8_lossy(bytes), &learned().0);
    if let Ok(law) = Law::from_model_json(&text, spec) {
        assert!(law.terms().iter().all(|term| term.coefficient.is_finite()));
        let (_, _) = (law.to_json(), law.to_latex());
        let again = law.model_json().expect("a model file");
        let again = Law::from_model_json(&again, spec).expect("what was written is read");
        assert_eq!(again.terms(), law.terms());
    }
}

fn ledgers() -> Vec<Vec<u8>> {
    below("tests/fixtures/versions", ".ledger.json", 64 << 10)
}

fn ledger(bytes: &[u8]) {
    in_folder(|folder| {
        let spec = folder.join("s.ham");
        fs::write(folder.join("s.ledger.json"), bytes).expect("written");
        if let Ok(ledger) = Ledger::open(&spec) {
            ledger.write(&spec).expect("written");
            assert_eq!(Ledger::open(&spec).expect("what was written is read"), ledger);
        }
    });
}

/// Port and token of a studio of this process.
fn studio() -> &'static (u16, String) {
    static STUDIO: OnceLock<(u16, String)> = OnceLock::new();
    STUDIO.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder").keep();
        let example = root().join("examples/damped-pendulum");
        for name in ["fit.ham", "swings.csv"] {
            fs::copy(example.join(name), folder.join(name)).expect("a copy");
        }
        let (sender, receiver) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            let ready = |address: &str| sender.send(address.to_string()).expect("heard");
            leverrier::internals::cli::served(&folder.join("fit.ham"), ready).expect("a studio");
        });
        let address = receiver.recv().expect("an address");
        let rest = address.rsplit_once(':').expect("a port").1;
        let (port, token) = rest.split_once("/#").expect("a token");
        (port.parse().expect("a number"), token.to_string())
    })
}

fn requests() -> Vec<Vec<u8>> {
    let head = "host: HOST\r\norigin: http://HOST\r\nx-leverrier-token: TOKEN\r\n\
                connection: close\r\n";
    let get = |path: &str| format!("GET {path} HTTP/1.1\r\n{head}\r\n");
    let post = |path: &str, body: &str| {
        format!("POST {path} HTTP/1.1\r\n{head}content-length: {}\r\n\r\n{body}", body.len())
    };
    let all = [
        get("/"),
        get("/api/state?since=0"),
        get("/api/plots?plot=forces&at=0&as=svg"),
        get("/api/export?to=latex"),
        get("/api/report"),
        post("/api/check", "{\"text\":\"coordinates q\\nV = sin(\"}"),
        post("/api/do", "{\"do\":\"add\",\"effect\":\"viscous_drag(q)\"}"),
        post("/api/do", "{\"do\":\"save\",\"text\":\"T = \",\"base\":\"x\",\"learn\":true}"),
        post("/api/do", "{\"do\":\"undo\",\"force\":true}"),
        post("/api/cancel", ""),
    ];
    all.map(String::into_bytes).to_vec()
}

/// Replaces a word in bytes.
fn replaced(bytes: &[u8], word: &[u8], by: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut rest = bytes;
    while let Some(at) = rest.windows(word.len()).position(|part| part == word) {
        out.extend(&rest[..at]);
        out.extend(by);
        rest = &rest[at + word.len()..];
    }
    out.extend(rest);
    out
}

fn request(bytes: &[u8]) {
    let (port, token) = studio();
    let host = format!("127.0.0.1:{port}");
    let bytes = replaced(&replaced(bytes, b"HOST", host.as_bytes()), b"TOKEN", token.as_bytes());
    let answered = |bytes: &[u8], patience: Duration| {
        let mut stream = TcpStream::connect(("127.0.0.1", *port)).expect("the studio listens");
        stream.set_read_timeout(Some(patience)).expect("a time");
        // A server that refuses a request closes while it is being sent.
        let _ = stream.write_all(bytes);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        answer
    };
    answered(&bytes, Duration::from_millis(50));
    // Whatever was asked, the studio still answers.
    let plain = format!("GET / HTTP/1.1\r\nhost: {host}\r\nconnection: close\r\n\r\n");
    let page = answered(plain.as_bytes(), Duration::from_secs(120));
    assert!(page.starts_with(b"HTTP/1.1 200"), "{:?}", String::from_utf8_lossy(&bytes));
}

fn random_bytes() -> Vec<Vec<u8>> {
    (0..8).map(|seed| super::choices::bytes(seed, 400)).collect()
}

fn whole_run(bytes: &[u8]) {
    // An error is a sentence; `run` has looked at it.
    in_folder(|folder| drop(runs::run(&mut Choices::new(bytes), folder)));
}
