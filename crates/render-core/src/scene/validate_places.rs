//! Refuses places at which light would be lost silently. A sphere light shines outwards, so that no camera may be in
//! one.

use std::fmt;

use glam::DVec3;

use super::Camera;
use super::description::CameraDescription;
use super::parts::SceneParts;
use crate::light::{Body, Light, LightAssets};
use crate::settings::JsonPath;
use crate::settings::SceneError;
use crate::settings::check::Quoted;

/// What a camera must keep out of.
#[derive(Clone, Copy, Debug, Default)]
pub struct Obstacles;

impl Obstacles {
    /// Checks that the camera of a valid scene stands outside of lights.
    ///
    /// # Errors
    ///
    /// What stands where, and a way out.
    pub fn check(&self, scene: SceneParts<'_>) -> Result<(), SceneError> {
        // Lights that have no place stand nowhere, or are meshes; their pictures and meshes are not at hand.
        let placed = scene.lights.iter().enumerate().filter(|(_, light)| light.place().is_some());
        let aperture = Camera::new(scene.camera, scene.film).aperture();
        let (kind, subject) = match scene.camera {
            CameraDescription::Perspective { .. } => ("perspective", "a camera"),
            CameraDescription::Orthographic { .. } => ("orthographic", "a camera whose rays start"),
        };
        for (index, light) in placed.map(|(index, light)| (index, Light::new(light, &LightAssets::default()))) {
            let Some(Body::Ball { centre, radius }) = light.body() else { continue };
            if radius == 0.0 || distance_to(centre, &aperture) > radius {
                continue;
            }
            let found = format!("{subject} inside of the sphere light {} (lights[{index}])", Quoted(&light.name));
            let expected = format!(
                "more than its radius of {radius} m from its centre: a sphere shines outwards, and is black from \
                 within; an environment is light from all around"
            );
            let root = JsonPath::Root;
            let camera = root.member("camera");
            return Err(SceneError::value(&camera.member(kind).member("position"), found, expected));
        }
        Ok(())
    }
}

/// In words, a way along a unit vector.
pub(super) fn further(micrometres: f64, direction: DVec3) -> String {
    let [x, y, z] = direction.to_array().map(|part| (part * 1e4).round() / 1e4 + 0.0);
    format!("{} m further along [{x}, {y}, {z}]", micrometres / 1e6)
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

    /// The valid scene without panes, changed.
    fn changed(change: impl FnOnce(&mut Value)) -> Result<Scene, SceneError> {
        let mut scene = valid_scene();
        scene["panes"] = json!([]);
        change(&mut scene);
        let description = SceneDescription::parse(scene.to_string().as_bytes())?;
        SceneBundle::from_parts(description, BTreeMap::new())?.build_scene()
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
    fn a_camera_in_a_sphere_light_is_refused() {
        let globe = |radius: f64| {
            move |scene: &mut Value| {
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
}
