//! The panes that stand close behind another, and what becomes of light there.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use super::side::PaneSide;
use super::window::SourceBounds;
use super::{SpecularPath, coverage};
use crate::bsdf::polarisation::Polarisation;
use crate::geometry::boxes::BoxIndex;
use crate::geometry::{Face, Pane, Ray, Surface, SurfaceId};
use crate::scene::pane_tree::{Beyond, LightRegion, PaneTree, Panes};
use crate::scene::{Scene, ShadingPoint};
use clerestory_film::counters::Counters;

/// Largest distance that light travels between both panes, as a part of the longest edge of the larger one.
const MOST_APART: f64 = 0.5;

/// Largest distance that light travels between two panes, metres.
fn reach(first: &Pane, second: &Pane) -> f64 {
    MOST_APART * first.size().max(second.size()).max_element()
}

/// The panes behind which there is another.
#[derive(Debug)]
pub(super) struct SecondPanes {
    /// For each pane, what is behind it for a point before its front face, and for one before its back face.
    behind: Vec<[Option<Behind>; 2]>,
    /// The panes that have another behind them, for points before their front faces, and for points before their back
    /// faces.
    trees: [PaneTree; 2],
}

/// The panes behind another.
#[derive(Debug, Default)]
struct Behind {
    /// Their numbers, in ascending order.
    panes: Vec<u32>,
    bounds: Beyond,
}

/// A ray behind a second pane.
pub(super) struct Passed {
    /// The ray.
    pub(super) exit: Ray,
    /// Where it comes out.
    pub(super) surface: SurfaceId,
    /// What both of its faces transmit together.
    pub(super) transmitted: f64,
    /// What the pane lets through.
    pub(super) transmittance: DVec3,
}

fn number(face: Face) -> usize {
    match face {
        Face::Front => 0,
        Face::Back => 1,
    }
}

impl SecondPanes {
    pub(super) fn new(scene: &Scene) -> Self {
        let panes = scene.panes();
        let classes = SizeClass::of(panes);
        let of_pane = |pane: &Pane| {
            let mut behind: [Option<Behind>; 2] = [None, None];
            for number in classes.iter().flat_map(|class| class.within_reach(pane)) {
                let second = &panes[number as usize];
                let near = [(Face::Front, 1.0), (Face::Back, -1.0)]
                    .into_iter()
                    .find(|(_, sign)| is_second(pane, second, *sign));
                if let Some((near, _)) = near {
                    let normals = [pane, second].map(|pane| pane.frame.vector_to_world(DVec3::Z));
                    let found = Beyond {
                        change: change(second),
                        tilt: (normals[0] - normals[1] * normals[0].dot(normals[1]).signum()).length(),
                        thickness: second.thickness,
                        apart: reach(pane, second),
                    };
                    let behind = behind[self::number(near)].get_or_insert_default();
                    behind.bounds = behind.bounds.or(&found);
                    behind.panes.push(number);
                }
            }
            behind.iter_mut().flatten().for_each(|behind| behind.panes.sort_unstable());
            behind
        };
        let behind: Vec<[Option<Behind>; 2]> = panes.iter().map(of_pane).collect();
        let trees = [Face::Front, Face::Back].map(|near| {
            let numbered = (0u32..).zip(panes).zip(&behind);
            let bounds = |behind: &[Option<Behind>; 2]| Some(behind[number(near)].as_ref()?.bounds);
            let first = numbered.filter_map(|((index, pane), behind)| Some((index, pane, bounds(behind)?)));
            PaneTree::over(first)
        });
        Self { behind, trees }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.behind.iter().flatten().all(Option::is_none)
    }

    /// What is behind a pane as seen from the side of `near`.
    pub(super) fn behind(&self, pane: u32, near: Face) -> Option<&Beyond> {
        self.behind[pane as usize][number(near)].as_ref().map(|behind| &behind.bounds)
    }

    /// Whether light goes on through a pane, that comes out of another one on the side of `near` of that, after a
    /// distance, metres.
    fn goes_on(&self, scene: &Scene, (pane, near): (u32, Face), second: u32, distance: f64) -> bool {
        let [first_pane, second_pane] = [pane, second].map(|index| &scene.panes()[index as usize]);
        let behind = &self.behind[pane as usize][number(near)];
        distance <= reach(first_pane, second_pane)
            && behind.as_ref().is_some_and(|behind| behind.panes.binary_search(&second).is_ok())
    }

    /// The panes that have another behind one of their faces.
    pub(super) fn first_panes(&self) -> impl Iterator<Item = u32> {
        (0u32..).zip(&self.behind).filter(|(_, faces)| faces.iter().any(Option::is_some)).map(|(pane, _)| pane)
    }

