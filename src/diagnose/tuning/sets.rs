//! Numbers of the search for sets of changes.

/// The search for sets of changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sets {
    /// Systems of more coordinates are not asked, as terms are not composed of more.
    pub coordinates: usize,
    /// Members of a set, at most.
    pub members: usize,
    /// Composed terms that sets are made of, at most: those that explain most alone, beside the
    /// shortest.
    pub leading: usize,
    /// Composed terms that are added in later looks, at most: those that explain most of what the
    /// best set leaves,
    pub beside: usize,
    /// or of what it leaves without one of its members, where it leaves noise,
    pub instead: usize,
    /// of about so many distinct expressions,
    pub expressions: usize,
    /// looked at before so many samples, at most.
    pub samples: usize,
    /// Choices of named candidates that sets are made of, at most: the best of each come first.
    pub named: usize,
    /// Points of the grid of a named candidate that sets are made of, at most.
    pub points: usize,
    /// Points between two of a grid of one number: a drive that is off by the distance of two is
    /// out of step at the end of a run, which looks like something that drifts.
    pub between: usize,
    /// Times that the members of the best set are moved between the points of their grids,
    pub sharpened: usize,
    /// and how often the distance of these is divided then.
    pub divisions: usize,
    /// Sets that each move of the search goes on from.
    pub beam: usize,
    /// Moves that follow one another, at most.
    pub rounds: usize,
    /// Sets that are remembered.
    pub kept: usize,
    /// Pairs that the search knows at its beginning, at most, for each of their members.
    pub paired: usize,
    /// Members that are tried beside a set, apart from each other,
    pub added: usize,
    /// in the place of one member,
    pub exchanged: usize,
    /// in the place of two,
    pub merged: usize,
    /// and in the place of one, two of them after one another.
    pub split: usize,
    /// Columns are alike that have more than this part of their squares in common.
    pub alike: f64,
    /// Part of its squares that a column keeps beside the others of a set, at least.
    pub apart: f64,
    /// Part of a known number, or of what a sensor shows, up to which what a change of it does is
    /// believed to go by its first order.
    pub linear: f64,
    /// What is left is believed to no less than this part of what is to be explained: scores of
    /// first order say no more.
    pub floor: f64,
    /// Sets that are fitted in full, in every look.
    pub proposed: usize,
    /// By how much their descriptions are longer than the shortest, at most, where first order says
    /// what a set is worth, and a set costs more and leaves less: twice the nats.
    pub near: f64,
    /// Forms that are fitted in the place of a member with inner numbers, at most, for leaving as
    /// little as that does.
    pub rivals: usize,
    /// Those of the proposed sets that are held against longer and longer segments: the best.
    pub grown: usize,
    /// Looks around a motion that is nearer to that of the data, at most.
    pub looks: usize,
    /// Part of what the best leaves beyond the noise that the best of the next look may leave, at
    /// most: where it leaves more, there is no further one.
    pub nearer: f64,
    /// Samples of the segments of later looks, at most.
    pub window: usize,
}
