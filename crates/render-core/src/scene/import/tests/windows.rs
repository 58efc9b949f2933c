//! What is taken for a window, what rules and tags do, and what has no area.

use glam::DVec3;

use super::*;
use crate::bsdf::ThinWallMaterial;
use crate::geometry::Ray;

/// A building of squares, each a node with a name and a material, or several of one node.
fn building(materials: &[Value], things: &[(&str, &[usize])]) -> Assets {
    let mut builder = Builder::square();
    for material in materials {
        builder.push("materials", material.clone());
    }
    builder.json["meshes"] = json!([]);
    builder.json["nodes"] = json!([]);
    builder.json["scenes"][0]["nodes"] = json!([]);
    for (index, (name, parts)) in things.iter().enumerate() {
        let part = |material: &usize| json!({"attributes": {"POSITION": 0}, "indices": 1, "material": material});
        let parts: Vec<Value> = parts.iter().map(part).collect();
        builder.push("meshes", json!({"primitives": parts}));
        builder.node(json!({"name": name, "mesh": index, "translation": [2 * index, 0, 0]}));
    }
    Assets::from([("a.glb".to_owned(), Asset::new(builder.glb()))])
}

fn stone() -> Value {
    json!({"name": "Stone"})
}

fn glass(colour: [f64; 4]) -> Value {
    json!({"name": "Glass", "pbrMetallicRoughness": {"baseColorFactor": colour, "roughnessFactor": 0},
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}})
}

fn names(expansion: &Expansion) -> Vec<&str> {
    expansion.windows.iter().map(|window| window.name.as_str()).collect()
}

#[test]
fn the_glass_of_a_house_is_found_by_its_material_and_keeps_its_colour() {
    let red = [0.8, 0.02, 0.02, 1.0];
    let house = expanded(json!({}), &building(&[stone(), glass(red)], &[("House", &[0, 1])]));
    assert_eq!(names(&house), ["Glass"]);
    assert_eq!(house.windows[0].sheet, None, "light goes through it as it is");
    let MaterialDescription::ThinWall(wall) = &house.materials["hall/Glass"] else { panic!("{house:?}") };
    assert_eq!(wall.tint, ColourDescription::Colour([0.8, 0.02, 0.02]));

    let opaque = expanded(json!({}), &building(&[stone()], &[("Window", &[0]), ("OakPanel", &[0]), ("Sill", &[0])]));
    assert_eq!(names(&opaque), ["Window"]);
    assert_eq!(opaque.windows[0].sheet, Some(ThinWallMaterial::default()));
}

#[test]
fn a_body_with_an_open_surface_is_a_sheet_of_its_colour() {
    let mut pane = glass([1.0, 1.0, 1.0, 1.0]);
    let volume = json!({"thicknessFactor": 0.01, "attenuationDistance": 0.01, "attenuationColor": [0.5, 1, 1]});
    pane["extensions"]["KHR_materials_volume"] = volume;
    let expansion = expanded(json!({}), &building(&[pane], &[("Sheet", &[0])]));
    let MaterialDescription::ThinWall(wall) = &expansion.materials["hall/Glass"] else { panic!("{expansion:?}") };
    let ColourDescription::Colour(tint) = wall.tint else { panic!("{wall:?}") };
    assert!((tint[0] - 0.5).abs() < 1e-12 && tint[1..] == [1.0, 1.0], "{tint:?}");
    assert!(expansion.notes.iter().any(|note| note.contains("its surface is open")), "{:?}", expansion.notes);
}

#[test]
fn patterns_fit_what_is_written_on_things_and_idle_rules_are_named() {
    let assets = file(|builder| builder.json["nodes"][0]["extras"] = json!({"ifc_class": "IfcWindow", "floor": 2}));
    for pattern in ["ifc_class:*Window", "floor:2"] {
        assert_eq!(expanded(json!({"glaze": [{"match": pattern}]}), &assets).panes.len(), 1, "{pattern}");
    }
    let rules = json!({"glaze": [{"match": "Windw*"}], "materials": [{"match": "Oak", "material": "plaster"}]});
    let notes = expanded(rules, &assets).notes;
    for pattern in ["\"Windw*\"", "\"Oak\""] {
        assert!(notes.iter().any(|note| note.contains(pattern) && note.contains("does nothing")), "{notes:?}");
    }
}

