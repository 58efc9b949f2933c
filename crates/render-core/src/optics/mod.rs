//! Light at surfaces: Snell, Fresnel, materials and lights. Units are SI; colours are linear Rec.709.

pub mod dielectric;
pub mod interface;
pub mod light;
pub mod light_sampling;

pub use interface::Interface;
pub use light::{Light, LightKind};
pub use light_sampling::{Source, SourceSample};
