//! docs/peers.md: sections of tables, each kept from the last run that took it.

use std::fmt::Write as _;
use std::path::Path;

/// What one part of the command found.
#[derive(Default)]
pub(crate) struct Section {
    pub title: String,
    pub about: String,
    pub columns: Vec<&'static str>,
    pub rows: Vec<Vec<String>>,
    pub notes: Vec<String>,
}

impl Section {
    pub(crate) fn new(title: &str, about: &str, columns: &[&'static str]) -> Section {
        let (title, about) = (title.to_string(), about.to_string());
        Section { title, about, columns: columns.to_vec(), ..Section::default() }
    }

    pub(crate) fn row(&mut self, cells: &[&str]) {
        println!("    {}", cells.join(" | "));
        self.rows.push(cells.iter().map(|cell| cell.replace('|', "\\|")).collect());
    }

    /// A row that could not be taken.
    pub(crate) fn not_run(&mut self, who: &str, why: &str) {
        let mut cells = vec![who, "not run"];
        cells.resize(self.columns.len(), "");
        self.row(&cells);
        self.note(&format!("{who}: {why}."));
    }

    pub(crate) fn note(&mut self, text: &str) {
        println!("    {text}");
        self.notes.push(text.to_string());
    }

    fn text(&self) -> String {
        let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
        let load = load.split(' ').next().unwrap_or("unknown");
        let mut text = format!("## {}\n\n{}\n\n", self.title, self.about);
        let _ = writeln!(text, "| {} |", self.columns.join(" | "));
        let _ = writeln!(text, "|{}", "---|".repeat(self.columns.len()));
        for row in &self.rows {
            let _ = writeln!(text, "| {} |", row.join(" | "));
        }
        for note in &self.notes {
            let _ = write!(text, "\n{note}\n");
        }
        let _ = write!(text, "\nLoad average at the end of this table: {load}.\n");
        text
    }

    pub(crate) fn keep(&self, folder: &Path, name: &str) -> Result<(), String> {
        let path = folder.join(format!("{name}.md"));
        std::fs::write(&path, self.text()).map_err(|error| format!("{}: {error}", path.display()))
    }
}

/// The page of all sections that were ever taken in a folder, in the order of `names`.
pub(crate) fn page(folder: &Path, names: &[&str]) -> String {
    let mut text = format!(
        "# Beside others\n\n\
         `cargo run --release --example peers` takes these figures and writes this page. It makes \
         a Python environment of its own below `target/peers`, with the versions named in the \
         tables, and runs its own short scripts, which stand in `examples/peers/python`. \
         `--only NAME` takes one table: {}.\n\n\
         Machine: {}. Everything runs on one core unless said, on double precision unless said. \
         Contestants of a table take turns within one run, after a first turn that does not \
         count; the fastest of several turns is given, in processor time, which other programs \
         disturb less than a clock on the wall. Compilation is told apart from running.\n",
        names.join(", "),
        machine()
    );
    for name in names {
        match std::fs::read_to_string(folder.join(format!("{name}.md"))) {
            Ok(section) => text += &format!("\n{section}"),
            Err(_) => text += &format!("\n## {name}\n\nnot run\n"),
        }
    }
    text
}

fn machine() -> String {
    let about = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let value = |name: &str| {
        let line = about.lines().find(|line| line.starts_with(name));
        line.and_then(|line| line.split_once(": ")).map(|(_, value)| value.to_string())
    };
    let model = value("model name").unwrap_or("an unknown processor".to_string());
    let flags = value("flags").unwrap_or_default();
    let widest = ["avx512f", "avx2"].into_iter().find(|set| flags.contains(set));
    format!("{model}, {} cores, {}", cores(), widest.unwrap_or("no wide vectors"))
}

/// Cores of the machine, whatever this process is bound to.
pub(crate) fn cores() -> usize {
    let about = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    about.lines().filter(|line| line.starts_with("processor")).count().max(1)
}

/// 1.23 ns, 4.5 ms, 6.7 s.
pub(crate) fn time(seconds: f64) -> String {
    let (value, unit) = match seconds {
        s if s.is_nan() => return "-".to_string(),
        s if s < 1e-6 => (s * 1e9, "ns"),
        s if s < 1e-3 => (s * 1e6, "µs"),
        s if s < 1.0 => (s * 1e3, "ms"),
        s => (s, "s"),
    };
    if value < 10.0 { format!("{value:.2} {unit}") } else { format!("{value:.1} {unit}") }
}

/// 0.53, 1.2, 45, 12,000.
pub(crate) fn ratio(value: f64) -> String {
    match value {
        x if x.is_nan() => "-".to_string(),
        x if x < 3.0 => format!("{x:.2}"),
        x if x < 100.0 => format!("{x:.1}"),
        x if x < 10_000.0 => format!("{x:.0}"),
        x => {
            let thousands = (x / 1000.0).round();
            if thousands < 1000.0 { format!("{thousands:.0},000") } else { format!("{x:.0e}") }
        }
    }
}
