//! The probe: one small scene with glass and water, rendered with every integrator, by whose bits builds and machines that compute other bits
//! are told apart before they render anything that counts.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

use crate::integrator::{RenderError, render_node};
use crate::scene::{Scene, SceneBundle, SceneDescription, SceneError};
use clerestory_film::{NodeAddress, TileGrid, store};

/// The scene, without an integrator.
const SCENE: &str = include_str!("probe.json");

/// The integrators: each method, and each of its forms that has code of its own.
const INTEGRATORS: [&str; 12] = [
    r#"{"path": {}}"#,
    r#"{"cone": {}}"#,
    r#"{"fnee": {"reflected": true}}"#,
    r#"{"fnee": {"solver": "published", "max_trials": 20}}"#,
    r#"{"sms": {"estimator": {"unbiased": {"max_trials": 20}}}}"#,
    r#"{"sms": {"constraint": "half_vector", "estimator": {"biased": {"trials": 4}}}}"#,
    r#"{"sms": {"chains": ["T"], "casters": ["water"], "estimator": {"biased": {"trials": 4}}}}"#,
    r#"{"sms": {"steps": "published", "selection": "random", "estimator": {"biased": {"trials": 4}}}}"#,
    r#"{"mnee": {}}"#,
    r#"{"mnee": {"chains": ["T"], "casters": ["water"]}}"#,
    r#"{"conic": {"casters": ["water"], "chains": ["T", "R"]}}"#,
    r#"{"conic": {"casters": ["water"], "search": "published"}}"#,
];

/// The probe cannot be rendered: what is built in does not fit together.
#[derive(Debug, thiserror::Error)]
pub enum ProbeError {
    /// The scene is not JSON.
    #[error("the scene of the probe cannot be read")]
    Json(#[from] serde_json::Error),
    /// The scene cannot be built.
    #[error("the scene of the probe cannot be built")]
    Scene(#[from] SceneError),
    /// It cannot be rendered.
    #[error("the probe cannot be rendered")]
    Render(#[from] RenderError),
}

/// Hash of the probe's images as this build renders them on this machine, in hexadecimal digits. Takes a fraction of a second.
///
/// # Errors
///
/// [`ProbeError`] when what is built in does not fit together.
pub fn digest() -> Result<String, ProbeError> {
    let mut hasher = blake3::Hasher::new();
    for integrator in INTEGRATORS {
        hasher.update(&image(integrator)?);
    }
    Ok(hasher.finalize().to_hex().to_string())
}

/// The bytes of the image with one integrator.
fn image(integrator: &str) -> Result<Vec<u8>, ProbeError> {
    let mut scene: serde_json::Value = serde_json::from_str(SCENE)?;
    scene["integrator"] = serde_json::from_str(integrator)?;
    let bundle = SceneBundle::from_parts(SceneDescription::parse(scene.to_string().as_bytes())?, BTreeMap::new())?;
    let film = bundle.description().film;
    let grid = TileGrid { width: film.width, height: film.height, tile_size: film.width.max(film.height) };
    let address = NodeAddress { frame: 0, tile: 0, level: 0, index: 0 };
    let rendered = render_node(&Scene::build(&bundle)?, &grid, address, &AtomicBool::new(false))?;
    Ok(store::encode(&rendered.node))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_integrator_has_an_image_of_its_own_with_light_in_it() {
        let images: Vec<Vec<u8>> = INTEGRATORS.iter().map(|integrator| image(integrator).unwrap()).collect();
        for (number, image) in images.iter().enumerate() {
            for other in &images[..number] {
                assert_ne!(image, other, "{}", INTEGRATORS[number]);
            }
        }
        assert_eq!(digest().unwrap(), digest().unwrap());
    }
}
