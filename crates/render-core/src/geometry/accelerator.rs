//! What a ray meets first among the triangles and panes of a scene.
//!
//! A hierarchy in single precision (the module `hierarchy`) decides which primitives are tested. The tests are in
//! double precision, triangles in world coordinates, panes in their own. What a ray has just left is skipped by
//! identity.
//!
//! A sheet, such as the surface of water, has a hierarchy of its own. So steep rays that leave it or end on it need not
//! test it.
//!
//! At equal distances the smaller number wins, triangles before panes. So a result does not depend on the order in
//! which the hierarchy is walked.
//!
//! A surface that is only partly there (the module `coverage`) is met by some rays and not by others.

use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use thiserror::Error;

use super::boxes::BoxIndex;
use super::contact::{NOWHERE, join};
use super::coverage::{Coverage, Parts};
use super::hierarchy::{Hierarchy, MOST_LEVELS};
use super::sheet::Sheet;
use super::triangle::{ShearedRay, coplanar};
use super::{Face, HalfPlane, Pane, PaneHit, Ray, SurfaceId};
use clerestory_film::counters::Counters;

/// Why there can be no hierarchy over a scene.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum AcceleratorError {
    /// A triangle names a corner that does not exist.
    #[error("triangle {triangle} has corner {corner}, but there are only {positions} positions")]
    Corner {
        /// The triangle.
        triangle: usize,
        /// The index that it names.
        corner: u32,
        /// Number of positions.
        positions: usize,
    },
    /// A coordinate is infinite, not a number, or beyond anything that can be computed with.
    #[error("position {index} is {position}: coordinates must be numbers below 1e100")]
    Position {
        /// Index of the position.
        index: usize,
        /// The position.
        position: DVec3,
    },
    /// A pane hangs at no finite place.
    #[error("pane {0:?} hangs at a place that is not finite")]
    PanePlace(String),
    /// There are too many primitives to number them.
    #[error("{0} triangles and panes: at most 2^31 are possible")]
    TooMany(usize),
    /// The primitives are nested so deeply that the hierarchy cannot be walked.
    #[error(
        "the triangles are so unevenly distributed that the hierarchy over them has {0} levels; at most 31 are possible"
    )]
    TooDeep(usize),
}

/// What a ray has met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Surface {
    /// A triangle.
    Triangle {
        /// Its number in the scene.
        index: u32,
        /// Weights of its second and third corner.
        barycentric: [f64; 2],
    },
    /// The boundary of a pane.
    Pane {
        /// Its number in the scene.
        index: u32,
        /// Where, in the pane's frame.
        hit: PaneHit,
    },
}

/// Where a ray meets the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray in metres.
    pub distance: f64,
    /// What was met.
    pub surface: Surface,
}

/// The triangles and panes of a scene, and the hierarchy over both.
#[derive(Clone, Debug)]
pub struct Accelerator {
    panes: Arc<[Pane]>,
    /// For each pane, whether a triangle reaches into its box.
    pierced: Vec<bool>,
    /// Corners of all triangles by number.
    corners: Vec<[DVec3; 3]>,
    everything: Option<Sorted>,
    sheets: Vec<(Sheet, Sorted)>,
    /// How much of the triangles is there; `None` where all of all is.
    coverage: Option<Arc<dyn Coverage>>,
}

/// A ray on its way through the scene.
struct Query<'a> {
    ray: &'a Ray,
    sheared: ShearedRay,
    ray_origin: SurfaceId,
    parts: Parts,
}

impl<'a> Query<'a> {
    fn new(ray: &'a Ray, ray_origin: SurfaceId, parts: Parts) -> Self {
        Self { ray, sheared: ShearedRay::new(ray), ray_origin, parts }
    }
}

/// Primitives with the hierarchy over them.
#[derive(Clone, Debug)]
struct Sorted {
    /// In the order of the hierarchy's leaves.
    leaves: Vec<Primitive>,
    hierarchy: Hierarchy,
}

#[derive(Clone, Copy, Debug)]
enum Primitive {
    Triangle {
        index: u32,
        corners: [DVec3; 3],
    },
    Pane {
        index: u32,
    },
    /// All triangles of a sheet.
    Sheet {
        index: u32,
    },
}

