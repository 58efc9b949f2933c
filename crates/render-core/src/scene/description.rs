//! The things of a scene, as they stand in its file.
//!
//! A choice is an object with one member named after it (`{"sphere": {...}}`), so that every error can name the exact
//! JSON path. A choice without parameters is a string (`"flat"`). Unknown members are errors. Ranges that a JSON Schema
//! can express stand here; `validate` checks them and everything else.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::paint::PaintDescription;
use crate::geometry::FaceCrossing;

pub use crate::bsdf::MaterialDescription;
pub use crate::light::LightDescription;
pub use crate::settings::{SCENE_FORMAT_VERSION, Triple};
pub use crate::texture::ColourDescription;

/// Size of the image in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FilmDescription {
    /// Pixels across, 1 to 16384.
    #[schemars(range(min = 1, max = 16384))]
    pub width: u32,
    /// Pixels down, 1 to 16384.
    #[schemars(range(min = 1, max = 16384))]
    pub height: u32,
}

/// The camera. Pixels are square; row 0 is the top of the picture. `up` must not be parallel to the line of sight;
/// right in the picture is (`look_at` - `position`) cross `up`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum CameraDescription {
    /// A pinhole camera.
    Perspective {
        /// The pinhole.
        position: Triple,
        /// A point in the middle of the picture.
        look_at: Triple,
        /// A direction that points up in the picture.
        up: Triple,
        /// Angle between the top and the bottom of the picture, degrees; more than 0, at most 179.
        #[schemars(range(max = 179.0), extend("exclusiveMinimum" = 0))]
        vertical_field_of_view: f64,
    },
    /// Parallel rays.
    Orthographic {
        /// A point on the plane from which the rays start; its ray is the middle of the picture.
        position: Triple,
        /// A point in the middle of the picture.
        look_at: Triple,
        /// A direction that points up in the picture.
        up: Triple,
        /// Height of the picture in the scene, metres.
        #[schemars(extend("exclusiveMinimum" = 0))]
        height: f64,
    },
}

/// A triangle mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshDescription {
    /// A short name, used in messages; no two meshes share one.
    #[schemars(length(min = 1, max = 200))]
    pub name: String,
    /// Name of a material.
    pub material: String,
    /// Where the triangles come from.
    pub source: MeshSource,
    /// Three rows of four numbers, by which (x, y, z, 1) is multiplied before everything else.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub matrix: Option<[[f64; 4]; 3]>,
    /// Uniform scale, applied after the matrix.
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub scale: f64,
    /// Rotation about the fixed axes x, then y, then z, degrees, applied after the scale; positive angles turn
    /// counterclockwise for whoever looks against the axis.
    #[serde(default)]
    pub rotate: Triple,
    /// Translation, metres, applied last.
    #[serde(default)]
    pub translate: Triple,
}

fn one() -> f64 {
    1.0
}

/// Where the triangles of a mesh come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum MeshSource {
    /// Written into the scene file.
    Inline {
        /// Vertex positions, metres.
        #[schemars(length(min = 3))]
        positions: Vec<Triple>,
        /// Vertex indices from 0, three for each triangle.
        #[schemars(length(min = 1))]
        triangles: Vec<[u32; 3]>,
        /// Texture coordinates, one for each vertex.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        texture_coordinates: Vec<[f64; 2]>,
        /// Normals of any length, one for each vertex, which make dielectrics and mirrors smooth.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        normals: Vec<Triple>,
    },
    /// A Stanford PLY file, relative to the scene file.
    Ply {
        /// The file.
        file: String,
    },
    /// A Wavefront OBJ file, relative to the scene file; its materials are ignored.
    Obj {
        /// The file.
        file: String,
        /// One part of it, from 0: the faces of one object or group that have one material. All of it where no part is
        /// named.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        part: Option<u32>,
    },
    /// A primitive of a mesh in a glTF file (.gltf or .glb), relative to the scene file; its material is ignored.
    Gltf(GltfSource),
    /// Waves on water, or ripples of sand.
    Waves(WaveDescription),
}

