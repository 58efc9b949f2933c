//! Scenes as data: their things, the checks of these, and what is built from them.
//!
//! `description` holds the types of the things in a scene file. With the bytes of the files that they name, they are
//! built into an immutable [`Scene`]. It knows no method that renders it.

pub(crate) mod asset_uses;
pub mod assets;
mod at_triangles;
mod bodies;
mod build;
mod build_meshes;
mod build_panes;
mod build_step;
pub mod camera;
mod contacts;
pub mod description;
mod direct_light;
mod framing;
pub mod hash;
pub mod import;
pub(crate) mod looks;
pub mod media;
pub mod memory;
pub(crate) mod mesh;
mod mesh_file;
mod mesh_format;
mod mesh_surface;
mod obj;
pub(crate) mod openings;
mod paint;
pub(crate) mod painting;
pub(crate) mod pane_tree;
mod parts;
mod ply;
mod polygon;
pub(crate) mod profile;
mod profile_limits;
pub(crate) mod random;
mod shading_point;
mod sheet;
mod shining;
mod surface_coverage;
mod text;
mod validate;
mod validate_faces;
mod validate_places;
pub(crate) mod visibility;
pub(crate) mod waves;
pub mod window;

pub use crate::settings::{AssetProblem, SceneError, limits};
pub use assets::{Asset, Assets};
pub use build::{Scene, decode_radiance};
pub use build_meshes::decode_textures;
pub use build_step::BuildStep;
pub use camera::Camera;
pub use framing::{View, view_of};
pub use hash::{ContentHash, SceneHash};
pub use memory::SceneMemory;
pub use mesh_surface::MeshSurface;
pub use paint::{PaintDescription, PaintedFace};
pub use parts::SceneParts;
pub use shading_point::ShadingPoint;
pub use validate_places::Obstacles;
