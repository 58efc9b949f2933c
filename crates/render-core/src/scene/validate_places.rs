//! Refuses places at which light would be lost silently. These are panes that touch each other, and specular meshes,
//! lights and cameras in the glass of a pane. A sphere light shines outwards, so that no camera may be in one either.
//!
//! Opaque meshes may stand in glass, as leading and masonry do: where they do, they are black.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;

use super::description::CameraDescription;
use super::parts::SceneParts;
use super::{Camera, MeshSurface};
use crate::geometry::Pane;
use crate::geometry::contact::{NOWHERE, Shape, contact, join, overlap, way_out};
use crate::light::{Body, Light, LightAssets};
use crate::settings::Check;
use crate::settings::JsonPath;
use crate::settings::SceneError;
use crate::settings::check::Quoted;

/// Parts of panes that are looked at in all: a second's work. What is not settled by then is let through.
const MOST_PARTS: u32 = 1 << 21;

/// So much of a distance may be rounding, micrometres.
const ROUNDING_MICROMETRES: f64 = 1e-3;

/// Boxes that are compared with that of a pane for the price of one part.
const BOXES_FOR_A_PART: usize = 64;

/// Triangles that share a box: in most meshes, those that follow each other lie side by side.
const TRIANGLES_IN_A_BOX: usize = 64;

/// Bodies that must be apart, with a bound on the work of all comparisons.
struct Places<'a> {
    scene: SceneParts<'a>,
    panes: &'a [Pane],
    budget: u32,
}

/// Boxes around a mesh.
struct Boxes {
    whole: [DVec3; 2],
    /// Those around some of its triangles each, and which these are.
    parts: Vec<(Range<u32>, [DVec3; 2])>,
}

impl Boxes {
    fn around(mesh: &MeshSurface, corners: impl Fn(u32) -> [DVec3; 3]) -> Self {
        let all = mesh.triangle_range();
        let part = |first: u32| {
            let triangles = first..all.end.min(first + TRIANGLES_IN_A_BOX as u32);
            let bounds = triangles.clone().map(|triangle| Shape::Polygon(&corners(triangle)).bounds());
            (triangles, bounds.fold(NOWHERE, join))
        };
        let parts: Vec<(Range<u32>, [DVec3; 2])> = all.clone().step_by(TRIANGLES_IN_A_BOX).map(part).collect();
        Self { whole: parts.iter().map(|(_, bounds)| *bounds).fold(NOWHERE, join), parts }
    }
}

/// Checks that panes stand apart from one another and from specular meshes.
pub(super) fn check_panes(
    scene: SceneParts<'_>,
    panes: &[Pane],
    corners: impl Fn(u32) -> [DVec3; 3],
    meshes: &[MeshSurface],
) -> Check {
    let mut places = Places { scene, panes, budget: MOST_PARTS };
    places.check_panes()?;
    places.check_meshes(corners, meshes)
}

/// What cameras and lights must keep out of.
#[derive(Clone, Debug)]
pub struct Obstacles {
    panes: Arc<[Pane]>,
}

impl Obstacles {
    /// The glass of these panes.
    pub(super) fn new(panes: Arc<[Pane]>) -> Self {
        Self { panes }
    }

    /// Checks that the lights and the camera of a valid scene stand outside of glass, and the camera outside of lights.
    ///
    /// # Errors
    ///
    /// What stands where, and a way out.
    pub fn check(&self, scene: SceneParts<'_>) -> Result<(), SceneError> {
        // Lights that have no place stand nowhere, or are meshes; their pictures and meshes are not at hand.
        let placed = scene.lights.iter().enumerate().filter(|(_, light)| light.place().is_some());
        let lights: Vec<(usize, Light)> =
            placed.map(|(index, light)| (index, Light::new(light, &LightAssets::default()))).collect();
        let mut places = Places { scene, panes: &self.panes, budget: MOST_PARTS };
        places.check_lights(&lights)?;
        places.check_camera(&Camera::new(scene.camera, scene.film), &lights)
    }
}

