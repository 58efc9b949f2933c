//! A swimming pool of 4 x 3 m, 1.8 m deep, with two balls afloat, in the sun.

use std::collections::BTreeMap;

use super::{WaterSettings, WaterView, diffuse, integrator, looking, onto_the_floor, sun, surface, water};
use crate::document::triangles::Triangles;
use crate::document::{SamplingDescription, SceneDescription};
use crate::scene::description::{FilmDescription, WaveDescription};
use crate::settings::{SCENE_FORMAT_VERSION, Triple};

/// Extent of the basin, metres: along, across, and its depth to the mean level of the water.
const BASIN: Triple = [4.0, 3.0, 1.8];

/// Height of the walls over the water, metres.
const FREEBOARD: f64 = 0.15;

/// Width of the coping around the basin, metres.
const COPING: f64 = 0.5;

/// Centres, relative to the middle of the surface, and radii of what floats, metres.
const BALLS: [([f64; 2], f64); 2] = [([-0.9, 0.5], 0.14), ([0.7, -0.7], 0.11)];

/// The pool: z is up, the floor is at 0.
pub fn pool(settings: &WaterSettings) -> SceneDescription {
    let [length, width, depth] = BASIN;
    let cells = settings.triangles.cells([length, width]);
    let waves = WaveDescription {
        size: [length, width],
        cells,
        wavelengths: [0.5, 1.3],
        height: 0.014,
        seed: 1,
        time: settings.time,
    };
    let (camera, film, path_filter) = match settings.view {
        WaterView::Above => (looking([-2.1, -1.7, 3.3], [0.3, 0.2, 0.9], 52.0), [960, 720], None),
        WaterView::Below => (looking([-1.7, -1.2, 1.2], [1.0, 0.7, 0.55], 65.0), [960, 720], None),
        WaterView::Floor => (onto_the_floor(2.0, 0.5), [256, 256], Some("D T L".to_owned())),
    };
    SceneDescription {
        version: SCENE_FORMAT_VERSION,
        name: format!("Pool with {} triangles at {} s", 2 * cells[0] * cells[1], settings.time),
        seed: 1,
        film: FilmDescription { width: film[0], height: film[1] },
        camera,
        integrator: integrator(),
        path_filter,
        sampling: SamplingDescription::default(),
        materials: BTreeMap::from([
            diffuse("tiles", [0.5, 0.72, 0.75]),
            diffuse("coping", [0.62, 0.58, 0.5]),
            diffuse("rubber", [0.75, 0.2, 0.12]),
            water(),
        ]),
        meshes: vec![
            surface(waves, depth),
            basin().into_mesh("basin", "tiles"),
            coping().into_mesh("coping", "coping"),
            balls().into_mesh("balls", "rubber"),
        ],
        imports: Vec::new(),
        windows: Vec::new(),
        sheets: BTreeMap::new(),
        panes: Vec::new(),
        lights: vec![sun([0.35, -0.45, 1.0])],
        site: None,
        moment: None,
        daylight: None,
        timeline: Vec::new(),
    }
}

/// Floor and walls.
fn basin() -> Triangles {
    let [x, y] = [0.5 * BASIN[0], 0.5 * BASIN[1]];
    let top = BASIN[2] + FREEBOARD;
    let corners = [[-x, -y], [x, -y], [x, y], [-x, y]];
    let at = |[x, y]: [f64; 2], z: f64| [x, y, z];
    let mut triangles = Triangles::default();
    triangles.add_quadrilateral(corners.map(|corner| at(corner, 0.0)));
    for (k, &from) in corners.iter().enumerate() {
        let to = corners[(k + 1) % corners.len()];
        triangles.add_quadrilateral([at(from, 0.0), at(to, 0.0), at(to, top), at(from, top)]);
    }
    triangles
}

/// The stone around it.
fn coping() -> Triangles {
    let [x, y] = [0.5 * BASIN[0], 0.5 * BASIN[1]];
    let top = BASIN[2] + FREEBOARD;
    let (outer_x, outer_y) = (x + COPING, y + COPING);
    let mut triangles = Triangles::default();
    for [[x0, y0], [x1, y1]] in [
        [[-outer_x, -outer_y], [outer_x, -y]],
        [[-outer_x, y], [outer_x, outer_y]],
        [[-outer_x, -y], [-x, y]],
        [[x, -y], [outer_x, y]],
    ] {
        triangles.add_quadrilateral([[x0, y0, top], [x1, y0, top], [x1, y1, top], [x0, y1, top]]);
    }
    triangles
}

/// What floats, a third of it under water.
fn balls() -> Triangles {
    let mut triangles = Triangles::default();
    for ([x, y], radius) in BALLS {
        triangles.add_ellipsoid([x, y, BASIN[2] + radius / 3.0], [radius; 3], 24);
    }
    triangles
}
