//! Scenes that are built in this process.

use clerestory_render_core::scene::{BuildStep, Scene, SceneBundle, SceneError, SceneMemory, SceneUse};
use clerestory_worker::machine_memory;

/// Builds a scene, unless the machine has less memory than that takes: the system would end the process without a word.
/// Tells of each step before it begins.
pub(crate) fn build(bundle: &SceneBundle, begin: &mut dyn FnMut(BuildStep<'_>)) -> Result<Scene, SceneError> {
    if let Some(memory) = machine_memory() {
        SceneMemory::of(bundle).check(SceneUse::Build, memory, "a machine with more memory")?;
    }
    Scene::build_step_by_step(bundle, begin)
}
