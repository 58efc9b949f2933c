//! Min-max pyramids: true bounds of a height field's jet over any block of cells, from a few entries.

use crate::math::Interval;

/// Bounds of a height and of its first and second derivatives by the cell coordinates, in the order h; x, y; xx, xy,
/// yy.
pub(crate) type Bounds = [Interval; 6];

/// The largest blocks of entries that one query reads are 3 x 3.
const ENTRIES_PER_AXIS_LOG2: u32 = 1;

/// Maxima, then as many negated minima, so that entries are united by maxima alone. In single precision, rounded
/// outwards.
#[derive(Clone, Copy, Debug)]
struct Entry {
    /// Of the first derivatives. They stand apart because most queries read nothing else.
    slopes: [f32; 4],
    /// Of the height and the second derivatives.
    others: [f32; 8],
}

const EMPTY: Entry = Entry { slopes: [f32::NEG_INFINITY; 4], others: [f32::NEG_INFINITY; 8] };

/// Bounds over every cell of a grid, and over blocks of 2 x 2, 4 x 4, ... cells.
#[derive(Clone, Debug)]
pub(crate) struct Pyramid {
    levels: Vec<Level>,
}

#[derive(Clone, Debug)]
struct Level {
    columns: usize,
    rows: usize,
    entries: Vec<Entry>,
}

/// A block of cells; both ends belong to it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CellRange {
    pub(crate) first: [usize; 2],
    pub(crate) last: [usize; 2],
}

impl Pyramid {
    /// The pyramid over `columns` x `rows` cells, whose bounds are given row by row.
    pub(crate) fn new(columns: usize, rows: usize, cells: impl Iterator<Item = Bounds>) -> Self {
        let entries: Vec<_> = cells.map(|bounds| Entry::around(&bounds)).collect();
        debug_assert_eq!(entries.len(), columns * rows);
        let mut levels = vec![Level { columns, rows, entries }];
        while let Some(coarser) = levels.last().and_then(Level::coarser) {
            levels.push(coarser);
        }
        Self { levels }
    }

    /// Bounds over a block of cells. A block inside another never has wider bounds.
    pub(crate) fn bounds(&self, range: &CellRange) -> Bounds {
        let mut united = EMPTY;
        self.for_each_entry(range, |entry| united.unite(entry));
        united.bounds()
    }

    /// Bounds of the first derivatives over a block of cells.
    #[inline(always)]
    pub(crate) fn slopes(&self, range: &CellRange) -> [Interval; 2] {
        let mut united = EMPTY.slopes;
        self.for_each_entry(range, |entry| unite(&mut united, &entry.slopes));
        intervals(&united)
    }

    /// Bounds over all cells.
    pub(crate) fn all(&self) -> Bounds {
        self.levels[self.levels.len() - 1].entries[0].bounds()
    }

    /// Calls `read` with the entries of the finest level on which few of them cover the block.
    #[inline(always)]
    fn for_each_entry(&self, range: &CellRange, mut read: impl FnMut(&Entry)) {
        let span = (range.last[0] - range.first[0]).max(range.last[1] - range.first[1]);
        let level = usize::BITS - (span >> ENTRIES_PER_AXIS_LOG2).leading_zeros();
        let Level { columns, entries, .. } = &self.levels[(level as usize).min(self.levels.len() - 1)];
        let (first, last) = (range.first.map(|i| i >> level), range.last.map(|i| i >> level));
        for row in first[1]..=last[1] {
            for entry in &entries[row * columns + first[0]..=row * columns + last[0]] {
                read(entry);
            }
        }
    }
}

impl Level {
    /// The level above, with half as many entries on each axis; `None` above a single entry.
    fn coarser(&self) -> Option<Self> {
        if self.entries.len() == 1 {
            return None;
        }
        let (columns, rows) = (self.columns.div_ceil(2), self.rows.div_ceil(2));
        let mut entries = vec![EMPTY; columns * rows];
        for (row, line) in self.entries.chunks_exact(self.columns).enumerate() {
            for (column, child) in line.iter().enumerate() {
                entries[(row / 2) * columns + column / 2].unite(child);
            }
        }
        Some(Self { columns, rows, entries })
    }
}

