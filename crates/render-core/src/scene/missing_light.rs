//! What an image of a scene will lack: the light that the chosen integrator and its settings leave out.
//!
//! These are classes of paths. How much light there is in them depends on the scene.

use super::description::{
    ConicSearch, FneeSolver, IntegratorDescription, LightDescription, ManifoldEstimator, MaterialDescription,
    MeshDescription, MissedPaths, PaneSelection, SceneDescription,
};
use crate::specular::side::GRAZING_COSINE;

/// Vertices of the shortest path that brings light through a pane to a surface that the camera sees.
const VERTICES_THROUGH_PANE: u32 = 3;

impl SceneDescription {
    /// The light that an image of this scene lacks, in words, for its metadata.
    pub fn missing_light(&self) -> Vec<String> {
        if self.lights.is_empty() {
            return Vec::new();
        }
        let mut missing = Vec::new();
        if let Some(filter) = &self.path_filter {
            missing.push(format!("paths that do not match the path filter {filter}"));
        }
        missing.push(self.long_paths());
        if self.panes.is_empty() && !self.has_smooth_meshes() {
            return missing;
        }
        missing.extend(self.unfound_paths());
        if self.lights.iter().any(|light| matches!(light, LightDescription::Point { .. })) {
            missing.extend(self.light_of_points());
        }
        missing
    }

    fn has_smooth_meshes(&self) -> bool {
        let material = |mesh: &MeshDescription| self.materials.get(&mesh.material);
        self.meshes.iter().any(|mesh| !matches!(material(mesh), Some(MaterialDescription::Diffuse { .. })))
    }

    fn long_paths(&self) -> String {
        let most = self.integrator.max_depth();
        let paths = format!("paths of more than {most} vertices between camera and light (max_depth)");
        if most < VERTICES_THROUGH_PANE && !self.panes.is_empty() {
            return format!("{paths}, and so all light that comes through a pane to a surface");
        }
        paths
    }

    /// Paths through panes, whatever light they come from, that the path tracer leaves to the search and that it misses.
    fn unfound_paths(&self) -> Vec<String> {
        match self.integrator {
            IntegratorDescription::Path { .. }
            | IntegratorDescription::Cone { .. }
            | IntegratorDescription::Conic { search: ConicSearch::Complete | ConicSearch::WithoutRays, .. }
            | IntegratorDescription::Mnee { missed: MissedPaths::LeftToChance, .. } => Vec::new(),
            IntegratorDescription::Conic { search: ConicSearch::Published, .. } => vec![
                "paths over a smooth mesh but for the first that a walk from the straight line to the light meets"
                    .to_owned(),
            ],
            IntegratorDescription::Mnee { missed: MissedPaths::Dropped, .. } => vec![
                "paths through a pane but for the one that a walk from the straight line to the light finds".to_owned(),
            ],
            IntegratorDescription::Fnee { solver: FneeSolver::Complete, max_trials, reflected, .. } => {
                let cut_off = cut_off(max_trials);
                let through = format!("paths through a pane that the enumeration misses and a random seed {cut_off}");
                let off = reflected.then(|| format!("paths off the outside of a pane that a random seed {cut_off}"));
                [through].into_iter().chain(off).collect()
            }
            IntegratorDescription::Fnee { solver: FneeSolver::Published, max_trials, reflected, .. } => {
                let ways = if reflected { "through a pane or off its outside" } else { "through a pane" };
                vec![
                    format!(
                        "paths {ways} along which the optical length is no minimum: the published solver finds almost none"
                    ),
                    format!("paths {ways} that a random seed {}", cut_off(max_trials)),
                ]
            }
            IntegratorDescription::Sms {
                estimator: ManifoldEstimator::Unbiased { max_trials }, ref chains, ..
            } => {
                vec![format!("paths over {} (chains) that a random seed {}", chains.join(" or "), cut_off(max_trials))]
            }
            IntegratorDescription::Sms { estimator: ManifoldEstimator::Biased { trials }, ref chains, .. } => {
                vec![format!(
                    "the part (1 - p)^{trials} of the light of each path over {} (chains), p being the probability with which a \
                 random seed finds it (trials)",
                    chains.join(" or ")
                )]
            }
        }
    }

    /// Light of point lights, which no path meets by chance.
    fn light_of_points(&self) -> Vec<String> {
        match &self.integrator {
            IntegratorDescription::Path { .. } | IntegratorDescription::Cone { .. } => {
                vec!["light of point lights that comes through or off a pane or a smooth mesh to a surface".to_owned()]
            }
            IntegratorDescription::Fnee { selection, reflected, .. } => {
                self.light_of_points_without_fnee(*selection, *reflected)
            }
            IntegratorDescription::Sms { selection, chains, casters, receivers, .. } => {
                let mut missing = vec![
                    format!("light of point lights over other specular vertices than {} (chains)", chains.join(", ")),
                    between_the_faces(None),
                ];
                missing.extend(unmarked(casters.as_deref(), receivers.as_deref()));
                missing.extend(unselected(*selection));
                missing
            }
            IntegratorDescription::Conic { chains, casters, receivers, .. } => {
                let mut missing = vec![format!(
                    "light of point lights that comes through or off a pane or a smooth mesh to a surface, but for that over \
                     one smooth mesh ({}; chains)",
                    chains.join(", ")
                )];
                missing.extend(unmarked(casters.as_deref(), receivers.as_deref()));
                missing
            }
            IntegratorDescription::Mnee { chains, casters, receivers, .. } => {
                let mut missing = vec![format!(
                    "light of point lights that comes through or off a pane or a smooth mesh to a surface, but for the one \
                     path over {} that a walk from the straight line to the light finds",
                    chains.join(" or ")
                )];
                missing.extend(unmarked(casters.as_deref(), receivers.as_deref()));
                missing
            }
        }
    }

    fn light_of_points_without_fnee(&self, selection: PaneSelection, reflected: bool) -> Vec<String> {
        let outside = if reflected { "" } else { "on its outside or " };
        let mut missing = vec![
            format!(
                "light of point lights that a pane reflects, {outside}between its faces, or that passes through more than \
                 one pane, on its way to a surface"
            ),
            between_the_faces(Some(libm::asin(GRAZING_COSINE).to_degrees())),
        ];
        if self.has_smooth_meshes() {
            missing.push("light of point lights that comes by way of a smooth mesh to a surface".to_owned());
        }
        missing.extend(unselected(selection));
        missing
    }
}

/// Light through panes that no method owns: at less than this angle [degrees], and too near to them.
fn between_the_faces(grazing: Option<f64>) -> String {
    let grazing = grazing.map_or(String::new(), |degrees| format!(" at less than {degrees:.2} degrees to it, or"));
    format!(
        "light of point lights through a pane{grazing} to a surface that lies between the pane's highest and lowest point"
    )
}

/// What a selection of panes loses.
fn unselected(selection: PaneSelection) -> Option<String> {
    let lost = match selection {
        PaneSelection::All | PaneSelection::Random => return None,
        PaneSelection::Sharp => {
            "light of point lights through any pane but the one that the straight line to the light meets first"
        }
        PaneSelection::Bleed => {
            "light of point lights through a pane to a surface from which nothing blocks the straight line to the light"
        }
    };
    Some(lost.to_owned())
}

/// What is lost where only some things are marked.
fn unmarked(casters: Option<&[String]>, receivers: Option<&[String]>) -> Vec<String> {
    let other = |names: &[String], place| {
        let names = names.join(", ");
        format!("light of point lights over specular vertices {place} other than {names}")
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
}
