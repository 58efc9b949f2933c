//! A picture of a frame that is small enough to be looked at, kept up to date tile by tile.
//!
//! A pixel of it is the mean of a square of pixels of the frame. Only pixels of the tile in the middle of the square
//! count. So a tile that grows changes no pixel of another tile. The planes of the film are kept apart until the
//! picture is encoded.

use std::borrow::Cow;

use super::address::TileGrid;
use super::image_error::ImageError;
use super::preview::{PreviewError, PreviewSettings, encode_pixels};
use super::tree::TileSum;

/// A picture of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct ReducedImage {
    grid: TileGrid,
    /// Edge of the square that a pixel stands for.
    factor: u32,
    width: u32,
    /// Of the camera plane, and of the light plane if there is one.
    planes: Vec<Vec<[f32; 3]>>,
    /// Whether the camera plane has a pixel, where there is a light plane.
    seen: Vec<bool>,
}

impl ReducedImage {
    /// A black picture of a frame, of at most `most_pixels` pixels in all its planes, but of at least one in each.
    pub fn new(grid: TileGrid, most_pixels: u64) -> Self {
        let size = |factor: u32| [grid.width.div_ceil(factor), grid.height.div_ceil(factor)];
        let planes = 1 + u64::from(grid.has_light_plane);
        let fits = |factor: &u32| planes * size(*factor).map(u64::from).iter().product::<u64>() <= most_pixels;
        let factor = (1..grid.width.max(grid.height)).find(fits).unwrap_or(grid.width.max(grid.height).max(1));
        let [width, height] = size(factor);
        let plane = vec![[0.0; 3]; width as usize * height as usize];
        let seen = if grid.has_light_plane { vec![false; plane.len()] } else { Vec::new() };
        Self { grid, factor, width, planes: vec![plane; 1 + usize::from(grid.has_light_plane)], seen }
    }

    /// Pixels of all its planes.
    pub fn pixels(&self) -> u64 {
        self.planes.iter().map(|plane| plane.len() as u64).sum()
    }

