//! The numbers that the diagnosis is tuned by, each of them once.
//!
//! Where a field names no derivation, its value is a judgement, and the study of
//! `docs/hidden-effects.md` is what it was judged by: every effect of the catalogue hidden in
//! several systems at several noises, and systems in which nothing is hidden. A change has to leave
//! the tables of that page no worse.

mod composed;
mod sets;
mod usual;

pub use composed::Composed;
pub use sets::Sets;

/// The numbers of every phase, in the order in which the phases come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tuning {
    /// Whether the data can carry a verdict.
    pub sufficiency: Sufficiency,
    /// The noise of the instrument.
    pub noise_floor: NoiseFloor,
    /// Noise whose samples are not independent.
    pub autocorrelation: Autocorrelation,
    /// Best initial states of segments.
    pub states: States,
    /// Which candidates are tried, and where.
    pub candidates: Candidates,
    /// The search for composed terms.
    pub composed: Composed,
    /// The search for sets of changes.
    pub sets: Sets,
    /// Scores of all candidates.
    pub scan: Scan,
    /// Refits of the significant ones, and their ranking.
    pub ranking: Ranking,
    /// Effects that explain a misfit together, and the verdict.
    pub verdict: Verdict,
    /// Explanations of a part of what is missing.
    pub in_part: InPart,
    /// Parts that move and are not measured.
    pub hidden: Hidden,
    /// Names of composed terms.
    pub naming: Naming,
    /// The loop that adds effects.
    pub discovery: Discovery,
    /// Faults of the instrument.
    pub instrument: Instrument,
    /// A model held against measurements.
    pub comparison: Comparison,
    /// The next run worth measuring.
    pub design: Design,
}

/// Whether measurements can carry a verdict at all.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sufficiency {
    /// Independent residuals beside the model's unknowns that a verdict takes: with fewer, a
    /// variance is known to a third at best.
    pub residuals: usize,
    /// The same for held-out runs, which have no unknowns but their states.
    pub held_out_residuals: usize,
}

/// The noise of the instrument, from the shortest predictions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseFloor {
    /// Rounds of weights and variances (MINQUE, Rao, J. Multivar. Anal. 1, 1971), at most.
    pub rounds: usize,
    /// They end when the logarithm of no noise moves by more: 5000 residuals tell it to one per
    /// cent, 1 / sqrt(2 * 5000).
    pub steady: f64,
    /// Independent residuals below which a column's estimate is worth nothing.
    pub residuals: f64,
    /// Standard errors that the short estimate is below the model's before it is believed: the
    /// smaller of two estimates of the same noise would be too small.
    pub below: f64,
    /// Times that the noise is measured anew with a story that explains the misfit, at most.
    pub stories: usize,
    /// Logarithm of the factor by which a noise has to move before it is.
    pub moved: f64,
    /// Where even the shortest predictions are off by this many times the roughness of a column,
    /// they lack a force. Columns that somebody smoothed before stay below.
    pub lacks_force: f64,
    /// A column that is rougher than its noise by up to this factor has the noise that it is rough
    /// by; where it is rougher still, it is sampled too coarsely to say.
    pub told_apart: f64,
    /// Values that a column can take over its range, at most: the best converters have 24 bits.
    /// What is smaller than a step between them nobody measures, and a solver's output is not true
    /// to it.
    pub levels: f64,
}

/// Noise whose samples are not independent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Autocorrelation {
    /// Highest order of the autoregressive process: filters of instruments have one or two poles.
    pub order: usize,
    /// Lags whose autocorrelations are looked at, at most; a quarter of the longest run if that is
    /// less.
    pub lags: usize,
    /// Independent readings of each observable below which nothing can be said, for each change
    /// that a model was given.
    pub samples: f64,
    /// Longest autocorrelation time, in samples: that of a filter that keeps 0.8 of each deviation
    /// is 9.
    pub longest: f64,
    /// Noise has forgotten an innovation after this part of the longest run, one over it.
    pub memory: usize,
    /// The spectral density of noise is nowhere larger than this many times that at frequency zero
    /// and at half the sampling rate: what a model misses swings with the motion.
    pub peak: f64,
    /// Errors of this many times the noise are no noise; 1: none is looked for. Over two samples
    /// that of a process with the memory of 30 of them looks four times smaller than it is.
    pub largest: f64,
    /// Noise is at most this part of a column's spread: no fit is worth judging where it is more.
    pub part: f64,
    /// p-value below which what such a process leaves is not white.
    pub significant: f64,
}

