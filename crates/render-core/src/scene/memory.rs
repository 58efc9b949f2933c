//! How much memory a scene takes, before any is taken: what it is made of is counted from its description and from the headers of
//! its files.
//!
//! A scene file of a few lines can ask for millions of triangles, and a file of a few kilobytes can hold a picture of gigabytes. The numbers here
//! are upper bounds of what building takes at its peak, and of what checking takes, which sorts nothing into hierarchies. The test
//! `allocations` compares both with what is allocated.

use std::collections::BTreeSet;
use std::fmt;

use glam::DVec2;

use super::assets::texture_path;
use super::build::check_budget;
use super::build_panes::{face_path, faces};
use super::bundle::SceneBundle;
use super::description::{
    MaterialDescription, MeshDescription, MeshSource, PaneDescription, ProfileDescription, ReflectanceDescription,
};
use super::error::SceneError;
use super::limits::{MAX_COEFFICIENTS, MAX_TEXELS, MAX_TRIANGLES};
use super::mesh_file::{MeshFile, MeshFormat};
use super::picture_size::{PictureSize, picture_size};
use super::profile::procedural_grid;

/// Bytes of all that is not counted: names, materials, lights.
const SMALL_THINGS: u64 = 64 << 10;

/// What is done with a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SceneUse {
    /// Its parts are decoded and checked, as a coordinator does.
    Check,
    /// It is built, to be rendered.
    Build,
}

/// What a scene is made of, and how much memory that takes.
#[derive(Clone, Debug)]
pub struct SceneMemory {
    asset_bytes: u64,
    parts: Vec<Part>,
}

/// Things of one kind in one place of a scene.
#[derive(Clone, Debug)]
struct Part {
    path: String,
    count: u64,
    kind: Kind,
    /// Bytes while it is decoded, which are free again before the next is.
    decoding: u64,
    /// Bytes for as long as the scene is checked.
    checked: u64,
    /// Bytes that building takes besides.
    sorted: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Triangles,
    Texels,
    Coefficients,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Triangles => "triangles",
            Self::Texels => "texels",
            Self::Coefficients => "spline coefficients",
        }
    }
}

impl SceneMemory {
    /// Counts what a scene is made of. Files that cannot be read count as nothing: decoding them says what is wrong.
    pub fn of(bundle: &SceneBundle) -> Self {
        let description = bundle.description();
        let mut parts = textures(bundle);
        let mut files = BTreeSet::new();
        for (index, mesh) in description.meshes.iter().enumerate() {
            parts.push(mesh_part(bundle, index, mesh, &mut files));
        }
        for (index, pane) in description.panes.iter().enumerate() {
            parts.extend(pane_parts(bundle, index, pane, &mut files));
        }
        Self { asset_bytes: bundle.assets().values().map(|asset| asset.bytes().len() as u64).sum(), parts }
    }

    /// Bytes that a use of the scene takes at its peak, its files among them.
    pub fn bytes(&self, scene_use: SceneUse) -> u64 {
        let kept = |part: &Part| match scene_use {
            SceneUse::Check => part.checked,
            SceneUse::Build => part.checked + part.sorted,
        };
        let decoding = self.parts.iter().map(|part| part.decoding).max().unwrap_or(0);
        self.parts.iter().map(kept).fold(SMALL_THINGS + self.asset_bytes + decoding, u64::saturating_add)
    }

    /// Refuses a scene whose use would take more than `limit` bytes. `way_out` says what can be done about the limit, as an alternative to a
    /// smaller scene.
    ///
    /// # Errors
    ///
    /// [`SceneError::Value`] with the place of what takes most, or with what there are more of than any scene may have.
    pub fn check(&self, scene_use: SceneUse, limit: u64, way_out: &str) -> Result<(), SceneError> {
        self.check_counts()?;
        let needed = self.bytes(scene_use);
        let of_part = |part: &Part| match scene_use {
            SceneUse::Check => part.checked + part.decoding,
            SceneUse::Build => part.checked + part.decoding + part.sorted,
        };
        if needed <= limit {
            return Ok(());
        }
        let Some(largest) = self.parts.iter().max_by_key(|part| of_part(part)) else {
            let (found, limit) = (Bytes(needed), Bytes(limit));
            return Err(SceneError::Value {
                path: "$".to_owned(),
                found: format!("files of {found}"),
                expected: format!("at most {limit}, or {way_out}"),
            });
        };
        let verb = match scene_use {
            SceneUse::Check => "check",
            SceneUse::Build => "build",
        };
        let name = largest.kind.name();
        let Part { path, count, .. } = largest;
        let rest = needed - of_part(largest).min(needed);
        let share = limit.saturating_sub(rest) as f64 / of_part(largest).max(1) as f64;
        let fitting = round_down((*count as f64 * share) as u64);
        let at_most = if fitting == 0 {
            format!("fewer {name}, here and elsewhere")
        } else {
            format!("at most {fitting} {name}")
        };
        Err(SceneError::Value {
            path: path.clone(),
            found: format!("{count} {name}: the scene takes {} to {verb}", Bytes(needed)),
            expected: format!("{at_most}, with which it takes {} at most; or {way_out}", Bytes(limit)),
        })
    }

