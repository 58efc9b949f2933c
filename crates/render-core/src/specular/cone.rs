//! `cone`: light through glass by forward sampling of the cone from which it can come.
//!
//! A direction is drawn at the shading point inside the deflection window of the whole light, traced exactly through
//! both faces, and counts when it meets the light. No root is sought; weights are bounded by the solid angle of the
//! window; the estimate is unbiased for every light that can be met, because the window is a true bound. It is the
//! house's own reference generator. A point light is never met: its light through glass is missing.
//!
//! Behind rippled glass the sun shows as a few small patches in a large window. The window is therefore halved again and
//! again, one half being kept by chance in proportion to what the bounds leave of each, until the slopes differ too
//! little within the part to tell more. That is still a density which is known and positive wherever light can come from.

use glam::{DVec2, DVec3};

use super::{
    Arrival, ShadingPoint, SpecularMethod, coverage,
    side::PaneSide,
    window::{SourceBounds, Window},
};
use crate::{
    counters::Counters,
    film::SampleStream,
    geometry::{Frame, Leaving, Ray, Rect},
    optics::{Light, LightKind, Source},
    scene::Scene,
};

/// Forward sampling of the cone from which a light's rays can come through each pane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cone;

/// A pane through which a shading point may see a light.
struct Opening<'a> {
    pane: u32,
    side: PaneSide<'a>,
    /// The shading point in the pane's frame.
    origin: DVec3,
}

/// A part of the deflection window of an opening.
struct Patch {
    opening: usize,
    rect: Rect,
    /// About the solid angle under which it is seen: patches are chosen in proportion to it.
    weight: f64,
}

/// How much is spent on the light that arrives at one point.
struct Effort {
    /// Rays, over all panes.
    rays: u32,
    /// Parts into which a window is cut, at the most.
    parts: usize,
}

impl Effort {
    /// Light at the first diffuse vertex of a path is seen in the picture as it falls; at later vertices the path's other
    /// choices make most of the noise.
    fn at(point: &ShadingPoint) -> Self {
        match point.bounces {
            0 => Self { rays: 16, parts: 64 },
            1 => Self { rays: 2, parts: 16 },
            _ => Self { rays: 1, parts: 8 },
        }
    }
}

/// Slopes that spread the landing by less than this part of the light's extent are not worth telling apart.
const SETTLED: f64 = 0.5;

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
        let random = stream.next_2d();
        let light = &scene.lights()[light_index as usize];
        if matches!(light.kind, LightKind::Point { .. }) {
            return;
        }
        let effort = Effort::at(point);
        let (openings, patches) = patches(scene, point, light, &effort);
        let total: f64 = patches.iter().map(|patch| patch.weight).sum();
        let stride = total / f64::from(effort.rays);
        let mut remaining = patches.iter();
        let Some(mut patch) = remaining.next() else { return };
        let mut start = 0.0;
        for ray in 0..effort.rays {
            // Side by side, the patches make one interval; the rays are spaced equally over it.
            let position = (f64::from(ray) + random.x) * stride;
            while position >= start + patch.weight
                && let Some(next) = remaining.next()
            {
                start += patch.weight;
                patch = next;
            }
            let along = ((position - start) / patch.weight).min(1.0);
            let across = fraction(random.y + f64::from(ray) * GOLDEN_RATIO);
            let Rect { min, max } = patch.rect;
            let place = min + (max - min) * DVec2::new(along, across);
            let area = patch.rect.area() * stride / patch.weight;
            let opening = &openings[patch.opening];
            let Some(arrival) = opening.look(scene, point, light_index, place, counters) else { continue };
            arrive(Arrival { weight: arrival.weight * area, ..arrival });
        }
    }

    fn selects(&self, scene: &Scene, _: &ShadingPoint, _: Source, pane: u32, _: &mut Counters) -> bool {
        (pane as usize) < scene.accelerator().panes().len()
    }
}

/// Successive multiples of it, modulo 1, are the most evenly spread.
const GOLDEN_RATIO: f64 = 0.618_033_988_749_894_9;

fn fraction(x: f64) -> f64 {
    x - x.floor()
}

/// The panes through which a light may be seen, and the parts of their windows from which it can be reached.
fn patches<'a>(
    scene: &'a Scene,
    point: &ShadingPoint,
    light: &Light,
    effort: &Effort,
) -> (Vec<Opening<'a>>, Vec<Patch>) {
    let (mut openings, mut patches) = (Vec::new(), Vec::new());
    for (pane_index, pane) in (0u32..).zip(scene.accelerator().panes()) {
        let origin = pane.frame.point_to_local(point.position);
        let Some(side) = PaneSide::facing(pane, origin) else { continue };
        if !side.rises_above(origin, pane.frame.vector_to_local(point.normal)) {
            continue;
        }
        let Some(window) = Window::new(&side, origin, &light_bounds(light, &pane.frame)) else { continue };
        let parts = window.parts(effort.parts, |landing, part| part.spread.cmple(landing.extent() * SETTLED).all());
        let near = (side.near_base() - origin.z).abs();
        let opening = openings.len();
        let patch = |rect: Rect| {
            let distance_squared = (rect.centre() - origin.truncate()).length_squared() + near * near;
            let weight = rect.area() * near / (distance_squared * distance_squared.sqrt());
            Patch { opening, rect, weight }
        };
        patches.extend(parts.into_iter().map(patch).filter(|patch| patch.weight > 0.0));
        openings.push(Opening { pane: pane_index, side, origin });
    }
    (openings, patches)
}

impl Opening<'_> {
    /// The light seen through a place of the near plane, if it is seen there, for a unit of area of that plane.
    fn look(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        light_index: u32,
        place: DVec2,
        counters: &mut Counters,
    ) -> Option<Arrival> {
        let (side, frame) = (&self.side, &self.side.pane.frame);
        let offset = place.extend(side.near_base()) - self.origin;
        let distance_squared = offset.length_squared();
        let ray = Ray::new(self.origin, offset / distance_squared.sqrt());
        let direction = frame.vector_to_world(ray.direction);
        if direction.dot(point.normal) <= 0.0 {
            return None;
        }
        let through = side.transmit(&ray, counters)?;
        if !coverage::owns(side, [ray.direction, through.inner_direction, through.direction]) {
            return None;
        }
        let exit = Ray::new(frame.point_to_world(through.exit), frame.vector_to_world(through.direction));
        let hit = scene.lights()[light_index as usize].intersect(&exit)?;
        if hit.radiance == DVec3::ZERO {
            return None;
        }
        let entry = frame.point_to_world(through.entry);
        let leaving = Leaving::Pane { index: self.pane, face: side.far };
        if scene.blocked_through_pane(point, entry, self.pane, side.near, &exit.origin, counters)
            || scene.blocked(&exit, hit.distance, leaving, None, Some(light_index), counters)
        {
            return None;
        }
        counters.unique_solutions += 1;
        let solid_angle = ray.direction.z.abs() / distance_squared;
        Some(Arrival { direction, weight: hit.radiance * through.transmittance * solid_angle })
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
