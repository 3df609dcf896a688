//! The same measurements in other clothes: units, origins, signs, orders, duplicates, formats,
//! threads. What is learned and what is told of them is the same.

use std::path::Path;

use leverrier::internals::data::{Layout, read_bytes, to_parquet};
use leverrier::{Data, Law, LearnedTerm, Result, Spec};

use crate::hidden::bases::Base;
use crate::hidden::case;

/// A sample: its run, its time in the digits of the file, its values.
type Row = (String, String, Vec<f64>);

/// Measurements of one system, as a spec and a table.
#[derive(Clone)]
pub(crate) struct Wearer {
    variables: String,
    space: String,
    /// Names of coordinates and momenta, as in the table's header.
    columns: Vec<String>,
    degrees: usize,
    rows: Vec<Row>,
    /// What the data block says more.
    block: String,
    separator: char,
    comma: bool,
    /// The table as a file, where that is another than its text.
    encode: fn(&str) -> Vec<u8>,
    file: &'static str,
    threads: usize,
}

impl Wearer {
    /// Measurements of a base with a statement hidden in it.
    pub(crate) fn new(base: &Base, hidden: &str, noise: f64, seed: u64) -> Self {
        let made = case(base, hidden, noise, seed);
        let columns = made.training.observables.clone();
        let runs = made.training.runs.iter().chain(&made.held_out.runs);
        let rows = runs.flat_map(|run| {
            let row = |at: usize| {
                let values = run.values.iter().map(|column| column[at]).collect();
                (run.name.clone(), format!("{}", run.time(at)), values)
            };
            (0..run.times.len()).map(row)
        });
        let plain = |text: &str| text.as_bytes().to_vec();
        Wearer {
            variables: base.variables.to_string(),
            space: base.space.to_string(),
            degrees: columns.len() / 2,
            columns,
            rows: rows.collect(),
            block: String::new(),
            separator: ',',
            comma: false,
            encode: plain,
            file: "data.csv",
            threads: 2,
        }
    }

    /// Without the columns of the momenta.
    pub(crate) fn positions_only(mut self) -> Self {
        self.columns.truncate(self.degrees);
        self.rows.iter_mut().for_each(|(.., values)| values.truncate(self.degrees));
        self
    }

    fn table(&self) -> String {
        let separator = self.separator.to_string();
        let number = |x: &f64| {
            let text = format!("{x:?}");
            if self.comma { text.replace('.', ",") } else { text }
        };
        let time = |t: &str| if self.comma { t.replace('.', ",") } else { t.to_string() };
        let header = ["run", "t"].into_iter().map(str::to_string).chain(self.columns.clone());
        let mut text = header.collect::<Vec<_>>().join(&separator) + "\n";
        for (run, at, values) in &self.rows {
            let cells = [run.clone(), time(at)].into_iter().chain(values.iter().map(number));
            text += &(cells.collect::<Vec<_>>().join(&separator) + "\n");
        }
        text
    }

    fn text(&self) -> String {
        let data = format!("data \"{}\" {{ time t  run run{} }}\n", self.file, self.block);
        format!("{}{data}{}", self.variables, self.space)
    }

    /// Spec and data as they are read from a folder.
    fn read(&self, folder: &Path) -> Result<(Spec, Data)> {
        let path = folder.join(self.file);
        std::fs::write(&path, (self.encode)(&self.table())).expect("a folder");
        let spec = Spec::parse(&self.text())?;
        let data = Data::open(&path, &spec)?;
        Ok((spec, data))
    }

    fn pool(&self) -> rayon::ThreadPool {
        rayon::ThreadPoolBuilder::new().num_threads(self.threads).build().expect("threads")
    }

    fn learned(&self) -> (Law, Data) {
        let folder = tempfile::tempdir().expect("a folder");
        let (spec, data) =
            self.read(folder.path()).unwrap_or_else(|error| panic!("{}\n{error}", self.text()));
        let fitted = self.pool().install(|| spec.fit(&data));
        (fitted.unwrap_or_else(|error| panic!("{}\n{error}", self.text())), data)
    }

    /// The missing effect that a diagnosis names.
    fn told(&self) -> Option<String> {
        let folder = tempfile::tempdir().expect("a folder");
        let (spec, data) = self.read(folder.path()).expect("sound data");
        let told = self.pool().install(|| {
            let (training, held_out) = data.split(0.25, 0)?;
            spec.fit(&training)?.diagnose(&training, &held_out)
        });
        told.expect("a diagnosis").missing().map(str::to_string)
    }
}

/// What the coefficient of a term is multiplied by.
type Factor = fn(&LearnedTerm) -> f64;

