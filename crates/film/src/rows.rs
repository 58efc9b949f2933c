//! Some rows of an image, made from the sums of tiles.
//!
//! An image can be far larger than what a process should hold. So it is made, measured and written in strips: rows over
//! its whole width, few enough to fit into memory, one strip after the other.

use std::ops::Range;

use super::address::{Plane, Tile, TileGrid};
use super::image_error::ImageError;
use super::image_layers::ImageLayers;
use super::tree::TileSum;

/// Which layers of an image are made; its means always are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayerChoice {
    /// The standard error.
    pub standard_error: bool,
    /// Numbers of samples, what camera rays meet first (albedo, normal and depth), and caustics if the film has them.
    pub others: bool,
}

impl LayerChoice {
    /// The means alone.
    pub const MEAN: Self = Self { standard_error: false, others: false };

    /// All that an image has: the standard error if it is known anywhere.
    pub fn all(has_standard_error: bool) -> Self {
        Self { standard_error: has_standard_error, others: true }
    }

    /// What a measurement needs: the means, and the standard error if it is known anywhere.
    pub fn measured(has_standard_error: bool) -> Self {
        Self { standard_error: has_standard_error, others: false }
    }

    /// Bytes of a pixel of a film in memory.
    pub fn bytes_per_pixel(&self, grid: &TileGrid) -> u64 {
        let others = if grid.has_caustic { 44 } else { 32 };
        12 + if self.standard_error { 12 } else { 0 } + if self.others { others } else { 0 }
    }
}

/// Rows of an image over its whole width, black until tiles are filled in.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageRows {
    grid: TileGrid,
    rows: Range<u32>,
    /// What each pixel has of the camera plane; empty without a light plane.
    seen: Vec<Seen>,
    pub(super) layers: ImageLayers,
}

/// What a pixel has of the camera plane.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Seen {
    Nothing,
    /// Samples.
    Samples,
    /// Samples of which the standard error is known.
    Blocks,
}

impl ImageRows {
    /// These rows of an image, without any tile.
    pub fn new(grid: TileGrid, rows: Range<u32>, choice: LayerChoice) -> Self {
        let pixels = grid.width as usize * rows.len();
        let triples = |is_wanted: bool| is_wanted.then(|| vec![[0.0; 3]; pixels]);
        let layers = ImageLayers {
            mean: vec![[0.0; 3]; pixels],
            standard_error: triples(choice.standard_error),
            caustic: triples(choice.others && grid.has_caustic),
            samples: choice.others.then(|| vec![0; pixels]),
            albedo: triples(choice.others),
            normal: triples(choice.others),
            depth: choice.others.then(|| vec![0.0; pixels]),
            halves: None,
        };
        let seen = if grid.has_light_plane { vec![Seen::Nothing; pixels] } else { Vec::new() };
        Self { grid, rows, seen, layers }
    }

    /// Which rows.
    pub fn rows(&self) -> Range<u32> {
        self.rows.clone()
    }

    /// How the image is cut into tiles.
    pub fn grid(&self) -> TileGrid {
        self.grid
    }

    /// The layers, with the pixels of these rows only.
    pub fn layers(&self) -> &ImageLayers {
        &self.layers
    }

    /// Adds the means of those pixels of a tile that lie in these rows. An image is the sum of its planes. The light
    /// plane comes after the tiles of the camera plane, and is added where those are.
    ///
    /// # Errors
    ///
    /// [`ImageError::WrongTile`] when the sum is of another grid.
    pub fn fill(&mut self, sum: &TileSum) -> Result<(), ImageError> {
        let expected = self.grid.tile(sum.tile_index);
        let Some(tile) = expected.filter(|tile| *tile == sum.tile) else {
            return Err(ImageError::WrongTile { index: sum.tile_index, found: sum.tile, expected });
        };
        let first = tile.y.max(self.rows.start);
        let end = (tile.y + tile.height).min(self.rows.end);
        for y in first..end {
            let in_tile = (y - tile.y) as usize * tile.width as usize;
            let in_rows = (y - self.rows.start) as usize * self.grid.width as usize + tile.x as usize;
            let seen = self.seen.get_mut(in_rows..in_rows + tile.width as usize).unwrap_or_default();
            if tile.plane == Plane::Light {
                self.layers.add_light(sum, in_tile, in_rows, seen);
            } else {
                self.layers.fill_line(sum, tile, in_tile, in_rows);
                seen.fill(if sum.blocks() >= 2 { Seen::Blocks } else { Seen::Samples });
            }
        }
        Ok(())
    }
}