/// The search for the best initial state of every segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct States {
    /// Samples that a state is settled on first.
    pub first_samples: usize,
    /// Factor by which it then sees more at a time.
    pub growth: usize,
    /// Times that the search is taken up again where states still move.
    pub retries: usize,
    /// States are settled when the loss falls by less than this part.
    pub settled: f64,
    /// Samples of the longest segments that a model is held against.
    pub longest: usize,
    /// Samples that explanations are looked for before, at most; what is found is held against all.
    pub searched: usize,
    /// Squares for each residual, in those of half the segments, that make a segment an outlier:
    /// its state starts again from where the segment before it goes on to.
    pub outlying: f64,
    /// Times that this is done, at most: a good state goes on by one segment each time.
    pub restarts: usize,
}

/// Grids of inner parameters, and terms without a name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidates {
    /// Points of one inner parameter of an effect of the catalogue, at most.
    pub points: usize,
    /// Points of a frequency, at most: between neighbours a drive gets half a turn out of step over
    /// a run, and what is further off is not seen.
    pub frequencies: usize,
    /// Points of several of them together, at most.
    pub points_together: usize,
    /// Points of one bounded inner parameter of a candidate of the spec, at most.
    pub declared_points: usize,
    /// Points of several of them together, at most.
    pub declared_points_together: usize,
    /// Known numbers of a spec that are tried, at most; those with a name first.
    pub numbers: usize,
    /// Systems of more terms are not asked for known numbers: each is a system of its own.
    pub number_terms: usize,
    /// Terms that the fit left out are asked for where there are no more than these.
    pub left_out: usize,
    /// Measured states at which two numbers are compared.
    pub number_states: usize,
    /// Two numbers act in the same way where the squared sine between what they do is below this:
    /// rounding leaves 1e-15 or so, and a different effect more than 1e-6.
    pub same_number: f64,
    /// Systems of so many coordinates or more are asked for effects on two of them only where a
    /// summand of an energy or force couples the two: the number of pairs grows with the square.
    pub pair_coordinates: usize,
    /// Highest total degree of an unnamed force that is a product of powers.
    pub unnamed_degree: usize,
    /// Systems of more coordinates are not asked for bumps of two variables: their number grows
    /// with the square.
    pub bump_coordinates: usize,
    /// Where inner parameters of effects of the catalogue are looked for.
    pub grids: Grids,
}

/// Where inner parameters of effects of the catalogue are looked for, in parts of what the data
/// reach. An effect that is not found from the nearest point of its grid shows in the rows of
/// docs/hidden-effects.md that hide it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grids {
    /// Lengths, in parts of the range of the coordinate.
    pub lengths: Axis,
    /// Ranges of forces, in parts of the range of the coordinate: one ten times as long bends a
    /// pull over the data by a hundredth.
    pub ranges: Axis,
    /// Wave numbers, in waves over the range of the coordinate.
    pub wave_numbers: Axis,
    /// Momenta, in parts of the largest.
    pub momenta: Axis,
    /// Rates: the smallest over the duration of a run, the largest over the time between samples.
    pub rates: Axis,
    /// Sizes of an input, in parts of its largest.
    pub levels: Axis,
    /// Delays of an input, in times between samples.
    pub delays: Axis,
    /// Durations: the shortest in times between samples, the longest in durations of a run.
    pub durations: Axis,
    /// Places are even over the range of the coordinate but for this part at either end: what a
    /// motion runs into, it hardly gets beyond.
    pub place_margin: f64,
    /// Places.
    pub places: usize,
    /// How far places beyond the range are from either end of it, in parts of the range.
    pub beyond: Axis,
    /// Instants are even over all times but for this part of a run at either end: a change needs
    /// data before and after it.
    pub instant_margin: f64,
    /// Instants.
    pub instants: usize,
    /// Exponents, between the whole ones, which other effects have.
    pub exponents: [f64; 3],
    /// Powers, most of them between the whole ones.
    pub powers: [f64; 6],
    /// Ratios of two things of a kind.
    pub ratios: [f64; 6],
    /// Highest frequency, in parts of the sampling rate: no mechanical data show faster ones.
    pub highest_frequency: f64,
}

