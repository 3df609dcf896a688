//! Parquet files: read like text files, and refused with place and advice when they are bad.

use std::path::Path;
use std::sync::Arc;

use leverrier::internals::data::{
    Clock, DataReport, Dataset, Layout, Mapping, ObservableMap, Reading, Run, dataset, read_bytes,
    to_csv, to_parquet,
};
use leverrier::internals::error::{DataError, Error, Result};
use parquet::basic::{Compression, LogicalType, Repetition, TimeUnit, Type as Physical};
use parquet::data_type::{
    BoolType, ByteArray, ByteArrayType, DoubleType, FloatType, Int32Type, Int64Type,
};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{PrimitiveTypeBuilder, Type};

/// What a column of a test file holds.
#[derive(Clone)]
enum Of {
    Doubles(Vec<Option<f64>>),
    Floats(Vec<f32>),
    Ints(Vec<Option<i64>>),
    Small(Vec<i32>),
    Unsigned(Vec<i32>),
    Cents(Vec<i64>),
    Texts(Vec<&'static str>),
    Flags(Vec<bool>),
    Stamps(Vec<i64>),
}

fn doubles(values: &[f64]) -> Of {
    Of::Doubles(values.iter().map(|x| Some(*x)).collect())
}

/// A file with all rows in one group, or with `group` rows in each.
fn file(columns: &[(&str, Of)], group: usize, compression: Compression) -> Vec<u8> {
    fn typed(
        name: &str,
        physical: Physical,
        logical: Option<LogicalType>,
        repetition: Repetition,
    ) -> PrimitiveTypeBuilder<'_> {
        let (precision, scale) = match &logical {
            Some(LogicalType::Decimal(_)) => (9, 2),
            _ => (-1, -1),
        };
        Type::primitive_type_builder(name, physical)
            .with_logical_type(logical)
            .with_repetition(repetition)
            .with_precision(precision)
            .with_scale(scale)
    }
    let (required, optional) = (Repetition::REQUIRED, Repetition::OPTIONAL);
    let field = |(name, of): &(&str, Of)| {
        let stamp = LogicalType::timestamp(true, TimeUnit::MICROS);
        let unsigned = LogicalType::integer(32, false);
        let built = match of {
            Of::Doubles(_) => typed(name, Physical::DOUBLE, None, optional),
            Of::Floats(_) => typed(name, Physical::FLOAT, None, required),
            Of::Ints(_) => typed(name, Physical::INT64, None, optional),
            Of::Small(_) => typed(name, Physical::INT32, None, required),
            Of::Unsigned(_) => typed(name, Physical::INT32, Some(unsigned), required),
            Of::Cents(_) => {
                typed(name, Physical::INT64, Some(LogicalType::decimal(2, 9)), required)
            }
            Of::Texts(_) => typed(name, Physical::BYTE_ARRAY, Some(LogicalType::String), required),
            Of::Flags(_) => typed(name, Physical::BOOLEAN, None, required),
            Of::Stamps(_) => typed(name, Physical::INT64, Some(stamp), required),
        };
        Arc::new(built.build().expect("a sound column"))
    };
    let fields = columns.iter().map(field).collect();
    let schema = Type::group_type_builder("m").with_fields(fields).build().expect("sound");
    let properties = WriterProperties::builder().set_compression(compression).build();
    let mut writer =
        SerializedFileWriter::new(Vec::new(), Arc::new(schema), Arc::new(properties)).expect("ok");
    let rows = match columns.first() {
        Some((_, Of::Doubles(x))) => x.len(),
        Some((_, Of::Stamps(x))) => x.len(),
        Some((_, Of::Flags(x))) => x.len(),
        _ => 0,
    };
    for start in (0..rows).step_by(group.max(1)) {
        let end = (start + group).min(rows);
        let mut rows = writer.next_row_group().expect("a group");
        for (_, of) in columns {
            let mut column = rows.next_column().expect("a column").expect("one more");
            macro_rules! put {
                ($kind:ty, $values:expr) => {{
                    let values: Vec<_> = $values;
                    column.typed::<$kind>().write_batch(&values, None, None).expect("written");
                }};
            }
            macro_rules! put_some {
                ($kind:ty, $all:expr) => {{
                    let levels: Vec<i16> =
                        $all[start..end].iter().map(|x| i16::from(x.is_some())).collect();
                    let values: Vec<_> = $all[start..end].iter().flatten().copied().collect();
                    let typed = column.typed::<$kind>();
                    typed.write_batch(&values, Some(&levels), None).expect("written");
                }};
            }
            match of {
                Of::Doubles(all) => put_some!(DoubleType, all),
                Of::Ints(all) => put_some!(Int64Type, all),
                Of::Floats(all) => put!(FloatType, all[start..end].to_vec()),
                Of::Small(all) | Of::Unsigned(all) => put!(Int32Type, all[start..end].to_vec()),
                Of::Cents(all) | Of::Stamps(all) => put!(Int64Type, all[start..end].to_vec()),
                Of::Flags(all) => put!(BoolType, all[start..end].to_vec()),
                Of::Texts(all) => {
                    put!(
                        ByteArrayType,
                        all[start..end].iter().map(|t| ByteArray::from(*t)).collect()
                    );
                }
            }
            column.close().expect("closed");
        }
        rows.close().expect("closed");
    }
    writer.into_inner().expect("a file")
}

