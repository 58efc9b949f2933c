//! Scenes that are built in this process.

use clerestory_render_core::scene::{BuildStep, Scene, SceneBundle, SceneError, SceneMemory};
use clerestory_worker::machine_memory;

/// Builds a scene, unless the machine has less memory than that takes: the system would end the process without a word.
/// Tells of each step before it begins.
pub(crate) fn build(bundle: &SceneBundle, begin: &mut dyn FnMut(BuildStep<'_>)) -> Result<Scene, SceneError> {
    check_memory(bundle)?;
    Scene::build_step_by_step(bundle, begin)
}

/// Refuses a scene that takes more memory to build than this machine has.
pub(crate) fn check_memory(bundle: &SceneBundle) -> Result<(), SceneError> {
    match machine_memory() {
        Some(memory) => SceneMemory::of(bundle).check(memory, "a machine with more memory"),
        None => Ok(()),
    }
}
