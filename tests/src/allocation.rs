//! How many samples each tile of a picture takes, so that its mean becomes known with the least work.
//!
//! Where caustics fold, the variance of a pixel can be a thousand times that of others. A picture whose tiles take samples
//! in proportion to the standard deviation of one of them (Neyman's allocation) then knows its mean with a fraction of the
//! samples that it would take with the same number everywhere. The numbers come from pictures with other seeds, so that the
//! estimates remain without bias.

use glam::DVec3;

use crate::reference::Image;

/// Edge of a tile, pixels.
pub const TILE: usize = 4;

/// What a tile's variance is never taken to be less than, relative to the mean of all: what is rare may not have
/// shown in the pilot.
const LEAST_VARIANCE: f64 = 0.02;

/// More than the pilot says, since it is itself uncertain.
const MARGIN: f64 = 1.2;

/// The passes for each tile, row by row, after which the mean over `pilot.len()` pictures has the relative standard error
/// `mean_error` in each channel, going by the pilot pictures of one pass. `least` to `most` passes for each.
pub fn passes(pilot: &[Image], mean_error: f64, least: u32, most: u32) -> Vec<u32> {
    let variances = relative_variances(pilot);
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

    /// Two tiles, of which the first varies by `first` of its value around 1, the other by `second`.
    fn pilot(first: f64, second: f64) -> Vec<Image> {
        let signs = (0..32).map(|picture| if picture % 2 == 0 { 1.0 } else { -1.0 });
        let pixels = |sign: f64| {
            let value = |column| DVec3::splat(1.0 + sign * if column < TILE { first } else { second });
            (0..TILE * 2 * TILE).map(|index| value(index % (2 * TILE))).collect()
        };
        signs.map(|sign| Image { width: 2 * TILE, height: TILE, pixels: pixels(sign) }).collect()
    }

    #[test]
    fn tiles_take_samples_in_proportion_to_their_deviation_until_the_mean_is_known() {
        let (first, second, error) = (0.3, 0.03, 0.001);
        let passes = passes(&pilot(first, second), error, 1, u32::MAX);
        // 10 without LEAST_VARIANCE.
        assert!((6.5..8.0).contains(&(f64::from(passes[0]) / f64::from(passes[1]))), "{passes:?}");
        // The parts of the mean are one half each, and independent between tiles after more passes.
        let variance = [first, second].iter().zip(&passes).map(|(d, n)| (d / 2.0).powi(2) / f64::from(*n)).sum::<f64>();
        let reached = (variance * 32.0 / 31.0 / 32.0).sqrt();
        assert!((0.85 * error..error).contains(&reached), "{reached}");
    }

    #[test]
    fn no_tile_takes_less_or_more_than_it_may() {
        assert_eq!(passes(&pilot(0.3, 0.0), 0.001, 200, 500), [500, 200]);
        assert_eq!(passes(&pilot(0.0, 0.0), 0.001, 7, 1000), [7, 7]);
    }
}
