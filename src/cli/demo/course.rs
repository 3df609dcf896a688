//! Demos that walk through a folder of the course: its law, its spec, data made on the spot.

use std::time::Instant;

use serde_json::{Value, json};

use super::{DemoRun, indented};
use crate::cli::progress::Progress;
use crate::data::{Layout, write_atomically, write_csv};
use crate::error::Result;
use crate::expr;
use crate::fit::Options;
use crate::project::fitting::{learn, origin, write_model};
use crate::project::{ModelFile, Spec};
use crate::report::layout::{WIDTH, wrapped};
use crate::report::{present, seconds};
use crate::simplify::Style;
use crate::simulate::{
    InitialDistribution, Interval, NoiseLevel, Simulator, add_noise, consecutive_pairs, draw,
};

/// One folder of the course.
pub(super) struct Course {
    /// What moves, in a sentence.
    pub about: &'static str,
    pub truth: &'static str,
    pub spec: &'static str,
    /// Name of the data file that the spec reads.
    pub file: &'static str,
    /// Bounds of each component of the start, coordinates first.
    pub starts: &'static [(f64, f64)],
    pub runs: usize,
    pub samples: u32,
    /// Every two neighbours become a run of two, as in the paper.
    pub pairs: bool,
    /// Standard deviation of the noise of every number.
    pub noise: f64,
}

/// Nonlinearly coupled oscillators: 200 noisy runs of four samples.
pub(super) static COUPLED: Course = Course {
    about: "two oscillators with a coupling that is not linear",
    truth: include_str!("../../../examples/coupled-oscillators/truth.ham"),
    spec: include_str!("../../../examples/coupled-oscillators/fit.ham"),
    file: "runs.csv",
    starts: &[(-1.0, 1.0); 4],
    runs: 200,
    samples: 4,
    pairs: false,
    noise: 0.005,
};

/// Five masses and six springs: 800 consecutive pairs.
pub(super) static SPRINGS: Course = Course {
    about: "five masses between two walls, joined by six springs",
    truth: include_str!("../../../examples/mass-spring/truth.ham"),
    spec: include_str!("../../../examples/mass-spring/fit.ham"),
    file: "chain.csv",
    starts: &[
        (0.25, 0.25),
        (0.5, 0.5),
        (0.75, 0.75),
        (1.0, 1.0),
        (1.25, 1.25),
        (-0.1, 0.1),
        (-0.1, 0.1),
        (-0.1, 0.1),
        (-0.1, 0.1),
        (-0.1, 0.1),
    ],
    runs: 1,
    samples: 801,
    pairs: false,
    noise: 0.0,
};

/// A pendulum: 200 consecutive pairs, and numbers inside a sine.
pub(super) static PENDULUM: Course = Course {
    about: "a pendulum let go at 1.4",
    truth: include_str!("../../../examples/pendulum/truth.ham"),
    spec: include_str!("../../../examples/pendulum/fit.ham"),
    file: "swing.csv",
    starts: &[(1.4, 1.4), (0.0, 0.0)],
    runs: 1,
    samples: 201,
    pairs: true,
    noise: 0.0,
};

/// Makes the data, learns the law from them, and shows it beside the truth.
pub(super) fn walk(stage: &DemoRun, course: &Course) -> Result<Value> {
    let say = |text: &str| match stage.console.is_json() {
        true => Ok(()),
        false => stage.console.text(&format!("{}\n\n", text.trim_end())),
    };
    let truth = expr::build("truth.ham", course.truth)?;
    let nature = Simulator::known(&truth.system);
    let intervals = course.starts.iter().map(|&(lower, upper)| Interval { lower, upper }).collect();
    let starts =
        draw(&nature, &InitialDistribution { intervals, energy: None }, course.runs, 0.0, 1)?;
    let times: Vec<f64> = (0..course.samples).map(|i| 0.1 * f64::from(i)).collect();
    let mut data = nature.trajectories(&starts, &times)?.dataset(&truth.system);
    if course.pairs {
        data = consecutive_pairs(&data);
    }
    let noise = vec![NoiseLevel::Absolute(course.noise); course.starts.len()];
    add_noise(&mut data, &noise, 1)?;
    for name in &mut data.observables {
        name.retain(|c| !matches!(c, '[' | ']'));
    }
    write_csv(&stage.folder.join(course.file), &data, &Layout::default())?;
    let spec = stage.folder.join("fit.ham");
    write_atomically(&spec, course.spec.as_bytes())?;
    let opening = format!(
        "The measurements: {}, {} samples in {} runs, noise {}. The spec, as if nothing were known:",
        course.about,
        data.samples(),
        data.runs.len(),
        course.noise
    );
    say(&wrapped(&opening, WIDTH, 0))?;
    say(&indented(course.spec))?;

    let clock = Instant::now();
    let spec = Spec::open(&spec)?;
    let (dataset, about) = spec.measurements(None)?;
    let options =
        Options { parameter_starts: spec.compiled().starts.clone(), ..Options::default() };
    let progress = Progress::new();
    let learned = learn(spec.system(), &dataset, &options, None, &progress);
    drop(progress);
    let file = ModelFile { model: learned?, origin: origin(&spec, &dataset, &about) };
    write_model(&spec.model_path(), &file)?;
    let fitting = clock.elapsed().as_secs_f64();
    let simplified = present::simplified(&spec.learned(&file.model)?, &file.origin.ranges);
    say(&format!(
        "Learned in {} from {} candidate terms:\n\n    {}",
        seconds(fitting),
        file.model.evidence.function_space,
        wrapped(&simplified.text(Style::default()), WIDTH - 4, 8),
    ))?;
    say(&format!("The truth:\n\n{}", indented(course.truth)))?;
    Ok(json!({
        "truth": course.truth,
        "hamiltonian": present::equations_json(&simplified, Style::default()),
        "model": file.model,
        "seconds": { "fit": fitting },
    }))
}