    /// Refuses a scene of more triangles, texels or coefficients than any has.
    pub(super) fn check_counts(&self) -> Result<(), SceneError> {
        let count = |kind: Kind| {
            let counts = self.parts.iter().filter(|part| part.kind == kind).map(|part| part.count);
            usize::try_from(counts.fold(0, u64::saturating_add)).unwrap_or(usize::MAX)
        };
        check_budget(count(Kind::Texels), MAX_TEXELS, "texels in all textures", "materials")?;
        check_budget(count(Kind::Triangles), MAX_TRIANGLES, "triangles in all meshes", "meshes")?;
        check_budget(count(Kind::Coefficients), MAX_COEFFICIENTS, "spline coefficients in all panes", "panes")
    }
}

fn textures(bundle: &SceneBundle) -> Vec<Part> {
    let mut seen = BTreeSet::new();
    let materials = bundle.description().materials.iter();
    let textures = materials.filter_map(|(name, material)| match material {
        MaterialDescription::Diffuse { reflectance: ReflectanceDescription::Texture { file } } => {
            seen.insert(file.as_str()).then_some((name, file))
        }
        _ => None,
    });
    let part = |(name, file): (&String, &String)| {
        let PictureSize { pixels, decoded_bytes, .. } = size(bundle, file);
        Part {
            path: texture_path(name),
            count: pixels,
            kind: Kind::Texels,
            decoding: decoded_bytes,
            checked: TEXEL_BYTES * pixels,
            sorted: 0,
        }
    };
    textures.map(part).collect()
}

/// Bytes of a decoded texel.
const TEXEL_BYTES: u64 = 12;

fn size(bundle: &SceneBundle, file: &str) -> PictureSize {
    bundle.assets().get(file).and_then(|asset| picture_size(asset.bytes()).ok()).unwrap_or_default()
}

fn mesh_part<'a>(
    bundle: &'a SceneBundle,
    index: usize,
    mesh: &'a MeshDescription,
    files: &mut BTreeSet<&'a str>,
) -> Part {
    let counted = |file: &str, format: MeshFormat| {
        let opened = bundle.assets().get(file).and_then(|asset| MeshFile::open(format, asset.bytes()).ok());
        opened.map_or([0; 2], |file| [file.vertices() as u64, file.triangles() as u64])
    };
    let (source, [vertices, triangles], decoded) = match &mesh.source {
        MeshSource::Inline { positions, triangles, .. } => {
            ("inline.triangles", [positions.len() as u64, triangles.len() as u64], true)
        }
        MeshSource::Waves(waves) => {
            let [columns, rows] = waves.cells.map(|cells| u64::from(cells) + 1);
            ("waves.cells", [columns * rows, waves.triangles() as u64], true)
        }
        MeshSource::Ply { file } => ("ply.file", counted(file, MeshFormat::Ply), files.insert(file)),
        MeshSource::Obj { file } => ("obj.file", counted(file, MeshFormat::Obj), files.insert(file)),
    };
    let is_smooth = match bundle.description().materials.get(&mesh.material) {
        Some(MaterialDescription::Diffuse { .. }) | None => false,
        Some(MaterialDescription::Dielectric { .. } | MaterialDescription::Mirror { .. }) => true,
    };
    let is_textured = matches!(
        bundle.description().materials.get(&mesh.material),
        Some(MaterialDescription::Diffuse { reflectance: ReflectanceDescription::Texture { .. } })
    );
    let from_file = matches!(mesh.source, MeshSource::Ply { .. } | MeshSource::Obj { .. });
    let decoding = match mesh.source {
        _ if !decoded => 0,
        MeshSource::Inline { .. } | MeshSource::Waves(_) => {
            DECODED_VERTEX * vertices + DECODED_TRIANGLE * triangles + WAVES_VERTEX * vertices
        }
        MeshSource::Ply { .. } | MeshSource::Obj { .. } => READ_VERTEX * vertices + READ_TRIANGLE * triangles,
    };
    let kept_file = if from_file && decoded { DECODED_VERTEX * vertices + DECODED_TRIANGLE * triangles } else { 0 };
    let surface = match (is_smooth, is_textured) {
        (true, _) => SMOOTH_TRIANGLE,
        (_, true) => TEXTURED_TRIANGLE,
        (false, false) => 0,
    };
    let passing = KEPT_TRIANGLE * triangles + if is_smooth { SMOOTH_PASSING * triangles + 24 * vertices } else { 0 };
    Part {
        path: format!("meshes[{index}].source.{source}"),
        count: triangles,
        kind: Kind::Triangles,
        decoding: decoding + passing,
        checked: kept_file
            + GROWTH * (PLACED_VERTEX * vertices + PLACED_TRIANGLE * triangles)
            + (surface + COMPARED_TRIANGLE) * triangles,
        sorted: SORTED_TRIANGLE * triangles,
    }
}

