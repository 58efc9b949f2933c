//! From a scene to its files.

use std::sync::Arc;

use clerestory_render_core::exchange::SurfaceModel;
use clerestory_render_core::scene::{Assets, Scene, SceneParts, decode_textures};
use clerestory_render_core::texture::Bitmap;
use glam::DVec3;

use crate::contents::{Contents, Light, Material, Mesh, Pane};
use crate::error::ExportError;
use crate::file_name::file_name;
use crate::mesh::{has_normals, mesh};
use crate::pane::Tessellation;
use crate::ply::PlyMesh;
use crate::{mitsuba, scene_file, texture};

/// Geometry moves to the origin where it lies further away than this many times its radius. Single precision then loses
/// more than two bits by the distance alone.
const FAR: f64 = 4.0;

/// A scene that is exported.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its things.
    pub parts: SceneParts<'a>,
    /// The files that it names.
    pub assets: &'a Assets,
    /// What was built of them.
    pub scene: &'a Scene,
    /// Largest number of vertices between camera and light.
    pub max_depth: u32,
    /// The light path expression to which it is restricted.
    pub path_filter: Option<&'a str>,
}

/// How a scene is exported.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExportSettings {
    /// Largest distance of the triangles of a pane from its faces, metres.
    pub tolerance: f64,
}

/// A scene that is ready to be written.
#[derive(Debug)]
pub struct Export<'a> {
    scene: &'a Scene,
    contents: Contents,
    tessellations: Vec<Tessellation>,
    /// Names and bytes.
    textures: Vec<(String, Vec<u8>)>,
}

/// What has been written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Written {
    /// Triangles of all files.
    pub triangles: u64,
    /// Triangles that were left out, since single precision leaves them no area.
    pub omitted_triangles: u64,
}

impl<'a> Export<'a> {
    /// Collects what a scene has.
    ///
    /// # Errors
    ///
    /// [`ExportError`] when a thing cannot be exported, or a texture cannot be read.
    pub fn new(source: &Source<'a>, settings: &ExportSettings) -> Result<Self, ExportError> {
        let Source { parts, scene, .. } = *source;
        let origin = origin(scene);
        let unknown = |place: String, kind: &str, thing| ExportError::Kind { place, kind: kind.to_owned(), thing };
        let camera = parts.camera.model().ok_or_else(|| unknown("camera".to_owned(), "a camera", "camera"))?;
        let mut lights = Vec::new();
        for (index, light) in parts.lights.iter().enumerate() {
            let model =
                light.model().ok_or_else(|| unknown(format!("lights[{index}]"), light.kind(), "kind of light"))?;
            lights.push(Light { name: light.name().to_owned(), model: model.seen_from(origin) });
        }
        let (materials, textures) = materials(source)?;
        let meshes = parts.meshes.iter().enumerate().map(|(index, mesh)| Mesh {
            name: mesh.name.clone(),
            file: format!("meshes/{}.ply", file_name(index, &mesh.name)),
            material: mesh.material.clone(),
            normals: has_normals(scene, index),
        });
        let meshes: Vec<Mesh> = meshes.collect();
        let mut tessellations = Vec::new();
        let mut panes = Vec::new();
        for (index, pane) in scene.panes().iter().enumerate() {
            let tessellation = Tessellation::of(pane, settings.tolerance)?;
            let file = file_name(index, &pane.name);
            panes.push(Pane {
                name: pane.name.clone(),
                faces: format!("meshes/pane-{file}-faces.ply"),
                edge: format!("meshes/pane-{file}-edge.ply"),
                index_of_refraction: pane.index_of_refraction,
                absorption: pane.absorption.to_array(),
                error: tessellation.error,
            });
            tessellations.push(tessellation);
        }
        let mut contents = Contents {
            name: source.name.to_owned(),
            origin: origin.to_array(),
            film: parts.film,
            camera: camera.clone().seen_from(origin),
            max_depth: source.max_depth,
            materials,
            lights,
            meshes,
            panes,
            notes: Vec::new(),
            ball: ball(scene, camera.position.into(), origin),
        };
        contents.notes = notes(source, &contents);
        mitsuba::check(&contents)?;
        Ok(Self { scene, contents, tessellations, textures })
    }

    /// What others render in another way, in sentences.
    pub fn notes(&self) -> &[String] {
        &self.contents.notes
    }

