//! The largest scene that is accepted. Scenes come from strangers, so every size is checked before memory is taken.

/// Bytes of a scene file. Larger meshes belong into PLY files.
pub const MAX_SCENE_BYTES: usize = 8 << 20;

/// Bytes of an asset.
pub const MAX_ASSET_BYTES: u64 = 256 << 20;

/// Bytes of the name of an asset, a mesh, a pane, a light or a material.
pub const MAX_NAME_BYTES: usize = 200;

/// Pixels along an edge of the image, of a texture or of a height map.
pub const MAX_IMAGE_EDGE: u32 = 16_384;

/// Bytes of one decoded picture.
pub const MAX_PICTURE_BYTES: u64 = 1 << 30;

/// Texels of all textures of a scene.
pub const MAX_TEXELS: usize = 1 << 27;

/// Triangles of all meshes of a scene.
pub const MAX_TRIANGLES: usize = 1 << 25;

/// Spline coefficients of all panes of a scene.
pub const MAX_COEFFICIENTS: usize = 1 << 25;

/// Panes of a scene.
pub const MAX_PANES: usize = 1 << 17;

/// Leaded windows of a scene.
pub const MAX_WINDOWS: usize = 1024;

/// Lights of a scene.
pub const MAX_LIGHTS: usize = 4096;

/// Meshes and panes of an imported file.
pub const MAX_IMPORTED_THINGS: usize = 1 << 17;

/// Shortest and longest edge of a pane, metres.
pub const PANE_EDGES: [f64; 2] = [1e-3, 100.0];

/// Triangles of all meshes that are lights.
pub const MAX_SHINING_TRIANGLES: usize = 1 << 20;

/// Distance of geometry and cameras from the origin along each axis, metres.
pub const MAX_COORDINATE: f64 = 1e6;

/// Distance of lights from the origin along each axis, metres.
pub const MAX_LIGHT_COORDINATE: f64 = 1e12;

/// Radiance, W/(m2 sr), or intensity, W/sr, of a light in each channel.
pub const MAX_EMISSION: f64 = 1e30;

/// Radiance in a picture of an environment, before it is scaled.
pub const MAX_PICTURE_RADIANCE: f64 = 1e24;
