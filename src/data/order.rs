//! The order of a run's rows in time: what can be put right, and what cannot.

/// How the rows of one run stand in the file.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Order {
    /// Times never go back.
    Rising,
    /// Some rows are late; sorting puts them right. Holds the position of the first one,
    /// and how many rows come after a row that is later in time.
    Shuffled { first: usize, late: usize },
    /// The clock starts again at this position: these are several runs.
    Restarted { at: usize },
    /// Time runs backwards from the first row to the last.
    Falling,
}

/// Judges the times of one run, in the order of the file. No time is NaN.
///
/// Two recordings one after the other and rows that came late both look like time running
/// backwards. They differ in this: two recordings are long stretches of rising time that
/// cover the same interval, so sorting would interleave them.
pub(super) fn judge(times: &[f64]) -> Order {
    let steps = (1..).zip(times.array_windows());
    let falls: Vec<usize> = steps.filter(|(_, [a, b])| b < a).map(|(at, _)| at).collect();
    let Some(&first) = falls.first() else {
        return Order::Rising;
    };
    if falls.len() + 1 == times.len() {
        return Order::Falling;
    }
    let stretches: Vec<&[f64]> = times.chunk_by(|a, b| a <= b).collect();
    for ([one, other], at) in stretches.array_windows().zip(&falls) {
        if interleave(one, other) && times.len() >= 3 * stretches.len() {
            return Order::Restarted { at: *at };
        }
        // Equal clocks, the same times again: two transition pairs, for one.
        if let ([a, b, ..], [c, d, ..]) = (one, other)
            && (a, b) == (c, d)
        {
            return Order::Restarted { at: *at };
        }
    }
    let mut latest = f64::NEG_INFINITY;
    let late = times
        .iter()
        .filter(|time| {
            let late = **time < latest;
            latest = latest.max(**time);
            late
        })
        .count();
    Order::Shuffled { first, late }
}

/// Whether at least two times of each rising stretch lie within the other.
fn interleave(one: &[f64], other: &[f64]) -> bool {
    let inside = |these: &[f64], those: &[f64]| match (those.first(), those.last()) {
        (Some(start), Some(end)) => these.iter().filter(|t| *t >= start && *t <= end).count() >= 2,
        _ => false,
    };
    inside(one, other) && inside(other, one)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn late_rows_are_told_from_new_recordings() {
        let rows: &[(&[f64], Order)] = &[
            (&[], Order::Rising),
            (&[0.0, 1.0, 1.0, 2.0], Order::Rising),
            (&[0.0, 2.0, 1.0, 3.0], Order::Shuffled { first: 2, late: 1 }),
            (&[0.0, 1.0, 2.0, 5.0, 3.0, 4.0, 6.0], Order::Shuffled { first: 4, late: 2 }),
            // Two files put together in the wrong order.
            (&[5.0, 6.0, 7.0, 0.0, 1.0, 2.0], Order::Shuffled { first: 3, late: 3 }),
            (&[0.0, 1.0, 2.0, 0.0, 1.0, 2.0], Order::Restarted { at: 3 }),
            (&[0.0, 1.0, 2.0, 0.5, 1.5, 2.5], Order::Restarted { at: 3 }),
            (&[0.0, 0.1, 0.0, 0.1, 0.0, 0.1], Order::Restarted { at: 2 }),
            (&[3.0, 2.0, 1.0], Order::Falling),
            (&[1.0, 0.0], Order::Falling),
        ];
        for (times, expected) in rows {
            assert_eq!(judge(times), *expected, "{times:?}");
        }
    }
}