/// The search for parts that move and are not measured; the test `learning::hidden_parts`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hidden {
    /// A part is fitted where the weak form of the force that is left is smaller by this factor
    /// with it, at least.
    pub gain: f64,
    /// A part whose coefficients are above zero is started from where its gain is this part of the
    /// best, at least, and is fitted at all where it is this part of what the best story gains.
    /// `learning::hidden_parts`.
    pub nearly: f64,
    /// Points of a grid from which the same part is fitted in turn, until one explains the data.
    pub points: usize,
    /// The next point is tried where the best part takes the error on held-out runs to less than
    /// this part of it.
    pub again: f64,
    /// Such points differ by more than this part in some inner parameter.
    pub points_apart: f64,
    /// Parts that are fitted, at most, in every turn.
    pub fits: usize,
    /// Orbits of an unseen body that are fitted, at most: 0, none is looked for. Off until what is
    /// found by them is told: they come near, and no diagnosis has said so yet.
    pub orbits: usize,
    /// Systems of more coordinates are not asked for internal states.
    pub coordinates: usize,
    /// Data of more samples are not asked at all: all of them are followed.
    pub samples: usize,
    /// Function spaces of more terms are held to what was learned of them.
    pub terms: usize,
    /// Points of a grid that are followed side by side.
    pub lanes: usize,
    /// A body is looked for over segments in which the model without it is off by less than this
    /// part of each column's spread: what a pull does is then linear.
    pub largest_error: f64,
    /// Samples of the shortest of these segments.
    pub shortest: usize,
    /// Nodes by which the motion is followed, at most, about.
    pub nodes: usize,
    /// Nodes in a turn of the fastest orbit: with eight, the trapezoidal rule keeps its first
    /// harmonic to a twentieth.
    pub nodes_of_turn: f64,
    /// The smallest radius of a circle, in distances of the nearest known body,
    pub nearest: f64,
    /// and the largest, in those of the farthest.
    pub farthest: f64,
    /// Neighbouring radii differ by this part, at most,
    pub radii_apart: f64,
    /// and are out of step by this angle at the end of the record, at most: half of it, if the
    /// phase is right in the middle.
    pub out_of_step: f64,
    /// Places on a circle.
    pub phases: usize,
    /// Circles from which free orbits are looked for: where they begin is apart
    pub refined: usize,
    /// by this part of the distance.
    pub orbits_apart: f64,
    /// Steps of Gauss and Newton for each of them, at most.
    pub orbit_steps: usize,
    /// A body is obvious where it takes what whole runs leave to less than one over this, and that
    /// of the best wrong mass, too: nothing imitates it so nearly.
    pub obvious: f64,
    /// Times that the search is made, at most, with the noise that its best orbit leaves.
    pub weighings: usize,
    /// It is made again where that is larger by this factor.
    pub weighed_again: f64,
}

/// Values of an inner parameter, each the same number of times the one before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    /// The smallest.
    pub from: f64,
    /// The largest.
    pub to: f64,
    /// How many.
    pub points: usize,
}

/// Scores of all candidates over their grids.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scan {
    /// Columns that one linearisation carries where what all together leave is asked for.
    pub columns_together: usize,
    /// Columns that it carries where each is asked by itself: most of the work is then in telling
    /// columns from one another, which grows with the square of their number.
    pub columns_apart: usize,
    /// Smallest variance of the weighted residuals that is believed of columns that were not
    /// fitted: noise is known to this factor before anything is added.
    pub least_variance: f64,
    /// Samples on which grids are looked through.
    pub samples: usize,
    /// A column that keeps less than this part of itself beside the model is spanned by it.
    pub spanned: f64,
    /// p-value below which an effect is there, after the look-elsewhere correction.
    pub significant: f64,
}

