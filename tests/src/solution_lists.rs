//! Lists of all paths from points of a receiver through a pane to a point light, found by brute force.

use std::fs;

use clerestory_render_core::document;
use clerestory_render_core::integrator::PreparedScene;
use serde::Deserialize;
use serde_json::Value;

use crate::comparisons::reference_folder;

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
    serde_json::from_str::<List>(&text).expect("the list is valid").points
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
