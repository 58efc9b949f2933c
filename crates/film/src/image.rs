//! A frame's image: the mean of its samples, its standard error, and how it was made.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::address::TileGrid;
use super::image_error::ImageError;
use super::image_layers::ImageLayers;
use super::rows::{ImageRows, LayerChoice};
use super::sampling::Sampling;
use super::tree::TileSum;
use crate::counters::Counters;

/// How an image was made: enough to make it again, bit for bit, from the same scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageMetadata {
    /// Hash of the canonical scene with all overrides applied, in hexadecimal.
    pub scene_hash: String,
    /// The frame.
    pub frame: u32,
    /// Seed of the scene.
    pub seed: u64,
    /// The integrator and its settings, as in the scene.
    pub integrator: serde_json::Value,
    /// How samples were grouped.
    pub sampling: Sampling,
    /// Edge of a tile in pixels.
    pub tile_size: u32,
    /// Passes of each tile, in the order of the tiles; 0 for a tile that is not there yet. The light plane, if there is
    /// one, is the last tile.
    pub tile_passes: Vec<u32>,
    /// Tiles of two whole blocks or more, whose standard error is known. Absent in files of earlier builds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub standard_error_tiles: Option<u32>,
    /// The program that made it.
    pub build: String,
    /// The programs that rendered it, where they are not just `build`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub worker_builds: Vec<String>,
    /// Light that the image lacks, in words.
    pub missing_light: Vec<String>,
    /// Light that comes by chance and rarely, in words.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_to_chance: Vec<String>,
    /// Which method `auto` has chosen for which light, in words.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub chosen_methods: Vec<String>,
    /// What is in imported files and not in the scene, or differs, in words.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub import_notes: Vec<String>,
    /// What was assumed for a file of another program that was rendered without a scene file, in words.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub assumptions: Vec<String>,
    /// What was done.
    pub counters: Counters,
    /// Time that it took, seconds.
    pub elapsed_seconds: Option<f64>,
}

impl ImageMetadata {
    /// Sets the passes of each tile, and with them in how many the standard error is known.
    pub fn set_tile_passes(&mut self, tile_passes: Vec<u32>) {
        self.tile_passes = tile_passes;
        self.standard_error_tiles = Some(self.tiles_with_standard_error());
    }

    /// Tiles of two whole blocks or more, whose standard error is known, those of the light plane among them.
    pub fn tiles_with_standard_error(&self) -> u32 {
        let is_known = |passes: &&u32| self.sampling.complete_blocks(**passes) >= 2;
        u32::try_from(self.tile_passes.iter().filter(is_known).count()).unwrap_or(u32::MAX)
    }
}

/// A finished or unfinished image of a frame, or a reference.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameImage {
    width: u32,
    height: u32,
    layers: ImageLayers,
    metadata: Option<ImageMetadata>,
}

impl FrameImage {
    /// An image of these layers.
    ///
    /// # Errors
    ///
    /// [`ImageError`] when there are no pixels, a layer is of another size, a value is not finite, a standard error is
    /// negative, or the metadata are those of an image of another size.
    pub fn new(
        width: u32,
        height: u32,
        layers: ImageLayers,
        metadata: Option<ImageMetadata>,
    ) -> Result<Self, ImageError> {
        let limit = i32::MAX as u32;
        if width == 0 || height == 0 || width > limit || height > limit {
            return Err(ImageError::BadSize { width: width.into(), height: height.into() });
        }
        check_layers(width, 0..height, &layers)?;
        if let Some(ImageMetadata { tile_size, tile_passes, .. }) = &metadata {
            let grid = TileGrid::new(width, height, (*tile_size).max(1));
            let counts = [false, true].map(|has_light_plane| u64::from(grid.with_light_plane(has_light_plane).len()));
            let found = tile_passes.len() as u64;
            if *tile_size == 0 || !counts.contains(&found) {
                return Err(ImageError::WrongTileCount { tile_size: *tile_size, found, expected: counts[0] });
            }
        }
        Ok(Self { width, height, layers, metadata })
    }

