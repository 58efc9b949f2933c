//! From the text of a scene file to a valid description, and the changes that a command line may ask for.

use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::Value;

use super::SceneDescription;
use super::syntax::{not_utf_8, refuse_other_formats, with_hint};
use crate::scene::description::FilmDescription;
use crate::settings::limits::MAX_SCENE_BYTES;
use crate::settings::{JsonPath, SceneError, is_readable};
use crate::specular::registry::IntegratorDescription;
use clerestory_film::file_format::without_byte_order_mark;

impl SceneDescription {
    /// Reads and validates a scene file.
    ///
    /// # Errors
    ///
    /// The first thing that is wrong, with its place, what stands there and what would be right.
    pub fn parse(json: &[u8]) -> Result<Self, SceneError> {
        let description = Self::read(json)?;
        description.validate()?;
        Ok(description)
    }

    /// Reads a scene file that is validated later.
    pub(crate) fn read(json: &[u8]) -> Result<Self, SceneError> {
        let json = without_byte_order_mark(json);
        if json.len() > MAX_SCENE_BYTES {
            refuse_other_formats(json)?;
            let found = format!("{} bytes", json.len());
            let expected = format!("at most {MAX_SCENE_BYTES} bytes: large meshes belong into PLY files");
            return Err(SceneError::value(&JsonPath::Root, found, expected));
        }
        check_syntax_and_version(json)?;
        let description: Self = serde_path_to_error::deserialize(&mut serde_json::Deserializer::from_slice(json))
            .map_err(SceneError::from_json)?;
        check_shape(json, &description)?;
        Ok(description)
    }

    /// The same scene with the integrator of this name: with its settings where the scene has it already, else with the
    /// default ones and the scene's `max_depth`.
    ///
    /// # Errors
    ///
    /// When no integrator has that name.
    pub fn with_integrator_named(self, name: &str) -> Result<Self, SceneError> {
        let Some(integrator) = self.integrator.named(name) else {
            let names: Vec<String> = IntegratorDescription::NAMES.iter().map(|name| format!("\"{name}\"")).collect();
            let expected = names.join(" or ");
            return Err(SceneError::value(&JsonPath::Root.member("integrator"), format_args!("\"{name}\""), expected));
        };
        Ok(Self { integrator, ..self })
    }

    /// The same scene with another seed.
    pub fn with_seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// The same scene with another size of the image, in pixels.
    ///
    /// # Errors
    ///
    /// When an edge is out of range.
    pub fn with_size(self, width: u32, height: u32) -> Result<Self, SceneError> {
        let description = Self { film: FilmDescription { width, height }, ..self };
        description.validate()?;
        Ok(description)
    }
}

/// Refuses text that is not JSON, and a file of another version before anything else in it is judged: all versions of
/// the format have the member `version`.
fn check_syntax_and_version(json: &[u8]) -> Result<(), SceneError> {
    #[derive(Deserialize)]
    struct VersionOnly {
        version: Option<Value>,
        /// What every glTF file has.
        asset: Option<Value>,
    }
    let syntax = |message| SceneError::Syntax { message };
    if let Err(error) = str::from_utf8(json) {
        refuse_other_formats(json)?;
        return Err(syntax(not_utf_8(json, error.valid_up_to())));
    }
    if let Err(error) = serde_json::from_slice::<IgnoredAny>(json) {
        refuse_other_formats(json)?;
        return Err(syntax(with_hint(json, &error)));
    }
    if !json.trim_ascii_start().starts_with(b"{") {
        return Err(SceneError::value(&JsonPath::Root, "JSON that is no object", "an object: a scene"));
    }
    match serde_json::from_slice(json) {
        Ok(VersionOnly { version: Some(version), .. })
            if version.is_number() && !version.as_u64().is_some_and(is_readable) =>
        {
            Err(SceneError::UnsupportedVersion { found: version.to_string() })
        }
        Ok(VersionOnly { version: None, asset: Some(_) }) => refuse_other_formats(json),
        _ => Ok(()),
    }
}

/// Refuses other spellings of the same scene. The JSON reader takes an array of values for an object, and
/// `{"flat": null}` for `"flat"`; the schema and other readers do not.
fn check_shape(json: &[u8], description: &SceneDescription) -> Result<(), SceneError> {
    let found: Value =
        serde_json::from_slice(json).map_err(|error| SceneError::Syntax { message: error.to_string() })?;
    let expected = serde_json::to_value(description).expect("every member of a scene has a form in JSON");
    compare_shapes(&found, &expected, &JsonPath::Root)
}

fn compare_shapes(found: &Value, expected: &Value, path: &JsonPath<'_>) -> Result<(), SceneError> {
    match (found, expected) {
        (Value::Object(found), Value::Object(expected)) => found.iter().try_for_each(|(name, member)| {
            expected.get(name).map_or(Ok(()), |expected| compare_shapes(member, expected, &path.member(name)))
        }),
        (Value::Array(found), Value::Array(expected)) => (0..)
            .zip(found.iter().zip(expected))
            .try_for_each(|(index, (found, expected))| compare_shapes(found, expected, &path.element(index))),
        // A choice by its name alone, with its usual settings.
        (Value::String(found), Value::Object(expected)) if expected.len() == 1 && expected.contains_key(found) => {
            Ok(())
        }
        (found, Value::Object(_)) => Err(SceneError::value(path, kind(found), "an object")),
        (found, Value::Array(_)) => Err(SceneError::value(path, kind(found), "an array")),
        (Value::Object(_), expected) => Err(SceneError::value(path, "an object", expected)),
        _ => Ok(()),
    }
}

fn kind(value: &Value) -> &'static str {
    match value {
        Value::Object(_) => "an object",
        Value::Array(_) => "an array",
        _ => "a single value",
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::malformed_scenes::valid_scene;
    use super::*;

    #[test]
    fn an_integrator_is_named_with_or_without_settings_and_is_auto_without_a_name() {
        let read = |change: &dyn Fn(&mut Value)| {
            let mut scene = valid_scene();
            change(&mut scene);
            SceneDescription::parse(scene.to_string().as_bytes()).map(|scene| scene.integrator)
        };
        let usual = |name: &str| read(&|scene| scene["integrator"] = json!({name: {}})).unwrap();
        for name in IntegratorDescription::NAMES {
            assert_eq!(read(&|scene| scene["integrator"] = json!(name)).unwrap(), usual(name));
        }
        let without = read(&|scene| _ = scene.as_object_mut().unwrap().remove("integrator"));
        assert_eq!(without.unwrap(), usual("auto"));
        let error = read(&|scene| scene["integrator"] = json!("magic")).unwrap_err().to_string();
        assert!(error.starts_with("integrator: unknown variant `magic`, expected one of `auto`"), "{error}");
    }
}
