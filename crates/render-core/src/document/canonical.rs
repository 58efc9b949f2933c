//! The canonical form of a scene file, and the hash over it.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::Value;

use super::SceneDescription;
use super::schema::schema_value;
use crate::scene::{ContentHash, SceneHash};
use crate::settings::schema_place::Place;
use crate::specular::registry::IntegratorDescription;

/// The one way in which a scene is written when it is hashed. Members are in alphabetical order, without white space.
/// Numbers are the shortest decimals that read back as the same floating-point numbers. Version 1 writes out the
/// defaults of the members that it had at first. From version 2 on, members at their default are left out, so that new
/// members change no hash.
pub fn canonical_json(description: &SceneDescription) -> String {
    let mut value = serde_json::to_value(description).expect("every member of a scene has a form in JSON");
    if description.version > 1 {
        leave_out_defaults(&mut value, &Place::root(schema_value()));
    }
    let mut json = String::new();
    write_canonical(&value, &mut json);
    json
}

/// The hash of a scene with the assets of these names and hashes.
pub(super) fn scene_hash(description: &SceneDescription, assets: &BTreeMap<&str, ContentHash>) -> SceneHash {
    let json = canonical_json(description);
    let mut hasher = blake3::Hasher::new_derive_key(match description.version {
        1 => "clerestory scene hash, version 1",
        _ => "clerestory scene hash, version 2",
    });
    hasher.update(&(json.len() as u64).to_le_bytes());
    hasher.update(json.as_bytes());
    for (name, hash) in assets {
        hasher.update(&(name.len() as u64).to_le_bytes());
        hasher.update(name.as_bytes());
        hasher.update(hash.as_bytes());
    }
    SceneHash::from_bytes(*hasher.finalize().as_bytes())
}

/// Appends `value`. The order of members does not depend on how `serde_json` was configured.
fn write_canonical(value: &Value, json: &mut String) {
    match value {
        Value::Array(elements) => {
            json.push('[');
            for (index, element) in elements.iter().enumerate() {
                if index > 0 {
                    json.push(',');
                }
                write_canonical(element, json);
            }
            json.push(']');
        }
        Value::Object(members) => {
            let members: BTreeMap<&String, &Value> = members.iter().collect();
            json.push('{');
            for (index, (name, member)) in members.into_iter().enumerate() {
                if index > 0 {
                    json.push(',');
                }
                json.push_str(&Value::from(name.as_str()).to_string());
                json.push(':');
                write_canonical(member, json);
            }
            json.push('}');
        }
        scalar => json.push_str(&scalar.to_string()),
    }
}

/// Removes members that are at their default, at any depth.
fn leave_out_defaults(value: &mut Value, place: &Place<'_>) {
    match value {
        Value::Object(members) => members.retain(|name, member| {
            let below = place.member(name);
            let is_default = below.default() == Some(member);
            if !is_default {
                leave_out_defaults(member, &below);
            }
            !is_default
        }),
        // Only objects have members, and lists of numbers are long.
        Value::Array(elements) if elements.iter().any(Value::is_object) => {
            for (index, element) in elements.iter_mut().enumerate() {
                leave_out_defaults(element, &place.element(index));
            }
        }
        _ => (),
    }
}

/// What an image says of the scene from which it comes.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct SceneHeader {
    /// The seed.
    #[serde(default)]
    pub seed: u64,
    /// The integrator and its settings.
    #[serde(default, deserialize_with = "IntegratorDescription::or_name")]
    pub integrator: IntegratorDescription,
}