    /// The image that these sums make. Tiles without a sum are black and have no samples. Sets the pass counts of the
    /// metadata.
    ///
    /// # Errors
    ///
    /// [`ImageError`] when the grid has no pixels or a sum is of another grid.
    pub fn assemble(grid: &TileGrid, sums: &[TileSum], mut metadata: ImageMetadata) -> Result<Self, ImageError> {
        let is_light = |sum: &&TileSum| grid.light_tiles().contains(&sum.tile_index);
        let is_known = |sum: &TileSum| sum.blocks() >= 2;
        let known_light = sums.iter().filter(is_light).filter(|sum| is_known(sum)).count();
        let has_standard_error = sums.iter().any(is_known) && known_light == grid.light_tiles().len();
        let mut rows = ImageRows::new(*grid, 0..grid.height, LayerChoice::all(has_standard_error));
        metadata.tile_size = grid.tile_size;
        let mut tile_passes = vec![0; grid.len() as usize];
        // The light plane comes last.
        for sum in sums.iter().filter(|sum| !is_light(sum)).chain(sums.iter().filter(is_light)) {
            rows.fill(sum)?;
            tile_passes[sum.tile_index as usize] = sum.passes;
        }
        metadata.set_tile_passes(tile_passes);
        Self::new(grid.width, grid.height, rows.layers, Some(metadata))
    }

    /// Pixels across.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Pixels down.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Its layers.
    pub fn layers(&self) -> &ImageLayers {
        &self.layers
    }

    /// How it was made, if that is known.
    pub fn metadata(&self) -> Option<&ImageMetadata> {
        self.metadata.as_ref()
    }
}

/// Checks the layers of some rows of an image: their sizes, and that they hold what an image may.
///
/// # Errors
///
/// [`ImageError`] when a layer is of another size, a value is not finite or a standard error is negative.
pub(super) fn check_layers(width: u32, rows: Range<u32>, layers: &ImageLayers) -> Result<(), ImageError> {
    let pixels = width as usize * rows.len();
    let place = |index: usize| {
        let (x, y) = pixel(index, width);
        (x, rows.start + y)
    };
    let check = |layer: &'static str, values: &[f32], channels: usize| {
        if values.len() != pixels * channels {
            let found = values.len() / channels;
            return Err(ImageError::WrongPixelCount { layer, found, expected: pixels });
        }
        match values.iter().position(|value| !value.is_finite()) {
            None => Ok(()),
            Some(index) => {
                let (x, y) = place(index / channels);
                Err(ImageError::NotFinite { layer, x, y })
            }
        }
    };
    check("RGB", layers.mean.as_flattened(), 3)?;
    if let Some(standard_error) = &layers.standard_error {
        check("stderr", standard_error.as_flattened(), 3)?;
        if let Some(index) = standard_error.as_flattened().iter().position(|&value| value < 0.0) {
            let (x, y) = place(index / 3);
            return Err(ImageError::NegativeStandardError { x, y });
        }
    }
    if let Some(samples) = layers.samples.as_ref().filter(|samples| samples.len() != pixels) {
        return Err(ImageError::WrongPixelCount { layer: "samples", found: samples.len(), expected: pixels });
    }
    for (name, layer) in [("caustic", &layers.caustic), ("albedo", &layers.albedo), ("normal", &layers.normal)] {
        layer.iter().try_for_each(|layer| check(name, layer.as_flattened(), 3))?;
    }
    layers.depth.iter().try_for_each(|depth| check("depth", depth, 1))?;
    layers.halves.iter().flatten().try_for_each(|half| check("half", half.as_flattened(), 3))
}

/// Column and row of pixel `index`.
fn pixel(index: usize, width: u32) -> (u32, u32) {
    ((index % width as usize) as u32, (index / width as usize) as u32)
}

#[cfg(test)]
pub(super) mod tests {
    use glam::DVec3;

