//! The probe: one small scene with glass and water, rendered with each method.
//!
//! The digests of its images tell machines and builds apart that compute other bits, before they render anything that
//! counts. Each method has digests of its own, so that a new method or a new probe case changes no digest of another.
//! Digests of images with the layer `caustic` have names of their own. So builds that lack it go on with other jobs.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::atomic::AtomicBool;

use crate::document::{SceneBundle, SceneDescription, WITH_CAUSTIC};
use crate::integrator::{PreparedScene, RenderError, render_node};
use crate::scene::SceneError;
use crate::specular::registry::IntegratorDescription;
use clerestory_film::{Node, NodeAddress, NodeLayers, Tile, store};

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
    /// all. A build that appends a case keeps the digests before it. Those of the images with the layer `caustic` have
    /// [`WITH_CAUSTIC`] behind the name.
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
        let [without, with] = images.digests_of_method(name, &lights, cases)?;
        methods.insert((*name).to_owned(), without);
        methods.insert(format!("{name}{WITH_CAUSTIC}"), with);
    }
    let mut hasher = blake3::Hasher::new();
    for case in FIRST_PROBE {
        hasher.update(&images.image(case)?.without_caustic);
    }
    Ok(ProbeDigests { methods, first: hasher.finalize().to_hex().to_string() })
}

/// The images of the cases that are rendered so far.
#[derive(Default)]
struct Images {
    by_case: BTreeMap<&'static str, Image>,
}

/// The bytes of an image.
#[derive(Default)]
struct Image {
    /// As builds render it that lack the layer `caustic`.
    without_caustic: Vec<u8>,
    with_caustic: Vec<u8>,
}

impl Images {
    /// The digest of the first case of a method, of its first two, and so on, each with an image that all methods
    /// share: without the layer `caustic`, and with it.
    fn digests_of_method(
        &mut self,
        name: &str,
        shared: &Image,
        cases: &[&'static str],
    ) -> Result<[Vec<String>; 2], ProbeError> {
        let versions: [fn(&Image) -> &[u8]; 2] = [|image| &image.without_caustic, |image| &image.with_caustic];
        let mut digests = [Vec::new(), Vec::new()];
        for (version, digests) in versions.iter().zip(&mut digests) {
            // With its name, no two methods have the same digests.
            let mut hasher = blake3::Hasher::new();
            hasher.update(name.as_bytes());
            hasher.update(version(shared));
            for case in cases {
                hasher.update(version(self.image(case)?));
                digests.push(hasher.finalize().to_hex().to_string());
            }
        }
        Ok(digests)
    }

    /// The image of a case.
    fn image(&mut self, case: &'static str) -> Result<&Image, ProbeError> {
        Ok(match self.by_case.entry(case) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(new) => new.insert(rendered(case)?),
        })
    }
}

/// Renders a case: a whole scene, or the probe's scene with one integrator.
fn rendered(case: &str) -> Result<Image, ProbeError> {
    let case: serde_json::Value = serde_json::from_str(case)?;
    if case.get("version").is_some() {
        return image(case);
    }
    let mut scene: serde_json::Value = serde_json::from_str(SCENE)?;
    scene["integrator"] = case;
    image(scene)
}

/// The first node of each plane of a scene.
fn image(scene: serde_json::Value) -> Result<Image, ProbeError> {
    let bundle = SceneBundle::from_parts(SceneDescription::parse(scene.to_string().as_bytes())?, BTreeMap::new())?;
    let film = bundle.description().film;
    let grid = bundle.description().grid(film.width.max(film.height)).with_caustic(true);
    let scene = PreparedScene::build(&bundle)?;
    let mut image = Image::default();
    for tile in 0..grid.len() {
        let address = NodeAddress { frame: 0, tile, level: 0, index: 0 };
        let node = render_node(&scene, &grid, address, &AtomicBool::new(false))?.node;
        image.with_caustic.extend(store::encode(&node));
        image.without_caustic.extend(store::encode(&without_caustic(node)?));
    }
    Ok(image)
}

/// A node without the layer `caustic`.
fn without_caustic(node: Node) -> Result<Node, RenderError> {
    let (address, sampling) = (node.address(), node.sampling());
    let tile = Tile { has_caustic: false, ..node.tile() };
    Ok(Node::from_layers(address, tile, sampling, NodeLayers { caustic: None, ..node.into_layers() })?)
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
        assert_eq!(methods.len(), 2 * IntegratorDescription::PROBES.len());
        assert!(methods.values().all(|digests| !digests.is_empty()), "{methods:?}");
        let all: Vec<&String> = methods.values().flatten().chain([first]).collect();
        assert_eq!(all.iter().collect::<BTreeSet<_>>().len(), all.len(), "{methods:?}");
    }

    #[test]
    fn every_case_of_the_first_probe_has_an_image_of_its_own() {
        let mut images = Images::default();
        let all: BTreeSet<Vec<u8>> =
            FIRST_PROBE.iter().map(|case| images.image(case).unwrap().without_caustic.clone()).collect();
        assert_eq!(all.len(), FIRST_PROBE.len());
    }

    #[test]
    fn an_appended_case_keeps_the_digests_before_it() {
        let mut images = Images::default();
        let shared = Image::default();
        let [before, after] =
            [1, 2].map(|cases| images.digests_of_method("path", &shared, &FIRST_PROBE[..cases]).unwrap());
        for (before, after) in before.iter().zip(&after) {
            assert_eq!((before.len(), after.len(), &before[0]), (1, 2, &after[0]));
            assert_ne!(after[0], after[1]);
        }
    }

    /// Jobs that older builds began go on only while this digest stays. A change of pixels on purpose changes it.
    #[test]
    fn the_digest_of_the_first_probe_stays() {
        let expected = "889de0ed9e24191b99836e4731486e0c17f28c27bac94f0cf1016c6d05a3d100";
        assert_eq!(DIGESTS.first, expected);
    }
}
