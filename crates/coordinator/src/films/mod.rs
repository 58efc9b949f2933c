//! Films: partials are accepted, nodes merged, rounds recorded, images made, lost nodes repaired and garbage collected.

pub(crate) mod acceptance;
pub(crate) mod assets;
mod batches;
pub(crate) mod convergence;
mod error;
mod frame;
pub(crate) mod garbage_collection;
pub(crate) mod images;
pub(crate) mod live;
pub(crate) mod pass_sharing;
pub(crate) mod previews;
mod reader;
pub(crate) mod repair;
pub(crate) mod rounds;

pub(crate) use error::FilmError;
pub(crate) use reader::FilmReader;
