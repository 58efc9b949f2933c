//! What an image of a scene will lack: the light that the chosen integrator and its settings leave out. And what it will show late:
//! the light of small lights that they leave to chance.
//!
//! These are classes of paths. How much light there is in them depends on the scene. A class without a path that the path filter lets
//! through is not named.

use std::collections::BTreeSet;
use std::f64::consts::PI;

use glam::DVec3;

use super::Scene;
use super::description::{
    ConicSearch, FneeSolver, IntegratorDescription, ManifoldEstimator, MeshDescription, MissedPaths, PaneSelection,
    SceneDescription,
};
use crate::geometry::Pane;
use crate::integrator::PathFilter;
use crate::light::Light;
use crate::specular::side::GRAZING_COSINE;

/// Vertices of the shortest path that brings light through a pane to a surface that the camera sees.
const VERTICES_THROUGH_PANE: u32 = 3;

/// A light is small where less than this of the directions from a surface lead to it: it is met so rarely that an image of some
/// thousand samples shows it as single bright pixels.
const SMALL_SOLID_ANGLE: f64 = PI / 1000.0;

/// At most so many lights are named.
const MOST_NAMES: usize = 3;

/// Paths over any specular vertices to a surface.
const ANY: &str = ".*D[RT]+L";

/// Paths over other specular vertices than those of one pane that is passed through.
const OTHER_THAN_TT: &str = ".*D([RT]|[RT]*R[RT]*|TTT+)L";

/// Paths in through one face of a pane and out through the other.
const THROUGH_ONE_PANE: &str = ".*DTTL";

/// A class of paths.
struct Class {
    /// In words.
    text: String,
    /// A path expression that all of them match.
    paths: String,
}

impl Class {
    fn new(text: impl Into<String>, paths: impl Into<String>) -> Self {
        Self { text: text.into(), paths: paths.into() }
    }
}

/// Lights of which some do not reach some surfaces, or do so by chance.
struct Lights {
    /// What they are called.
    name: String,
    /// Whether a path may meet them by chance.
    can_be_met: bool,
}

impl Scene {
    /// The light of small lights that an image of this scene leaves to chance, in words, for its metadata.
    pub fn left_to_chance(&self) -> Vec<String> {
        let meshes =
            (0u32..).zip(self.meshes()).filter(|(_, mesh)| mesh.is_smooth()).map(|(mesh, _)| self.mesh_bounds(mesh));
        let glass: Vec<_> = self.panes().iter().map(Pane::world_bounds).chain(meshes).collect();
        self.description().left_to_chance_by(self.lights(), &glass)
    }
}

impl SceneDescription {
    /// As [`Scene::left_to_chance`], for these lights and boxes around what refracts or mirrors.
    pub(super) fn left_to_chance_by(&self, lights: &[Light], glass: &[[DVec3; 2]]) -> Vec<String> {
        let is_small = |solid_angle: f64| solid_angle < SMALL_SOLID_ANGLE;
        let small = lights.iter().filter(|light| {
            light.emission().max_element() > 0.0
                && glass.iter().any(|bounds| light.largest_solid_angle(*bounds).is_some_and(is_small))
        });
        self.left_to_chance_of(&small.map(|light| light.name.as_str()).collect::<Vec<_>>())
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
        if self.panes.is_empty() && !self.has_smooth_meshes() {
            return missing;
        }
        let mut classes = self.unfound_paths();
        if self.lights.iter().any(|light| light.build().is_delta()) {
            classes.extend(self.unowned_light(&Lights { name: "point lights".to_owned(), can_be_met: false }));
        }
        missing.extend(self.rendered(classes));
        missing
    }

    /// Light of the lights with these names, which are small, that no method owns.
    fn left_to_chance_of(&self, names: &[&str]) -> Vec<String> {
        if names.is_empty() {
            return Vec::new();
        }
        let quoted: Vec<String> = names.iter().take(MOST_NAMES).map(|name| format!("\"{name}\"")).collect();
        let name = match names.len() {
            1 => format!("the small light {}", quoted[0]),
            count if count <= MOST_NAMES => format!("the small lights {}", quoted.join(", ")),
            count => format!("{count} small lights, {} and so on,", quoted.join(", ")),
        };
        self.rendered(self.unowned_light(&Lights { name, can_be_met: true }))
    }

