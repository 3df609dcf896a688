//! What terms act on, and how strongly along a motion.

use std::ops::Range;

use super::states::Along;

/// Channels that a term acts on: rates of the momenta (kicks), rates of the coordinates (drifts),
/// and what the instrument adds to each observable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Channels {
    /// Degrees of freedom.
    pub(super) degrees: usize,
    /// Where kicks act.
    pub(super) along: Along,
}

impl Channels {
    pub(super) fn kick(self, coordinate: usize) -> usize {
        coordinate
    }

    pub(super) fn drift(self, coordinate: usize) -> usize {
        self.degrees + coordinate
    }

    pub(super) fn sensor(self, observable: usize) -> usize {
        2 * self.degrees + observable
    }

    /// Where in a row of values at phase points those are by which a channel goes: kicks act where
    /// forces do.
    pub(super) fn values(self, channel: usize, values: usize) -> Range<usize> {
        match self.along {
            Along::Model => 0..values,
            Along::Measured if channel < self.degrees => values / 2..values,
            Along::Measured => 0..values / 2,
        }
    }

    /// The observable whose sensor a channel is of.
    pub(super) fn sensed(self, channel: usize) -> Option<usize> {
        channel.checked_sub(2 * self.degrees)
    }

    pub(super) fn moving(self) -> usize {
        2 * self.degrees
    }

    pub(super) fn count(self) -> usize {
        4 * self.degrees
    }
}

/// A term's values at all nodes, channel after channel, or at finer points.
#[derive(Debug, Clone, Default)]
pub(super) struct Action {
    /// Channels that it acts on.
    pub(super) channels: Vec<usize>,
    /// `[channel of the list][point]`.
    pub(super) values: Vec<f64>,
    /// Whether they are at finer points than the nodes: kicks that have a kink or a jump.
    pub(super) fine: bool,
}
