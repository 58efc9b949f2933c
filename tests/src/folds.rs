//! Where the caustic of a point light is singular.
//!
//! The light that a pane throws onto a surface is a map from the pane's face to the picture. Where that map turns over,
//! its image folds. There the irradiance grows like the inverse square root of the distance to the fold. It is
//! integrable, but has infinite variance for an estimator that evaluates it at points. The fold is where the sign of
//! the map's Jacobian determinant changes. The contrast of a picture would not do: it also marks the shadow of the
//! pane's edge, and misses a fold inside a bright region.

use glam::DVec2;
use rayon::prelude::*;

use crate::forward_tracer::{Fault, photon};
use crate::traced_scene::{TracedLight, TracedScene};

/// Cells of the face along each axis under a point light. The profiles have at most 256 coefficients along an axis, so
/// that a cell is a quarter of the finest detail.
const CELLS: usize = 1024;

/// Cells of the face along each axis under each place of a light with an extent, whose folds lie side by side.
const FEWER_CELLS: usize = 256;

/// How far a fold reaches into the pixels around it.
const MARGIN: f64 = 1.0;

/// Places on a light with an extent whose folds are marked: from the middle to the rim, and around.
const LAMPS: [usize; 2] = [4, 12];

/// Whose folds are marked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Folds {
    /// Those of point lights. No pixel is marked by lights with an extent.
    OfPoints,
    /// Those of points of lights with an extent, too: where methods that draw one point of the light have infinite
    /// variance.
    OfAllLights,
}

/// For each pixel of the picture, whether a fold passes within a pixel of it.
pub fn fold_pixels(scene: &TracedScene, folds: Folds) -> Vec<bool> {
    let [width, height] = scene.film;
    let mut marked = vec![false; width * height];
    for light in &scene.lights {
        let is_point = matches!(light, TracedLight::Point { .. });
        let (lamps, cells) = match folds {
            _ if is_point => (1, CELLS),
            Folds::OfPoints => (0, CELLS),
            Folds::OfAllLights => (LAMPS[0] * LAMPS[1], FEWER_CELLS),
        };
        // Around the middle there is one place.
        let distinct = |lamp: &usize| *lamp == 0 || !lamp.is_multiple_of(LAMPS[0]);
        let places = (0..lamps).filter(distinct).flat_map(|lamp| {
            let lamp = [(lamp % LAMPS[0]) as f64 / (LAMPS[0] - 1) as f64, (lamp / LAMPS[0]) as f64 / LAMPS[1] as f64];
            (0..scene.panes.len()).flat_map(move |pane| fold_places(scene, light, pane, lamp, cells))
        });
        for place in places {
            let low = (place - MARGIN).max(DVec2::ZERO);
            let high = place + MARGIN;
            for y in low.y as usize..=(high.y as usize).min(height - 1) {
                for x in low.x as usize..=(high.x as usize).min(width - 1) {
                    marked[y * width + x] = true;
                }
            }
        }
    }
    marked
}

/// Places in the picture where neighbouring cells of the face have opposite orientation, under one place of the light.
fn fold_places(scene: &TracedScene, light: &TracedLight, pane: usize, lamp: [f64; 2], cells: usize) -> Vec<DVec2> {
    let vertices: Vec<Vec<Option<DVec2>>> = (0..=cells)
        .into_par_iter()
        .map(|j| {
            let parameter = |k: usize| k as f64 / cells as f64;
            (0..=cells)
                .map(|i| {
                    let face = [parameter(i), parameter(j)];
                    photon(scene, light, pane, face, lamp, Fault::None).map(|splat| splat.position)
                })
                .collect()
        })
        .collect();
    let turned = |i: usize, j: usize| {
        let (a, b, c) = (vertices[j][i]?, vertices[j][i + 1]?, vertices[j + 1][i]?);
        Some((b - a).perp_dot(c - a) < 0.0)
    };
    let mut places = Vec::new();
    for j in 0..cells - 1 {
        for i in 0..cells - 1 {
            let here = turned(i, j);
            let changes = |other: Option<bool>| matches!((here, other), (Some(a), Some(b)) if a != b);
            if changes(turned(i + 1, j)) {
                places.extend([vertices[j][i + 1], vertices[j + 1][i + 1]].into_iter().flatten());
            }
            if changes(turned(i, j + 1)) {
                places.extend([vertices[j + 1][i], vertices[j + 1][i + 1]].into_iter().flatten());
            }
        }
    }
    places
}
