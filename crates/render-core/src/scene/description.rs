//! The scene file, version 1: the types that its JSON is read into.
//!
//! A choice is written as an object with one member named after it (`{"sphere": {...}}`), so that every error can name
//! the exact JSON path; a choice without parameters is a string (`"flat"`). Unknown members are errors. Ranges that a
//! JSON Schema can express stand here; `validate` checks them and everything else.

use std::collections::BTreeMap;
use std::fmt;

use schemars::JsonSchema;
use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use crate::geometry::FaceCrossing;

pub use crate::bsdf::MaterialDescription;
pub use crate::light::LightDescription;
pub use crate::settings::{SCENE_FORMAT_VERSION, Triple};
pub use crate::texture::ColourDescription;

/// A scene: geometry, materials, panes, lights, camera, integrator settings and seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneDescription {
    /// Version of the format; 1.
    #[schemars(range(min = 1, max = 1))]
    pub version: u32,
    /// A short name, shown in lists; at most 200 bytes.
    #[schemars(length(min = 1, max = 200))]
    pub name: String,
    /// Seed of every random number.
    #[serde(default)]
    pub seed: u64,
    /// Size of the image.
    pub film: FilmDescription,
    /// The camera.
    pub camera: CameraDescription,
    /// The integrator and its settings.
    pub integrator: IntegratorDescription,
    /// Light path expression over D (diffuse), R (specular reflection), T (specular transmission) and L (light), from
    /// the camera to the light, for instance `D TT L`: only matching paths are rendered. Default: all paths.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub path_filter: Option<String>,
    /// How samples are grouped.
    #[serde(default)]
    pub sampling: SamplingDescription,
    /// Materials by name.
    #[serde(default, deserialize_with = "materials_with_unique_names")]
    pub materials: BTreeMap<String, MaterialDescription>,
    /// Triangle meshes.
    #[serde(default)]
    pub meshes: Vec<MeshDescription>,
    /// Window panes, at most 4096.
    #[serde(default)]
    #[schemars(length(max = 4096))]
    pub panes: Vec<PaneDescription>,
    /// Lights, at most 4096.
    #[serde(default)]
    #[schemars(length(max = 4096))]
    pub lights: Vec<LightDescription>,
}

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

