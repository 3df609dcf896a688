//! The data layer from outside: files as people have them, reports, and writing.

use std::path::Path;

use leverrier::internals::data::{
    Clock, ColumnMap, DataReport, Dataset, Layout, Mapping, ObservableMap, Run, SuspicionKind,
    dataset, read, read_bytes, to_csv, write_atomically, write_csv,
};
use leverrier::internals::error::{Error, Result};
use proptest::prelude::*;

fn mapping(run: Option<&str>, observables: &[&str]) -> Mapping {
    Mapping {
        groups: Vec::new(),
        inputs: Vec::new(),
        time: None,
        every: None,
        file: None,
        run: run.map(str::to_string),
        observables: observables.iter().map(|name| ObservableMap::plain(*name)).collect(),
    }
}

fn load(content: &[u8], mapping: &Mapping) -> Result<(Dataset, DataReport)> {
    dataset(&read_bytes(Path::new("data.csv"), content)?, mapping)
}

/// Files that all hold the same two columns: t = 0, 0.5, 1 and x = 1.5, missing, -2.
const SAME_FILES: &[(&str, &[u8])] = &[
    ("plain", b"t,x\n0,1.5\n0.5,\n1,-2\n"),
    ("no newline at the end", b"t,x\n0,1.5\n0.5,\n1,-2"),
    ("carriage returns", b"t,x\r\n0,1.5\r\n0.5,\r\n1,-2\r\n"),
    ("only carriage returns", b"t,x\r0,1.5\r0.5,\r1,-2\r"),
    ("mark", b"\xEF\xBB\xBFt,x\n0,1.5\n0.5,NaN\n1,-2\n"),
    ("units", b"t [s],x (m)\n0,1.5\n0.5,NA\n1,-2\n"),
    ("units below", b"t,x\n[s],[m]\n0,1.5\n0.5,NA\n1,-2\n"),
    ("tabs", b"t\tx\n0\t1.5\n0.5\tnull\n1\t-2\n"),
    ("decimal commas", b"t;x\n0;1,5\n0,5;?\n1;-2\n"),
    ("decimal commas, blanks", b"t   x\n0   1,5\n0,5 -\n1   -2\n"),
    ("blanks", b"  t [s]  x [m]\n  0.0   1.5\n  0.5   nan\n  1.0  -2.0\n"),
    ("comments", b"# by hand\n% again\n\nt,x\n# one\n0,1.5\n\n0.5,\n1,-2\n"),
    ("header as a comment", b"# t x\n0e0 1.5e0\n5e-1 nan\n1e0 -2e0\n"),
    ("header as a comment, commas", b"#t,x\n0,1.5\n0.5,nan\n1,-2\n"),
    ("quotes", b"\"t\",\"x\"\n\"0\",\"1.5\"\n\"0.5\",\"\"\n\"1\",\"-2\"\n"),
    ("delimiter at the end", b"t,x,\n0,1.5,\n0.5,,\n1,-2,\n"),
    ("delimiter at the end of rows", b"t,x\n0,1.5,\n0.5,,\n1,-2,\n"),
    ("other columns", b"note,t,x\n\"a, b\",0,1.5\nc,0.5,\n\"d \"\"e\"\"\",1,-2\n"),
    ("index column", b",t,x\n0,0,1.5\n1,0.5,\n2,1,-2\n"),
    ("capitals", b"Time,X\n0,1.5\n0.5,\n1,-2\n"),
    ("named delimiter", b"sep=;\r\nt;x\r\n0;1.5\r\n0.5;\r\n1;-2\r\n"),
    ("rows of delimiters", b"t,x\n0,1.5\n0.5,\n1,-2\n,\n,\n"),
    ("out of order", b"t,x\n0,1.5\n1,-2\n0.5,\n"),
    ("doubled", b"t,x\n0,1.5\n0,1.5\n0.5,\n1,-2\n"),
    ("a cell of several lines", b"note,t,x\n\"a\nb\",0,1.5\nc,0.5,\nd,1,-2\n"),
    ("Latin-1", b"t,x,phi [\xb0]\n0,1.5,0\n0.5,,0\n1,-2,0\n"),
    ("Fortran", b"t x\n0.0D+00 1.5D+00\n5.0D-01 NaN\n1.0D+00 -2.0D+00\n"),
];

