//! Every number of the fit that somebody chose, in one place.
//!
//! A field says what its number is, in what unit, and what fixes it: a derivation where there is
//! one, else the benchmark, the page of figures or the test that shows when it is wrong.
//!
//! Not here: sizes that change cost alone (`blocking.rs`), what rounding leaves (`rounding.rs`),
//! and numbers of mathematics (constants of losses, tableaus), which stand where they are used.

pub use super::local::tuning::LocalTuning;

/// The numbers of the fit, phase by phase: the field `tuning` of [`Options`](crate::Options).
///
/// The usual ones serve every system of the documentation; any version may change them.
///
/// ```
/// let mut options = leverrier::Options::default();
/// // Segments of up to 1024 samples, for a slow motion that is sampled densely.
/// options.tuning.course.longest = 1024;
/// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
/// let law = spec.fit_with(&spec.data()?, &options)?;
/// assert!(!law.terms().is_empty());
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Tuning {
    /// How runs are cut into segments, and kept in folds.
    pub segments: SegmentTuning,
    /// First guesses of masses where momenta are not measured, but known forces set their scale.
    pub masses: MassTuning,
    /// When derivatives of trajectories are integrated by a cheaper method than these. Their error
    /// slows Gauss-Newton and does not move its end; `benches/fit.rs`, `learning::recovery`.
    pub tangents: TangentTuning,
    /// The search for the initial state of every segment at a given theta.
    /// `learning::settling`; its speed is that of a pass of `benches/fit.rs`.
    pub settling: SettlingTuning,
    /// How accurately trajectories are integrated.
    pub stepping: SteppingTuning,
    /// Gauss-Newton on a support.
    pub refit: RefitTuning,
    /// Rounds of search and refit at one length of segments. docs/paper-table.md.
    pub rounds: RoundTuning,
    /// The course of a training.
    pub course: CourseTuning,
    /// The search for the support on a factor. docs/paper-table.md; its time: docs/growth.md.
    pub support: SupportTuning,
    /// Function spaces that are too large for one factor. docs/growth.md, `learning::trainer`.
    pub screening: ScreeningTuning,
    /// The first-order trainer. `learning::trainer`, docs/growth.md.
    pub first_order: FirstOrderTuning,
    /// What is said of a finished fit.
    pub conclusion: ConclusionTuning,
    /// Systems whose couplings are local.
    pub local: LocalTuning,
}

/// How runs are cut into segments, and kept in folds.
///
/// ```
/// let mut options = leverrier::Options::default();
/// options.tuning.segments.folds = 32;
/// assert_ne!(options, leverrier::Options::default());
/// ```
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[non_exhaustive]
pub struct SegmentTuning {
    /// Folds that the data are kept in: what is resampled, and what candidates are held out
    /// from. More take memory in proportion (`memory::factors`); of 16, a standard error is
    /// itself known to 1 / sqrt(2 * 15), 18 percent. The test `learning::recovery`.
    pub folds: usize,
    /// An interval this many times the typical one is a hole that no segment bridges: nine
    /// samples in a row were lost. `learning::data`.
    pub hole: f64,
    /// Samples of a long run that go into the same fold of a stream, at least: neighbours
    /// in time are alike, and a fold must be new to the others. `learning::stream`.
    pub stretch: u64,
    /// A segment may last this many times as long as its samples would take at the typical
    /// interval: half of them may be lost.
    pub slack: f64,
    /// Samples of the first segments where something moves unseen. `learning::hidden_parts`.
    pub hidden: usize,
}

/// First guesses of masses where momenta are not measured and a measured input sets their scale.
/// A wrong guess costs rounds of the fit, or its way; the test `learning::driven`.
///
/// ```
/// let mut options = leverrier::Options::default();
/// options.tuning.masses.windows = 200;
/// assert_ne!(options, leverrier::Options::default());
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct MassTuning {
    /// Samples of a window, each twice as many intervals as the one before: the length at which the
    /// weak form explains most is taken. A window has to span a part of the motion, and not a turn.
    pub lengths: [usize; 7],
    /// Windows of one length, spread over all runs: four for each of the unknowns that the largest
    /// space has.
    pub windows: usize,
    /// Function spaces of more terms have no guess.
    pub terms: usize,
    /// Part of the known force that the guess has to explain.
    pub explained: f64,
    /// A window has no interval of more than this many times the typical one.
    pub hole: f64,
}