impl Places<'_> {
    /// Panes are compared with those beside them along the axis on which they are spread most.
    fn check_panes(&mut self) -> Check {
        let boxes: Vec<[DVec3; 2]> = self.panes.iter().map(Pane::world_bounds).collect();
        let spread = boxes.iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[min, max], b| {
            let middle = 0.5 * (b[0] + b[1]);
            [min.min(middle), max.max(middle)]
        });
        let axis = (spread[1] - spread[0]).max_position();
        let mut order: Vec<usize> = (0..boxes.len()).collect();
        order.sort_by(|a, b| boxes[*a][0][axis].total_cmp(&boxes[*b][0][axis]));
        for (place, &first) in order.iter().enumerate() {
            let beside = order[place + 1..].iter().take_while(|other| boxes[**other][0][axis] <= boxes[first][1][axis]);
            for &second in beside.filter(|other| overlap(&boxes[first], &boxes[**other])) {
                self.check_pair(first.min(second), first.max(second))?;
            }
        }
        Ok(())
    }

    fn check_pair(&mut self, first: usize, second: usize) -> Check {
        let [one, other] = [first, second].map(|index| &self.panes[index]);
        let Some(at) = contact(one, &Shape::Pane(other), &mut self.budget) else { return Ok(()) };
        let root = JsonPath::Root;
        let panes = root.member("panes");
        let path = panes.element(second);
        let centre = self.scene.panes[second].centre;
        let found = format!(
            "{centre:?}, where the glass of pane {} touches or overlaps that of pane {} (panes[{first}]) at {}",
            Quoted(&other.name),
            Quoted(&one.name),
            Metres(at)
        );
        let expected = format!(
            "apart from it, such as {} (light between panes that touch would be lost)",
            self.way(first, &Shape::Pane(other))
        );
        Err(SceneError::value(&path.member("centre"), found, expected))
    }

    fn check_meshes(&mut self, corners: impl Fn(u32) -> [DVec3; 3], meshes: &[MeshSurface]) -> Check {
        if self.panes.is_empty() {
            return Ok(());
        }
        let specular = meshes.iter().enumerate().filter(|(_, mesh)| mesh.is_specular());
        let specular: Vec<(usize, Boxes)> =
            specular.map(|(index, mesh)| (index, Boxes::around(mesh, &corners))).collect();
        for (pane_index, pane) in self.panes.iter().enumerate() {
            let around = pane.world_bounds();
            self.count_boxes(specular.len());
            for (mesh_index, Boxes { whole, parts }) in &specular {
                if !overlap(&around, whole) {
                    continue;
                }
                self.count_boxes(parts.len());
                for (triangles, part) in parts {
                    if self.budget == 0 {
                        return Ok(());
                    }
                    if !overlap(&around, part) {
                        continue;
                    }
                    self.count_boxes(triangles.len());
                    let meets = |triangle| {
                        let corners = corners(triangle);
                        let shape = Shape::Polygon(&corners);
                        overlap(&around, &shape.bounds()).then(|| contact(pane, &shape, &mut self.budget)).flatten()
                    };
                    let Some(at) = triangles.clone().find_map(meets) else { continue };
                    let root = JsonPath::Root;
                    let path = root.member("meshes");
                    let found = format!(
                        "mesh {} in or against the glass of pane {} (panes[{pane_index}]) at {}",
                        Quoted(meshes[*mesh_index].name()),
                        Quoted(&pane.name),
                        Metres(at)
                    );
                    let expected = "apart from it: a dielectric or mirror that stands in glass would be black";
                    return Err(SceneError::value(&path.element(*mesh_index).member("source"), found, expected));
                }
            }
        }
        Ok(())
    }

    /// Pays for boxes that are compared with that of a pane.
    fn count_boxes(&mut self, boxes: usize) {
        self.budget = self.budget.saturating_sub(boxes.div_ceil(BOXES_FOR_A_PART) as u32);
    }

    fn check_lights(&mut self, lights: &[(usize, Light)]) -> Check {
        for (index, light) in lights {
            let Some(body) = light.body() else { continue };
            let Some((pane, at)) = self.pane_around(&shape_of(&body)) else { continue };
            let description = &self.scene.lights[*index];
            let root = JsonPath::Root;
            let (lights, place) = (root.member("lights"), description.place().unwrap_or_default());
            let (element, kind) = (lights.element(*index), description.kind());
            let found = format!("light {} in or against {}", Quoted(&light.name), self.glass(pane, at));
            let expected = format!(
                "outside of glass, such as {} (its light would be lost there)",
                self.way(pane, &shape_of(&body))
            );
            return Err(SceneError::value(&element.member(kind).member(place), found, expected));
        }
        Ok(())
    }

    fn check_camera(&mut self, camera: &Camera, lights: &[(usize, Light)]) -> Check {
        let aperture = camera.aperture();
        let shape = match aperture[..] {
            [centre] => Shape::Ball { centre, radius: 0.0 },
            _ => Shape::Polygon(&aperture),
        };
        let root = JsonPath::Root;
        let camera = root.member("camera");
        let (kind, subject) = match self.scene.camera {
            CameraDescription::Perspective { .. } => ("perspective", "a camera"),
            CameraDescription::Orthographic { .. } => ("orthographic", "a camera whose rays start"),
        };
        let camera = camera.member(kind);
        if let Some((pane, at)) = self.pane_around(&shape) {
            let found = format!("{subject} inside {}", self.glass(pane, at));
            let expected = format!("outside of glass, such as {} (all would be black there)", self.way(pane, &shape));
            return Err(SceneError::value(&camera.member("position"), found, expected));
        }
        for (index, light) in lights {
            let Some(Body::Ball { centre, radius }) = light.body() else { continue };
            if radius == 0.0 || distance_to(centre, &aperture) > radius {
                continue;
            }
            let found = format!("{subject} inside of the sphere light {} (lights[{index}])", Quoted(&light.name));
            let expected = format!(
                "more than its radius of {radius} m from its centre: a sphere shines outwards, and is black from \
                 within; an environment is light from all around"
            );
            return Err(SceneError::value(&camera.member("position"), found, expected));
        }
        Ok(())
    }

    /// The first pane in whose glass a shape stands, and where.
    fn pane_around(&mut self, shape: &Shape<'_>) -> Option<(usize, DVec3)> {
        let panes = self.panes;
        let mut panes = panes.iter().enumerate();
        panes.find_map(|(index, pane)| contact(pane, shape, &mut self.budget).map(|at| (index, at)))
    }

    fn glass(&self, pane: usize, at: DVec3) -> String {
        format!("the glass of pane {} (panes[{pane}]) at {}", Quoted(&self.panes[pane].name), Metres(at))
    }

    /// In words, a way that takes a shape out of a pane.
    fn way(&self, pane: usize, shape: &Shape<'_>) -> String {
        let (direction, distance) = way_out(&self.panes[pane], shape);
        // A micrometre more than it takes, in whole micrometres.
        let micrometres = (distance * 1e6 - ROUNDING_MICROMETRES).ceil().max(0.0) + 1.0;
        further(micrometres, direction)
    }
}

