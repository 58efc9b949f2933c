//! Why there is no image.

use thiserror::Error;

use super::address::Tile;
use super::openexr_error::OpenExrError;

/// Why there is no image.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ImageError {
    /// The bytes are no OpenEXR file, too large, or damaged.
    #[error(transparent)]
    OpenExr(#[from] OpenExrError),
    /// There is no picture in the file.
    #[error("no part has the channels R, G and B; the channels are {found}")]
    NoPicture {
        /// The channels that there are.
        found: String,
    },
    /// Some channels of a layer are there and some are not.
    #[error("channel {channel} is missing or does not hold floats")]
    MissingChannel {
        /// The channel.
        channel: &'static str,
    },
    /// The attribute `clerestory` is not the metadata of an image.
    #[error("the attribute clerestory is not the metadata of an image: {message}")]
    BadMetadata {
        /// What is wrong.
        message: String,
    },
    /// An image must have pixels.
    #[error("the image has {width} x {height} pixels; each must be 1 to 2147483647")]
    BadSize {
        /// Pixels across.
        width: u64,
        /// Pixels down.
        height: u64,
    },
    /// A layer has too few or too many pixels.
    #[error("layer {layer} has {found} pixels; the image has {expected}")]
    WrongPixelCount {
        /// The layer.
        layer: &'static str,
        /// Pixels in it.
        found: usize,
        /// Pixels of the image.
        expected: usize,
    },
    /// A value is infinite or not a number.
    #[error("layer {layer} is not finite at pixel ({x}, {y})")]
    NotFinite {
        /// The layer.
        layer: &'static str,
        /// Column.
        x: u32,
        /// Row.
        y: u32,
    },
    /// A standard error is negative.
    #[error("layer stderr is negative at pixel ({x}, {y})")]
    NegativeStandardError {
        /// Column.
        x: u32,
        /// Row.
        y: u32,
    },
    /// The metadata count the tiles of another image.
    #[error("the metadata count {found} tiles of {tile_size} pixels; this image has {expected}")]
    WrongTileCount {
        /// Edge of a tile.
        tile_size: u32,
        /// Tiles counted.
        found: u64,
        /// Tiles of this size that the image has.
        expected: u64,
    },
    /// A tile does not fit the grid of the image.
    #[error("tile {index} is {found:?}; in this image it is {expected:?}")]
    WrongTile {
        /// Its number.
        index: u32,
        /// Its pixels.
        found: Tile,
        /// What they should be.
        expected: Option<Tile>,
    },
}
