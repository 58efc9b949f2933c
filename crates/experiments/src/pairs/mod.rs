//! Pairs of a scene and its light, on which every method is compared with `auto`. Each has a small reference.
//!
//! - `list`: the pairs, and what each is derived from;
//! - `changes`, `glassware`: scenes that differ from those that ship in glass or light;
//! - [`stored`]: the references, which a folder keeps with an index.

mod changes;
mod glassware;
mod list;
pub mod stored;

use clerestory_render_core::document::{SceneBundle, SceneDescription};
use clerestory_render_core::scene::SceneError;
use clerestory_render_core::scene::description::FilmDescription;

use crate::error::ExperimentError;
use crate::scenes::SAMPLING;

pub use self::list::{ALL, TAXES};

/// Pixels across and down the pictures of most pairs.
pub const SIZE: [u32; 2] = [64, 48];

/// A scene and its light.
#[derive(Debug)]
pub struct Pair {
    /// Its name in tables and files.
    pub name: &'static str,
    /// What lights it.
    pub light: &'static str,
    /// What the light goes through.
    pub glass: &'static str,
    /// The single methods that `auto` is compared with. Without any, the pair is there for its cost alone.
    pub methods: &'static [&'static str],
    /// The two methods that render the halves of the reference. The first one takes more of the time.
    pub halves: [&'static str; 2],
    /// Whether `auto` must be as good as the best single method on it.
    pub is_required: bool,
    /// Whether the picture is as wide as it is high.
    is_square: bool,
    build: fn() -> Result<SceneBundle, ExperimentError>,
}

/// What glass costs: one pair with glass, the same without.
#[derive(Debug)]
pub struct Tax {
    /// The scene.
    pub scene: &'static str,
    /// Its glass.
    pub glass: &'static str,
    /// The pair with glass.
    pub glazed: &'static str,
    /// The pair without.
    pub bare: &'static str,
    /// Most that the glass may multiply error times time by.
    pub limit: f64,
}

/// The pair of a name.
pub fn find(name: &str) -> Option<&'static Pair> {
    ALL.iter().find(|pair| pair.name == name)
}

impl Pair {
    /// Its scene, with a picture of a width and a height; square pictures are as wide as high.
    ///
    /// # Errors
    ///
    /// When the scene is not valid.
    pub fn bundle(&self, [width, height]: [u32; 2]) -> Result<SceneBundle, ExperimentError> {
        let bundle = (self.build)()?;
        let width = if self.is_square { height } else { width };
        let (film, seed, sampling) = (FilmDescription { width, height }, 0, SAMPLING);
        let description = SceneDescription { film, seed, sampling, ..bundle.description().clone() };
        bundle.with_description(description).map_err(|source| self.failure(source))
    }

    /// The failure of its scene.
    pub(crate) fn failure(&self, source: SceneError) -> ExperimentError {
        ExperimentError::scene(self.name.as_ref(), source)
    }
}

/// A scene with another integrator and seed. The integrator keeps what describes the scene.
///
/// # Errors
///
/// When there is no such integrator.
pub fn rendered_by(bundle: &SceneBundle, method: &str, seed: u64) -> Result<SceneBundle, SceneError> {
    let description = bundle.description().clone().with_seed(seed).with_integrator_named(method)?;
    bundle.clone().with_description(description)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use clerestory_render_core::integrator::PreparedScene;
    use clerestory_render_core::specular::registry::IntegratorDescription;

    use super::*;

    #[test]
    fn pairs_have_names_of_their_own_and_methods_that_there_are() {
        let names: BTreeSet<&str> = ALL.iter().map(|pair| pair.name).collect();
        assert_eq!(names.len(), ALL.len());
        for pair in ALL {
            for method in pair.methods.iter().chain(&pair.halves) {
                assert!(IntegratorDescription::NAMES.contains(method), "{}: {method}", pair.name);
            }
            assert_ne!(pair.halves[0], pair.halves[1], "{}", pair.name);
            assert!(pair.methods.is_empty() || pair.methods.contains(&"light"), "{}", pair.name);
        }
        assert!(ALL.iter().filter(|pair| !pair.methods.is_empty()).count() >= 16);
        assert_eq!(ALL.iter().filter(|pair| pair.is_required).count(), 8);
        for tax in TAXES {
            assert!(find(tax.glazed).is_some() && find(tax.bare).is_some(), "{}, {}", tax.scene, tax.glass);
        }
    }

    #[test]
    fn scenes_of_pairs_can_be_built_for_each_of_their_methods() {
        for pair in ALL {
            let bundle = pair.bundle([8, 6]).unwrap();
            for method in pair.methods.iter().chain(&pair.halves) {
                rendered_by(&bundle, method, 1).unwrap_or_else(|error| panic!("{}, {method}: {error}", pair.name));
            }
            // Thousands of pieces of glass take long.
            if !pair.name.starts_with("chapel") {
                let built = PreparedScene::build(&rendered_by(&bundle, "auto", 1).unwrap());
                built.unwrap_or_else(|error| panic!("{}: {error}", pair.name));
            }
        }
    }

    #[test]
    fn pairs_without_glass_have_no_panes() {
        for tax in TAXES {
            let [glazed, bare] = [tax.glazed, tax.bare].map(|name| find(name).unwrap().bundle([8, 6]).unwrap());
            let has_glass = |bundle: &SceneBundle| {
                let description = bundle.description();
                !(description.panes.is_empty() && description.windows.is_empty())
            };
            assert!(has_glass(&glazed) && !has_glass(&bare), "{}, {}", tax.scene, tax.glass);
        }
    }
}
