//! The triangles of a scene: decoded, placed, and with what they reflect.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use glam::{DVec2, DVec3, UVec3, Vec4};

use super::asset_uses::{picture_bytes, texture_uses};
use super::assets::Assets;
use super::description::{MeshDescription, MeshSource};
use super::mesh::{Placement, TriangleMesh, is_degenerate};
use super::mesh_file::MeshFiles;
use super::mesh_format::{MeshFormat, MeshPart};
use super::mesh_surface::{MeshSurface, Surface};
use super::parts::SceneParts;
use crate::geometry::{MappedTriangles, Tangent};
use crate::light::LightDescription;
use crate::settings::JsonPath;
use crate::settings::SceneError;
use crate::settings::check::{Quoted, check_budget};
use crate::settings::limits::{MAX_COORDINATE, MAX_TRIANGLES};
use crate::texture::{Bitmap, Bitmaps, PictureKey};

/// Decodes the textures of all materials, each file once.
///
/// # Errors
///
/// When a picture is missing or makes no sense.
pub fn decode_textures<'a>(scene: SceneParts<'a>, assets: &Assets) -> Result<Bitmaps<'a>, SceneError> {
    let mut bitmaps = Bitmaps::new();
    for (path, picture) in texture_uses(scene) {
        if bitmaps.contains_key(&picture) {
            continue;
        }
        let PictureKey { file, image, encoding } = picture;
        let decode = if image.is_some() { Bitmap::decode_in_gltf } else { Bitmap::decode };
        let bitmap = picture_bytes(assets, file, image).and_then(|bytes| decode(&bytes, encoding));
        let bitmap = bitmap.map_err(|problem| SceneError::Asset { path, name: file.to_owned(), problem })?;
        bitmaps.insert(picture, Arc::new(bitmap));
    }
    Ok(bitmaps)
}

/// Triangles of all meshes.
pub(super) struct Meshes<'a> {
    scene: SceneParts<'a>,
    bitmaps: &'a Bitmaps<'a>,
    files: MeshFiles<'a>,
    /// The lights that are meshes, by the names of the meshes.
    shining: BTreeMap<&'a str, &'a LightDescription>,
    /// Decoded parts of files, which several meshes may share.
    decoded: BTreeMap<(MeshFormat, &'a str, MeshPart), Arc<TriangleMesh>>,
    /// Positions of all vertices in the scene.
    pub(super) positions: Vec<DVec3>,
    /// All triangles that have an area.
    pub(super) triangles: Vec<[u32; 3]>,
    /// What they do to light, one for each mesh.
    pub(super) surfaces: Vec<MeshSurface>,
}

impl<'a> Meshes<'a> {
    /// No mesh yet.
    pub(super) fn new(scene: SceneParts<'a>, assets: &'a Assets, bitmaps: &'a Bitmaps<'a>) -> Self {
        Self {
            scene,
            bitmaps,
            files: MeshFiles::new(assets),
            shining: scene.shining(),
            decoded: BTreeMap::new(),
            positions: Vec::new(),
            triangles: Vec::new(),
            surfaces: Vec::new(),
        }
    }

    /// Adds mesh `index` of the scene file.
    pub(super) fn add(&mut self, index: usize, description: &'a MeshDescription) -> Result<(), SceneError> {
        let decoded = self.decode(index, description)?;
        let is_imported = description.source.is_of_building();
        let has_folds = is_imported && self.scene.is_specular(description);
        let mesh = if has_folds { decoded.without_folds() } else { Cow::Borrowed(&*decoded) };
        check_budget(self.triangles.len() + mesh.triangles.len(), MAX_TRIANGLES, "triangles", "meshes")?;
        check_budget(self.positions.len() + mesh.positions.len(), 3 * MAX_TRIANGLES, "vertices", "meshes")?;
        let first_vertex = self.positions.len() as u32;
        let first_triangle = self.triangles.len() as u32;
        let placement = Placement::of(description);
        self.place_vertices(index, &mesh, placement)?;
        let kept = self.place_triangles(index, &mesh, placement, first_vertex)?;
        // A building does without what has no area. Methods search no mesh that is empty.
        if kept.is_empty() && (!is_imported || self.scene.is_specular(description)) {
            let found = format!("{} triangles, none with an area", decoded.triangles.len());
            return Err(mesh_error(index, found, "at least one triangle with an area"));
        }
        let surface = self.surface(index, description, &mesh, &kept)?;
        let triangles = kept.len() as u32;
        self.surfaces.push(MeshSurface {
            name: description.name.clone(),
            first_triangle,
            triangles,
            omitted_triangles: decoded.triangles.len() as u32 - triangles,
            surface,
        });
        Ok(())
    }