    /// The panes through which, and through another behind, light of a region may come to a point, in ascending order.
    pub(super) fn candidates(&self, from: DVec3, region: &LightRegion) -> Panes {
        let [mut found, of_back] = self.trees.each_ref().map(|tree| tree.candidates(from, region));
        found.extend(of_back);
        found.sort_unstable();
        found.dedup();
        found
    }

    /// What becomes of a ray that has come out of a pane and meets another; `None` where nothing comes through.
    pub(super) fn pass(
        &self,
        scene: &Scene,
        first: (u32, Face),
        ray: &Ray,
        ray_origin: SurfaceId,
        light: Polarisation,
        counters: &mut Counters,
    ) -> Option<Passed> {
        let hit = scene.accelerator().closest_hit(ray, f64::INFINITY, ray_origin, counters)?;
        let Surface::Pane { index, .. } = hit.surface else { return None };
        let pane = &scene.panes()[index as usize];
        if scene.media().is_immersed(index) || !self.goes_on(scene, first, index, hit.distance) {
            return None;
        }
        if scene.blocked_by_light(ray, hit.distance, None) {
            return None;
        }
        let frame = &pane.frame;
        let origin = frame.point_to_local(ray.origin);
        let side = PaneSide::facing(pane, origin)?;
        let local = Ray::new(origin, frame.vector_to_local(ray.direction));
        let light = light.turned(|axis| frame.vector_to_local(axis));
        let through = side.transmit_polarised(&local, light, counters)?;
        if !coverage::steep(&side, [local.direction, through.inner_direction, through.direction]) {
            return None;
        }
        let [entry, leaving] = [through.entry, through.exit].map(|place| frame.point_to_world(place));
        let inner = leaving - entry;
        let length = inner.length();
        let within = SurfaceId::Pane { index, face: side.near };
        if scene.blocked(&Ray::new(entry, inner / length), length, within, Some(index), None, counters) {
            return None;
        }
        Some(Passed {
            exit: Ray::new(leaving, frame.vector_to_world(through.direction)),
            surface: SurfaceId::Pane { index, face: side.far },
            transmitted: through.transmitted,
            transmittance: through.transmittance,
        })
    }

    /// Whether a path goes through two panes, the second close behind the first.
    pub(super) fn owns(&self, scene: &Scene, point: &ShadingPoint, path: &SpecularPath<'_>) -> bool {
        let [_, leaving, entering, _] = path.links else { return false };
        let (first, second) = path.links.split_at(2);
        let before = SpecularPath { links: first, last_direction: entering.direction, ..*path };
        let Some(pane) = coverage::through_one_pane(scene, point, &before) else { return false };
        let SurfaceId::Pane { index: second_pane, .. } = entering.surface else { return false };
        let SurfaceId::Pane { face: near, .. } = first[0].surface else { return false };
        let between = ShadingPoint { position: leaving.position, ..*point };
        let behind = SpecularPath { links: second, ..*path };
        self.goes_on(scene, (pane, near), second_pane, leaving.position.distance(entering.position))
            && coverage::through_one_pane(scene, &between, &behind).is_some()
    }
}

impl Beyond {
    /// Bounds on where light may come from that a second pane bends towards a light, both in the frame of the first
    /// pane; `None` where it may come from anywhere.
    pub(super) fn bounds_behind(&self, bounds: &SourceBounds, origin: DVec3) -> Option<SourceBounds> {
        match *bounds {
            SourceBounds::Cap { direction, sin_radius } => {
                let sin_radius = sin_radius + self.chord_towards(direction, sin_radius)?;
                (sin_radius < 1.0).then_some(SourceBounds::Cap { direction, sin_radius })
            }
            SourceBounds::Ball { centre, radius } => {
                let offset = centre - origin;
                let distance = offset.length();
                let chord = self.chord_towards(offset / distance, (radius / distance).min(1.0))?;
                let radius = radius + self.displacement() + 2.0 * distance * chord;
                Some(SourceBounds::Ball { centre, radius })
            }
        }
    }

    /// How far apart directions before and behind the second pane may be, as a chord. It stands nearly parallel to the
    /// first, to which `direction` belongs.
    fn chord_towards(&self, direction: DVec3, spread: f64) -> Option<f64> {
        if self.change == 0.0 {
            return Some(0.0);
        }
        let tangential = direction.truncate().length() + spread + self.change + PARALLEL;
        let steepness = tangential / (1.0 - tangential * tangential).max(0.0).sqrt();
        let chord = self.change * (1.0 + steepness * steepness).sqrt();
        chord.is_finite().then_some(chord)
    }
}

/// Panes whose normals differ by no more than this chord stand parallel.
const PARALLEL: f64 = 0.2;

