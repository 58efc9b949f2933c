//! Searches take no memory: they run by the million, and on every core an allocation waits for the others. Scenes take
//! no more than is counted before they are built.

#![expect(clippy::unwrap_used, reason = "a test that cannot set itself up has failed")]

use std::hint::black_box;
use std::io::Cursor;

use allocation_counter::measure;
use clerestory_film::counters::Counters;
use clerestory_render_core::document::{SceneBundle, SceneDescription};
use clerestory_render_core::geometry::SurfaceId;
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::light::LightBounds;
use clerestory_render_core::light::Source;
use clerestory_render_core::scene::Asset;
use clerestory_render_core::scene::ShadingPoint;
use clerestory_render_core::specular::constraint::ManifoldConstraint;
use clerestory_render_core::specular::fnee::FneeSolver;
use clerestory_render_core::specular::fnee::PathSearch;
use clerestory_render_core::specular::manifold::WalkSteps;
use clerestory_render_core::specular::side::PaneSide;
use clerestory_render_core::specular::sms::ManifoldSearch;
use clerestory_tests::random::Random;
use clerestory_tests::solution_lists::{load_case, load_list};
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

/// Seeds at each point.
const SEEDS: u32 = 100;

/// Some points behind cathedral glass.
fn points() -> Vec<DVec3> {
    load_list("cathedral-folds.json").into_iter().map(|point| point.origin.into()).step_by(4).collect()
}

/// Where the light of a case is.
fn light(scene: &PreparedScene) -> DVec3 {
    let LightBounds::Ball { centre: position, .. } = scene.scene().lights()[0].bounds() else {
        panic!("a point light")
    };
    position
}

/// The search from a point through the pane, if a path can be there.
fn search(scene: &PreparedScene, point: DVec3, solver: FneeSolver) -> Option<PathSearch<'_>> {
    let pane = &scene.scene().accelerator().panes()[0];
    let origin = pane.frame.point_to_local(point);
    let side = PaneSide::facing(pane, origin).expect("receivers lie in front of their pane");
    PathSearch::new(side, origin, Source::Point(pane.frame.point_to_local(light(scene))), solver)
}

/// Runs a search from seeds in the unit square, of which some and not all have to lead to a path.
#[derive(Default)]
struct Runs {
    tried: u32,
    found: u32,
}

impl Runs {
    fn run(&mut self, random: &mut Random, mut search: impl FnMut(DVec2) -> bool) {
        let taken = measure(|| {
            for _ in 0..SEEDS {
                self.found += u32::from(search(DVec2::new(random.uniform(), random.uniform())));
            }
        });
        assert_eq!(taken.count_total, 0);
        self.tried += SEEDS;
    }

    fn finish(&self) {
        assert!(0 < self.found && self.found < self.tried, "{} of {} end at a path", self.found, self.tried);
    }
}

#[test]
fn memory_that_is_taken_is_counted() {
    assert_eq!(measure(|| drop(black_box(Box::new(1)))).count_total, 1);
}

#[test]
fn searches_of_stationary_lengths_take_no_memory() {
    let scene = load_case("cathedral");
    let mut random = Random::new(5, 0);
    let counters = &mut Counters::default();
    for solver in [FneeSolver::Complete, FneeSolver::Published] {
        let mut runs = Runs::default();
        for search in points().into_iter().filter_map(|point| search(&scene, point, solver)) {
            runs.run(&mut random, |seed| {
                // The published search takes four numbers, and may have two of them twice.
                search.solve(|| seed, counters).is_some()
            });
        }
        runs.finish();
    }
}

