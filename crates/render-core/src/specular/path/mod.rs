//! `path`: path tracing alone. Light through glass is found by chance, that of point lights not at all.

mod settings;

pub use settings::PathSettings;
