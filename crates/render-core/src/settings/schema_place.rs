//! Places in a scene file, as its JSON Schema describes them.

use serde_json::{Map, Value};

use super::path::MemberStep;

/// A place in a scene file, with what its schema says of it.
#[derive(Clone, Debug)]
pub(crate) struct Place<'a> {
    schema: &'a Value,
    root: &'a Value,
    path: String,
}

impl<'a> Place<'a> {
    /// The whole file.
    pub(crate) fn root(schema: &'a Value) -> Self {
        Self { schema, root: schema, path: String::new() }
    }

    /// The path to it, empty for the whole file.
    pub(crate) fn path(&self) -> &str {
        &self.path
    }

    /// What stands here when the file says nothing.
    pub(crate) fn default(&self) -> Option<&'a Value> {
        self.schema.get("default")
    }

    /// The schema, and behind a choice or a reference the schemas to which it leads.
    fn schemas(&self) -> Vec<&'a Value> {
        let mut found = Vec::new();
        let mut open = vec![self.schema];
        while let Some(schema) = open.pop() {
            if let Some(pointer) = schema.get("$ref").and_then(Value::as_str)
                && let Some(target) = self.root.pointer(pointer.trim_start_matches('#'))
            {
                open.push(target);
            }
            for choice in ["oneOf", "anyOf", "allOf"] {
                open.extend(schema.get(choice).and_then(Value::as_array).into_iter().flatten());
            }
            found.push(schema);
        }
        found
    }

    /// The members that may stand here; none where any may.
    pub(crate) fn members(&self) -> Vec<&'a str> {
        let members = |schema: &'a Value| schema.get("properties").and_then(Value::as_object);
        let known = self.schemas().into_iter().filter_map(members).flat_map(Map::keys);
        let mut known: Vec<&str> = known.map(String::as_str).collect();
        known.sort_unstable();
        known
    }

    /// Whether a member is one of several choices.
    pub(crate) fn is_choice_of(&self, name: &str) -> bool {
        let is_one = |schema: &Value| {
            let properties = schema.get("properties").and_then(Value::as_object);
            properties.is_some_and(|properties| properties.len() == 1 && properties.contains_key(name))
        };
        let choices = |schema: &'a Value| schema.get("oneOf").and_then(Value::as_array);
        self.schemas().into_iter().filter_map(choices).flatten().any(is_one)
    }

    /// Whether members of any name may stand here.
    pub(crate) fn has_any_members(&self) -> bool {
        self.schemas().into_iter().any(|schema| schema.get("additionalProperties").is_some_and(Value::is_object))
    }

    /// Where one of several choices stands here, its name and its settings.
    pub(crate) fn chosen<'v>(&self, value: &'v mut Value) -> Option<(String, &'v mut Value)> {
        let members = value.as_object_mut().filter(|members| members.len() == 1)?;
        let (name, settings) = members.iter_mut().next()?;
        self.is_choice_of(name).then(|| (name.clone(), settings))
    }

    pub(crate) fn member(&self, name: &str) -> Self {
        let schemas = self.schemas();
        let named = |schema: &&'a Value| schema.get("properties").and_then(|members| members.get(name));
        let any = |schema: &&'a Value| schema.get("additionalProperties").filter(|schema| schema.is_object());
        let schema = schemas.iter().find_map(named).or_else(|| schemas.iter().find_map(any)).unwrap_or(&Value::Null);
        let path = format!("{}{}", self.path, MemberStep { name, is_first: self.path.is_empty() });
        Self { schema, path, root: self.root }
    }

    pub(crate) fn element(&self, index: usize) -> Self {
        let schema = self.schemas().into_iter().find_map(|schema| schema.get("items")).unwrap_or(&Value::Null);
        Self { schema, path: format!("{}[{index}]", self.path), root: self.root }
    }
}
