//! Addresses: tiles of the image, runs of passes, and the nodes of the merge tree.

use std::fmt;
use std::ops::Range;

use serde::{Deserialize, Serialize};

/// A run of passes `[first, first + count)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct PassRange {
    /// The first pass.
    pub first: u32,
    /// How many.
    pub count: u32,
}

impl PassRange {
    /// The largest aligned runs that the passes consist of, from left to right: the nodes of tile `tile` whose sum, in
    /// this order, is the tile's image when the range starts at pass 0.
    pub fn maximal_nodes(&self, frame: u32, tile: u32) -> Vec<NodeAddress> {
        let end = u64::from(self.first) + u64::from(self.count);
        let mut first = u64::from(self.first);
        let mut nodes = Vec::new();
        while first < end {
            let fits = (end - first).ilog2();
            let level = first.trailing_zeros().min(fits).min(NodeAddress::MAX_LEVEL);
            nodes.push(NodeAddress { frame, tile, level, index: (first >> level) as u32 });
            first += 1 << level;
        }
        nodes
    }
}

/// A plane of a film: what its samples start from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Plane {
    /// The camera: each sample belongs to a pixel.
    #[default]
    Camera,
    /// The lights: each light subpath leaves splats anywhere in the frame. The integrator says how many there are for
    /// each sample of the camera plane.
    Light,
}

/// A rectangle of pixels of one plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Tile {
    /// Leftmost pixel.
    pub x: u32,
    /// Topmost pixel.
    pub y: u32,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// The plane.
    #[serde(default)]
    pub plane: Plane,
    /// Whether its film has the layer `caustic`.
    #[serde(default)]
    pub has_caustic: bool,
}

impl Tile {
    /// A rectangle of the camera plane of a film without the layer `caustic`.
    pub const fn new([x, y]: [u32; 2], [width, height]: [u32; 2]) -> Self {
        Self { x, y, width, height, plane: Plane::Camera, has_caustic: false }
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Column and row in the image of the tile's `index`-th pixel, counted in rows from its top left.
    pub fn pixel(&self, index: usize) -> (u32, u32) {
        let width = self.width.max(1) as usize;
        (self.x + (index % width) as u32, self.y + (index / width) as u32)
    }
}

/// Largest tile edge, in pixels.
pub const LARGEST_TILE: u32 = 1024;

/// Most tiles of a frame: a farm keeps a row for each node of each.
pub const MOST_TILES: u64 = 65_536;

/// Smallest tile edge, in pixels, with which an image of this size has at most [`MOST_TILES`] tiles.
pub fn smallest_tile(width: u32, height: u32) -> u32 {
    let tiles = |edge: u32| u64::from(width.div_ceil(edge)) * u64::from(height.div_ceil(edge));
    (1..=LARGEST_TILE).find(|edge| tiles(*edge) <= MOST_TILES).unwrap_or(LARGEST_TILE)
}

/// The most pixels of a frame that has a light plane, as 4096 x 4096: who traces light holds all of it.
pub const MOST_LIGHT_PIXELS: u64 = 1 << 24;

/// The most pixels of a strip of the light plane, unless it is a single row of tiles: as 1920 x 1080.
const MOST_STRIP_PIXELS: u64 = 1 << 21;

/// How a film is cut into tiles. Those of the camera plane are squares of `tile_size`, smaller at the right and bottom
/// borders, numbered in rows. The light plane, if there is one, comes last. Its tiles are strips over the whole width:
/// one, or several rows of tiles each where a frame is large.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileGrid {
    /// Pixels across the image.
    pub width: u32,
    /// Pixels down the image.
    pub height: u32,
    /// Edge of a tile in pixels.
    pub tile_size: u32,
    /// Whether there is a light plane.
    pub has_light_plane: bool,
    /// Whether there is the layer `caustic`: light whose last specular vertices before a light are of glass or water.
    pub has_caustic: bool,
}

impl TileGrid {
    /// The camera plane of an image, without a light plane and without the layer `caustic`.
    pub const fn new(width: u32, height: u32, tile_size: u32) -> Self {
        Self { width, height, tile_size, has_light_plane: false, has_caustic: false }
    }

    /// The same with a light plane, or without one.
    #[must_use]
    pub const fn with_light_plane(self, has_light_plane: bool) -> Self {
        Self { has_light_plane, ..self }
    }

    /// The same with the layer `caustic`, or without it.
    #[must_use]
    pub const fn with_caustic(self, has_caustic: bool) -> Self {
        Self { has_caustic, ..self }
    }