fn plain(columns: &[(&str, Of)]) -> Vec<u8> {
    file(columns, 2, Compression::SNAPPY)
}

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

fn load(bytes: &[u8], mapping: &Mapping) -> Result<(Dataset, DataReport)> {
    dataset(&read_bytes(Path::new("data.parquet"), bytes)?, mapping)
}

#[test]
fn every_type_of_number_is_read_and_nulls_are_missing() {
    let t = doubles(&[0.0, 0.5, 1.0]);
    let rows = [
        (Of::Doubles(vec![Some(1.5), None, Some(f64::NAN)]), [1.5, f64::NAN, f64::NAN]),
        (Of::Floats(vec![0.5, -2.0, 3.0]), [0.5, -2.0, 3.0]),
        (Of::Ints(vec![Some(-7), None, Some(9)]), [-7.0, f64::NAN, 9.0]),
        (Of::Small(vec![-7, 8, 9]), [-7.0, 8.0, 9.0]),
        (Of::Unsigned(vec![-1, 8, 9]), [4294967295.0, 8.0, 9.0]),
        (Of::Texts(vec!["1.5", "", "1e3"]), [1.5, f64::NAN, 1000.0]),
    ];
    for compression in [Compression::UNCOMPRESSED, Compression::SNAPPY, Compression::LZ4_RAW] {
        for (of, expected) in &rows {
            // Another column is measured always, so that no row is empty.
            let columns = [("t [s]", t.clone()), ("x", of.clone()), ("y", t.clone())];
            let (data, _) =
                load(&file(&columns, 2, compression), &mapping(None, &["x", "y"])).expect("good");
            let read = &data.runs[0].values[0];
            assert_eq!(format!("{read:?}"), format!("{expected:?}"));
            assert_eq!(data.runs[0].lines, [1, 2, 3]);
        }
    }
    let columns = [("t", t), ("cents", Of::Cents(vec![150, -5, 0]))];
    let (data, _) = load(&plain(&columns), &mapping(None, &["cents"])).expect("good");
    assert_eq!(data.runs[0].values[0], [1.5, -0.05, 0.0]);
}

#[test]
fn runs_are_named_by_text_or_by_integers() {
    let t = doubles(&[0.0, 1.0, 0.0, 1.0]);
    let large = i64::MAX - 1;
    let rows = [
        (Of::Texts(vec!["a", "a", "b b", "b b"]), ["a", "b b"]),
        (Of::Ints(vec![Some(7), Some(7), Some(-1), Some(-1)]), ["7", "-1"]),
        (Of::Small(vec![7, 7, 8, 8]), ["7", "8"]),
        (doubles(&[1.0, 1.0, 2.0, 2.0]), ["1", "2"]),
        (
            Of::Ints(vec![Some(large - 1), Some(large - 1), Some(large), Some(large)]),
            ["9223372036854775805", "9223372036854775806"],
        ),
    ];
    for (run, expected) in rows {
        let columns = [("t", t.clone()), ("run", run), ("x", t.clone())];
        let (data, _) = load(&plain(&columns), &mapping(Some("run"), &["x"])).expect("good");
        let names: Vec<&str> = data.runs.iter().map(|run| run.name.as_str()).collect();
        assert_eq!(names, expected);
    }
}

