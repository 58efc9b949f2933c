//! The JSON Schema of scene files, generated from the types, for editors and for other programs that write scenes.

use std::sync::LazyLock;

use schemars::Schema;
use schemars::generate::SchemaSettings;
use serde_json::Value;

use super::SceneDescription;

/// The JSON Schema (draft 2020-12) of scene files. What it cannot say is checked by [`SceneDescription::validate`].
pub fn scene_schema() -> Schema {
    let mut schema = SchemaSettings::draft2020_12().into_generator().into_root_schema_for::<SceneDescription>();
    schema.insert("title".to_owned(), "Clerestory scene".into());
    schema
}

/// The same as a value that is made once.
pub(super) fn schema_value() -> &'static Value {
    static SCHEMA: LazyLock<Value> = LazyLock::new(|| scene_schema().to_value());
    &SCHEMA
}

#[cfg(test)]
pub(super) mod tests {
    use std::fs;
    use std::path::Path;

    use boon::{Compiler, SchemaIndex, Schemas};
    use serde_json::json;

    use super::super::malformed_scenes::{valid_scene, with};
    use super::*;

    /// The schema, ready to judge scenes.
    pub(in super::super) struct Validator {
        schemas: Schemas,
        scene: SchemaIndex,
    }

    impl Validator {
        pub(in super::super) fn new() -> Self {
            let mut compiler = Compiler::new();
            compiler.add_resource("scene.schema.json", scene_schema().to_value()).unwrap();
            let mut schemas = Schemas::new();
            let scene = compiler.compile("scene.schema.json", &mut schemas).unwrap();
            Self { schemas, scene }
        }

        /// What the schema has against a scene, with its places.
        pub(in super::super) fn validate(&self, scene: &Value) -> Result<(), String> {
            self.schemas.validate(scene, self.scene).map_err(|error| error.to_string())
        }
    }

    #[test]
    fn the_published_schema_is_that_of_the_types() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/scene.schema.json");
        let generated = serde_json::to_string_pretty(&scene_schema()).unwrap() + "\n";
        if std::env::var_os("UPDATE_SCHEMA").is_some() {
            fs::write(&file, &generated).unwrap();
        }
        let published = fs::read_to_string(&file).unwrap();
        assert!(
            published == generated,
            "docs/scene.schema.json is out of date; update it with: \
             UPDATE_SCHEMA=1 cargo test --release -p clerestory-render-core published_schema"
        );
    }

    #[test]
    fn the_schema_accepts_valid_scenes() {
        assert_eq!(Validator::new().validate(&valid_scene()), Ok(()));
    }

    #[test]
    fn the_schema_refuses_what_it_can_express() {
        let cases = [
            ("/version", json!(3)),
            ("/film/width", json!(0)),
            ("/panes/0/width", json!(0)),
            ("/panes/0/thickness", json!(0)),
            ("/panes/0/index_of_refraction", json!(4)),
            ("/panes/0/front", json!({"crow": {}})),
            ("/panes/0/centre", json!([0, 1])),
            ("/panes/0/absorption", json!([-1, 0, 0])),
            ("/materials/stone/diffuse/reflectance/colour/0", json!(1.5)),
            ("/lights/1/sphere/radius", json!(0)),
            ("/lights/3/sun/angular_radius", json!(0)),
            ("/seed", json!(-1)),
        ];
        let validator = Validator::new();
        for (pointer, value) in cases {
            let scene: Value = serde_json::from_str(&with(pointer, value)).unwrap();
            assert!(validator.validate(&scene).is_err(), "{pointer}");
        }
        let mut scene = valid_scene();
        scene["panes"][0]["tilt"] = json!(1);
        assert!(validator.validate(&scene).is_err());
    }
}