    /// Those classes of which the path filter lets some path through.
    fn rendered(&self, classes: Vec<Class>) -> Vec<String> {
        let filter = self.compiled_path_filter().ok().flatten();
        let is_rendered = |class: &Class| match (&filter, PathFilter::parse(&class.paths)) {
            (Some(filter), Ok(paths)) => filter.shares_a_path(&paths),
            _ => true,
        };
        classes.into_iter().filter(is_rendered).map(|class| class.text).collect()
    }

    fn has_smooth_meshes(&self) -> bool {
        let material = |mesh: &MeshDescription| self.materials.get(&mesh.material);
        self.meshes.iter().any(|mesh| material(mesh).is_some_and(|material| material.is_delta()))
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

    /// Paths through panes, whatever light they come from, that the path tracer leaves to the search and that it misses.
    fn unfound_paths(&self) -> Vec<Class> {
        match &self.integrator {
            IntegratorDescription::Path { .. }
            | IntegratorDescription::Cone { .. }
            | IntegratorDescription::Conic { search: ConicSearch::Complete | ConicSearch::WithoutRays, .. }
            | IntegratorDescription::Mnee { missed: MissedPaths::LeftToChance, .. } => Vec::new(),
            IntegratorDescription::Conic { search: ConicSearch::Published, chains, .. } => vec![Class::new(
                "paths over a smooth mesh but for the first that a walk from the straight line to the light meets",
                over(chains),
            )],
            IntegratorDescription::Mnee { missed: MissedPaths::Dropped, chains, .. } => vec![Class::new(
                "paths through a pane but for the one that a walk from the straight line to the light finds",
                over(chains),
            )],
            IntegratorDescription::Fnee { solver, max_trials, reflected, .. } => {
                unfound_by_fnee(*solver, *reflected, &cut_off(*max_trials))
            }
            IntegratorDescription::Sms { estimator: ManifoldEstimator::Unbiased { max_trials }, chains, .. } => {
                let text =
                    format!("paths over {} (chains) that a random seed {}", chains.join(" or "), cut_off(*max_trials));
                vec![Class::new(text, over(chains))]
            }
            IntegratorDescription::Sms { estimator: ManifoldEstimator::Biased { trials }, chains, .. } => {
                let text = format!(
                    "the part (1 - p)^{trials} of the light of each path over {} (chains), p being the probability with which a \
                     random seed finds it (trials)",
                    chains.join(" or ")
                );
                vec![Class::new(text, over(chains))]
            }
        }
    }

    /// Light of these lights that no method looks for: no path meets a point light by chance.
    fn unowned_light(&self, lights: &Lights) -> Vec<Class> {
        let of = &lights.name;
        let all = || format!("light of {of} that comes through or off a pane or a smooth mesh to a surface");
        let over_other = |chains: &[String]| {
            let text = format!("light of {of} over other specular vertices than {} (chains)", chains.join(", "));
            Class::new(text, other_than(chains))
        };
        match &self.integrator {
            IntegratorDescription::Cone { .. } if lights.can_be_met => {
                self.unowned_by_panes(of, PaneSelection::All, false)
            }
            IntegratorDescription::Path { .. } | IntegratorDescription::Cone { .. } => vec![Class::new(all(), ANY)],
            IntegratorDescription::Fnee { selection, reflected, .. } => {
                self.unowned_by_panes(of, *selection, *reflected)
            }
            IntegratorDescription::Sms { selection, chains, casters, receivers, .. } => {
                let mut classes = vec![over_other(chains)];
                classes.extend((!self.panes.is_empty()).then(|| between_the_faces(of, None)));
                classes.extend(unmarked(of, casters.as_deref(), receivers.as_deref()));
                classes.extend(unselected(of, *selection));
                classes
            }
            IntegratorDescription::Conic { chains, casters, receivers, .. } => {
                let text = format!("{}, but for that over one smooth mesh ({}; chains)", all(), chains.join(", "));
                let paths = if self.panes.is_empty() { other_than(chains) } else { ANY.to_owned() };
                let mut classes = vec![Class::new(text, paths)];
                classes.extend(unmarked(of, casters.as_deref(), receivers.as_deref()));
                classes
            }
            IntegratorDescription::Mnee { missed, chains, casters, receivers, .. } => {
                let is_named_already = lights.can_be_met && *missed == MissedPaths::Dropped;
                let found = chains.join(" or ");
                let first = if is_named_already {
                    over_other(chains)
                } else {
                    let but = "but for the one path over";
                    let by = "that a walk from the straight line to the light finds";
                    Class::new(format!("{}, {but} {found} {by}", all()), ANY)
                };
                let mut classes = vec![first];
                classes.extend(unmarked(of, casters.as_deref(), receivers.as_deref()));
                classes
            }
        }
    }

    /// As [`Self::unowned_light`], where a method looks for light through one pane.
    fn unowned_by_panes(&self, of: &str, selection: PaneSelection, reflected: bool) -> Vec<Class> {
        let mut classes = Vec::new();
        if !self.panes.is_empty() {
            let outside = if reflected { "" } else { "on its outside or " };
            let text = format!(
                "light of {of} that a pane reflects, {outside}between its faces, or that passes through more than one pane, on its \
                 way to a surface"
            );
            classes.push(Class::new(text, OTHER_THAN_TT));
            classes.push(between_the_faces(of, Some(libm::asin(GRAZING_COSINE).to_degrees())));
        }
        if self.has_smooth_meshes() {
            classes.push(Class::new(format!("light of {of} that comes by way of a smooth mesh to a surface"), ANY));
        }
        if !self.panes.is_empty() {
            classes.extend(unselected(of, selection));
        }
        classes
    }
}

/// What the search of `fnee` misses; `cut_off` says what a seed finds.
fn unfound_by_fnee(solver: FneeSolver, reflected: bool, cut_off: &str) -> Vec<Class> {
    match solver {
        FneeSolver::Complete => {
            let text = format!("paths through a pane that the enumeration misses and a random seed {cut_off}");
            let through = Class::new(text, THROUGH_ONE_PANE);
            let text = format!("paths off the outside of a pane that a random seed {cut_off}");
            let off = reflected.then(|| Class::new(text, ".*DRL"));
            [through].into_iter().chain(off).collect()
        }
        FneeSolver::Published => {
            let (ways, paths) = if reflected {
                ("through a pane or off its outside", ".*D(TT|R)L")
            } else {
                ("through a pane", THROUGH_ONE_PANE)
            };
            let saddles = "along which the optical length is no minimum: the published solver finds almost none";
            vec![
                Class::new(format!("paths {ways} {saddles}"), paths),
                Class::new(format!("paths {ways} that a random seed {cut_off}"), paths),
            ]
        }
    }
}

/// Paths over one of these chains of specular vertices.
fn over(chains: &[String]) -> String {
    format!(".*D({})L", chains.join("|"))
}

/// Paths over any other chain than these.
fn other_than(chains: &[String]) -> String {
    // At each place where a chain may differ: another letter, an end, or more letters.
    let others = chains.iter().flat_map(|chain| (0..=chain.len()).map(move |end| &chain[..end]));
    let starts: BTreeSet<&str> = others.chain([""]).collect();
    let differing = starts.iter().flat_map(|start| {
        let go_on = ["R", "T"].map(|letter| format!("{start}{letter}"));
        let fresh = go_on.into_iter().filter(|word| !starts.contains(word.as_str())).map(|word| format!("{word}[RT]*"));
        let ends_here = (!start.is_empty() && !chains.iter().any(|chain| chain == start)).then(|| (*start).to_owned());
        fresh.chain(ends_here)
    });
    format!(".*D({})L", differing.collect::<Vec<_>>().join("|"))
}

/// Light through panes that no method owns: at less than this angle [degrees], and too near to them.
fn between_the_faces(of: &str, grazing: Option<f64>) -> Class {
    let grazing = grazing.map_or(String::new(), |degrees| format!(" at less than {degrees:.2} degrees to it, or"));
    let text = format!(
        "light of {of} through a pane{grazing} to a surface that lies between the pane's highest and lowest point"
    );
    Class::new(text, ".*D[RT]*T[RT]*L")
}

/// What a selection of panes loses.
fn unselected(of: &str, selection: PaneSelection) -> Option<Class> {
    let lost = match selection {
        PaneSelection::All | PaneSelection::Random => return None,
        PaneSelection::Sharp => "any pane but the one that the straight line to the light meets first",
        PaneSelection::Bleed => "a pane to a surface from which nothing blocks the straight line to the light",
    };
    Some(Class::new(format!("light of {of} through {lost}"), ".*D[RT]*T[RT]*L"))
}

/// What is lost where only some things are marked.
fn unmarked(of: &str, casters: Option<&[String]>, receivers: Option<&[String]>) -> Vec<Class> {
    let other = |names: &[String], place| {
        let names = names.join(", ");
        Class::new(format!("light of {of} over specular vertices {place} other than {names}"), ANY)
    };
    let casters = casters.map(|names| other(names, "of which the first is on a pane or a mesh"));
    let receivers = receivers.map(|names| other(names, "to a mesh"));
    casters.into_iter().chain(receivers).collect()
}

/// What a search by chance loses. A path that a seed finds with probability p is weighted by the number of seeds until the
/// next success, cut off at N: on average by (1 - (1 - p)^N) / p instead of 1 / p.
fn cut_off(max_trials: u32) -> String {
    format!("finds with a small probability p, by up to the part (1 - p)^{max_trials} of their light (max_trials)")
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
            check(&missing(json!({integrator: {}}), 0..4), &[long, "through or off a pane or a smooth mesh"]);
        }
        check(&missing(json!({"mnee": {}}), 0..4), &[long, "but for the one path"]);
        check(&missing(json!({"conic": {"chains": ["T", "R"]}}), 0..4), &[long, "over one smooth mesh (T, R; chains)"]);
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
    fn other_chains_are_all_but_those_that_are_named() {
        let chains = ["TT", "R", "TRT"].map(str::to_owned);
        let other = PathFilter::parse(&other_than(&chains)).unwrap();
        for (chain, expected) in [
            ("TT", false),
            ("R", false),
            ("TRT", false),
            ("T", true),
            ("RR", true),
            ("TR", true),
            ("TTT", true),
            ("TRTR", true),
        ] {
            assert_eq!(other.shares_a_path(&PathFilter::parse(&format!("D{chain}L")).unwrap()), expected, "{chain}");
        }
    }