/// In words, a way along a unit vector.
pub(super) fn further(micrometres: f64, direction: DVec3) -> String {
    let [x, y, z] = direction.to_array().map(|part| (part * 1e4).round() / 1e4 + 0.0);
    format!("{} m further along [{x}, {y}, {z}]", micrometres / 1e6)
}

fn shape_of(body: &Body) -> Shape<'_> {
    match body {
        Body::Ball { centre, radius } => Shape::Ball { centre: *centre, radius: *radius },
        Body::Polygon(corners) => Shape::Polygon(corners),
    }
}

/// Distance from a point to a point or to a rectangle.
fn distance_to(point: DVec3, corners: &[DVec3]) -> f64 {
    let [origin, x, _, y] = corners else {
        return corners.first().map_or(f64::INFINITY, |corner| corner.distance(point));
    };
    let along = |side: DVec3| ((point - *origin).dot(side) / side.length_squared()).clamp(0.0, 1.0) * side;
    (*origin + along(*x - *origin) + along(*y - *origin)).distance(point)
}

/// A place, to the micrometre.
pub(super) struct Metres(pub(super) DVec3);

impl fmt::Display for Metres {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.0.to_array().map(|part| (part * 1e6).round() / 1e6 + 0.0);
        write!(formatter, "[{x}, {y}, {z}]")
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use serde_json::{Value, json};