/// The integrator and its settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum IntegratorDescription {
    /// Path tracing alone: light through glass is found by chance, light of point lights through glass not at all.
    Path {
        /// Largest number of vertices between camera and light, 1 to 1000.
        #[serde(default = "default_max_depth")]
        #[schemars(range(min = 1, max = 1000))]
        max_depth: u32,
    },
    /// Path tracing, with light through panes found by sampling the cone from which the light can come.
    Cone {
        /// Largest number of vertices between camera and light, 1 to 1000.
        #[serde(default = "default_max_depth")]
        #[schemars(range(min = 1, max = 1000))]
        max_depth: u32,
    },
    /// Path tracing, with light through panes found by Fermat next event estimation.
    Fnee {
        /// Largest number of vertices between camera and light, 1 to 1000.
        #[serde(default = "default_max_depth")]
        #[schemars(range(min = 1, max = 1000))]
        max_depth: u32,
        /// How stationary paths are searched for.
        #[serde(default)]
        solver: FneeSolver,
        /// Which panes are searched.
        #[serde(default)]
        selection: PaneSelection,
        /// Largest number of trials when an inverse probability is estimated, 1 to 1000000.
        #[serde(default = "default_max_trials")]
        #[schemars(range(min = 1, max = 1_000_000))]
        max_trials: u32,
        /// Whether light that the outside of a pane reflects is searched for, too.
        #[serde(default, skip_serializing_if = "is_default")]
        reflected: bool,
    },
    /// Path tracing, with light by way of panes and smooth meshes found by specular manifold sampling.
    Sms {
        /// Largest number of vertices between camera and light, 1 to 1000.
        #[serde(default = "default_max_depth")]
        #[schemars(range(min = 1, max = 1000))]
        max_depth: u32,
        /// What a vertex on a face has to obey.
        #[serde(default)]
        constraint: ManifoldConstraint,
        /// Where walks go that leave a pane.
        #[serde(default)]
        steps: WalkSteps,
        /// What is made of the paths that are found.
        #[serde(default)]
        estimator: ManifoldEstimator,
        /// Which panes (or smooth meshes) are searched.
        #[serde(default)]
        selection: PaneSelection,
        /// Which chains of specular vertices between a surface and a light are looked for: each a word of 1 to 16 letters R
        /// (reflection) and T (transmission), from the surface to the light.
        #[serde(default = "default_chains")]
        #[schemars(length(min = 1, max = 16), inner(regex(pattern = "^[RT]{1,16}$")))]
        chains: Vec<String>,
        /// Names of the panes and smooth meshes on which chains begin; all by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        casters: Option<Vec<String>>,
        /// Names of the meshes on which their light is gathered; all by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        receivers: Option<Vec<String>>,
    },
    /// Path tracing, with one path through what refracts on the straight line to a light found by a manifold walk.
    Mnee {
        /// Largest number of vertices between camera and light, 1 to 1000.
        #[serde(default = "default_max_depth")]
        #[schemars(range(min = 1, max = 1000))]
        max_depth: u32,
        /// What happens to the paths that the walk does not find.
        #[serde(default)]
        missed: MissedPaths,
        /// Which chains of specular vertices between a surface and a light are looked for: each a word of 1 to 16 letters T
        /// (transmission).
        #[serde(default = "default_chains")]
        #[schemars(length(min = 1, max = 16), inner(regex(pattern = "^T{1,16}$")))]
        chains: Vec<String>,
        /// Names of the panes and smooth meshes on which chains begin; all by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        casters: Option<Vec<String>>,
        /// Names of the meshes on which their light is gathered; all by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        receivers: Option<Vec<String>>,
    },
    /// Path tracing, with all light over one interface, a smooth mesh, found on the curves along which surface, light and
    /// normal are coplanar.
    Conic {
        /// Largest number of vertices between camera and light, 1 to 1000.
        #[serde(default = "default_max_depth")]
        #[schemars(range(min = 1, max = 1000))]
        max_depth: u32,
        /// Which paths are found.
        #[serde(default)]
        search: ConicSearch,
        /// What happens between a surface and a light: `T`, refraction, or `R`, reflection, or both in turn.
        #[serde(default = "default_conic_chains")]
        #[schemars(length(min = 1, max = 2), inner(regex(pattern = "^[RT]$")))]
        chains: Vec<String>,
        /// Names of the smooth meshes on which it happens; all by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        casters: Option<Vec<String>>,
        /// Names of the meshes on which the light is gathered; all by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        receivers: Option<Vec<String>>,
    },
}

/// Which paths over a mesh `conic` finds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ConicSearch {
    /// All, with rays to where a surface focuses a light that has an extent.
    #[default]
    Complete,
    /// All, without these rays.
    WithoutRays,
    /// The first along the curve from the straight line to the light (Granizo-Hidalgo and Holzschuch 2024).
    Published,
}

/// What manifold next event estimation does about the paths through a pane that its walk does not find.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MissedPaths {
    /// They count when chance finds them: unbiased, but for point lights, which chance never meets.
    #[default]
    LeftToChance,
    /// They are dropped: dark where there is more than one path, and without the noise of rare finds.
    Dropped,
}

/// How a manifold walk writes Snell's law at a vertex (Zeltner et al. 2020, section 4).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ManifoldConstraint {
    /// The outgoing direction is that of the refracted ray.
    #[default]
    AngleDifference,
    /// The half vector is the normal.
    HalfVector,
}

/// Where a manifold walk goes whose next step, or whose seed, misses the pane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WalkSteps {
    /// To the border of the pane, where that gains or nothing else helps, and half as far otherwise.
    #[default]
    OnPanes,
    /// Half as far, and nowhere from a seed (Zeltner et al. 2020).
    Published,
}