/// A primitive by its number.
#[derive(Clone, Copy, Debug)]
enum Number {
    Triangle(u32),
    Pane(u32),
    Sheet(u32),
}

impl Sorted {
    /// Primitives of which more is known by their numbers; `None` when there are none.
    fn over(
        numbers: &[Number],
        primitive: impl Fn(Number) -> Primitive,
        bounds: impl Fn(Number) -> [DVec3; 2] + Copy,
    ) -> Result<Option<Self>, AcceleratorError> {
        let Some(hierarchy) = Hierarchy::over(numbers.iter().map(|number| bounds(*number))) else { return Ok(None) };
        let levels = hierarchy.levels();
        if levels > MOST_LEVELS {
            return Err(AcceleratorError::TooDeep(levels));
        }
        let leaves = hierarchy.leaves().iter().map(|&index| primitive(numbers[index as usize])).collect();
        Ok(Some(Self { leaves, hierarchy }))
    }
}

impl Accelerator {
    /// The hierarchy over triangles, given by the indices of their corners, and panes. `surfaces` are triangles that
    /// light may pass through, by their numbers, each behind those before it: those that are sheets get hierarchies of
    /// their own.
    ///
    /// # Errors
    /// [`AcceleratorError`] when an index or a coordinate is out of range.
    pub fn build(
        positions: &[DVec3],
        triangles: &[[u32; 3]],
        surfaces: &[Range<u32>],
        panes: Vec<Pane>,
    ) -> Result<Self, AcceleratorError> {
        let corners = gather(positions, triangles)?;
        if let Some(lost) = panes.iter().find(|pane| !pane.world_bounds().iter().all(|corner| in_range(*corner))) {
            return Err(AcceleratorError::PanePlace(lost.name.clone()));
        }
        if corners.len() + panes.len() > 1 << 31 {
            return Err(AcceleratorError::TooMany(corners.len() + panes.len()));
        }
        let primitive = |number: Number| match number {
            Number::Triangle(index) => Primitive::Triangle { index, corners: corners[index as usize] },
            Number::Pane(index) => Primitive::Pane { index },
            Number::Sheet(index) => Primitive::Sheet { index },
        };
        let triangle_bounds = |index: u32| {
            let [a, b, c] = corners[index as usize];
            [a.min(b).min(c), a.max(b).max(c)]
        };
        let mut sheets: Vec<(Sheet, Sorted)> = Vec::new();
        for sheet in surfaces.iter().filter_map(|range| Sheet::of(range.clone(), positions, triangles)) {
            let is_behind = sheets.last().is_none_or(|(last, _)| last.triangles().end <= sheet.triangles().start);
            if !is_behind {
                continue;
            }
            let numbers: Vec<Number> = sheet.triangles().map(Number::Triangle).collect();
            let bounds = |number: Number| match number {
                Number::Triangle(index) => triangle_bounds(index),
                Number::Pane(_) | Number::Sheet(_) => NOWHERE,
            };
            if let Some(sorted) = Sorted::over(&numbers, primitive, bounds)? {
                sheets.push((sheet, sorted));
            }
        }
        let mut numbers = Vec::with_capacity(corners.len() + panes.len());
        let mut next = 0;
        for (index, (sheet, _)) in (0..).zip(&sheets) {
            let Range { start, end } = sheet.triangles();
            numbers.extend((next..start).map(Number::Triangle));
            numbers.push(Number::Sheet(index));
            next = end;
        }
        numbers.extend((next..corners.len() as u32).map(Number::Triangle));
        numbers.extend((0..panes.len() as u32).map(Number::Pane));
        let bounds = |number: Number| match number {
            Number::Triangle(index) => triangle_bounds(index),
            Number::Pane(index) => panes[index as usize].world_bounds(),
            Number::Sheet(index) => sheets[index as usize].1.hierarchy.bounds(),
        };
        let mut are_pierced = Vec::new();
        // The hierarchy is built on this thread, whose freed memory it takes.
        let everything = rayon::in_place_scope(|scope| {
            scope.spawn(|_| are_pierced = pierced(&panes, &corners));
            Sorted::over(&numbers, primitive, bounds)
        })?;
        Ok(Self { panes: panes.into(), pierced: are_pierced, everything, sheets, corners, coverage: None })
    }