#[test]
fn a_tag_that_makes_no_sense_is_named_and_the_rest_of_it_counts() {
    let tagged = |tag: Value| {
        let assets = file(|builder| builder.json["nodes"][0]["extras"] = json!({"clerestory": tag}));
        expanded(json!({}), &assets)
    };
    let good = tagged(json!({"kind": "pane", "profile": "Crown", "thickness": 0.003, "colour": "#ff0000"}));
    assert_eq!(good.notes, Vec::<String>::new());
    let pane = &good.panes[0];
    assert!(pane.front.name() == "crown" && pane.absorption[0] == 0.0 && pane.absorption[1] > 1000.0, "{pane:?}");
    let bad = tagged(json!({"kind": "pane", "profile": "float", "thickness": 5, "colour": "red"}));
    assert_eq!(bad.panes.len(), 1);
    for (member, value) in [("profile", "float"), ("thickness", "5"), ("colour", "red")] {
        let says = |note: &String| note.contains(member) && note.contains(value);
        assert!(bad.notes.iter().any(says), "{member}: {:?}", bad.notes);
    }
}

#[test]
fn a_strip_that_is_too_narrow_for_a_pane_stays_a_mesh() {
    let assets = file(|builder| {
        builder.json["nodes"][0]["name"] = json!("Window");
        builder.json["nodes"][0]["scale"] = json!([0.0015, 1, 1]);
    });
    let expansion = expanded(json!({"glaze": [{"match": "Window"}]}), &assets);
    assert_eq!((expansion.panes.len(), expansion.meshes.len()), (0, 1));
    assert!(expansion.unglazed[0].1.contains("too narrow"), "{:?}", expansion.unglazed);
}

#[test]
fn what_becomes_no_pane_for_the_same_reason_is_counted() {
    let mut thing = Expansion::default();
    let reason = |text: &str| ("Window".to_owned(), text.to_owned());
    thing.unglazed = vec![reason("it is bent"), reason("it is bent"), reason("it is thick")];
    let remarks: Vec<String> = thing.remarks().collect();
    assert_eq!(remarks, ["2 pieces of Window are no panes: it is bent", "Window is no pane: it is thick"]);
}

#[test]
fn what_shines_without_an_area_is_dark_and_what_stands_behind_it_is_not() {
    let lamp = json!({"name": "Lamp", "emissiveFactor": [1, 1, 1]});
    let mut builder = Builder::square();
    builder.push("materials", lamp);
    builder.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    builder.json["nodes"][0]["scale"] = json!([1, 0, 1]);
    builder.node(json!({"mesh": 0, "name": "Screen"}));
    let assets = Assets::from([("a.glb".to_owned(), Asset::new(builder.glb()))]);
    let expansion = expanded(json!({}), &assets);
    assert_eq!((expansion.meshes.len(), expansion.lights.len()), (2, 1));
    assert!(expansion.notes.iter().any(|note| note.contains("no area")), "{:?}", expansion.notes);

    let scene = built(json!([import(json!({}))]), assets).unwrap();
    let ray = Ray::new(DVec3::new(0.5, -1.0, 0.5), DVec3::Y);
    let hit =
        scene.scene().accelerator().closest_hit(&ray, f64::INFINITY, SurfaceId::Nothing, &mut Counters::default());
    assert!(scene.scene().light_on(&hit.unwrap()).is_some());
}

#[test]
fn a_file_of_very_many_things_of_one_name_is_read_at_once_and_of_more_is_refused() {
    let of = |count: usize| {
        let mut builder = Builder::square();
        builder.json["nodes"] = json!(vec![json!({"mesh": 0, "name": "Part"}); count]);
        builder.json["scenes"][0]["nodes"] = json!((0..count).collect::<Vec<usize>>());
        let assets = Assets::from([("a.glb".to_owned(), Asset::new(builder.glb()))]);
        expand(&import(json!({})), &assets, &JsonPath::Root)
    };
    let parts = of(30_000).unwrap();
    assert_eq!(parts.meshes[29_999].name, "hall/Part 30000");
    let error = of((1 << 17) + 1).unwrap_err().to_string();
    assert!(error.contains("131072"), "{error}");
}

#[test]
fn of_names_and_patterns_the_first_rule_counts() {
    let material = |rules: [&str; 2]| {
        let [first, second] = rules;
        let rules = json!({"materials": [
            {"match": first, "material": "plaster"}, {"match": second, "material": "oak"}
        ]});
        let assets = file(|builder| builder.json["nodes"][0]["name"] = json!("Door"));
        expanded(rules, &assets).meshes[0].material.clone()
    };
    for rules in [["Door", "D*"], ["D*", "Door"], ["Door", "Door"], ["D*", "*"]] {
        assert_eq!(material(rules), "plaster", "{rules:?}");
    }
    assert_eq!([material(["Gate", "D*"]), material(["G*", "Door"])], ["oak"; 2]);
}