    use super::*;
    use crate::DecodeBudget;
    use crate::address::{NodeAddress, Tile};
    use crate::node::{Node, PassSums};
    use crate::sampler::{SampleStream, SamplerSettings};
    use crate::test_nodes::noise_node;
    use crate::tree::FilmTile;

    const GRID: TileGrid = TileGrid::new(7, 5, 4);

    fn sampling() -> Sampling {
        Sampling::new(4, 16).unwrap()
    }

    fn metadata() -> ImageMetadata {
        ImageMetadata {
            scene_hash: "5ce7e".to_owned(),
            frame: 0,
            seed: u64::MAX,
            integrator: serde_json::json!({ "fnee": { "trials": 1000 } }),
            sampling: sampling(),
            tile_size: 0,
            tile_passes: Vec::new(),
            standard_error_tiles: None,
            build: "test".to_owned(),
            worker_builds: vec!["old".to_owned(), "test".to_owned()],
            missing_light: vec!["light \u{201c}key\u{201d}: reflections inside the pane".to_owned()],
            left_to_chance: vec!["light of the small light \"sun\" that a pane reflects".to_owned()],
            chosen_methods: vec!["cone finds light of \"sun\" through panes".to_owned()],
            import_notes: vec!["hall.glb: animations are left out (1)".to_owned()],
            assumptions: vec!["The file has no light".to_owned()],
            counters: Counters { rays: 12, ..Counters::default() },
            elapsed_seconds: Some(0.1),
        }
    }

    fn tile_sum(index: u32, passes: u32) -> TileSum {
        let tile = GRID.tile(index).unwrap();
        let mut film = FilmTile::new(0, index, tile, sampling());
        for pass in 0..passes {
            let address = NodeAddress { frame: 0, tile: index, level: 0, index: pass };
            film.insert(noise_node(address, tile, sampling())).unwrap();
        }
        film.sum(passes).unwrap()
    }

    /// An unfinished image with all layers.
    pub(crate) fn image() -> FrameImage {
        let sums = [tile_sum(0, 13), tile_sum(1, 3), tile_sum(3, 8)];
        FrameImage::assemble(&GRID, &sums, metadata()).unwrap()
    }

    #[test]
    fn means_and_counts_are_those_of_the_sums() {
        let image = image();
        let sum = tile_sum(3, 8);
        // The first pixel of tile 3 is (4, 4).
        let pixel = 4 * 7 + 4;
        let layers = image.layers();
        assert_eq!(layers.mean[pixel], sum.layers.beauty[0].map(|sum| sum / 32.0));
        let first_hit = sum.layers.first_hit.as_ref().unwrap();
        assert_eq!(layers.albedo.as_ref().unwrap()[pixel], first_hit.albedo[0].map(|sum| sum / 16.0));
        assert_eq!(layers.depth.as_ref().unwrap()[pixel], first_hit.depth[0] / 16.0);
        let counts = layers.samples.as_ref().unwrap();
        assert_eq!((counts[0], counts[6], counts[pixel]), (52, 12, 32));
        assert_eq!((counts[pixel - 1], layers.mean[pixel - 1]), (0, [0.0; 3]));
        let errors = layers.standard_error.as_ref().unwrap();
        assert!(errors[0][0] > 0.0 && errors[pixel][2] > 0.0);
        assert_eq!(errors[6], [0.0; 3], "three passes are less than a block");
        assert_eq!(image.metadata().unwrap().standard_error_tiles, Some(2), "of 13 and 8 passes");
    }

    #[test]
    fn standard_error_is_absent_before_the_second_block() {
        let image = FrameImage::assemble(&GRID, &[tile_sum(0, 7)], metadata()).unwrap();
        assert!(image.layers().standard_error.is_none());
        assert_eq!(image.metadata().unwrap().standard_error_tiles, Some(0));
    }

