//! The view of a light through the panes: the parts of their deflection windows where it may be seen, and rays spread
//! evenly over them.
//!
//! A window is halved again and again and loses what the bounds exclude, until the slopes differ too little within a
//! part to tell more. Rays are spread evenly over all parts of all panes ([`Warp`]). So their density is known, and
//! positive wherever light can come from, for any number of panes.

use std::collections::VecDeque;

use glam::{DVec2, DVec3};

use super::assumed_density::assumed_density;
use super::certificate::{Certificate, MOST_LOOKS};
use super::effort::{Effort, SETTLED};
use super::second_panes::SecondPanes;
use super::side::{PaneSide, Transmission};
use super::warp::{Warp, Weighted};
use super::window::{SourceBounds, Window, seen_face};
use super::{Arrival, SampledPath, coverage};
use crate::geometry::{Frame, Pane, Ray, SeenOutline, Shape, SurfaceId, Widened};
use crate::light::{Light, LightBounds, LightHit};
use crate::math::Rect;
use crate::scene::Scene;
use crate::scene::ShadingPoint;
use crate::scene::pane_tree::{LightRegion, Panes};
use clerestory_film::counters::Counters;

/// The most rays that are sent because there are many panes.
const MOST_RAYS: u32 = 128;

/// A light as it may be seen from a shading point through panes.
pub(super) struct LightView<'a> {
    scene: &'a Scene,
    point: &'a ShadingPoint,
    light: u32,
    second: Option<&'a SecondPanes>,
    apertures: Vec<PaneAperture<'a>>,
    /// The windows of those of them that are left to a search.
    searched: Vec<SearchedWindow<'a>>,
    patches: Vec<Patch<'a>>,
    /// Where points that are spread evenly go.
    warp: Warp,
    rays: u32,
}

/// A pane through which a shading point may see a light.
pub(super) struct PaneAperture<'a> {
    /// The pane.
    pub(super) pane: u32,
    /// The pane from the shading point's side.
    pub(super) side: PaneSide<'a>,
    /// The shading point in the pane's frame.
    pub(super) origin: DVec3,
    /// What it sees of the pane.
    pub(super) outline: SeenOutline<'a>,
    /// What weights assume of the density of rays ([`assumed_density`]).
    pub(super) assumed: f64,
}

/// A window in which no point of a light is on a fold.
pub(super) struct SearchedWindow<'a> {
    pub(super) pane: u32,
    pub(super) window: Window<'a>,
    pub(super) certificate: Certificate,
}

/// Where a shading point may see a light through a pane.
enum Extent<'a> {
    /// In a window.
    Window(Window<'a>),
    /// In a window, no point of it on a fold.
    Searched(Window<'a>, Certificate),
    /// All over a pane that is smaller than the light: what it sees of it, with a margin, and the solid angle of that.
    Pane { rect: Rect, widened: Widened<'a>, weight: f64 },
}

/// A pane through which a shading point may see a light, and where; `None` when no light can come through.
fn aperture<'a>(
    scene: &'a Scene,
    point: &ShadingPoint,
    light: u32,
    pane_index: u32,
    effort: &Effort,
    second: Option<&'a SecondPanes>,
    counters: &mut Counters,
) -> Option<(PaneAperture<'a>, Extent<'a>)> {
    let source = &scene.lights()[light as usize];
    let pane = &scene.panes()[pane_index as usize];
    let origin = pane.frame.point_to_local(point.position);
    let side = PaneSide::facing(pane, origin)?;
    if !side.rises_above(origin, pane.frame.vector_to_local(point.normal)) {
        return None;
    }
    let bounds = light_bounds(source, &pane.frame)?;
    // Bounds that a second pane makes, if it leaves any.
    let bounds = match second.map(|second| second.behind(pane_index, side.near)) {
        None => Some(bounds),
        Some(behind) => behind?.bounds_behind(&bounds, origin),
    };
    let assumed = assumed_density(scene, point, light, pane_index, effort);
    match bounds.filter(|_| !covers(&LightRegion::of_light(source), pane, point.position)) {
        Some(bounds) => {
            let window = Window::new(&side, origin, &bounds)?;
            let outline = *window.outline();
            if effort.is_beside_search
                && let Some(certificate) = better_searched(&window, &bounds, counters)
            {
                let aperture = PaneAperture { pane: pane_index, side, origin, outline, assumed };
                return Some((aperture, Extent::Searched(window, certificate)));
            }
            Some((PaneAperture { pane: pane_index, side, origin, outline, assumed }, Extent::Window(window)))
        }
        None => {
            let outline = seen_face(&side, origin)?.outline;
            let rect = *outline.rect();
            let widened = outline.widened();
            let weight = widened.area() * solid_angle(&side, origin, rect.centre());
            Some((
                PaneAperture { pane: pane_index, side, origin, outline, assumed },
                Extent::Pane { rect, widened, weight },
            ))
        }
    }
}

/// What is certain of the paths in a window where a search has less noise than rays.
///
/// A search sees one point of the light. That is all or nothing where the outline cuts the window, and the light may
/// come by paths of other weights from its other points. Rays miss the light, the more often the larger the window is.
fn better_searched(window: &Window<'_>, bounds: &SourceBounds, counters: &mut Counters) -> Option<Certificate> {
    let [one_path, several] = SEARCHED;
    let times = (DVec2::ONE + window.spread() / window.deflection().extent()).element_product();
    if times < one_path || !window.outline().holds(window.rect()) {
        return None;
    }
    let looks = if times < several { 0 } else { MOST_LOOKS };
    Certificate::new(window, bounds, looks, counters)
}

/// A part of the deflection window of an aperture.
struct Patch<'a> {
    aperture: usize,
    rect: Rect,
    glass: GlassOfPatch<'a>,
    /// About the solid angle under which it is seen: rays are spread in proportion to it.
    weight: f64,
}