    /// The sum of its planes, where the camera plane has any.
    fn shown(&self) -> Cow<'_, [[f32; 3]]> {
        match &self.planes[..] {
            [camera, light] => {
                let sum = |((camera, light), is_seen): ((&[f32; 3], &[f32; 3]), &bool)| match is_seen {
                    true => std::array::from_fn(|channel| camera[channel] + light[channel]),
                    false => [0.0; 3],
                };
                camera.iter().zip(light).zip(&self.seen).map(sum).collect()
            }
            planes => Cow::Borrowed(planes.first().map_or(&[], |camera| &camera[..])),
        }
    }

    /// Shows a tile.
    ///
    /// # Errors
    ///
    /// [`ImageError::WrongTile`] when the sum is of another grid.
    pub fn put(&mut self, sum: &TileSum) -> Result<(), ImageError> {
        let expected = self.grid.tile(sum.tile_index);
        let Some(tile) = expected.filter(|tile| *tile == sum.tile) else {
            return Err(ImageError::WrongTile { index: sum.tile_index, found: sum.tile, expected });
        };
        let scale = 1.0 / sum.samples().max(1) as f64;
        let factor = self.factor;
        self.each_pixel(sum.tile_index, true, |[x, y]| {
            let columns = (x * factor).max(tile.x)..((x + 1) * factor).min(tile.x + tile.width);
            let rows = (y * factor).max(tile.y)..((y + 1) * factor).min(tile.y + tile.height);
            let mut total = [0.0; 3];
            for row in rows.clone() {
                let line = (row - tile.y) as usize * tile.width as usize;
                for column in columns.clone() {
                    let pixel = sum.layers.beauty[line + (column - tile.x) as usize];
                    total = std::array::from_fn(|channel| total[channel] + f64::from(pixel[channel]));
                }
            }
            let scale = scale / (rows.len() * columns.len()) as f64;
            total.map(|total| (total * scale) as f32)
        });
        Ok(())
    }

    /// Shows a tile as black.
    pub fn clear(&mut self, tile: u32) {
        self.each_pixel(tile, false, |_| [0.0; 3]);
    }

    /// The PNG of the picture. That of a frame that is not reduced is the [PNG of its
    /// image](super::preview::encode_png).
    ///
    /// # Errors
    ///
    /// [`PreviewError`] when it is too large for the format.
    pub fn encode_png(&self, settings: &PreviewSettings) -> Result<Vec<u8>, PreviewError> {
        encode_pixels(self.width, self.grid.height.div_ceil(self.factor), &self.shown(), settings)
    }

    /// Computes the pixels that stand for a tile, each from its column and row.
    fn each_pixel(&mut self, tile: u32, is_seen: bool, pixel: impl Fn([u32; 2]) -> [f32; 3]) {
        let plane = usize::from(self.grid.light_tiles().contains(&tile));
        let Some(tile) = self.grid.tile(tile) else { return };
        let middles = |first: u32, length: u32, whole: u32| {
            let factor = self.factor;
            let candidates = first / factor..(first + length).div_ceil(factor);
            let middle = move |square: u32| (square * factor + factor / 2).min(whole - 1);
            candidates.filter(move |square| (first..first + length).contains(&middle(*square)))
        };
        let columns: Vec<u32> = middles(tile.x, tile.width, self.grid.width).collect();
        for y in middles(tile.y, tile.height, self.grid.height).collect::<Vec<_>>() {
            for x in &columns {
                let place = y as usize * self.width as usize + *x as usize;
                self.planes[plane][place] = pixel([*x, y]);
                if plane == 0
                    && let Some(seen) = self.seen.get_mut(place)
                {
                    *seen = is_seen;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::address::NodeAddress;
    use crate::preview::{Exposure, ToneCurve};
    use crate::rows::{ImageRows, LayerChoice};
    use crate::test_nodes::noise_node;
    use crate::{FilmTile, Sampling};

    fn sum(grid: TileGrid, index: u32) -> TileSum {
        let (tile, sampling) = (grid.tile(index).unwrap(), Sampling::new(4, 16).unwrap());
        let mut film = FilmTile::new(0, index, tile, sampling);
        film.insert(noise_node(NodeAddress { frame: 0, tile: index, level: 1, index: 0 }, tile, sampling)).unwrap();
        film.sum(2).unwrap()
    }

    fn means(grid: TileGrid, sums: &[TileSum]) -> Vec<[f32; 3]> {
        let mut rows = ImageRows::new(grid, 0..grid.height, LayerChoice::MEAN);
        sums.iter().for_each(|sum| rows.fill(sum).unwrap());
        rows.layers().mean.clone()
    }

    #[test]
    fn a_frame_that_fits_is_shown_as_it_is() {
        let grid = TileGrid::new(21, 13, 8);
        let grid = grid.with_light_plane(true);
        let sums: Vec<TileSum> = [0, 2, 5, 6].map(|index| sum(grid, index)).to_vec();
        let mut reduced = ReducedImage::new(grid, 2 * 21 * 13);
        assert_eq!(reduced.pixels(), 2 * 21 * 13);
        sums.iter().for_each(|sum| reduced.put(sum).unwrap());
        assert!(reduced.shown() == means(grid, &sums));
        let settings = PreviewSettings { exposure: Exposure::Automatic, curve: ToneCurve::Filmic };
        let png = image::load_from_memory(&reduced.encode_png(&settings).unwrap()).unwrap();
        assert_eq!((png.width(), png.height()), (21, 13));
        reduced.clear(2);
        assert!(reduced.shown() == means(grid, &[sums[0].clone(), sums[2].clone(), sums[3].clone()]));
    }

    #[test]
    fn a_larger_frame_is_shown_as_means_of_squares() {
        let grid = TileGrid::new(22, 14, 8);
        let sums: Vec<TileSum> = (0..grid.len()).map(|index| sum(grid, index)).collect();
        let mut reduced = ReducedImage::new(grid, 100);
        assert_eq!((reduced.factor, reduced.width, reduced.pixels()), (2, 11, 77));
        sums.iter().for_each(|sum| reduced.put(sum).unwrap());
        let means = means(grid, &sums);
        for (index, pixel) in reduced.shown().iter().enumerate() {
            let (x, y) = (index % 11 * 2, index / 11 * 2);
            for channel in 0..3 {
                let square =
                    [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| f64::from(means[(y + j) * 22 + x + i][channel]));
                let mean = square.iter().sum::<f64>() / 4.0;
                assert!((f64::from(pixel[channel]) - mean).abs() <= 1e-6 * mean, "pixel {index}");
            }
        }
    }

    #[test]
    fn every_pixel_is_that_of_one_tile_also_where_squares_do_not_fit() {
        for (width, height, tile_size, most) in [(23, 17, 5, 50), (23, 17, 7, 30), (40, 3, 10, 9), (16, 16, 16, 1)] {
            let grid = TileGrid::new(width, height, tile_size);
            let mut reduced = ReducedImage::new(grid, most);
            assert!(reduced.pixels() <= most);
            for index in 0..grid.len() {
                reduced.put(&sum(grid, index)).unwrap();
            }
            assert!(reduced.shown().iter().all(|pixel| pixel[0] > 0.0), "{grid:?}");
            let whole = reduced.clone();
            for index in 0..grid.len() {
                reduced.clear(index);
            }
            assert!(reduced.shown().iter().all(|pixel| *pixel == [0.0; 3]), "{grid:?}");
            // In any order.
            (0..grid.len()).rev().for_each(|index| reduced.put(&sum(grid, index)).unwrap());
            assert!(reduced == whole);
        }
    }
}