#[test]
fn the_same_measurements_are_read_from_every_kind_of_file() {
    // A second observable that is measured everywhere keeps the row with the missing cell.
    let mut mapping = mapping(None, &["x"]);
    let mut clock = ObservableMap::plain("clock");
    clock.columns = vec!["t".into(), "time".into()];
    mapping.observables.push(clock);
    for (what, content) in SAME_FILES {
        let (data, report) = load(content, &mapping).unwrap_or_else(|e| panic!("{what}: {e}"));
        let [run] = data.runs.as_slice() else {
            panic!("{what}: {data:?}");
        };
        assert_eq!(run.times, [0.0, 0.5, 1.0], "{what}");
        let x = &run.values[0];
        assert_eq!((x[0], x[2]), (1.5, -2.0), "{what}");
        assert!(x[1].is_nan(), "{what}");
        assert_eq!(report.columns[0].missing, 1, "{what}");
    }
    let utf16: Vec<u8> = std::iter::once(0xFEFF)
        .chain("t,x\r\n0,1.5\r\n1,2\r\n".encode_utf16())
        .flat_map(u16::to_le_bytes)
        .collect();
    let (data, _) = load(&utf16, &mapping).expect("UTF-16");
    assert_eq!(data.runs[0].values[0], [1.5, 2.0]);
}

#[test]
fn both_the_name_and_the_header_find_a_column() {
    let table = read_bytes(Path::new("a.csv"), b"t [s],theta (rad)\n0,1\n1,2\n").expect("good");
    for name in ["theta", "theta (rad)", "Theta"] {
        let column = table.find(name).expect("one").expect("there");
        assert_eq!(column.unit.as_deref(), Some("rad"));
    }
    assert!(table.find("rad").expect("none").is_none());
    assert_eq!(table.lines, [2, 3]);
    assert_eq!(table.sha256.len(), 64);
}

#[test]
fn runs_are_collected_converted_and_put_in_order() {
    let content = b"t [ms],run,angle [deg]\n\
        0,b,180\n0,a,90\n2,a,270\n10,b,\n1,a,180\n20,b,90\n5,lonely,7\n";
    let mapping = Mapping {
        groups: Vec::new(),
        inputs: Vec::new(),
        time: Some(ColumnMap { scale: 1e-3, ..ColumnMap::plain("t") }),
        every: None,
        file: None,
        run: Some("run".into()),
        observables: vec![
            ObservableMap {
                columns: vec!["theta".into(), "angle".into()],
                scale: 1.0 / 90.0,
                offset: 1.0,
                ..ObservableMap::plain("theta")
            },
            ObservableMap { required: false, ..ObservableMap::plain("omega") },
        ],
    };
    let (data, report) = load(content, &mapping).expect("good");
    assert_eq!(data.observables, ["theta", "omega"]);
    let names: Vec<&str> = data.runs.iter().map(|run| run.name.as_str()).collect();
    assert_eq!(names, ["b", "a"]);
    assert_eq!(data.runs[0].times, [0.0, 0.02]);
    assert_eq!(data.runs[0].lines, [2, 7]);
    assert_eq!(data.runs[1].values[0], [2.0, 3.0, 4.0]);
    assert_eq!(data.runs[1].lines, [3, 6, 4]);
    assert!(data.runs.iter().all(|run| run.values[1].iter().all(|v| v.is_nan())));
    assert_eq!(report.columns[0].header.as_deref(), Some("angle [deg]"));
    let warnings = report.warnings.join("\n");
    for fragment in [
        "1 row without any measurement",
        "1 row out of order",
        "line 6 of run a",
        "1 run with a single sample left out; the first is run lonely at line 8",
        "omega was never measured",
    ] {
        assert!(warnings.contains(fragment), "{fragment:?} in {warnings}");
    }
}