/// One way to dress.
pub(crate) struct Garment {
    /// What is changed.
    pub name: &'static str,
    /// Whether a system can wear it.
    pub fits: fn(&Wearer) -> bool,
    wear: fn(&mut Wearer),
    factor: Factor,
    /// Whether every bit is the same.
    exact: bool,
}

const fn garment(name: &'static str, exact: bool, wear: fn(&mut Wearer)) -> Garment {
    Garment { name, fits: |_| true, wear, factor: |_| 1.0, exact }
}

/// Degree of a monomial in all of its variables: `x^2*y` has 3; a name alone has 1.
fn degree(term: &str) -> i32 {
    let of = |factor: &str| match factor.split_once('^') {
        Some((_, power)) => power.trim().parse::<i32>().expect("a whole power"),
        None => i32::from(factor.trim().starts_with(char::is_alphabetic)),
    };
    term.split(['*', ' ']).filter(|factor| !factor.is_empty()).map(of).sum()
}

/// Whether all that is learned is a sum of monomials, and all that is known the kinetic energy.
fn monomials(wearer: &Wearer) -> bool {
    let learned = wearer.space.split("V = span{").nth(1);
    learned.is_some_and(|learned| !learned.contains(['(', '/', '+']))
}

/// Whether all of the potential is learned, and forces are none: then a scale of time is a factor.
fn potential_is_learned(wearer: &Wearer) -> bool {
    wearer.space.lines().filter(|line| !line.trim().is_empty()).count() == 2
        && wearer.space.contains("\nV = span{")
        && !wearer.variables.contains("time")
}

fn scaled(wearer: &mut Wearer, q: f64, p: f64) {
    let degrees = wearer.degrees;
    for (.., values) in &mut wearer.rows {
        for (at, value) in values.iter_mut().enumerate() {
            *value *= if at < degrees { q } else { p };
        }
    }
}

fn in_order_of(wearer: &mut Wearer, key: impl Fn(usize, &str) -> u64) {
    let mut numbered: Vec<(u64, Row)> =
        wearer.rows.drain(..).enumerate().map(|(at, row)| (key(at, &row.0), row)).collect();
    numbered.sort_by_key(|(key, _)| *key);
    wearer.rows = numbered.into_iter().map(|(_, row)| row).collect();
}

fn clock(wearer: &mut Wearer, by: u64) {
    for (_, time, _) in &mut wearer.rows {
        let (whole, part) = time.split_once('.').unwrap_or((time.as_str(), "0"));
        *time = format!("{}.{part}", whole.parse::<u64>().expect("a time") + by);
    }
}

/// A number of a name, that has nothing to do with its order.
fn shuffled(name: &str) -> u64 {
    name.bytes().fold(7, |sum: u64, byte| sum.wrapping_mul(31).wrapping_add(u64::from(byte)))
        % 10_007
}

fn as_parquet(text: &str) -> Vec<u8> {
    use leverrier::internals::data::{Mapping, ObservableMap, dataset};
    let table = read_bytes(Path::new("data.csv"), text.as_bytes()).expect("a table");
    let names: Vec<String> = table.columns.iter().skip(2).map(|c| c.header.clone()).collect();
    let observables = names.iter().map(ObservableMap::plain).collect();
    let mapping = Mapping { run: Some("run".to_string()), observables, ..Mapping::default() };
    let (data, _) = dataset(&table, &mapping).expect("a data set");
    to_parquet(Path::new("data.parquet"), &data, &Layout::default()).expect("finite numbers")
}

