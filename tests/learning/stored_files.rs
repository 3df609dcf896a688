//! Files of MATLAB, HDF5, NumPy, Excel and Arrow: one table in all of them is one law, and what
//! is damaged is refused with a sentence. The files are written by `tests/fixtures/files/make.py`.

use std::io::Write;
use std::path::{Path, PathBuf};

use leverrier::internals::data::{Table, file_of, read, read_bytes};
use leverrier::{Data, Law, Spec};
use proptest::prelude::*;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/files").join(name)
}

const SPEC: &str = "coordinates theta; velocities omega\nT = p_theta^2/2\n\
                    V = span{ cos(theta), theta^4 }\n";

/// Every file, what is asked for in it, and whether it names the runs in a column of its own.
const FILES: &[(&str, bool)] = &[
    ("flat.csv", true),
    ("flat.mat", true),
    ("plain.mat", true),
    ("structs.mat", false),
    ("structs.mat#swings", false),
    ("cells.mat", false),
    ("flat73.mat", true),
    ("cells73.mat", false),
    ("structs73.mat", false),
    ("structs73.mat#swings", false),
    ("flat.h5", true),
    ("groups.h5", false),
    ("groups.h5#swings", false),
    ("records.h5", true),
    ("records.h5#table", true),
    ("records.npy", true),
    ("flat.npz", true),
    ("runs.npz", false),
    ("flat.xlsx", true),
    ("flat.xlsx#swings", true),
    ("sheets.xlsx", false),
    ("flat.feather", true),
    ("plain.arrow", true),
    ("flat.arrows", true),
];

fn spec(name: &str, run: bool) -> Spec {
    let run = if run { "  run run" } else { "" };
    let path = fixture(name).display().to_string();
    Spec::parse(&format!("{SPEC}data \"{path}\" {{ time t{run} }}\n")).expect("a spec")
}

/// Times and values of all runs, as bits.
fn bits(data: &Data) -> Vec<Vec<u64>> {
    let bits = |numbers: &[f64]| numbers.iter().map(|x| x.to_bits()).collect::<Vec<u64>>();
    (0..data.runs())
        .flat_map(|run| {
            let values = |name| bits(data.values(run, name).expect("measured"));
            [bits(&data.times(run).expect("a run")), values("theta"), values("omega")]
        })
        .collect()
}

#[test]
fn one_table_in_every_format_is_one_law_to_the_bit() {
    let mut first: Option<(Vec<Vec<u64>>, Vec<u64>)> = None;
    for (name, run) in FILES {
        let spec = spec(name, *run);
        let data = Data::open(fixture(name), &spec).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!((data.runs(), data.samples()), (2, 80), "{name}");
        let law: Law = spec.fit(&data).expect("a law");
        let numbers = law.terms().iter().flat_map(|t| [t.coefficient, t.standard_error]);
        let found = (bits(&data), numbers.map(f64::to_bits).collect::<Vec<u64>>());
        let gravity = law.coefficient("cos(theta)").expect("found");
        assert!((gravity + 4.0).abs() < 0.05, "{name}: {gravity}");
        match &first {
            None => first = Some(found),
            Some(first) => assert!(*first == found, "{name} is another law"),
        }
    }
}

fn columns(table: &Table) -> Vec<String> {
    table.columns.iter().map(|column| column.header.clone()).collect()
}

#[test]
fn single_numbers_texts_matrices_and_units_have_columns() {
    let headers = |name: &str| columns(&read(&fixture(name)).expect(name));
    assert_eq!(headers("cells.mat"), ["t", "theta", "omega", "mass", "run"]);
    assert_eq!(headers("groups.h5"), ["mass", "omega", "t", "theta", "run"]);
    assert_eq!(headers("matrix.mat"), ["t", "states_1", "states_2"]);
    assert_eq!(headers("states.npz"), ["t", "y_1", "y_2", "run"]);
    assert_eq!(headers("runs.npz"), ["t", "theta", "omega", "rig", "run"]);
    assert_eq!(headers("table.npy"), ["column_1", "column_2", "column_3", "column_4"]);
    assert!(headers("flat.h5").contains(&"t [s]".to_string()));
    assert_eq!(headers("flat.feather"), ["t", "theta", "omega", "run", "rig"]);
    let text = |name: &str, column: &str, row: usize| {
        let table = read(&fixture(name)).expect(name);
        table.find(column).expect("one").expect("there").cells.get(row).to_string()
    };
    assert_eq!(text("runs.npz", "rig", 0), "left");
    assert_eq!(text("runs.npz", "rig", 79), "right");
    assert_eq!(text("groups.h5", "run", 0), "run_9");
    assert_eq!(text("groups.h5", "mass", 79), "2");
    assert_eq!(text("sheets.xlsx", "run", 79), "Swing 2");
    assert_eq!(text("flat.feather", "rig", 79), "b");
    assert_eq!(text("cells.mat", "mass", 79), "1.5");
    // A part of a part.
    assert_eq!(read(&fixture("structs.mat#swings/2")).expect("a part").rows(), 40);
    assert_eq!(read(&fixture("groups.h5#swings/run_10")).expect("a part").rows(), 40);
    assert_eq!(read(&fixture("sheets.xlsx#Swing 2")).expect("a sheet").rows(), 40);
    // The states of both ways of standing are the same.
    let first = text("states.npz", "y_1", 79);
    assert_eq!(first, text("runs.npz", "theta", 79));
}