fn sample() -> Dataset {
    let run = |name: &str, from: f64| Run {
        name: name.to_string(),
        times: (0..30).map(|i| from + 0.1 * f64::from(i)).collect(),
        values: vec![
            (0..30).map(|i| (0.1 * f64::from(i) + from).sin()).collect(),
            (0..30).map(|i| if i == 7 { f64::NAN } else { f64::from(i * i) }).collect(),
        ],
        lines: vec![0; 30],
        clock: Clock::default(),
        inputs: Vec::new(),
        groups: Vec::new(),
        errors: Vec::new(),
    };
    Dataset {
        inputs: Vec::new(),
        observables: vec!["x".to_string(), "y".to_string()],
        runs: vec![run("1", 0.0), run("2", 3.0)],
    }
}

#[test]
fn a_data_set_comes_back_bit_by_bit_with_the_report_of_its_text() {
    let data = sample();
    for names in [["1", "2"], ["a", "01"]] {
        let mut data = data.clone();
        for (run, name) in data.runs.iter_mut().zip(names) {
            run.name = name.to_string();
        }
        let layout = Layout::default();
        let bytes = to_parquet(Path::new("x.parquet"), &data, &layout).expect("finite");
        let text = to_csv(Path::new("x.csv"), &data, &layout).expect("finite");
        let asked = mapping(Some("run"), &["x", "y"]);
        let (back, report) = load(&bytes, &asked).expect("good");
        let table = read_bytes(Path::new("x.csv"), &text).expect("good");
        let (other, text_report) = dataset(&table, &asked).expect("good");
        for (run, other) in back.runs.iter().zip(&other.runs) {
            assert_eq!((&run.name, &run.times), (&other.name, &other.times));
            assert_eq!(format!("{:?}", run.values), format!("{:?}", other.values));
        }
        assert_eq!(report.columns, text_report.columns);
        assert_eq!(report.sampling, text_report.sampling);
        assert_eq!(report.warnings, text_report.warnings);
        let text = report.to_text();
        assert!(text.contains("60 rows, Parquet, 1 row group, written by leverrier"), "{text}");
        let source = report.source.expect("a file");
        assert!(matches!(source.reading, Reading::Parquet(_)), "{source:?}");
    }
}

fn refused(bytes: &[u8], run: Option<&str>) -> DataError {
    match load(bytes, &mapping(run, &["x"])) {
        Err(Error::Data(error)) => error,
        other => panic!("{other:?}"),
    }
}

