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
//! themselves. What no model describes is an error that names it. What others render in another way is a note.

mod contents;
mod error;
mod export;
mod file_name;
mod light_frame;
mod mesh;
mod mitsuba;
mod pane;
mod ply;
mod scene_file;
mod texture;
mod xml;

pub use error::ExportError;
pub use export::{Export, ExportSettings, Source, Written};
