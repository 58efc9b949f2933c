//! What all settings in a scene file share: places in the file, errors, limits and checks of ranges. The macro `kinds`
//! declares a registry.

pub(crate) mod check;
pub mod error;
mod kinds;
pub mod limits;
pub(crate) mod path;
pub(crate) mod pattern;
pub(crate) mod schema_place;

pub use check::Check;
pub use error::{AssetProblem, SceneError};
pub use path::JsonPath;

pub(crate) use kinds::kinds;

/// Three numbers: a point or direction in metres, or linear Rec.709 red, green, blue.
pub type Triple = [f64; 3];

/// The newest version of the scene format. This build reads all versions from 1.
pub const SCENE_FORMAT_VERSION: u32 = 2;

/// Whether this build reads a version of the scene format.
pub(crate) fn is_readable(version: u64) -> bool {
    (1..=u64::from(SCENE_FORMAT_VERSION)).contains(&version)
}

/// Settings that few scenes change are left out where they are as usual, so that the hashes of other scenes stay.
pub(crate) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}
