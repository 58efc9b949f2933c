//! Changes of a scene file, written as `PATH=VALUE`.

use std::str::FromStr;

use serde_json::{Map, Value};
use thiserror::Error;

use super::path::{Step, parse};
use super::schema::schema_value;
use crate::document::SceneDescription;
use crate::scene::SceneError;
use crate::settings::pattern::matches;
use crate::settings::schema_place::Place;
use crate::specular::registry::IntegratorDescription;

/// Another value for members of a scene file, such as `lights[sun].direction=[0, 1, 1]`. A value is JSON; text that is
/// not JSON is taken for a string.
#[derive(Clone, Debug, PartialEq)]
pub struct Override {
    text: String,
    steps: Vec<Step>,
    value: Value,
}

/// A change that cannot be made.
#[derive(Debug, Error)]
pub enum OverrideError {
    /// The text is no change.
    #[error("`{text}`: expected PATH=VALUE, such as lights[sun].direction=[0,1,1], with {expected}")]
    Text {
        /// The text.
        text: String,
        /// What it lacks.
        expected: String,
    },
    /// There is no such place in the scene.
    #[error("`{text}`: {place} {found}: expected {expected}")]
    Place {
        /// The change.
        text: String,
        /// How far the path leads.
        place: String,
        /// What is wrong there.
        found: String,
        /// What would be right.
        expected: String,
    },
    /// The scene makes no sense with the changes.
    #[error("{changes}: {source}")]
    Value {
        /// The changes.
        changes: String,
        /// Why.
        source: SceneError,
    },
}

impl FromStr for Override {
    type Err = OverrideError;

    fn from_str(text: &str) -> Result<Self, OverrideError> {
        let error = |expected: &str| OverrideError::Text { text: text.to_owned(), expected: expected.to_owned() };
        let (path, value) = divided(text).ok_or_else(|| error("an equals sign"))?;
        let steps = parse(path.trim()).map_err(|expected| error(&expected))?;
        let value = match serde_json::from_str(value) {
            Ok(value) => value,
            Err(problem) if value.trim_start().starts_with(['[', '{', '"']) => {
                return Err(error(&format!("a value that is JSON ({problem})")));
            }
            Err(_) => Value::String(value.to_owned()),
        };
        Ok(Self { text: text.to_owned(), steps, value })
    }
}

/// Path and value: what stands before and behind the first equals sign that is in no brackets.
fn divided(text: &str) -> Option<(&str, &str)> {
    let mut is_inside = false;
    let is_sign = |character: char| {
        is_inside = character == '[' || is_inside && character != ']';
        character == '=' && !is_inside
    };
    let at = text.find(is_sign)?;
    Some((&text[..at], &text[at + 1..]))
}

/// A scene with changes made, one after the other. It still has to be [validated](SceneDescription::validate): some
/// changes make sense together only, and with others.
///
/// # Errors
///
/// [`OverrideError`] when a path leads nowhere in this scene, or a value has the wrong type.
pub fn apply(changes: &[Override], description: &SceneDescription) -> Result<SceneDescription, OverrideError> {
    if changes.is_empty() {
        return Ok(description.clone());
    }
    apply_to(changes, document_of(description))
}

/// A scene as the JSON that changes are made in.
pub(super) fn document_of(description: &SceneDescription) -> Value {
    serde_json::to_value(description).expect("every member of a scene has a form in JSON")
}

/// The same, of a scene as [`document_of`] it.
pub(super) fn apply_to(changes: &[Override], mut document: Value) -> Result<SceneDescription, OverrideError> {
    for change in changes {
        change.check_integrator(&document)?;
        let root = Place::root(schema_value());
        change.set(&mut document, root, &change.steps)?;
        // A name alone stands for the usual settings, which later changes may name.
        let named = document["integrator"].as_str().and_then(|name| IntegratorDescription::default().named(name));
        if let Some(usual) = named {
            document["integrator"] = serde_json::to_value(usual).expect("settings have a form in JSON");
        }
    }
    SceneDescription::read(document.to_string().as_bytes()).map_err(|source| {
        let texts: Vec<String> = changes.iter().map(|change| format!("`{}`", change.text)).collect();
        OverrideError::Value { changes: texts.join(", "), source: source.without_place_in_text() }
    })
}

