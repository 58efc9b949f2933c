//! Lists of all paths from points of a receiver through a pane to a point light, found by brute force.
//!
//! The lists have the light of faces that each meet unpolarised light. Here it is multiplied by what both faces
//! transmit together over that.

use std::fs;

use clerestory_render_core::document;
use clerestory_render_core::integrator::PreparedScene;
use glam::DVec3;
use serde::Deserialize;
use serde_json::Value;

use crate::comparisons::reference_folder;
use crate::polarised_light::TwoFaces;
use crate::spline::Spline;
use crate::traced_pane::TracedPane;
use crate::traced_scene::{TracedLight, TracedScene};

/// A point and its paths.
#[derive(Deserialize)]
pub struct ListedPoint {
    /// The point.
    #[serde(rename = "O")]
    pub origin: [f64; 3],
    /// All paths.
    pub solutions: Vec<ListedSolution>,
}

/// A path.
#[derive(Deserialize)]
pub struct ListedSolution {
    /// Where it crosses the back, in units of the pane's size.
    pub back_uv: [f64; 2],
    /// Where it crosses the front.
    pub front_uv: [f64; 2],
    /// Irradiance at the point for a light of unit intensity.
    #[serde(rename = "E_per_unit_intensity")]
    pub irradiance: f64,
}

/// The points of a list, by its file name.
///
/// # Panics
///
/// When there is no such list.
pub fn load_list(file: &str) -> Vec<ListedPoint> {
    #[derive(Deserialize)]
    struct List {
        points: Vec<ListedPoint>,
    }
    let text = fs::read_to_string(reference_folder().join("solutions").join(file)).expect("the list ships");
    let mut points = serde_json::from_str::<List>(&text).expect("the list is valid").points;
    let case = file.trim_end_matches(".json").trim_end_matches("-folds");
    let scene = TracedScene::load(&reference_folder().join(format!("{case}-point.json"))).expect("the scene ships");
    let [TracedLight::Point { position: lamp, .. }] = scene.lights[..] else { panic!("a point light") };
    for ListedPoint { origin, solutions } in &mut points {
        for solution in solutions {
            solution.irradiance *= polarisation(&scene.panes[0], lamp, solution, (*origin).into());
        }
    }
    points
}

/// What a pane transmits along a path over what it would if each face met unpolarised light.
fn polarisation(pane: &TracedPane, lamp: DVec3, path: &ListedSolution, end: DVec3) -> f64 {
    let vertex = |spline: &Spline, base: f64, [u, v]: [f64; 2]| {
        let value = spline.value(u, v);
        let local = DVec3::new((u - 0.5) * pane.size.x, (v - 0.5) * pane.size.y, base + value.height);
        let normal = DVec3::new(-value.du / pane.size.x, -value.dv / pane.size.y, 1.0).normalize();
        (pane.origin + pane.vector_to_world(local), pane.vector_to_world(normal))
    };
    let (back, back_normal) = vertex(&pane.back, pane.thickness, path.back_uv);
    let (front, front_normal) = vertex(&pane.front, 0.0, path.front_uv);
    let directions = [back - lamp, front - back, end - front].map(DVec3::normalize);
    TwoFaces::new(directions, [back_normal, front_normal], pane.index_of_refraction).over_averages()
}

/// The scene of a case, with its point light.
///
/// # Panics
///
/// When there is no such case.
pub fn load_case(case: &str) -> PreparedScene {
    let bundle = document::load(&reference_folder().join(format!("{case}-point.json"))).expect("the scene ships");
    PreparedScene::build(&bundle).expect("the scene is valid")
}

/// The scene of a case with another integrator, as in a scene file.
///
/// # Panics
///
/// When there is no such case or integrator.
pub fn load_case_for(case: &str, integrator: &Value) -> PreparedScene {
    let bundle = document::load(&reference_folder().join(format!("{case}-point.json"))).expect("the scene ships");
    let mut description = bundle.description().clone();
    description.integrator = serde_json::from_value(integrator.clone()).expect("settings that the scene format knows");
    let bundle = bundle.with_description(description).expect("the changed scene is valid");
    PreparedScene::build(&bundle).expect("the scene is valid")
}
