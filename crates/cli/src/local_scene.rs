//! Scenes that are built in this process.

use clerestory_api::BuiltScene;
use clerestory_render_core::scene::{BuildStep, Scene, SceneBundle, SceneError, SceneMemory};
use clerestory_worker::machine_memory;

use crate::activity::Activity;
use crate::progress::Progress;

/// Builds a scene, unless the machine has less memory than that takes: the system would end the process without a word.
/// Tells of each step before it begins.
pub(crate) fn build(bundle: &SceneBundle, begin: &mut dyn FnMut(BuildStep<'_>)) -> Result<Scene, SceneError> {
    check_memory(bundle)?;
    Scene::build_step_by_step(bundle, begin)
}

fn check_memory(bundle: &SceneBundle) -> Result<(), SceneError> {
    match machine_memory() {
        Some(memory) => SceneMemory::of(bundle).check(memory, "a machine with more memory"),
        None => Ok(()),
    }
}

/// What this machine finds out about a scene before a farm has it.
pub(crate) enum Rehearsal {
    /// The scene can be built.
    Built(BuiltScene),
    /// This machine has too little memory to build the scene. The machines of the farm may have more.
    TooLarge(SceneError),
}

impl Rehearsal {
    /// Builds a scene and drops it again. The user hears at once what a worker would refuse.
    pub(crate) fn of(bundle: &SceneBundle, activity: &Activity) -> Result<Self, SceneError> {
        SceneMemory::of(bundle).check_counts()?;
        if let Err(error) = check_memory(bundle) {
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