/// A primitive of a mesh in a glTF file. v = 0 of its texture coordinates is the bottom of a picture, as everywhere in
/// a scene; the file has it at the top.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GltfSource {
    /// The file.
    pub file: String,
    /// Other files that it refers to and that its triangles need.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub files: Vec<String>,
    /// Number of the mesh, from 0.
    #[serde(default)]
    pub mesh: u32,
    /// Number of the primitive in the mesh, from 0.
    #[serde(default)]
    pub primitive: u32,
}

/// A rectangle about the origin with 16 plane waves in random directions, moving as on deep water.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WaveDescription {
    /// Extent along x and y, metres; 0.001 to 100000.
    #[schemars(inner(range(min = 0.001, max = 100_000.0)))]
    pub size: [f64; 2],
    /// Cells of two triangles along x and y, 1 to 4096.
    #[schemars(inner(range(min = 1, max = 4096)))]
    pub cells: [u32; 2],
    /// Shortest and longest wavelength, metres.
    #[schemars(inner(range(min = 0.0)))]
    pub wavelengths: [f64; 2],
    /// Root of the mean square of z, metres; 0 to 1000.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub height: f64,
    /// Seed of directions, lengths and phases.
    #[serde(default)]
    pub seed: u64,
    /// Time at which the waves are seen, seconds.
    #[serde(default)]
    pub time: f64,
}

/// A window pane: a slab of glass with two displaced faces in an opaque, black edge.
///
/// In the pane's frame the front face is `z = h1(x, y)` and the back face `z = thickness + h2(x, y)`, within the
/// outline: the rectangle `|x| <= width/2`, `|y| <= height/2`, or a convex polygon in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PaneDescription {
    /// A short name, used in messages; no two panes share one.
    #[schemars(length(min = 1, max = 200))]
    pub name: String,
    /// Centre of the undisplaced front face.
    pub centre: Triple,
    /// Direction of the pane's x axis.
    pub x_axis: Triple,
    /// Direction of the pane's y axis; made perpendicular to `x_axis`. z is x cross y.
    pub y_axis: Triple,
    /// Extent along x, metres; 0.001 to 100.
    #[schemars(range(min = 0.001, max = 100.0))]
    pub width: f64,
    /// Extent along y, metres; 0.001 to 100.
    #[schemars(range(min = 0.001, max = 100.0))]
    pub height: f64,
    /// Corners of a convex polygon within that rectangle, in the pane's x and y, metres, counterclockwise, 3 to 64.
    /// Default: the rectangle.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 64))]
    pub outline: Vec<[f64; 2]>,
    /// The sheet from which the pane is cut, which has its relief: `front` and `back` are left out then.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sheet: Option<SheetCut>,
    /// Distance between the undisplaced faces, metres; more than 0, at most 1. The displaced faces must not touch.
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0))]
    pub thickness: f64,
    /// Index of refraction of the glass, 1 to 3.
    #[serde(default = "crate::bsdf::crown_glass")]
    #[schemars(range(min = 1.0, max = 3.0))]
    pub index_of_refraction: f64,
    /// Absorption coefficient of red, green and blue light, per metre: light that travels `d` metres in the glass is
    /// multiplied by `exp(-absorption * d)`.
    #[serde(default)]
    #[schemars(inner(range(min = 0.0)))]
    pub absorption: Triple,
    /// Coloured layers on the faces, such as a flash of ruby or silver stain.
    #[serde(default, skip_serializing_if = "crate::settings::is_default")]
    pub layers: LayersDescription,
    /// Vitreous paint on one of its faces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub paint: Option<Box<PaintDescription>>,
    /// Profile of the front face.
    #[serde(default)]
    pub front: ProfileDescription,
    /// Profile of the back face.
    #[serde(default)]
    pub back: ProfileDescription,
    /// How rays find where they cross the faces.
    #[serde(default, skip_serializing_if = "crate::settings::is_default")]
    pub crossing: FaceCrossing,
    /// Where bodies overlap, the place belongs to the one with the highest priority, -1000 to 1000.
    #[serde(default, skip_serializing_if = "crate::settings::is_default")]
    #[schemars(range(min = -1000, max = 1000))]
    pub priority: i32,
}

