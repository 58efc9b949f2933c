//! What designs in JSON say, and what is wrong with some.

use serde_json::{Value, json};

use super::designs::all;
use crate::{GlazingError, WindowDesign};

fn window() -> Value {
    json!({ "opening": { "arch": { "width": 0.6, "height": 2.0, "head": "equilateral" } } })
}

fn read(value: Value) -> WindowDesign {
    serde_json::from_value(value).unwrap()
}

#[test]
fn a_few_lines_make_a_window() {
    let design = read(window());
    assert_eq!(design, WindowDesign::new(design.opening.clone()));
    let plan = design.plan().unwrap();
    assert!(plan.pieces.len() > 100);
    assert_eq!(design.glass_names(), ["clear"]);
    assert_eq!(plan.pieces[0].place.to_string(), "light 1 field row 1 column 2");
}

#[test]
fn designs_are_written_as_they_are_read() {
    for design in all() {
        let text = serde_json::to_string(&design).unwrap();
        assert_eq!(serde_json::from_str::<WindowDesign>(&text).unwrap(), design);
    }
}

#[test]
fn choices_are_named_in_small_letters() {
    let mut value = window();
    value["tracery"] = json!("y");
    value["filling"] = json!({ "border": { "width": 0.03, "field": { "rectangles": { "offset": 0.5 } } } });
    value["lead"] = json!("none");
    value["bars"] = json!({ "saddle": { "section": "square" } });
    value["glass"] = json!({ "mixed": { "kinds": [{ "name": "green" }, { "name": "white", "weight": 2 }] } });
    value["opening"]["arch"]["width"] = json!(1.2);
    let design = read(value);
    design.plan().unwrap();
    assert_eq!(design.glass_names(), ["green", "white"]);
}

#[test]
fn unknown_members_are_refused() {
    for pointer in ["/opening/arch", "", "/lead/cames", "/bars/saddle", "/filling/diamonds", "/stone"] {
        let mut value = serde_json::to_value(read(window())).unwrap();
        value.pointer_mut(pointer).unwrap()["colour"] = json!(1);
        assert!(serde_json::from_value::<WindowDesign>(value).is_err(), "{pointer}");
    }
}

/// The error of a window in which a member has another value.
fn error(pointer: &str, changed: Value) -> GlazingError {
    let mut value = serde_json::to_value(read(window())).unwrap();
    *value.pointer_mut(pointer).unwrap_or_else(|| panic!("{pointer}")) = changed;
    read(value).plan().unwrap_err()
}

#[test]
fn errors_name_the_member_and_what_is_expected() {
    let text = error("/opening/arch/width", json!(40.0)).to_string();
    assert_eq!(text, "opening.arch.width: found 40, must be 0.05 to 30 metres");
    for (pointer, value, path) in [
        ("/opening/arch/height", json!(0.1), "opening.arch.height"),
        ("/opening/arch/head", json!({ "lancet": { "radius": 0.3 } }), "opening.arch.head.lancet.radius"),
        ("/opening", json!({ "foil": { "diameter": 1, "lobes": 2 } }), "opening.foil.lobes"),
        ("/opening", json!({ "roundel": { "diameter": 0 } }), "opening.roundel.diameter"),
        ("/tracery", json!({ "intersecting": { "lights": 1 } }), "tracery.intersecting.lights"),
        ("/tracery", json!({ "mullions": { "lights": 12 } }), "stone.width"),
        ("/tracery", json!({ "reticulated": { "rise": 1.5 } }), "tracery.reticulated.rise"),
        ("/stone/width", json!(2), "stone.width"),
        ("/stone/chamfer", json!(0.06), "stone.chamfer"),
        ("/filling", json!({ "diamonds": { "width": 0 } }), "filling.diamonds.width"),
        ("/filling", json!({ "rectangles": { "offset": 2 } }), "filling.rectangles.offset"),
        ("/filling", json!({ "border": { "width": 0.4 } }), "filling.border.width"),
        (
            "/filling",
            json!({ "border": { "field": { "border": { "width": 0.3 } } } }),
            "filling.border.field.border.width",
        ),
        ("/filling", json!({ "roundels": { "gap": 0 } }), "filling.roundels.gap"),
        ("/glass", json!({ "uniform": { "name": "" } }), "glass.uniform.name"),
        ("/lead", json!({ "cames": { "flange_width": 0.001 } }), "lead.cames.flange_width"),
        ("/bars", json!({ "ferramenta": { "spacing": [0.5, 0] } }), "bars.ferramenta.spacing[1]"),
        ("/tilt", json!(-1), "tilt"),
        ("/thickness_variation", json!(0.5), "thickness_variation"),
    ] {
        let error = error(pointer, value);
        assert_eq!(error.path, path, "{error}");
    }
}