#[test]
fn rows_at_one_time_that_agree_are_merged() {
    let (data, report) =
        load(b"t,x,y\n0,1,\n0,,5\n1,2,6\n1,2,6\n", &mapping(None, &["x", "y"])).expect("good");
    assert_eq!(data.runs[0].values, [[1.0, 2.0], [5.0, 6.0]]);
    assert!(report.warnings[0].starts_with("2 rows at the time of another"));
}

#[test]
fn the_report_reads_well_and_is_json() {
    let (_, report) = load(
        b"run,t,x,y\na,0,1,3\na,1,2,3\na,2,4,3\na,4,3,3\nb,0,1,3\nb,1,5,3\n",
        &mapping(Some("run"), &["x", "y"]),
    )
    .expect("good");
    assert_eq!(report.gaps.len(), 1);
    assert_eq!(report.suspicious[0].kind, SuspicionKind::Constant { value: 3.0 });
    let text = report.to_text();
    for fragment in [
        "data.csv: 6 rows, UTF-8, comma between cells",
        "6 samples in 2 runs",
        "gap in run",
        "Warning: y is always 3",
    ] {
        assert!(text.contains(fragment), "{fragment:?} in\n{text}");
    }
    let json = serde_json::to_value(&report).expect("a report is JSON");
    assert_eq!(json["source"]["delimiter"], "comma");
    assert_eq!(json["suspicious"][0]["kind"], "constant");
    assert_eq!(json["gaps"][0]["after_line"], 4);
}

