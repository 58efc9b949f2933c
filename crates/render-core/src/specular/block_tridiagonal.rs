//! Linear systems of chains: each vertex depends on itself and on its two neighbours.

use std::ops::{Mul, SubAssign};

use glam::DMat2;

use super::fermat::inverse;

/// One vertex of a chain: its equations, and their right-hand side, which [`solve`] replaces by the solution: a vector,
/// or a matrix of two.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row<R> {
    /// Coefficients of the previous vertex; unused in the first row.
    pub(super) before: DMat2,
    /// Coefficients of the vertex itself.
    pub(super) own: DMat2,
    /// Coefficients of the next vertex; unused in the last row.
    pub(super) after: DMat2,
    /// Right-hand side.
    pub(super) right: R,
}

/// Solves by elimination from the first row to the last and back (Jakob and Marschner 2012, section 4.3), in place;
/// `None` when singular.
pub(super) fn solve<R: Copy + SubAssign>(rows: &mut [Row<R>]) -> Option<()>
where
    DMat2: Mul<R, Output = R>,
{
    for k in 0..rows.len() {
        if let Some(previous) = k.checked_sub(1).map(|previous| rows[previous]) {
            let row = &mut rows[k];
            row.own -= row.before.mul_mat2(&previous.after);
            row.right -= row.before * previous.right;
        }
        let row = &mut rows[k];
        let inverse = inverse(&row.own, row.own.determinant())?;
        row.after = inverse.mul_mat2(&row.after);
        row.right = inverse * row.right;
    }
    for k in (1..rows.len()).rev() {
        let next = rows[k].right;
        let row = &mut rows[k - 1];
        row.right -= row.after * next;
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::specular::testing::{pair, random};

    #[test]
    fn solutions_of_chains_of_any_length_satisfy_their_equations() {
        let mut random = random(11);
        for length in 1..9 {
            let mut matrix = |diagonal: f64| {
                DMat2::from_cols(pair(&mut random) - 0.5, pair(&mut random) - 0.5)
                    + DMat2::from_diagonal(DVec2::splat(diagonal))
            };
            let rows: Vec<Row<DVec2>> = (0..length)
                .map(|_| Row { before: matrix(0.0), own: matrix(3.0), after: matrix(0.0), right: matrix(0.0).x_axis })
                .collect();
            let mut solved = rows.clone();
            solve(&mut solved).unwrap();
            for (k, row) in rows.iter().enumerate() {
                let mut left = row.own * solved[k].right;
                if k > 0 {
                    left += row.before * solved[k - 1].right;
                }
                if k + 1 < length {
                    left += row.after * solved[k + 1].right;
                }
                assert!((left - row.right).length() < 1e-14, "{k} of {length}: {left} is not {}", row.right);
            }
        }
    }

    #[test]
    fn a_singular_chain_has_no_solution() {
        let row = Row { before: DMat2::ZERO, own: DMat2::ZERO, after: DMat2::ZERO, right: DVec2::X };
        assert!(solve(&mut [row]).is_none());
    }
}