/// When derivatives of trajectories are integrated by a cheaper method than the trajectories.
/// Their error slows Gauss-Newton and does not move where it ends; `benches/fit.rs` and
/// `learning::recovery`.
///
/// ```
/// let mut options = leverrier::Options::default();
/// options.tuning.tangents.deviation = 1e-6;
/// assert_ne!(options, leverrier::Options::default());
/// ```
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[non_exhaustive]
pub struct TangentTuning {
    /// The cheaper trajectory may differ by this part of the motion from end to end: with
    /// derivatives that are wrong by it, every step of Gauss-Newton leaves that part of the way,
    pub deviation: f64,
    /// and by no less than this part from sample to sample.
    pub least_deviation: f64,
    /// Methods of a higher order than this are worth a cheaper one.
    pub above_order: u32,
    /// Steps of order four that are tried, for one of the method of the states.
    pub steps: usize,
}

/// The search for the initial state of every segment at a given theta. `learning::settling`;
/// its speed is that of a pass of `benches/fit.rs`.
///
/// ```
/// let mut options = leverrier::Options::default();
/// options.tuning.settling.steps = 12;
/// assert_ne!(options, leverrier::Options::default());
/// ```
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[non_exhaustive]
pub struct SettlingTuning {
    /// Gauss-Newton steps, at most.
    pub steps: usize,
    /// States are settled when the next step promises less than this part of the loss: over n
    /// residuals they are then within sqrt(1e-7 n) of their standard errors, 0.003 for 100,
    pub settled: f64,
    /// or less than this part of what rounding makes of the loss.
    pub rounding: f64,
    /// They are nearly settled when it promises less than this part (0.3 standard errors for
    /// 100 residuals): enough where theta moves too.
    pub nearly_settled: f64,
    /// Derivatives are approximate ([`TangentTuning::deviation`]): where the next step
    /// promises nothing, the loss may be this part above the least that was seen, a hundredth
    /// of a deviance for 100 residuals.
    pub equal_loss: f64,
    /// Segments that the number of steps of all others is expected from, at most,
    pub expected_from: usize,
    /// and one segment of so many, which costs little beside all.
    pub expected_part: usize,
    /// A step that does not pay is shortened by this factor,
    pub shorter: f64,
    /// and given up below this part of its length.
    pub shortest: f64,
}

/// How accurately trajectories are integrated. `learning::recovery` and the errors of
/// docs/paper-table.md show where it is too rough, `benches/fit.rs` what it costs.
///
/// ```
/// let mut options = leverrier::Options::default();
/// options.tuning.stepping.part_of_noise = 0.005;
/// assert_ne!(options, leverrier::Options::default());
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct SteppingTuning {
    /// Transitions of the data that the error is estimated on.
    pub transitions: usize,
    /// The integrator may err by this part of the noise: it then adds 0.02 squared to its
    /// variance,
    pub part_of_noise: f64,
    /// and by this part of the standard error of the mean of all residuals: noise averages
    /// out over many data, the error of the integrator does not.
    pub part_of_mean: f64,
    /// The last refit takes this part: an integrator errs alike in all segments, which moves
    /// coefficients by many times as much. `learning::clothes`.
    pub part_of_error: f64,
    /// Where that cannot be reached, or only by more evaluations of the forces between two
    /// samples than this,
    pub evaluations: usize,
    /// the integrator may err by this part of the noise between two samples.
    pub hidden: f64,
    /// Residuals up to this many times the error of the integrator may be the integrator: one
    /// that was chosen for its noise errs by [`part_of_noise`](Self::part_of_noise), a fiftieth.
    pub suspect: f64,
    /// No instrument resolves this part of the spread of a column, for 16 bits are 1.5e-5:
    /// such residuals are the integrator.
    pub finest: f64,
    /// The error estimate is the largest of [`transitions`](Self::transitions): one in 97 others
    /// is expected to be larger, for which this factor is the allowance.
    pub margin: f64,
}

