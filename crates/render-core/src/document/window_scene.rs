//! A scene to look at a leaded window: a room of lime-washed walls whose only light comes through it.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use super::triangles::{Triangles, rounded};
use super::{SamplingDescription, SceneDescription};
use crate::bsdf::{DiffuseMaterial, MaterialDescription};
use crate::light::{EnvironmentLight, EnvironmentRadiance, LightDescription, SunLight};
use crate::scene::description::{CameraDescription, FilmDescription, MeshDescription};
use crate::scene::window::{GlassDescription, WindowDescription, WindowDesign, plan};
use crate::settings::{JsonPath, SCENE_FORMAT_VERSION, SceneError, Triple};
use crate::specular::registry::IntegratorDescription;
use crate::texture::ColourDescription;

/// From the sill to the floor, metres.
const SILL: f64 = 1.0;

/// From the window to the camera, as a multiple of the height of the opening.
const NEARNESS: f64 = 1.8;

/// From the window to the far wall, metres, as a multiple of the wall's longer edge.
const DEPTH: f64 = 1.4;

/// A window in a wall in the plane y = 0, with the inside towards -y.
pub fn window_of(design: WindowDesign, glass: BTreeMap<String, GlassDescription>) -> WindowDescription {
    WindowDescription {
        name: "window".to_owned(),
        sill: [0.0, 0.0, SILL],
        x_axis: [1.0, 0.0, 0.0],
        y_axis: [0.0, 0.0, 1.0],
        design,
        glass,
        paint: None,
        outer: None,
    }
}

/// A room around such a window, in the morning sun. The window's own wall closes it.
///
/// # Errors
///
/// When the window cannot be planned.
pub fn window_scene(window: WindowDescription) -> Result<SceneDescription, SceneError> {
    let root = JsonPath::Root;
    let windows = root.member("windows");
    let plan = plan(&window, &windows.element(0))?;
    let edge = plan.wall.as_ref().map_or(&plan.outline, |wall| &wall.outline);
    let corners = edge
        .iter()
        .fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[low, high], corner| [low.min(*corner), high.max(*corner)]);
    let inside = plan.wall.as_ref().and_then(|wall| wall.hole.first()).map_or(0.0, |(z, _)| *z);
    let sill = DVec3::from(window.sill);
    let (low, high) = (corners[0] + DVec2::new(sill.x, sill.z), corners[1] + DVec2::new(sill.x, sill.z));
    let (near, height) = (sill.y - inside, high.y - low.y);
    let far = near - DEPTH * height.max(high.x - low.x);
    let opening_top = plan.outline.iter().map(|corner| corner.y).fold(0.0, f64::max);
    // The window is a third of the picture, and the floor before it is seen.
    let farthest = far + 0.25;
    let back = (near - NEARNESS * opening_top).max(farthest);
    let eye = DVec3::new(low.x + 0.65 * (high.x - low.x), back, low.y + 0.55 * height);
    let target = DVec3::new(sill.x, near - 0.25 * (near - far), sill.z + 0.25 * opening_top);
    let opening: Vec<DVec3> = plan.outline.iter().map(|corner| sill + DVec3::new(corner.x, 0.0, corner.y)).collect();
    let [eye, target] = view_of(&opening, [eye, target], farthest).map(|place| place.to_array().map(rounded));
    Ok(SceneDescription {
        version: SCENE_FORMAT_VERSION,
        name: "A leaded window".to_owned(),
        seed: 1,
        film: FilmDescription { width: FILM[0], height: FILM[1] },
        camera: CameraDescription::Perspective {
            position: eye,
            look_at: target,
            up: [0.0, 0.0, 1.0],
            vertical_field_of_view: FIELD_OF_VIEW,
        },
        integrator: IntegratorDescription::default(),
        path_filter: None,
        sampling: SamplingDescription::default(),
        materials: materials(),
        meshes: [room([low.x, far, low.y], [high.x, near, high.y]), garden(sill, low.y)].concat(),
        imports: Vec::new(),
        windows: vec![window],
        sheets: BTreeMap::new(),
        panes: Vec::new(),
        lights: lights(),
        site: None,
        moment: None,
        daylight: None,
        timeline: Vec::new(),
    })
}

/// Width and height of the picture, pixels.
const FILM: [u32; 2] = [480, 600];

/// Degrees from the lower to the upper edge of the picture.
const FIELD_OF_VIEW: f64 = 62.0;

/// An eye and a target from which all of the opening is seen: these, or others from which the view goes more towards
/// the opening, and from further back, down to `farthest`.
fn view_of(opening: &[DVec3], [eye, target]: [DVec3; 2], farthest: f64) -> [DVec3; 2] {
    let [width, height] = FILM.map(f64::from);
    let half = libm::tan((0.5 * FIELD_OF_VIEW).to_radians());
    let middle = opening.iter().sum::<DVec3>() / opening.len() as f64;
    let is_seen = |[eye, target]: [DVec3; 2]| {
        let ahead = (target - eye).normalize();
        let right = ahead.cross(DVec3::Z).normalize();
        let up = right.cross(ahead);
        opening.iter().all(|corner| {
            let to = *corner - eye;
            let reach = 0.99 * half * to.dot(ahead);
            to.dot(up).abs() < reach && to.dot(right).abs() < reach * width / height
        })
    };
    let steps = |count: u32| (0..=count).map(move |step| f64::from(step) / f64::from(count));
    let back = |part: f64| DVec3::new(eye.x, eye.y + part * (farthest - eye.y), eye.z);
    let views = steps(8).flat_map(|part| steps(8).map(move |turn| [back(part), target.lerp(middle, turn)]));
    views.into_iter().find(|view| is_seen(*view)).unwrap_or([back(1.0), middle])
}

