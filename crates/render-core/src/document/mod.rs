//! The scene file as a whole: the things of a scene, and how they are rendered.
//!
//! `description` holds the type of the file, with the settings of film, sampling and integrator; `docs/scene-format.md`
//! is its manual. A description plus the bytes of the assets that it names is a [`SceneBundle`]: what is hashed, sent
//! to the farm, and rendered. `overrides` changes members by their paths, and `timeline` makes a scene of each frame by
//! such changes. `nave` and `water` make scenes of any size.

mod bundle;
mod canonical;
pub mod chapel;
mod daylight;
mod daylight_description;
mod description;
#[cfg(test)]
mod hostile_scenes;
mod imports;
mod integrators;
#[cfg(test)]
pub(crate) mod malformed_scenes;
mod missing_light;
mod model_scene;
pub mod nave;
mod overrides;
mod parse;
mod path;
mod path_filter;
mod planes;
mod schema;
#[cfg(test)]
mod shipped_scenes;
mod syntax;
mod timeline;
mod triangles;
mod validate;
mod validate_integrator;
pub mod water;
pub mod window_scene;

pub use bundle::{SceneBundle, asset_names, load};
pub use canonical::{SceneHeader, canonical_json};
pub use daylight::SunOfScene;
pub use daylight_description::{DaylightDescription, MomentDescription, SiteDescription, SunStrength};
pub use description::{FrameDescription, SamplingDescription, SceneDescription};
pub use imports::{MAX_NOTE_CHARACTERS, MAX_NOTES};
pub use integrators::{IntegratorEntry, integrators};
pub use model_scene::{ModelOptions, ModelScene, is_model, scene_around};
pub use overrides::{Override, OverrideError, apply};
pub use path_filter::{FilterState, PathEvent, PathFilter, PathFilterError};
pub use planes::WITH_CAUSTIC;
pub use schema::scene_schema;