#[test]
fn walks_over_panes_take_no_memory() {
    let scene = load_case("cathedral");
    let pane = &scene.scene().accelerator().panes()[0];
    let mut random = Random::new(5, 0);
    let counters = &mut Counters::default();
    for constraint in [ManifoldConstraint::AngleDifference, ManifoldConstraint::HalfVector] {
        let mut runs = Runs::default();
        for position in points() {
            let normal = scene.scene().triangle_normal(0);
            let normal = if normal.dot(pane.frame.origin - position) > 0.0 { normal } else { -normal };
            let point = ShadingPoint { position, normal, surface: SurfaceId::Triangle(0), bounces: 0 };
            let source = Source::Point(light(&scene));
            let Some(search) = ManifoldSearch::new(scene.scene(), &point, source, 0, constraint, WalkSteps::default())
            else {
                continue;
            };
            runs.run(&mut random, |seed| {
                let target = pane.frame.point_to_world(((seed - 0.5) * pane.size()).extend(0.0));
                search.walk_towards(target, counters).is_some()
            });
        }
        runs.finish();
    }
}

#[test]
fn all_paths_of_a_window_are_found_without_memory_but_for_more_than_four() {
    let scene = load_case("cathedral");
    let counters = &mut Counters::default();
    let points = points();
    let (mut most, mut all) = (0, 0);
    for search in points.iter().filter_map(|point| search(&scene, *point, FneeSolver::Complete)) {
        let mut paths = 0;
        let taken = measure(|| paths = search.enumerate(counters).roots.len());
        assert_eq!(taken.count_total, u64::from(paths > 4), "{paths} paths");
        (most, all) = (most.max(paths), all + paths);
    }
    assert!(most > 2 && all > points.len(), "{all} paths, {most} at the most");
}

/// A scene of one mesh with this source and material, or of one pane with these faces.
fn scene_of(source: &Value, material: &Value, panes: &Value, assets: &[(&str, Vec<u8>)]) -> SceneBundle {
    let mesh = json!({"name": "mesh", "material": "stuff", "source": source});
    scene_with(&json!([mesh]), &json!({"stuff": material}), panes, assets)
}

/// A scene of these meshes, or of one pane with these faces.
fn scene_with(meshes: &Value, materials: &Value, panes: &Value, assets: &[(&str, Vec<u8>)]) -> SceneBundle {
    let mut lights = vec![json!({"point": {"name": "lamp", "position": [1, 1, -2], "intensity": [5, 5, 5]}})];
    if meshes[0]["name"] == "glow" {
        lights.push(json!({"mesh": {"name": "glow", "mesh": "glow", "radiance": [5, 5, 5]}}));
    }
    let scene = json!({
        "version": 1, "name": "memory", "film": {"width": 8, "height": 8},
        "camera": {"perspective": {
            "position": [0, 0, -2], "look_at": [0, 0, 0], "up": [0, 1, 0], "vertical_field_of_view": 40
        }},
        "integrator": "auto",
        "materials": materials,
        "meshes": meshes,
        "panes": panes,
        "lights": lights
    });
    let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
    let assets = assets.iter().map(|(name, bytes)| ((*name).to_owned(), Asset::new(bytes.clone())));
    SceneBundle::from_parts(description, assets.collect()).unwrap()
}

/// A square of cells of two triangles as an OBJ file, and as PLY files.
fn square(cells: usize) -> [(&'static str, Vec<u8>); 3] {
    let edge = cells + 1;
    let corners = || (0..edge * edge).map(|k| ((k % edge) as f32 / cells as f32, (k / edge) as f32 / cells as f32));
    let faces = || {
        (0..cells * cells)
            .map(|k| k / cells * edge + k % cells)
            .flat_map(|a| [[a, a + 1, a + edge + 1], [a, a + edge + 1, a + edge]])
    };
    let mut obj = String::new();
    for (x, y) in corners() {
        obj += &format!("v {x} {y} 0\nvt {x} {y}\n");
    }
    for [a, b, c] in faces().map(|face| face.map(|corner| corner + 1)) {
        obj += &format!("f {a}/{a} {b}/{b} {c}/{c}\n");
    }
    let header = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
             element face {}\nproperty list uchar int vertex_indices\nend_header\n",
            edge * edge,
            2 * cells * cells
        )
    };
    let mut text = header("ascii");
    let mut binary = header("binary_little_endian").into_bytes();
    for (x, y) in corners() {
        text += &format!("{x} {y} 0\n");
        binary.extend([x, y, 0.0].map(f32::to_le_bytes).concat());
    }
    for face in faces() {
        let [a, b, c] = face;
        text += &format!("3 {a} {b} {c}\n");
        binary.push(3);
        binary.extend(face.map(|corner| (corner as i32).to_le_bytes()).concat());
    }
    [("a.obj", obj.into_bytes()), ("a.ply", text.into_bytes()), ("b.ply", binary)]
}

