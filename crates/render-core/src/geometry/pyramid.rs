//! Min-max pyramids: true bounds of a quantity over any block of cells, from a few entries.

use super::Interval;

/// The largest blocks of entries that one query reads are 3 x 3.
const ENTRIES_PER_AXIS_LOG2: u32 = 1;

/// Bounds of one quantity over every cell of a grid, and over blocks of 2 x 2, 4 x 4, ... cells. Ends are stored in
/// single precision, rounded outwards.
#[derive(Clone, Debug)]
pub(crate) struct Pyramid {
    levels: Vec<Level>,
}

#[derive(Clone, Debug)]
struct Level {
    columns: usize,
    rows: usize,
    entries: Vec<[f32; 2]>,
}

/// A block of cells; both ends belong to it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CellRange {
    pub(crate) first: [usize; 2],
    pub(crate) last: [usize; 2],
}

impl Pyramid {
    /// The pyramid over `columns` x `rows` cells, whose bounds are given row by row.
    pub(crate) fn new(columns: usize, rows: usize, cells: impl Iterator<Item = Interval>) -> Self {
        let entries: Vec<_> = cells.map(|bounds| [round_down(bounds.min), round_up(bounds.max)]).collect();
        debug_assert_eq!(entries.len(), columns * rows);
        let mut levels = vec![Level { columns, rows, entries }];
        while let Some(coarser) = levels.last().and_then(Level::coarser) {
            levels.push(coarser);
        }
        Self { levels }
    }

    /// Bounds over a block of cells. A block inside another never has wider bounds.
    pub(crate) fn bounds(&self, range: &CellRange) -> Interval {
        let span = (range.last[0] - range.first[0]).max(range.last[1] - range.first[1]);
        let level = usize::BITS - (span >> ENTRIES_PER_AXIS_LOG2).leading_zeros();
        let Level { columns, entries, .. } = &self.levels[(level as usize).min(self.levels.len() - 1)];
        let (first, last) = (range.first.map(|i| i >> level), range.last.map(|i| i >> level));
        let (mut min, mut max) = (f32::INFINITY, f32::NEG_INFINITY);
        for row in first[1]..=last[1] {
            for entry in &entries[row * columns + first[0]..=row * columns + last[0]] {
                min = min.min(entry[0]);
                max = max.max(entry[1]);
            }
        }
        Interval::new(f64::from(min), f64::from(max))
    }

    /// Bounds over all cells.
    pub(crate) fn all(&self) -> Interval {
        let [min, max] = self.levels[self.levels.len() - 1].entries[0];
        Interval::new(f64::from(min), f64::from(max))
    }
}

impl Level {
    /// The level above, with half as many entries on each axis; `None` above a single entry.
    fn coarser(&self) -> Option<Self> {
        if self.entries.len() == 1 {
            return None;
        }
        let (columns, rows) = (self.columns.div_ceil(2), self.rows.div_ceil(2));
        let mut entries = vec![[f32::INFINITY, f32::NEG_INFINITY]; columns * rows];
        for (row, line) in self.entries.chunks_exact(self.columns).enumerate() {
            for (column, child) in line.iter().enumerate() {
                let entry = &mut entries[(row / 2) * columns + column / 2];
                *entry = [entry[0].min(child[0]), entry[1].max(child[1])];
            }
        }
        Some(Self { columns, rows, entries })
    }
}

fn round_down(value: f64) -> f32 {
    let nearest = value as f32;
    if f64::from(nearest) > value { nearest.next_down() } else { nearest }
}

fn round_up(value: f64) -> f32 {
    -round_down(-value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::testing::fixed_seed;
    use proptest::prelude::*;

    fn value(column: usize, row: usize) -> f64 {
        libm::sin((column * 37 + row * 101) as f64)
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
                let v = value(i % 37, i / 37);
                Interval::new(v, v)
            }));
            let bounds = pyramid.bounds(&outer);
            for row in outer.first[1]..=outer.last[1] {
                for column in outer.first[0]..=outer.last[0] {
                    let v = value(column, row);
                    prop_assert!(bounds.min <= v && v <= bounds.max);
                }
            }
            prop_assert!(pyramid.all().min <= bounds.min && bounds.max <= pyramid.all().max);
            let common = CellRange {
                first: [inner.first[0].max(outer.first[0]), inner.first[1].max(outer.first[1])],
                last: [inner.last[0].min(outer.last[0]), inner.last[1].min(outer.last[1])],
            };
            if (0..2).all(|axis| common.first[axis] <= common.last[axis]) {
                let narrower = pyramid.bounds(&common);
                prop_assert!(bounds.min <= narrower.min && narrower.max <= bounds.max);
            }
        }

        #[test]
        fn rounding_to_single_precision_goes_outwards(v in prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL) {
            prop_assert!(f64::from(round_down(v)) <= v && v <= f64::from(round_up(v)));
        }
    }
}