impl Override {
    /// A value for the member at a path.
    pub(super) fn new(path: &str, value: Value) -> Result<Self, OverrideError> {
        let text = format!("{path}={value}");
        match parse(path) {
            Ok(steps) => Ok(Self { text, steps, value }),
            Err(expected) => Err(OverrideError::Text { text, expected }),
        }
    }

    /// Another integrator is chosen by its name, not by one of its settings: that keeps what describes the scene.
    fn check_integrator(&self, document: &Value) -> Result<(), OverrideError> {
        let integrator = document.get("integrator").and_then(Value::as_object);
        let kind = integrator.and_then(|integrator| integrator.keys().next()).map_or("", String::as_str);
        match self.steps.as_slice() {
            [Step::Member(first), Step::Member(name), ..]
                if first == "integrator" && name != kind && IntegratorDescription::NAMES.contains(&name.as_str()) =>
            {
                let expected = format!("a setting of {kind}, or the integrator {name} beside it");
                Err(self.misplaced("integrator", &format!("is {kind}"), &expected))
            }
            _ => Ok(()),
        }
    }

    fn misplaced(&self, place: &str, found: &str, expected: &str) -> OverrideError {
        let place = if place.is_empty() { "the scene" } else { place };
        OverrideError::Place {
            text: self.text.clone(),
            place: place.to_owned(),
            found: found.to_owned(),
            expected: expected.to_owned(),
        }
    }

    fn set(&self, target: &mut Value, place: Place<'_>, steps: &[Step]) -> Result<(), OverrideError> {
        let Some((step, rest)) = steps.split_first() else {
            *target = self.value.clone();
            return Ok(());
        };
        match (step, target) {
            (Step::Element(pattern), Value::Array(elements)) => self.set_elements(elements, pattern, &place, rest),
            (Step::Element(pattern), Value::Object(members)) => self.set_members(members, pattern, &place, rest),
            (Step::Member(name), target @ (Value::Object(_) | Value::String(_))) => {
                // The name of a choice may be left out on the way to one of its settings.
                if let Some((chosen, settings)) = place.chosen(target)
                    && !place.is_choice_of(name)
                {
                    let below = place.member(&chosen);
                    return self.set(settings, below, steps);
                }
                let known = place.members();
                if !known.is_empty() && !known.contains(&name.as_str()) {
                    return Err(self.misplaced(place.path(), &format!("has no member {name}"), &known.join(", ")));
                }
                // A choice is an object with one member: another choice takes its place.
                if place.is_choice_of(name) && target.get(name).is_none() {
                    *target = Value::Object(Map::new());
                }
                let Value::Object(members) = target else {
                    return Err(self.misplaced(
                        place.path(),
                        &format!("has no member {name}"),
                        "a path that ends there",
                    ));
                };
                if !members.contains_key(name) {
                    if place.has_any_members() && !rest.is_empty() {
                        let known: Vec<&str> = members.keys().map(String::as_str).collect();
                        return Err(self.misplaced(place.path(), &format!("has no member {name}"), &known.join(", ")));
                    }
                    if let Some(Step::Element(element)) = rest.first() {
                        let found = format!("is not there, and has no element {element}");
                        return Err(self.misplaced(place.member(name).path(), &found, "the whole list as the value"));
                    }
                }
                let below = place.member(name);
                let member = members.entry(name.clone()).or_insert_with(|| Value::Object(Map::new()));
                self.set(member, below, rest)
            }
            (Step::Member(name), Value::Array(elements)) => {
                let expected = format!("an element in brackets, by its index from 0 or its name ({})", names(elements));
                Err(self.misplaced(place.path(), &format!("is a list and has no member {name}"), &expected))
            }
            (step, _) => {
                Err(self.misplaced(place.path(), &format!("has nothing like {step}"), "a path that ends there"))
            }
        }
    }

