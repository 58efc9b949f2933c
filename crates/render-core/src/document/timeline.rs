//! The timeline of a scene: what differs from frame to frame, and the scene that each frame is.
//!
//! A frame is the scene with its own values for some members, and without a timeline. So its hash is that of a scene
//! file which says the same, and no other frame changes it.

use serde_json::Value;

use super::overrides::{Override, OverrideError, apply_to, document_of};
use super::{FrameDescription, SceneDescription};
use crate::settings::{JsonPath, SceneError};

impl SceneDescription {
    /// The number of frames: one without a timeline.
    pub fn frames(&self) -> u32 {
        u32::try_from(self.timeline.len()).unwrap_or(u32::MAX).max(1)
    }

    /// The scene of a frame, without a timeline.
    ///
    /// # Errors
    ///
    /// When there is no such frame, or what it sets makes no sense.
    pub fn frame(&self, number: u32) -> Result<Self, SceneError> {
        if self.timeline.is_empty() && number == 0 {
            return Ok(self.clone());
        }
        let frame = self.timeline.get(number as usize).ok_or_else(|| {
            let expected = format!("a frame from 0 to {}", self.frames() - 1);
            SceneError::value(&JsonPath::Root.member("timeline"), format_args!("no frame {number}"), expected)
        })?;
        Base::of(self).scene(number, frame)
    }

    /// The scenes of all frames of the timeline, with their numbers.
    pub(super) fn frame_scenes(&self) -> impl Iterator<Item = (u32, Result<Self, SceneError>)> {
        let base = (!self.timeline.is_empty()).then(|| Base::of(self));
        base.into_iter().flat_map(|base| {
            let numbered = (0..).zip(&self.timeline);
            numbered.map(move |(number, frame)| (number, base.scene(number, frame)))
        })
    }
}

/// The scene that frames differ from.
struct Base<'a> {
    /// With its timeline.
    description: &'a SceneDescription,
    /// Without it.
    document: Value,
}

impl<'a> Base<'a> {
    fn of(description: &'a SceneDescription) -> Self {
        let mut document = document_of(description);
        if let Some(members) = document.as_object_mut() {
            members.remove("timeline");
        }
        Self { description, document }
    }

    fn scene(&self, number: u32, frame: &FrameDescription) -> Result<SceneDescription, SceneError> {
        let changes = frame.set.iter().map(|(path, value)| Override::new(path, value.clone()));
        let changes = changes.collect::<Result<Vec<_>, _>>().map_err(|error| misplaced(number, error))?;
        let scene = apply_to(&changes, self.document.clone()).map_err(|error| misplaced(number, error))?;
        self.check_what_frames_share(number, &scene)?;
        scene.validate().map_err(|error| error.with_path(|path| Some(place_in_frame(number, path))))?;
        Ok(scene)
    }

    /// All frames of a job have one size and one grouping of samples.
    fn check_what_frames_share(&self, number: u32, scene: &SceneDescription) -> Result<(), SceneError> {
        let SceneDescription { version, film, sampling, .. } = self.description;
        let member = if scene.version != *version {
            "version"
        } else if scene.film != *film {
            "film"
        } else if scene.sampling != *sampling {
            "sampling"
        } else if !scene.timeline.is_empty() {
            "timeline"
        } else {
            return Ok(());
        };
        Err(SceneError::Value {
            path: set_of(number),
            found: format!("another {member}"),
            expected: format!("values that leave {member} as it is: all frames share it"),
        })
    }
}

fn set_of(number: u32) -> String {
    format!("timeline[{number}].set")
}

/// A place in the scene of a frame.
pub(super) fn place_in_frame(number: u32, path: &str) -> String {
    format!("timeline[{number}] sets {path}")
}

/// What is wrong with a change of a frame.
fn misplaced(number: u32, error: OverrideError) -> SceneError {
    match error {
        OverrideError::Value { source, .. } => source.with_path(|path| Some(place_in_frame(number, path))),
        other => SceneError::Structure { path: set_of(number), message: other.to_string() },
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use serde_json::json;

    use super::super::SceneBundle;
    use super::super::malformed_scenes::valid_scene;
    use super::*;

    fn bundle(timeline: Value) -> Result<SceneBundle, SceneError> {
        let mut scene = valid_scene();
        scene["timeline"] = timeline;
        SceneBundle::from_parts(SceneDescription::parse(scene.to_string().as_bytes())?, BTreeMap::new())
    }

    #[test]
    fn a_frame_is_the_scene_that_says_the_same() {
        let job = bundle(json!([{}, {"name": "sext", "set": {"seed": 7, "camera.position": [0.5, 1, 2]}}])).unwrap();
        assert_eq!(job.description().frames(), 2);
        let plain = SceneDescription::parse(valid_scene().to_string().as_bytes()).unwrap();
        let plain = SceneBundle::from_parts(plain, BTreeMap::new()).unwrap();
        assert_eq!(job.frame(0).unwrap().scene_hash(), plain.scene_hash());
        assert_eq!(plain.frame(0).unwrap().scene_hash(), plain.scene_hash());
        let mut changed = valid_scene();
        changed["seed"] = json!(7);
        let camera = changed["camera"].as_object_mut().unwrap().values_mut().next().unwrap();
        camera["position"] = json!([0.5, 1, 2]);
        let changed = SceneDescription::parse(changed.to_string().as_bytes()).unwrap();
        let changed = SceneBundle::from_parts(changed, BTreeMap::new()).unwrap();
        assert_eq!(job.frame(1).unwrap().scene_hash(), changed.scene_hash());
        assert_ne!(job.scene_hash(), plain.scene_hash(), "a job with frames is another job");
    }

    #[test]
    fn frames_that_are_appended_change_no_frame_before_them() {
        let frame = |seed: u64| json!({"set": {"seed": seed}});
        let (short, long) =
            (bundle(json!([frame(1), frame(2)])).unwrap(), bundle(json!([frame(1), frame(2), frame(3)])).unwrap());
        for number in [0, 1] {
            assert_eq!(short.frame(number).unwrap().scene_hash(), long.frame(number).unwrap().scene_hash());
        }
        let error = short.frame(2).unwrap_err().to_string();
        assert!(error.contains("no frame 2") && error.contains("0 to 1"), "{error}");
    }

    #[test]
    fn what_a_frame_cannot_set_is_named_with_its_frame() {
        let refused = |frame: Value, parts: &[&str]| {
            let error = bundle(json!([{}, frame])).unwrap_err().to_string();
            assert!(parts.iter().all(|part| error.contains(part)), "{error}");
        };
        refused(json!({"set": {"lights[sunny].direction": [0, 1, 0]}}), &["timeline[1].set", "sunny"]);
        refused(json!({"set": {"lights[": 1}}), &["timeline[1].set", "bracket"]);
        refused(json!({"set": {"seed": "seven"}}), &["timeline[1]", "seed"]);
        refused(json!({"set": {"film.width": 7}}), &["timeline[1].set", "film"]);
        refused(json!({"set": {"timeline": [{}]}}), &["timeline[1].set", "timeline"]);
        refused(json!({"sets": {}}), &["timeline[1]", "sets"]);
        refused(
            json!({"set": {"meshes[0].source": {"ply": {"file": "other.ply"}}}}),
            &["timeline[1]", "other.ply", "missing"],
        );
    }
}
