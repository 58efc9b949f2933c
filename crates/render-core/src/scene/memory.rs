//! The memory of a scene, known before it is allocated. It is counted from the description and from the headers of the
//! files.
//!
//! A scene file of a few lines can request millions of triangles. A file of a few kilobytes can hold a picture of
//! gigabytes. The number here is an upper bound of what building takes at its peak. The test `allocations` compares it
//! with what is allocated.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use glam::DVec2;

use super::asset_uses::{environment_uses, picture_bytes, texture_uses};
use super::assets::Assets;
use super::description::{MeshDescription, MeshSource, ProfileDescription};
use super::mesh_file::MeshFiles;
use super::mesh_format::{FileMesh, MeshFormat, MeshPart};
use super::parts::SceneParts;
use super::profile::procedural_grid;
use super::sheet::profile_uses;
use crate::light::{EnvironmentMap, LightDescription};
use crate::settings::SceneError;
use crate::settings::check::check_budget;
use crate::settings::limits::{MAX_COEFFICIENTS, MAX_TEXELS, MAX_TRIANGLES};
use crate::texture::PictureKey;
use crate::texture::picture_size::{PictureSize, picture_size};

/// Bytes of all that is not counted: names, materials, lights.
const SMALL_THINGS: u64 = 64 << 10;

/// What a scene is made of, and how much memory that takes.
#[derive(Clone, Debug)]
pub struct SceneMemory {
    asset_bytes: u64,
    /// Of panes without their relief.
    pane_bytes: u64,
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
    /// Bytes until the scene is built.
    kept: u64,
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
    pub fn of(scene: SceneParts<'_>, assets: &Assets) -> Self {
        let mut files = Files {
            scene,
            assets,
            have_specular_meshes: scene.meshes.iter().any(|mesh| scene.is_specular(mesh)),
            shining: scene.shining(),
            mesh_files: MeshFiles::new(assets),
            meshes: BTreeMap::new(),
            pictures: BTreeMap::new(),
        };
        let mut parts = textures(&mut files);
        parts.extend(environments(&mut files));
        for (index, mesh) in scene.meshes.iter().enumerate() {
            parts.push(mesh_part(&mut files, index, mesh));
        }
        let mut heights = BTreeSet::new();
        for (path, profile, size) in profile_uses(&scene) {
            parts.push(face_part(&mut files, path, profile, size, &mut heights));
        }
        let pane_bytes = PANE_BYTES * scene.panes.len() as u64;
        Self { asset_bytes: assets.values().map(|asset| asset.bytes().len() as u64).sum(), pane_bytes, parts }
    }

    /// Bytes that building the scene takes at its peak, its files among them.
    pub fn bytes(&self) -> u64 {
        let decoding = self.parts.iter().map(|part| part.decoding).max().unwrap_or(0);
        self.parts
            .iter()
            .map(|part| part.kept)
            .fold(SMALL_THINGS + self.asset_bytes + self.pane_bytes + decoding, u64::saturating_add)
    }

    /// Refuses a scene that takes more than `limit` bytes to build. `way_out` says what can be done about the limit, as
    /// an alternative to a smaller scene.
    ///
    /// # Errors
    ///
    /// [`SceneError::Value`] with the place of what takes most, or with what there are more of than any scene may have.
    pub fn check(&self, limit: u64, way_out: &str) -> Result<(), SceneError> {
        self.check_counts()?;
        let needed = self.bytes();
        let of_part = |part: &Part| part.kept + part.decoding;
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
            found: format!("{count} {name}: the scene takes {} to build", Bytes(needed)),
            expected: format!("{at_most}, with which it takes {} at most; or {way_out}", Bytes(limit)),
        })
    }

    /// Refuses a scene of more triangles, texels or coefficients than any has.
    ///
    /// # Errors
    ///
    /// [`SceneError::Value`] with the number that is too large.
    pub fn check_counts(&self) -> Result<(), SceneError> {
        let count = |kind: Kind| {
            let counts = self.parts.iter().filter(|part| part.kind == kind).map(|part| part.count);
            usize::try_from(counts.fold(0, u64::saturating_add)).unwrap_or(usize::MAX)
        };
        check_budget(count(Kind::Texels), MAX_TEXELS, "texels in all textures", "materials")?;
        check_budget(count(Kind::Triangles), MAX_TRIANGLES, "triangles in all meshes", "meshes")?;
        check_budget(count(Kind::Coefficients), MAX_COEFFICIENTS, "spline coefficients in all panes", "panes")
    }
}

