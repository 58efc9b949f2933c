//! Rendering scenes in this process, pass by pass.

use std::sync::atomic::AtomicBool;

use clerestory_film::counters::Counters;
use clerestory_film::{NodeAddress, TileGrid};
use clerestory_render_core::integrator::{PreparedScene, RenderError, render_node};
use glam::DVec3;

use crate::{estimate::Estimate, reference::Image};

/// A scene being rendered: the sums over the passes so far.
pub struct Rendering<'a> {
    scene: &'a PreparedScene,
    grid: TileGrid,
    passes: u32,
    sums: Vec<DVec3>,
    counters: Counters,
}

impl<'a> Rendering<'a> {
    /// Nothing rendered yet.
    pub fn new(scene: &'a PreparedScene) -> Self {
        let film = scene.description().film;
        let grid = scene.description().grid(film.width.max(film.height));
        let pixels = film.width as usize * film.height as usize;
        Self { scene, grid, passes: 0, sums: vec![DVec3::ZERO; pixels], counters: Counters::default() }
    }

    /// Renders the next pass on all cores.
    ///
    /// # Errors
    ///
    /// When a sample is not finite.
    pub fn render_pass(&mut self) -> Result<(), RenderError> {
        for tile in 0..self.grid.len() {
            let address = NodeAddress { frame: 0, tile, level: 0, index: self.passes };
            let rendered = render_node(self.scene, &self.grid, address, &AtomicBool::new(false))?;
            for (sum, pass) in self.sums.iter_mut().zip(&rendered.node.layers().beauty) {
                *sum += DVec3::from(pass.map(f64::from));
            }
            self.counters += rendered.counters;
        }
        self.passes += 1;
        Ok(())
    }

    /// Passes rendered so far.
    pub fn passes(&self) -> u32 {
        self.passes
    }

    /// Samples rendered so far, in each pixel.
    pub fn samples(&self) -> u32 {
        self.passes * self.scene.sampling().samples_per_pass()
    }

    /// The work so far.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// The mean over all samples so far.
    pub fn image(&self) -> Image {
        let scale = 1.0 / f64::from(self.samples().max(1));
        Image {
            width: self.grid.width as usize,
            height: self.grid.height as usize,
            pixels: self.sums.iter().map(|&sum| sum * scale).collect(),
        }
    }
}

/// Means of the red channel over `blocks` by `blocks` equal parts of the picture, row by row, from `passes` independent
/// passes.
///
/// # Panics
///
/// When a sample is not finite.
pub fn block_means(scene: &PreparedScene, passes: u32, blocks: usize) -> Vec<Estimate> {
    let mut rendering = Rendering::new(scene);
    let mut values = vec![Vec::new(); blocks * blocks];
    let mut before = vec![0.0; blocks * blocks];
    for _ in 0..passes {
        rendering.render_pass().expect("finite samples");
        let image = rendering.image();
        let mut now = vec![0.0; blocks * blocks];
        let scale = f64::from(rendering.passes()) * (blocks * blocks) as f64 / image.pixels.len() as f64;
        for (index, pixel) in image.pixels.iter().enumerate() {
            let (column, row) = (index % image.width, index / image.width);
            now[row * blocks / image.height * blocks + column * blocks / image.width] += pixel.x * scale;
        }
        for ((values, now), before) in values.iter_mut().zip(&now).zip(&before) {
            values.push(now - before);
        }
        before = now;
    }
    values.iter().map(|values| Estimate::of(values)).collect()
}
