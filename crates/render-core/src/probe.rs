//! The probe: one small scene with glass and water, rendered with every integrator, by whose bits builds and machines that compute other bits
//! are told apart before they render anything that counts.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

use crate::integrator::{RenderError, render_node};
use crate::scene::description::IntegratorDescription;
use crate::scene::{Scene, SceneBundle, SceneDescription, SceneError};
use clerestory_film::{NodeAddress, TileGrid, store};

/// The scene, without an integrator.
const SCENE: &str = include_str!("probe.json");

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
    for integrator in integrators() {
        hasher.update(&image(integrator)?);
    }
    Ok(hasher.finalize().to_hex().to_string())
}

/// The settings under which each method is probed.
fn integrators() -> impl Iterator<Item = &'static str> {
    IntegratorDescription::PROBES.iter().flat_map(|(_, probes)| probes.iter().copied())
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
        let images: Vec<Vec<u8>> = integrators().map(|integrator| image(integrator).unwrap()).collect();
        for (number, image) in images.iter().enumerate() {
            for other in &images[..number] {
                assert_ne!(image, other, "{}", integrators().nth(number).unwrap());
            }
        }
        assert_eq!(digest().unwrap(), digest().unwrap());
    }
}