/// What the lead leaves of a patch.
enum GlassOfPatch<'a> {
    /// Of a part of a window.
    Part(Shape),
    /// Of a pane that is smaller than the light.
    Pane(Widened<'a>),
}

/// A ray that meets the light through a pane.
pub(super) struct LightSample {
    /// The light, divided by the density of rays.
    pub(super) arrival: Arrival,
    /// Expected number of rays for each unit of solid angle.
    pub(super) density: f64,
    /// The way through the pane, in its frame.
    pub(super) through: Transmission,
    /// The ray behind the pane.
    pub(super) exit: Ray,
    /// Where that ray meets the light.
    pub(super) hit: LightHit,
}

/// A pane is smaller than a light if its angular radius is less than this part of the light's.
const COVERED: f64 = 0.7;

/// A search has less noise than rays if a window is this many times as large as it would be behind flat glass: where
/// each point of the light has one path at the most, and where it may have several. Measured behind crown and blown
/// glass, and through a rippled slab.
const SEARCHED: [f64; 2] = [4.0, 10.0];

/// Successive multiples of it, modulo 1, are the most evenly spread.
pub(super) const GOLDEN_RATIO: f64 = 0.618_033_988_749_894_9;

impl<'a> LightView<'a> {
    /// The view of a light, which is empty for a point light and for one that is all around.
    /// Through one pane, or through one and another that is close behind it.
    pub(super) fn new(
        scene: &'a Scene,
        point: &'a ShadingPoint,
        light: u32,
        effort: &Effort,
        second: Option<&'a SecondPanes>,
        counters: &mut Counters,
    ) -> Self {
        let source = &scene.lights()[light as usize];
        let region = LightRegion::of_light(source);
        let candidates = match second {
            _ if source.is_delta() => Panes::new(),
            None => scene.pane_tree().candidates(point.position, &region),
            Some(second) => second.candidates(point.position, &region),
        };
        let mut apertures = Vec::with_capacity(candidates.len());
        let mut patches = Vec::with_capacity(candidates.len());
        let (mut searched, mut windows) = (Vec::new(), Vec::new());
        for index in candidates.into_iter().filter(|index| !scene.media().is_immersed(*index)) {
            let Some((aperture, extent)) = aperture(scene, point, light, index, effort, second, counters) else {
                continue;
            };
            let index_of = apertures.len();
            match extent {
                Extent::Window(window) => windows.push((index_of, window)),
                Extent::Searched(window, certificate) => {
                    searched.push(SearchedWindow { pane: index, window, certificate });
                }
                Extent::Pane { rect, widened, weight } => {
                    patches.push(Patch { aperture: index_of, rect, glass: GlassOfPatch::Pane(widened), weight });
                }
            }
            apertures.push(aperture);
        }
        let [for_windows, for_panes] = effort.rays_for;
        let rays = windows.len() as u32 * for_windows + patches.len() as u32 * for_panes;
        let rays = rays.min(MOST_RAYS).max(effort.rays);
        for (window, rect) in cut(&windows, effort.parts) {
            let aperture = windows[window].0;
            let PaneAperture { side, origin, outline, .. } = &apertures[aperture];
            let Some(shape) = outline.shape(&rect) else { continue };
            let weight = shape.area() * solid_angle(side, *origin, rect.centre());
            patches.push(Patch { aperture, rect, glass: GlassOfPatch::Part(shape), weight });
        }
        patches.retain(|patch| patch.weight > 0.0);
        let warp = Warp::new((0u32..).zip(&patches).map(|(index, patch)| {
            let at = apertures[patch.aperture].direction(patch.rect.centre());
            let at = apertures[0].side.pane.frame.vector_to_local(at).truncate();
            Weighted { index, at, weight: patch.weight }
        }));
        Self { scene, point, light, second, apertures, searched, patches, warp, rays }
    }

