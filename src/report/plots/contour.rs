//! Lines of equal height over a grid: marching squares, joined into polylines.

use std::collections::HashMap;

/// A point on an edge of the grid: (row, column, whether the edge goes up).
type Edge = (usize, usize, bool);

/// Lines along which `heights`, `[row][column]` over `columns` and `rows`, equals `level`.
///
/// Cells with a corner that is not finite have no line. A saddle is cut by the mean of its
/// corners. Closed lines end where they begin.
pub(super) fn lines(
    columns: &[f64],
    rows: &[f64],
    heights: &[Vec<f64>],
    level: f64,
) -> Vec<Vec<(f64, f64)>> {
    let mut next: HashMap<Edge, Vec<Edge>> = HashMap::new();
    let mut order: Vec<Edge> = Vec::new();
    for row in 0..rows.len().saturating_sub(1) {
        for column in 0..columns.len().saturating_sub(1) {
            let corner = |r: usize, c: usize| heights[row + r][column + c];
            let corners = [corner(0, 0), corner(0, 1), corner(1, 1), corner(1, 0)];
            if corners.iter().any(|height| !height.is_finite()) {
                continue;
            }
            // Below, right, above, left.
            let edges = [
                (row, column, false),
                (row, column + 1, true),
                (row + 1, column, false),
                (row, column, true),
            ];
            for (a, b) in crossings(&corners, level) {
                for (from, to) in [(edges[a], edges[b]), (edges[b], edges[a])] {
                    let list = next.entry(from).or_default();
                    if list.is_empty() {
                        order.push(from);
                    }
                    list.push(to);
                }
            }
        }
    }
    let place = |(row, column, up): Edge| {
        let (other_row, other_column) = if up { (row + 1, column) } else { (row, column + 1) };
        let (a, b) = (heights[row][column], heights[other_row][other_column]);
        let share = if a == b { 0.5 } else { ((level - a) / (b - a)).clamp(0.0, 1.0) };
        let between = |from: f64, to: f64| from + share * (to - from);
        (between(columns[column], columns[other_column]), between(rows[row], rows[other_row]))
    };
    let mut out = Vec::new();
    // Open lines start at their ends; what is left then is closed.
    let ends: Vec<Edge> = order.iter().copied().filter(|edge| next[edge].len() == 1).collect();
    for start in ends.into_iter().chain(order) {
        let mut line = Vec::new();
        let mut at = start;
        while let Some(to) = next.get_mut(&at).and_then(Vec::pop) {
            if line.is_empty() {
                line.push(place(at));
            }
            if let Some(back) = next.get_mut(&to)
                && let Some(found) = back.iter().position(|edge| *edge == at)
            {
                back.swap_remove(found);
            }
            line.push(place(to));
            at = to;
        }
        if line.len() > 1 {
            out.push(line);
        }
    }
    out
}

/// Which edges of a cell (below, right, above, left) a line joins.
fn crossings(corners: &[f64; 4], level: f64) -> Vec<(usize, usize)> {
    let above: Vec<bool> = corners.iter().map(|height| *height > level).collect();
    let crossed: Vec<usize> = (0..4).filter(|&i| above[i] != above[(i + 1) % 4]).collect();
    match crossed[..] {
        [a, b] => vec![(a, b)],
        [_, _, _, _] => {
            let middle = corners.iter().map(|height| 0.25 * height).sum::<f64>() > level;
            // The first corner's side of the saddle goes through the middle, or is cut off.
            if middle == above[0] { vec![(0, 1), (2, 3)] } else { vec![(3, 0), (1, 2)] }
        }
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Vec<f64> {
        (0..=80).map(|i| -2.0 + 0.05 * f64::from(i)).collect()
    }

    fn heights(f: impl Fn(f64, f64) -> f64) -> Vec<Vec<f64>> {
        grid().iter().map(|&y| grid().iter().map(|&x| f(x, y)).collect()).collect()
    }

    #[test]
    fn a_circle_is_one_closed_line_of_the_right_radius() {
        let found = lines(&grid(), &grid(), &heights(|x, y| x * x + y * y), 1.3);
        assert_eq!(found.len(), 1);
        let line = &found[0];
        assert_eq!(line.first(), line.last());
        for (x, y) in line {
            assert!((x * x + y * y - 1.3).abs() < 2e-3, "{x} {y}");
        }
        let length: f64 = line
            .windows(2)
            .map(|p| ((p[1].0 - p[0].0).powi(2) + (p[1].1 - p[0].1).powi(2)).sqrt())
            .sum();
        assert!((length / (2.0 * std::f64::consts::PI * 1.3f64.sqrt()) - 1.0).abs() < 2e-3);
    }

    #[test]
    fn a_saddle_has_two_branches_and_a_hole_none() {
        let found = lines(&grid(), &grid(), &heights(|x, y| x * y), 0.3);
        assert_eq!(found.len(), 2);
        let holed = heights(|x, y| if x > 0.0 { f64::NAN } else { x * y });
        for (x, _) in lines(&grid(), &grid(), &holed, 0.3).concat() {
            assert!(x <= 0.0);
        }
        assert!(lines(&grid(), &grid(), &heights(|_, _| 1.0), 1.0).is_empty());
        assert!(lines(&[], &[], &[], 1.0).is_empty());
    }
}