    #[test]
    fn light_of_small_lights_that_no_method_looks_for_is_named() {
        let of = |change: &dyn Fn(&mut Value)| {
            let mut scene = valid_scene();
            change(&mut scene);
            let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
            let bundle = crate::scene::SceneBundle::from_parts(description, std::collections::BTreeMap::new()).unwrap();
            Scene::build(&bundle).unwrap().left_to_chance()
        };
        let lights = "the small lights \"globe\", \"sun\", \"aperture\"";
        let found = of(&|_| {});
        check(
            &found,
            &["reflects, on its outside or between its faces, or that passes through more than one pane", "0.06"],
        );
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
        assert_eq!(of(&only(3)).len(), 2, "a sun is not");
        assert_eq!(under_the_sun(&|scene| scene["lights"][0]["sun"]["angular_radius"] = json!(2)), [""; 0]);
        assert_eq!(under_the_sun(&|scene| scene["lights"][0]["sun"]["radiance"] = json!([0, 0, 0])), [""; 0]);
        assert_eq!(under_the_sun(&|scene| scene["panes"] = json!([])), [""; 0]);
        assert_eq!(under_the_sun(&|scene| scene["path_filter"] = json!("D* L")), [""; 0]);
        let sun = "the small light \"sun\"";
        let with = |integrator: Value| under_the_sun(&|scene| scene["integrator"] = integrator.clone());
        check(
            &with(json!({"path": {}})),
            &[&format!("light of {sun} that comes through or off a pane or a smooth mesh")],
        );
        check(&with(json!({"sms": {"chains": ["TT", "R"]}})), &["than TT, R (chains)", "between the pane's"]);
        check(&with(json!({"mnee": {}})), &["but for the one path over TT"]);
        check(&with(json!({"mnee": {"missed": "dropped"}})), &["than TT (chains)"]);
        check(&with(json!({"conic": {}})), &["one smooth mesh (T; chains)"]);
        check(&with(json!({"fnee": {"selection": "sharp"}})), &["more than one pane", "0.06", "meets first"]);
    }
}
