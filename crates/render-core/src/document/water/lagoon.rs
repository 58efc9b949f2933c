//! A lagoon in the sun: 24 x 24 m of water over rippled sand with stones.

use std::collections::BTreeMap;

use super::{WaterSettings, WaterView, diffuse, integrator, looking, onto_the_floor, sun, surface, water};
use crate::document::triangles::Triangles;
use crate::document::{SamplingDescription, SceneDescription};
use crate::scene::description::{FilmDescription, MeshDescription, MeshSource, WaveDescription};
use crate::settings::SCENE_FORMAT_VERSION;

/// Edge of the water and the sand, metres.
const EDGE: f64 = 24.0;

/// Mean depth, metres.
const DEPTH: f64 = 2.2;

/// Cells of the sand along an edge.
const SAND_CELLS: u32 = 160;

/// Centres on the sand and half axes of stones, metres.
const STONES: [([f64; 2], [f64; 3]); 5] = [
    ([1.2, 2.6], [0.9, 0.6, 0.55]),
    ([-1.6, 3.4], [0.5, 0.7, 0.4]),
    ([2.9, 4.6], [1.2, 0.9, 0.9]),
    ([-3.4, 5.8], [1.4, 1.0, 1.1]),
    ([0.1, 0.9], [0.3, 0.35, 0.22]),
];

/// The lagoon: z is up, the sand is at 0 on average.
pub fn lagoon(settings: &WaterSettings) -> SceneDescription {
    let size = [EDGE; 2];
    let cells = settings.triangles.cells(size);
    let waves = WaveDescription { size, cells, wavelengths: [0.8, 3.5], height: 0.035, seed: 3, time: settings.time };
    let (camera, film, path_filter) = match settings.view {
        WaterView::Above => (looking([0.0, -6.0, 5.2], [0.0, 1.8, 0.6], 50.0), [960, 720], None),
        WaterView::Below => (looking([0.0, -3.2, 1.1], [0.2, 3.0, 0.75], 62.0), [960, 720], None),
        WaterView::Floor => (onto_the_floor(5.0, 1.2), [256, 256], Some("D T L".to_owned())),
    };
    let mut stones = Triangles::default();
    for ([x, y], radii) in STONES {
        stones.add_ellipsoid([x, y, 0.3 * radii[2]], radii, 24);
    }
    SceneDescription {
        version: SCENE_FORMAT_VERSION,
        name: format!("Lagoon with {} triangles at {} s", 2 * cells[0] * cells[1], settings.time),
        seed: 1,
        film: FilmDescription { width: film[0], height: film[1] },
        camera,
        integrator: integrator(),
        path_filter,
        sampling: SamplingDescription::default(),
        materials: BTreeMap::from([diffuse("sand", [0.7, 0.62, 0.46]), diffuse("stone", [0.4, 0.38, 0.35]), water()]),
        meshes: vec![surface(waves, DEPTH), sand(), stones.into_mesh("stones", "stone")],
        imports: Vec::new(),
        windows: Vec::new(),
        sheets: BTreeMap::new(),
        panes: Vec::new(),
        lights: vec![sun([-0.4, 0.3, 1.0])],
        site: None,
        moment: None,
        daylight: None,
        timeline: Vec::new(),
    }
}

/// The floor, in ripples and dunes that do not move.
fn sand() -> MeshDescription {
    MeshDescription {
        name: "sand".to_owned(),
        material: "sand".to_owned(),
        matrix: None,
        source: MeshSource::Waves(WaveDescription {
            size: [EDGE; 2],
            cells: [SAND_CELLS; 2],
            wavelengths: [1.5, 7.0],
            height: 0.09,
            seed: 8,
            time: 0.0,
        }),
        scale: 1.0,
        rotate: [0.0; 3],
        translate: [0.0; 3],
    }
}
