//! Files of other programs that hold whole buildings: meshes, materials, cameras and lights.
//!
//! A scene names such a file in its `imports`. `expand` turns it into things of the scene. So everything else sees an
//! ordinary scene.

mod description;
mod expand;
mod glazing;
pub(crate) mod gltf;
mod gltf_materials;
mod leading;
mod obj_materials;
mod of_gltf;
mod of_obj;
mod old_glass;
mod things;
mod windows;

pub use description::{GlazeRule, ImportDescription, ImportFiles, ImportSource, MaterialRule, UpAxis};
pub use expand::files_of;
pub use leading::{FittedDesign, LeadingRule};
pub use old_glass::{OLD_GLASS, hex_colour, profile};
pub use things::{Expansion, FLAT_THICKNESS, ImportedCamera};
pub use windows::Window;

pub(crate) use description::check_imports;
pub(crate) use expand::expand;

#[cfg(test)]
mod tests;
