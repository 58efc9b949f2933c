//! The water is the same scene for any number of triangles. Cameras are under water where they should be, and see lit
//! places.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

use rayon::prelude::*;

use super::*;
use crate::document::{SceneBundle, SceneDescription};
use crate::integrator::PreparedScene;
use crate::integrator::render_node;
use crate::scene::description::FilmDescription;
use crate::specular::path::PathSettings;
use clerestory_film::{NodeAddress, TileGrid};

type Water = fn(&WaterSettings) -> SceneDescription;

const SCENES: [Water; 2] = [pool, lagoon];

const VIEWS: [WaterView; 3] = [WaterView::Above, WaterView::Below, WaterView::Floor];

fn settings(triangles: &str, view: WaterView) -> WaterSettings {
    WaterSettings { triangles: triangles.parse().unwrap(), time: 0.0, view }
}

fn built(description: SceneDescription) -> PreparedScene {
    PreparedScene::build(&SceneBundle::from_parts(description, BTreeMap::new()).unwrap()).unwrap()
}

/// The part of a small picture with 4 passes that has light.
fn lit(mut description: SceneDescription) -> f64 {
    description.film = FilmDescription { width: 32, height: 24 };
    let scene = built(description);
    let grid = TileGrid::new(32, 24, 32);
    let address = NodeAddress { frame: 0, tile: 0, level: 2, index: 0 };
    let rendered = render_node(&scene, &grid, address, &AtomicBool::new(false)).unwrap();
    let beauty = &rendered.node.layers().beauty;
    beauty.iter().filter(|pixel| pixel[1] > 0.0).count() as f64 / beauty.len() as f64
}

#[test]
fn numbers_of_triangles_are_about_what_was_asked_for() {
    for (asked, least, most) in [("8", 6, 12), ("1000", 950, 1050), ("2000000", 1_990_000, 2_010_000)] {
        for scene in SCENES {
            let description = scene(&settings(asked, WaterView::Floor));
            let MeshSource::Waves(waves) = &description.meshes[0].source else { panic!("the first mesh is water") };
            assert!((least..=most).contains(&(2 * waves.cells[0] * waves.cells[1])), "{asked}: {:?}", waves.cells);
        }
    }
    for asked in ["0", "7", "20000001", "-5", "many"] {
        assert!(asked.parse::<TriangleCount>().is_err(), "{asked}");
    }
}

#[test]
fn scenes_differ_in_the_surface_alone() {
    for scene in SCENES {
        for view in VIEWS {
            let [few, many] = ["1000", "4000"].map(|triangles| scene(&settings(triangles, view)));
            assert_eq!(few.meshes[1..], many.meshes[1..]);
            assert_eq!((few.camera, few.lights), (many.camera, many.lights));
        }
    }
}

#[test]
fn every_view_sees_light_through_the_water() {
    let pairs: Vec<_> = SCENES.into_iter().flat_map(|scene| VIEWS.map(|view| (scene, view))).collect();
    pairs.into_par_iter().for_each(|(scene, view)| {
        let all = lit(scene(&settings("2000", view)));
        let mut dry = scene(&settings("2000", view));
        dry.integrator = IntegratorDescription::Path(PathSettings { max_depth: 12 });
        let by_chance = lit(dry);
        let name = scene(&settings("8", view)).name;
        println!("{name}, {view:?}: {all:.2} of the picture lit, by chance {by_chance:.2}");
        assert!(all > 0.7 && all > by_chance + 0.1, "{view:?}: {all}, {by_chance}");
    });
}

#[test]
fn waves_stay_between_floor_and_edge_of_the_basin() {
    for time in [0.0, 1.0, 10.0] {
        let prepared = built(pool(&WaterSettings { time, ..settings("20000", WaterView::Above) }));
        let scene = prepared.scene();
        let [low, high] = scene.mesh_bounds(0);
        assert!(low.z > 1.7 && high.z < 1.9, "{low} {high}");
    }
}