    use super::super::Scene;
    use super::*;
    use crate::document::malformed_scenes::valid_scene;
    use crate::document::{SceneBundle, SceneDescription};

    fn build(scene: &Value) -> Result<Scene, SceneError> {
        let description = SceneDescription::parse(scene.to_string().as_bytes())?;
        SceneBundle::from_parts(description, BTreeMap::new())?.build_scene()
    }

    /// The valid scene with flat panes, changed.
    fn changed(change: impl FnOnce(&mut Value)) -> Result<Scene, SceneError> {
        let mut scene = valid_scene();
        for pane in scene["panes"].as_array_mut().unwrap() {
            pane["front"] = json!("flat");
            pane["back"] = json!("flat");
        }
        change(&mut scene);
        build(&scene)
    }

    #[track_caller]
    fn check_refused(path: &str, fragments: &[&str], change: impl FnOnce(&mut Value)) {
        let error = changed(change).expect_err("something stands where it may not");
        assert_eq!(error.path(), path, "{error}");
        for fragment in fragments {
            assert!(error.to_string().contains(fragment), "no {fragment:?} in: {error}");
        }
    }

    #[track_caller]
    fn check_allowed(change: impl FnOnce(&mut Value)) {
        if let Err(error) = changed(change) {
            panic!("{error}");
        }
    }

    #[test]
    fn panes_that_touch_are_refused_with_both_names_the_place_and_a_way_out() {
        let behind = |z: f64| move |scene: &mut Value| scene["panes"][1]["centre"] = json!([0.1, 0, z]);
        let names = ["pane \"right\" touches or overlaps that of pane \"left\" (panes[0]) at", ", 1.002]"];
        check_refused(
            "panes[1].centre",
            &[&names[..], &["0.000001 m further along [0, 0, 1]"]].concat(),
            behind(1.002),
        );
        check_refused("panes[1].centre", &["0.001001 m further along [0, 0, 1]"], behind(1.001));
        check_allowed(behind(1.002_001));
        // The outline of neighbours, also where it has been rounded.
        let beside = |x: f64| move |scene: &mut Value| scene["panes"][1]["centre"] = json!([x, 0, 1]);
        check_allowed(beside(0.3));
        check_allowed(beside(0.299_999));
        check_refused("panes[1].centre", &["0.010001 m further along [1, 0, 0]"], beside(0.29));
    }

    #[test]
    fn thousands_of_panes_in_a_window_are_no_hindrance() {
        let mut scene = valid_scene();
        let pane = |i: u32| {
            let centre = [f64::from(i % 64) * 0.1, f64::from(i / 64) * 0.1, 1.0];
            json!({
                "name": i.to_string(), "centre": centre, "x_axis": [1, 0, 0], "y_axis": [0, 1, 0],
                "width": 0.1, "height": 0.1, "thickness": 0.002
            })
        };
        scene["panes"] = (0..4096).map(pane).collect();
        assert_eq!(build(&scene).unwrap().panes().len(), 4096);
        scene["panes"][4000]["centre"][2] = json!(1.001);
        scene["panes"][4000]["centre"][0] = json!(3.25);
        assert!(build(&scene).unwrap_err().to_string().contains("\"4000\""));
    }