    fn set_elements(
        &self,
        elements: &mut [Value],
        pattern: &str,
        place: &Place<'_>,
        rest: &[Step],
    ) -> Result<(), OverrideError> {
        let known = names(elements);
        let count = elements.len();
        let index: Option<usize> = pattern.parse().ok();
        let is_named = |element: &Value| name_of(element).is_some_and(|name| matches(pattern, name));
        let chosen: Vec<usize> = match index {
            Some(index) if !elements.iter().any(is_named) => (index < count).then_some(index).into_iter().collect(),
            _ if pattern == "*" => (0..count).collect(),
            _ => (0..count).filter(|index| is_named(&elements[*index])).collect(),
        };
        let chosen = of_choice(pattern, rest, chosen, |index| place.element(*index), |index| &elements[*index]);
        if chosen.is_empty() {
            let expected = format!("an index below {count}, or a name ({known}), in which * stands for any text");
            return Err(self.misplaced(place.path(), &format!("has no element {pattern}"), &expected));
        }
        for index in chosen {
            self.set(&mut elements[index], place.element(index), rest)?;
        }
        Ok(())
    }

    fn set_members(
        &self,
        members: &mut Map<String, Value>,
        pattern: &str,
        place: &Place<'_>,
        rest: &[Step],
    ) -> Result<(), OverrideError> {
        let known: Vec<String> = members.keys().cloned().collect();
        let chosen: Vec<&String> = known.iter().filter(|name| matches(pattern, name)).collect();
        let chosen = of_choice(pattern, rest, chosen, |name| place.member(name), |name| &members[*name]);
        if chosen.is_empty() {
            return Err(self.misplaced(place.path(), &format!("has no member {pattern}"), &known.join(", ")));
        }
        for name in chosen {
            let member = members.get_mut(name).expect("it was found there");
            self.set(member, place.member(name), rest)?;
        }
        Ok(())
    }
}

/// Those things that a pattern has chosen in which the next step of the path stands already, where that names a choice:
/// a pattern changes settings of many things, and never what they are.
fn of_choice<'a, 'v, T>(
    pattern: &str,
    rest: &[Step],
    chosen: Vec<T>,
    place: impl Fn(&T) -> Place<'a>,
    value: impl Fn(&T) -> &'v Value,
) -> Vec<T> {
    let Some(Step::Member(name)) = rest.first().filter(|_| pattern.contains('*')) else { return chosen };
    let stays = |thing: &T| !place(thing).is_choice_of(name) || value(thing).get(name).is_some();
    chosen.into_iter().filter(stays).collect()
}

/// The name of an element: its member `name`, or that of the choice which it is.
fn name_of(element: &Value) -> Option<&str> {
    let own = |value: &Value| value.get("name").and_then(Value::as_str).is_some();
    let holder = if own(element) { element } else { element.as_object()?.values().find(|value| own(value))? };
    holder["name"].as_str()
}