/// Gauss-Newton on a support.
///
/// ```
/// let mut options = leverrier::Options::default();
/// options.tuning.refit.iterations = 100;
/// assert_ne!(options, leverrier::Options::default());
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct RefitTuning {
    /// Iterations, at most; `learning::trainer`.
    pub iterations: usize,
    /// Converged when a step promises less than this part of the loss: with N residuals, a
    /// change of sqrt(1e-9 N) standard errors.
    pub converged: f64,
    /// In a round that others follow, a refit ends when a step promises less than this
    /// part: sqrt(1e-3 N) standard errors; `benches/fit.rs`.
    pub rough: f64,
    /// Damping after the first step that does not pay, in parts of the squared norm of each
    /// column (Levenberg);
    pub first_damping: f64,
    /// it grows by this factor with every step that does not pay (Marquardt, J. SIAM 11, 1963),
    pub more_damping: f64,
    /// shrinks by this one with every step that does,
    pub less_damping: f64,
    /// is left out below this,
    pub least_damping: f64,
    /// and ends the refit above this: no direction pays. `learning::trainer`.
    pub most_damping: f64,
    /// A step that promises less than this part of the squares that rounding leaves cannot
    /// be seen.
    pub rounding: f64,
}

/// Rounds of search and refit at one length of segments. `learning::recovery`, docs/paper-table.md.
///
/// ```
/// let mut options = leverrier::Options::default();
/// options.tuning.rounds.most = 12;
/// assert_ne!(options, leverrier::Options::default());
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct RoundTuning {
    /// Rounds, at most: a support that neither stands still nor comes back must end, too.
    pub most: usize,
    /// The noise stands still when it changes by less than this factor: weights that are
    /// wrong by a part x cost the estimate a part x^2 / 4 of its efficiency.
    pub noise_steady: f64,
    /// Segments that tell the noise better than the next round needs to know it: a relative
    /// standard error of sqrt(1 / (2 * 1536)), two percent.
    pub noise_segments: usize,
    /// Noise below this many times what the integrator and rounding resolve is not waited
    /// for.
    pub above_resolution: f64,
}

/// The course of a training.
///
/// ```
/// let mut options = leverrier::Options::default();
/// options.tuning.course.sampled = 1 << 18;
/// assert_ne!(options, leverrier::Options::default());
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct CourseTuning {
    /// Segments may grow while what is left, in a training the noise estimate, grows by
    /// less than this factor. docs/hidden-effects.md, `learning::diagnosis`.
    pub follows: f64,
    /// Longest segment, in samples. docs/hidden-effects.md.
    pub longest: usize,
    /// Segments that different starts of the inner parameters are tried on;
    /// `learning::recovery` (the pendulum).
    pub start_segments: usize,
    /// Segments that the first rounds take, where there are at least twice as many;
    /// `benches/fit.rs`.
    pub first_segments: usize,
    /// Samples that terms are first looked for on, when there are many more;
    /// docs/growth.md.
    pub sampled: usize,
    /// Samples above which terms are first looked for on a part; docs/growth.md.
    pub all_at_once: usize,
    /// Function spaces of more terms are worked on a part at a time: the factors of 3000
    /// unknowns take gigabytes (`memory::factors`); docs/growth.md.
    pub largest_factor: usize,
    /// How far starts of an inner parameter reach from that of the spec, in parts of its
    /// size or of 1, where there are no bounds.
    pub reach: f64,
    /// Combinations of the starts that the spec lists, at most.
    pub combinations: usize,
    /// Segments may grow while the noise stays below this many times what is resolved,
    /// however it grows.
    pub above_resolution: f64,
}

