//! The integrators that a scene file may name, with the schemas of their settings.

use serde_json::Value;

use crate::specular::registry::IntegratorDescription;

/// An integrator that a scene file may name.
#[derive(Clone, Debug, PartialEq)]
pub struct IntegratorEntry {
    /// Its name.
    pub name: &'static str,
    /// A line for people who choose one.
    pub summary: &'static str,
    /// The JSON Schema (draft 2020-12) of its settings.
    pub schema: Value,
    /// The settings of a scene that names it alone.
    pub defaults: Value,
}

/// All integrators, in the order of their registry. The first is that of a scene that names none.
pub fn integrators() -> Vec<IntegratorEntry> {
    let default = IntegratorDescription::default();
    let schemas = IntegratorDescription::schemas();
    (IntegratorDescription::SUMMARIES.iter().zip(schemas))
        .map(|((name, summary), schema)| {
            let usual = default.named(name).and_then(|usual| serde_json::to_value(usual).ok());
            let defaults = usual.as_ref().and_then(|usual| usual.get(name)).cloned().unwrap_or_default();
            IntegratorEntry { name, summary, schema: schema.to_value(), defaults }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_schema_accepts_the_defaults_and_describes_each_of_them() {
        let all = integrators();
        assert_eq!(all[0].name, IntegratorDescription::default().kind());
        for IntegratorEntry { name, summary, schema, defaults } in all {
            assert!(summary.ends_with('.'), "{name}: {summary}");
            let mut compiler = boon::Compiler::new();
            compiler.add_resource("settings", schema.clone()).unwrap();
            let mut schemas = boon::Schemas::new();
            let compiled = compiler.compile("settings", &mut schemas).unwrap();
            assert!(schemas.validate(&defaults, compiled).is_ok(), "{name}");
            for member in defaults.as_object().unwrap().keys() {
                assert!(schema["properties"][member]["description"].is_string(), "{name}.{member}");
            }
        }
    }
}
