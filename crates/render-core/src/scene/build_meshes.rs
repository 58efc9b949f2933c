//! The triangles of a scene: decoded, placed, and with what they reflect.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use glam::{DVec2, DVec3, UVec3};

use super::assets::{Assets, asset_bytes, texture_uses};
use super::description::{MeshDescription, MeshSource};
use super::mesh::{Placement, TriangleMesh, is_degenerate};
use super::mesh_file::MeshFile;
use super::mesh_format::MeshFormat;
use super::mesh_surface::{MeshSurface, Surface};
use super::parts::SceneParts;
use crate::settings::JsonPath;
use crate::settings::SceneError;
use crate::settings::check::check_budget;
use crate::settings::limits::{MAX_COORDINATE, MAX_TRIANGLES};
use crate::texture::{Bitmap, Bitmaps};

/// Decodes the textures of all materials, each file once.
pub(super) fn decode_textures<'a>(scene: SceneParts<'a>, assets: &Assets) -> Result<Bitmaps<'a>, SceneError> {
    let mut bitmaps = Bitmaps::new();
    for (path, file) in texture_uses(scene) {
        if bitmaps.contains_key(file) {
            continue;
        }
        let bitmap = asset_bytes(assets, file).and_then(Bitmap::decode);
        let bitmap = bitmap.map_err(|problem| SceneError::Asset { path, name: file.to_owned(), problem })?;
        bitmaps.insert(file, Arc::new(bitmap));
    }
    Ok(bitmaps)
}

/// Triangles of all meshes.
pub(super) struct Meshes<'a> {
    scene: SceneParts<'a>,
    assets: &'a Assets,
    bitmaps: &'a Bitmaps<'a>,
    /// Decoded files, which several meshes may share.
    files: BTreeMap<(MeshFormat, &'a str), Arc<TriangleMesh>>,
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
        let files = BTreeMap::new();
        Self { scene, assets, bitmaps, files, positions: Vec::new(), triangles: Vec::new(), surfaces: Vec::new() }
    }

    /// Adds mesh `index` of the scene file.
    pub(super) fn add(&mut self, index: usize, description: &'a MeshDescription) -> Result<(), SceneError> {
        let mesh = self.decode(index, description)?;
        check_budget(self.triangles.len() + mesh.triangles.len(), MAX_TRIANGLES, "triangles", "meshes")?;
        check_budget(self.positions.len() + mesh.positions.len(), 3 * MAX_TRIANGLES, "vertices", "meshes")?;
        let first_vertex = self.positions.len() as u32;
        let first_triangle = self.triangles.len() as u32;
        self.place_vertices(index, &mesh, Placement::of(description))?;
        let kept = self.place_triangles(index, &mesh, first_vertex)?;
        let surface = self.surface(index, description, &mesh, &kept)?;
        let triangles = kept.len() as u32;
        self.surfaces.push(MeshSurface {
            name: description.name.clone(),
            first_triangle,
            triangles,
            omitted_triangles: mesh.triangles.len() as u32 - triangles,
            surface,
        });
        Ok(())
    }

    fn decode(&mut self, index: usize, description: &'a MeshDescription) -> Result<Arc<TriangleMesh>, SceneError> {
        let (format, file) = match &description.source {
            MeshSource::Inline { positions, triangles, texture_coordinates, normals } => {
                return Ok(Arc::new(TriangleMesh {
                    positions: positions.iter().copied().map(DVec3::from).collect(),
                    triangles: triangles.clone(),
                    texture_coordinates: texture_coordinates.iter().copied().map(DVec2::from).collect(),
                    normals: normals.iter().copied().map(DVec3::from).collect(),
                }));
            }
            MeshSource::Waves(waves) => return Ok(Arc::new(waves.mesh())),
            MeshSource::Ply { file } => (MeshFormat::Ply, file),
            MeshSource::Obj { file } => (MeshFormat::Obj, file),
        };
        if let Some(mesh) = self.files.get(&(format, file.as_str())) {
            return Ok(mesh.clone());
        }
        let unusable = |problem| SceneError::Asset {
            path: format!("meshes[{index}].source.{}.file", format.name()),
            name: file.clone(),
            problem,
        };
        let bytes = asset_bytes(self.assets, file).map_err(unusable)?;
        let opened = MeshFile::open(format, bytes).map_err(unusable)?;
        let mesh = Arc::new(opened.decode().map_err(unusable)?);
        self.files.insert((format, file), mesh.clone());
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
        first_vertex: u32,
    ) -> Result<Vec<[u32; 3]>, SceneError> {
        let mut kept = Vec::new();
        for (number, &triangle) in mesh.triangles.iter().enumerate() {
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
        if kept.is_empty() {
            let found = format!("{} triangles, none with an area", mesh.triangles.len());
            return Err(mesh_error(index, found, "at least one triangle with an area"));
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
        let texture = match material.texture() {
            Some(_) => Some(texture_corners(index, description, mesh, triangles)?),
            None => None,
        };
        let (normals, areas) = if material.is_delta() {
            let (normals, areas) = self.delta_corners(index, description, mesh, triangles)?;
            (normals, Some(areas))
        } else {
            (None, None)
        };
        Ok(Surface { bsdf, texture, normals, areas })
    }

    /// The normals at the corners of the last triangles, and the area of all triangles up to each.
    #[expect(clippy::type_complexity, reason = "two lists")]
    fn delta_corners(
        &self,
        index: usize,
        description: &MeshDescription,
        mesh: &TriangleMesh,
        triangles: &[[u32; 3]],
    ) -> Result<(Option<Vec<[DVec3; 3]>>, Vec<f64>), SceneError> {
        let corners = self.triangles[self.triangles.len() - triangles.len()..]
            .iter()
            .map(|triangle| triangle.map(|vertex| self.positions[vertex as usize]));
        let crosses: Vec<DVec3> = corners.map(|[a, b, c]| (b - a).cross(c - a)).collect();
        let areas = crosses.iter().scan(0.0, |sum, cross| {
            *sum += 0.5 * cross.length();
            Some(*sum)
        });
        let areas = areas.collect();
        if mesh.normals.is_empty() {
            return Ok((None, areas));
        }
        let placement = Placement::of(description);
        let placed: Option<Vec<DVec3>> =
            mesh.normals.iter().map(|normal| placement.turn(*normal).try_normalize()).collect();
        let Some(placed) = placed else {
            return Err(mesh_error(index, "a normal of no length", "normals that point somewhere, or none at all"));
        };
        let outwards = |(triangle, cross): (&[u32; 3], &DVec3)| {
            triangle.map(|vertex| {
                let normal = placed[vertex as usize];
                if normal.dot(*cross) < 0.0 { -normal } else { normal }
            })
        };
        Ok((Some(triangles.iter().zip(&crosses).map(outwards).collect()), areas))
    }
}

/// The texture coordinates of the corners of triangles.
fn texture_corners(
    index: usize,
    description: &MeshDescription,
    mesh: &TriangleMesh,
    triangles: &[[u32; 3]],
) -> Result<Vec<[DVec2; 3]>, SceneError> {
    let coordinates = &mesh.texture_coordinates;
    if coordinates.len() != mesh.positions.len() || !coordinates.iter().all(|pair| is_within(&pair.to_array())) {
        let expected = format!("one in every vertex: material \"{}\" has a texture", description.material);
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
