//! `light`: forward light tracing alone. What the camera sees straight on a surface comes from light subpaths, and the
//! rest from path tracing.

mod settings;

pub use settings::LightTracingSettings;