/// What the files of a scene hold. Each is looked at once, however often the scene names it.
struct Files<'a> {
    scene: SceneParts<'a>,
    assets: &'a Assets,
    /// Whether any mesh refracts or mirrors, so that all are compared with it.
    have_specular_meshes: bool,
    /// The lights that are meshes, by the names of the meshes.
    shining: BTreeMap<&'a str, &'a LightDescription>,
    mesh_files: MeshFiles<'a>,
    /// Vertices and triangles of parts of files.
    meshes: BTreeMap<(MeshFormat, &'a str, MeshPart), [u64; 2]>,
    pictures: BTreeMap<(&'a str, Option<u32>), PictureSize>,
}

impl<'a> Files<'a> {
    /// The vertices and triangles of a part of a file, and whether it has not been looked at before.
    fn mesh(&mut self, mesh: FileMesh<'a>) -> ([u64; 2], bool) {
        let key = (mesh.format, mesh.file, mesh.part);
        if let Some(counts) = self.meshes.get(&key) {
            return (*counts, false);
        }
        let size = self.mesh_files.file(mesh).and_then(|file| file.size(mesh.part));
        let counts = size.unwrap_or_default().map(|count| count as u64);
        self.meshes.insert(key, counts);
        (counts, true)
    }

    /// The size of a picture: a file, or one of the pictures in it.
    fn picture(&mut self, file: &'a str, image: Option<u32>) -> PictureSize {
        let read = || picture_bytes(self.assets, file, image).and_then(|bytes| picture_size(&bytes)).ok();
        *self.pictures.entry((file, image)).or_insert_with(|| read().unwrap_or_default())
    }
}

fn textures<'a>(files: &mut Files<'a>) -> Vec<Part> {
    let mut seen = BTreeSet::new();
    let textures = texture_uses(files.scene).filter(|(_, picture)| seen.insert(*picture));
    let part = |(path, picture): (String, PictureKey<'a>)| {
        let PictureSize { pixels, decoded_bytes } = files.picture(picture.file, picture.image);
        Part { path, count: pixels, kind: Kind::Texels, decoding: decoded_bytes, kept: TEXEL_BYTES * pixels }
    };
    textures.map(part).collect()
}

fn environments<'a>(files: &mut Files<'a>) -> Vec<Part> {
    let uses = environment_uses(files.scene);
    let part = |(path, file): (String, &'a str)| {
        let PictureSize { pixels, decoded_bytes } = files.picture(file, None);
        let kept = EnvironmentMap::bytes(pixels);
        Part { path, count: pixels, kind: Kind::Texels, decoding: decoded_bytes, kept }
    };
    uses.map(part).collect()
}

/// Bytes of a decoded texel.
const TEXEL_BYTES: u64 = 12;

