//! `auto`: several methods in one picture bring the light that single methods bring, all of it and none twice.
//!
//! Large lights are compared with path tracing, which shares no search with `auto`. Points are compared with the
//! methods of which `auto` is made. That tests how the paths are split among these methods. It does not test their
//! bias, which tests of their own do.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use clerestory_render_core::document::{SceneBundle, SceneDescription};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_tests::estimate::{Estimate, check_agreement};
use clerestory_tests::rendering::block_means;
use serde_json::{Value, json};

/// Parts of the picture along an edge.
const BLOCKS: usize = 4;

/// A sphere around the origin with smooth normals.
fn sphere(radius: f64, [around, up]: [u32; 2]) -> Value {
    let place = |row: u32, column: u32| {
        let (polar, azimuth) = (PI * f64::from(row) / f64::from(up), TAU * f64::from(column) / f64::from(around));
        [polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos()]
    };
    let inner = (1..up).flat_map(|row| (0..around).map(move |column| place(row, column)));
    let normals: Vec<[f64; 3]> = [[0.0, 0.0, 1.0]].into_iter().chain(inner).chain([[0.0, 0.0, -1.0]]).collect();
    let at = |row: u32, column: u32| match row {
        0 => 0,
        row if row == up => 1 + (up - 1) * around,
        row => 1 + (row - 1) * around + column % around,
    };
    let triangles: Vec<[u32; 3]> = (0..up)
        .flat_map(|row| (0..around).map(move |column| (row, column)))
        .flat_map(|(row, column)| {
            let [a, b, c, d] = [at(row, column), at(row + 1, column), at(row + 1, column + 1), at(row, column + 1)];
            [[a, b, c], [a, c, d]]
        })
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect();
    let positions: Vec<[f64; 3]> = normals.iter().map(|normal| normal.map(|coordinate| radius * coordinate)).collect();
    json!({"inline": {"positions": positions, "normals": normals, "triangles": triangles}})
}

fn quad(corners: [[f64; 3]; 4]) -> Value {
    json!({"inline": {"positions": corners, "triangles": [[0, 1, 2], [0, 2, 3]]}})
}

/// A pool and a glass sphere in a court under a roof of four panes.
fn court(lights: &Value, integrator: &Value, paths: &str) -> PreparedScene {
    let pane = |number: usize| {
        let centre = [0.7 * (number % 2) as f64 - 0.35, 0.7 * (number / 2) as f64 - 0.35, 1.2];
        json!({
            "name": format!("pane {number}"), "centre": centre, "x_axis": [1, 0, 0], "y_axis": [0, 1, 0],
            "width": 0.66, "height": 0.66, "thickness": 0.004, "index_of_refraction": 1.52,
            "front": {"crown": {"centre": [0.1, -0.2], "wavelength": 0.1, "amplitude": 2e-5, "seed": number}},
            "back": "flat"
        })
    };
    let floor = quad([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]);
    let wall = quad([[1.0, -1.0, 0.0], [1.0, -1.0, 1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 0.0]]);
    let waves = json!({"waves": {
        "size": [0.9, 1.6], "cells": [12, 20], "wavelengths": [0.8, 1.6], "height": 0.001, "seed": 5
    }});
    let scene = json!({
        "version": 1, "name": "court", "film": {"width": 12, "height": 12},
        "sampling": {"samples_per_pass": 16},
        "camera": {"perspective": {
            "position": [-0.9, -0.8, 0.8], "look_at": [0.3, 0.1, 0.1], "up": [0, 0, 1], "vertical_field_of_view": 70
        }},
        "integrator": integrator, "path_filter": paths, "lights": lights,
        "materials": {
            "stone": {"diffuse": {"reflectance": {"colour": [0.4, 0.4, 0.4]}}},
            "glass": {"dielectric": {"index_of_refraction": 1.5}},
            "water": {"dielectric": {"index_of_refraction": 1.33}}
        },
        "meshes": [
            {"name": "floor", "material": "stone", "source": floor},
            {"name": "wall", "material": "stone", "source": wall},
            {"name": "pool", "material": "water", "source": waves, "translate": [0.5, 0, 0.15]},
            {"name": "ball", "material": "glass", "source": sphere(0.15, [16, 8]), "translate": [-0.45, -0.2, 0.2]}
        ],
        "panes": (0..4).map(pane).collect::<Vec<_>>()
    });
    let description = SceneDescription::parse(scene.to_string().as_bytes()).expect("a valid scene");
    let bundle = SceneBundle::from_parts(description, BTreeMap::new()).expect("no assets");
    PreparedScene::build(&bundle).expect("the court can be built")
}

