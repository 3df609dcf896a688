//! Numbers of the search for composed terms.

/// The search for composed terms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Composed {
    /// Systems of more coordinates are not asked: what two coordinates do together is then one
    /// of too many things.
    pub coordinates: usize,
    /// Distinct expressions, about.
    pub expressions: usize,
    /// Candidates that the search hands on, at most.
    pub candidates: usize,
    /// Expressions of the first look that the second one sees.
    pub kept: usize,
    /// Expressions that are handed on however little they explain alone: the shortest.
    pub short: usize,
    /// Forms whose inner numbers are refined in a look.
    pub refined: usize,
    /// What it costs in nats to say that no named effect is meant: odds of a thousand to one.
    pub unnamed: f64,
    /// Forms that are joined with others.
    pub joined: usize,
    /// Terms that the motion is followed by between two looks, at most.
    pub together: usize,
    /// Nats within which rivals of the best are handed on: held-out runs have not been asked.
    pub rivals: f64,
    /// Looks around a motion that is nearer to that of the data, at most.
    pub rounds: usize,
    /// Samples of the shortest segment of the first look,
    pub shortest: usize,
    /// of the longest one,
    pub window: usize,
    /// and of the longest of the later looks.
    pub followed: usize,
    /// Part of the spread by which the model may be off over such a segment: of the square of it,
    /// first-order effects are wrong.
    pub largest_error: f64,
    /// Radians of the fastest motion from node to node in the first look: cubics between nodes
    /// then keep a fourth harmonic to a few per cent.
    pub first_spacing: f64,
    /// The same in later looks: a fourth harmonic to a thousandth.
    pub second_spacing: f64,
    /// Radians of the fastest motion that a panel of Simpson's rule spans, at most: its error is
    /// then below 0.3^4 / 180 of the integral, some 5e-5,
    pub panel_angle: f64,
    /// with so many panels between two samples, at most.
    pub panels: usize,
    /// An action that keeps less than this part of its squares beside the model is spanned by it:
    /// Simpson's rule leaves some 1e-9 of them.
    pub spanned: f64,
    /// The same of the model's own unknowns beside one another, which are integrated with it.
    pub spanned_unknowns: f64,
    /// Subexpressions of the spec that become leaves, at most: the largest ones are rarely what
    /// another term is made of.
    pub known_parts: usize,
    /// Coordinates up to which distances of two bodies in a plane are leaves.
    pub plane_coordinates: usize,
    /// Products of powers of coordinates and momenta, at most.
    pub monomials: usize,
    /// Other functions of one leaf, at most.
    pub others: usize,
    /// Those of them that are multiplied with one another, at most.
    pub multiplied: usize,
    /// Nats that a term which a sensor adds may cost: an instrument adds simple things.
    pub sensor_length: f64,
    /// States at which two expressions are compared.
    pub compared_at: usize,
    /// First step of the search for inner numbers, in parts of the logarithm of a length or of the
    /// range of a centre,
    pub first_step: f64,
    /// last step: a length to a fiftieth of a per cent, less than noise tells,
    pub last_step: f64,
    /// and scores of one term, at most.
    pub scores: usize,
    /// Scores for each inner number of every form before the leaders are chosen: they move a length
    /// half of the way between two points of its grid and back.
    pub sketched: usize,
    /// Terms that a second one is joined with.
    pub beam: usize,
    /// Part of its squares that a second column keeps beside the first, at least: with less of its
    /// own its coefficient is known a thousand times worse than alone.
    pub apart: f64,
    /// The same of the terms that the motion is followed by: a hundred times.
    pub apart_together: f64,
}
