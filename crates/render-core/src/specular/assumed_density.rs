//! About how densely the rays of a [`LightView`](super::light_view::LightView) go through a pane, for each unit of
//! solid angle: what the weights of techniques assume.
//!
//! The exact density depends on the windows of all panes, which cost more than a light subpath. Weights by which
//! techniques share a path may be any function of the path, as long as all of them use the same. This one takes the
//! light's extent and the steepest slopes of the pane's faces, and no look at the place.

use glam::DVec2;

use super::effort::{Effort, SETTLED};
use crate::geometry::Face;
use crate::scene::pane_tree::LightRegion;
use crate::scene::{Scene, ShadingPoint};

/// A light that the shading point is in looks as large as that, radians.
const ALL_AROUND: f64 = 1.0;

/// Panes are seen at this cosine at the least: beyond, their solid angle is off anyway.
const LEAST_COSINE: f64 = 0.05;

/// The density with which rays from a point to a light go through a pane: positive, and a function of these alone.
pub(super) fn assumed_density(scene: &Scene, point: &ShadingPoint, light: u32, pane: u32, effort: &Effort) -> f64 {
    let pane = &scene.panes()[pane as usize];
    let region = LightRegion::of_light(&scene.lights()[light as usize]);
    let middle = pane.frame.point_to_world(pane.outline.bounds().centre().extend(0.0)) - point.position;
    let (direction, radius) = region.seen_from_ball(point.position, 0.0).unwrap_or((middle.normalize(), ALL_AROUND));
    let cosine = pane.frame.vector_to_local(direction).z.abs().max(LEAST_COSINE);
    let seen = pane.outline.area() * cosine / middle.length_squared();
    let slopes = [Face::Front, Face::Back].map(|face| {
        let [x, y] = pane.bounds(face).gradient;
        DVec2::new(x.max - x.min, y.max - y.min)
    });
    // Slopes deflect light by as much as they differ, times the index less one.
    let spread = (slopes[0] + slopes[1]) * (pane.index_of_refraction - 1.0).abs();
    let window = (spread + 2.0 * radius).element_product() / cosine;
    // A window that is much larger than the light is cut down to some of its parts.
    let gain = (spread / (2.0 * radius * SETTLED)).max(DVec2::ONE).element_product();
    let gain = gain.sqrt().clamp(1.0, effort.parts as f64);
    let rays = f64::from(effort.rays_for[0].max(effort.rays));
    let density = rays * gain / window.min(seen);
    // Of a light without an extent behind flat glass, and of what is as large as it is far.
    if density.is_finite() { density } else { rays }
}
