//! `scene.xml` for Mitsuba 3.
//!
//! Its defaults differ from ours in many places, so every one of them is written out. The field of view is vertical,
//! the pixel filter a box, the film 32-bit floats, the index of air 1. Its materials have one side unless they are
//! wrapped in `twosided`. Shapes of lights have no material, so they reflect nothing. Its depth counts segments, ours
//! vertices.

mod element;
mod environment;
mod light_frame;
mod surface;
mod xml;

use std::collections::BTreeMap;

use clerestory_render_core::exchange::{CameraModel, ColourModel, LightModel, ProjectionModel, RadianceModel};
use glam::{DMat4, DVec3};

use crate::approximation::Approximation;
use crate::contents::{Contents, Light, Pane};
use crate::error::ExportError;
use crate::file_name::file_name;
use crate::texture::Pictures;
use element::{float, look_at, matrix, point, rgb};
use environment::{constant, environment};
use light_frame::{disk, linear_beam, rectangle};
use surface::{Surfaces, bitmap, dielectric, diffuse, two_sided};
use xml::Element;

/// Distance of a disk that stands for a sun, in radii of the scene. Directions towards it differ by at most the inverse
/// of it, radians.
const SUN_DISTANCE: f64 = 1e4;

/// Largest angular radius of a disk that stands for a sun, degrees.
const LARGEST_SUN: f64 = 80.0;

/// Nearest visible distance, in radii of the scene.
const NEAR: f64 = 1e-5;

/// `scene.xml`.
#[derive(Debug)]
pub(crate) struct Translation {
    pub(crate) text: String,
    /// What Mitsuba has no twin for.
    pub(crate) approximations: Vec<Approximation>,
}

/// Checks that the file can say all this.
fn check(contents: &Contents) -> Result<(), ExportError> {
    for light in &contents.lights {
        if let LightModel::Distant { angular_radius, .. } = light.model
            && angular_radius > LARGEST_SUN
        {
            return Err(ExportError::Value {
                place: format!("lights[{}].angular_radius", light.name),
                found: angular_radius.to_string(),
                expected: format!("at most {LARGEST_SUN}: it becomes a distant disk"),
            });
        }
    }
    Ok(())
}

/// Writes the file, and adds pictures that it takes.
pub(crate) fn translate(contents: &Contents, pictures: &mut Pictures) -> Result<Translation, ExportError> {
    check(contents)?;
    let mut approximations = Vec::new();
    let mut textures = Vec::new();
    let mut materials = Vec::new();
    for material in &contents.materials {
        let mut surfaces = Surfaces::new(&mut textures);
        materials.push(surfaces.covered(&material.model, &material.cover).with("id", &material_id(&material.id)));
        let place = format!("materials.{}", material.name);
        let differences = surfaces.differences.into_iter();
        approximations.extend(differences.map(|(by, difference)| Approximation {
            place: place.clone(),
            by,
            difference,
        }));
    }
    let mut emitters: BTreeMap<&str, Element> = BTreeMap::new();
    for light in &contents.lights {
        let LightModel::Mesh { mesh, radiance } = &light.model else { continue };
        let mut surfaces = Surfaces::new(&mut textures);
        emitters.insert(mesh, Element::plugin("emitter", "area").containing(surfaces.colour("radiance", radiance)));
        surfaces.differ("`area`", "it shines to the side of its normals alone");
        if matches!(radiance, ColourModel::Texture(_)) {
            surfaces.differ("`area`", "where texture coordinates are beyond 0 to 1, less of its light is found");
        }
        approximations.extend(surfaces.differences.into_iter().map(|(by, difference)| Approximation {
            place: format!("lights[{}]", light.name),
            by,
            difference,
        }));
    }
    let mut scene = Element::new("scene").with("version", "3.0.0");
    scene.add(Element::new("default").with("name", "spp").with("value", "64"));
    scene.add(integrator(contents));
    scene.add(sensor(contents));
    textures.iter().enumerate().for_each(|(number, texture)| scene.add(bitmap(number, texture)));
    materials.into_iter().for_each(|material| scene.add(material));
    for mesh in &contents.meshes {
        let material = contents.materials.iter().find(|material| material.name == mesh.material);
        let id = material.map_or_else(String::new, |material| material_id(&material.id));
        let mut shape = ply(&mesh.file, !mesh.normals).containing(Element::new("ref").with("id", &id));
        if let Some(emitter) = emitters.remove(&*mesh.name) {
            shape.add(emitter);
        }
        scene.add(shape);
    }
    for pane in &contents.panes {
        scene.add(glass(pane));
        scene.add(ply(&pane.edge, true).containing(two_sided(diffuse(rgb("reflectance", [0.0; 3])))));
    }
    for (index, light) in contents.lights.iter().enumerate() {
        let mut differ = |by, difference| {
            approximations.push(Approximation { place: format!("lights[{}]", light.name), by, difference });
        };
        if let Some(element) = emitter(light, contents.ball, pictures, &mut differ)? {
            scene.add(element.with("id", &format!("light-{}", file_name(index, &light.name))));
        }
    }
    Ok(Translation { text: scene.text(), approximations })
}

fn material_id(id: &str) -> String {
    format!("material-{id}")
}

fn integrator(contents: &Contents) -> Element {
    // Absorption in glass takes an integrator that knows media.
    let has_media = contents.panes.iter().any(Pane::is_absorbing);
    let integrator = Element::plugin("integrator", if has_media { "volpath" } else { "path" });
    integrator.containing(Element::value("integer", "max_depth", contents.max_depth + 1))
}

