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
    if let Some(memory) = machine_memory() {
        bundle.memory()?.check(memory, WAY_OUT)?;
    }
    PreparedScene::build_step_by_step(bundle, begin)
}
