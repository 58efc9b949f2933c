//! Scenes that are built in this process.

use clerestory_render_core::document::SceneBundle;
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::{BuildStep, SceneError};
use clerestory_worker::machine_memory;

/// What can be done for a scene that takes more memory than this machine has.
pub(crate) const WAY_OUT: &str = "a machine with more memory";

/// Builds a scene, unless the machine has less memory than that takes: the system would end the process without a word.
/// Tells of each step before it begins.
pub(crate) fn build(bundle: &SceneBundle, begin: &mut dyn FnMut(BuildStep<'_>)) -> Result<PreparedScene, SceneError> {
    check_memory(bundle)?;
    PreparedScene::build_step_by_step(bundle, begin)
}

/// Makes the scene of another frame of one that is built.
pub(crate) fn change(scene: PreparedScene, bundle: &SceneBundle) -> Result<PreparedScene, SceneError> {
    check_memory(bundle)?;
    scene.changed(bundle)
}

fn check_memory(bundle: &SceneBundle) -> Result<(), SceneError> {
    match machine_memory() {
        Some(memory) => bundle.memory()?.check(memory, WAY_OUT),
        None => Ok(()),
    }
}