#[test]
fn numbers_that_are_none_are_refused() {
    let mut design = read(window());
    design.tilt = f64::NAN;
    assert_eq!(design.plan().unwrap_err().path, "tilt");
    let crate::Opening::Arch(arch) = &mut design.opening else { panic!("no arch") };
    arch.height = f64::INFINITY;
    design.tilt = 0.0;
    assert_eq!(design.plan().unwrap_err().path, "opening.arch.height");
}

/// The places of all numbers in a value.
fn numbers(value: &Value, pointer: &str, found: &mut Vec<String>) {
    match value {
        Value::Number(_) => found.push(pointer.to_owned()),
        Value::Object(members) => members.iter().for_each(|(name, value)| {
            numbers(value, &format!("{pointer}/{name}"), found);
        }),
        Value::Array(elements) => elements.iter().enumerate().for_each(|(index, value)| {
            numbers(value, &format!("{pointer}/{index}"), found);
        }),
        _ => {}
    }
}

#[test]
fn any_number_is_planned_or_refused() {
    for design in all().into_iter().step_by(23) {
        let value = serde_json::to_value(&design).unwrap();
        let mut pointers = Vec::new();
        numbers(&value, "", &mut pointers);
        assert!(pointers.len() > 10, "{pointers:?}");
        for pointer in pointers {
            for number in [json!(0), json!(-1), json!(1e-9), json!(0.05), json!(2), json!(12), json!(1e9), json!(1e300)]
            {
                let mut changed = value.clone();
                *changed.pointer_mut(&pointer).unwrap() = number.clone();
                let Ok(design) = serde_json::from_value::<WindowDesign>(changed) else { continue };
                if let Err(error) = design.plan() {
                    assert!(!error.expected.is_empty() && error.path != "filling", "{error}");
                }
            }
        }
    }
}

#[test]
fn any_path_is_planned_or_refused() {
    let tokens = [
        "M", "L", "l", "H", "v", "C", "q", "A", "Z", "z", "S", "t", "0", "100", "300", "-50", "1e9", "1e400", "NaN",
        ".5", ",", "e", "1", "0 0 1",
    ];
    let mut random = crate::random::Random::new(5, &[]);
    let mut pick = |count: usize| (random.unit() * count as f64) as usize;
    let mut planned = 0;
    for _ in 0..4000 {
        let length = pick(12);
        let rest: Vec<&str> = (0..length).map(|_| tokens[pick(tokens.len())]).collect();
        let mut value = window();
        let path = format!("M 100 900 L 400 900 L 300 {} {} Z", 1200 + 10 * pick(20), rest.join(" "));
        value["filling"] = json!({ "drawn": { "pieces": [{ "path": path, "glass": "blue" }] } });
        match read(value).plan() {
            Ok(_) => planned += 1,
            Err(error) => assert_eq!(error.path, "filling.drawn.pieces[0].path", "{path}: {error}"),
        }
    }
    assert!(planned > 200, "{planned}");
}

#[test]
fn lead_that_hides_all_glass_is_refused() {
    let mut value = window();
    value["filling"] = json!({ "diamonds": { "width": 0.03, "height": 0.04 } });
    value["lead"] = json!({ "cames": { "flange_width": 0.03, "border_width": 0.03 } });
    assert_eq!(read(value).plan().unwrap_err().path, "lead.cames.flange_width");
}

