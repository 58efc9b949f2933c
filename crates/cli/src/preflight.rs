//! Scenes that are built on this machine before a farm has them.

use clerestory_api::{BuiltScene, JobView};
use clerestory_render_core::document::SceneBundle;
use clerestory_render_core::scene::SceneError;
use clerestory_worker::machine_memory;

use crate::activity::Activity;
use crate::local_scene::WAY_OUT;
use crate::progress::Progress;

/// What building a scene on this machine shows.
pub(crate) enum Preflight {
    /// The scene can be built.
    Built(BuiltScene),
    /// This machine has too little memory to build the scene. The machines of the farm may have more.
    TooLarge(SceneError),
}

impl Preflight {
    /// Builds a scene, shown as an activity, and drops it again. The user hears at once what a worker would refuse.
    pub(crate) fn of(bundle: &SceneBundle) -> Result<Self, SceneError> {
        Self::within(machine_memory(), bundle)
    }

    fn within(machine: Option<u64>, bundle: &SceneBundle) -> Result<Self, SceneError> {
        let activity = Activity::begin("Building the scene");
        let memory = bundle.memory()?;
        memory.check_counts()?;
        if let Some(Err(error)) = machine.map(|machine| memory.check(machine, WAY_OUT)) {
            activity.done("The scene is counted");
            return Ok(Self::TooLarge(error));
        }
        let scene = activity.build(bundle)?;
        activity.done("The scene is built");
        Ok(Self::Built(BuiltScene {
            left_to_chance: scene.left_to_chance(),
            chosen_methods: scene.chosen_methods(),
            import_notes: scene.import_notes().to_vec(),
        }))
    }

    /// Lists the notes on imports, the chosen methods and the light that an image of the scene lacks.
    pub(crate) fn announce(&self, missing_light: &[String], progress: &Progress) {
        match self {
            Self::Built(BuiltScene { left_to_chance, chosen_methods, import_notes }) => {
                progress.import_notes(import_notes);
                progress.chosen_methods(chosen_methods);
                progress.missing_light(missing_light, left_to_chance);
            }
            Self::TooLarge(error) => {
                progress.missing_light(missing_light, &[]);
                progress.note(&format!(
                    "This machine has too little memory to build the scene, so the workers find whether it can be \
                     rendered: {error}"
                ));
            }
        }
    }

    /// Lists what a worker has reported of a scene that is too large for this machine.
    pub(crate) fn announce_report(&self, job: &JobView, progress: &Progress) {
        if let Self::TooLarge(_) = self {
            progress.import_notes(job.import_notes.as_deref().unwrap_or_default());
            progress.chosen_methods(job.chosen_methods.as_deref().unwrap_or_default());
            progress.missing_light(&[], job.left_to_chance.as_deref().unwrap_or_default());
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use clerestory_render_core::document::SceneDescription;
    use serde_json::json;

    use super::*;

    /// A scene with a pane and a mirror at this height.
    fn glazed(mirror: f64) -> SceneBundle {
        let scene = json!({
            "version": 2,
            "name": "panes",
            "film": {"width": 8, "height": 8},
            "camera": {"orthographic": {"position": [0, 0, 3], "look_at": [0, 0, 0], "up": [0, 1, 0], "height": 1}},
            "materials": {"silver": {"mirror": {}}},
            "meshes": [{"name": "mirror", "material": "silver", "source": {"inline": {
                "positions": [[0, 0, mirror], [0.1, 0, mirror], [0, 0.1, mirror]], "triangles": [[0, 1, 2]]}}}],
            "panes": [{"name": "pane", "centre": [0, 0, 1], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0], "width": 0.5,
                "height": 0.5, "thickness": 0.004}],
            "lights": [{"sun": {
                "name": "sun", "direction": [0, 0.2, 1], "angular_radius": 0.267, "radiance": [1, 1, 1]
            }}]
        });
        let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
        SceneBundle::from_parts(description, BTreeMap::new()).unwrap()
    }

    #[test]
    fn a_scene_is_built_where_there_is_memory_and_otherwise_left_to_a_worker() {
        let preflight = |machine, mirror| Preflight::within(machine, &glazed(mirror));
        let built = preflight(None, 2.0).unwrap();
        assert!(matches!(built, Preflight::Built(scene) if !scene.chosen_methods.is_empty()));
        let error = preflight(None, 1.002).err().unwrap();
        assert_eq!(error.path(), "meshes[0].source");
        for mirror in [2.0, 1.002] {
            let left = preflight(Some(1), mirror).unwrap();
            assert!(matches!(left, Preflight::TooLarge(error) if error.to_string().contains(WAY_OUT)));
        }
    }
}