/// Bytes of a vertex and of a triangle in a decoded mesh.
const DECODED_VERTEX: u64 = 24 + 24 + 16;
const DECODED_TRIANGLE: u64 = 12;

/// Bytes of a vertex that computing waves takes besides.
const WAVES_VERTEX: u64 = 24;

/// Bytes of a vertex and of a triangle that reading a file takes besides what it decodes to.
const READ_VERTEX: u64 = 80;
const READ_TRIANGLE: u64 = 80;

/// Bytes of a vertex and of a triangle of the scene.
const PLACED_VERTEX: u64 = 24;
const PLACED_TRIANGLE: u64 = 12;

/// Arrays that grow are twice as large as what is in them, at the most, and while they move there is also what they were.
const GROWTH: u64 = 3;

/// Bytes of a triangle's corners in its file, while it is placed.
const KEPT_TRIANGLE: u64 = 36;

/// Bytes of a triangle that may lie face to face with another, while they are compared.
const COMPARED_TRIANGLE: u64 = 52;

/// Bytes of a triangle that refracts or mirrors: its normals, its area.
const SMOOTH_TRIANGLE: u64 = 72 + 8;

/// Bytes of such a triangle while these are computed.
const SMOOTH_PASSING: u64 = 24;

/// Bytes of a triangle with a texture.
const TEXTURED_TRIANGLE: u64 = 48;

/// Bytes of a triangle that hierarchies take while they are built; what is made afterwards takes less.
const SORTED_TRIANGLE: u64 = 560;

fn pane_parts<'a>(
    bundle: &'a SceneBundle,
    index: usize,
    pane: &'a PaneDescription,
    files: &mut BTreeSet<&'a str>,
) -> Vec<Part> {
    let part = |(face, profile, size): (_, &'a ProfileDescription, DVec2)| {
        let path = face_path(index, face);
        let (path, count, decoding, map) = match profile {
            ProfileDescription::HeightMap { file, .. } => {
                let picture = self::size(bundle, file);
                let decoded = if files.insert(file) { 1 } else { 0 };
                let map = MAP_VALUE * picture.pixels * decoded;
                (path + ".height_map.file", picture.pixels, picture.decoded_bytes * decoded, map)
            }
            procedural => {
                let coefficients = procedural_grid(procedural, size).map_or(1, |[columns, rows]| columns * rows);
                (path, coefficients as u64, 0, 0)
            }
        };
        let checked = map + COEFFICIENT_BYTES * count;
        Part { path, count, kind: Kind::Coefficients, decoding, checked, sorted: 0 }
    };
    faces(pane).into_iter().map(part).collect()
}

/// Bytes of a value of a decoded height map.
const MAP_VALUE: u64 = 4;

/// Bytes of a coefficient of a face with its bounds, whose arrays grow, and of what it is computed from: panes are built side by side.
const COEFFICIENT_BYTES: u64 = 200;

/// A number with two digits that count.
fn round_down(number: u64) -> u64 {
    let unit = 10_u64.pow(number.checked_ilog10().unwrap_or(0).saturating_sub(1));
    number / unit * unit
}

/// A number of bytes as people read it.
struct Bytes(u64);

impl fmt::Display for Bytes {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        const MIB: f64 = (1_u64 << 20) as f64;
        let mib = self.0 as f64 / MIB;
        if mib < 1024.0 {
            write!(formatter, "{:.0} MiB", mib.max(1.0))
        } else {
            write!(formatter, "{:.1} GiB", mib / 1024.0)
        }
    }
}