/// Refits of the significant candidates, and their ranking.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ranking {
    /// Candidates that are refitted when a model is asked first.
    pub first_refits: usize,
    /// Candidates that are refitted when it has an effect already, or is asked for unnamed terms.
    pub later_refits: usize,
    /// Deviance that a fit for the ranking may leave: a third of a standard error, at most.
    pub deviance_left: f64,
    /// Part of its range within which an inner parameter is at a bound.
    pub at_bound: f64,
    /// Part of the grid's length by which a fitted inner parameter may leave the grid.
    pub beyond_grid: f64,
    /// Differences of deviance below this cannot be told from chance: odds of 20 to 1, for twice
    /// the logarithm of 20 is 6.
    pub indistinguishable: f64,
    /// Differences of deviance below this are none: fits for the ranking leave about as much.
    pub same: f64,
    /// Those within this deviance of the best are fitted to all the data,
    pub finish_within: f64,
    /// or within this part of the best,
    pub finish_within_part: f64,
    /// but so many at most.
    pub finished: usize,
    /// Those that explain this part of what the best does are refitted when segments grow; what
    /// the others are worth is clear.
    pub refitted_part: f64,
    /// Error in units of the noise at which a model is no first approximation any more.
    pub largest_error: f64,
    /// Variance of the weighted residuals that is taken for none: its root is a millionth of the
    /// noise, far below what any column's digits resolve.
    pub least_variance: f64,
}

/// Effects that explain a misfit together, and the verdict.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verdict {
    /// Changes of a story, at most.
    pub effects: usize,
    /// Ranked effects that a story may begin with.
    pub beginnings: usize,
    /// Stories that are extended.
    pub beam: usize,
    /// Changes that each of them is extended by.
    pub branches: usize,
    /// Stories with a term that has no name that are extended, beside those.
    pub unnamed_beam: usize,
    /// Terms without a name that a story may begin with: many of them look alike over short
    /// segments.
    pub unnamed_branches: usize,
    /// Standard errors that every coefficient of a story is away from zero, at least: of a
    /// thousand candidates, noise brings one to 3.3 of them.
    pub standard_errors: f64,
    /// Numbers that members with numbers inside may have in all, where several bend one force by
    /// one variable: two contacts and a spring have five, and six bend to any curve.
    pub curve: usize,
    /// Standard errors of the noise's variance that a model at the noise may be above it.
    pub at_noise: f64,
    /// Differences of deviance below this are not worth more than a bare mention (Kass and Raftery
    /// 1995): odds of less than 2.7 to 1 do not choose between two names.
    pub level: f64,
    /// A story that holds brings the error on held-out runs to less than this times the noise.
    pub reaches: f64,
    /// Squares that are less than this part of the misfit are left to the digits of the data and
    /// the integrator: a story that explains clean data to a millionth of the misfit is not
    /// incomplete for the rest.
    pub negligible: f64,
    /// p-value below which a residual force without a name is there, all maps counted.
    pub unmistakable: f64,
    /// Residuals this many times the resolution of the integrator are the measurements' own.
    pub resolved: f64,
}

/// Explanations of a part of what is missing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InPart {
    /// Part of the squares beyond the noise that each number of an effect may leave of held-out
    /// runs, in those that are left without it: what has two may leave the square of that part.
    pub left: f64,
    /// Standard errors that every number of an effect is away from zero, at least. Those of what
    /// resembles the rest are too small: beside a force of 100 times the noise none of 23 learned
    /// numbers was more than five off, beside one that some term resembles 8 to 12 of 32.
    pub standard_errors: f64,
    /// Segments that the data are cut into, at least: parts of them have a few each.
    pub segments: usize,
    /// Samples of segments around whose motion sets are found, at most.
    pub window: usize,
}