/// The search for the support on a factor.
///
/// ```
/// let mut options = leverrier::Options::default();
/// options.tuning.support.largest = 120;
/// assert_ne!(options, leverrier::Options::default());
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct SupportTuning {
    /// Terms of the largest support that is looked at closely.
    pub largest: usize,
    /// Nested spaces of the simplest terms that are searched, at most.
    pub nested: usize,
    /// Rounds of additions, removals and exchanges before the search gives up.
    pub rounds: usize,
    /// How many of the best supports are improved by such moves.
    pub polished: usize,
    /// Exchanges of each term that are looked at for terms that could stand in its place.
    pub exchanges: usize,
    /// Supports of a quick backward elimination that are looked at closely.
    pub closely: usize,
    /// Additions in a row that may not pay before forward selection ends.
    pub idle: usize,
    /// Part of its norm that keeps a column apart from those before it where they alone do
    /// not: above rounding, far below what is looked at.
    pub ridge: f64,
    /// Part of its norm by which a column stands apart without a ridge.
    pub alone: f64,
    /// Deviances that differ by less are the same to the criterion: no term costs so little.
    pub same_loss: f64,
    /// Supports that are compared by their error on held-out folds, at most.
    pub compared_held_out: usize,
    /// Additions that are tried in a round of moves,
    pub additions: usize,
    /// and terms in the place of each term of the support.
    pub replacements: usize,
    /// Penalties of the L1 path.
    pub path_points: usize,
    /// Smallest penalty of the path over the largest.
    pub path_ratio: f64,
    /// Smallest penalty over the noise of one residual: noise comes in below it.
    pub path_noise: f64,
    /// Sweeps at one penalty before the next is taken anyway.
    pub path_sweeps: usize,
    /// The solution at one penalty stands still when a sweep moves no coefficient by more than
    /// this part of the largest, both times the norms of their columns: less than rounding.
    pub path_still: f64,
}

/// Function spaces that are too large for one factor. docs/growth.md, `learning::trainer`.
///
/// ```
/// let mut options = leverrier::Options::default();
/// options.tuning.screening.rounds = 8;
/// assert_ne!(options, leverrier::Options::default());
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ScreeningTuning {
    /// Terms that Gauss-Newton takes on at once, at most.
    pub together: usize,
    /// Terms that enter the working set at first,
    pub first: usize,
    /// and in every later round.
    pub each: usize,
    /// Terms of the least complexity that are always looked at: they cost the criterion
    /// little.
    pub simplest: usize,
    /// Rounds of the working set.
    pub rounds: usize,
}

/// The first-order trainer. `learning::trainer`, docs/growth.md.
///
/// ```
/// let mut options = leverrier::Options::default();
/// options.tuning.first_order.epochs = 30;
/// assert_ne!(options, leverrier::Options::default());
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct FirstOrderTuning {
    /// Segments of one mini-batch.
    pub batch: usize,
    /// Passes over the data at each penalty.
    pub epochs: usize,
    /// Penalties over the one that empties the model, in the order in which they are taken.
    pub penalties: [f64; 6],
    /// First step length, in units in which every column has norm one;
    pub rate: f64,
    /// the last is this part of it: mini-batches make coefficients jitter by about a step
    /// length, which is then far below the least penalty's threshold.
    pub last_rate: f64,
    /// Adam divides by the root of a gradient's second moment and, beside it, this part of the
    /// penalty: a gradient a thousand times weaker than the penalty leaves a coefficient at zero
    /// in any case, and must not make its step long.
    pub least_moment: f64,
    /// One segment of so many is held back to choose the penalty by.
    pub held_back: usize,
    /// Samples of a segment where nothing else is asked for: predictions are from one to
    /// the next.
    pub window: usize,
    /// Segments that the norms of the columns are measured on.
    pub norm_segments: usize,
    /// Penalties end when the held-back loss is above the least by this factor;
    pub worse: f64,
    /// it is better when it is below by this one: less than that is chance.
    pub better: f64,
}

/// What is said of a finished fit.
///
/// ```
/// let mut options = leverrier::Options::default();
/// options.tuning.conclusion.draws = 200;
/// assert_ne!(options, leverrier::Options::default());
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ConclusionTuning {
    /// Data whose noise is below this part of the spread of each column are finer than
    /// instruments: 14 bits. `learning::recovery`.
    pub clean: f64,
    /// Runners-up that are kept.
    pub runners_up: usize,
    /// Exchanges that cost the criterion (a deviance) less than this are named: odds of
    /// exp(6 / 2), 20 to 1.
    pub close: f64,
    /// Combinations of this many terms are not spelled out.
    pub spelled_out: usize,
    /// Unknowns of the largest function space that is searched for exact dependences: the
    /// work grows with their cube.
    pub dependence: usize,
    /// Times that the folds are drawn anew for the inclusion of a term: a standard error of
    /// at most 0.08.
    pub draws: usize,
    /// Terms that a resampled search chooses among, at most.
    pub pool: usize,
    /// Supports that are worse by this deviance do not win on any draw: odds of exp(30).
    pub leading: f64,
    /// Part of itself that a column must keep beside the others for normal equations to do.
    pub apart: f64,
    /// Part of itself below which what is left of a column beside the others is rounding.
    pub dependent: f64,
    /// Dependences that are taken apart; the rest are only named.
    pub made_of: usize,
    /// Part of a dependent column, in units of its norm, below which another column is not
    /// named: parts are printed to four decimals.
    pub no_part: f64,
}

