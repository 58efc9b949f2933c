//! Light at smooth surfaces: Snell and Fresnel.

pub mod dielectric;
pub mod interface;

pub use interface::Interface;
