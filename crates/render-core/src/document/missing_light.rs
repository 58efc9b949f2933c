//! What an image of a scene will lack: the light that the chosen integrator and its settings leave out. And what it
//! will show late: the light of small lights, and of the environment, that they leave to chance.
//!
//! These are classes of paths. How much light there is in them depends on the scene. A class without a path that the
//! path filter lets through is not named.

use glam::DVec3;

use super::PathFilter;
use super::SceneDescription;
use crate::geometry::Pane;
use crate::light::SELDOM_MET;
use crate::scene::Scene;
use crate::scene::description::MeshDescription;
use crate::specular::missing::{ANNOUNCED, Contents, LightGroup, PathClass, immersed_bodies, unowned_of_environment};
use crate::specular::settings::LightSubpaths;

/// Vertices of the shortest path that brings light through a pane to a surface that the camera sees.
const VERTICES_THROUGH_PANE: u32 = 3;

/// Most lights that are named.
const MOST_NAMES: usize = 3;

impl SceneDescription {
    /// The light of small lights and of the environment that an image of the scene built from this leaves to chance, in
    /// words, for its metadata.
    pub fn left_to_chance(&self, scene: &Scene) -> Vec<String> {
        let meshes = |is_one: &dyn Fn(&MeshDescription) -> bool| {
            let chosen = (0u32..).zip(&self.meshes).filter(|(_, mesh)| is_one(mesh));
            chosen.map(|(mesh, _)| scene.mesh_bounds(mesh)).collect::<Vec<_>>()
        };
        let specular = meshes(&|mesh| self.parts().is_specular(mesh));
        let glass: Vec<_> = scene.panes().iter().map(Pane::world_bounds).chain(specular).collect();
        let mut classes = Vec::new();
        if let Some(group) = small_lights(scene, &glass) {
            classes.extend(self.unsplatted(self.integrator.unowned(&group, self.contents())));
        }
        let walls = meshes(&|mesh| self.parts().is_left_to_chance(mesh));
        classes.extend(small_lights(scene, &walls).map(|group| group.over_thin_walls(self.contents())));
        let immersed = scene.immersed_names(MOST_NAMES);
        if let Some(names) = immersed.filter(|_| scene.lights().iter().any(|light| light.emission() != DVec3::ZERO)) {
            classes.push(immersed_bodies(&names, self.has_points()));
        }
        let environment = scene.light_sampler().environment().map(|index| &scene.lights()[index as usize]);
        if let Some(light) = environment.filter(|light| light.emission().max_element() > 0.0 && !glass.is_empty()) {
            let group = LightGroup { name: format!("the environment \"{}\"", light.name), can_be_met: true };
            let unowned = unowned_of_environment(&group, self.contents(), self.integrator.finds_environment());
            classes.extend(self.unsplatted(unowned));
        }
        classes.retain(|class| class.estimate > ANNOUNCED);
        self.rendered(classes)
    }

    /// The light that an image of this scene lacks, in words, for its metadata.
    pub fn missing_light(&self) -> Vec<String> {
        if self.lights.is_empty() {
            return Vec::new();
        }
        let mut missing = Vec::new();
        if let Some(filter) = &self.path_filter {
            missing.push(format!("paths that do not match the path filter {filter}"));
        }
        missing.extend(self.long_paths());
        let contents = self.contents();
        let points = LightGroup { name: "point lights".to_owned(), can_be_met: false };
        let mut classes = Vec::new();
        if contents.panes + contents.meshes > 0 {
            // Methods search for the light of all lights but the environment.
            if self.lights.iter().any(|light| !light.is_environment()) {
                classes.extend(self.integrator.unfound(contents));
            }
            if contents.has_points {
                let unowned = self.integrator.unowned(&points, contents);
                let is_shared = self.integrator.light_subpaths() == LightSubpaths::Shared;
                classes.extend(if is_shared { self.unsplatted(unowned) } else { unowned });
            }
        }
        if contents.has_points && self.meshes.iter().any(|mesh| self.parts().is_left_to_chance(mesh)) {
            classes.push(points.over_thin_walls(contents));
        }
        missing.extend(self.rendered(classes));
        missing
    }

    /// Those of some paths that no light subpath finds.
    fn unsplatted(&self, classes: Vec<PathClass>) -> Vec<PathClass> {
        if !self.grid(1).has_light_plane || self.contents().meshes > 0 {
            return classes;
        }
        classes.into_iter().map(PathClass::seen_over_glass).collect()
    }

    /// Those classes of which the path filter lets some path through.
    fn rendered(&self, classes: Vec<PathClass>) -> Vec<String> {
        let filter = self.compiled_path_filter().ok().flatten();
        let is_rendered = |class: &PathClass| match (&filter, PathFilter::parse(&class.paths)) {
            (Some(filter), Ok(paths)) => filter.shares_a_path(&paths),
            _ => true,
        };
        classes.into_iter().filter(is_rendered).map(|class| class.text).collect()
    }

