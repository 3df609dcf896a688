//! Conjugate gradients for eight sparse problems of the same pattern side by side.

use super::eights::Eight;
use super::lanes::REGISTER;
use super::processor::dispatched;

/// The lower triangle of a symmetric matrix, row after row, each ascending with its diagonal last.
#[derive(Clone, Copy)]
pub(crate) struct Lower<'a> {
    /// Where each row begins, and where the last ends.
    pub(crate) starts: &'a [usize],
    pub(crate) columns: &'a [u32],
    pub(crate) values: &'a [Eight],
}

dispatched! {
    /// Solves matrix x = right in every problem by conjugate gradients, scaled by the diagonal
    /// (Hestenes and Stiefel 1952): until the norm of what is left, in the metric of the scaling,
    /// has fallen to the part `limits.0` in all of them, in `limits.1` steps at most. `converged`
    /// says whether it has. `work` is memory.
    pub(crate) fn conjugate_gradients(
        matrix: Lower,
        right: &[Eight],
        x: &mut [Eight],
        work: &mut Vec<Eight>,
        limits: (f64, usize),
        converged: &mut bool,
    ) = conjugate_gradients_body;
}

#[inline(always)]
fn conjugate_gradients_body(
    matrix: Lower,
    right: &[Eight],
    x: &mut [Eight],
    work: &mut Vec<Eight>,
    limits: (f64, usize),
    converged: &mut bool,
) {
    let size = right.len();
    work.clear();
    work.resize(4 * size, Eight::ZERO);
    let (inverse, rest) = work.split_at_mut(size);
    let (left, rest) = rest.split_at_mut(size);
    let (along, image) = rest.split_at_mut(size);
    x.fill(Eight::ZERO);
    left.copy_from_slice(right);
    let mut now = Eight::ZERO;
    for i in 0..size {
        let diagonal = &matrix.values[matrix.starts[i + 1] - 1];
        for lane in 0..REGISTER {
            let own = diagonal.0[lane];
            inverse[i].0[lane] = if own > 0.0 { 1.0 / own } else { 0.0 };
        }
        along[i] = left[i].times(&inverse[i]);
        now.add_product(&left[i], &along[i]);
    }
    let first = now;
    *converged = false;
    for step in 0..=limits.1 {
        let allowed = limits.0 * limits.0;
        *converged = (0..REGISTER).all(|lane| now.0[lane] <= allowed * first.0[lane]);
        if *converged || step == limits.1 {
            return;
        }
        symmetric_times(matrix, along, image);
        let mut bend = Eight::ZERO;
        for i in 0..size {
            bend.add_product(&along[i], &image[i]);
        }
        let length = ratio(&now, &bend);
        let mut next = Eight::ZERO;
        for i in 0..size {
            x[i].add_product(&length, &along[i]);
            left[i].subtract_product(&length, &image[i]);
            next.add_product(&left[i].times(&inverse[i]), &left[i]);
        }
        let turn = ratio(&next, &now);
        for i in 0..size {
            let mut new = left[i].times(&inverse[i]);
            new.add_product(&turn, &along[i]);
            along[i] = new;
        }
        now = next;
    }
}

/// image = matrix x.
#[inline(always)]
fn symmetric_times(matrix: Lower, x: &[Eight], image: &mut [Eight]) {
    for i in 0..x.len() {
        let row = matrix.starts[i]..matrix.starts[i + 1] - 1;
        let mut sum = matrix.values[row.end].times(&x[i]);
        for (&j, value) in matrix.columns[row.clone()].iter().zip(&matrix.values[row]) {
            sum.add_product(value, &x[j as usize]);
            image[j as usize].add_product(value, &x[i]);
        }
        image[i] = sum;
    }
}

/// a / b, problem by problem; zero where there is nothing to divide by.
#[inline(always)]
fn ratio(a: &Eight, b: &Eight) -> Eight {
    let mut ratio = Eight::ZERO;
    for lane in 0..REGISTER {
        let (a, b) = (a.0[lane], b.0[lane]);
        ratio.0[lane] = if b > 0.0 { a / b } else { 0.0 };
    }
    ratio
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::InstructionSet;

    /// A ring of springs, of another stiffness in every problem; the last problem is empty.
    #[test]
    fn what_is_solved_for_is_found_in_every_problem() {
        let size = 23_usize;
        let (mut starts, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
        let stiffness = |lane: usize| if lane == 7 { 0.0 } else { 0.3 + lane as f64 };
        let entry = |x: f64| Eight(std::array::from_fn(|lane| x * stiffness(lane)));
        for i in 0..size {
            let own = if i % 4 == 0 { 2.5 } else { 2.0 };
            let before = [(i + 1 == size).then_some(0), i.checked_sub(1)];
            for j in before.into_iter().flatten() {
                columns.push(j as u32);
                values.push(entry(-1.0));
            }
            columns.push(i as u32);
            values.push(entry(own));
            starts.push(columns.len());
        }
        let matrix = Lower { starts: &starts, columns: &columns, values: &values };
        let wanted: Vec<Eight> =
            (0..size).map(|i| Eight(std::array::from_fn(|l| (i * 7 + l) as f64 % 5.0))).collect();
        let mut right = vec![Eight::ZERO; size];
        symmetric_times(matrix, &wanted, &mut right);
        for set in InstructionSet::available() {
            let (mut x, mut converged) = (vec![Eight::ZERO; size], false);
            let mut work = Vec::new();
            conjugate_gradients(
                set,
                matrix,
                &right,
                &mut x,
                &mut work,
                (1e-12, 60),
                &mut converged,
            );
            assert!(converged, "{set:?}");
            for (x, wanted) in x.iter().zip(&wanted) {
                assert!((0..7).all(|lane| (x.0[lane] - wanted.0[lane]).abs() < 1e-9), "{set:?}");
                assert_eq!(x.0[7], 0.0);
            }
            conjugate_gradients(set, matrix, &right, &mut x, &mut work, (1e-12, 2), &mut converged);
            assert!(!converged, "two steps are too few");
        }
    }
}
