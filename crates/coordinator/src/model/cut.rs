//! Cutting: the passes of a round become nodes. Every cut has the same sum, bit for bit.

use clerestory_film::PassRange;

/// Cuts a range of passes into aligned runs of `2^level` passes, from left to right, each as long as alignment, the
/// range and `largest_level` allow. Yields `(level, index)`.
pub(crate) fn cut(range: PassRange, largest_level: u32) -> impl Iterator<Item = (u32, u32)> {
    let end = range.first + range.count;
    let mut first = range.first;
    std::iter::from_fn(move || {
        let rest = end.checked_sub(first)?.checked_ilog2()?;
        let level = first.trailing_zeros().min(rest).min(largest_level);
        let node = (level, first >> level);
        first += 1 << level;
        Some(node)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_is_aligned_whole_and_no_finer_than_asked() {
        for first in 0..40 {
            for count in 0..40 {
                for largest_level in 0..6 {
                    let mut next = first;
                    for (level, index) in cut(PassRange { first, count }, largest_level) {
                        assert!(level <= largest_level);
                        assert_eq!(index << level, next);
                        next += 1 << level;
                        let grown = level + 1;
                        let could_grow = grown <= largest_level
                            && (index << level) % (1 << grown) == 0
                            && (index << level) + (1 << grown) <= first + count;
                        assert!(!could_grow, "level {level} at {} of {first}+{count}", index << level);
                    }
                    assert_eq!(next, first + count);
                }
            }
        }
    }
}