    /// Sends the rays; whatever sees the light is handed to `see`.
    pub(super) fn cast(
        &self,
        random: DVec2,
        counters: &mut Counters,
        see: &mut dyn FnMut(LightSample, &PaneAperture<'a>),
    ) {
        for ray in 0..self.rays {
            let along = (f64::from(ray) + random.x) / f64::from(self.rays);
            let across = random.y + f64::from(ray) * GOLDEN_RATIO;
            let Some((patch, within)) = self.warp.patch(DVec2::new(along, across - across.floor())) else { return };
            let patch = &self.patches[patch as usize];
            let aperture = &self.apertures[patch.aperture];
            let place = patch.glass.sample(within);
            let density = self.density_in(patch, place);
            let aimed = AimedRay { place, density, assumed: aperture.assumed };
            if let Some(light_sample) = aperture.look(self.scene, self.point, self.light, aimed, self.second, counters)
            {
                see(light_sample, aperture);
            }
        }
    }

    /// The panes through which light may come.
    pub(super) fn panes(&self) -> impl Iterator<Item = u32> {
        self.apertures.iter().map(|aperture| aperture.pane)
    }

    /// Those of them that get no rays.
    pub(super) fn searched(&self) -> &[SearchedWindow<'a>] {
        &self.searched
    }

    /// As [`assumed_density`], for a pane of the view.
    pub(super) fn assumed(&self, pane: u32) -> f64 {
        self.apertures.iter().find(|aperture| aperture.pane == pane).map_or(0.0, |aperture| aperture.assumed)
    }

    /// Expected number of rays for each unit of solid angle towards a place of a pane's near plane.
    pub(super) fn density(&self, pane: u32, place: DVec2) -> f64 {
        let holds = |patch: &&Patch| self.apertures[patch.aperture].pane == pane && patch.rect.contains(place);
        let patch = self.patches.iter().find(holds);
        patch.map_or(0.0, |patch| self.density_in(patch, place))
    }

    /// The same towards a place of a patch.
    fn density_in(&self, patch: &Patch<'_>, place: DVec2) -> f64 {
        let aperture = &self.apertures[patch.aperture];
        let rays = f64::from(self.rays) * patch.weight / self.warp.total();
        rays / (patch.glass.area() * solid_angle(&aperture.side, aperture.origin, place))
    }
}

/// Where a ray goes through a pane's near plane, and the expected number of such rays for each unit of solid angle.
#[derive(Clone, Copy, Debug)]
pub(super) struct AimedRay {
    pub(super) place: DVec2,
    pub(super) density: f64,
    /// The density that weights assume.
    pub(super) assumed: f64,
}

impl PaneAperture<'_> {
    /// Where a direction from the shading point crosses the near plane.
    pub(super) fn place(&self, direction: DVec3) -> DVec2 {
        let local = self.side.pane.frame.vector_to_local(direction);
        self.origin.truncate() + local.truncate() * ((self.side.near_base() - self.origin.z) / local.z)
    }

    /// Unit vector from the shading point towards a place of the near plane.
    pub(super) fn direction(&self, place: DVec2) -> DVec3 {
        let towards = place.extend(self.side.near_base()) - self.origin;
        self.side.pane.frame.vector_to_world(towards.normalize())
    }

