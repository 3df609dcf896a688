//! One fit of a file, stage by stage.

use std::path::Path;
use std::sync::Mutex;
use std::time::Instant;

use leverrier::internals::data::{FileSource, Mapping, ObservableMap, survey_file};
use leverrier::internals::expr::build;
use leverrier::internals::fit::Tuning;
use leverrier::internals::fit::{Monitor, Options, fit_stream};

/// Seconds of the stages of a fit, and what it took.
#[derive(Debug, Clone, Default)]
pub(crate) struct Stages {
    /// Reading the file once, counting, sampling.
    pub survey: f64,
    /// The first pass: linearised by all 30 terms.
    pub pass: f64,
    /// Processor time of it.
    pub pass_processor: f64,
    /// The passes of the refits, together, and how many there were.
    pub refits: f64,
    pub count: usize,
    /// From the first to the last second.
    pub whole: f64,
    /// Processor time of all threads.
    pub processor: f64,
    /// Peak resident memory, MiB.
    pub memory: f64,
    /// Terms that were found.
    pub terms: usize,
    /// Largest error of a coefficient in standard errors.
    pub error: f64,
}

impl Stages {
    pub(crate) fn to_line(&self) -> String {
        let numbers = [
            self.survey,
            self.pass,
            self.pass_processor,
            self.refits,
            self.count as f64,
            self.whole,
            self.processor,
            self.memory,
            self.terms as f64,
            self.error,
        ];
        numbers.map(|x| format!("{x:.4}")).join(" ")
    }

    pub(crate) fn from_line(line: &str) -> Stages {
        let n: Vec<f64> = line.split(' ').map(|x| x.parse().expect("a number")).collect();
        Stages {
            survey: n[0],
            pass: n[1],
            pass_processor: n[2],
            refits: n[3],
            count: n[4] as usize,
            whole: n[5],
            processor: n[6],
            memory: n[7],
            terms: n[8] as usize,
            error: n[9],
        }
    }
}

const SPACE: &str = "coordinates q[1..2]\nmomenta p[1..2]\n\
    T = span{ tensor(p; 3) }\nV = span{ tensor(q; 3) }\n";

/// The true coefficients.
const TRUTH: [(&str, f64); 6] = [
    ("p[1]^2", 0.5),
    ("p[2]^2", 0.5),
    ("q[1]^2", 0.5),
    ("q[2]^2", 0.5),
    ("q[1]^2*q[2]", 1.0),
    ("q[2]^3", -1.0 / 3.0),
];

/// Seconds and processor seconds of each pass, and the processor time when the last one began.
#[derive(Default)]
struct Passes {
    done: Mutex<Vec<(f64, f64)>>,
    begun: Mutex<f64>,
}

impl Monitor for Passes {
    fn stage(&self, what: &str, fraction: f64) {
        if fraction == 0.0 && what.starts_with("pass ") {
            *self.begun.lock().expect("no thread panicked") = processor_seconds();
        }
    }

    fn passed(&self, _: u64, seconds: f64) {
        let begun = *self.begun.lock().expect("no thread panicked");
        let taken = (seconds, processor_seconds() - begun);
        self.done.lock().expect("no thread panicked").push(taken);
    }
}

/// Fits a file on some threads, and measures this process.
pub(crate) fn measure(file: &Path, threads: usize) -> Stages {
    let clock = Instant::now();
    let mapping = Mapping {
        groups: Vec::new(),
        inputs: Vec::new(),
        time: None,
        every: None,
        file: None,
        run: Some("run".to_string()),
        observables: ["q1", "q2", "p1", "p2"].map(ObservableMap::plain).to_vec(),
    };
    let source = FileSource::new(file, &mapping, false).expect("a file of transitions");
    let found =
        survey_file(&source, Tuning::default().course.sampled, 0, &|_| true).expect("a sound file");
    let survey = clock.elapsed().as_secs_f64();
    let space = build("space", SPACE).expect("a sound spec");
    let passes = Passes::default();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let model = pool
        .install(|| fit_stream(&space.system, &source, &found, &Options::default(), &passes))
        .expect("a model");
    let passes = passes.done.into_inner().expect("no thread panicked");
    let error = |(term, truth): &(&str, f64)| {
        let found = model.terms.iter().find(|t| t.term == *term);
        found.map_or(f64::NAN, |t| (t.coefficient - truth).abs() / t.standard_error)
    };
    Stages {
        survey,
        pass: passes.first().map_or(f64::NAN, |pass| pass.0),
        pass_processor: passes.first().map_or(f64::NAN, |pass| pass.1),
        refits: passes.iter().skip(1).map(|pass| pass.0).sum(),
        count: passes.len().saturating_sub(1),
        whole: clock.elapsed().as_secs_f64(),
        processor: processor_seconds(),
        memory: peak_memory(),
        terms: model.terms.len(),
        error: TRUTH.iter().map(error).fold(0.0, f64::max),
    }
}

/// MiB; NaN where the system does not tell.
pub(crate) fn peak_memory() -> f64 {
    let about = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    about
        .lines()
        .find_map(|line| {
            line.strip_prefix("VmHWM:")?.trim().strip_suffix("kB")?.trim().parse().ok()
        })
        .map_or(f64::NAN, |kilobytes: f64| kilobytes / 1024.0)
}

/// User and system time of this process, in hundredths of a second as Linux counts them.
pub(crate) fn processor_seconds() -> f64 {
    let about = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = about.rsplit(')').next().unwrap_or("").split_whitespace().collect();
    let field = |at: usize| fields.get(at).and_then(|x| x.parse::<f64>().ok());
    match (field(11), field(12)) {
        (Some(user), Some(system)) => (user + system) / 100.0,
        _ => f64::NAN,
    }
}