    #[test]
    fn standard_error_is_the_spread_of_the_mean() {
        // Each sample is uniform in [0, 1]; the squared deviation of the mean in units of the standard error, from 32
        // blocks, is the square of Student's t with 31 degrees of freedom: mean 31/29, variance 2 (31/29)^2 30/27.
        let tile = Tile::new([0, 0], [64, 64]);
        let sampling = Sampling::new(2, 4).unwrap();
        let mut film = FilmTile::new(0, 0, tile, sampling);
        for pass in 0..64 {
            let noise = |x, y| {
                let settings = SamplerSettings { seed: 3, samples_per_block: 1 };
                let mut trials = SampleStream::new(&settings, 0, [x, y], pass).trials();
                [0, 1].map(|_| DVec3::from_array([0; 3].map(|_| trials.next_f64()))).into_iter().sum::<DVec3>()
            };
            let beauty = (0..tile.pixels()).map(|index| tile.pixel(index)).map(|(x, y)| noise(x, y)).collect();
            let first_hit = sampling.is_in_first_block(pass).then(|| crate::node::FirstHitSums {
                albedo: vec![DVec3::ZERO; tile.pixels()],
                normal: vec![DVec3::ZERO; tile.pixels()],
                depth: vec![0.0; tile.pixels()],
            });
            let address = NodeAddress { frame: 0, tile: 0, level: 0, index: pass };
            film.insert(Node::leaf(address, tile, sampling, &PassSums { beauty, caustic: None, first_hit }).unwrap())
                .unwrap();
        }
        let grid = TileGrid::new(64, 64, 64);
        let image = FrameImage::assemble(&grid, &[film.sum(64).unwrap()], metadata()).unwrap();
        let means = image.layers().mean.as_flattened();
        let errors = image.layers().standard_error.as_ref().unwrap().as_flattened();
        let squares: f64 =
            means.iter().zip(errors).map(|(mean, error)| f64::from((mean - 0.5) / error)).map(|t| t * t).sum();
        let count = means.len() as f64;
        let (mean, variance) = (31.0 / 29.0, 2.0 * (31.0f64 / 29.0) * (31.0 / 29.0) * 30.0 / 27.0);
        let deviation = (squares / count - mean) / (variance / count).sqrt();
        assert!(deviation.abs() < 5.0, "mean square {} deviates by {deviation} standard deviations", squares / count);
    }

    #[test]
    fn an_image_is_the_sum_of_its_planes_in_any_order() {
        let grid = GRID.with_light_plane(true);
        let sum = |index: u32, passes: u32| {
            let tile = grid.tile(index).unwrap();
            let mut film = FilmTile::new(0, index, tile, sampling());
            for pass in 0..passes {
                film.insert(noise_node(NodeAddress { frame: 0, tile: index, level: 0, index: pass }, tile, sampling()))
                    .unwrap();
            }
            film.sum(passes).unwrap()
        };
        let (camera, light) = ([sum(0, 9), sum(1, 8), sum(2, 8), sum(3, 8)], sum(4, 8));
        assert!(light.layers.first_hit.is_none());
        let alone = FrameImage::assemble(&GRID, &camera, metadata()).unwrap();
        let sums: Vec<TileSum> = camera.iter().cloned().chain([light.clone()]).collect();
        let both = FrameImage::assemble(&grid, &sums, metadata()).unwrap();
        assert_eq!(both.metadata().unwrap().tile_passes, [9, 8, 8, 8, 8]);
        let turned: Vec<TileSum> = sums.iter().rev().cloned().collect();
        assert_eq!(FrameImage::assemble(&grid, &turned, metadata()).unwrap().layers(), both.layers());
        for pixel in 0..35 {
            let added = light.layers.beauty[pixel].map(|sum| sum / 32.0);
            let moment = light.layers.moment.as_ref().unwrap()[pixel];
            let layers = [&alone, &both].map(FrameImage::layers);
            let error = layers.map(|layers| layers.standard_error.as_ref().unwrap()[pixel]);
            for channel in 0..3 {
                assert_eq!(layers[1].mean[pixel][channel], layers[0].mean[pixel][channel] + added[channel]);
                let own = f64::from(moment[channel]) / 2.0;
                let expected = (f64::from(error[0][channel]).powi(2) + own).sqrt();
                assert!((f64::from(error[1][channel]) / expected - 1.0).abs() < 1e-6);
            }
            assert_eq!((&layers[0].samples, &layers[0].albedo), (&layers[1].samples, &layers[1].albedo));
        }
        // A tile of one block in the camera plane has no error, whatever the light plane has. One without passes is
        // black.
        let few: Vec<TileSum> = [sum(0, 9), sum(1, 7), light.clone()].to_vec();
        let image = FrameImage::assemble(&grid, &few, metadata()).unwrap();
        let (errors, means) = (image.layers().standard_error.as_ref().unwrap(), &image.layers().mean);
        assert!(errors[0][0] > 0.0 && errors[6] == [0.0; 3] && means[6] != [0.0; 3] && means[34] == [0.0; 3]);
        // One block of the light plane: nothing is known of its error.
        let short: Vec<TileSum> = camera.iter().cloned().chain([sum(4, 7)]).collect();
        assert!(FrameImage::assemble(&grid, &short, metadata()).unwrap().layers().standard_error.is_none());
    }