    /// The same triangles, of which only a part is there.
    #[must_use]
    pub fn with_coverage(self, coverage: Arc<dyn Coverage>) -> Self {
        Self { coverage: Some(coverage), ..self }
    }

    /// The panes, by number.
    pub fn panes(&self) -> &[Pane] {
        &self.panes
    }

    /// The corners of a triangle.
    pub fn corners(&self, triangle: u32) -> &[DVec3; 3] {
        &self.corners[triangle as usize]
    }

    /// The distance at which a ray meets a triangle, whatever else is in the way; `None` where it misses.
    pub fn distance_to_triangle(&self, ray: &Ray, triangle: u32) -> Option<f64> {
        ShearedRay::new(ray).intersect(self.corners(triangle)).map(|hit| hit.distance)
    }

    /// Corners of a box that holds everything; `None` when there is nothing.
    pub fn bounds(&self) -> Option<[DVec3; 2]> {
        self.everything.as_ref().map(|everything| everything.hierarchy.bounds())
    }

    /// The nearest triangle or pane within `max_distance` of a ray through the air.
    pub fn closest_hit(
        &self,
        ray: &Ray,
        max_distance: f64,
        ray_origin: SurfaceId,
        counters: &mut Counters,
    ) -> Option<Hit> {
        self.closest(&Query::new(ray, ray_origin, Parts::Drawn), max_distance, counters)
    }

    fn closest(&self, query: &Query<'_>, max_distance: f64, counters: &mut Counters) -> Option<Hit> {
        counters.rays += 1;
        let &Query { ray, ray_origin, .. } = query;
        self.nearest(ray, max_distance, self.left_behind(ray_origin, ray), |primitive| match primitive {
            Primitive::Triangle { index, corners } => self.hit_triangle(query, *index, corners),
            Primitive::Pane { index } => self.hit_pane(ray, max_distance, *index, ray_origin, counters),
            Primitive::Sheet { .. } => None,
        })
    }

    /// The nearest triangle, or the boundary of the pane in whose glass the ray starts, for a ray through that glass.
    /// Other panes are not seen. `start_face` is the face of the pane on which the ray starts, if any.
    pub fn closest_hit_inside(
        &self,
        pane_index: u32,
        ray: &Ray,
        start_face: Option<Face>,
        counters: &mut Counters,
    ) -> Option<Hit> {
        self.closest_inside(pane_index, &Query::new(ray, SurfaceId::Nothing, Parts::Drawn), start_face, counters)
    }

    fn closest_inside(
        &self,
        pane_index: u32,
        query: &Query<'_>,
        start_face: Option<Face>,
        counters: &mut Counters,
    ) -> Option<Hit> {
        counters.rays += 1;
        let ray = query.ray;
        let pane = &self.panes[pane_index as usize];
        let boundary = pane
            .intersect_inside(&to_local(pane, ray), start_face, counters)
            .map(|hit| Hit { distance: hit.distance, surface: Surface::Pane { index: pane_index, hit } });
        if !self.pierced[pane_index as usize] {
            return boundary;
        }
        let max_distance = boundary.map_or(f64::INFINITY, |hit| hit.distance);
        let triangle = self.nearest(ray, max_distance, None, |primitive| match primitive {
            Primitive::Triangle { index, corners } => self.hit_triangle(query, *index, corners),
            Primitive::Pane { .. } | Primitive::Sheet { .. } => None,
        });
        triangle.or(boundary)
    }

    /// Whether anything stands within `max_distance` in the way of a ray through the air. Panes do, but for
    /// `ignored_pane`.
    pub fn occluded(
        &self,
        ray: &Ray,
        max_distance: f64,
        ray_origin: SurfaceId,
        ignored_pane: Option<u32>,
        counters: &mut Counters,
    ) -> bool {
        self.occluded_to(&Query::new(ray, ray_origin, Parts::Drawn), max_distance, ignored_pane, counters)
    }

    fn occluded_to(
        &self,
        query: &Query<'_>,
        max_distance: f64,
        ignored_pane: Option<u32>,
        counters: &mut Counters,
    ) -> bool {
        counters.rays += 1;
        self.any(query, max_distance, SurfaceId::Nothing, ignored_pane, counters, |hit| hit.distance <= max_distance)
    }

