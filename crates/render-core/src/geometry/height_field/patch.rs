//! The coefficients of a height field, padded, and the patches of them that control the cells.

use glam::DVec2;

/// Copies of the outermost value on each side of the grid: with these, the cells from -2 to n read their taps without
/// clamping, and the outermost of them are constant.
pub(super) const PADDING: usize = 3;

/// The cell of clamped cell coordinates.
#[inline(always)]
pub(super) fn cell_of(a: DVec2) -> [u32; 2] {
    [a.x as u32, a.y as u32]
}

/// The 4 x 4 coefficients that control a cell, row by row.
pub(super) type Patch<'a> = [&'a [f64; 4]; 4];

#[inline(always)]
pub(super) fn patch(coefficients: &[f64], stride: u32, [column, row]: [u32; 2]) -> Patch<'_> {
    // The products of numbers of 32 bits cannot overflow.
    let (stride, start) = (stride as usize, row as usize * stride as usize + column as usize);
    let (second, third, fourth) = (start + stride, start + 2 * stride, start + 3 * stride);
    // One look at the end of the last row, so that the others need none.
    let coefficients = &coefficients[..fourth + 4];
    let row = |start: usize| coefficients[start..start + 4].first_chunk().expect("a row of four");
    [row(start), row(second), row(third), row(fourth)]
}

pub(super) fn pad(coefficients: &[f32], columns: usize, rows: usize) -> Vec<f64> {
    let mut padded = Vec::with_capacity((columns + 2 * PADDING) * (rows + 2 * PADDING));
    for row in 0..rows + 2 * PADDING {
        let line = row.saturating_sub(PADDING).min(rows - 1) * columns;
        for column in 0..columns + 2 * PADDING {
            padded.push(f64::from(coefficients[line + column.saturating_sub(PADDING).min(columns - 1)]));
        }
    }
    padded
}

/// The patch in another basis on each axis.
#[inline(always)]
pub(super) fn tensor<const X: usize, const Y: usize>(
    patch: Patch<'_>,
    along_x: &[[f64; 4]; X],
    along_y: &[[f64; 4]; Y],
) -> [[f64; X]; Y] {
    let dot = |a: &[f64; 4], b: &[f64; 4]| (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]);
    along_y.map(|wy| {
        let line = [0, 1, 2, 3].map(|column| dot(&patch.map(|row| row[column]), &wy));
        along_x.map(|wx| dot(&wx, &line))
    })
}

/// The patches of all cells of a padded grid, row by row: `columns + 3` times `rows + 3`.
pub(super) fn patches(padded: &[f64], [columns, rows]: [usize; 2]) -> impl Iterator<Item = Patch<'_>> {
    let (cells_across, cells_down) = ((columns + PADDING) as u32, (rows + PADDING) as u32);
    let cells = (0..cells_down).flat_map(move |row| (0..cells_across).map(move |column| [column, row]));
    cells.map(move |cell| patch(padded, cells_across + PADDING as u32, cell))
}