#[test]
fn a_part_that_is_not_there_is_told_with_those_that_are() {
    let said = |name: &str| read(&fixture(name)).expect_err(name).to_string();
    let rows = [
        ("structs.mat#swing", vec!["nothing called `swing`", "`swings`"]),
        ("structs.mat#swings/3", vec!["nothing called `3`", "parts 1 to 2"]),
        ("flat.xlsx#Data", vec!["no sheet `Data`", "`Swings`"]),
        ("flat.xlsx#Notes", vec!["no row of measurements"]),
        ("groups.h5#swings/run_9/mass", vec!["no arrays"]),
        ("flat.feather#x", vec!["no names of tables", "leave out"]),
        ("zstd.feather", vec!["zstd", "lz4"]),
        ("one.feather", vec!["first version of Feather"]),
        ("missing.mat#x", vec!["missing.mat"]),
    ];
    for (name, words) in rows {
        let said = said(name);
        for word in words {
            assert!(said.contains(word), "{name}: {said}");
        }
    }
    assert_eq!(file_of(Path::new("a.mat#b/c")), Path::new("a.mat"));
    assert_eq!(file_of(Path::new("a.csv#b")), Path::new("a.csv#b"));
}

/// Files that are refused by what they are, whatever their name says.
#[test]
fn foreign_files_get_a_sentence() {
    let names = ["x.mat", "x.h5", "x.npy", "x.npz", "x.xlsx", "x.feather"];
    let contents: [(&str, &[u8]); 5] = [
        ("nothing", b""),
        ("text", b"t,x\n0,1\n1,2\n"),
        ("a picture", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"),
        ("an old workbook", b"\xD0\xCF\x11\xE0\xA1\xB1\x1A\xE1"),
        ("an archive", b"PK\x03\x04\x14\0\0\0\0\0"),
    ];
    for name in names {
        for (what, bytes) in contents {
            let said = read_bytes(Path::new(name), bytes).expect_err(what).to_string();
            assert!(said.len() > 30 && said.contains(name), "{name} of {what}: {said}");
        }
    }
}

/// The files that are damaged, byte by byte.
fn whole() -> Vec<(&'static str, Vec<u8>)> {
    let names = FILES.iter().map(|(name, _)| *name).filter(|name| !name.contains('#'));
    let more = ["matrix.mat", "states.npz", "table.npy", "zstd.feather", "one.feather"];
    let names = names.filter(|name| *name != "flat.csv").chain(more);
    names.map(|name| (name, std::fs::read(fixture(name)).expect(name))).collect()
}

#[test]
fn files_that_are_cut_off_are_refused() {
    for (name, bytes) in whole() {
        for part in 1..40 {
            let cut = &bytes[..bytes.len() * part / 40];
            // A table that is whole may stand before the cut, in a list of variables.
            if let Ok(table) = read_bytes(Path::new(name), cut) {
                assert!(name.ends_with(".mat") || name.ends_with(".h5"), "{name}, part {part}");
                assert!(table.rows() <= 80, "{name}, part {part}");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        failure_persistence: None,
        cases: 400,
        ..ProptestConfig::default()
    })]

    /// Whatever stands in a file, reading it ends with a table or a sentence.
    #[test]
    fn damaged_files_end_with_a_sentence(
        file in 0..27_usize,
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        large in any::<Option<prop::sample::Index>>(),
    ) {
        let files = whole();
        let (name, bytes) = &files[file % files.len()];
        let mut bytes = bytes.clone();
        for (place, byte) in changes {
            let at = place.index(bytes.len());
            bytes[at] = byte;
        }
        // A length that lies.
        if let Some(place) = large {
            let at = place.index(bytes.len() - 8);
            bytes[at..at + 8].copy_from_slice(&[0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x0f]);
        }
        match read_bytes(Path::new(name), &bytes) {
            Ok(table) => {
                prop_assert!(table.columns.iter().all(|c| c.cells.len() == table.rows()));
            }
            Err(error) => prop_assert!(error.to_string().contains(name)),
        }
    }
}

/// Zeros without end in a small file fill no memory.
#[test]
fn files_that_inflate_without_end_are_refused() {
    let zeros = vec![0; 1 << 20];
    let archive = |name: &str| {
        let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        writer.start_file(name, zip::write::SimpleFileOptions::default()).expect(name);
        (0..400).for_each(|_| writer.write_all(&zeros).expect(name));
        writer.finish().expect(name).into_inner()
    };
    let mut matlab = b"MATLAB 5.0 MAT-file".to_vec();
    matlab.resize(124, b' ');
    matlab.extend(b"\x00\x01IM");
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    (0..400).for_each(|_| encoder.write_all(&zeros).expect("in memory"));
    let compressed = encoder.finish().expect("in memory");
    matlab.extend(15_u32.to_le_bytes());
    matlab.extend((compressed.len() as u32).to_le_bytes());
    matlab.extend(compressed);
    let files = [
        ("zeros.npz", archive("x.npy")),
        ("zeros.xlsx", archive("xl/workbook.xml")),
        ("zeros.mat", matlab),
    ];
    for (name, bytes) in files {
        assert!(bytes.len() < 2 << 20, "{name}: {} bytes", bytes.len());
        let said = read_bytes(Path::new(name), &bytes).expect_err(name).to_string();
        assert!(said.contains("a hundred times"), "{name}: {said}");
    }
}