    /// The light that a ray from the shading point meets behind the pane, or behind it and a second one.
    pub(super) fn look(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        light: u32,
        AimedRay { place, density, assumed }: AimedRay,
        second: Option<&SecondPanes>,
        counters: &mut Counters,
    ) -> Option<LightSample> {
        let Self { pane, side, origin, .. } = self;
        let frame = &side.pane.frame;
        let ray = Ray::new(*origin, (place.extend(side.near_base()) - *origin).normalize());
        let direction = frame.vector_to_world(ray.direction);
        if direction.dot(point.normal) <= 0.0 {
            return None;
        }
        let through = side.transmit(&ray, counters)?;
        if !coverage::steep(side, [ray.direction, through.inner_direction, through.direction]) {
            return None;
        }
        let mut exit = Ray::new(frame.point_to_world(through.exit), frame.vector_to_world(through.direction));
        let mut ray_origin = SurfaceId::Pane { index: *pane, face: side.far };
        let mut transmitted = through.transmitted;
        let mut transmittance = through.transmittance;
        let first_exit = exit.origin;
        if let Some(second) = second {
            second.behind(*pane, side.near)?;
            let light = through.polarisation.turned(|axis| frame.vector_to_world(axis));
            let passed = second.pass(scene, (*pane, side.near), &exit, ray_origin, light, counters)?;
            (exit, ray_origin) = (passed.exit, passed.surface);
            transmitted *= passed.transmitted;
            transmittance *= passed.transmittance;
        }
        let hit = scene.lights()[light as usize].intersect(&exit)?;
        if hit.radiance == DVec3::ZERO {
            return None;
        }
        let entry = frame.point_to_world(through.entry);
        if scene.blocked_through_pane(point, entry, *pane, side.near, &first_exit, counters)
            || scene.blocked(&exit, hit.distance, ray_origin, None, Some(light), counters)
        {
            return None;
        }
        counters.unique_solutions += 1;
        let path = SampledPath { density: assumed, surface: ray_origin, exit, hit, transmitted };
        let arrival = Arrival { direction, weight: hit.radiance * transmittance / density, path: Some(path) };
        Some(LightSample { arrival, density, through, exit, hit })
    }
}

/// Cuts windows into about `most` parts in all: by halves, the parts of all windows in turn, until each is settled or
/// `most` is reached. Leaves out those from which no light can reach the source. Each part comes with the index of its
/// window.
fn cut(windows: &[(usize, Window<'_>)], most: usize) -> Vec<(usize, Rect)> {
    let capacity = most.max(windows.len());
    let (mut open, mut done) = (VecDeque::with_capacity(capacity), Vec::with_capacity(capacity));
    let keep = |index: usize, rect: &Rect, open: &mut VecDeque<_>, done: &mut Vec<_>| {
        let (_, window) = &windows[index];
        let Some(part) = window.part(rect) else { return };
        if is_settled(window, part.spread) {
            done.push((index, part.rect));
        } else {
            open.push_back((index, part.rect));
        }
    };
    for (index, (_, window)) in windows.iter().enumerate() {
        if is_settled(window, window.spread()) {
            done.push((index, *window.rect()));
        } else {
            keep(index, window.rect(), &mut open, &mut done);
        }
    }
    while open.len() + done.len() < most
        && let Some((index, rect)) = open.pop_front()
    {
        for half in &rect.halves() {
            keep(index, half, &mut open, &mut done);
        }
    }
    done.extend(open);
    done
}

/// Whether slopes that spread the end points so much are not worth telling apart.
fn is_settled(window: &Window<'_>, spread: DVec2) -> bool {
    spread.cmple(window.deflection().extent() * SETTLED).all()
}

/// Whether a pane is smaller than a light, as a point sees both: then its window is all of it.
fn covers(region: &LightRegion, pane: &Pane, from: DVec3) -> bool {
    let bounds = pane.outline.bounds();
    let centre = pane.frame.point_to_world(bounds.centre().extend(0.0));
    let radius = 0.5 * (bounds.max - bounds.min).length();
    region.seen_from_ball(centre, 0.0).is_some_and(|(_, extent)| radius < COVERED * extent * centre.distance(from))
}

impl GlassOfPatch<'_> {
    /// Its area in square metres.
    fn area(&self) -> f64 {
        match self {
            Self::Part(shape) => shape.area(),
            Self::Pane(widened) => widened.area(),
        }
    }

    /// A place in it for a pair of numbers in [0, 1): uniform over the area.
    fn sample(&self, random: DVec2) -> DVec2 {
        match self {
            Self::Part(shape) => shape.sample(random),
            Self::Pane(widened) => widened.sample(random),
        }
    }
}

/// Solid angle, for each unit of area, under which a place of the near plane is seen.
fn solid_angle(side: &PaneSide<'_>, origin: DVec3, place: DVec2) -> f64 {
    let offset = place.extend(side.near_base()) - origin;
    let distance_squared = offset.length_squared();
    offset.z.abs() / (distance_squared * distance_squared.sqrt())
}

/// Bounds on a whole light, in a pane's frame; `None` for one that is all around.
pub(super) fn light_bounds(light: &Light, frame: &Frame) -> Option<SourceBounds> {
    match light.bounds() {
        LightBounds::Ball { centre, radius } => {
            Some(SourceBounds::Ball { centre: frame.point_to_local(centre), radius })
        }
        LightBounds::Cap { direction, sin_radius } => {
            Some(SourceBounds::Cap { direction: frame.vector_to_local(direction), sin_radius })
        }
        LightBounds::Everywhere => None,
    }
}
