//! How many samples each tile of a picture takes, so that its mean becomes known with the least work.
//!
//! Where caustics fold, the variance of a pixel can be a thousand times that of others. Under Neyman's allocation,
//! tiles take samples in proportion to the standard deviation of one sample. Then the mean of a picture needs a
//! fraction of the samples that an equal number everywhere would take. The numbers come from pictures with other seeds,
//! so that the estimates remain without bias.

use glam::DVec3;

use crate::reference::Image;

/// Edge of a tile, pixels.
pub const TILE: usize = 4;

/// Tiles on each side that share a variance. Near folds a few samples make most of it, and chance decides which tile
/// has them. A tile without them must not take fewer samples.
const NEIGHBOURS: usize = 2;

/// Least variance of a tile, relative to the mean of all. The pilot may have missed rare samples.
const LEAST_VARIANCE: f64 = 0.1;

/// How many more samples are taken than a pilot asks for, since it is itself uncertain.
pub const MARGIN: f64 = 1.2;

/// The passes for each tile, row by row, from pilot pictures of one pass. With them the mean over `pilot.len()`
/// pictures has the relative standard error `mean_error` in each channel. `least` to `most` passes for each.
pub fn passes(pilot: &[Image], mean_error: f64, least: u32, most: u32) -> Vec<u32> {
    let columns = pilot.first().map_or(1, |picture| picture.width.div_ceil(TILE));
    let variances = shared(&relative_variances(pilot), columns);
    let mean = variances.iter().sum::<f64>() / variances.len() as f64;
    let deviations: Vec<f64> = variances.iter().map(|variance| (variance + LEAST_VARIANCE * mean).sqrt()).collect();
    let total: f64 = deviations.iter().sum();
    let scale = MARGIN * total / (pilot.len() as f64 * mean_error * mean_error);
    deviations.iter().map(|deviation| ((deviation * scale).ceil().min(f64::from(most)) as u32).max(least)).collect()
}

/// The variance of each tile's part of the picture's mean, relative to its square: the largest of the channels.
fn relative_variances(pictures: &[Image]) -> Vec<f64> {
    let count = pictures.len() as f64;
    let parts: Vec<Vec<DVec3>> = pictures.iter().map(tile_sums).collect();
    let tiles = parts.first().map_or(0, Vec::len);
    let total = parts.iter().flatten().sum::<DVec3>() / count;
    (0..tiles)
        .map(|tile| {
            let mean = parts.iter().map(|parts| parts[tile]).sum::<DVec3>() / count;
            let squares: DVec3 = parts.iter().map(|parts| (parts[tile] - mean).powf(2.0)).sum();
            (squares / (count - 1.0) / (total * total)).max_element()
        })
        .collect()
}

/// The mean over the neighbourhood of each tile.
fn shared(values: &[f64], columns: usize) -> Vec<f64> {
    let rows = values.len() / columns;
    let around = |middle: usize, end: usize| middle.saturating_sub(NEIGHBOURS)..(middle + NEIGHBOURS + 1).min(end);
    (0..values.len())
        .map(|index| {
            let [x, y] = [index % columns, index / columns];
            let near = around(y, rows).flat_map(|y| around(x, columns).map(move |x| values[y * columns + x]));
            near.clone().sum::<f64>() / near.count() as f64
        })
        .collect()
}

fn tile_sums(picture: &Image) -> Vec<DVec3> {
    let columns = picture.width.div_ceil(TILE);
    let mut sums = vec![DVec3::ZERO; columns * picture.height.div_ceil(TILE)];
    for (index, pixel) in picture.pixels.iter().enumerate() {
        let [x, y] = [index % picture.width, index / picture.width];
        sums[y / TILE * columns + x / TILE] += *pixel;
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two parts side by side, each wider than a neighbourhood that shares a variance. Tiles of the first vary around 1
    /// by `first`, those of the other by `second`.
    fn pilot(first: f64, second: f64) -> Vec<Image> {
        let columns = 4 * NEIGHBOURS + 2;
        let pixels = |picture: usize| {
            let value = |column: usize| {
                // Orthogonal patterns of signs: products of one bit pattern with another sum to nothing over the
                // pictures.
                let sign = if ((picture + 1) & (column + 1)).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 };
                DVec3::splat(1.0 + sign * if column < columns / 2 { first } else { second })
            };
            (0..TILE * columns * TILE).map(|index| value(index % (columns * TILE) / TILE)).collect()
        };
        (0..32).map(|picture| Image { width: columns * TILE, height: TILE, pixels: pixels(picture) }).collect()
    }

    #[test]
    fn tiles_take_samples_in_proportion_to_their_deviation_until_the_mean_is_known() {
        let (first, second, error) = (0.3, 0.1, 0.001);
        let passes = passes(&pilot(first, second), error, 1, u32::MAX);
        let columns = passes.len();
        let ratio = f64::from(passes[0]) / f64::from(passes[columns - 1]);
        // 3 without LEAST_VARIANCE.
        assert!((2.3..3.0).contains(&ratio), "{passes:?}");
        // Each part of the mean is independent of the others after more passes.
        let variance = passes.iter().enumerate().map(|(column, passes)| {
            let deviation = if column < columns / 2 { first } else { second } / columns as f64;
            deviation * deviation / f64::from(*passes) / 31.0
        });
        let reached = variance.sum::<f64>().sqrt();
        assert!((0.8 * error..error).contains(&reached), "{reached}");
    }

    #[test]
    fn what_varies_in_one_tile_is_expected_of_its_neighbours() {
        let mut pictures = pilot(0.0, 0.0);
        for picture in pictures.iter_mut().step_by(2) {
            picture.pixels[0] = DVec3::splat(10.0);
        }
        let passes = passes(&pictures, 0.001, 1, u32::MAX);
        assert!(passes[NEIGHBOURS] > 2 * passes[NEIGHBOURS + 1], "{passes:?}");
    }

    #[test]
    fn no_tile_takes_less_or_more_than_it_may() {
        let limited = passes(&pilot(0.3, 0.0), 0.001, 100, 200);
        assert_eq!([limited[0], limited[limited.len() - 1]], [200, 100]);
        assert!(passes(&pilot(0.0, 0.0), 0.001, 7, 1000).iter().all(|passes| *passes == 7));
    }
}
