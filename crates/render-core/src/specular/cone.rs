//! `cone`: light through glass by forward sampling of the cone from which it can come.
//!
//! A direction is drawn at the shading point inside the deflection window of the whole light, traced exactly through
//! both faces, and counts when it meets the light. No root is sought; weights are bounded by the solid angle of the
//! window; the estimate is unbiased for every light that can be met, because the window is a true bound. It is the
//! house's own reference generator. A point light is never met: its light through glass is missing.
//!
//! Assumes panes that bend light by little, as window glass does. When the window is much larger than the light (a far
//! candle behind steep relief), [`super::fnee`] is the better method.

use glam::DVec3;

use super::{
    Arrival, ShadingPoint, SpecularMethod, coverage,
    side::PaneSide,
    window::{SourceBounds, deflection_window},
};
use crate::{
    counters::Counters,
    film::SampleStream,
    geometry::{Frame, Leaving, Ray},
    optics::{Light, LightKind, Source},
    scene::Scene,
};

/// Forward sampling of the cone from which a light's rays can come through each pane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cone;

impl SpecularMethod for Cone {
    fn gather(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        light_index: u32,
        stream: &mut SampleStream,
        counters: &mut Counters,
        arrive: &mut dyn FnMut(Arrival),
    ) {
        let light = &scene.lights()[light_index as usize];
        if matches!(light.kind, LightKind::Point { .. }) {
            return;
        }
        for (pane_index, pane) in (0u32..).zip(scene.accelerator().panes()) {
            let random = stream.next_2d();
            let origin = pane.frame.point_to_local(point.position);
            let Some(side) = PaneSide::facing(pane, origin) else { continue };
            if !side.rises_above(origin, pane.frame.vector_to_local(point.normal)) {
                continue;
            }
            let Some(window) = deflection_window(&side, origin, &light_bounds(light, &pane.frame)) else { continue };
            let target = (window.min + (window.max - window.min) * random).extend(side.near_base());
            let offset = target - origin;
            let distance_squared = offset.length_squared();
            let ray = Ray::new(origin, offset / distance_squared.sqrt());
            let direction = pane.frame.vector_to_world(ray.direction);
            if direction.dot(point.normal) <= 0.0 {
                continue;
            }
            let Some(through) = side.transmit(&ray, counters) else { continue };
            if !coverage::owns(&side, [ray.direction, through.inner_direction, through.direction]) {
                continue;
            }
            let exit = Ray::new(pane.frame.point_to_world(through.exit), pane.frame.vector_to_world(through.direction));
            let Some(hit) = light.intersect(&exit) else { continue };
            if hit.radiance == DVec3::ZERO {
                continue;
            }
            let entry = pane.frame.point_to_world(through.entry);
            let leaving = Leaving::Pane { index: pane_index, face: side.far };
            if scene.blocked_through_pane(point, entry, pane_index, side.near, &exit.origin, counters)
                || scene.blocked(&exit, hit.distance, leaving, None, Some(light_index), counters)
            {
                continue;
            }
            counters.unique_solutions += 1;
            let solid_angle = window.area() * ray.direction.z.abs() / distance_squared;
            arrive(Arrival { direction, weight: hit.radiance * through.transmittance * solid_angle });
        }
    }

    fn selects(&self, scene: &Scene, _: &ShadingPoint, _: Source, pane: u32, _: &mut Counters) -> bool {
        (pane as usize) < scene.accelerator().panes().len()
    }
}

/// Bounds on a whole light, in a pane's frame.
fn light_bounds(light: &Light, frame: &Frame) -> SourceBounds {
    match light.kind {
        LightKind::Point { position, .. } => SourceBounds::Ball { centre: frame.point_to_local(position), radius: 0.0 },
        LightKind::Sphere { centre, radius, .. } => SourceBounds::Ball { centre: frame.point_to_local(centre), radius },
        LightKind::Rectangle { frame: light_frame, half_size: [u, v], .. } => {
            SourceBounds::Ball { centre: frame.point_to_local(light_frame.origin), radius: (u * u + v * v).sqrt() }
        }
        LightKind::Sun { direction, sin_radius, .. } => {
            SourceBounds::Cap { direction: frame.vector_to_local(direction), sin_radius }
        }
    }
}
