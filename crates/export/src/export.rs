//! From a scene to its files.

use clerestory_render_core::exchange::{ColourModel, LightModel, RadianceModel, SurfaceModel};
use clerestory_render_core::geometry::{Face, Pane as Glass};
use clerestory_render_core::scene::description::MeshDescription;
use clerestory_render_core::scene::{Scene, decode_radiance, decode_textures};
use clerestory_render_core::texture::Bitmaps;
use glam::DVec3;

use crate::approximation::{Approximation, sentences};
use crate::contents::{Contents, Light, Material, Mesh, Pane};
use crate::error::ExportError;
use crate::file_name::file_name;
use crate::materials::materials;
use crate::mesh::{has_normals, mesh};
use crate::mitsuba::Translation;
use crate::pane::Tessellation;
use crate::ply::PlyMesh;
use crate::source::Source;
use crate::texture::Pictures;
use crate::{mitsuba, scene_file};

/// Geometry moves to the origin where it lies further away than this many times its radius. Single precision then loses
/// more than two bits by the distance alone.
const FAR: f64 = 4.0;

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
    pictures: Pictures,
    translation: Translation,
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
        let camera = parts.camera.model();
        let mut pictures = Pictures::default();
        let bitmaps = decode_textures(source.parts, source.assets)?;
        let (lights, mut approximations) = lights(source, &bitmaps, origin, &mut pictures)?;
        let (materials, simpler) = materials(source, &bitmaps, &mut pictures)?;
        approximations.extend(simpler);
        let meshes = parts.meshes.iter().enumerate().map(|(index, mesh)| Mesh {
            name: mesh.name.clone(),
            file: format!("meshes/{}.ply", file_name(index, &mesh.name)),
            material: mesh.material.clone(),
            normals: has_normals(scene, index),
            coordinates: coordinates(mesh, &materials, &lights, &mut approximations),
        });
        let meshes: Vec<Mesh> = meshes.collect();
        let coloured = meshes.iter().zip(scene.meshes()).filter(|(_, surface)| surface.has_colours());
        approximations.extend(coloured.map(|(mesh, _)| Approximation {
            place: format!("meshes[{}]", mesh.name),
            by: "one colour",
            difference: "the colours of its vertices are left out",
        }));
        let mut tessellations = Vec::new();
        let mut panes = Vec::new();
        for (index, pane) in scene.panes().iter().enumerate() {
            let tessellation = Tessellation::of(pane, settings.tolerance)?;
            let file = file_name(index, &pane.name);
            let absorption = with_layers(pane);
            if absorption != pane.absorption {
                approximations.push(Approximation {
                    place: format!("panes[{}]", pane.name),
                    by: "glass of one colour",
                    difference: "its coloured layers are spread over the body, and colour light between its faces more",
                });
            }
            panes.push(Pane {
                name: pane.name.clone(),
                faces: format!("meshes/pane-{file}-faces.ply"),
                edge: format!("meshes/pane-{file}-edge.ply"),
                index_of_refraction: pane.index_of_refraction,
                absorption: absorption.to_array(),
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
            mitsuba_approximations: approximations,
            ball: ball(scene, camera.position.into(), origin),
        };
        contents.notes = notes(source, &contents);
        let translation = mitsuba::translate(&contents, &mut pictures)?;
        contents.mitsuba_approximations.extend(translation.approximations.iter().cloned());
        Ok(Self { scene, contents, tessellations, pictures, translation })
    }

    /// What others render in another way, and what they have no twin for, in sentences.
    pub fn notes(&self) -> Vec<String> {
        [self.contents.notes.clone(), sentences(&self.contents.mitsuba_approximations)].concat()
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
            write_mesh(&described.file, &mesh(self.scene, index, described.coordinates, origin))?;
        }
        let tessellated = self.scene.panes().iter().zip(&self.tessellations);
        for (described, (pane, tessellation)) in self.contents.panes.iter().zip(tessellated) {
            write_mesh(&described.faces, &tessellation.faces(pane, origin))?;
            write_mesh(&described.edge, &tessellation.edge(pane, origin))?;
        }
        for (name, bytes) in &self.pictures.files {
            write(name, bytes)?;
        }
        write("scene.json", scene_file::text(&self.contents).as_bytes())?;
        write("scene.xml", self.translation.text.as_bytes())?;
        Ok(written)
    }
}

/// The lights, and those that no model describes.
fn lights(
    source: &Source<'_>,
    bitmaps: &Bitmaps<'_>,
    origin: DVec3,
    pictures: &mut Pictures,
) -> Result<(Vec<Light>, Vec<Approximation>), ExportError> {
    let mut lights = Vec::new();
    let mut left_out = Vec::new();
    for light in source.parts.lights {
        let Some(mut model) = light.model(bitmaps) else {
            let place = format!("lights[{}]", light.name());
            left_out.push(Approximation { place, by: "darkness", difference: "no model describes this kind of light" });
            continue;
        };
        let mut picture = None;
        if let LightModel::Environment { radiance: RadianceModel::Picture { file, .. } } = &mut model {
            let decoded = decode_radiance(source.assets, file)?;
            *file = pictures.radiance(&decoded)?;
            picture = Some(decoded);
        }
        let model = model.seen_from(origin).try_map_textures(&mut |texture| pictures.texture(texture))?;
        lights.push(Light { name: light.name().to_owned(), model, picture });
    }
    Ok((lights, left_out))
}

/// Which set of texture coordinates a mesh has in its file: that of its material, or else of the light that it is.
fn coordinates(
    mesh: &MeshDescription,
    materials: &[Material],
    lights: &[Light],
    approximations: &mut Vec<Approximation>,
) -> usize {
    let material = materials.iter().find(|material| material.name == mesh.material);
    let of_material = material.and_then(|material| material.coordinates);
    let of_light = lights.iter().find_map(|light| match &light.model {
        LightModel::Mesh { mesh: name, radiance: ColourModel::Texture(texture) } if *name == mesh.name => {
            Some((&light.name, texture.coordinates))
        }
        _ => None,
    });
    if let (Some(set), Some((light, other))) = (of_material, of_light)
        && set != other
    {
        approximations.push(Approximation {
            place: format!("lights[{light}]"),
            by: "one set of texture coordinates",
            difference: "the material of its mesh uses the other, which is written",
        });
    }
    of_material.or(of_light.map(|(_, set)| set)).unwrap_or_default()
}

/// The absorption coefficient of a body that lets as much light straight through as a pane with the layers on its
/// faces.
fn with_layers(pane: &Glass) -> DVec3 {
    let layers = pane.layer(Face::Front, 1.0) * pane.layer(Face::Back, 1.0);
    let absorbance = layers.map(|through| -libm::log(through.max(f64::MIN_POSITIVE)));
    pane.absorption + absorbance.max(DVec3::ZERO) / pane.thickness
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
    let is_glass = |material: &Material| {
        matches!(
            material.model,
            SurfaceModel::Dielectric { .. } | SurfaceModel::RoughDielectric { .. } | SurfaceModel::ThinSheet { .. }
        )
    };
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
    let is_soft = |mesh: &&Mesh| {
        let material = contents.materials.iter().find(|material| material.name == mesh.material);
        let is_soft = |model| matches!(model, &SurfaceModel::Metal { .. } | &SurfaceModel::Coated { .. });
        mesh.normals && material.is_some_and(|material| is_soft(&material.model))
    };
    if contents.meshes.iter().any(|mesh| is_soft(&mesh)) {
        notes.push("rounded meshes show their triangles in grazing light: others have no soft terminator".to_owned());
    }
    notes
}