/// A sheet of glass from which panes are cut: the relief of both of its faces.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SheetDescription {
    /// Extent along x, metres; 0.001 to 100.
    #[schemars(range(min = 0.001, max = 100.0))]
    pub width: f64,
    /// Extent along y, metres; 0.001 to 100.
    #[schemars(range(min = 0.001, max = 100.0))]
    pub height: f64,
    /// Profile of the front face.
    #[serde(default)]
    pub front: ProfileDescription,
    /// Profile of the back face.
    #[serde(default)]
    pub back: ProfileDescription,
}

/// Where on a sheet a pane is cut.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SheetCut {
    /// Name of the sheet.
    pub name: String,
    /// The place of the sheet that becomes the pane's centre, metres from the middle of the sheet.
    #[serde(default)]
    pub at: [f64; 2],
    /// Direction of the pane's x axis on the sheet, from the sheet's x towards its y, degrees.
    #[serde(default)]
    pub rotation: f64,
}

/// Coloured layers on the faces of a pane, much thinner than the glass and of its index of refraction. Light that
/// crosses one at the angle `a` to the normal, in the glass, is multiplied by `exp(-absorbance / cos a)`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LayersDescription {
    /// Absorbance (natural logarithm) of red, green and blue light on the front face, 0 to 100.
    #[schemars(inner(range(min = 0.0, max = 100.0)))]
    pub front: Triple,
    /// The same on the back face.
    #[schemars(inner(range(min = 0.0, max = 100.0)))]
    pub back: Triple,
}

/// The height field of a face, in metres along the pane's z axis: a uniform cubic B-spline over a grid of coefficients.
///
/// The procedural profiles compute those coefficients; `docs/scene-format.md` gives their formulas. Front and back face
/// of a pane differ even when their parameters and seeds are equal.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ProfileDescription {
    /// No displacement.
    #[default]
    Flat,
    /// Concentric rings of crown glass.
    Crown {
        /// Centre of the rings in the pane's x and y, metres; often outside the pane.
        centre: [f64; 2],
        /// Distance between rings, metres.
        #[schemars(extend("exclusiveMinimum" = 0))]
        wavelength: f64,
        /// Amplitude of the rings, metres.
        amplitude: f64,
        /// Seed of the irregularities.
        #[serde(default)]
        seed: u64,
    },
    /// Parallel ripples of cylinder-blown glass.
    Cylinder {
        /// Direction of the cylinder's axis from x towards y, degrees: the ripples run along it.
        axis: f64,
        /// Distance between ripples, metres.
        #[schemars(extend("exclusiveMinimum" = 0))]
        wavelength: f64,
        /// Amplitude of the ripples, metres.
        amplitude: f64,
        /// Seed of the irregularities.
        #[serde(default)]
        seed: u64,
    },
    /// One Gaussian dent or bump.
    Bump {
        /// Centre in the pane's x and y, metres.
        centre: [f64; 2],
        /// Standard deviations along its own axes, metres.
        #[schemars(inner(range(min = 0.0)))]
        radius: [f64; 2],
        /// Direction of its first axis from x towards y, degrees.
        #[serde(default)]
        rotation: f64,
        /// Height at the centre, metres; negative for a dent.
        amplitude: f64,
    },
    /// Irregular dimples of hammered or rolled cathedral glass.
    Hammered {
        /// Typical distance between dimples, metres.
        #[schemars(extend("exclusiveMinimum" = 0))]
        wavelength: f64,
        /// Amplitude, metres.
        amplitude: f64,
        /// Seed of the pattern.
        #[serde(default)]
        seed: u64,
    },
    /// Measured heights; the values are the coefficients of the spline.
    HeightMap {
        /// EXR with a channel `Y` or `R` (heights, times `scale`) or 16-bit grey PNG (0 to 1, times `scale`). Column i
        /// of row j, counted from the top of the file, is the coefficient at `u = (i+1/2)/columns`,
        /// `v = (j+1/2)/rows`; `x = (u-1/2) width`, `y = (v-1/2) height`.
        file: String,
        /// Metres for each unit in the file.
        #[serde(default = "one")]
        scale: f64,
        /// Added after scaling, metres.
        #[serde(default)]
        offset: f64,
    },
}