    #[test]
    fn a_camera_in_glass_is_refused() {
        let at = |z: f64| move |scene: &mut Value| scene["camera"]["perspective"]["position"] = json!([0.1, 0, z]);
        let place = "camera.perspective.position";
        check_refused(
            place,
            &["inside the glass of pane \"left\" (panes[0]) at [0.1, 0, 1.001]", "outside"],
            at(1.001),
        );
        check_refused(place, &["\"left\"", "0.000001 m further along [0, 0, -1]"], at(1.0));
        check_allowed(at(0.999_999));
        let parallel = |z: f64| {
            move |scene: &mut Value| {
                scene["camera"] = json!({"orthographic": {
                    "position": [-0.2, 0, z], "look_at": [-0.2, 0, 9], "up": [0, 1, 0], "height": 0.2
                }});
            }
        };
        check_refused(
            "camera.orthographic.position",
            &["whose rays start inside the glass of pane \"left\""],
            parallel(1.001),
        );
        check_allowed(parallel(0.99));
    }

    #[test]
    fn lights_in_glass_are_refused_wherever_they_reach_into_it() {
        let only = |light: Value| move |scene: &mut Value| scene["lights"] = json!([light]);
        let point = |z: f64| only(json!({"point": {"name": "lamp", "position": [0, 0, z], "intensity": [1, 1, 1]}}));
        let names = ["light \"lamp\" in or against the glass of pane \"left\"", "0.000501 m further along [0, 0, 1]"];
        check_refused("lights[0].point.position", &names, point(1.0015));
        check_allowed(point(1.003));
        let sphere = |z: f64, radius: f64| {
            only(json!({"sphere": {"name": "globe", "centre": [0, 0, z], "radius": radius, "radiance": [1, 1, 1]}}))
        };
        check_refused("lights[0].sphere.centre", &["globe"], sphere(1.1, 0.099));
        check_refused("lights[0].sphere.centre", &["globe"], sphere(1.1, 1.0));
        check_allowed(sphere(1.1, 0.098));
        let rectangle = |z: f64| {
            only(json!({"rectangle": {
                "name": "panel", "centre": [0.7, 0, z], "edge_u": [0.2, 0, 0], "edge_v": [0, 0.2, 0],
                "radiance": [1, 1, 1]
            }}))
        };
        check_refused("lights[0].rectangle.centre", &["\"right\" (panes[1])"], rectangle(1.002));
        check_allowed(rectangle(1.003));
        let disk = |z: f64| {
            only(json!({"disk": {
                "name": "aperture", "centre": [0, 0, z], "normal": [1, 0, 0], "radius": 0.1, "radiance": [1, 1, 1]
            }}))
        };
        check_refused("lights[0].disk.centre", &["aperture"], disk(1.1));
        check_allowed(disk(1.2));
    }

    #[test]
    fn specular_meshes_in_glass_are_refused_and_opaque_ones_are_not() {
        let wall = |material: Value, z: f64, up: [f64; 3]| {
            move |scene: &mut Value| {
                scene["materials"]["m"] = material;
                scene["meshes"][0]["material"] = json!("m");
                let [x, y, rise] = up;
                scene["meshes"][0]["source"]["inline"]["positions"] =
                    json!([[-1, -y, z], [1, -y, z], [1.0 + x, y, z + rise], [-1.0 + x, y, z + rise]]);
            }
        };
        let (across, standing) = ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        let stone = || json!({"diffuse": {"reflectance": {"colour": [1, 1, 1]}}});
        for specular in [json!({"mirror": {}}), json!({"dielectric": {}})] {
            for (z, up) in [(1.001, across), (1.0, across), (1.002, across), (0.5, standing)] {
                check_refused("meshes[0].source", &["mesh \"floor\"", "glass of pane"], wall(specular.clone(), z, up));
            }
            // Against the edge of a came's width, and with its own edge on the glass, as water in a tank has it.
            check_allowed(wall(specular.clone(), 1.002_001, across));
            check_allowed(wall(specular, 1.002, standing));
        }
        check_allowed(wall(stone(), 1.001, across));
        check_allowed(wall(stone(), 0.5, standing));
    }

