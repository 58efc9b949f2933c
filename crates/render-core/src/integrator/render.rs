//! From a scene to nodes of the film: all samples of a tile over an aligned run of passes, on all cores.
//!
//! Strips of the light plane over the same passes have their light from the same light subpaths. These are traced once
//! for strips that are rendered together.

use std::sync::atomic::{AtomicBool, Ordering};

use glam::{DVec2, DVec3};
use rayon::prelude::*;
use thiserror::Error;

use super::allocation::Splats;
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
    render_nodes(scene, grid, &[address], cancelled)?.pop().ok_or(RenderError::NoSuchNode(address))
}

/// Renders nodes, in their order, as [`render_node`] does. It takes less time where there are strips of the light plane
/// one after the other over the same passes.
///
/// # Errors
///
/// As [`render_node`].
pub fn render_nodes(
    scene: &PreparedScene,
    grid: &TileGrid,
    addresses: &[NodeAddress],
    cancelled: &AtomicBool,
) -> Result<Vec<Rendered>, RenderError> {
    let mut nodes = Vec::with_capacity(addresses.len());
    for addresses in rendered_together(grid, addresses) {
        let mut tiles = Vec::with_capacity(addresses.len());
        for address in addresses {
            let tile = grid.tile(address.tile).filter(|_| address.exists());
            tiles.push((address.tile, tile.ok_or(RenderError::NoSuchNode(*address))?));
        }
        let [first, ..] = addresses else { continue };
        let renderer = Renderer {
            scene: scene.scene(),
            tracer: PathTracer::new(scene, grid),
            grid,
            tiles,
            sampling: scene.sampling(),
            sampler: SamplerSettings {
                seed: scene.description().seed,
                samples_per_block: scene.sampling().samples_per_block(),
            },
            splatted: scene.allocation().splats,
            cancelled,
        };
        nodes.extend(renderer.subtree(*first)?);
    }
    Ok(nodes)
}

/// The runs of nodes that are rendered together: strips of the light plane over the same passes, or a single node.
pub fn rendered_together<'a>(
    grid: &TileGrid,
    addresses: &'a [NodeAddress],
) -> impl Iterator<Item = &'a [NodeAddress]> + use<'a> {
    let light = grid.light_tiles();
    addresses.chunk_by(move |a, b| {
        let is_light = light.contains(&a.tile) && light.contains(&b.tile);
        is_light && a.tile < b.tile && NodeAddress { tile: b.tile, ..*a } == *b
    })
}

struct Renderer<'a> {
    scene: &'a Scene,
    tracer: PathTracer<'a>,
    grid: &'a TileGrid,
    /// One of the camera plane, or strips of the light plane from the top to the bottom, with their numbers.
    tiles: Vec<(u32, Tile)>,
    sampling: Sampling,
    sampler: SamplerSettings,
    /// Light subpaths for each sample of the light plane.
    splatted: Splats,
    cancelled: &'a AtomicBool,
}

/// The samples of one pass in one row of the tile.
struct Row {
    samples: Vec<PathSample>,
    counters: Counters,
}

impl Renderer<'_> {
    /// The nodes of the tiles over the passes of an address.
    fn subtree(&self, address: NodeAddress) -> Result<Vec<Rendered>, RenderError> {
        let camera_tile = match self.tiles[..] {
            [(_, tile)] if tile.plane == Plane::Camera => Some(tile),
            _ => None,
        };
        let Some([left, right]) = address.children() else {
            return match camera_tile {
                Some(tile) => Ok(vec![self.leaf(address, tile)?]),
                None => self.light_leaves(address),
            };
        };
        let (left, right) = match camera_tile {
            Some(_) => rayon::join(|| self.subtree(left), || self.subtree(right)),
            // A leaf has work for all cores, and takes much memory.
            None => (self.subtree(left), self.subtree(right)),
        };
        let merge = |(left, right): (Rendered, Rendered)| {
            let mut counters = left.counters;
            counters += right.counters;
            Ok(Rendered { node: Node::merge(left.node, &right.node)?, counters })
        };
        left?.into_iter().zip(right?).map(merge).collect()
    }

    /// The leaves of strips of the light plane. The work is that of the whole frame, and is shared out among strips.
    fn light_leaves(&self, address: NodeAddress) -> Result<Vec<Rendered>, RenderError> {
        let (Some((_, first)), Some((_, last))) = (self.tiles.first(), self.tiles.last()) else {
            return Ok(Vec::new());
        };
        let plane = LightPass {
            tracer: &self.tracer,
            seed: self.sampler.seed,
            width: self.grid.width,
            rows: first.y..last.y + last.height,
            has_caustic: self.grid.has_caustic,
            cancelled: self.cancelled,
        };
        let samples = |pixels: u64| pixels * u64::from(self.sampling.samples_per_pass());
        let whole = u64::from(self.grid.width) * u64::from(self.grid.height);
        let subpaths = self.splatted.of(samples(whole));
        // The weights know the ratio, and the number of subpaths is whole.
        let rounding = self.splatted.ratio() * samples(whole) as f64 / subpaths.max(1) as f64;
        let (splats, counters) = plane.splats(address.frame, address.passes().first, subpaths);
        if self.cancelled.load(Ordering::Relaxed) {
            return Err(RenderError::Cancelled);
        }
        let strips = self.grid.light_tiles();
        let leaf = |&(index, tile): &(u32, Tile)| {
            let begin = (tile.y - first.y) as usize * tile.width as usize;
            let of_strip = |sums: &[DVec3]| -> Vec<DVec3> {
                sums[begin..begin + tile.pixels()].iter().map(|sum| *sum * rounding).collect()
            };
            let caustic = splats.caustic.as_deref().map(of_strip);
            let sums = PassSums { beauty: of_strip(&splats.all), caustic, first_hit: None };
            let address = NodeAddress { tile: index, ..address };
            let counters = counters.part(index - strips.start, strips.len() as u32);
            let counters = Counters { samples: samples(tile.pixels() as u64), ..counters };
            Ok(Rendered { node: Node::leaf(address, tile, self.sampling, &sums)?, counters })
        };
        self.tiles.iter().map(leaf).collect()
    }

    fn leaf(&self, address: NodeAddress, tile: Tile) -> Result<Rendered, RenderError> {
        let pass = address.passes().first;
        // Left to itself, rayon makes pieces of many rows, and threads wait for the last one.
        let rows = (0..tile.height).into_par_iter().with_max_len(1);
        let rows: Vec<Row> = rows.map(|row| self.row(address.frame, pass, tile, row)).collect();
        if self.cancelled.load(Ordering::Relaxed) {
            return Err(RenderError::Cancelled);
        }
        let mut counters = Counters::default();
        let mut samples = Vec::with_capacity(tile.pixels());
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
        let caustic = tile.has_caustic.then(|| triples(|sample| sample.caustic));
        let sums = PassSums { beauty: triples(|sample| sample.radiance), caustic, first_hit };
        Ok(Rendered { node: Node::leaf(address, tile, self.sampling, &sums)?, counters })
    }

    /// Sums over the samples of a pass, for each pixel of a row.
    fn row(&self, frame: u32, pass: u32, tile: Tile, row: u32) -> Row {
        let mut counters = Counters::default();
        let samples = (0..tile.width)
            .map(|column| {
                if self.cancelled.load(Ordering::Relaxed) {
                    return PathSample::default();
                }
                self.pixel(frame, pass, [tile.x + column, tile.y + row], &mut counters)
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
