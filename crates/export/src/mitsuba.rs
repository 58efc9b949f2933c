//! `scene.xml` for Mitsuba 3.
//!
//! Its defaults differ from ours in many places, so every one of them is written out. The field of view is vertical,
//! the pixel filter a box, the film 32-bit floats, the index of air 1. Its materials have one side unless they are
//! wrapped in `twosided`. Shapes of lights have no material, so they reflect nothing. Its depth counts segments, ours
//! vertices.

use clerestory_render_core::exchange::{CameraModel, ColourModel, LightModel, ProjectionModel, SurfaceModel};
use clerestory_render_core::settings::Triple;
use glam::{DMat4, DVec3};

use crate::contents::{Contents, Pane};
use crate::error::ExportError;
use crate::file_name::file_name;
use crate::light_frame::{disk, rectangle};
use crate::xml::Element;

/// Distance of a disk that stands for a sun, in radii of the scene. Directions towards it differ by at most the inverse
/// of it, radians.
const SUN_DISTANCE: f64 = 1e4;

/// Largest angular radius of a disk that stands for a sun, degrees.
const LARGEST_SUN: f64 = 80.0;

/// Nearest visible distance, in radii of the scene.
const NEAR: f64 = 1e-5;

/// Checks that the file can say all this.
pub(crate) fn check(contents: &Contents) -> Result<(), ExportError> {
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

/// The text of the file.
pub(crate) fn text(contents: &Contents) -> String {
    let mut scene = Element::new("scene").with("version", "3.0.0");
    scene.add(Element::new("default").with("name", "spp").with("value", "64"));
    scene.add(integrator(contents));
    scene.add(sensor(contents));
    for material in &contents.materials {
        scene.add(bsdf(&material.model).with("id", &material_id(&material.id)));
    }
    for mesh in &contents.meshes {
        let material = contents.materials.iter().find(|material| material.name == mesh.material);
        let id = material.map_or_else(String::new, |material| material_id(&material.id));
        scene.add(ply(&mesh.file, !mesh.normals).containing(Element::new("ref").with("id", &id)));
    }
    for pane in &contents.panes {
        scene.add(glass(pane));
        scene.add(ply(&pane.edge, true).containing(two_sided(diffuse(rgb("reflectance", [0.0; 3])))));
    }
    for (index, light) in contents.lights.iter().enumerate() {
        scene.add(emitter(&light.model, contents.ball).with("id", &format!("light-{}", file_name(index, &light.name))));
    }
    scene.text()
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
    let CameraModel { position, look_at, up, projection } = &contents.camera;
    let (_, radius) = contents.ball;
    let look = Element::new("lookat")
        .with("origin", &numbers(*position))
        .with("target", &numbers(*look_at))
        .with("up", &numbers(*up));
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

/// The material of a model.
fn bsdf(model: &SurfaceModel<String>) -> Element {
    match model {
        SurfaceModel::Diffuse { reflectance: ColourModel::Colour(colour) } => {
            two_sided(diffuse(rgb("reflectance", *colour)))
        }
        SurfaceModel::Diffuse { reflectance: ColourModel::Texture(file) } => {
            let texture = Element::plugin("texture", "bitmap")
                .with("name", "reflectance")
                .containing(Element::value("string", "filename", file))
                .containing(Element::value("string", "filter_type", "bilinear"))
                .containing(Element::value("string", "wrap_mode", "repeat"));
            two_sided(diffuse(texture))
        }
        SurfaceModel::Mirror { reflectance } => {
            let conductor = Element::plugin("bsdf", "conductor")
                .containing(Element::value("string", "material", "none"))
                .containing(rgb("specular_reflectance", *reflectance));
            two_sided(conductor)
        }
        SurfaceModel::Dielectric { index_of_refraction } => dielectric(*index_of_refraction),
    }
}

fn diffuse(reflectance: Element) -> Element {
    Element::plugin("bsdf", "diffuse").containing(reflectance)
}

fn two_sided(bsdf: Element) -> Element {
    Element::plugin("bsdf", "twosided").containing(bsdf)
}

fn dielectric(index_of_refraction: f64) -> Element {
    Element::plugin("bsdf", "dielectric")
        .containing(Element::value("float", "int_ior", index_of_refraction))
        .containing(Element::value("float", "ext_ior", 1))
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

/// The light of a model. `ball` is around everything but distant lights.
fn emitter(model: &LightModel, (middle, radius): (DVec3, f64)) -> Element {
    let area = |radiance| Element::plugin("emitter", "area").containing(rgb("radiance", radiance));
    let placed = |shape: &str, to_world: DMat4, radiance| {
        Element::plugin("shape", shape).containing(matrix(to_world)).containing(area(radiance))
    };
    match *model {
        LightModel::Point { position, intensity } => Element::plugin("emitter", "point")
            .containing(point("position", position))
            .containing(rgb("intensity", intensity)),
        LightModel::Sphere { centre, radius, radiance } => Element::plugin("shape", "sphere")
            .containing(point("center", centre))
            .containing(Element::value("float", "radius", radius))
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
    }
}

/// A mesh in a file.
fn ply(file: &str, is_flat: bool) -> Element {
    Element::plugin("shape", "ply").containing(Element::value("string", "filename", file)).containing(Element::value(
        "boolean",
        "face_normals",
        is_flat,
    ))
}

fn rgb(name: &str, colour: Triple) -> Element {
    Element::value("rgb", name, numbers(colour))
}

fn point(name: &str, [x, y, z]: Triple) -> Element {
    let coordinates = [("x", x), ("y", y), ("z", z)];
    coordinates
        .into_iter()
        .fold(Element::new("point").with("name", name), |element, (axis, value)| element.with(axis, &value.to_string()))
}

/// A placement, by the rows of its matrix.
fn matrix(to_world: DMat4) -> Element {
    let rows = to_world.transpose().to_cols_array().map(|value| value.to_string()).join(" ");
    Element::transform().containing(Element::new("matrix").with("value", &rows))
}

fn numbers(triple: Triple) -> String {
    triple.map(|number| number.to_string()).join(", ")
}