    /// Tiles across.
    pub fn columns(&self) -> u32 {
        self.width.div_ceil(self.tile_size)
    }

    /// Tiles down.
    pub fn rows(&self) -> u32 {
        self.height.div_ceil(self.tile_size)
    }

    /// Number of tiles of the camera plane.
    pub fn camera_tiles(&self) -> u32 {
        self.columns() * self.rows()
    }

    /// Number of tiles.
    pub fn len(&self) -> u32 {
        let strips = if self.has_light_plane { self.rows().div_ceil(self.strip_rows()) } else { 0 };
        self.camera_tiles() + strips
    }

    /// The tiles of the light plane: strips, from the top to the bottom. None where there is no light plane.
    pub fn light_tiles(&self) -> Range<u32> {
        self.camera_tiles()..self.len()
    }

    /// The strip of the light plane over a tile of the camera plane, if there is a light plane.
    pub fn light_over(&self, tile: u32) -> Option<u32> {
        let strip = self.camera_tiles() + tile / self.columns() / self.strip_rows();
        (tile < self.camera_tiles() && strip < self.len()).then_some(strip)
    }

    /// The tiles of the camera plane under a strip of the light plane.
    pub fn under_light(&self, strip: u32) -> Range<u32> {
        let tiles = self.strip_rows() * self.columns();
        let first = strip.saturating_sub(self.camera_tiles()) * tiles;
        first..self.camera_tiles().min(first + tiles)
    }

    /// Rows of tiles in a strip of the light plane: strips are about equally high.
    fn strip_rows(&self) -> u32 {
        let row = u64::from(self.width) * u64::from(self.tile_size);
        let whole = u64::from(self.width) * u64::from(self.height);
        let fitting = if whole <= MOST_STRIP_PIXELS { self.rows() } else { (MOST_STRIP_PIXELS / row.max(1)) as u32 };
        let strips = self.rows().div_ceil(fitting.max(1)).max(1);
        self.rows().div_ceil(strips).max(1)
    }

    /// Whether there is no tile.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The pixels of tile `index`; `None` when there is no such tile.
    pub fn tile(&self, index: u32) -> Option<Tile> {
        let tile = |position, size| Tile { has_caustic: self.has_caustic, ..Tile::new(position, size) };
        if self.light_tiles().contains(&index) {
            let edge = self.strip_rows() * self.tile_size;
            let y = (index - self.camera_tiles()) * edge;
            return Some(Tile { plane: Plane::Light, ..tile([0, y], [self.width, edge.min(self.height - y)]) });
        }
        if index >= self.camera_tiles() {
            return None;
        }
        let x = index % self.columns() * self.tile_size;
        let y = index / self.columns() * self.tile_size;
        Some(tile([x, y], [self.tile_size.min(self.width - x), self.tile_size.min(self.height - y)]))
    }
}

/// A node of the merge tree: one tile over the aligned run of passes `[index * 2^level, (index + 1) * 2^level)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct NodeAddress {
    /// The frame.
    pub frame: u32,
    /// The tile's number in its grid.
    pub tile: u32,
    /// Binary logarithm of the number of passes.
    pub level: u32,
    /// Which aligned run of that length.
    pub index: u32,
}

impl fmt::Display for NodeAddress {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { frame, tile, level, index } = self;
        write!(formatter, "frame {frame}, tile {tile}, level {level}, index {index}")
    }
}

impl NodeAddress {
    /// The level of the largest node: 2^31 passes.
    pub const MAX_LEVEL: u32 = 31;

    /// Whether its passes can be counted in 32 bits. The other methods may be called only if so.
    pub fn exists(&self) -> bool {
        self.level <= Self::MAX_LEVEL && u64::from(self.index) < u64::from(u32::MAX) >> self.level
    }

    /// Its passes.
    pub fn passes(&self) -> PassRange {
        PassRange { first: self.index << self.level, count: 1 << self.level }
    }

    /// The node that this one is half of.
    pub fn parent(&self) -> Self {
        Self { level: self.level + 1, index: self.index >> 1, ..*self }
    }

    /// The other half of the parent.
    pub fn sibling(&self) -> Self {
        Self { index: self.index ^ 1, ..*self }
    }

    /// The two halves, left first; `None` for a single pass.
    pub fn children(&self) -> Option<[Self; 2]> {
        let level = self.level.checked_sub(1)?;
        Some([0, 1].map(|half| Self { level, index: self.index * 2 + half, ..*self }))
    }