    fn decode(&mut self, index: usize, description: &'a MeshDescription) -> Result<Arc<TriangleMesh>, SceneError> {
        let source = match &description.source {
            MeshSource::Inline { positions, triangles, texture_coordinates, normals } => {
                return Ok(Arc::new(TriangleMesh {
                    positions: positions.iter().copied().map(DVec3::from).collect(),
                    triangles: triangles.clone(),
                    texture_coordinates: texture_coordinates.iter().copied().map(DVec2::from).collect(),
                    normals: normals.iter().copied().map(DVec3::from).collect(),
                    ..TriangleMesh::default()
                }));
            }
            MeshSource::Waves(waves) => return Ok(Arc::new(waves.mesh())),
            from_file => from_file.file().expect("all other sources are files"),
        };
        let key = (source.format, source.file, source.part);
        if let Some(mesh) = self.decoded.get(&key) {
            return Ok(mesh.clone());
        }
        let decoded = self.files.file(source).and_then(|file| file.decode(source.part));
        let mesh = Arc::new(decoded.map_err(|problem| SceneError::Asset {
            path: format!("meshes[{index}].source.{}", source.place()),
            name: source.file.to_owned(),
            problem,
        })?);
        self.decoded.insert(key, mesh.clone());
        Ok(mesh)
    }

    fn place_vertices(&mut self, index: usize, mesh: &TriangleMesh, placement: Placement) -> Result<(), SceneError> {
        for &position in &mesh.positions {
            let placed = placement.apply(position);
            if !is_within(&placed.to_array()) {
                let expected = format!("within {MAX_COORDINATE} m along each axis");
                return Err(mesh_error(index, format_args!("a vertex at {placed} m"), expected));
            }
            self.positions.push(placed);
        }
        Ok(())
    }

    /// Adds the triangles that have an area, and returns which of the mesh they are.
    fn place_triangles(
        &mut self,
        index: usize,
        mesh: &TriangleMesh,
        placement: Placement,
        first_vertex: u32,
    ) -> Result<Vec<[u32; 3]>, SceneError> {
        let mut kept = Vec::new();
        let mirrors = placement.mirrors();
        for (number, &[a, b, c]) in mesh.triangles.iter().enumerate() {
            let triangle = if mirrors { [a, c, b] } else { [a, b, c] };
            if triangle.iter().any(|&vertex| vertex as usize >= mesh.positions.len()) {
                let found = format!("triangle {number} with the vertices {}", UVec3::from(triangle));
                return Err(mesh_error(index, found, format_args!("indices below {}", mesh.positions.len())));
            }
            let placed = triangle.map(|vertex| vertex + first_vertex);
            if !is_degenerate(placed.map(|vertex| self.positions[vertex as usize])) {
                self.triangles.push(placed);
                kept.push(triangle);
            }
        }
        Ok(kept)
    }

    /// What a mesh does to light, of which these triangles were kept, as the last ones so far.
    fn surface(
        &self,
        index: usize,
        description: &MeshDescription,
        mesh: &TriangleMesh,
        triangles: &[[u32; 3]],
    ) -> Result<Surface, SceneError> {
        let material = self.scene.materials.get(&description.material);
        let material = material.expect("validation knows every material");
        let bsdf = material.build(self.bitmaps);
        let opacity = material.opacity(self.bitmaps);
        let of_material = material.textures().into_iter().map(|texture| (texture, "material", &description.material));
        let light = self.shining.get(description.name.as_str()).and_then(|light| light.texture());
        let textures: Vec<_> =
            of_material.chain(light.map(|texture| (texture, "light of mesh", &description.name))).collect();
        let corners = |number: u32, coordinates: &[DVec2]| {
            let user = textures.iter().find(|(texture, ..)| texture.texture.coordinates == number);
            let user = user.map(|(_, thing, name)| format!("{thing} {}", Quoted(name)));
            user.map(|user| texture_corners(index, &user, mesh, coordinates, triangles)).transpose()
        };
        let texture = corners(0, &mesh.texture_coordinates)?;
        let second_texture = corners(1, &mesh.second_texture_coordinates)?;
        let normals = if material.uses_normals() && !mesh.normals.is_empty() {
            Some(self.normals_at_corners(index, description, mesh, triangles)?)
        } else {
            None
        };
        let tangents = material.normal_map().map(|map| {
            let coordinates = if map.texture.coordinates == 0 { &texture } else { &second_texture };
            let coordinates = coordinates.as_deref().unwrap_or_default();
            self.tangents_at_corners(description, mesh, triangles, normals.as_deref(), coordinates)
        });
        let colours = (material.uses_colours() && mesh.colours.len() == mesh.positions.len()).then(|| {
            triangles.iter().map(|corners| corners.map(|vertex| Vec4::from(mesh.colours[vertex as usize]))).collect()
        });
        let areas = material.is_searched().then(|| {
            let add = |sum: &mut f64, cross: DVec3| {
                *sum += 0.5 * cross.length();
                Some(*sum)
            };
            self.crosses(triangles.len()).scan(0.0, add).collect()
        });
        Ok(Surface { bsdf, opacity, texture, second_texture, normals, tangents, colours, areas })
    }

