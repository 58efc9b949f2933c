//! The probe: one small scene with glass and water, rendered with each method.
//!
//! The digests of its images tell machines and builds apart that compute other bits, before they render anything that
//! counts. Each method has digests of its own, so that a new method or a new probe case changes no digest of another.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::atomic::AtomicBool;

use crate::document::{SceneBundle, SceneDescription};
use crate::integrator::{PreparedScene, RenderError, render_node};
use crate::scene::SceneError;
use crate::specular::registry::IntegratorDescription;
use clerestory_film::{NodeAddress, store};

/// The scene, without an integrator.
const SCENE: &str = include_str!("probe.json");

/// A scene with lights of every kind, more than are all asked, a mirror, and glass at large angles of incidence. What
/// all methods share is in each digest.
const LIGHTS: &str = include_str!("probe_lights.json");

/// The cases of the first probe, which had one digest for all methods. This list never changes, because jobs that older
/// builds began are pinned to its digest.
const FIRST_PROBE: [&str; 12] = [
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

/// Digests of the probe's images as this build renders them on this machine, in hexadecimal digits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProbeDigests {
    /// By the name of the method: the digest of its first probe case, of its first two, and so on. The last one covers
    /// all. A build that appends a case keeps the digests before it.
    pub methods: BTreeMap<String, Vec<String>>,
    /// The digest of the first probe, over all methods of that time. It is the only one that older builds know.
    pub first: String,
}

/// Renders the probe, each case once.
///
/// # Errors
///
/// [`ProbeError`] when what is built in does not fit together.
pub fn digests() -> Result<ProbeDigests, ProbeError> {
    let mut images = Images::default();
    let mut methods = BTreeMap::new();
    let lights = image(serde_json::from_str(LIGHTS)?)?;
    for (name, cases) in IntegratorDescription::PROBES {
        methods.insert((*name).to_owned(), images.digests_of_method(name, &lights, cases)?);
    }
    let mut hasher = blake3::Hasher::new();
    for case in FIRST_PROBE {
        hasher.update(images.image(case)?);
    }
    Ok(ProbeDigests { methods, first: hasher.finalize().to_hex().to_string() })
}

/// The images of the cases that are rendered so far.
#[derive(Default)]
struct Images {
    by_case: BTreeMap<&'static str, Vec<u8>>,
}

impl Images {
    /// The digest of the first case of a method, of its first two, and so on, each with an image that all methods
    /// share.
    fn digests_of_method(
        &mut self,
        name: &str,
        shared: &[u8],
        cases: &[&'static str],
    ) -> Result<Vec<String>, ProbeError> {
        // With its name, no two methods have the same digests.
        let mut hasher = blake3::Hasher::new();
        hasher.update(name.as_bytes());
        hasher.update(shared);
        let mut digests = Vec::new();
        for case in cases {
            hasher.update(self.image(case)?);
            digests.push(hasher.finalize().to_hex().to_string());
        }
        Ok(digests)
    }

    /// The bytes of the image of a case.
    fn image(&mut self, case: &'static str) -> Result<&[u8], ProbeError> {
        Ok(match self.by_case.entry(case) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(new) => new.insert(rendered(case)?),
        })
    }
}

/// Renders a case: a whole scene, or the probe's scene with one integrator.
fn rendered(case: &str) -> Result<Vec<u8>, ProbeError> {
    let case: serde_json::Value = serde_json::from_str(case)?;
    if case.get("version").is_some() {
        return image(case);
    }
    let mut scene: serde_json::Value = serde_json::from_str(SCENE)?;
    scene["integrator"] = case;
    image(scene)
}

/// The bytes of the first node of each plane of a scene.
fn image(scene: serde_json::Value) -> Result<Vec<u8>, ProbeError> {
    let bundle = SceneBundle::from_parts(SceneDescription::parse(scene.to_string().as_bytes())?, BTreeMap::new())?;
    let film = bundle.description().film;
    let grid = bundle.description().grid(film.width.max(film.height));
    let scene = PreparedScene::build(&bundle)?;
    let mut bytes = Vec::new();
    for tile in 0..grid.len() {
        let address = NodeAddress { frame: 0, tile, level: 0, index: 0 };
        bytes.extend(store::encode(&render_node(&scene, &grid, address, &AtomicBool::new(false))?.node));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::sync::LazyLock;

    use super::*;

    static DIGESTS: LazyLock<ProbeDigests> = LazyLock::new(|| digests().unwrap());

    #[test]
    fn every_method_has_digests_of_its_own() {
        let ProbeDigests { methods, first } = &*DIGESTS;
        assert_eq!(methods.len(), IntegratorDescription::PROBES.len());
        assert!(methods.values().all(|digests| !digests.is_empty()), "{methods:?}");
        let all: Vec<&String> = methods.values().flatten().chain([first]).collect();
        assert_eq!(all.iter().collect::<BTreeSet<_>>().len(), all.len(), "{methods:?}");
    }

    #[test]
    fn every_case_of_the_first_probe_has_an_image_of_its_own() {
        let mut images = Images::default();
        let all: BTreeSet<Vec<u8>> = FIRST_PROBE.iter().map(|case| images.image(case).unwrap().to_vec()).collect();
        assert_eq!(all.len(), FIRST_PROBE.len());
    }

    #[test]
    fn an_appended_case_keeps_the_digests_before_it() {
        let mut images = Images::default();
        let [before, after] = [1, 2].map(|cases| images.digests_of_method("path", &[], &FIRST_PROBE[..cases]).unwrap());
        assert_eq!((before.len(), after.len(), &before[0]), (1, 2, &after[0]));
        assert_ne!(after[0], after[1]);
    }

    /// Jobs that older builds began go on only while this digest stays. A change of pixels on purpose changes it.
    #[test]
    fn the_digest_of_the_first_probe_stays() {
        let expected = "889de0ed9e24191b99836e4731486e0c17f28c27bac94f0cf1016c6d05a3d100";
        assert_eq!(DIGESTS.first, expected);
    }
}