/// Names of composed terms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Naming {
    /// States along the motion at which forces are compared, at most.
    pub states: usize,
    /// Part of a composed term's force that a named effect may lack before it is fitted: grids of
    /// inner parameters are coarse.
    pub apart: f64,
    /// Named effects that are fitted in its place, at most.
    pub tried: usize,
}

/// The loop that adds effects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Discovery {
    /// Additions, at most.
    pub additions: usize,
}

/// Faults of the instrument.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instrument {
    /// Samples of the shortest segment on which readings are compared with their neighbours.
    pub shortest: usize,
    /// Samples of the longest one.
    pub longest: usize,
    /// Standard deviations from its neighbours that make a reading an outlier.
    pub far: f64,
    /// The neighbours of an outlier deviate less than this part, to the other side: a jump or a
    /// bend of the motion itself does not look like that.
    pub spike: f64,
    /// p-value below which a fault is there, all columns counted.
    pub significant: f64,
    /// Rounding is spoken of when it makes this part of the noise.
    pub coarse: f64,
    /// Multiples of a step are exact but for this part of the column's range.
    pub slack: f64,
    /// A step is one where it is this many times what multiples of it may be off by.
    pub step: f64,
    /// A story explains so many times more of rounded readings than of what the model without it
    /// would have read: errors that return with the motion may explain as much again by chance.
    pub rounding_margin: f64,
    /// Readings that show whether a column is rounded, at least.
    pub readings: usize,
}

/// A model held against measurements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comparison {
    /// Hats of a map of the residual force.
    pub hats: usize,
    /// p-value below which a map is spoken of, all maps counted,
    pub significant: f64,
    /// and so many of them at most.
    pub maps: usize,
    /// An energy drifts where its slope is this many standard errors.
    pub drifts: f64,
    /// An error grows where that over the longest predictions is this many times that over the
    /// shortest: the standard error of one over 13 residuals is a fifth of it.
    pub grows: f64,
    /// Part of the values on either side that a range leaves out: the outermost per cent.
    pub outermost: f64,
    /// Nodes on each side of a force plane.
    pub plane_nodes: usize,
    /// Samples that a node of it needs.
    pub node_samples: usize,
    /// Coordinates whose planes are shown.
    pub planes: usize,
    /// Points on each side of a portrait.
    pub portrait_points: usize,
    /// Part of the range of the data by which a portrait reaches beyond them.
    pub portrait_margin: f64,
    /// Energies along the longest run, at least.
    pub energies: usize,
    /// Predictions that are followed side by side: enough to fill the lanes of the machine code.
    pub lanes: usize,
}

/// The next run worth measuring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Design {
    /// Longest run that is thought of, in samples.
    pub longest: usize,
    /// Shortest run, in samples, that is proposed unasked.
    pub shortest: usize,
    /// Earlier runs that are thought of as repeated.
    pub repeats: usize,
    /// Points that are spread over the bounds of the start, for a single sampling,
    pub points: usize,
    /// for each of several samplings,
    pub points_of_several: usize,
    /// and points at rest among them.
    pub points_at_rest: usize,
    /// Runs whose gains are computed at a time.
    pub batch: usize,
    /// A pair of rivals whose deviance no run makes grow by more is given up: from equal standing,
    /// the chance that one run distinguishes them stays below a fifth.
    pub hopeless: f64,
    /// A shorter run is preferred if it brings this part of the best.
    pub enough: f64,
    /// Neighbourhoods that are searched.
    pub neighbourhoods: usize,
    /// Points nearer than this, in parts of the bounds, share a neighbourhood.
    pub apart: f64,
    /// First step of the compass search, in parts of the bounds.
    pub first_step: f64,
    /// Last step of it, in parts of the bounds.
    pub last_step: f64,
    /// Rounds of it, at most.
    pub rounds: usize,
    /// A rival takes steps so many times shorter than the model without its effect, at most: a
    /// force that jumps would ask for any number of them, which noise does not notice.
    pub finer_steps: f64,
    /// Trajectories that are followed side by side.
    pub lanes: usize,
}