/// All of them. A new one is a row here.
pub(crate) const GARMENTS: &[Garment] = &[
    garment("one thread", true, |w| w.threads = 1),
    garment("three threads", true, |w| w.threads = 3),
    garment("semicolons and decimal commas", true, |w| (w.separator, w.comma) = (';', true)),
    garment("tabs", true, |w| w.separator = '\t'),
    garment("line ends of DOS and a mark", true, |w| {
        w.encode = |text| format!("\u{feff}{}", text.replace('\n', "\r\n")).into_bytes();
    }),
    garment("UTF-16", true, |w| {
        w.encode = |text| {
            let units = std::iter::once(0xfeff).chain(text.encode_utf16());
            units.flat_map(u16::to_le_bytes).collect()
        };
    }),
    garment("Parquet", true, |w| (w.file, w.encode) = ("data.parquet", as_parquet)),
    garment("comments and empty lines", true, |w| {
        w.encode = |text| format!("# a note\n\n{}\n\n", text.replace("\n0,", "\n# x\n0,")).into();
    }),
    garment("rows of runs in turn", true, |w| {
        let mut count = std::collections::HashMap::new();
        let keys: Vec<u64> = (w.rows.iter())
            .map(|(run, ..)| *count.entry(run.clone()).and_modify(|n| *n += 1).or_insert(0))
            .collect();
        in_order_of(w, |at, _| keys[at]);
    }),
    garment("runs in another order", false, |w| in_order_of(w, |_, run| shuffled(run))),
    garment("runs with other names", false, |w| {
        w.rows.iter_mut().for_each(|(run, ..)| *run = format!("trial {}", shuffled(run)));
    }),
    garment("columns in another order", true, |w| {
        w.columns.reverse();
        w.rows.iter_mut().for_each(|(.., values)| values.reverse());
    }),
    garment("a column more", true, |w| {
        w.columns.push("temperature".to_string());
        w.rows.iter_mut().for_each(|(.., values)| values.push(21.0));
    }),
    garment("columns with other names", true, |w| {
        w.block = w.columns.iter().map(|name| format!("  {name} = c_{name}")).collect();
        w.columns.iter_mut().for_each(|name| *name = format!("c_{name}"));
    }),
    garment("a clock that starts at 1e6", false, |w| clock(w, 1_000_000)),
    garment("seconds since 1970", false, |w| clock(w, 1_700_000_000)),
    garment("a run that is listed twice", false, |w| {
        let first = w.rows[0].0.clone();
        let again = w.rows.iter().filter(|(run, ..)| *run == first).cloned();
        let again: Vec<_> = again.map(|(_, t, values)| ("again".to_string(), t, values)).collect();
        w.rows.extend(again);
    }),
    Garment {
        name: "positions and momenta times 1,000",
        fits: |w| monomials(w),
        wear: |w| scaled(w, 1000.0, 1000.0),
        factor: |term| 1000f64.powi(2 - degree(&term.term)),
        exact: false,
    },
    Garment {
        name: "positions and momenta a thousandth",
        fits: |w| monomials(w),
        wear: |w| scaled(w, 1e-3, 1e-3),
        factor: |term| 1e-3f64.powi(2 - degree(&term.term)),
        exact: false,
    },
    Garment {
        name: "signs",
        fits: |w| monomials(w),
        wear: |w| scaled(w, -1.0, -1.0),
        factor: |term| (-1f64).powi(degree(&term.term)),
        exact: false,
    },
    Garment {
        name: "time in thousandths",
        fits: |w| potential_is_learned(w),
        wear: |w| {
            scaled(w, 1.0, 1e-3);
            for (_, time, _) in &mut w.rows {
                *time =
                    format!("{}", (time.parse::<f64>().expect("a time") * 1e3 * 1e6).round() / 1e6);
            }
        },
        factor: |_| 1e-6,
        exact: false,
    },
];

/// How far numbers may move, in standard errors, where not every bit is the same.
pub(crate) const ROUNDING: f64 = 1e-3;

/// How far the coefficients of the same law in a garment are from those without it, in standard
/// errors. Another law, or one that claims another precision, is infinitely far.
pub(crate) fn moved(plain: &Wearer, garment: &Garment) -> f64 {
    let mut dressed = plain.clone();
    (garment.wear)(&mut dressed);
    let ((one, _), (other, about)) = (plain.learned(), dressed.learned());
    let twice = garment.name.contains("listed twice");
    assert!(!twice || about.warnings().iter().any(|text| text.contains("again")), "not a word");
    let names = |law: &Law| -> Vec<String> { law.terms().iter().map(|t| t.term.clone()).collect() };
    if names(&one) != names(&other) {
        println!("{}: {:?} became {:?}", garment.name, names(&one), names(&other));
        return f64::INFINITY;
    }
    let apart = one.terms().iter().zip(other.terms()).map(|(a, b)| {
        let factor = (garment.factor)(a);
        if (b.standard_error / factor.abs() / a.standard_error - 1.0).abs() > 1e-3 {
            println!("{}: {} +- {}", garment.name, a.standard_error, b.standard_error / factor);
            return f64::INFINITY;
        }
        let apart = (b.coefficient / factor - a.coefficient).abs();
        match garment.exact {
            true if apart == 0.0 => 0.0,
            true => f64::INFINITY,
            // What is left of the rounding of the factors themselves.
            false => (apart - 1e-13 * a.coefficient.abs()).max(0.0) / a.standard_error,
        }
    });
    apart.fold(0.0, f64::max)
}

/// What is told to be missing, without the garment and with it.
pub(crate) fn told(plain: &Wearer, garment: &Garment) -> (Option<String>, Option<String>) {
    let mut dressed = plain.clone();
    (garment.wear)(&mut dressed);
    (plain.told(), dressed.told())
}
