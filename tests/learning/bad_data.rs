//! Bad files: every one is refused, with its place and with advice.

use std::path::Path;

use leverrier::internals::data::{
    DataReport, Dataset, Mapping, ObservableMap, dataset, read_bytes,
};
use leverrier::internals::error::{Error, Result};

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

/// One bad file: what it is, its content, its run column, the line and column that the
/// error names, and what message and hint say.
struct Bad {
    what: &'static str,
    content: &'static [u8],
    run: Option<&'static str>,
    line: Option<u64>,
    column: Option<&'static str>,
    says: &'static [&'static str],
}

const fn bad(
    what: &'static str,
    content: &'static [u8],
    line: Option<u64>,
    column: Option<&'static str>,
    says: &'static [&'static str],
) -> Bad {
    Bad { what, content, run: None, line, column, says }
}

/// Rows of which every one must be refused when `t` and `x` are asked for.
const BAD_FILES: &[Bad] = &[
    bad("empty", b"", None, None, &["is empty", "header"]),
    bad("a mark only", b"\xEF\xBB\xBF", None, None, &["is empty"]),
    bad("blank lines", b"\n \r\n\n", None, None, &["is empty"]),
    bad("comments", b"# a\n# b\n", None, None, &["only comment"]),
    bad(
        "header only",
        b"# a\n\nt,x\n",
        Some(3),
        None,
        &["no row of measurements", "one row per sample"],
    ),
    bad("header and empty rows", b"t,x\n,\n,\n", Some(1), None, &["no row of measurements"]),
    bad(
        "no header",
        b"\n0,1\n1,2\n",
        Some(2),
        None,
        &["no header", "first line that names the columns"],
    ),
    bad("short row", b"t,x,y\n0,1,2\n\n# note\n1,2\n", Some(5), None, &["2 cells", "3 columns"]),
    bad("long row", b"t,x\r\n0,1\r\n1,2,3\r\n", Some(3), None, &["3 cells", "2 columns"]),
    bad(
        "row names without a header",
        b"t,x\n1,0,1\n2,1,2\n",
        Some(2),
        None,
        &["3 cells", "name every column"],
    ),
    bad(
        "same column twice",
        b"t,x,x\n0,1,2\n1,2,3\n",
        Some(1),
        Some("x"),
        &["two columns", "name of its own"],
    ),
    bad(
        "name of two columns",
        b"t,x [m],x [mm]\n0,1,2\n1,2,3\n",
        Some(1),
        Some("x"),
        &["`x [m]` and `x [mm]`", "whole header"],
    ),
    bad(
        "text in a number",
        b"t,x [m]\n0,1\n1,two\n",
        Some(3),
        Some("x [m]"),
        &["`two` is not a number"],
    ),
    bad(
        "units that differ in cells",
        b"t,x\n0,1 m\n1,2 mm\n",
        Some(2),
        Some("x"),
        &["`1 m` is not a number"],
    ),
    bad(
        "a date among numbers",
        b"t,x\n0,1\n2024-01-01 10:00:01,2\n2,3\n",
        Some(3),
        Some("t"),
        &["not a number", "seconds since the start"],
    ),
    bad(
        "thousands separator",
        b"t;x\n0;1,234.5\n1;2,3\n",
        Some(2),
        Some("x"),
        &["not a number", "thousands"],
    ),
    bad(
        "infinity",
        b"t,x\n0,1\n1,-inf\n",
        Some(3),
        Some("x"),
        &["infinite", "leave the cell empty"],
    ),
    bad("infinite time", b"t,x\n0,1\nInfinity,2\n", Some(3), Some("t"), &["infinite"]),
    bad(
        "spreadsheet's division by zero",
        b"t,x\n0,#DIV/0!\n1,2\n",
        Some(2),
        Some("x"),
        &["infinite"],
    ),
    bad("too large", b"t,x\n0,1e400\n1,2\n", Some(2), Some("x"), &["too large"]),
    bad(
        "open quotation mark",
        b"t,x,y\n0,\"1,2\n1,2,3\n2,3,4\n",
        Some(2),
        None,
        &["quotation mark"],
    ),
    bad(
        "open quotation mark in the last column",
        b"t,x\n0,\"1\n1,2\n2,3\n",
        Some(2),
        Some("x"),
        &["quotation mark"],
    ),
    bad(
        "no time column",
        b"clock,x\n0,1\n1,2\n",
        Some(1),
        None,
        &["no column holds the time", "`clock`, `x`", "time t [s]"],
    ),
    bad(
        "no such column",
        b"t,xx,theta\n0,1,2\n1,2,3\n",
        Some(1),
        Some("x"),
        &["no column `x`", "`t`, `xx`, `theta`", "did you mean `xx`?"],
    ),
    bad("sample without a time", b"t,x\n0,1\nNA,2\n", Some(3), Some("t"), &["no time"]),
    bad("one row", b"t,x\n0,1\n", Some(2), None, &["only one sample", "more rows"]),
    bad("nothing measured", b"t,x\n0,NA\n1,\n", None, None, &["nothing was measured"]),
    bad(
        "time backwards",
        b"t,x\n3,1\n2,2\n1,3\n",
        Some(3),
        Some("t"),
        &["time runs backwards, from 3 to 2", "rising time"],
    ),
    bad(
        "clock starts again",
        b"t,x\n0,1\n1,2\n2,3\n0,5\n1,6\n2,7\n",
        Some(5),
        Some("t"),
        &["jumps back from 2 to 0", "add a column"],
    ),
    bad(
        "clock starts again, with a run column",
        b"trial,t,x\na,0,1\na,1,2\nb,0,3\nb,1,4\n",
        Some(4),
        Some("t"),
        &["jumps back", "write `run trial`"],
    ),
    bad(
        "two samples at once",
        b"t,x\n0,1\n1,2\n1,3\n2,4\n",
        Some(4),
        Some("t"),
        &["lines 3 and 4", "different samples", "time 1"],
    ),
    bad(
        "binary",
        b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR",
        Some(2),
        None,
        &["not a text file", "CSV"],
    ),
    bad("a zero byte", b"t,x\n0,1\n1,\x002\n", Some(3), None, &["not a text file"]),
    Bad {
        run: Some("run"),
        ..bad(
            "runs of one sample",
            b"run,t,x\na,0,1\nb,0,2\n",
            Some(2),
            Some("run"),
            &["each of the 2 runs", "run column"],
        )
    },
    Bad {
        run: Some("run"),
        ..bad(
            "sample without a run",
            b"run,t,x\na,0,1\na,1,1\n,2,2\n",
            Some(4),
            Some("run"),
            &["no run"],
        )
    },
    Bad {
        run: Some("trail"),
        ..bad(
            "no such run column",
            b"trial,t,x\na,0,1\na,1,1\n",
            Some(1),
            Some("trail"),
            &["no column `trail` for the run", "did you mean `trial`?"],
        )
    },
];

#[test]
fn every_bad_file_is_refused_with_place_and_advice() {
    for row in BAD_FILES {
        let error = match load(row.content, &mapping(row.run, &["x"])) {
            Err(Error::Data(error)) => error,
            other => panic!("{}: {other:?}", row.what),
        };
        assert_eq!(error.line, row.line, "{}: {error}", row.what);
        assert_eq!(error.column.as_deref(), row.column, "{}: {error}", row.what);
        for fragment in row.says {
            assert!(
                error.to_string().contains(fragment),
                "{}: {fragment:?} is not in: {error}",
                row.what
            );
        }
    }
}
