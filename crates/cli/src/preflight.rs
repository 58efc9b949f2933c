//! Scenes that are built on this machine before a farm has them.

use clerestory_api::BuiltScene;
use clerestory_render_core::scene::{SceneBundle, SceneError, SceneMemory};

use crate::activity::Activity;
use crate::local_scene;
use crate::progress::Progress;

/// What building a scene on this machine shows.
pub(crate) enum Preflight {
    /// The scene can be built.
    Built(BuiltScene),
    /// This machine has too little memory to build the scene. The machines of the farm may have more.
    TooLarge(SceneError),
}

impl Preflight {
    /// Builds a scene and drops it again. The user hears at once what a worker would refuse.
    pub(crate) fn of(bundle: &SceneBundle, activity: &Activity) -> Result<Self, SceneError> {
        SceneMemory::of(bundle).check_counts()?;
        if let Err(error) = local_scene::check_memory(bundle) {
            return Ok(Self::TooLarge(error));
        }
        let scene = activity.build(bundle)?;
        let (left_to_chance, chosen_methods) = (scene.left_to_chance(), scene.chosen_methods());
        Ok(Self::Built(BuiltScene { left_to_chance, chosen_methods }))
    }

    /// Lists the chosen methods and the light that an image of the scene lacks.
    pub(crate) fn announce(&self, missing_light: &[String], progress: &Progress) {
        match self {
            Self::Built(BuiltScene { left_to_chance, chosen_methods }) => {
                progress.chosen_methods(chosen_methods);
                progress.missing_light(missing_light, left_to_chance);
            }
            Self::TooLarge(error) => {
                progress.missing_light(missing_light, &[]);
                progress.note(&format!(
                    "This machine has too little memory to build the scene, so the first worker that builds it decides \
                     whether it can be rendered: {error}"
                ));
            }
        }
    }
}