#[test]
fn every_bad_file_is_refused_with_place_and_advice() {
    let t = || doubles(&[0.0, 1.0, 2.0, 3.0]);
    let x = || doubles(&[1.0, 2.0, 3.0, 4.0]);
    let good = plain(&[("t", t()), ("x", x())]);
    let with = |of: Of| plain(&[("t", t()), ("x", of)]);
    let some = |values: [Option<f64>; 4]| Of::Doubles(values.to_vec());
    let mut scrambled = good.clone();
    let body = good.len() / 3;
    scrambled[4..body].fill(0xff);
    // What is wrong, the file, its run column; row, row group and column of the error; words.
    type Row<'a> =
        (Vec<u8>, Option<&'a str>, Option<u64>, Option<u32>, Option<&'a str>, &'a [&'a str]);
    let rows: Vec<Row> = vec![
        (Vec::new(), None, None, None, None, &["is empty"]),
        (b"t,x\n0,1\n".to_vec(), None, None, None, None, &["does not begin with PAR1"]),
        (b"PAR1".to_vec(), None, None, None, None, &["cut off", "copy it again"]),
        (good[..good.len() - 1].to_vec(), None, None, None, None, &["cut off"]),
        (good[..good.len() / 2].to_vec(), None, None, None, None, &["cut off"]),
        (scrambled, None, Some(1), Some(1), Some("t"), &["damaged", "copy it again"]),
        (plain(&[("t", doubles(&[])), ("x", doubles(&[]))]), None, None, None, None, &["no rows"]),
        (plain(&[("t", t()), ("xx", x())]), None, None, None, Some("x"), &["did you mean `xx`?"]),
        (plain(&[("clock", t()), ("x", x())]), None, None, None, None, &["holds the time"]),
        (
            plain(&[("t", t()), ("x [m]", x()), ("x [mm]", x())]),
            None,
            None,
            None,
            Some("x"),
            &["`x [m]` and `x [mm]`"],
        ),
        (
            with(Of::Texts(vec!["1", "2", "three", "4"])),
            None,
            Some(3),
            Some(2),
            Some("x"),
            &["`three` is not a number"],
        ),
        (
            with(Of::Flags(vec![true, false, true, true])),
            None,
            Some(1),
            Some(1),
            Some("x"),
            &["`true` is not a number"],
        ),
        (with(Of::Stamps(vec![1, 2, 3, 4])), None, None, None, Some("x"), &["timestamps"]),
        (
            plain(&[("t", Of::Stamps(vec![1, 2, 3, 4])), ("x", x())]),
            None,
            None,
            None,
            Some("t"),
            &["timestamps", "seconds since the start"],
        ),
        (
            with(doubles(&[1.0, 2.0, 3.0, f64::NEG_INFINITY])),
            None,
            Some(4),
            Some(2),
            Some("x"),
            &["`-inf` is infinite"],
        ),
        (
            plain(&[("t", some([Some(0.0), None, Some(2.0), Some(3.0)])), ("x", x())]),
            None,
            Some(2),
            Some(1),
            Some("t"),
            &["no time"],
        ),
        (with(some([None; 4])), None, None, None, None, &["nothing was measured"]),
        (
            plain(&[("t", doubles(&[3.0, 2.0, 1.0, 0.0])), ("x", x())]),
            None,
            Some(2),
            Some(1),
            Some("t"),
            &["time runs backwards, from 3 to 2"],
        ),
        (
            plain(&[("t", doubles(&[0.0, 1.0, 1.0, 2.0])), ("x", x())]),
            None,
            Some(3),
            Some(2),
            Some("t"),
            &["rows 2 and 3", "different samples"],
        ),
        (
            plain(&[("t", t()), ("x", x()), ("run", Of::Texts(vec!["a", "a", "", "b"]))]),
            Some("run"),
            Some(3),
            Some(2),
            Some("run"),
            &["no run"],
        ),
        (
            plain(&[("t", t()), ("x", x()), ("run", Of::Stamps(vec![1, 1, 2, 2]))]),
            Some("run"),
            None,
            None,
            Some("run"),
            &["timestamps, which name no run", "whole numbers"],
        ),
        (
            plain(&[("t", t()), ("x", x()), ("trial", x())]),
            Some("trail"),
            None,
            None,
            Some("trail"),
            &["did you mean `trial`?"],
        ),
    ];
    for (bytes, run, row, group, column, says) in rows {
        let error = refused(&bytes, run);
        assert_eq!((error.line, error.row_group), (row, group), "{error}");
        assert_eq!(error.column.as_deref(), column, "{error}");
        for fragment in says {
            assert!(error.to_string().contains(fragment), "{fragment:?} is not in: {error}");
        }
        if let (Some(row), Some(group)) = (row, group) {
            let place = format!(", row {row} (row group {group})");
            assert!(error.to_string().contains(&place), "{error}");
        }
    }
}

#[test]
fn a_column_that_is_not_asked_for_may_hold_anything() {
    let stamps = Of::Stamps(vec![1, 2, 3]);
    let t = doubles(&[0.0, 1.0, 2.0]);
    let bytes = plain(&[("when", stamps), ("t", t.clone()), ("x", t)]);
    // The first column sets the number of rows of the test file, whatever its kind.
    assert_eq!(load(&bytes, &mapping(None, &["x"])).expect("good").0.samples(), 3);
}

#[test]
fn no_damage_ends_the_program() {
    let bytes = to_parquet(Path::new("x"), &sample(), &Layout::default()).expect("finite");
    let asked = mapping(Some("run"), &["x", "y"]);
    for length in 0..bytes.len() {
        assert!(load(&bytes[..length], &asked).is_err(), "cut at {length}");
    }
    for at in 0..bytes.len() {
        for mask in [0x01, 0x80, 0xff] {
            let mut damaged = bytes.clone();
            damaged[at] ^= mask;
            // A changed number may well be read; it must not panic.
            let _ = load(&damaged, &asked);
        }
    }
}