    /// Whether `test` says yes to a hit on a triangle, or on a pane other than `ignored_pane`. Some beyond
    /// `max_distance` are tested as well. `reaching` is what the ray ends on.
    fn any(
        &self,
        query: &Query<'_>,
        max_distance: f64,
        reaching: SurfaceId,
        ignored_pane: Option<u32>,
        counters: &mut Counters,
        mut test: impl FnMut(&Hit) -> bool,
    ) -> bool {
        let Some(everything) = &self.everything else { return false };
        let &Query { ray, ray_origin, .. } = query;
        let passed = self.left_behind(ray_origin, ray).or_else(|| self.left_behind(reaching, ray));
        everything.hierarchy.any(ray, max_distance, |leaf| {
            let hit = match &everything.leaves[leaf] {
                Primitive::Triangle { index, corners } => self.hit_triangle(query, *index, corners),
                Primitive::Pane { index } if query.parts == Parts::Veils || Some(*index) == ignored_pane => None,
                Primitive::Pane { index } => self.hit_pane(ray, max_distance, *index, ray_origin, counters),
                Primitive::Sheet { index } if Some(*index) == passed => None,
                Primitive::Sheet { index } => {
                    let (_, sheet) = &self.sheets[*index as usize];
                    return sheet.hierarchy.any(ray, max_distance, |leaf| match &sheet.leaves[leaf] {
                        Primitive::Triangle { index, corners } => {
                            self.hit_triangle(query, *index, corners).is_some_and(|hit| test(&hit))
                        }
                        Primitive::Pane { .. } | Primitive::Sheet { .. } => false,
                    });
                }
            };
            hit.is_some_and(|hit| test(&hit))
        })
    }

    /// The nearest hit; nothing is looked for on the sheet that has been `passed`.
    fn nearest(
        &self,
        ray: &Ray,
        max_distance: f64,
        passed: Option<u32>,
        mut test: impl FnMut(&Primitive) -> Option<Hit>,
    ) -> Option<Hit> {
        let mut nearest: Option<Hit> = None;
        let everything = self.everything.as_ref()?;
        let mut nearer = |primitive: &Primitive| {
            let hit = test(primitive)?;
            if hit.distance > max_distance || nearest.is_some_and(|best| precedes(&best, &hit)) {
                return None;
            }
            nearest = Some(hit);
            Some(hit.distance)
        };
        let mut reach = max_distance;
        everything.hierarchy.visit(ray, max_distance, |leaf| {
            let found = match &everything.leaves[leaf] {
                Primitive::Sheet { index } if Some(*index) == passed => None,
                Primitive::Sheet { index } => {
                    let (_, sheet) = &self.sheets[*index as usize];
                    let mut found = None;
                    sheet.hierarchy.visit(ray, reach, |leaf| {
                        let distance = nearer(&sheet.leaves[leaf]);
                        found = distance.or(found);
                        distance
                    });
                    found
                }
                primitive => nearer(primitive),
            };
            reach = found.unwrap_or(reach);
            found
        });
        nearest
    }

    /// The sheet which a ray that begins or ends on it does not meet anywhere else.
    fn left_behind(&self, on: SurfaceId, ray: &Ray) -> Option<u32> {
        let SurfaceId::Triangle(triangle) = on else { return None };
        let index = self.sheets.partition_point(|(sheet, _)| sheet.triangles().end <= triangle);
        let (sheet, _) = self.sheets.get(index)?;
        (sheet.triangles().contains(&triangle) && sheet.meets_once(ray.direction)).then_some(index as u32)
    }

    fn hit_triangle(&self, query: &Query<'_>, index: u32, corners: &[DVec3; 3]) -> Option<Hit> {
        if query.ray_origin == SurfaceId::Triangle(index) {
            return None;
        }
        let hit = query.sheared.intersect(corners)?;
        if let SurfaceId::Triangle(start) = query.ray_origin
            && self.is_beside(start, corners, hit.distance)
        {
            return None;
        }
        if let Some(coverage) = &self.coverage {
            let opacity = coverage.opacity(index, hit.barycentric);
            if !query.parts.is_met(opacity, query.ray, index) {
                return None;
            }
        }
        let surface = Surface::Triangle { index, barycentric: hit.barycentric };
        Some(Hit { distance: hit.distance, surface })
    }