fn png(picture: image::DynamicImage) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

#[test]
fn a_scene_takes_no_more_memory_than_is_counted_before_it_is_decoded_and_not_far_less() {
    let colour = json!({"diffuse": {"reflectance": {"colour": [0.5, 0.5, 0.5]}}});
    let textured = json!({"diffuse": {"reflectance": {"texture": {"file": "t.png"}}}});
    let water = json!({"dielectric": {"index_of_refraction": 1.33}});
    let waves = json!({"waves": {
        "size": [2, 2], "cells": [150, 150], "wavelengths": [0.3, 0.5], "height": 0.01, "seed": 1
    }});
    let triangle = json!({"inline": {"positions": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "triangles": [[0, 1, 2]]}});
    let pane = |face: Value| {
        json!([{"name": "pane", "centre": [0, 0, 2], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0], "width": 1, "height": 1,
            "thickness": 0.004, "front": face, "back": face}])
    };
    let files = square(150);
    let texture = ("t.png", png(image::DynamicImage::new_rgb8(700, 300)));
    let heights = ("h.png", png(image::DynamicImage::new_luma16(300, 300)));
    let with_texture = |file: usize| [files[file].clone(), texture.clone()];
    let none = json!([]);
    let uv_square = json!({"inline": {
        "positions": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "triangles": [[0, 1, 2]],
        "texture_coordinates": [[0, 0], [1, 0], [0, 1]]
    }});
    // Water through which a rough bed reaches everywhere, so that all its triangles are compared with those of the
    // water.
    let mut bed = waves.clone();
    bed["waves"]["seed"] = json!(2);
    let glow = json!([{"name": "glow", "material": "stuff", "source": waves}]);
    let pool = json!([
        {"name": "bed", "material": "stone", "source": bed}, {"name": "water", "material": "water", "source": waves}
    ]);
    let pool_materials = json!({"stone": colour, "water": water});
    let scenes = [
        ("waves", scene_of(&waves, &colour, &none, &[])),
        ("water", scene_of(&waves, &water, &none, &[])),
        ("waves that shine", scene_with(&glow, &json!({"stuff": colour}), &none, &[])),
        ("obj", scene_of(&json!({"obj": {"file": "a.obj"}}), &colour, &none, &files[..1])),
        ("obj with a texture", scene_of(&json!({"obj": {"file": "a.obj"}}), &textured, &none, &with_texture(0))),
        ("water and its bed", scene_with(&pool, &pool_materials, &none, &[])),
        ("smooth obj", scene_of(&json!({"obj": {"file": "a.obj"}}), &water, &none, &files[..1])),
        ("text ply", scene_of(&json!({"ply": {"file": "a.ply"}}), &colour, &none, &files[1..2])),
        ("binary ply", scene_of(&json!({"ply": {"file": "b.ply"}}), &colour, &none, &files[2..])),
        ("texture", scene_of(&uv_square, &textured, &none, std::slice::from_ref(&texture))),
        (
            "hammered",
            scene_of(&triangle, &colour, &pane(json!({"hammered": {"wavelength": 0.1, "amplitude": 1e-6}})), &[]),
        ),
        ("heights", scene_of(&triangle, &colour, &pane(json!({"height_map": {"file": "h.png"}})), &[heights])),
    ];
    // Threads have counters of their own.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build().unwrap();
    let mut wrong = Vec::new();
    for (name, bundle) in &scenes {
        let assets: u64 = bundle.assets().values().map(|asset| asset.bytes().len() as u64).sum();
        let build = || drop(black_box(PreparedScene::build(bundle).unwrap()));
        let taken = pool.install(|| measure(build).bytes_max + assets);
        let counted = bundle.memory().unwrap().bytes();
        if !(taken..=4 * taken).contains(&counted) {
            wrong.push(format!("{name}: {taken} bytes taken, {counted} counted"));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
