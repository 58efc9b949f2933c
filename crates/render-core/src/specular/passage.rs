//! One shading point, one point of a light and one pane between them: what is common to all paths through it, whichever
//! method finds them.

use glam::DVec3;

use super::fermat::Connection;
use super::newton::Root;
use super::side::{PaneSide, Transmission};
use super::{Arrival, SampledPath, coverage};
use crate::scene::ShadingPoint;
use crate::{
    geometry::{Ray, SurfaceId},
    light::{LightHit, SourceSample},
    scene::Scene,
};
use clerestory_film::counters::Counters;

/// The vertices replayed by tracing may differ from the solved ones by this part of the pane's thickness.
const REPLAY_TOLERANCE: f64 = 1e-3;

/// A point of a light, seen from a shading point through a pane.
pub(crate) struct Passage<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) point: &'a ShadingPoint,
    /// Index of the light in the scene.
    pub(crate) light: u32,
    /// The point on it.
    pub(crate) sample: &'a SourceSample,
    /// Index of the pane in the scene.
    pub(crate) pane: u32,
    /// The pane, from the side of the shading point.
    pub(crate) side: PaneSide<'a>,
    /// Both ends, in the pane's frame.
    pub(crate) connection: Connection<'a>,
}

/// Light along a path that was found.
pub(crate) struct Found {
    /// What arrives, if the path is found with certainty. Who looked for it knows the density of the path.
    pub(crate) arrival: Arrival,
    /// Solid angle at the shading point per area (or solid angle) of the light.
    pub(crate) factor: f64,
}

impl<'a> Passage<'a> {
    /// `None` when no path through this pane can reach the point.
    pub(crate) fn new(
        scene: &'a Scene,
        point: &'a ShadingPoint,
        light: u32,
        sample: &'a SourceSample,
        pane: u32,
    ) -> Option<Self> {
        if scene.media().is_immersed(pane) {
            return None;
        }
        let geometry = &scene.accelerator().panes()[pane as usize];
        let frame = &geometry.frame;
        let origin = frame.point_to_local(point.position);
        let side = PaneSide::facing(geometry, origin)?;
        if !side.rises_above(origin, frame.vector_to_local(point.normal)) {
            return None;
        }
        let connection = Connection::new(&side, origin, sample.source.in_frame(frame));
        Some(Self { scene, point, light, sample, pane, side, connection })
    }

    /// The light along a root, if it is a path that the method owns and nothing is in the way. Counts it.
    pub(crate) fn found(&self, root: &Root, counters: &mut Counters) -> Option<Found> {
        let frame = &self.side.pane.frame;
        let direction = frame.vector_to_world(root.path.directions[0]);
        if direction.dot(self.point.normal) <= 0.0 {
            return None;
        }
        let last = frame.vector_to_world(root.path.directions[2]);
        let light_cosine = self.sample.cosine(last);
        let falloff = self.scene.lights()[self.light as usize].falloff(last);
        if light_cosine.min(falloff) <= 0.0 {
            return None;
        }
        let through = transmission(&self.side, self.connection.origin, root, counters)?;
        let [entry, exit] = root.path.vertices.map(|vertex| frame.point_to_world(vertex));
        let ray_origin = SurfaceId::Pane { index: self.pane, face: self.side.far };
        let outside = Ray::new(exit, last);
        let Self { scene, point, light, sample, pane, side, .. } = *self;
        if scene.blocked_through_pane(point, entry, pane, side.near, &exit, counters)
            || scene.blocked_from_light(&outside, root.path.lengths[2], ray_origin, light, sample, counters)
        {
            return None;
        }
        counters.unique_solutions += 1;
        let factor = root.path.geometry_factor(root.determinant) * light_cosine;
        let weight = self.sample.weight * through.transmittance * (factor * falloff);
        let hit = LightHit { distance: root.path.lengths[2], radiance: DVec3::ZERO, triangle: sample.triangle };
        let path =
            SampledPath { density: 0.0, surface: ray_origin, exit: outside, hit, transmitted: through.transmitted };
        Some(Found { arrival: Arrival { direction, weight, path: Some(path) }, factor })
    }
}

/// What a pane lets through along a root; `None` when the root is no path of light that the method owns: outside the
/// outline, not crossing both faces, or blocked by the pane's own relief. All in the pane's frame.
pub(crate) fn transmission(
    side: &PaneSide<'_>,
    origin: DVec3,
    root: &Root,
    counters: &mut Counters,
) -> Option<Transmission> {
    let inside = root.theta.iter().all(|vertex| side.pane.outline.contains(*vertex));
    if !(inside && root.path.crosses(side.sign) && coverage::steep(side, root.path.directions)) {
        return None;
    }
    let through = side.transmit(&Ray::new(origin, root.path.directions[0]), counters)?;
    let limit = REPLAY_TOLERANCE * side.pane.thickness;
    let near = (through.entry - root.path.vertices[0]).length() < limit;
    let far = (through.exit - root.path.vertices[1]).length() < limit;
    (near && far).then_some(through)
}