/// As bright as this many candles, by the sphere's area.
fn lamp(name: &str, centre: [f64; 3], radius: f64, intensity: f64) -> Value {
    let radiance = intensity / (PI * radius * radius);
    json!({"sphere": {
        "name": name, "centre": centre, "radius": radius, "radiance": [radiance, radiance, radiance]
    }})
}

/// Means over parts of a picture of the court, of the paths over specular vertices behind one diffuse vertex.
fn picture(lights: &Value, integrator: &Value, chains: &str, passes: u32) -> Vec<Estimate> {
    block_means(&court(lights, integrator, &format!("[RT]*D({chains})L")), passes, BLOCKS)
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn auto_brings_all_light_of_large_lights_that_chance_does() {
    let lights = json!([lamp("over", [0.2, 0.1, 2.4], 1.0, 3.0), lamp("under", [-0.6, 0.5, 0.75], 0.2, 0.5)]);
    let auto = picture(&lights, &json!({"auto": {"max_depth": 8}}), "[RT]+", 60);
    let path = picture(&lights, &json!({"path": {"max_depth": 8}}), "[RT]+", 300);
    check_agreement("auto under large lights", &auto, &path, 0.08);
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn auto_brings_all_light_of_points_that_manifold_walks_do() {
    let point = |name: &str, position: [f64; 3], intensity: f64| {
        let intensity = [intensity; 3];
        json!({"point": {"name": name, "position": position, "intensity": intensity}})
    };
    let lights = json!([
        point("over", [0.2, 0.1, 2.0], 3.0),
        point("under", [-0.6, 0.5, 0.75], 0.5),
        lamp("spark", [-0.2, 0.3, 2.2], 1e-4, 2.0),
    ]);
    // Walks over several things have heavy tails: there, the test rejects what is found twice or not at all.
    for (words, method, passes, fault) in
        [("TT", "sms", 40, 0.15), ("T", "conic", 30, 0.08), ("R", "sms", 20, 0.05), ("TTT|RTT", "sms", 20, 1.0)]
    {
        let chains: Vec<&str> = words.split('|').collect();
        let auto = picture(&lights, &json!({"auto": {"max_depth": 8}}), words, passes);
        let single = picture(&lights, &json!({method: {"max_depth": 8, "chains": chains}}), words, passes);
        check_agreement(&format!("auto under points, {words}"), &auto, &single, fault);
    }
}

#[test]
fn a_closed_box_of_glass_as_a_window_is_as_bright_as_with_manifold_walks() {
    let corner = |bits: usize| [0, 1, 2].map(|axis| if bits >> axis & 1 == 0 { -0.5 } else { 0.5 });
    let corners: Vec<[f64; 3]> = (0..8)
        .map(|bits| {
            let [x, y, z] = corner(bits);
            [0.8 * x, 0.8 * y, 1.0 + 0.01 * z]
        })
        .collect();
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<[usize; 3]> = sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    let room = |integrator: Value| {
        let scene = json!({
            "version": 1, "name": "box", "film": {"width": 12, "height": 12},
            "sampling": {"samples_per_pass": 16},
            "camera": {"orthographic": {"position": [0, 0, 0.5], "look_at": [0, 0, 0], "up": [0, 1, 0], "height": 1}},
            "integrator": integrator,
            "lights": [
                {"sun": {
                    "name": "sun", "direction": [0.2, 0.1, 1], "angular_radius": 0.27, "radiance": [2e4, 2e4, 2e4]
                }},
                {"point": {"name": "lamp", "position": [-0.1, 0.2, 1.8], "intensity": [2, 2, 2]}}
            ],
            "materials": {
                "stone": {"diffuse": {"reflectance": {"colour": [0.4, 0.4, 0.4]}}},
                "glass": {"dielectric": {"index_of_refraction": 1.5}}
            },
            "meshes": [
                {"name": "floor", "material": "stone",
                    "source": quad([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]])},
                {"name": "window", "material": "glass",
                    "source": {"inline": {"positions": corners, "triangles": triangles}}}
            ]
        });
        let description = SceneDescription::parse(scene.to_string().as_bytes()).expect("a valid scene");
        let bundle = SceneBundle::from_parts(description, BTreeMap::new()).expect("no assets");
        PreparedScene::build(&bundle).expect("the room can be built")
    };
    let filter = |integrator: Value| block_means(&room(integrator), 32, BLOCKS);
    let auto = filter(json!({"auto": {}}));
    check_agreement("a box of glass", &auto, &filter(json!({"sms": {"chains": ["TT", "R"]}})), 0.03);
}
