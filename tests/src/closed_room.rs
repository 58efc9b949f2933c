//! A closed room: light walls, a bright light and two panes, one of them between the camera and half of what it sees.
//!
//! The room is a cube of two metres around the origin. The camera looks along -z; the left half of its picture shows
//! the room through the first pane, the right half shows it past that. The second pane hangs below the light.

use std::collections::BTreeMap;

use clerestory_render_core::document::{SceneBundle, SceneDescription};
use clerestory_render_core::integrator::PreparedScene;
use serde_json::{Value, json};

use crate::estimate::Estimate;
use crate::pane_scene::pane;
use crate::rendering::block_means;

/// A room with a light and an integrator.
#[derive(Clone, Debug)]
pub struct ClosedRoom {
    /// The light, as in a scene file.
    pub light: Value,
    /// The integrator, as in a scene file, without its depth.
    pub integrator: Value,
    /// Largest number of vertices between camera and light.
    pub max_depth: u32,
    /// Light path expression of what is rendered; `None` for all light.
    pub filter: Option<&'static str>,
    /// Seed of every random number; estimates with different seeds are independent.
    pub seed: u64,
}

/// Pixels along an edge of the picture, and equal parts that are compared: pixels are the parts.
pub const CELLS: usize = 8;

/// Part of the light that a wall throws back.
const ALBEDO: f64 = 0.8;

/// The light on the ceiling, looking down: so large that chance finds it.
pub fn panel() -> Value {
    json!({"rectangle": {"name": "panel", "centre": [0, 0.98, 0.25], "edge_u": [1.4, 0, 0], "edge_v": [0, 0, 1.3],
        "radiance": [1, 1, 1]}})
}

/// A ball below the ceiling.
pub fn globe() -> Value {
    json!({"sphere": {"name": "globe", "centre": [0.1, 0.68, 0.2], "radius": 0.28, "radiance": [1, 1, 1]}})
}

impl ClosedRoom {
    /// The room, built for one pass of `samples` samples in each pixel at a time.
    ///
    /// # Panics
    ///
    /// When the scene is not valid.
    pub fn build(&self, samples: u32) -> PreparedScene {
        let relief = |wavelength: f64, seed: u32| {
            let hammered = json!({"wavelength": wavelength, "amplitude": 1.2e-4, "seed": seed});
            json!({"hammered": hammered})
        };
        let upright = pane("before the camera", [-0.4, -0.2, 0.72], [0.8, 0.7], 0.01, [relief(0.4, 1), relief(0.5, 2)]);
        let mut lying = pane("below the light", [0.1, 0.3, 0.0], [1.5, 1.2], 0.01, [relief(0.5, 3), relief(0.4, 4)]);
        lying["y_axis"] = json!([0, 0.1, -1]);
        let mut integrator = self.integrator.clone();
        for settings in integrator.as_object_mut().into_iter().flat_map(|integrator| integrator.values_mut()) {
            settings["max_depth"] = self.max_depth.into();
        }
        let corner = |k: usize| [0, 1, 2].map(|axis| if k >> axis & 1 == 1 { 1.0 } else { -1.0 });
        let sides = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        let triangles: Vec<[usize; 3]> = sides.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let mut description = json!({
            "version": 1, "name": "closed room", "seed": self.seed,
            "film": {"width": CELLS, "height": CELLS},
            "camera": {"perspective": {
                "position": [0, 0, 0.95], "look_at": [0, -0.1, -1], "up": [0, 1, 0], "vertical_field_of_view": 70}},
            "sampling": {"samples_per_pass": samples, "samples_per_block": samples},
            "integrator": integrator,
            "materials": {"plaster": {"diffuse": {"reflectance": {"colour": [ALBEDO, ALBEDO, ALBEDO]}}}},
            "meshes": [{"name": "walls", "material": "plaster", "source": {"inline": {
                "positions": (0..8).map(corner).collect::<Vec<_>>(), "triangles": triangles}}}],
            "panes": [upright, lying],
            "lights": [self.light],
        });
        if let Some(filter) = self.filter {
            description["path_filter"] = filter.into();
        }
        let description = SceneDescription::parse(description.to_string().as_bytes()).expect("a valid scene");
        let bundle = SceneBundle::from_parts(description, BTreeMap::new()).expect("a complete scene");
        PreparedScene::build(&bundle).expect("a scene that can be built")
    }

    /// Radiance of the red channel in every pixel, row by row, from `passes` independent passes.
    ///
    /// # Panics
    ///
    /// When the scene is not valid.
    pub fn radiance(&self, samples: u32, passes: u32) -> Vec<Estimate> {
        block_means(&self.build(samples), passes, CELLS)
    }
}