    /// Gives each file to `write`, by its name relative to a folder.
    ///
    /// # Errors
    ///
    /// The first error of `write`.
    pub fn write<E>(&self, mut write: impl FnMut(&str, &[u8]) -> Result<(), E>) -> Result<Written, E> {
        let origin = DVec3::from(self.contents.origin);
        let mut written = Written::default();
        let mut write_mesh = |name: &str, mesh: &PlyMesh| {
            written.triangles += mesh.triangles();
            written.omitted_triangles += mesh.omitted();
            write(name, &mesh.encode())
        };
        for (index, described) in self.contents.meshes.iter().enumerate() {
            write_mesh(&described.file, &mesh(self.scene, index, origin))?;
        }
        let tessellated = self.scene.panes().iter().zip(&self.tessellations);
        for (described, (pane, tessellation)) in self.contents.panes.iter().zip(tessellated) {
            write_mesh(&described.faces, &tessellation.faces(pane, origin))?;
            write_mesh(&described.edge, &tessellation.edge(pane, origin))?;
        }
        for (name, bytes) in &self.textures {
            write(name, bytes)?;
        }
        write("scene.json", scene_file::text(&self.contents).as_bytes())?;
        write("scene.xml", mitsuba::text(&self.contents).as_bytes())?;
        Ok(written)
    }
}

/// Names and bytes of files.
type Files = Vec<(String, Vec<u8>)>;

/// The materials that meshes have, and the files of their pictures.
fn materials(source: &Source<'_>) -> Result<(Vec<Material>, Files), ExportError> {
    let bitmaps = decode_textures(source.parts, source.assets)?;
    let mut known: Vec<(Arc<Bitmap>, String)> = Vec::new();
    let mut textures = Vec::new();
    let mut materials = Vec::new();
    for (index, (name, material)) in source.parts.materials.iter().enumerate() {
        if !source.parts.meshes.iter().any(|mesh| mesh.material == *name) {
            continue;
        }
        let model = material.model(&bitmaps).ok_or_else(|| ExportError::Kind {
            place: format!("materials.{name}"),
            kind: material.kind().to_owned(),
            thing: "kind of material",
        })?;
        let mut file_of = |bitmap: Arc<Bitmap>| -> Result<String, ExportError> {
            if let Some((_, file)) = known.iter().find(|(other, _)| Arc::ptr_eq(other, &bitmap)) {
                return Ok(file.clone());
            }
            let (bytes, ending) = texture::encode(&bitmap)?;
            let file = format!("textures/{:04}.{ending}", textures.len());
            textures.push((file.clone(), bytes));
            known.push((bitmap, file.clone()));
            Ok(file)
        };
        let model = model.try_map_pictures(&mut file_of)?;
        materials.push(Material { name: name.clone(), id: file_name(index, name), model });
    }
    Ok((materials, textures))
}

/// The point that becomes the origin: that of the scene, or a round one in the middle of what lies far from it.
fn origin(scene: &Scene) -> DVec3 {
    let Some([min, max]) = scene.bounds() else { return DVec3::ZERO };
    let (middle, radius) = ((min + max) / 2.0, (max - min).length() / 2.0);
    if min.abs().max(max.abs()).max_element() <= FAR * radius {
        return DVec3::ZERO;
    }
    let step = libm::exp2(libm::log2(radius).floor());
    (middle / step).round() * step
}

/// A ball around everything but distant lights.
fn ball(scene: &Scene, camera: DVec3, origin: DVec3) -> (DVec3, f64) {
    let lights = scene.lights().iter().filter_map(|light| light.bounding_box());
    let boxes = scene.bounds().into_iter().chain(lights);
    let [min, max] = boxes.fold([camera; 2], |[min, max], [lower, upper]| [min.min(lower), max.max(upper)]);
    ((min + max) / 2.0 - origin, ((max - min).length() / 2.0).max(f64::MIN_POSITIVE))
}

/// What others render in another way.
fn notes(source: &Source<'_>, contents: &Contents) -> Vec<String> {
    let mut notes = Vec::new();
    if contents.origin != [0.0; 3] {
        let [x, y, z] = contents.origin;
        notes.push(format!("the point ({x}, {y}, {z}) of the scene is the origin of the exported one"));
    }
    if let Some(filter) = source.path_filter {
        notes.push(format!("the path filter \"{filter}\" is left out: others render all paths"));
    }
    let is_glass = |material: &Material| matches!(material.model, SurfaceModel::Dielectric { .. });
    if !contents.panes.is_empty() || contents.materials.iter().any(is_glass) {
        notes.push(
            "path tracers find light through glass by chance: small lights make noise, and point lights nothing"
                .to_owned(),
        );
    }
    if contents.panes.iter().any(Pane::is_absorbing) {
        notes.push(
            "Mitsuba moves rays off surfaces by about 0.1 mm: thin coloured glass absorbs some percent less there"
                .to_owned(),
        );
    }
    notes
}