    #[test]
    fn the_layer_caustic_is_the_sum_of_its_planes_each_over_its_own_count() {
        let grid = GRID.with_light_plane(true).with_caustic(true);
        let sum = |index: u32, passes: u32| {
            let tile = grid.tile(index).unwrap();
            let mut film = FilmTile::new(0, index, tile, sampling());
            for pass in 0..passes {
                film.insert(noise_node(NodeAddress { frame: 0, tile: index, level: 0, index: pass }, tile, sampling()))
                    .unwrap();
            }
            film.sum(passes).unwrap()
        };
        let sums = [sum(0, 9), sum(4, 8)];
        let image = FrameImage::assemble(&grid, &sums, metadata()).unwrap();
        let caustic = image.layers().caustic.as_ref().unwrap();
        let [camera, light] = [&sums[0], &sums[1]].map(|sum| &sum.layers.caustic.as_ref().unwrap()[0]);
        for channel in 0..3 {
            let [camera, light] = [(camera, 36.0), (light, 32.0)].map(|(sum, count)| f64::from(sum[channel]) / count);
            assert_eq!(caustic[0][channel], camera as f32 + light as f32);
        }
        assert_eq!(caustic[34], [0.0; 3], "the camera plane has nothing there yet");
        assert_eq!(FrameImage::decode(&image.encode().unwrap(), DecodeBudget { pixel_bytes: 1 << 20 }).unwrap(), image);
        let mut layers = image.layers().clone();
        layers.caustic.as_mut().unwrap()[8][1] = f32::NAN;
        let error = FrameImage::new(7, 5, layers, None).unwrap_err().to_string();
        assert_eq!(error, "layer caustic is not finite at pixel (1, 1)");
        let without = FrameImage::assemble(&GRID, &[tile_sum(0, 9)], metadata()).unwrap();
        assert!(without.layers().caustic.is_none());
    }

    #[test]
    fn metadata_of_an_image_of_another_size_are_refused() {
        let image = image();
        for (tile_size, tiles) in [(4, 3), (4, 6), (0, 0), (0, 4), (1, 4)] {
            let metadata = ImageMetadata { tile_size, tile_passes: vec![1; tiles], ..metadata() };
            let found = FrameImage::new(7, 5, image.layers.clone(), Some(metadata));
            assert!(matches!(found, Err(ImageError::WrongTileCount { .. })), "{tile_size}, {tiles}");
        }
    }

    #[test]
    fn a_tile_that_is_not_of_the_grid_is_refused() {
        let sum = TileSum { tile_index: 1, ..tile_sum(0, 1) };
        let error = FrameImage::assemble(&GRID, &[sum], metadata()).unwrap_err();
        assert!(matches!(error, ImageError::WrongTile { index: 1, .. }), "{error}");
    }
}
