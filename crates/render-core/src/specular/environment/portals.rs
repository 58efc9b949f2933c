//! Light of an environment through panes, by sampling the near side of the panes.
//!
//! A pane is chosen by about the solid angle under which it is seen and by the colour of its glass
//! (`light::LightTree`). A direction to it is uniform in its solid angle. The ray is traced exactly through both faces,
//! and carries the radiance of the environment behind them. So its weight is bounded: there is no geometry factor, and
//! no fold.
//!
//! Glass hardly turns light. So where an environment is much brighter in some directions, one more ray goes straight to
//! where it is bright, through whichever pane is there. The balance heuristic combines both (Veach and Guibas 1995).

use glam::{DVec2, DVec3};

use super::super::Arrival;
use super::super::light_view::{AimedRay, PaneAperture};
use super::super::second_panes::SecondPanes;
use super::super::side::PaneSide;
use super::super::window::seen_face;
use crate::geometry::spherical_rectangle::SphericalRectangle;
use crate::geometry::{Face, Pane, PaneBoundary, Ray, Surface, Widened};
use crate::light::{Chosen, Cluster, EmissionCone, Light, LightTree, Receiver, Side, Source, with_finer_places};
use crate::math::Rect;
use crate::scene::looks::Looks;
use crate::scene::{Scene, ShadingPoint};
use clerestory_film::SampleStream;
use clerestory_film::counters::Counters;

/// Rays to panes from the first diffuse vertex of a path. From later ones there is one.
const FIRST_RAYS: u32 = 4;

/// An environment whose brightest radiance is more than this multiple of the mean gets a ray to where it is bright.
const UNEVEN: f64 = 2.0;

/// No glass is taken to be darker than this: what a pane lets through to one side has to be looked for.
const DARKEST: f64 = 1e-3;

/// Successive multiples of it, modulo 1, are the most evenly spread.
const GOLDEN_RATIO: f64 = 0.618_033_988_749_894_9;

/// The faces of a pane, as they are numbered in the tree.
const FACES: [Face; 2] = [Face::Front, Face::Back];

/// The faces of all panes, through which an environment is seen.
#[derive(Debug)]
pub(in crate::specular) struct Portals {
    tree: LightTree,
}

impl Portals {
    pub(super) fn new(scene: &Scene) -> Self {
        Self::of(scene, 0..scene.panes().len() as u32)
    }

    /// The faces of these panes.
    pub(in crate::specular) fn of(scene: &Scene, panes: impl Iterator<Item = u32>) -> Self {
        let mut portals = vec![None; FACES.len() * scene.panes().len()];
        for pane in panes {
            for (number, face) in FACES.into_iter().enumerate() {
                let place = FACES.len() * pane as usize + number;
                portals[place] = Some(portal(&scene.panes()[pane as usize], face));
            }
        }
        Self { tree: LightTree::over(portals.into_iter()) }
    }

    /// Estimates the light of the environment `light` that arrives at a point through one pane, or through one and
    /// another that is close behind it.
    #[expect(clippy::too_many_arguments, reason = "one estimate depends on all of them, and none belong together")]
    pub(in crate::specular) fn sample_li(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        light: u32,
        second: Option<&SecondPanes>,
        stream: &mut SampleStream,
        counters: &mut Counters,
        arrive: &mut dyn FnMut(Arrival),
    ) {
        let source = &scene.lights()[light as usize];
        let rays = Rays::from(point, source);
        let random = stream.next_2d();
        let start = with_finer_places(random.x, stream);
        for ray in 0..rays.to_panes as u32 {
            let position = (f64::from(ray) + start) / rays.to_panes;
            let across = random.y + f64::from(ray) * GOLDEN_RATIO;
            let Some(Chosen { light: portal, probability, rest }) = self.tree.choose(&rays.receiver, position) else {
                continue;
            };
            let Some(seen) = SeenPortal::new(scene, point, portal) else { continue };
            let place = seen.sample(DVec2::new(rest, across - across.floor()));
            let density = rays.density(&seen, place, probability * seen.density(place), source);
            if let Some(found) =
                seen.aperture.look(scene, point, light, AimedRay { place, density, assumed: density }, second, counters)
            {
                arrive(found.arrival);
            }
        }
        if rays.to_light > 0.0 {
            let random = stream.next_2d();
            if let Some((seen, place)) = straight_to_light(scene, point, source, random, counters) {
                let density = self.density_at(&rays, &seen, place, source);
                if let Some(found) = seen.aperture.look(
                    scene,
                    point,
                    light,
                    AimedRay { place, density, assumed: density },
                    second,
                    counters,
                ) {
                    arrive(found.arrival);
                }
            }
        }
    }
}

impl Portals {
    /// The expected number of rays from a point to the environment `light`, for each unit of solid angle in a direction
    /// to a face of a pane.
    pub(in crate::specular) fn density(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        light: u32,
        (pane, face): (u32, Face),
        direction: DVec3,
    ) -> f64 {
        let source = &scene.lights()[light as usize];
        let seen = SeenPortal::new(scene, point, number(pane, face));
        seen.map_or(0.0, |seen| {
            self.density_at(&Rays::from(point, source), &seen, seen.aperture.place(direction), source)
        })
    }

    /// The same towards a place of a portal.
    fn density_at(&self, rays: &Rays, seen: &SeenPortal<'_>, place: DVec2, source: &Light) -> f64 {
        let by_pane = if seen.holds(place) {
            self.tree.probability(seen.portal, &rays.receiver) * seen.density(place)
        } else {
            0.0
        };
        rays.density(seen, place, by_pane, source)
    }
}

/// The number of a face in the tree.
fn number(pane: u32, face: Face) -> u32 {
    pane * FACES.len() as u32 + u32::from(face == FACES[1])
}