fn names(elements: &[Value]) -> String {
    let names: Vec<&str> = elements.iter().filter_map(name_of).collect();
    if names.is_empty() { "none has one".to_owned() } else { names.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::malformed_scenes::valid_scene;

    fn changed(change: &str) -> Result<Value, OverrideError> {
        let scene = SceneDescription::parse(valid_scene().to_string().as_bytes()).unwrap();
        let changed = apply(&[change.parse()?], &scene)?;
        changed.validate().map_err(|source| OverrideError::Value { changes: format!("`{change}`"), source })?;
        Ok(serde_json::to_value(changed).unwrap())
    }

    #[track_caller]
    fn check(change: &str, pointers: &[&str], expected: &Value) {
        let changed = changed(change).unwrap();
        for pointer in pointers {
            assert_eq!(changed.pointer(pointer), Some(expected), "{change}: {pointer}");
        }
    }

    #[test]
    fn any_member_can_be_set() {
        check("film.width=40", &["/film/width"], &40.into());
        check("name=a nave", &["/name"], &"a nave".into());
        check("lights[sun].sun.angular_radius=0.5", &["/lights/3/sun/angular_radius"], &0.5.into());
        check("lights[sun].angular_radius=0.5", &["/lights/3/sun/angular_radius"], &0.5.into());
        check("lights[3].sun.direction=[0,1,1]", &["/lights/3/sun/direction"], &vec![0.0, 1.0, 1.0].into());
        check("panes[*].thickness=0.004", &["/panes/0/thickness", "/panes/1/thickness"], &0.004.into());
        check("panes[le*].thickness=0.004", &["/panes/0/thickness"], &0.004.into());
        check(
            "materials.stone.diffuse.reflectance.colour[1]=0.1",
            &["/materials/stone/diffuse/reflectance/colour/1"],
            &0.1.into(),
        );
        check("panes[1].front=flat", &["/panes/1/front"], &"flat".into());
        // What is left out of the file because it is as usual.
        check("path_filter=D TT L", &["/path_filter"], &"D TT L".into());
    }

    #[test]
    fn changes_that_make_sense_together_only_are_made_together() {
        let scene = SceneDescription::parse(valid_scene().to_string().as_bytes()).unwrap();
        let [fewer, smaller] = ["sampling.samples_per_block=64", "sampling.samples_per_pass=64"];
        let [first, second] = [fewer, smaller].map(|text| text.parse::<Override>().unwrap());
        let changed = apply(&[second.clone(), first.clone()], &scene).unwrap();
        assert_eq!((changed.sampling.samples_per_pass, changed.sampling.samples_per_block), (64, 64));
        assert!(changed.validate().is_ok());
        let third = "sampling.samples_per_pass=few".parse().unwrap();
        let message = apply(&[first, third], &scene).unwrap_err().to_string();
        for fragment in ["`sampling.samples_per_block=64`, `sampling.samples_per_pass=few`", "samples_per_pass", "u32"]
        {
            assert!(message.contains(fragment), "no {fragment:?} in: {message}");
        }
    }

    #[test]
    fn an_integrator_that_is_set_by_its_name_has_settings_to_be_set() {
        let scene = SceneDescription::parse(valid_scene().to_string().as_bytes()).unwrap();
        let changes = ["integrator=sms", "integrator.sms.chains=[\"T\"]", "integrator.max_depth=5"];
        let changes: Vec<Override> = changes.iter().map(|change| change.parse().unwrap()).collect();
        let set = serde_json::to_value(apply(&changes, &scene).unwrap().integrator).unwrap();
        assert_eq!((&set["sms"]["chains"][0], &set["sms"]["max_depth"]), (&"T".into(), &5.into()));
        let long = format!("path_filter{}=1", ".a".repeat(30_000));
        let message = long.parse::<Override>().unwrap_err().to_string();
        assert!(message.contains("at most 64"), "{message:.200}");
    }

    #[test]
    fn the_path_of_an_error_is_one_that_can_be_set() {
        let mut scene = valid_scene();
        scene["materials"]["old.stone"] = scene["materials"]["stone"].clone();
        scene["materials"]["old.stone"]["diffuse"]["reflectance"]["colour"][0] = 2.into();
        let scene = SceneDescription::read(scene.to_string().as_bytes()).unwrap();
        let error = scene.validate().unwrap_err();
        assert_eq!(error.path(), "materials[old.stone].diffuse.reflectance.colour[0]");
        let change: Override = format!("{}=0.5", error.path()).parse().unwrap();
        assert!(apply(&[change], &scene).unwrap().validate().is_ok());
    }

    #[test]
    fn a_pattern_changes_settings_and_never_what_things_are() {
        let painted = changed("materials[*].diffuse.reflectance.colour=[0.1,0.2,0.3]").unwrap();
        assert_eq!(painted["materials"]["stone"]["diffuse"]["reflectance"]["colour"][2], 0.3);
        check("lights[*].sun.angular_radius=1.5", &["/lights/3/sun/angular_radius"], &1.5.into());
        let message = changed("materials[*].mirror.reflectance=[1,1,1]").unwrap_err().to_string();
        assert!(message.contains("has no member *"), "{message}");
    }

    #[test]
    fn a_choice_below_any_kind_can_be_changed() {
        let mut scene = valid_scene();
        scene["integrator"] = serde_json::json!({"sms": {}});
        let scene = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
        let set = |changes: &[&str]| {
            let changes: Vec<Override> = changes.iter().map(|text| text.parse().unwrap()).collect();
            serde_json::to_value(apply(&changes, &scene).unwrap()).unwrap()
        };
        let changed = set(&["integrator.sms.estimator.biased.trials=4"]);
        assert_eq!(changed["integrator"]["sms"]["estimator"], serde_json::json!({"biased": {"trials": 4}}));
        let changed = set(&["integrator.estimator.max_trials=40", "integrator.chains=[\"T\"]"]);
        assert_eq!(changed["integrator"]["sms"]["estimator"], serde_json::json!({"unbiased": {"max_trials": 40}}));
        assert_eq!(changed["integrator"]["sms"]["chains"], serde_json::json!(["T"]));
        let changed = set(&["integrator={\"mnee\":{}}", "integrator.mnee.missed=dropped"]);
        assert_eq!(changed["integrator"]["mnee"]["missed"], "dropped");
        let texture = "materials.stone.diffuse.reflectance.texture.file=stone.png";
        let changed = set(&[texture]);
        let reflectance = &changed["materials"]["stone"]["diffuse"]["reflectance"];
        assert_eq!(*reflectance, serde_json::json!({"texture": {"file": "stone.png"}}));
    }

    #[test]
    fn another_choice_takes_the_place_of_the_first() {
        let changed =
            changed("camera.orthographic={\"position\":[0,0,2],\"look_at\":[0,0,0],\"up\":[0,1,0],\"height\":1}");
        assert_eq!(changed.unwrap()["camera"].as_object().unwrap().len(), 1);
    }

    #[test]
    fn what_cannot_be_set_is_refused_with_path_value_and_what_would_be_right() {
        for (change, fragments) in [
            ("film.width", &["`film.width`", "PATH=VALUE", "equals sign"][..]),
            ("lights[sun].direction=[0,1", &["a value that is JSON", "EOF"]),
            ("lights[a=b].radius=1", &["lights has no element a=b"]),
            ("materials.stoen.diffuse.reflectance.colour=[1,0,0]", &["materials has no member stoen", "stone"]),
            ("film..width=1", &["`film..width=1`", "a name before and behind each dot"]),
            ("film.depth=1", &["film has no member depth", "height, width"]),
            ("film.width=wide", &["film.width", "wide", "u32"]),
            ("film.width=0", &["film.width", "found 0", "1 to 16384"]),
            ("lights[sun].centre=[1,1,1]", &["lights[3].sun has no member centre", "direction"]),
            ("lights[moon].sun.radiance=[1,1,1]", &["lights has no element moon", "below 5", "sun"]),
            ("lights[9].sun.radiance=[1,1,1]", &["lights has no element 9", "below 5"]),
            ("lights.sun.radiance=[1,1,1]", &["lights is a list", "in brackets"]),
            ("integrator.conic.search=published", &["integrator is", "the integrator conic beside it"]),
            ("film.width.pixels=4", &["film.width", "a path that ends there"]),
            (
                "panes[0].front=crown",
                &["panes[0].front.crown", "the name alone", "{\"crown\": {...}} with its members"],
            ),
        ] {
            let message = changed(change).unwrap_err().to_string();
            assert!(!message.contains("column") || message.contains("EOF"), "a place in no file: {message}");
            for fragment in fragments {
                assert!(message.contains(fragment), "no {fragment:?} in: {message}");
            }
        }
    }
}
