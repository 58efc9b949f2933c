//! Scenes as folders of files that other programs read.
//!
//! ```text
//! scene.json        everything in plain members: camera, film, materials, lights, meshes by their files
//! scene.xml         the same for Mitsuba 3
//! meshes/*.ply      binary PLY, 32-bit floats; panes as triangles with the normals of their faces
//! textures/*        PNG (8 bits, sRGB) or OpenEXR (linear)
//! ```
//!
//! [`Export`] collects what a scene has, by the [models](clerestory_render_core::exchange) that its things give of
//! themselves. What others render in another way is a note, and so is what they have no twin for.

mod approximation;
mod contents;
mod error;
mod export;
mod file_name;
mod materials;
mod mesh;
mod mitsuba;
mod pane;
mod ply;
mod scene_file;
mod source;
mod texture;

pub use error::ExportError;
pub use export::{Export, ExportSettings, Written};
pub use source::Source;
