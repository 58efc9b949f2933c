//! A sheet of old glass that is cut along lines into many pieces, which stay in place, without lead.

use std::collections::BTreeMap;

use clerestory_render_core::document::{SceneBundle, SceneDescription};
use glam::DVec2;
use serde_json::{Value, json};

use crate::random::Random;

/// Edge of the picture, pixels.
pub const EDGE: u32 = 64;

/// Size of the sheet, metres: two square metres.
const SHEET: DVec2 = DVec2::new(1.0, 2.0);

/// How far the corners of pieces are from those of a regular grid, of the grid's step.
const JITTER: f64 = 0.2;

/// How a sheet is cut, and how its light is looked for.
#[derive(Clone, Copy, Debug)]
pub struct CutSheet<'a> {
    /// Pieces across and up.
    pub pieces: [u32; 2],
    /// Name of the integrator.
    pub integrator: &'a str,
    /// Samples of a pass.
    pub samples: u32,
    /// Seed of the picture.
    pub seed: u64,
}

impl CutSheet<'_> {
    /// The scene: sunlight through the pieces on a wall five metres away, `D TT L`. The camera sees 0.8 m of the wall,
    /// all of it lit.
    ///
    /// # Panics
    ///
    /// When the scene is not valid.
    pub fn scene(&self) -> SceneBundle {
        let profile = |kind: &str, members: Value| json!({ kind: members });
        let scene = json!({
            "version": 2, "name": "A sheet in pieces", "seed": self.seed, "film": {"width": EDGE, "height": EDGE},
            "camera": {"orthographic": {
                "position": [-0.25, -0.5, -4], "look_at": [-0.25, -0.5, -5], "up": [0, 1, 0], "height": 0.8}},
            "integrator": self.integrator, "path_filter": "D TT L",
            "sampling": {"samples_per_pass": self.samples, "samples_per_block": self.samples},
            "materials": {"plaster": {"diffuse": {"reflectance": {"colour": [0.8, 0.8, 0.8]}}}},
            "meshes": [{"name": "wall", "material": "plaster", "source": {"inline": {
                "positions": [[-3, -3, -5], [3, -3, -5], [3, 3, -5], [-3, 3, -5]],
                "triangles": [[0, 1, 2], [0, 2, 3]]}}}],
            "sheets": {"sheet": {
                "width": SHEET.x, "height": SHEET.y,
                "front": profile("crown", json!({
                    "centre": [0.3, 0.2], "wavelength": 0.06, "amplitude": 4e-5, "seed": 1})),
                "back": profile("cylinder", json!({
                    "axis": 80, "wavelength": 0.08, "amplitude": 2e-5, "seed": 2}))
            }},
            "panes": self.panes(),
            "lights": [{"sun": {
                "name": "sun", "direction": [0.05, 0.1, 1], "angular_radius": 0.27,
                "radiance": [40000, 40000, 40000]}}]
        });
        let description = SceneDescription::parse(scene.to_string().as_bytes()).expect("a valid scene");
        SceneBundle::from_parts(description, BTreeMap::new()).expect("a complete scene")
    }

    fn panes(&self) -> Vec<Value> {
        let [columns, rows] = self.pieces;
        let pieces = (0..rows).flat_map(|row| (0..columns).map(move |column| [column, row]));
        pieces.map(|[column, row]| self.pane(column, row)).collect()
    }

    /// A piece between four corners of the grid, whose place on the sheet is where it stands.
    fn pane(&self, column: u32, row: u32) -> Value {
        let corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[x, y]| self.corner(column + x, row + y));
        let [low, high] = corners
            .iter()
            .fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[low, high], at| [low.min(*at), high.max(*at)]);
        // Nanometres, so that the file of many pieces is no larger than a scene file may be.
        let rounded = |place: DVec2| (place * 1e9).round() / 1e9;
        let centre = rounded(0.5 * (low + high));
        let outline = corners.map(|corner| rounded(corner - centre));
        let size = outline.iter().fold(DVec2::ZERO, |size, corner| size.max(2.0 * corner.abs()));
        let outline = outline.map(|corner| corner.to_array());
        json!({
            "name": format!("{column} {row}"), "centre": [centre.x, centre.y, 0],
            "x_axis": [1, 0, 0], "y_axis": [0, 1, 0], "width": size.x, "height": size.y, "thickness": 0.002,
            "outline": outline, "sheet": {"name": "sheet", "at": centre.to_array()}
        })
    }

    /// A corner of the grid: those within are moved at random, the same for all pieces that meet there.
    fn corner(&self, column: u32, row: u32) -> DVec2 {
        let cells = DVec2::new(f64::from(self.pieces[0]), f64::from(self.pieces[1]));
        let step = SHEET / cells;
        let at = DVec2::new(f64::from(column), f64::from(row)) * step - 0.5 * SHEET;
        let mut random = Random::new(5, u64::from(column) << 32 | u64::from(row));
        let mut moved = |is_free: bool| if is_free { JITTER * (2.0 * random.uniform() - 1.0) } else { 0.0 };
        let free = [(column, self.pieces[0]), (row, self.pieces[1])].map(|(at, last)| at > 0 && at < last);
        at + step * DVec2::new(moved(free[0]), moved(free[1]))
    }
}