fn materials() -> BTreeMap<String, MaterialDescription> {
    let diffuse = |name: &str, colour: Triple| {
        let reflectance = ColourDescription::Colour(colour);
        (name.to_owned(), MaterialDescription::Diffuse(DiffuseMaterial { reflectance }))
    };
    BTreeMap::from([
        diffuse("flagstones", [0.42, 0.38, 0.33]),
        diffuse("limewash", [0.72, 0.68, 0.6]),
        diffuse("grass", [0.1, 0.2, 0.05]),
        diffuse("bark", [0.08, 0.06, 0.05]),
    ])
}

/// Floor, ceiling and three walls of a box; the fourth, at the largest y, is that of the window.
fn room([x0, y0, z0]: Triple, [x1, y1, z1]: Triple) -> Vec<MeshDescription> {
    let [x0, y0, z0, x1, y1, z1] = [x0, y0, z0, x1, y1, z1].map(rounded);
    let mut floor = Triangles::default();
    floor.add_quadrilateral([[x0, y0, z0], [x1, y0, z0], [x1, y1, z0], [x0, y1, z0]]);
    let mut walls = Triangles::default();
    walls.add_quadrilateral([[x0, y0, z1], [x1, y0, z1], [x1, y1, z1], [x0, y1, z1]]);
    walls.add_quadrilateral([[x0, y0, z0], [x0, y0, z1], [x0, y1, z1], [x0, y1, z0]]);
    walls.add_quadrilateral([[x1, y0, z0], [x1, y0, z1], [x1, y1, z1], [x1, y1, z0]]);
    walls.add_quadrilateral([[x0, y0, z0], [x1, y0, z0], [x1, y0, z1], [x0, y0, z1]]);
    vec![floor.into_mesh("floor", "flagstones"), walls.into_mesh("walls", "limewash")]
}

/// A meadow with the trunks of trees: what is seen through old glass shows its relief. Too low to shade the window.
fn garden(sill: DVec3, ground: f64) -> Vec<MeshDescription> {
    let (x, near, ground) = (rounded(sill.x), rounded(sill.y + 1.0), rounded(ground));
    let mut meadow = Triangles::default();
    let [left, right, far] = [x - 80.0, x + 80.0, near + 150.0].map(rounded);
    meadow.add_quadrilateral([[left, near, ground], [right, near, ground], [right, far, ground], [left, far, ground]]);
    let mut trunks = Triangles::default();
    for (place, away, height) in TRUNKS {
        let [left, right, y] = [x + place - 0.15, x + place + 0.15, near + away].map(rounded);
        let [low, high] = [ground, rounded(ground + height)];
        trunks.add_quadrilateral([[left, y, low], [right, y, low], [right, y, high], [left, y, high]]);
    }
    vec![meadow.into_mesh("meadow", "grass"), trunks.into_mesh("trunks", "bark")]
}

/// Trunks of trees: to the right of the window, behind the edge of the meadow, and high, metres.
const TRUNKS: [(f64, f64, f64); 7] = [
    (-6.5, 11.0, 6.0),
    (-3.1, 8.0, 4.5),
    (-1.4, 13.0, 6.5),
    (0.3, 9.0, 5.0),
    (1.9, 12.0, 6.0),
    (3.6, 8.0, 4.5),
    (7.0, 13.0, 6.5),
];

fn lights() -> Vec<LightDescription> {
    vec![
        LightDescription::Sun(SunLight {
            name: "sun".to_owned(),
            // 36 degrees high, 22 degrees to the side.
            direction: [0.3, 0.75, 0.59],
            angular_radius: 0.27,
            radiance: [41_000.0, 37_000.0, 31_000.0],
        }),
        LightDescription::Environment(EnvironmentLight {
            name: "sky".to_owned(),
            radiance: EnvironmentRadiance::Colour([0.35, 0.45, 0.6]),
            scale: 1.0,
            rotate: [0.0; 3],
        }),
    ]
}

#[cfg(test)]
mod tests {
    use clerestory_glazing::{Arch, Head, Opening};

    use super::*;

    #[test]
    fn all_of_a_window_is_in_the_picture() {
        for [width, height] in [[0.6, 2.0], [0.5, 1.0], [1.0, 1.0], [2.0, 1.0], [3.0, 6.0], [0.3, 0.3], [8.0, 2.0]] {
            let opening = Opening::Arch(Arch { width, height, head: Head::Rectangle });
            let mut design = WindowDesign::new(opening);
            design.wall = Some(clerestory_glazing::Wall::default());
            let glass = BTreeMap::from([("clear".to_owned(), GlassDescription::float())]);
            let scene = window_scene(window_of(design, glass)).unwrap();
            let CameraDescription::Perspective { position, look_at, .. } = scene.camera else { panic!("{scene:?}") };
            let [eye, target] = [position, look_at].map(DVec3::from);
            let ahead = (target - eye).normalize();
            let right = ahead.cross(DVec3::Z).normalize();
            let half = libm::tan(31_f64.to_radians());
            for corner in [[-0.5, 0.0], [0.5, 0.0], [0.5, 1.0], [-0.5, 1.0]] {
                let to = DVec3::new(corner[0] * width, 0.0, 1.0 + corner[1] * height) - eye;
                let [across, up] = [right, right.cross(ahead)].map(|axis| to.dot(axis) / (to.dot(ahead) * half));
                assert!(across.abs() < 0.8 && up.abs() < 1.0, "{width} x {height}: [{across}, {up}]");
            }
        }
    }
}
