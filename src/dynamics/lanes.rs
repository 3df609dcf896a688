//! Some lanes of arrays of rows of lanes.

/// Some lanes of rows of lanes.
pub(super) fn gathered(rows: &[f64], of: usize, lanes: &[usize]) -> Vec<f64> {
    if are_all(lanes, of) {
        return rows.to_vec();
    }
    let rows = rows.chunks_exact(of.max(1));
    rows.flat_map(|row| lanes.iter().map(|&lane| row[lane])).collect()
}

/// Sets some lanes of rows of lanes.
pub(super) fn scatter(rows: &mut [f64], of: usize, lanes: &[usize], some: &[f64]) {
    if are_all(lanes, of) {
        return rows.copy_from_slice(some);
    }
    let some = some.chunks_exact(lanes.len().max(1));
    for (row, values) in rows.chunks_exact_mut(of.max(1)).zip(some) {
        lanes.iter().zip(values).for_each(|(&lane, value)| row[lane] = *value);
    }
}

/// Whether these are all lanes, in their order.
fn are_all(lanes: &[usize], of: usize) -> bool {
    lanes.len() == of && lanes.iter().enumerate().all(|(place, &lane)| place == lane)
}