    /// The tangents at the corners of the last triangles: those of the file, or as all programs compute them.
    fn tangents_at_corners(
        &self,
        description: &MeshDescription,
        mesh: &TriangleMesh,
        triangles: &[[u32; 3]],
        normals: Option<&[[DVec3; 3]]>,
        coordinates: &[[DVec2; 3]],
    ) -> Vec<[Tangent; 3]> {
        if mesh.tangents.len() == mesh.positions.len() {
            let placement = Placement::of(description);
            let placed = |vertex: u32| placement.turn_tangent(mesh.tangents[vertex as usize]).as_vec4().to_array();
            return triangles.iter().map(|triangle| triangle.map(placed)).collect();
        }
        let placed = &self.triangles[self.triangles.len() - triangles.len()..];
        let corners = |triangle: usize| placed[triangle].map(|vertex| self.positions[vertex as usize]);
        let flat = |triangle: usize| {
            let [a, b, c] = corners(triangle);
            [(b - a).cross(c - a).normalize_or_zero(); 3]
        };
        let normals = |triangle: usize| normals.map_or_else(|| flat(triangle), |normals| normals[triangle]);
        MappedTriangles { corners: &corners, normals: &normals, coordinates }.tangents()
    }

    /// The vectors along the normals of the last triangles, twice as long as their areas.
    fn crosses(&self, count: usize) -> impl Iterator<Item = DVec3> {
        self.triangles[self.triangles.len() - count..].iter().map(|triangle| {
            let [a, b, c] = triangle.map(|vertex| self.positions[vertex as usize]);
            (b - a).cross(c - a)
        })
    }

    /// The normals at the corners of the last triangles, on the side of each triangle's own.
    fn normals_at_corners(
        &self,
        index: usize,
        description: &MeshDescription,
        mesh: &TriangleMesh,
        triangles: &[[u32; 3]],
    ) -> Result<Vec<[DVec3; 3]>, SceneError> {
        let placement = Placement::of(description);
        let placed: Vec<Option<DVec3>> =
            mesh.normals.iter().map(|normal| placement.turn(*normal).try_normalize()).collect();
        if placed.contains(&None) && !description.source.is_of_building() {
            return Err(mesh_error(index, "a normal of no length", "normals that point somewhere, or none at all"));
        }
        let outwards = |(triangle, cross): (&[u32; 3], DVec3)| {
            triangle.map(|vertex| {
                // Programs write none where faces without an area meet.
                let normal = placed[vertex as usize].unwrap_or_else(|| cross.normalize());
                if normal.dot(cross) < 0.0 { -normal } else { normal }
            })
        };
        Ok(triangles.iter().zip(self.crosses(triangles.len())).map(outwards).collect())
    }
}

/// The texture coordinates of the corners of triangles. `user` is what needs them.
fn texture_corners(
    index: usize,
    user: &str,
    mesh: &TriangleMesh,
    coordinates: &[DVec2],
    triangles: &[[u32; 3]],
) -> Result<Vec<[DVec2; 3]>, SceneError> {
    if coordinates.len() != mesh.positions.len() || !coordinates.iter().all(|pair| is_within(&pair.to_array())) {
        let expected = format!("one in every vertex: {user} has a texture");
        return Err(mesh_error(index, "no usable texture coordinates", expected));
    }
    Ok(triangles.iter().map(|triangle| triangle.map(|vertex| coordinates[vertex as usize])).collect())
}

/// Whether coordinates are finite and not too far away.
fn is_within(coordinates: &[f64]) -> bool {
    coordinates.iter().all(|coordinate| coordinate.abs() <= MAX_COORDINATE)
}

fn mesh_error(index: usize, found: impl fmt::Display, expected: impl fmt::Display) -> SceneError {
    let root = JsonPath::Root;
    let meshes = root.member("meshes");
    SceneError::value(&meshes.element(index).member("source"), found, expected)
}
