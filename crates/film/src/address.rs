//! Addresses: tiles of the image, runs of passes, and the nodes of the merge tree.

use std::fmt;

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
    /// The lights: a pass has as many light subpaths as a pass of the camera plane has samples, and each leaves splats
    /// anywhere in the frame.
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

/// The most pixels of a frame that has a light plane, as 1920 x 1080: workers and coordinators hold all of it.
pub const MOST_LIGHT_PIXELS: u64 = 1 << 21;

/// How a film is cut into tiles. Those of the camera plane are squares of `tile_size`, smaller at the right and bottom
/// borders, numbered in rows. The light plane, if there is one, is the last tile: the whole frame.
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
        self.camera_tiles() + u32::from(self.has_light_plane)
    }

    /// The tile that is the light plane, if there is one.
    pub fn light_tile(&self) -> Option<u32> {
        self.has_light_plane.then(|| self.camera_tiles())
    }

    /// Whether there is no tile.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The pixels of tile `index`; `None` when there is no such tile.
    pub fn tile(&self, index: u32) -> Option<Tile> {
        let tile = |position, size| Tile { has_caustic: self.has_caustic, ..Tile::new(position, size) };
        if Some(index) == self.light_tile() {
            return Some(Tile { plane: Plane::Light, ..tile([0, 0], [self.width, self.height]) });
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
        assert_eq!((grid.len(), grid.light_tile(), grid.tile(6)), (6, None, None));
        let both = grid.with_light_plane(true);
        assert_eq!((both.camera_tiles(), both.len(), both.light_tile()), (6, 7, Some(6)));
        assert!((0..6).all(|index| both.tile(index) == grid.tile(index)));
        assert_eq!(both.tile(6), Some(Tile { plane: Plane::Light, ..Tile::new([0, 0], [21, 13]) }));
        assert_eq!(both.tile(7), None);
    }

    #[test]
    fn addresses_past_the_last_pass_do_not_exist() {
        let exists = |level, index| NodeAddress { frame: 0, tile: 0, level, index }.exists();
        assert!(exists(0, 0) && exists(0, u32::MAX - 1) && exists(30, 2) && exists(31, 0));
        assert!(!exists(0, u32::MAX) && !exists(31, 1) && !exists(32, 0) && !exists(u32::MAX, 0) && !exists(30, 3));
    }
}
