//! From a scene to a node of the film: all samples of a tile over an aligned run of passes, on all cores.

use std::sync::atomic::{AtomicBool, Ordering};

use glam::{DVec2, DVec3};
use rayon::prelude::*;
use thiserror::Error;

use super::light_pass::LightPass;
use super::path::{PathSample, PathTracer};
use super::prepared::PreparedScene;
use crate::scene::Scene;
use clerestory_film::counters::Counters;
use clerestory_film::{
    FirstHitSums, MergeError, Node, NodeAddress, NodeError, PassSums, Plane, Rendered, SampleStream, SamplerSettings,
    Sampling, Tile, TileGrid,
};

/// Why a node was not rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum RenderError {
    /// The caller asked to stop.
    #[error("rendering was cancelled")]
    Cancelled,
    /// The address names no tile of the grid or no node of the tree.
    #[error("there is no tile {} with a node of level {} and index {} in this image", .0.tile, .0.level, .0.index)]
    NoSuchNode(NodeAddress),
    /// A sample is not finite.
    #[error("a rendered pass is no valid node")]
    Node(#[from] NodeError),
    /// Two halves do not fit.
    #[error("two rendered halves do not merge")]
    Merge(#[from] MergeError),
}

/// Renders one node of the merge tree: a pure function of the scene and the address, whatever the number of threads.
/// Returns soon after `cancelled` becomes true.
///
/// # Errors
///
/// [`RenderError`] when there is no such node, on cancellation, and when a sample is not finite.
pub fn render_node(
    scene: &PreparedScene,
    grid: &TileGrid,
    address: NodeAddress,
    cancelled: &AtomicBool,
) -> Result<Rendered, RenderError> {
    let tile = grid.tile(address.tile).ok_or(RenderError::NoSuchNode(address))?;
    if !address.exists() {
        return Err(RenderError::NoSuchNode(address));
    }
    let renderer = Renderer {
        scene: scene.scene(),
        tracer: PathTracer::new(scene, grid),
        tile,
        sampling: scene.sampling(),
        sampler: SamplerSettings {
            seed: scene.description().seed,
            samples_per_block: scene.sampling().samples_per_block(),
        },
        splatted: scene.allocation().splats,
        cancelled,
    };
    renderer.subtree(address)
}

struct Renderer<'a> {
    scene: &'a Scene,
    tracer: PathTracer<'a>,
    tile: Tile,
    sampling: Sampling,
    sampler: SamplerSettings,
    /// Light subpaths for each sample of the light plane.
    splatted: u32,
    cancelled: &'a AtomicBool,
}

/// The samples of one pass in one row of the tile.
struct Row {
    samples: Vec<PathSample>,
    counters: Counters,
}

impl Renderer<'_> {
    fn subtree(&self, address: NodeAddress) -> Result<Rendered, RenderError> {
        let Some([left, right]) = address.children() else {
            return match self.tile.plane {
                Plane::Camera => self.leaf(address),
                Plane::Light => self.light_leaf(address),
            };
        };
        let (left, right) = match self.tile.plane {
            Plane::Camera => rayon::join(|| self.subtree(left), || self.subtree(right)),
            // A leaf has work for all cores, and takes much memory.
            Plane::Light => (self.subtree(left), self.subtree(right)),
        };
        let (left, right) = (left?, right?);
        let mut counters = left.counters;
        counters += right.counters;
        Ok(Rendered { node: Node::merge(left.node, &right.node)?, counters })
    }

    fn light_leaf(&self, address: NodeAddress) -> Result<Rendered, RenderError> {
        let samples = self.tile.pixels() as u64 * u64::from(self.sampling.samples_per_pass());
        let plane =
            LightPass { tracer: &self.tracer, seed: self.sampler.seed, tile: self.tile, cancelled: self.cancelled };
        let subpaths = samples.saturating_mul(self.splatted.into());
        let (splats, mut counters) = plane.splats(address.frame, address.passes().first, subpaths);
        if self.cancelled.load(Ordering::Relaxed) {
            return Err(RenderError::Cancelled);
        }
        counters.samples = samples;
        let sums = PassSums { beauty: splats.all, caustic: splats.caustic, first_hit: None };
        Ok(Rendered { node: Node::leaf(address, self.tile, self.sampling, &sums)?, counters })
    }

    fn leaf(&self, address: NodeAddress) -> Result<Rendered, RenderError> {
        let pass = address.passes().first;
        // Left to itself, rayon makes pieces of many rows, and threads wait for the last one.
        let rows = (0..self.tile.height).into_par_iter().with_max_len(1);
        let rows: Vec<Row> = rows.map(|row| self.row(address.frame, pass, row)).collect();
        if self.cancelled.load(Ordering::Relaxed) {
            return Err(RenderError::Cancelled);
        }
        let mut counters = Counters::default();
        let mut samples = Vec::with_capacity(self.tile.pixels());
        for row in rows {
            counters += row.counters;
            samples.extend(row.samples);
        }
        let triples = |layer: fn(&PathSample) -> DVec3| samples.iter().map(layer).collect::<Vec<_>>();
        let first_hit = self.sampling.is_in_first_block(pass).then(|| FirstHitSums {
            albedo: triples(|sample| sample.albedo),
            normal: triples(|sample| sample.normal),
            depth: samples.iter().map(|sample| sample.depth).collect(),
        });
        let caustic = self.tile.has_caustic.then(|| triples(|sample| sample.caustic));
        let sums = PassSums { beauty: triples(|sample| sample.radiance), caustic, first_hit };
        Ok(Rendered { node: Node::leaf(address, self.tile, self.sampling, &sums)?, counters })
    }

    /// Sums over the samples of a pass, for each pixel of a row.
    fn row(&self, frame: u32, pass: u32, row: u32) -> Row {
        let mut counters = Counters::default();
        let samples = (0..self.tile.width)
            .map(|column| {
                if self.cancelled.load(Ordering::Relaxed) {
                    return PathSample::default();
                }
                self.pixel(frame, pass, [self.tile.x + column, self.tile.y + row], &mut counters)
            })
            .collect();
        Row { samples, counters }
    }

    fn pixel(&self, frame: u32, pass: u32, pixel: [u32; 2], counters: &mut Counters) -> PathSample {
        let count = self.sampling.samples_per_pass();
        let mut sum = PathSample::default();
        for sample in pass * count..(pass + 1) * count {
            let mut stream = SampleStream::new(&self.sampler, frame, pixel, sample);
            let position = DVec2::new(f64::from(pixel[0]), f64::from(pixel[1])) + stream.next_2d();
            let seen = self.tracer.sample(self.scene.camera().ray(position), &mut stream, counters);
            sum.radiance += seen.radiance;
            sum.caustic += seen.caustic;
            sum.albedo += seen.albedo;
            sum.normal += seen.normal;
            sum.depth += seen.depth;
            counters.samples += 1;
        }
        sum
    }
}
