//! What meets is found, what is apart is not, and what has no inside is refused.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::super::Scene;
use super::*;
use crate::document::malformed_scenes::valid_scene;
use crate::document::{SceneBundle, SceneDescription};
use crate::integrator::PreparedScene;

fn bundle(scene: &Value) -> SceneBundle {
    let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
    SceneBundle::from_parts(description, BTreeMap::new()).unwrap()
}

fn pane(name: &str, centre: [f64; 3], edge: f64) -> Value {
    json!({
        "name": name, "centre": centre, "x_axis": [1, 0, 0], "y_axis": [0, 1, 0],
        "width": edge, "height": edge, "thickness": 0.002
    })
}

/// A box, with its normals outwards.
fn block(name: &str, material: &str, min: [f64; 3], max: [f64; 3]) -> Value {
    let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { max[axis] } else { min[axis] });
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<[usize; 3]> = sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    let inline = json!({"positions": (0..8).map(corner).collect::<Vec<_>>(), "triangles": triangles});
    json!({"name": name, "material": material, "source": {"inline": inline}})
}

fn sheet(name: &str, material: &str, z: f64) -> Value {
    let positions = [[-1.0, -1.0, z], [1.0, -1.0, z], [1.0, 1.0, z], [-1.0, 1.0, z]];
    let inline = json!({"positions": positions, "triangles": [[0, 1, 2], [0, 2, 3]]});
    json!({"name": name, "material": material, "source": {"inline": inline}})
}

fn scene(panes: &[Value], meshes: &[Value], lights: &[Value]) -> Value {
    let mut scene = valid_scene();
    scene["materials"] = json!({
        "stone": {"diffuse": {"reflectance": {"colour": [0.5, 0.5, 0.5]}}},
        "glass": {"dielectric": {}}, "frosted": {"rough_dielectric": {"roughness": 0.3}}, "mirror": {"mirror": {}}
    });
    (scene["panes"], scene["meshes"], scene["lights"]) = (json!(panes), json!(meshes), json!(lights));
    scene["imports"] = json!([]);
    scene
}

/// The names of the bodies that meet others.
fn immersed(panes: &[Value], meshes: &[Value], lights: &[Value]) -> Vec<String> {
    names(&bundle(&scene(panes, meshes, lights)).build_scene().unwrap())
}

fn names(scene: &Scene) -> Vec<String> {
    let panes = scene.panes().iter().map(|pane| pane.name.clone());
    let names: Vec<String> = panes.chain(scene.meshes().iter().map(|mesh| mesh.name().to_owned())).collect();
    (0u32..).zip(names).filter(|(body, _)| scene.media().is_immersed(*body)).map(|(_, name)| name).collect()
}

const NONE: [&str; 0] = [];

#[test]
fn panes_that_touch_or_overlap_meet_and_neighbours_do_not() {
    let with = |at: [f64; 3]| immersed(&[pane("left", [0.0, 0.0, 1.0], 0.3), pane("right", at, 0.3)], &[], &[]);
    for z in [1.002, 1.001, 1.0, 0.998] {
        assert_eq!(with([0.1, 0.0, z]), ["left", "right"], "{z}");
    }
    assert_eq!(with([0.1, 0.0, 1.002_000_001]), NONE);
    // The outlines of neighbours, also where they have been rounded.
    for x in [0.3, 0.299_999] {
        assert_eq!(with([x, 0.0, 1.0]), NONE, "{x}");
    }
    assert_eq!(with([0.29, 0.0, 1.0]), ["left", "right"]);
}

#[test]
fn thousands_of_panes_in_a_window_are_no_hindrance() {
    let place = |i: u32| [f64::from(i % 64) * 0.1, f64::from(i / 64) * 0.1, 1.0];
    let mut panes: Vec<Value> = (0..4096).map(|i| pane(&i.to_string(), place(i), 0.1)).collect();
    assert_eq!(immersed(&panes, &[], &[]), NONE);
    panes[4000]["centre"] = json!([3.25, place(4000)[1], 1.001]);
    assert_eq!(immersed(&panes, &[], &[]), ["4000", "4001"]);
}