fn mesh_part<'a>(files: &mut Files<'a>, index: usize, mesh: &'a MeshDescription) -> Part {
    let (source, ([vertices, triangles], decoded)) = match &mesh.source {
        MeshSource::Inline { positions, triangles, .. } => {
            ("inline.triangles".to_owned(), ([positions.len() as u64, triangles.len() as u64], true))
        }
        MeshSource::Waves(waves) => {
            let [columns, rows] = waves.cells.map(|cells| u64::from(cells) + 1);
            ("waves.cells".to_owned(), ([columns * rows, waves.triangles() as u64], true))
        }
        from_file => match from_file.file() {
            Some(file) => (file.place(), files.mesh(file)),
            None => (String::new(), ([0; 2], false)),
        },
    };
    let is_specular = files.scene.is_specular(mesh);
    let material = files.scene.materials.get(&mesh.material);
    let light = files.shining.get(mesh.name.as_str());
    let mut textures = material.map_or(Vec::new(), |material| material.textures());
    textures.extend(light.and_then(|light| light.texture()));
    let sets: BTreeSet<u32> = textures.iter().map(|texture| texture.texture.coordinates).collect();
    let from_file = mesh.source.file().is_some();
    let decoding = match (decoded, from_file) {
        (false, _) => 0,
        (true, false) => DECODED_VERTEX * vertices + DECODED_TRIANGLE * triangles + WAVES_VERTEX * vertices,
        (true, true) => READ_VERTEX * vertices + READ_TRIANGLE * triangles,
    };
    let kept_file = if from_file && decoded { DECODED_VERTEX * vertices + DECODED_TRIANGLE * triangles } else { 0 };
    let uses_normals = material.is_some_and(|material| material.uses_normals());
    let has_tangents = material.is_some_and(|material| material.normal_map().is_some());
    let may_have_colours = from_file && material.is_some_and(|material| material.uses_colours());
    let parts = [
        (is_specular, SPECULAR_TRIANGLE),
        (uses_normals, ROUNDED_TRIANGLE),
        (has_tangents, TANGENT_TRIANGLE),
        (may_have_colours, COLOURED_TRIANGLE),
        (light.is_some(), SHINING_TRIANGLE),
    ];
    let surface: u64 = parts.iter().filter(|(is_there, _)| *is_there).map(|(_, bytes)| bytes).sum();
    let surface = surface + TEXTURED_TRIANGLE * sets.len() as u64;
    let compared = if files.have_specular_meshes { COMPARED_TRIANGLE } else { 0 };
    let is_measured = is_specular || uses_normals;
    let passing =
        KEPT_TRIANGLE * triangles + if is_measured { MEASURED_PASSING * triangles + 24 * vertices } else { 0 };
    let passing = passing + if has_tangents { TANGENT_PASSING * triangles } else { 0 };
    Part {
        path: format!("meshes[{index}].source.{source}"),
        count: triangles,
        kind: Kind::Triangles,
        decoding: decoding + passing,
        kept: kept_file
            + GROWTH * (PLACED_VERTEX * vertices + PLACED_TRIANGLE * triangles)
            + (surface + compared + SORTED_TRIANGLE) * triangles,
    }
}

/// Bytes of a vertex and of a triangle in a decoded mesh.
const DECODED_VERTEX: u64 = 24 + 24 + 16 + 16 + 32 + 16;
const DECODED_TRIANGLE: u64 = 12;

/// Bytes of a vertex that computing waves takes besides.
const WAVES_VERTEX: u64 = 24;

/// Bytes of a vertex and of a triangle that reading a file takes besides what it decodes to.
const READ_VERTEX: u64 = 104;
const READ_TRIANGLE: u64 = 80;

/// Bytes of a vertex and of a triangle of the scene.
const PLACED_VERTEX: u64 = 24;
const PLACED_TRIANGLE: u64 = 12;

/// Arrays that grow are twice as large as what is in them, at the most, and while they move there is also what they
/// were.
const GROWTH: u64 = 3;

/// Bytes of a triangle's corners in its file, while it is placed.
const KEPT_TRIANGLE: u64 = 36;

/// Bytes of a triangle that may lie face to face with another, while they are compared: its number, 4 bytes in an array
/// that grows; three entries of 20 bytes and a little; and its number in five arrays of one cell.
const COMPARED_TRIANGLE: u64 = 4 * GROWTH + 62 + 4 * 5;

/// Bytes of a triangle that methods search: its area.
const SPECULAR_TRIANGLE: u64 = 8;

/// Bytes of a triangle with normals at its corners.
const ROUNDED_TRIANGLE: u64 = 72;

/// Bytes of a triangle with tangents at its corners, and what computing them takes besides.
const TANGENT_TRIANGLE: u64 = 48;
const TANGENT_PASSING: u64 = 600;

/// Bytes of a triangle with colours at its corners.
const COLOURED_TRIANGLE: u64 = 48;

/// Bytes of a triangle that shines: its corners with texture coordinates, its area, two nodes of a tree, and what that
/// is built from.
const SHINING_TRIANGLE: u64 = 72 + 48 + 8 + 2 * 136 + 8 + 2 * 128;