impl SceneHeader {
    /// Reads it from a canonical scene.
    ///
    /// # Errors
    ///
    /// When the text is no canonical scene.
    pub fn read(canonical: &str) -> Result<Self, serde_json::Error> {
        serde_json::from_str(canonical)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::malformed_scenes::valid_scene;
    use super::super::scene_schema;
    use super::super::shipped_scenes::{read, shipped};
    use super::*;

    fn canonical(scene: &Value) -> Value {
        let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
        serde_json::from_str(&canonical_json(&description)).unwrap()
    }

    #[test]
    fn from_version_2_members_at_their_default_are_left_out() {
        let mut scene = valid_scene();
        scene["version"] = json!(2);
        scene["integrator"] =
            json!({"sms": {"selection": "all", "estimator": {"unbiased": {"max_trials": 10_000_000}}}});
        scene["seed"] = json!(0);
        scene["sampling"] = json!({"samples_per_pass": 16, "samples_per_block": 128});
        let short = canonical(&scene);
        assert_eq!(short["integrator"], json!({"sms": {}}));
        assert_eq!(short["sampling"], json!({"samples_per_block": 128}));
        assert!(short.get("seed").is_none() && short.get("path_filter").is_none(), "{short}");
        scene["integrator"] = json!("auto");
        assert!(canonical(&scene).get("integrator").is_none());
        scene["integrator"] = json!({"auto": {"max_depth": 7}});
        assert_eq!(canonical(&scene)["integrator"], scene["integrator"]);
        scene["version"] = json!(1);
        assert_eq!(canonical(&scene)["seed"], 0);
    }

    /// Each default in the schema, with the places to which it belongs.
    fn defaults(schema: &Value, path: &str, found: &mut Vec<String>) {
        let Some(members) = schema.as_object() else {
            for (index, element) in schema.as_array().into_iter().flatten().enumerate() {
                defaults(element, &format!("{path}/{index}"), found);
            }
            return;
        };
        for (name, member) in members {
            if name == "default" && !path.ends_with("/properties") {
                found.push(format!("{path} {member}"));
            } else {
                // What a choice is called says where it is; its number does not.
                defaults(member, &format!("{path}/{name}"), found);
            }
        }
    }

    /// A scene says nothing of a member that is at its default, so a default is part of what its hash means.
    #[test]
    fn the_defaults_of_version_2_never_change() {
        let mut found = Vec::new();
        defaults(&scene_schema().to_value(), "", &mut found);
        let of_members: Vec<String> = found.iter().map(|line| member_of(line)).collect();
        for line in include_str!("defaults_of_version_2.txt").lines() {
            assert!(
                of_members.iter().any(|found| found == line),
                "a default of version 2 has changed: {line}. Scenes of version 2 would keep their hash and change \
                 their image: raise the version of the format instead"
            );
        }
        assert!(found.len() > 30, "{found:#?}");
    }

    /// A default without the numbers of the choices on the way to it.
    fn member_of(line: &str) -> String {
        let (path, value) = line.split_once(' ').unwrap_or((line, ""));
        let is_name =
            |part: &&str| !["", "properties", "oneOf", "anyOf", "$defs"].contains(part) && part.parse::<u32>().is_err();
        format!("{} {value}", path.split('/').filter(is_name).collect::<Vec<_>>().join("."))
    }

    #[test]
    fn the_canonical_form_reads_back_as_the_same_scene() {
        for file in shipped() {
            let name = file.display();
            for version in [1, 2] {
                let mut scene = read(&file);
                scene["version"] = json!(version);
                let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
                let canonical = canonical_json(&description);
                let again = SceneDescription::parse(canonical.as_bytes()).unwrap();
                assert_eq!(again, description, "{name}");
                assert_eq!(canonical_json(&again), canonical, "{name}");
                let header = SceneHeader::read(&canonical).unwrap();
                assert_eq!((header.seed, header.integrator), (again.seed, again.integrator), "{name}");
            }
        }
    }

    #[test]
    fn canonical_numbers_are_the_shortest_that_read_back() {
        let mut json = String::new();
        write_canonical(&serde_json::json!({"b": 0.1, "a": [1e-7, 1.0, 3]}), &mut json);
        assert_eq!(json, r#"{"a":[1e-7,1.0,3],"b":0.1}"#);
    }
}