#[test]
fn bodies_meet_what_they_touch_hold_or_stand_in() {
    let cube = |name: &str, low: f64, high: f64| block(name, "glass", [low; 3], [high; 3]);
    let frosted = |low: f64, high: f64| block("frosted", "frosted", [low; 3], [high; 3]);
    let both = ["a", "b"];
    assert_eq!(immersed(&[], &[cube("a", 0.0, 1.0), cube("b", 0.5, 1.5)], &[]), both);
    assert_eq!(immersed(&[], &[cube("a", 0.0, 1.0), cube("b", 0.4, 0.6)], &[]), both);
    assert_eq!(immersed(&[], &[cube("a", 0.0, 1.0), cube("b", 1.1, 1.2)], &[]), NONE);
    assert_eq!(immersed(&[], &[cube("a", 0.0, 1.0), frosted(0.4, 0.6)], &[]), ["a", "frosted"]);
    // Bars that cross, of which no corner is in the other.
    let bars = [
        block("a", "glass", [-1.0, -0.1, -0.1], [1.0, 0.1, 0.1]),
        block("b", "glass", [-0.1, -1.0, -0.05], [0.1, 1.0, 0.05]),
    ];
    assert_eq!(immersed(&[], &bars, &[]), both);
    // Stone is no body, nor is a shell whose normals point inwards.
    assert_eq!(immersed(&[], &[cube("a", 0.0, 1.0), block("b", "stone", [0.5; 3], [1.5; 3])], &[]), NONE);
    assert_eq!(immersed(&[], &[cube("a", 0.0, 1.0), block("b", "glass", [0.6; 3], [0.4; 3])], &[]), NONE);
    let in_glass = |low: [f64; 3], high: [f64; 3], material: &str| {
        immersed(&[pane("pane", [0.0, 0.0, 1.0], 0.3)], &[block("block", material, low, high)], &[])
    };
    let all = ["pane", "block"];
    for material in ["glass", "frosted"] {
        assert_eq!(in_glass([-1.0; 3], [2.0; 3], material), all, "around it");
        assert_eq!(in_glass([-0.1, -0.1, 1.002], [0.1, 0.1, 1.2], material), all, "on it");
        assert_eq!(in_glass([-0.1, -0.1, 1.0005], [0.1, 0.1, 1.0015], material), all, "in it");
        assert_eq!(in_glass([-0.1, -0.1, 1.003], [0.1, 0.1, 1.2], material), NONE, "above it");
    }
    assert_eq!(in_glass([-0.1, -0.1, 0.9], [0.1, 0.1, 1.2], "stone"), NONE);
}

#[test]
fn what_refracts_or_mirrors_without_an_inside_is_refused_in_glass() {
    let build = |material: &str, z: f64| {
        let panes = [pane("pane", [0.0, 0.0, 1.0], 0.3)];
        bundle(&scene(&panes, &[sheet("sheet", material, z)], &[])).build_scene().map(drop)
    };
    for material in ["glass", "mirror"] {
        for z in [1.001, 1.0, 1.002] {
            let error = build(material, z).expect_err("a sheet in glass");
            assert_eq!(error.path(), "meshes[0].source");
            let text = error.to_string();
            assert!(text.contains("mesh \"sheet\" in or against the glass of pane \"pane\" (panes[0]) at"), "{text}");
        }
        build(material, 1.002_001).unwrap();
    }
    build("stone", 1.001).unwrap();
}

#[test]
fn a_light_in_a_pane_is_noticed_wherever_it_goes() {
    let point = |z: f64| json!({"point": {"name": "lamp", "position": [0, 0, z], "intensity": [1, 1, 1]}});
    let sphere = |z: f64, radius: f64| {
        let place = [0.0, 0.0, z];
        json!({"sphere": {"name": "globe", "centre": place, "radius": radius, "radiance": [1, 1, 1]}})
    };
    let panes = [pane("pane", [0.0, 0.0, 1.0], 0.3), pane("other", [1.0, 0.0, 1.0], 0.3)];
    let with = |light: Value| immersed(&panes, &[], &[light]);
    assert_eq!(with(point(1.0015)), ["pane"]);
    assert_eq!(with(point(1.003)), NONE);
    assert_eq!(with(sphere(1.1, 0.099)), ["pane"]);
    assert_eq!(with(sphere(1.1, 0.0975)), NONE);
    let shining = json!({"mesh": {"name": "lamp", "mesh": "sheet", "radiance": [1, 1, 1]}});
    let sheet = [sheet("sheet", "stone", 1.001)];
    assert_eq!(immersed(&panes[..1], &sheet, std::slice::from_ref(&shining)), ["pane"]);
    assert_eq!(immersed(&panes[..1], &sheet, &[point(2.0)]), NONE);

    let mut prepared = PreparedScene::build(&bundle(&scene(&panes, &[], &[point(2.0)]))).unwrap();
    let light = "light through or off bodies that meet others";
    for (z, expected) in [(1.001, &["pane"][..]), (2.0, &[])] {
        prepared = prepared.changed(&bundle(&scene(&panes, &[], &[point(z)]))).unwrap();
        assert_eq!(names(prepared.scene()), expected);
        let late = prepared.left_to_chance();
        assert_eq!(late.iter().any(|text| text.starts_with(light)), !expected.is_empty(), "{late:?}");
        let is_missing = |text: &String| text.contains("(\"pane\")") && text.contains("of point lights none");
        assert_eq!(late.iter().any(is_missing), !expected.is_empty(), "{late:?}");
    }
}

#[test]
fn a_mesh_of_many_triangles_that_most_panes_are_far_from_uses_up_no_budget() {
    let panes: Vec<Value> = (0..20).map(|i| pane(&i.to_string(), [f64::from(i), 0.0, 1.0], 0.1)).collect();
    let sea = json!({
        "name": "sea", "material": "glass", "rotate": [90, 0, 0], "translate": [0, -9, 0],
        "source": {"waves": {"size": [60, 60], "cells": [80, 80], "wavelengths": [3, 5], "height": 0.01, "seed": 1}}
    });
    let scene = bundle(&scene(&panes, &[sea], &[])).build_scene().unwrap();
    let bounds = [scene.mesh_bounds(0)];
    let never = |_: u32| false;
    let mut finder = Finder::new(scene.accelerator(), scene.meshes(), &bounds, &never, &never);
    finder.parts = 2000;
    finder.find_meshes_in_panes().unwrap();
    assert!(finder.parts > 1900, "{}", finder.parts);
}