    fn contents(&self) -> Contents {
        Contents { panes: self.panes.len(), meshes: self.specular_meshes(), has_points: self.has_points() }
    }

    fn has_points(&self) -> bool {
        self.lights.iter().any(|light| light.is_delta())
    }

    fn specular_meshes(&self) -> usize {
        self.meshes.iter().filter(|mesh| self.parts().is_specular(mesh)).count()
    }

    /// Paths that are cut off, unless the path filter lets none of them through.
    fn long_paths(&self) -> Option<String> {
        let most = self.integrator.max_depth();
        let filter = self.compiled_path_filter().ok().flatten();
        let longest = filter.and_then(|filter| filter.most_vertices());
        if longest.is_some_and(|longest| longest <= most as usize) {
            return None;
        }
        let paths = format!("paths of more than {most} vertices between camera and light (max_depth)");
        if most < VERTICES_THROUGH_PANE && !self.panes.is_empty() {
            return Some(format!("{paths}, and so all light that comes through a pane to a surface"));
        }
        Some(paths)
    }
}

/// The lights that are small as seen from one of these boxes; `None` where there are none.
fn small_lights(scene: &Scene, boxes: &[[DVec3; 2]]) -> Option<LightGroup> {
    let is_small = |solid_angle: f64| solid_angle < SELDOM_MET;
    let small = scene.lights().iter().filter(|light| {
        light.emission().max_element() > 0.0
            && boxes.iter().any(|bounds| light.largest_solid_angle(*bounds).is_some_and(is_small))
    });
    let names: Vec<&str> = small.map(|light| light.name.as_str()).collect();
    let quoted: Vec<String> = names.iter().take(MOST_NAMES).map(|name| format!("\"{name}\"")).collect();
    let name = match names.len() {
        0 => return None,
        1 => format!("the small light {}", quoted[0]),
        count if count <= MOST_NAMES => format!("the small lights {}", quoted.join(", ")),
        count => format!("{count} small lights, {} and so on,", quoted.join(", ")),
    };
    Some(LightGroup { name, can_be_met: true })
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::malformed_scenes::valid_scene;
    use super::*;

    /// What the valid scene lacks with another integrator and these of its lights.
    fn missing(integrator: Value, lights: std::ops::Range<usize>) -> Vec<String> {
        let mut scene = valid_scene();
        scene["integrator"] = integrator;
        scene["lights"] = scene["lights"].as_array().unwrap()[lights].into();
        SceneDescription::parse(scene.to_string().as_bytes()).unwrap().missing_light()
    }

    /// Checks that there is one text for each of `expected`, in this order, which contains it.
    #[track_caller]
    fn check(found: &[String], expected: &[&str]) {
        assert_eq!(found.len(), expected.len(), "{found:#?}");
        for (text, part) in found.iter().zip(expected) {
            assert!(text.contains(part), "{part:?} is not in {text:?}");
        }
    }

    #[test]
    fn a_light_that_can_be_met_lacks_only_what_the_search_misses_and_long_paths() {
        let lights = 1..4;
        let long = "more than 16 vertices";
        check(&missing(json!({"path": {}}), lights.clone()), &[long]);
        check(&missing(json!({"cone": {}}), lights.clone()), &[long]);
        check(&missing(json!({"fnee": {"selection": "bleed"}}), lights.clone()), &[long, "enumeration misses"]);
        let published = json!({"fnee": {"solver": "published", "max_trials": 50}});
        check(&missing(published, lights.clone()), &[long, "no minimum", "(1 - p)^50"]);
        let sms = |estimator: Value| missing(json!({"sms": {"estimator": estimator}}), lights.clone());
        check(&sms(json!({"unbiased": {"max_trials": 70}})), &[long, "(1 - p)^70"]);
        check(&sms(json!({"biased": {"trials": 4}})), &[long, "(1 - p)^4"]);
        let mnee = |missed| missing(json!({"mnee": {"missed": missed}}), lights.clone());
        check(&mnee("left_to_chance"), &[long]);
        check(&mnee("dropped"), &[long, "but for the one"]);
        check(&missing(json!({"conic": {}}), lights.clone()), &[long]);
        check(&missing(json!({"conic": {"search": "published"}}), lights), &[long, "but for the first"]);
    }

    #[test]
    fn a_point_light_lacks_all_that_only_chance_could_find() {
        let long = "more than 16 vertices";
        for integrator in ["path", "cone"] {
            check(&missing(json!({integrator: {}}), 0..4), &[long, "through or off a pane or a specular mesh"]);
        }
        check(&missing(json!({"mnee": {}}), 0..4), &[long, "but for the one path"]);
        check(
            &missing(json!({"conic": {"chains": ["T", "R"]}}), 0..4),
            &[long, "over one specular mesh (T, R; chains)"],
        );
        let manifold =
            [long, "(1 - p)^10000000", "other specular vertices than TT (chains)", "highest and lowest point"];
        check(&missing(json!({"sms": {}}), 0..1), &manifold);
        let marked = missing(json!({"sms": {"chains": ["TT", "R"], "casters": ["left"]}}), 0..1);
        check(
            &marked,
            &[
                manifold[0],
                manifold[1],
                "than TT, R (chains)",
                manifold[3],
                "the first is on a pane or a mesh other than left",
            ],
        );
        let always = [long, "(1 - p)^1000", "more than one pane", "less than 0.06 degrees"];
        let with = |selection| missing(json!({"fnee": {"selection": selection}}), 0..1);
        check(&with("all"), &always);
        check(&with("random"), &always);
        let reflected = missing(json!({"fnee": {"reflected": true}}), 0..1);
        assert!(!reflected.iter().any(|text| text.contains("on its outside")), "{reflected:?}");
        check(&with("sharp"), &[&always[..], &["meets first"]].concat());
        check(&with("bleed"), &[&always[..], &["nothing blocks"]].concat());
    }

    #[test]
    fn auto_lacks_what_none_of_its_methods_looks_for() {
        let long = "more than 16 vertices";
        let walks = "paths over TT or TTTT or RTT or TTT or TTR (chains) that a random seed";
        check(&missing(json!("auto"), 1..4), &[long, walks]);
        let points = [
            long,
            "paths through a pane that the enumeration misses",
            "paths off the outside of a pane",
            walks,
            "in a row, or reflected within one of them, where no chosen method looks for it",
            "less than 0.06 degrees",
        ];
        check(&missing(json!("auto"), 0..4), &points);
    }

    #[test]
    fn a_low_depth_and_a_path_filter_say_what_they_leave_out() {
        let of = |change: &dyn Fn(&mut Value)| {
            let mut scene = valid_scene();
            scene["integrator"] = json!({"cone": {"max_depth": 2}});
            scene["lights"].as_array_mut().unwrap().remove(0);
            change(&mut scene);
            SceneDescription::parse(scene.to_string().as_bytes()).unwrap().missing_light()
        };
        check(&of(&|_| {}), &["more than 2 vertices between camera and light (max_depth), and so all light"]);
        check(&of(&|scene| scene["path_filter"] = json!("D TT L")), &["path filter D TT L", "more than 2 vertices"]);
        assert!(of(&|scene| scene["panes"] = json!([]))[0].ends_with("(max_depth)"));
        check(&of(&|scene| scene["lights"] = json!([])), &[]);
    }

    #[test]
    fn what_the_path_filter_makes_moot_is_not_named() {
        let of = |filter: &str, integrator: Value| {
            let mut scene = valid_scene();
            scene["path_filter"] = json!(filter);
            scene["integrator"] = integrator;
            SceneDescription::parse(scene.to_string().as_bytes()).unwrap().missing_light()
        };
        let published = json!({"fnee": {"solver": "published", "reflected": true}});
        check(&of("D L", published.clone()), &["path filter"]);
        check(&of("D R L", published.clone()), &["path filter", "no minimum", "random seed", "that a pane reflects"]);
        let through = ["path filter", "no minimum", "random seed", "less than 0.06 degrees"];
        check(&of("D TT L", published.clone()), &through);
        check(&of("D* TT L", published), &[&through[..1], &["more than 16 vertices"], &through[1..]].concat());
        let sms = json!({"sms": {"chains": ["TT", "TTTT", "R"], "estimator": {"biased": {"trials": 4}}}});
        check(&of("D TTTT L", sms.clone()), &["path filter", "(1 - p)^4", "between the pane's highest"]);
        check(&of("D TRRT L", sms), &["path filter", "than TT, TTTT, R (chains)", "between the pane's highest"]);
    }

    #[test]
    fn what_is_left_to_chance_of_an_environment_is_named() {
        let of = |integrator: Value, change: &dyn Fn(&mut Value)| {
            let mut scene = valid_scene();
            scene["integrator"] = integrator;
            scene["lights"] = json!([{"environment": {"name": "sky", "radiance": {"colour": [1, 1, 1]}}}]);
            change(&mut scene);
            let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
            assert!(description.missing_light().iter().all(|text| text.contains("max_depth")));
            let bundle =
                crate::document::SceneBundle::from_parts(description, std::collections::BTreeMap::new()).unwrap();
            bundle.description().left_to_chance(&bundle.build_scene().unwrap())
        };
        let all = "light of the environment \"sky\" that comes through or off a pane or a specular mesh to a surface";
        check(&of(json!({"path": {}}), &|_| {}), &[all]);
        for integrator in ["auto", "cone", "fnee", "sms", "mnee", "conic"] {
            check(&of(json!({integrator: {}}), &|_| {}), &["environment \"sky\" that a pane reflects"]);
        }
        assert_eq!(of(json!({"path": {}}), &|scene| scene["panes"] = json!([])), [""; 0]);
        let dark = json!([{"environment": {"name": "night", "radiance": {"colour": [0, 0, 0]}}}]);
        assert_eq!(of(json!({"path": {}}), &|scene| scene["lights"] = dark.clone()), [""; 0]);
    }

    #[test]
    fn light_of_small_lights_that_no_method_looks_for_is_named() {
        let of = |change: &dyn Fn(&mut Value)| {
            let mut scene = valid_scene();
            change(&mut scene);
            let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
            let bundle =
                crate::document::SceneBundle::from_parts(description, std::collections::BTreeMap::new()).unwrap();
            bundle.description().left_to_chance(&bundle.build_scene().unwrap())
        };
        let lights = "the small lights \"globe\", \"sun\", \"aperture\"";
        let found = of(&|_| {});
        check(&found, &["reflects, on its outside or between its faces, or that passes through more than one pane"]);
        assert!(found.iter().all(|text| text.contains(lights)), "{found:#?}");
        let only = |light: usize| {
            move |scene: &mut Value| {
                scene["integrator"] = json!({"cone": {}});
                scene["lights"] = json!([scene["lights"][light]]);
            }
        };
        let under_the_sun = |change: &dyn Fn(&mut Value)| {
            of(&|scene| {
                only(3)(scene);
                change(scene);
            })
        };
        assert_eq!(of(&only(0)), [""; 0], "chance does not find a point");
        assert_eq!(of(&only(2)), [""; 0], "a panel is met often");
        assert_eq!(of(&only(3)).len(), 1, "a sun is not");
        assert_eq!(under_the_sun(&|scene| scene["lights"][0]["sun"]["angular_radius"] = json!(2)), [""; 0]);
        assert_eq!(under_the_sun(&|scene| scene["lights"][0]["sun"]["radiance"] = json!([0, 0, 0])), [""; 0]);
        assert_eq!(under_the_sun(&|scene| scene["panes"] = json!([])), [""; 0]);
        assert_eq!(under_the_sun(&|scene| scene["path_filter"] = json!("D* L")), [""; 0]);
        let sun = "the small light \"sun\"";
        let with = |integrator: Value| under_the_sun(&|scene| scene["integrator"] = integrator.clone());
        check(
            &with(json!({"path": {}})),
            &[&format!("light of {sun} that comes through or off a pane or a specular mesh")],
        );
        check(&with(json!({"sms": {"chains": ["TT", "R"]}})), &["than TT, R (chains)"]);
        check(&with(json!({"mnee": {}})), &["but for the one path over TT"]);
        check(&with(json!({"mnee": {"missed": "dropped"}})), &["than TT (chains)"]);
        check(&with(json!({"conic": {}})), &["one specular mesh (T; chains)"]);
        check(&with(json!({"fnee": {"selection": "sharp"}})), &["more than one pane", "meets first"]);
        // Light subpaths find reflections within panes on all surfaces that the camera sees straight.
        let seen = "which the camera sees through or off glass";
        check(&with(json!("auto")), &[seen]);
        for filter in ["D TRRT L", "D D TRRT L"] {
            let late = |integrator: &str| {
                under_the_sun(&|scene| {
                    scene["integrator"] = json!(integrator);
                    scene["path_filter"] = json!(filter);
                })
            };
            assert_eq!((late("auto").len(), late("light").len(), late("cone").len()), (0, 0, 1), "{filter}");
        }
    }

    #[test]
    fn light_over_thin_walls_is_missing_from_points_and_late_from_small_lights() {
        let mut scene = valid_scene();
        scene["panes"] = json!([]);
        scene["materials"] = json!({"stone": {"thin_wall": {}}});
        scene["integrator"] = json!({"path": {}});
        let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
        let wall = "off a thin wall to a surface";
        check(&description.missing_light(), &["more than 16 vertices", &format!("light of point lights {wall}")]);
        let bundle = crate::document::SceneBundle::from_parts(description, std::collections::BTreeMap::new()).unwrap();
        let late = bundle.description().left_to_chance(&bundle.build_scene().unwrap());
        check(&late, &[wall]);
        assert!(late[0].contains("\"sun\""), "{late:?}");
    }
}