/// Whether a pane counts as a second one for light that comes out of the first towards the sign of its z. It is within
/// reach and stands parallel to the first. All of it is beyond the first, and all of the first is before it. Light
/// between them rises by [`LEAST_RISE`] at least. Pieces of glass beside each other, a little tilted, are not.
fn is_second(first: &Pane, second: &Pane, sign: f64) -> bool {
    let [normal, other] = [first, second].map(|pane| pane.frame.vector_to_world(DVec3::Z));
    normal.cross(other).length() <= PARALLEL
        && distance(first.world_bounds(), second.world_bounds()) <= reach(first, second)
        && rise(second, first, -sign * normal.dot(other).signum()) > 0.0
        && rise(first, second, sign) > LEAST_RISE * aside(first, second)
}

/// Light that goes aside from one pane to another rises by at least this part of the way.
const LEAST_RISE: f64 = 0.2;

/// How far another pane is beyond one, towards the sign of the z of that, metres; less than 0 where a part is not.
fn rise(one: &Pane, other: &Pane, sign: f64) -> f64 {
    let [min, max] = other.local_bounds();
    let middle = one.frame.point_to_local(other.frame.point_to_world(0.5 * (min + max))).z - 0.5 * one.thickness;
    let across = other.frame.vector_to_local(one.frame.vector_to_world(DVec3::Z));
    sign * middle - across.abs().dot(0.5 * (max - min)) - 0.5 * one.thickness
}

/// How far another pane is beside one along the glass of that, metres; 0 where one covers a part of the other. It may
/// be farther where corners look at each other.
fn aside(one: &Pane, other: &Pane) -> f64 {
    let of_other = other.outline.corners().iter().map(|corner| {
        let place = other.frame.point_to_world(corner.extend(0.0));
        one.frame.point_to_local(place).truncate()
    });
    let mut of_other: Vec<DVec2> = of_other.collect();
    if one.frame.vector_to_world(DVec3::Z).dot(other.frame.vector_to_world(DVec3::Z)) < 0.0 {
        // Seen from its back, it runs the other way round.
        of_other.reverse();
    }
    let of_one = one.outline.corners();
    beyond_edges(of_one, &of_other).max(beyond_edges(&of_other, of_one)).max(0.0)
}

/// The largest distance at which all of a convex polygon is beyond an edge of another one.
fn beyond_edges(polygon: &[DVec2], other: &[DVec2]) -> f64 {
    let edges = polygon.iter().zip(polygon.iter().cycle().skip(1));
    let beyond = |(from, to): (&DVec2, &DVec2)| {
        let outwards = -(*to - *from).normalize_or_zero().perp();
        other.iter().map(|corner| outwards.dot(*corner - *from)).fold(f64::INFINITY, f64::min)
    };
    edges.map(beyond).fold(f64::NEG_INFINITY, f64::max)
}

/// The distance between two boxes, metres.
fn distance([min, max]: [DVec3; 2], [other_min, other_max]: [DVec3; 2]) -> f64 {
    (other_min - max).max(min - other_max).max(DVec3::ZERO).length()
}

/// Panes of which the largest is at most twice as large as the smallest.
struct SizeClass {
    panes: Vec<u32>,
    boxes: BoxIndex,
    /// The longest edge of all, metres.
    longest: f64,
}

impl SizeClass {
    fn of(panes: &[Pane]) -> Vec<Self> {
        let mut classes: BTreeMap<i32, Vec<u32>> = BTreeMap::new();
        for (index, pane) in (0u32..).zip(panes) {
            classes.entry(libm::ilogb(pane.size().max_element())).or_default().push(index);
        }
        let class = |numbers: Vec<u32>| {
            let members = || numbers.iter().map(|&index| &panes[index as usize]);
            Self {
                boxes: BoxIndex::over(members().map(Pane::world_bounds).collect()),
                longest: members().map(|pane| pane.size().max_element()).fold(0.0, f64::max),
                panes: numbers,
            }
        };
        classes.into_values().map(class).collect()
    }

    /// The panes that light may reach from a pane, and some for which it would be too far.
    fn within_reach(&self, pane: &Pane) -> Vec<u32> {
        let reach = DVec3::splat(MOST_APART * self.longest.max(pane.size().max_element()));
        let [min, max] = pane.world_bounds();
        let mut found = Vec::new();
        self.boxes.overlapping(&[min - reach, max + reach], |place| {
            found.push(self.panes[place as usize]);
            true
        });
        found
    }
}

/// The largest change of the tangential part of a direction in a pane.
fn change(pane: &Pane) -> f64 {
    let slope = |face| {
        let [x, y] = pane.bounds(face).gradient.map(|slope| slope.magnitude());
        (x * x + y * y).sqrt()
    };
    let n = pane.index_of_refraction;
    (n * n - 1.0).max(0.0).sqrt() * (slope(Face::Front) + slope(Face::Back))
}