/// Bytes of a triangle of either kind while these are computed.
const MEASURED_PASSING: u64 = 24;

/// Bytes of a triangle for each set of texture coordinates that its textures use.
const TEXTURED_TRIANGLE: u64 = 48;

/// Bytes of a triangle that hierarchies take while they are built; what is made afterwards takes less.
const SORTED_TRIANGLE: u64 = 560;

/// A face of a pane or of a sheet.
fn face_part<'a>(
    files: &mut Files<'a>,
    path: String,
    profile: &'a ProfileDescription,
    size: DVec2,
    heights: &mut BTreeSet<&'a str>,
) -> Part {
    let (path, count, decoding, map) = match profile {
        ProfileDescription::HeightMap { file, .. } => {
            let picture = files.picture(file, None);
            let decoded = if heights.insert(file) { 1 } else { 0 };
            let map = MAP_VALUE * picture.pixels * decoded;
            (path + ".height_map.file", picture.pixels, picture.decoded_bytes * decoded, map)
        }
        procedural => {
            let coefficients = procedural_grid(procedural, size).map_or(1, |[columns, rows]| columns * rows);
            (path, coefficients as u64, 0, 0)
        }
    };
    let kept = map + COEFFICIENT_BYTES * count;
    Part { path, count, kind: Kind::Coefficients, decoding, kept }
}

/// Bytes of a pane beside its relief: its outline, a node of the tree of panes, two portals, and hierarchies while they
/// are built.
const PANE_BYTES: u64 = 4096;

/// Bytes of a value of a decoded height map.
const MAP_VALUE: u64 = 4;

/// Bytes of a coefficient of a face with its bounds, whose arrays grow, and of what it is computed from: panes are
/// built side by side.
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

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::Asset;
    use super::*;
    use crate::document::malformed_scenes::valid_scene;
    use crate::document::{SceneBundle, SceneDescription};

    /// The valid scene with this many meshes from one file of a triangle, of a material.
    fn of_one_file(meshes: usize, material: &str) -> SceneBundle {
        let mut scene = valid_scene();
        scene["panes"] = json!([]);
        scene["materials"]["glass"] = json!({"dielectric": {}});
        let mesh = |index: usize| {
            json!({
                "name": index.to_string(), "material": material, "source": {"obj": {"file": "a.obj"}},
                "translate": [0, 0, index]
            })
        };
        scene["meshes"] = (0..meshes).map(mesh).collect();
        let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
        let file = Asset::new(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".to_vec());
        SceneBundle::from_parts(description, BTreeMap::from([("a.obj".to_owned(), file)])).unwrap()
    }

    #[test]
    fn a_file_is_counted_once_however_many_meshes_name_it() {
        let bundle = of_one_file(1000, "stone");
        let memory = bundle.memory().unwrap();
        assert!(memory.parts.iter().all(|part| part.count == 1));
        let decoded = memory.parts.iter().filter(|part| part.kept > memory.parts[1].kept);
        assert_eq!(decoded.map(|part| part.path.as_str()).collect::<Vec<_>>(), ["meshes[0].source.obj.file"]);
        let mut files = Files {
            scene: bundle.description().parts(),
            assets: bundle.assets(),
            have_specular_meshes: false,
            shining: BTreeMap::new(),
            mesh_files: MeshFiles::new(bundle.assets()),
            meshes: BTreeMap::new(),
            pictures: BTreeMap::new(),
        };
        let mesh = bundle.description().meshes[0].source.file().unwrap();
        let looked_at: Vec<_> = (0..3).map(|_| files.mesh(mesh)).collect();
        assert_eq!(looked_at, [([3, 1], true), ([3, 1], false), ([3, 1], false)]);
    }

    #[test]
    fn triangles_are_compared_only_where_something_refracts_or_mirrors() {
        let [stone, glass] = ["stone", "glass"].map(|material| of_one_file(1000, material).memory().unwrap());
        let more = glass.bytes() - stone.bytes();
        assert!(more >= 1000 * (COMPARED_TRIANGLE + SPECULAR_TRIANGLE), "{more}");
    }
}