fn sensor(contents: &Contents) -> Element {
    let CameraModel { position, look_at: target, up, projection } = &contents.camera;
    let (_, radius) = contents.ball;
    let look = look_at(*position, *target, *up);
    let (sensor, to_world) = match projection {
        ProjectionModel::Perspective { vertical_field_of_view } => {
            let sensor = Element::plugin("sensor", "perspective")
                .containing(Element::value("string", "fov_axis", "y"))
                .containing(Element::value("float", "fov", vertical_field_of_view));
            (sensor, Element::transform())
        }
        ProjectionModel::Orthographic { height } => {
            // Half the width of the picture, whose aspect Mitsuba takes from the film.
            let half = height / 2.0 * f64::from(contents.film.width) / f64::from(contents.film.height);
            let scale = Element::new("scale").with("x", &half.to_string()).with("y", &half.to_string());
            (Element::plugin("sensor", "orthographic"), Element::transform().containing(scale))
        }
    };
    let film = Element::plugin("film", "hdrfilm")
        .containing(Element::value("integer", "width", contents.film.width))
        .containing(Element::value("integer", "height", contents.film.height))
        .containing(Element::value("string", "pixel_format", "rgb"))
        .containing(Element::value("string", "component_format", "float32"))
        .containing(Element::plugin("rfilter", "box"));
    let sampler =
        Element::plugin("sampler", "independent").containing(Element::value("integer", "sample_count", "$spp"));
    sensor
        .containing(Element::value("float", "near_clip", NEAR * radius))
        .containing(Element::value("float", "far_clip", 3.0 * SUN_DISTANCE * radius))
        .containing(to_world.containing(look))
        .containing(film)
        .containing(sampler)
}

/// The faces of a pane, with a medium between them where they absorb light.
fn glass(pane: &Pane) -> Element {
    let shape = ply(&pane.faces, false).containing(dielectric(pane.index_of_refraction));
    if !pane.is_absorbing() {
        return shape;
    }
    // Colours above 1 are refused, so the coefficient is a colour times a scale.
    let most = pane.absorption.into_iter().fold(0.0, f64::max);
    let medium = Element::plugin("medium", "homogeneous")
        .with("name", "interior")
        .containing(rgb("sigma_t", pane.absorption.map(|coefficient| coefficient / most)))
        .containing(Element::value("float", "scale", most))
        .containing(rgb("albedo", [0.0; 3]));
    shape.containing(medium)
}

/// A light that stands alone; `None` for one that belongs to a mesh. `ball` is around everything but distant lights.
fn emitter(
    light: &Light,
    (middle, radius): (DVec3, f64),
    pictures: &mut Pictures,
    differ: &mut dyn FnMut(&'static str, &'static str),
) -> Result<Option<Element>, ExportError> {
    let area = |radiance| Element::plugin("emitter", "area").containing(rgb("radiance", radiance));
    let placed = |shape: &str, to_world: DMat4, radiance| {
        Element::plugin("shape", shape).containing(matrix(to_world)).containing(area(radiance))
    };
    Ok(Some(match light.model {
        LightModel::Mesh { .. } => return Ok(None),
        LightModel::Point { position, intensity } => Element::plugin("emitter", "point")
            .containing(point("position", position))
            .containing(rgb("intensity", intensity)),
        LightModel::Spot { position, direction, intensity, inner_angle, outer_angle } => {
            if inner_angle < outer_angle {
                differ(
                    "`spot`",
                    "between its angles the intensity is linear in the angle; its power is about the same",
                );
            }
            let axis = DVec3::from(direction);
            let target = (DVec3::from(position) + axis).to_array();
            let up = axis.any_orthonormal_vector().to_array();
            Element::plugin("emitter", "spot")
                .containing(Element::transform().containing(look_at(position, target, up)))
                .containing(rgb("intensity", intensity))
                .containing(float("cutoff_angle", outer_angle))
                .containing(float("beam_width", linear_beam(inner_angle, outer_angle)))
        }
        LightModel::Sphere { centre, radius, radiance } => Element::plugin("shape", "sphere")
            .containing(point("center", centre))
            .containing(float("radius", radius))
            .containing(area(radiance)),
        LightModel::Rectangle { centre, edge_u, edge_v, radiance } => {
            placed("rectangle", rectangle(centre, edge_u, edge_v), radiance)
        }
        LightModel::Disk { centre, normal, radius, radiance } => placed("disk", disk(centre, normal, radius), radiance),
        LightModel::Distant { direction, angular_radius, radiance } => {
            let distance = SUN_DISTANCE * radius;
            let direction = DVec3::from(direction);
            let centre = (middle + direction * distance).to_array();
            let disk_radius = distance * libm::tan(angular_radius.to_radians());
            placed("disk", disk(centre, (-direction).to_array(), disk_radius), radiance)
        }
        LightModel::Environment { radiance: RadianceModel::Colour(radiance) } => constant(radiance),
        LightModel::Environment { radiance: RadianceModel::Picture { ref file, scale, middle, left, up } } => {
            let file = environment::file(file, light.picture.as_ref(), pictures, differ)?;
            environment(&file, scale, [middle, left, up])
        }
    }))
}

/// A mesh in a file.
fn ply(file: &str, is_flat: bool) -> Element {
    Element::plugin("shape", "ply").containing(Element::value("string", "filename", file)).containing(Element::value(
        "boolean",
        "face_normals",
        is_flat,
    ))
}