    #[test]
    fn a_mesh_of_many_triangles_that_most_panes_are_far_from_uses_up_no_budget() {
        let mut scene = valid_scene();
        let pane = |i: u32| {
            json!({
                "name": i.to_string(), "centre": [f64::from(i), 0, 1], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0],
                "width": 0.1, "height": 0.1, "thickness": 0.002
            })
        };
        scene["panes"] = (0..20).map(pane).collect();
        scene["materials"]["water"] = json!({"dielectric": {"index_of_refraction": 1.33}});
        scene["meshes"] = json!([{
            "name": "sea", "material": "water", "rotate": [90, 0, 0], "translate": [0, -9, 0],
            "source": {"waves": {"size": [60, 60], "cells": [80, 80], "wavelengths": [3, 5], "height": 0.01, "seed": 1}}
        }]);
        let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
        let scene = build(&scene).unwrap();
        let found = |rise: f64, x: f64| {
            let corners =
                |triangle: u32| scene.accelerator().corners(triangle).map(|corner| corner + DVec3::new(x, rise, 0.0));
            let mut places = Places { scene: description.parts(), panes: scene.panes(), budget: 2000 };
            let result = places.check_meshes(corners, scene.meshes());
            (places.budget, result.err().map(|error| error.to_string()))
        };
        // Below all panes, around all of them, and around the last alone.
        let (left, message) = found(0.0, 0.0);
        assert!(left > 1900 && message.is_none(), "{left} {message:?}");
        assert!(found(9.0, 0.0).1.unwrap().contains("pane \"0\""));
        let message = found(9.0, 48.99).1.unwrap();
        assert!(message.contains("mesh \"sea\" in or against the glass of pane \"19\""), "{message}");
    }

    #[test]
    fn a_camera_in_a_sphere_light_is_refused() {
        let globe = |radius: f64| {
            move |scene: &mut Value| {
                scene["panes"] = json!([]);
                let light = json!({"name": "globe", "centre": [0, 0, 0], "radius": radius, "radiance": [1, 1, 1]});
                scene["lights"] = json!([{"sphere": light}]);
            }
        };
        let place = "camera.perspective.position";
        check_refused(place, &["inside of the sphere light \"globe\" (lights[0])", "black from within"], globe(2.0));
        check_refused(place, &["its radius of 100 m"], globe(100.0));
        check_allowed(globe(1.999));
        let parallel = |radius: f64| {
            move |scene: &mut Value| {
                globe(radius)(scene);
                scene["camera"] = json!({"orthographic": {
                    "position": [0, 2, -1], "look_at": [0, 2, 0], "up": [0, 1, 0], "height": 2
                }});
            }
        };
        // Rays start from 1 m to 3 m above the centre, 1 m before it.
        check_refused("camera.orthographic.position", &["whose rays start inside of the sphere"], parallel(1.42));
        check_allowed(parallel(1.41));
    }

    #[test]
    fn where_a_camera_may_go_in_a_built_scene_is_known_beforehand() {
        let mut description = SceneDescription::parse(valid_scene().to_string().as_bytes()).unwrap();
        let scene = changed(|_| {}).unwrap();
        assert!(scene.obstacles().check(description.parts()).is_ok());
        let CameraDescription::Perspective { position, .. } = &mut description.camera else { panic!("no pinhole") };
        *position = [0.0, 0.0, 1.001];
        assert_eq!(scene.obstacles().check(description.parts()).unwrap_err().path(), "camera.perspective.position");
    }
}
