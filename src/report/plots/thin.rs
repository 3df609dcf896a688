//! Fewer points that look the same: a line keeps the extremes of every column of the screen,
//! a cloud one point of every small cell.

use std::collections::HashSet;

/// Indices of the points that a line keeps: the first, the last, the lowest and the highest of
/// each of `columns` columns of equal width, and both sides of every break.
///
/// A point that is not finite breaks the line. The points ascend in x.
pub(super) fn line(points: &[(f64, f64)], columns: usize) -> Vec<usize> {
    if points.len() <= 4 * columns {
        return (0..points.len()).collect();
    }
    let finite = |p: &(f64, f64)| p.0.is_finite() && p.1.is_finite();
    let xs = || points.iter().filter(|p| finite(p)).map(|p| p.0);
    let (low, high) =
        xs().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    let width = (high - low).max(f64::MIN_POSITIVE);
    let column = |x: f64| ((x - low) / width * columns as f64).min(columns as f64 - 1.0) as usize;
    let mut kept = Vec::new();
    let mut at = 0;
    while at < points.len() {
        if !finite(&points[at]) {
            // One break says as much as many.
            if kept.last().is_some_and(|&last: &usize| finite(&points[last])) {
                kept.push(at);
            }
            at += 1;
            continue;
        }
        let start = at;
        let own = column(points[at].0);
        let (mut least, mut most) = (at, at);
        while at < points.len() && finite(&points[at]) && column(points[at].0) == own {
            if points[at].1 < points[least].1 {
                least = at;
            }
            if points[at].1 > points[most].1 {
                most = at;
            }
            at += 1;
        }
        let mut four = [start, least, most, at - 1];
        four.sort_unstable();
        for index in four {
            if kept.last() != Some(&index) {
                kept.push(index);
            }
        }
    }
    kept
}

/// Indices of the points that a cloud keeps: those that are finite, the outermost in each
/// direction, and the first of every cell `1 / across` wide and `1 / up` high.
///
/// `place` brings a point into the unit square.
pub(super) fn cloud(
    points: &[(f64, f64)],
    place: &dyn Fn((f64, f64)) -> (f64, f64),
    across: usize,
    up: usize,
) -> Vec<usize> {
    let finite = |p: &(f64, f64)| p.0.is_finite() && p.1.is_finite();
    if points.len() <= FEW {
        return (0..points.len()).filter(|&i| finite(&points[i])).collect();
    }
    let directions: [fn((f64, f64)) -> f64; 4] = [|p| p.0, |p| -p.0, |p| p.1, |p| -p.1];
    let far = |direction: &fn((f64, f64)) -> f64| {
        let all = (0..points.len()).filter(|&i| finite(&points[i]));
        all.max_by(|&a, &b| direction(points[a]).total_cmp(&direction(points[b])))
    };
    let outermost: Vec<usize> = directions.iter().filter_map(far).collect();
    let mut cells = HashSet::new();
    (0..points.len())
        .filter(|&i| {
            let point = points[i];
            if !finite(&point) {
                return false;
            }
            let (x, y) = place(point);
            let cell = ((x * across as f64).floor() as i64, (y * up as f64).floor() as i64);
            cells.insert(cell) || outermost.contains(&i)
        })
        .collect()
}

/// Clouds of so few points are drawn whole.
const FEW: usize = 2000;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn wave(count: usize) -> Vec<(f64, f64)> {
        let value = |i: usize| (0.37 * i as f64).sin() * (1.0 + (i % 97) as f64);
        (0..count).map(|i| (i as f64 * 0.01, value(i))).collect()
    }

    #[test]
    fn a_line_keeps_its_ends_and_the_extremes_of_every_column() {
        let mut points = wave(100_000);
        points[50_123].1 = 1e6;
        points[70_001].1 = -1e6;
        points[20_000].1 = f64::NAN;
        let kept = line(&points, 600);
        assert!(kept.len() <= 4 * 602, "{}", kept.len());
        for index in [0, 99_999, 50_123, 70_001, 20_000] {
            assert!(kept.contains(&index), "{index}");
        }
        assert!(kept.windows(2).all(|pair| pair[0] < pair[1]));
        let short = wave(50);
        assert_eq!(line(&short, 600).len(), 50);
    }

    #[test]
    fn a_cloud_keeps_the_outermost_and_stays_small() {
        let mut points = wave(100_000);
        points[777] = (-5.0, 0.1);
        points[778] = (f64::NAN, 0.1);
        let kept = cloud(&points, &|p| ((p.0 + 5.0) / 1005.0, (p.1 + 100.0) / 200.0), 100, 80);
        assert!(kept.contains(&777) && !kept.contains(&778));
        assert!(kept.len() <= 100 * 80 + 4, "{}", kept.len());
    }

    proptest! {
        #[test]
        fn no_line_loses_its_extremes(values in prop::collection::vec(-1e9..1e9f64, 1..3000), columns in 2usize..60) {
            let points: Vec<(f64, f64)> =
                values.iter().enumerate().map(|(i, &y)| (i as f64, y)).collect();
            let kept: Vec<f64> = line(&points, columns).into_iter().map(|i| points[i].1).collect();
            let most = |all: &[f64]| all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let least = |all: &[f64]| all.iter().copied().fold(f64::INFINITY, f64::min);
            prop_assert_eq!(most(&values), most(&kept));
            prop_assert_eq!(least(&values), least(&kept));
        }
    }
}