impl ImageLayers {
    /// Adds a line of the light plane, from pixel `in_tile` of it on, to the pixels from `in_rows` on, of which the
    /// camera plane has seen so much.
    fn add_light(&mut self, sum: &TileSum, in_tile: usize, in_rows: usize, seen: &[Seen]) {
        let scale = 1.0 / sum.samples().max(1) as f64;
        let known = f64::from(sum.blocks());
        let error_scale = 1.0 / (known * (known - 1.0));
        let moment = sum.layers.moment.as_ref().filter(|_| known >= 2.0);
        for (index, seen) in seen.iter().enumerate() {
            let (from, to) = (in_tile + index, in_rows + index);
            if *seen != Seen::Nothing {
                for (mean, sum) in self.mean[to].iter_mut().zip(sum.layers.beauty[from]) {
                    *mean = (*mean + (f64::from(sum) * scale) as f32).clamp(f32::MIN, f32::MAX);
                }
                if let (Some(means), Some(sums)) = (&mut self.caustic, &sum.layers.caustic) {
                    for (mean, sum) in means[to].iter_mut().zip(sums[from]) {
                        *mean = (*mean + (f64::from(sum) * scale) as f32).clamp(f32::MIN, f32::MAX);
                    }
                }
            }
            let Some(errors) = &mut self.standard_error else { continue };
            errors[to] = match moment.filter(|_| *seen == Seen::Blocks) {
                Some(moment) => std::array::from_fn(|channel| {
                    let own = f64::from(moment[from][channel]) * error_scale;
                    libm::hypot(f64::from(errors[to][channel]), own.sqrt()) as f32
                }),
                None => [0.0; 3],
            };
        }
    }

    /// Writes the means of a line of a tile, from pixel `in_tile` of the tile on, to the pixels from `in_rows` on.
    fn fill_line(&mut self, sum: &TileSum, tile: Tile, in_tile: usize, in_rows: usize) {
        let samples = sum.samples();
        let scale = 1.0 / samples.max(1) as f64;
        let blocks = f64::from(sum.blocks());
        let error_scale = 1.0 / (blocks * (blocks - 1.0));
        let first_hit_scale = 1.0 / f64::from(sum.sampling.first_hit_samples(sum.passes).max(1));
        let width = tile.width as usize;
        let (from, to) = (in_tile..in_tile + width, in_rows..in_rows + width);

        write_means(&mut self.mean[to.clone()], &sum.layers.beauty[from.clone()], scale);
        if let (Some(means), Some(sums)) = (&mut self.caustic, &sum.layers.caustic) {
            write_means(&mut means[to.clone()], &sums[from.clone()], scale);
        }
        if let Some(counts) = &mut self.samples {
            counts[to.clone()].fill(u32::try_from(samples).unwrap_or(u32::MAX));
        }
        if let (Some(errors), Some(moment), 2..) = (&mut self.standard_error, &sum.layers.moment, sum.blocks()) {
            for (error, moment) in errors[to.clone()].iter_mut().zip(&moment[from.clone()]) {
                *error = moment.map(|moment| (f64::from(moment) * error_scale).sqrt() as f32);
            }
        }
        if let Some(first_hit) = &sum.layers.first_hit {
            if let Some(albedo) = &mut self.albedo {
                write_means(&mut albedo[to.clone()], &first_hit.albedo[from.clone()], first_hit_scale);
            }
            if let Some(normal) = &mut self.normal {
                write_means(&mut normal[to.clone()], &first_hit.normal[from.clone()], first_hit_scale);
            }
            if let Some(depth) = &mut self.depth {
                for (depth, sum) in depth[to].iter_mut().zip(&first_hit.depth[from]) {
                    *depth = (f64::from(*sum) * first_hit_scale) as f32;
                }
            }
        }
    }
}

fn write_means(means: &mut [[f32; 3]], sums: &[[f32; 3]], scale: f64) {
    for (mean, sum) in means.iter_mut().zip(sums) {
        *mean = sum.map(|sum| (f64::from(sum) * scale) as f32);
    }
}