/// What specular manifold sampling makes of the paths that it finds (Zeltner et al. 2020, section 4.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ManifoldEstimator {
    /// One path, weighted by an unbiased estimate of one over the probability with which a seed leads to it.
    Unbiased {
        /// Largest number of trials of that estimate, 1 to 10000000.
        #[serde(default = "default_manifold_trials")]
        #[schemars(range(min = 1, max = 10_000_000))]
        max_trials: u32,
    },
    /// All distinct paths that a fixed number of seeds finds: too dark where they find few.
    Biased {
        /// Number of seeds, 1 to 10000.
        #[schemars(range(min = 1, max = 10_000))]
        trials: u32,
    },
}

impl Default for ManifoldEstimator {
    fn default() -> Self {
        Self::Unbiased { max_trials: default_manifold_trials() }
    }
}

/// How Fermat next event estimation searches for stationary paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FneeSolver {
    /// Enumerates the paths in the deflection window: minima, saddles and maxima alike.
    #[default]
    Complete,
    /// Huan et al. 2023, Algorithm 1, with uniform seeds over both faces: finds minima almost exclusively.
    Published,
}

/// Which panes are searched for paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PaneSelection {
    /// Every pane through which light can arrive.
    #[default]
    All,
    /// The pane that the straight line to the light meets first.
    Sharp,
    /// A pane at random whenever anything blocks the straight line to the light.
    Bleed,
    /// A pane at random.
    Random,
}

fn default_max_depth() -> u32 {
    16
}

pub(super) fn default_max_trials() -> u32 {
    1000
}

/// Most specular vertices between a surface and a light that a manifold method looks for.
pub const MOST_SPECULAR_VERTICES: usize = 16;

pub(super) fn default_chains() -> Vec<String> {
    vec!["TT".to_owned()]
}

pub(super) fn default_conic_chains() -> Vec<String> {
    vec!["T".to_owned()]
}

/// As in the scenes of the authors of specular manifold sampling.
fn default_manifold_trials() -> u32 {
    10_000_000
}

/// How samples are grouped. Both numbers decide the order of summation and so the last bits of the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SamplingDescription {
    /// Samples per pixel in a pass, 1 to 65536.
    #[schemars(range(min = 1, max = 65_536))]
    pub samples_per_pass: u32,
    /// Samples per pixel that share one scramble of the low-discrepancy sequence: a power of two times
    /// `samples_per_pass`, at most 65536. The standard error is estimated from the means of such blocks.
    #[schemars(range(min = 1, max = 65_536))]
    pub samples_per_block: u32,
}

impl Default for SamplingDescription {
    fn default() -> Self {
        Self { samples_per_pass: 16, samples_per_block: 256 }
    }
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
    /// Uniform scale, applied first.
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
    },
    /// Waves on water, or ripples of sand.
    Waves(WaveDescription),
}

/// A rectangle about the origin with waves in z: 16 plane waves of equal height in random directions, moving as on deep water.
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
/// In the pane's frame the front face is `z = h1(x, y)` and the back face `z = thickness + h2(x, y)`, for
/// `|x| <= width/2`, `|y| <= height/2`.
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
    /// Profile of the front face.
    #[serde(default)]
    pub front: ProfileDescription,
    /// Profile of the back face.
    #[serde(default)]
    pub back: ProfileDescription,
    /// How rays find where they cross the faces.
    #[serde(default, skip_serializing_if = "is_default")]
    pub crossing: FaceCrossing,
}

/// Settings that few scenes change are left out where they are as usual, so that the hashes of other scenes stay.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
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

/// Reads a map of materials. A name that stands there twice is an error; a plain map would keep the last.
fn materials_with_unique_names<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<BTreeMap<String, MaterialDescription>, D::Error> {
    struct Materials;

    impl<'de> Visitor<'de> for Materials {
        type Value = BTreeMap<String, MaterialDescription>;

        fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
            formatter.write_str("an object of materials by name")
        }

        fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> Result<Self::Value, A::Error> {
            let mut materials = BTreeMap::new();
            while let Some((name, material)) = members.next_entry()? {
                if materials.contains_key(&name) {
                    return Err(A::Error::custom(format_args!("duplicate material `{name}`")));
                }
                materials.insert(name, material);
            }
            Ok(materials)
        }
    }

    deserializer.deserialize_map(Materials)
}