/// The usual numbers.
const TUNING: Tuning = Tuning {
    segments: SegmentTuning { folds: 16, hole: 10.0, stretch: 8192, slack: 2.0, hidden: 1024 },
    masses: MassTuning {
        lengths: [9, 17, 33, 65, 129, 257, 513],
        windows: 96,
        terms: 24,
        explained: 0.5,
        hole: 4.0,
    },
    tangents: TangentTuning { deviation: 1e-4, least_deviation: 1e-5, above_order: 4, steps: 2 },
    settling: SettlingTuning {
        steps: 8,
        settled: 1e-7,
        rounding: 0.03,
        nearly_settled: 1e-3,
        equal_loss: 1e-4,
        expected_from: 16,
        expected_part: 32,
        shorter: 0.25,
        shortest: 1e-3,
    },
    stepping: SteppingTuning {
        transitions: 96,
        part_of_noise: 0.02,
        part_of_mean: 4.0,
        part_of_error: 0.02,
        evaluations: 200,
        hidden: 0.01,
        suspect: 20.0,
        finest: 1e-5,
        margin: 3.0,
    },
    refit: RefitTuning {
        iterations: 40,
        converged: 1e-9,
        rough: 1e-3,
        first_damping: 1e-4,
        more_damping: 10.0,
        less_damping: 0.1,
        least_damping: 1e-6,
        most_damping: 1e8,
        rounding: 1e-3,
    },
    rounds: RoundTuning {
        most: 8,
        noise_steady: 1.05,
        noise_segments: 1536,
        above_resolution: 3.0,
    },
    course: CourseTuning {
        follows: 1.5,
        longest: 256,
        start_segments: 400,
        first_segments: 256,
        sampled: 1 << 16,
        all_at_once: 4 << 16,
        largest_factor: 3000,
        reach: 2.0,
        combinations: 64,
        above_resolution: 2.0,
    },
    support: SupportTuning {
        largest: 80,
        nested: 8,
        rounds: 60,
        polished: 3,
        exchanges: 4,
        closely: 3,
        idle: 3,
        ridge: 1e-13,
        alone: 1e-9,
        same_loss: 0.5,
        compared_held_out: 120,
        additions: 3,
        replacements: 2,
        path_points: 60,
        path_ratio: 1e-7,
        path_noise: 0.1,
        path_sweeps: 60,
        path_still: 1e-9,
    },
    screening: ScreeningTuning { together: 600, first: 300, each: 150, simplest: 100, rounds: 5 },
    first_order: FirstOrderTuning {
        batch: 128,
        epochs: 12,
        penalties: [0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3],
        rate: 0.02,
        last_rate: 1e-3,
        least_moment: 1e-3,
        held_back: 5,
        window: 2,
        norm_segments: 32,
        worse: 1.02,
        better: 0.98,
    },
    conclusion: ConclusionTuning {
        clean: 6e-5,
        runners_up: 8,
        close: 6.0,
        spelled_out: 6,
        dependence: 1000,
        draws: 40,
        pool: 40,
        leading: 60.0,
        apart: 1e-6,
        dependent: 1e-12,
        made_of: 4,
        no_part: 1e-7,
    },
    local: LocalTuning::USUAL,
};

/// Each part of a `TUNING` in scope is what its type is by default.
macro_rules! usual {
    ($($name:ident: $field:ident,)*) => {
        $(impl Default for $name {
            /// The usual numbers.
            fn default() -> Self {
                TUNING.$field
            }
        })*
    };
}

pub(crate) use usual;

usual! {
    SegmentTuning: segments,
    MassTuning: masses,
    TangentTuning: tangents,
    SettlingTuning: settling,
    SteppingTuning: stepping,
    RefitTuning: refit,
    RoundTuning: rounds,
    CourseTuning: course,
    SupportTuning: support,
    ScreeningTuning: screening,
    FirstOrderTuning: first_order,
    ConclusionTuning: conclusion,
}

impl Default for Tuning {
    /// The usual numbers.
    fn default() -> Self {
        TUNING
    }
}