impl Entry {
    fn around(&[h, x, y, xx, xy, yy]: &Bounds) -> Self {
        Self { slopes: rounded_outwards(&[x, y]), others: rounded_outwards(&[h, xx, xy, yy]) }
    }

    fn unite(&mut self, other: &Self) {
        unite(&mut self.slopes, &other.slopes);
        unite(&mut self.others, &other.others);
    }

    fn bounds(&self) -> Bounds {
        let ([x, y], [h, xx, xy, yy]) = (intervals(&self.slopes), intervals(&self.others));
        [h, x, y, xx, xy, yy]
    }
}

#[inline(always)]
fn unite<const N: usize>(into: &mut [f32; N], other: &[f32; N]) {
    for (a, b) in into.iter_mut().zip(other) {
        // Not f32::max, whose care for NaN keeps the loop from becoming vector instructions.
        *a = if *b > *a { *b } else { *a };
    }
}

/// The intervals of maxima and negated minima.
#[inline(always)]
fn intervals<const N: usize, const M: usize>(ends: &[f32; M]) -> [Interval; N] {
    debug_assert_eq!(M, 2 * N);
    std::array::from_fn(|k| Interval::new(-f64::from(ends[N + k]), f64::from(ends[k])))
}

fn rounded_outwards<const N: usize, const M: usize>(bounds: &[Interval; N]) -> [f32; M] {
    debug_assert_eq!(M, 2 * N);
    std::array::from_fn(|k| round_up(if k < N { bounds[k].max } else { -bounds[k - N].min }))
}

/// The nearest number in single precision that is not below `value`.
pub(crate) fn round_up(value: f64) -> f32 {
    let nearest = value as f32;
    if f64::from(nearest) < value { nearest.next_up() } else { nearest }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::testing::fixed_seed;
    use proptest::prelude::*;

    fn value(quantity: usize, column: usize, row: usize) -> f64 {
        libm::sin((quantity * 13 + column * 37 + row * 101) as f64)
    }

    prop_compose! {
        fn block(columns: usize, rows: usize)(
            a in 0..columns, b in 0..columns, c in 0..rows, d in 0..rows,
        ) -> CellRange {
            CellRange { first: [a.min(b), c.min(d)], last: [a.max(b), c.max(d)] }
        }
    }

    proptest! {
        #![proptest_config(fixed_seed(256))]

        #[test]
        fn bounds_hold_every_cell_of_the_block_and_shrink_with_it(outer in block(37, 22), inner in block(37, 22)) {
            let pyramid = Pyramid::new(37, 22, (0..37 * 22).map(|i| {
                std::array::from_fn(|k| Interval::point(value(k, i % 37, i / 37)))
            }));
            let (bounds, all) = (pyramid.bounds(&outer), pyramid.all());
            for k in 0..6 {
                for row in outer.first[1]..=outer.last[1] {
                    for column in outer.first[0]..=outer.last[0] {
                        let v = value(k, column, row);
                        prop_assert!(bounds[k].min <= v && v <= bounds[k].max);
                    }
                }
                prop_assert!(all[k].min <= bounds[k].min && bounds[k].max <= all[k].max);
            }
            prop_assert_eq!(pyramid.slopes(&outer), [bounds[1], bounds[2]]);
            let common = CellRange {
                first: [inner.first[0].max(outer.first[0]), inner.first[1].max(outer.first[1])],
                last: [inner.last[0].min(outer.last[0]), inner.last[1].min(outer.last[1])],
            };
            if (0..2).all(|axis| common.first[axis] <= common.last[axis]) {
                for (narrow, wide) in pyramid.bounds(&common).into_iter().zip(bounds) {
                    prop_assert!(wide.min <= narrow.min && narrow.max <= wide.max);
                }
            }
        }

        #[test]
        fn rounding_to_single_precision_goes_outwards(v in prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL) {
            prop_assert!(-f64::from(round_up(-v)) <= v && v <= f64::from(round_up(v)));
        }
    }
}