/// How many rays of each kind go out from a point.
#[derive(Clone, Copy, Debug)]
struct Rays {
    receiver: Receiver,
    to_panes: f64,
    to_light: f64,
}

impl Rays {
    fn from(point: &ShadingPoint, source: &Light) -> Self {
        let is_first = point.bounces == 0;
        Self {
            receiver: Receiver { position: point.position, side: Side::Front(point.normal) },
            to_panes: if is_first { f64::from(FIRST_RAYS) } else { 1.0 },
            to_light: if is_first && is_uneven(source) { 1.0 } else { 0.0 },
        }
    }

    /// The expected number of rays for each unit of solid angle towards a place of a portal, which a ray to a pane goes
    /// to with the density `by_pane`.
    fn density(&self, seen: &SeenPortal<'_>, place: DVec2, by_pane: f64, source: &Light) -> f64 {
        let to_panes = self.to_panes * by_pane;
        if self.to_light == 0.0 {
            return to_panes;
        }
        let straight = Source::Direction(seen.aperture.direction(place));
        to_panes + self.to_light * source.source_density(DVec3::ZERO, 0.0, straight)
    }
}

/// Whether some directions are much brighter than others.
fn is_uneven(source: &Light) -> bool {
    let mean = source.power() / (4.0 * std::f64::consts::PI);
    source.emission().element_sum() / 3.0 > UNEVEN * mean
}

/// A face of a pane, as a light of uniform radiance.
fn portal(pane: &Pane, face: Face) -> Cluster {
    let [min, max] = pane.world_bounds();
    let outwards = match face {
        Face::Front => -pane.frame.axes.z_axis,
        Face::Back => pane.frame.axes.z_axis,
    };
    let tint = pane.tint().element_sum() / 3.0;
    Cluster {
        min,
        max,
        power: pane.outline.area() * tint.max(DARKEST),
        cone: EmissionCone::from_plane(outwards),
        radius: 0.5 * (max - min).length(),
        can_be_met: false,
    }
}

/// A portal from a shading point in front of it.
struct SeenPortal<'a> {
    portal: u32,
    aperture: PaneAperture<'a>,
    /// What it covers of the near plane.
    covered: Covered<'a>,
}

/// What a portal covers of its near plane.
enum Covered<'a> {
    /// A rectangle relative to the point's foot in that plane. Places are uniform in solid angle.
    Rectangle(SphericalRectangle),
    /// An outline seen from a height above that plane. Places are uniform over its area: quarries are small.
    Outline { widened: Widened<'a>, height: f64 },
}

impl<'a> SeenPortal<'a> {
    /// `None` where the point sees the pane from the other side, or none of it.
    fn new(scene: &'a Scene, point: &ShadingPoint, portal: u32) -> Option<Self> {
        let (pane, face) = (portal / FACES.len() as u32, FACES[portal as usize % FACES.len()]);
        Looks::count(|looks| looks.portals += 1);
        if scene.media().is_immersed(pane) {
            return None;
        }
        let geometry = &scene.panes()[pane as usize];
        let origin = geometry.frame.point_to_local(point.position);
        let side = PaneSide::facing(geometry, origin).filter(|side| side.near == face)?;
        let seen = seen_face(&side, origin)?;
        let covered = if geometry.outline.cuts().is_empty() {
            let (Rect { min, max }, foot) = (*seen.outline.rect(), origin.truncate());
            Covered::Rectangle(SphericalRectangle::new(Rect::new(min - foot, max - foot), seen.near))
        } else {
            Covered::Outline { widened: seen.outline.widened(), height: seen.near }
        };
        Some(Self {
            portal,
            aperture: PaneAperture { pane, side, origin, outline: seen.outline, assumed: 0.0 },
            covered,
        })
    }

    fn foot(&self) -> DVec2 {
        self.aperture.origin.truncate()
    }

    /// A place of the near plane that is drawn at random.
    fn sample(&self, random: DVec2) -> DVec2 {
        match &self.covered {
            Covered::Rectangle(rectangle) => rectangle.sample(random) + self.foot(),
            Covered::Outline { widened, .. } => widened.sample(random),
        }
    }

    /// Whether a place is one that may be drawn.
    fn holds(&self, place: DVec2) -> bool {
        match &self.covered {
            Covered::Rectangle(_) => self.aperture.outline.contains(place),
            Covered::Outline { widened, .. } => widened.contains(place),
        }
    }

    /// The density of such a place, per solid angle.
    fn density(&self, place: DVec2) -> f64 {
        match &self.covered {
            Covered::Rectangle(rectangle) => rectangle.density(place - self.foot()),
            Covered::Outline { widened, height } => {
                let length = (place - self.foot()).extend(*height).length();
                length * length * length / (widened.area() * height)
            }
        }
    }
}

/// The portal in a direction in which the environment is bright, and where the direction crosses its near plane.
fn straight_to_light<'a>(
    scene: &'a Scene,
    point: &ShadingPoint,
    source: &Light,
    random: DVec2,
    counters: &mut Counters,
) -> Option<(SeenPortal<'a>, DVec2)> {
    let Source::Direction(direction) = source.sample_source(DVec3::ZERO, 0.0, random).source else { return None };
    if direction.dot(point.normal) <= 0.0 {
        return None;
    }
    let ray = Ray::new(point.position, direction);
    let hit = scene.accelerator().solid().closest_hit(&ray, f64::INFINITY, point.surface, counters)?;
    let Surface::Pane { index, hit } = hit.surface else { return None };
    let PaneBoundary::Face(face) = hit.boundary else { return None };
    let seen = SeenPortal::new(scene, point, number(index, face))?;
    let place = seen.aperture.place(direction);
    Some((seen, place))
}
