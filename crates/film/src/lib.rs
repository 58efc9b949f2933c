//! The film: sampler, passes, tiles, nodes, the merge tree, OpenEXR and error metrics.
//!
//! The film of a frame is a fixed binary tree for each tile, anchored at pass 0. Its leaves are the passes; a node is
//! the sum of its two children in that order, whoever computes it. A tile with P passes is the sum of its maximal
//! aligned nodes, from left to right. So the image does not depend on who rendered what, or when.
//!
//! Nothing here knows of scenes or of rendering.

pub mod adaptive;
pub mod address;
pub mod counters;
pub mod decomposition;
pub mod exposure;
pub mod file_format;
pub mod image;
mod image_error;
mod image_file;
mod image_layers;
mod image_writer;
pub mod layer;
pub mod metrics;
pub mod node;
pub mod openexr;
mod openexr_error;
mod openexr_header;
pub mod partial;
mod partial_error;
mod partial_format;
mod partial_header;
pub mod picture;
pub mod preview;
pub mod reduced;
pub mod rounds;
pub mod rows;
pub mod sampler;
pub mod sampling;
pub mod store;
pub mod targets;
#[cfg(test)]
mod test_nodes;
pub mod tree;

pub use adaptive::{Adaptation, PILOT_ROUND, Share};
pub use address::{LARGEST_TILE, MOST_LIGHT_PIXELS, NodeAddress, PassRange, Plane, Tile, TileGrid, smallest_tile};
pub use counters::Counters;
pub use decomposition::{Decomposition, decompose};
pub use exposure::{AutomaticExposure, MeanLuminance};
pub use image::{FrameImage, ImageMetadata};
pub use image_error::ImageError;
pub use image_layers::ImageLayers;
pub use image_writer::{ImageWriter, ROWS_PER_BLOCK, first_bytes};
pub use layer::{Layer, LayerError, LayerKind, read_layer};
pub use metrics::flip::{FlipComparison, FlipError, mean_flip};
pub use metrics::{
    CompareError, Comparison, Metrics, NoiseMeasure, ReferenceMeasure, ReferenceSummary, RelativeNoise, compare,
    mean_squared_standard_error, relative_noise,
};
pub use node::{FirstHitLayers, FirstHitSums, MergeError, Node, NodeError, NodeLayers, NonFinite, PassSums};
pub use openexr::DecodeBudget;
pub use openexr_error::OpenExrError;
pub use partial_error::PartialError;
pub use partial_format::{Expectation, PartialHeader, Rendered};
pub use picture::{picture_rows, picture_size};
pub use preview::{Exposure, PreviewError, PreviewSettings, ToneCurve, encode_pixels, encode_png};
pub use reduced::ReducedImage;
pub use rounds::Rounds;
pub use rows::{ImageRows, LayerChoice};
pub use sampler::{SampleStream, SamplerSettings, TrialStream};
pub use sampling::{Sampling, SamplingError};
pub use store::StoreError;
pub use targets::{InvalidTarget, RoundError, Target, Targets};
pub use tree::{FilmTile, InsertError, SumError, TileSum};
