//! Independent pictures of one scene.

use std::sync::atomic::AtomicBool;

use clerestory_film::{NodeAddress, TileGrid};
use clerestory_render_core::integrator::{PreparedScene, render_node};

/// Independent pictures of one scene, each with rows of red, green and blue from the top left.
#[derive(Clone, Debug)]
pub struct Pictures {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// The pictures.
    pub pictures: Vec<Vec<[f32; 3]>>,
}

impl Pictures {
    /// Renders a scene, each pass of which is independent of the others.
    ///
    /// # Panics
    ///
    /// When a sample is not finite, or passes belong to blocks.
    pub fn render(scene: &PreparedScene, count: u32) -> Self {
        let sampling = scene.sampling();
        assert_eq!(sampling.samples_per_pass(), sampling.samples_per_block(), "passes are independent");
        let film = scene.description().film;
        let grid = TileGrid::new(film.width, film.height, film.width.max(film.height));
        let scale = 1.0 / sampling.samples_per_pass() as f32;
        let picture = |index| {
            let address = NodeAddress { frame: 0, tile: 0, level: 0, index };
            let rendered = render_node(scene, &grid, address, &AtomicBool::new(false)).expect("finite samples");
            rendered.node.layers().beauty.iter().map(|sum| sum.map(|sum| sum * scale)).collect()
        };
        let [width, height] = [film.width, film.height].map(|edge| edge as usize);
        Self { width, height, pictures: (0..count).map(picture).collect() }
    }

    /// The pictures in bytes of 32-bit floats, one after another.
    ///
    /// # Panics
    ///
    /// When these are no such pictures.
    pub fn from_bytes(bytes: &[u8], [width, height]: [usize; 2]) -> Self {
        let values: Vec<f32> =
            bytes.chunks_exact(4).map(|value| f32::from_le_bytes([value[0], value[1], value[2], value[3]])).collect();
        let pixels: Vec<[f32; 3]> = values.chunks_exact(3).map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
        assert_eq!(pixels.len() * 12, bytes.len(), "whole pixels");
        assert!(!pixels.is_empty() && pixels.len().is_multiple_of(width * height), "whole pictures");
        Self { width, height, pictures: pixels.chunks_exact(width * height).map(<[_]>::to_vec).collect() }
    }
}