    /// Whether a ray that leaves a triangle leaves another with it, which it would meet at `distance`: it starts on the
    /// edge to a neighbour in the same plane.
    fn is_beside(&self, start: u32, corners: &[DVec3; 3], distance: f64) -> bool {
        distance <= 1e-9 * (corners[0] - corners[1]).abs().max_element()
            && coplanar(&self.corners[start as usize], corners)
    }

    fn hit_pane(
        &self,
        ray: &Ray,
        max_distance: f64,
        index: u32,
        ray_origin: SurfaceId,
        counters: &mut Counters,
    ) -> Option<Hit> {
        let pane = &self.panes[index as usize];
        let face = match ray_origin {
            SurfaceId::Pane { index: own, face } if own == index => Some(face),
            _ => None,
        };
        let hit = pane.intersect_outside(&to_local(pane, ray), max_distance, face, counters)?;
        Some(Hit { distance: hit.distance, surface: Surface::Pane { index, hit } })
    }
}

/// Whether `a` is the one to report of two hits.
fn precedes(a: &Hit, b: &Hit) -> bool {
    let rank = |hit: &Hit| match hit.surface {
        Surface::Triangle { index, .. } => (0, index),
        Surface::Pane { index, .. } => (1, index),
    };
    a.distance < b.distance || (a.distance == b.distance && rank(a) < rank(b))
}

fn gather(positions: &[DVec3], triangles: &[[u32; 3]]) -> Result<Vec<[DVec3; 3]>, AcceleratorError> {
    if let Some(index) = positions.iter().position(|position| !in_range(*position)) {
        return Err(AcceleratorError::Position { index, position: positions[index] });
    }
    let corner = |triangle: usize, corner: u32| {
        let missing = AcceleratorError::Corner { triangle, corner, positions: positions.len() };
        positions.get(corner as usize).copied().ok_or(missing)
    };
    let mut gathered = Vec::with_capacity(triangles.len());
    for (index, triangle) in triangles.iter().enumerate() {
        let [a, b, c] = triangle.map(|vertex| corner(index, vertex));
        gathered.push([a?, b?, c?]);
    }
    Ok(gathered)
}

fn in_range(p: DVec3) -> bool {
    p.is_finite() && p.abs().max_element() < 1e100
}

/// Which panes a triangle may reach into.
fn pierced(panes: &[Pane], corners: &[[DVec3; 3]]) -> Vec<bool> {
    let mut pierced = vec![false; panes.len()];
    let around = BoxIndex::over(panes.iter().map(Pane::world_bounds).collect());
    for triangle in corners {
        let bounds = triangle.iter().fold(NOWHERE, |bounds, corner| join(bounds, [*corner, *corner]));
        around.overlapping(&bounds, |index| {
            let index = index as usize;
            pierced[index] = pierced[index] || reaches_into(triangle, &panes[index]);
            true
        });
    }
    pierced
}

/// Whether no side of the box around the glass and no edge of its outline separates a triangle from it.
fn reaches_into(triangle: &[DVec3; 3], pane: &Pane) -> bool {
    let corners = triangle.map(|corner| pane.frame.point_to_local(corner));
    let [a, b, c] = corners;
    let (min, max) = (a.min(b).min(c), a.max(b).max(c));
    let [low, high] = pane.local_bounds();
    let slack = 64.0 * f64::EPSILON * (min.abs().max(max.abs()).max_element() + pane.frame.origin.abs().max_element());
    let is_beyond = |cut: &HalfPlane| corners.iter().all(|corner| cut.distance(corner.truncate()) < -slack);
    (min - slack).cmple(high).all() && (max + slack).cmpge(low).all() && !pane.outline.cuts().iter().any(is_beyond)
}

fn to_local(pane: &Pane, ray: &Ray) -> Ray {
    Ray::new(pane.frame.point_to_local(ray.origin), pane.frame.vector_to_local(ray.direction))
}

mod passing;
mod solid;
mod within;

pub use passing::{MOST_PASSED, Passed, PassedTriangle};
pub use solid::Solid;
pub use within::Within;

#[cfg(test)]
mod tests;