#[test]
fn files_are_written_whole_or_not_at_all() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.csv");
    write_atomically(&path, b"one").expect("written");
    write_atomically(&path, b"two").expect("written over");
    assert_eq!(std::fs::read(&path).expect("there"), b"two");
    let left: Vec<_> = std::fs::read_dir(folder.path()).expect("there").collect();
    assert_eq!(left.len(), 1, "no temporary file stays behind");

    let infinite = Dataset {
        inputs: Vec::new(),
        observables: vec!["x".into()],
        runs: vec![run("1", &[0.0, 1.0], &[&[1.0, f64::INFINITY]])],
    };
    let error = write_csv(&path, &infinite, &Layout::default()).expect_err("infinite");
    assert!(error.to_string().contains("line 3, column `x`"), "{error}");
    assert_eq!(std::fs::read(&path).expect("there"), b"two");

    for (path, says) in [
        (folder.path().join("no/a.csv"), "there is no folder"),
        (path.join("a.csv"), "there is no folder"),
        (folder.path().to_path_buf(), "it is a folder"),
    ] {
        let error = write_atomically(&path, b"three").expect_err("cannot be");
        assert!(matches!(error, Error::File { .. }));
        assert!(error.to_string().contains(says), "{error}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn permissions_links_and_a_full_disk() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().expect("a folder");
    let (path, link) = (folder.path().join("a"), folder.path().join("b"));
    write_atomically(&path, b"one").expect("written");
    let mode = |path: &Path| std::fs::metadata(path).expect("there").permissions().mode() & 0o777;
    // As open as any new file here.
    std::fs::write(folder.path().join("c"), b"").expect("written");
    assert_eq!(mode(&path), mode(&folder.path().join("c")));
    std::fs::set_permissions(&path, PermissionsExt::from_mode(0o640)).expect("set");
    std::os::unix::fs::symlink(&path, &link).expect("linked");
    write_atomically(&link, b"two").expect("written");
    assert_eq!(std::fs::read(&path).expect("there"), b"two");
    assert_eq!(mode(&path), 0o640);
    assert!(link.is_symlink());
    let full = Path::new("/dev/full");
    if full.exists() {
        let error = write_atomically(full, b"three").expect_err("full");
        assert!(error.to_string().contains("No space left"), "{error}");
    }
}

#[test]
fn a_file_that_does_not_exist_is_named() {
    let error = read(Path::new("no/such/file.csv")).expect_err("absent");
    assert!(error.to_string().starts_with("cannot read no/such/file.csv"));
}

#[test]
fn a_filmed_pendulum_is_read_with_its_gaps() {
    let Some(path) = crate::measurements::shared_data("real_pendulum.csv") else {
        return;
    };
    let table = read(&path).expect("good");
    let (data, report) =
        dataset(&table, &mapping(Some("trial"), &["theta", "omega"])).expect("good");
    assert_eq!(data.samples(), 556);
    assert_eq!(data.runs.len(), 1);
    assert_eq!(data.measured(), [556, 556]);
    assert_eq!(report.gaps.len(), 10);
    assert_eq!(report.gaps[0].after_line, 6);
    assert!((report.sampling.median - 1.0 / 6.0).abs() < 1e-6);
    assert_eq!(report.suspicious, []);
    println!("{}", report.to_text());
}

#[test]
fn the_other_real_files_are_read() {
    let columns = [
        ("real_double_oscillator.csv", ["x1", "x2", "v1", "v2"], 495, 1),
        ("real_double_pendulum.csv", ["theta1", "theta2", "omega1", "omega2"], 1520, 2),
    ];
    for (name, observables, samples, runs) in columns {
        let Some(path) = crate::measurements::shared_data(name) else {
            continue;
        };
        let table = read(&path).expect("good");
        let (data, report) = dataset(&table, &mapping(Some("trial"), &observables)).expect("good");
        assert_eq!((data.samples(), data.runs.len()), (samples, runs), "{name}");
        println!("{}", report.to_text());
    }
}

fn run(name: &str, times: &[f64], values: &[&[f64]]) -> Run {
    Run {
        name: name.to_string(),
        times: times.to_vec(),
        values: values.iter().map(|column| column.to_vec()).collect(),
        lines: Vec::new(),
        clock: Clock::default(),
        inputs: Vec::new(),
        groups: Vec::new(),
        errors: Vec::new(),
    }
}

/// Any finite number, and NaN now and then, but always the same NaN.
fn cell() -> impl Strategy<Value = f64> {
    prop_oneof![
        9 => any::<u64>().prop_map(f64::from_bits).prop_filter("finite", |x| x.is_finite()),
        1 => Just(f64::NAN),
    ]
}

fn any_run(name: String) -> impl Strategy<Value = Run> {
    let time = any::<u64>().prop_map(f64::from_bits).prop_filter("finite", |t| t.is_finite());
    prop::collection::vec((time, cell(), cell()), 2..20).prop_map(move |mut rows| {
        rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        rows.dedup_by(|a, b| a.0 == b.0);
        // A row without any value would be left out, and so would a single row.
        rows.iter_mut().filter(|r| r.1.is_nan()).for_each(|r| r.2 = 0.5);
        if rows.len() < 2 {
            rows = vec![(0.0, 1.0, 2.0), (1.0, -0.0, f64::NAN)];
        }
        Run {
            name: name.clone(),
            times: rows.iter().map(|r| r.0).collect(),
            values: vec![rows.iter().map(|r| r.1).collect(), rows.iter().map(|r| r.2).collect()],
            lines: vec![0; rows.len()],
            clock: Clock::default(),
            inputs: Vec::new(),
            groups: Vec::new(),
            errors: Vec::new(),
        }
    })
}

fn bits(data: &Dataset) -> Vec<(String, Vec<u64>)> {
    data.runs
        .iter()
        .map(|run| {
            let numbers = run.times.iter().chain(run.values.iter().flatten());
            // Which of the many NaN it is does not matter.
            let bits = numbers.map(|x| if x.is_nan() { u64::MAX } else { x.to_bits() });
            (run.name.clone(), bits.collect())
        })
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_is_written_is_read_back_to_the_bit(
        runs in prop::collection::hash_set("[a-z#%,;\" ]{0,6}[a-z]", 1..5)
            .prop_flat_map(|names| names.into_iter().map(|name| any_run(name.trim().to_string()))
                .collect::<Vec<_>>())
            .prop_filter("names of their own", |runs| {
                let names: std::collections::HashSet<_> = runs.iter().map(|r| &r.name).collect();
                names.len() == runs.len()
            })
            // A column without any value would not be written.
            .prop_filter("values of every column", |runs| {
                (0..2).all(|column| {
                    runs.iter().flat_map(|run| &run.values[column]).any(|x| !x.is_nan())
                })
            }),
    ) {
        let data = Dataset { observables: vec!["x".into(), "y".into()], runs, inputs: Vec::new() };
        let layout = Layout { units: vec![Some("m".into()), None], ..Layout::default() };
        let path = Path::new("written.csv");
        let text = to_csv(path, &data, &layout).expect("finite");
        let (back, _) = load(&text, &mapping(Some("run"), &["x", "y"])).expect("readable");
        prop_assert_eq!(bits(&data), bits(&back));
    }

    #[test]
    fn no_bytes_make_the_reader_panic(
        bytes in prop::collection::vec(prop_oneof![
            4 => prop::sample::select(b"tx01.,;\t\n\r\"#%[]()-e/ ".to_vec()),
            1 => any::<u8>(),
        ], 0..80),
        header in prop::bool::ANY,
    ) {
        let mut content = if header { b"t,x\n".to_vec() } else { Vec::new() };
        content.extend(bytes);
        let _ = load(&content, &mapping(None, &["x"])).map(|(data, report)| {
            let _ = report.to_text();
            data.split_held_out(0.3, 1)
        });
    }
}

#[test]
fn a_run_listed_twice_is_said_and_counted_once() {
    let row = |run: &str, i: usize, from: f64| {
        format!("{run},{},{}\n", from + 0.5 * i as f64, (0.3 * i as f64).sin())
    };
    let other = |i: usize| format!("b,{},{}\n", 0.5 * i as f64, (0.31 * i as f64).sin());
    let still = |run: &str, i: usize| format!("{run},{},1\n", 0.5 * i as f64);
    let rows = |of: &dyn Fn(usize) -> String| (0..12).map(of).collect::<String>();
    let text = "run,t,x\n".to_string()
        + &rows(&|i| row("a", i, 0.0))
        + &rows(&other)
        + &rows(&|i| row("again", i, 0.0))
        + &rows(&|i| row("later", i, 16.0))
        + &rows(&|i| still("rest 1", i))
        + &rows(&|i| still("rest 2", i));
    let (data, report) = load(text.as_bytes(), &mapping(Some("run"), &["x"])).expect("good");
    let names: Vec<&str> = data.runs.iter().map(|run| run.name.as_str()).collect();
    assert_eq!(names, ["a", "b", "rest 1", "rest 2"]);
    let said = report.warnings.join("\n");
    assert!(said.contains("2 runs") && said.contains("copy of run a"), "{said}");
}

#[test]
fn the_last_runs_may_be_named_by_words() {
    let rows = ["1", "2", "again"].map(|run| format!("{run},0,1\n{run},1,2\n{run},2,3\n"));
    let text = format!("run,t,x\n{}", rows.concat());
    let table = read_bytes(Path::new("a.csv"), text.as_bytes()).expect("good");
    assert_eq!(table.rows(), 9);
    // What stands below a table whose first column counts is none of it.
    let table = read_bytes(Path::new("a.csv"), b"t,x\n0,1\n1,2\n2,3\nMean,2\n").expect("good");
    assert_eq!(table.rows(), 3);
}