#[test]
fn more_pieces_than_a_window_may_have_are_refused() {
    let mut value = window();
    value["opening"]["arch"] = json!({ "width": 20, "height": 30 });
    for (name, member) in [("diamonds", "width"), ("rectangles", "width"), ("roundels", "diameter")] {
        value["filling"] = json!({ name: { member: 0.02 } });
        let error = read(value.clone()).plan().unwrap_err();
        assert_eq!(error.path, format!("filling.{name}.{member}"));
        assert!(error.expected.contains("100000"), "{error}");
    }
}

#[test]
fn a_crowd_of_drawn_pieces_in_a_corner_is_planned() {
    let disc = |index: usize| {
        let (x, y) = (100 + 2 * (index % 50), 100 + 2 * (index / 50));
        json!({ "path": format!("M {x} {y} a .8 .8 0 0 0 1.6 0 a .8 .8 0 0 0 -1.6 0 Z"), "glass": "red" })
    };
    let mut value = window();
    value["opening"]["arch"] = json!({ "width": 30, "height": 30 });
    value["lead"] = json!("none");
    value["filling"] = json!({ "drawn": { "pieces": (0..2500).map(disc).collect::<Vec<_>>() } });
    let plan = read(value).plan().unwrap();
    assert!(plan.pieces.len() >= 2500, "{}", plan.pieces.len());
}

#[test]
fn drawn_lines_that_cross_all_others_are_refused() {
    let slat = |index: u32| {
        let (x, y) = (10.0 + 0.3 * f64::from(index / 2), 1800.0 - 0.3 * f64::from(index / 2));
        let path = if index.is_multiple_of(2) {
            format!("M {x} 900 h .15 v 950 h -.15 Z")
        } else {
            format!("M 5 {y} v .15 h 590 v -.15 Z")
        };
        json!({ "path": path, "glass": "red" })
    };
    let mut value = window();
    value["filling"] = json!({ "drawn": { "pieces": (0..3800).map(slat).collect::<Vec<_>>() } });
    let error = read(value).plan().unwrap_err();
    assert!(error.path.starts_with("filling") && error.expected.contains("100000"), "{error}");
}

#[test]
fn wrong_drawings_are_refused_at_their_piece() {
    for (path, expected) in [
        ("", "around at least"),
        ("M 0 0 L 100", "SVG path"),
        ("M 0 0 L 100 0", "around at least"),
        ("M 100 100 L 200 200 L 200 100 L 100 200 Z M 0 0", "one closed part"),
        ("M 100 100 L 200 200 L 200 100 L 100 250 Z", "does not cross itself"),
        ("M 5000 0 L 5100 0 L 5100 100 Z", "lies in a light"),
        ("M 0 0 L 1e300 0 L 0 1e300 Z", "within 1000 metres"),
    ] {
        let mut value = window();
        let good = json!({ "path": "M 200 1000 L 300 1000 L 300 1200 Z", "glass": "red" });
        value["filling"] = json!({ "drawn": { "pieces": [good, { "path": path, "glass": "blue" }] } });
        let error = read(value).plan().unwrap_err();
        assert_eq!(error.path, "filling.drawn.pieces[1].path", "{error}");
        assert!(error.expected.contains(expected), "{error}");
    }
    assert_eq!(error("/filling", json!({ "drawn": { "pieces": [] } })).path, "filling.drawn.pieces");
}

#[test]
fn the_schema_has_the_defaults_and_ranges() {
    let schema = serde_json::to_value(schemars::schema_for!(WindowDesign)).unwrap();
    assert_eq!(schema["properties"]["tilt"]["default"], 0.3);
    assert_eq!(schema["required"], json!(["opening"]));
    assert_eq!(schema["$defs"]["Cames"]["properties"]["flange_width"]["maximum"], 0.05);
}
