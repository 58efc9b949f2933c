//! Scenes: the JSON description, its validation, its assets, and the immutable scene built from them.
//!
//! `description` holds the types of the file; `docs/scene-format.md` is its manual. A description plus the bytes of
//! the assets that it names is a [`SceneBundle`]: what is hashed, sent to the farm, and built.

pub mod assets;
mod build;
mod build_meshes;
mod build_panes;
mod build_step;
pub mod bundle;
pub mod camera;
mod canonical;
pub mod description;
pub mod hash;

#[cfg(test)]
mod hostile_scenes;
#[cfg(test)]
pub(crate) mod malformed_scenes;
pub mod memory;
mod mesh;
mod mesh_file;
mod missing_light;
pub mod nave;
mod obj;
mod parse;
mod ply;
mod polygon;
mod profile;
mod random;
pub mod schema;
#[cfg(test)]
mod shipped_scenes;
mod surface;
mod syntax;
mod text;
mod triangles;
mod validate;
mod validate_faces;
mod validate_integrator;
mod validate_places;
pub(crate) mod visibility;
pub mod water;
mod waves;

pub use crate::settings::{AssetProblem, SceneError, limits};
pub use assets::asset_names;
pub use build::Scene;
pub use build_step::BuildStep;
pub use bundle::{Asset, SceneBundle, load};
pub use camera::Camera;
pub use canonical::{SceneHeader, canonical_json};
pub use description::SceneDescription;
pub use hash::{ContentHash, SceneHash};
pub use memory::SceneMemory;
pub use schema::scene_schema;
pub use surface::MeshSurface;
pub use validate_places::Obstacles;