    /// Whether the two nodes share a pass of the same tile: one is then the other's ancestor, or they are equal.
    pub fn overlaps(&self, other: &Self) -> bool {
        let level = self.level.max(other.level);
        self.frame == other.frame
            && self.tile == other.tile
            && self.index >> (level - self.level) == other.index >> (level - other.level)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn runs(first: u32, count: u32) -> Vec<(u32, u32)> {
        PassRange { first, count }.maximal_nodes(3, 5).iter().map(|node| (node.level, node.index)).collect()
    }

    #[test]
    fn a_run_of_passes_is_cut_into_its_largest_aligned_runs() {
        assert_eq!(runs(0, 8), [(3, 0)]);
        assert_eq!(runs(0, 13), [(3, 0), (2, 2), (0, 12)]);
        assert_eq!(runs(5, 8), [(0, 5), (1, 3), (2, 2), (0, 12)]);
        assert_eq!(runs(7, 0), []);
        assert_eq!(runs(0, u32::MAX).len(), 32);
        assert_eq!(runs(u32::MAX - 1, 1), [(0, u32::MAX - 1)]);
    }

    #[test]
    fn maximal_nodes_cover_the_run_and_no_two_are_siblings() {
        for first in 0..40 {
            for count in 0..40 {
                let nodes = PassRange { first, count }.maximal_nodes(0, 0);
                let mut next = first;
                for node in &nodes {
                    assert!(node.exists());
                    assert_eq!(node.passes().first, next);
                    next += node.passes().count;
                }
                assert_eq!(next, first + count);
                assert!(nodes.windows(2).all(|pair| pair[0].index % 2 == 1 || pair[0].sibling() != pair[1]));
            }
        }
    }

    #[test]
    fn the_light_plane_is_the_last_tile_and_the_whole_frame() {
        let grid = TileGrid::new(21, 13, 8);
        assert_eq!((grid.len(), grid.light_tiles(), grid.light_over(5), grid.tile(6)), (6, 6..6, None, None));
        let both = grid.with_light_plane(true);
        assert_eq!((both.camera_tiles(), both.len(), both.light_tiles()), (6, 7, 6..7));
        assert_eq!((both.light_over(5), both.under_light(6)), (Some(6), 0..6));
        assert!((0..6).all(|index| both.tile(index) == grid.tile(index)));
        assert_eq!(both.tile(6), Some(Tile { plane: Plane::Light, ..Tile::new([0, 0], [21, 13]) }));
        assert_eq!(both.tile(7), None);
    }

    #[test]
    fn strips_of_the_light_plane_are_rows_of_tiles_over_the_whole_frame() {
        for (width, height, tile_size, strips) in
            [(1920, 1080, 64, 1), (2048, 1024, 64, 1), (3840, 2160, 64, 5), (4096, 4096, 1024, 4), (3840, 2160, 7, 4)]
        {
            let grid = TileGrid::new(width, height, tile_size).with_light_plane(true);
            assert_eq!(grid.light_tiles().len(), strips, "{grid:?}");
            let (mut next_row, mut next_tile) = (0, 0);
            for strip in grid.light_tiles() {
                let tile = grid.tile(strip).unwrap();
                assert_eq!((tile.x, tile.y, tile.width, tile.plane), (0, next_row, width, Plane::Light));
                assert!(tile.pixels() as u64 <= MOST_STRIP_PIXELS.max(u64::from(width * tile_size)));
                let under = grid.under_light(strip);
                assert_eq!(under.start, next_tile);
                for index in [under.start, under.end - 1] {
                    let here = grid.tile(index).unwrap();
                    assert!(tile.y <= here.y && here.y + here.height <= tile.y + tile.height);
                    assert_eq!(grid.light_over(index), Some(strip));
                }
                (next_row, next_tile) = (tile.y + tile.height, under.end);
            }
            assert_eq!((next_row, next_tile), (height, grid.camera_tiles()));
            assert_eq!((grid.tile(grid.len()), grid.light_over(grid.camera_tiles())), (None, None));
        }
    }

    #[test]
    fn addresses_past_the_last_pass_do_not_exist() {
        let exists = |level, index| NodeAddress { frame: 0, tile: 0, level, index }.exists();
        assert!(exists(0, 0) && exists(0, u32::MAX - 1) && exists(30, 2) && exists(31, 0));
        assert!(!exists(0, u32::MAX) && !exists(31, 1) && !exists(32, 0) && !exists(u32::MAX, 0) && !exists(30, 3));
    }
}
