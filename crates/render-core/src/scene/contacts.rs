//! Which bodies of a scene touch, overlap or hold each other, and which panes a light reaches into.
//!
//! A body is a pane, or a mesh of glass or water that has an inside. A mesh that refracts or mirrors light and has no
//! inside may not stand in the glass of a pane. Nothing says what lies behind it there.

use std::ops::Range;

use glam::DVec3;

use super::MeshSurface;
use super::validate_places::Metres;
use crate::geometry::contact::{NOWHERE, Shape, contact, join, overlap};
use crate::geometry::{Accelerator, Pane, Ray};
use crate::light::{Body, Light};
use crate::settings::check::Quoted;
use crate::settings::{Check, JsonPath, SceneError};

/// Parts of panes that are looked at in all: a second's work. What is not settled by then counts as apart.
const MOST_PARTS: u32 = 1 << 21;

/// Boxes that are compared with that of a pane for the price of one part.
const BOXES_FOR_A_PART: usize = 64;

/// Triangles that share a box: in most meshes, those that follow each other lie side by side.
const TRIANGLES_IN_A_BOX: usize = 64;

/// Rays that compare meshes with each other in all: a second's work. What is not settled by then counts as apart.
const MOST_RAYS: u32 = 1 << 21;

/// Rays that tell whether a point is in a mesh.
const RAYS_OF_A_POINT: u32 = 3;

/// Corners of a mesh that are looked for in another one.
const MOST_CORNERS: u32 = 256;

/// What meets what.
#[derive(Debug, Default)]
pub(super) struct Contacts {
    /// Pairs of bodies, panes first, then meshes.
    pub(super) pairs: Vec<[u32; 2]>,
    /// Panes that a mesh reaches into which is a light.
    pub(super) shone_into: Vec<u32>,
}

/// Things that are compared, with a bound on the work of all comparisons.
pub(super) struct Finder<'a> {
    pub(super) accelerator: &'a Accelerator,
    pub(super) meshes: &'a [MeshSurface],
    pub(super) mesh_bounds: &'a [[DVec3; 2]],
    /// Whether each mesh is a light.
    pub(super) is_light: &'a dyn Fn(u32) -> bool,
    /// Whether each mesh is a body.
    pub(super) is_body: &'a dyn Fn(u32) -> bool,
    parts: u32,
    rays: u32,
    found: Contacts,
}

/// Boxes around a mesh.
struct Boxes {
    whole: [DVec3; 2],
    /// Those around some of its triangles each, and which these are.
    parts: Vec<(Range<u32>, [DVec3; 2])>,
}

impl Boxes {
    fn around(mesh: &MeshSurface, accelerator: &Accelerator) -> Self {
        let all = mesh.triangle_range();
        let part = |first: u32| {
            let triangles = first..all.end.min(first + TRIANGLES_IN_A_BOX as u32);
            let bounds = triangles.clone().map(|triangle| Shape::Polygon(accelerator.corners(triangle)).bounds());
            (triangles, bounds.fold(NOWHERE, join))
        };
        let parts: Vec<(Range<u32>, [DVec3; 2])> = all.clone().step_by(TRIANGLES_IN_A_BOX).map(part).collect();
        Self { whole: parts.iter().map(|(_, bounds)| *bounds).fold(NOWHERE, join), parts }
    }
}

impl<'a> Finder<'a> {
    pub(super) fn new(
        accelerator: &'a Accelerator,
        meshes: &'a [MeshSurface],
        mesh_bounds: &'a [[DVec3; 2]],
        is_light: &'a dyn Fn(u32) -> bool,
        is_body: &'a dyn Fn(u32) -> bool,
    ) -> Self {
        let found = Contacts::default();
        Self { accelerator, meshes, mesh_bounds, is_light, is_body, parts: MOST_PARTS, rays: MOST_RAYS, found }
    }

    /// All contacts.
    ///
    /// # Errors
    ///
    /// A mesh without an inside in the glass of a pane.
    pub(super) fn find(mut self) -> Result<Contacts, SceneError> {
        self.find_panes();
        self.find_meshes_in_panes()?;
        self.find_meshes();
        Ok(self.found)
    }

    fn panes(&self) -> &'a [Pane] {
        self.accelerator.panes()
    }

    fn body(&self, mesh: u32) -> u32 {
        self.panes().len() as u32 + mesh
    }

    /// Panes are compared with those beside them along the axis on which they are spread most.
    fn find_panes(&mut self) {
        let panes = self.panes();
        let boxes: Vec<[DVec3; 2]> = panes.iter().map(Pane::world_bounds).collect();
        let spread = boxes.iter().fold(NOWHERE, |bounds, b| {
            let middle = 0.5 * (b[0] + b[1]);
            join(bounds, [middle, middle])
        });
        let axis = (spread[1] - spread[0]).max_position();
        let mut order: Vec<usize> = (0..boxes.len()).collect();
        order.sort_by(|a, b| boxes[*a][0][axis].total_cmp(&boxes[*b][0][axis]));
        for (place, &first) in order.iter().enumerate() {
            let beside = order[place + 1..].iter().take_while(|other| boxes[**other][0][axis] <= boxes[first][1][axis]);
            for &second in beside.filter(|other| overlap(&boxes[first], &boxes[**other])) {
                let [low, high] = [first.min(second), first.max(second)];
                if contact(&panes[low], &Shape::Pane(&panes[high]), &mut self.parts).is_some() {
                    self.found.pairs.push([low as u32, high as u32]);
                }
            }
        }
    }

    fn find_meshes_in_panes(&mut self) -> Check {
        if self.panes().is_empty() {
            return Ok(());
        }
        let concerns =
            |mesh: &MeshSurface, index: u32| mesh.is_specular() || mesh.interior().is_some() || (self.is_light)(index);
        let near = (0u32..).zip(self.meshes).filter(|(index, mesh)| concerns(mesh, *index));
        let near: Vec<(u32, Boxes)> =
            near.map(|(index, mesh)| (index, Boxes::around(mesh, self.accelerator))).collect();
        for (pane_index, pane) in (0u32..).zip(self.panes()) {
            let around = pane.world_bounds();
            self.count_boxes(near.len());
            for (mesh, boxes) in &near {
                if !overlap(&around, &boxes.whole) || self.parts == 0 {
                    continue;
                }
                let Some(at) = self.mesh_against(pane, &around, boxes) else {
                    if self.holds(pane, *mesh) {
                        self.found.pairs.push([pane_index, self.body(*mesh)]);
                    }
                    continue;
                };
                if (self.is_body)(*mesh) {
                    self.found.pairs.push([pane_index, self.body(*mesh)]);
                } else if self.meshes[*mesh as usize].is_specular() {
                    return self.refuse(*mesh, pane_index, at);
                }
                if (self.is_light)(*mesh) {
                    self.found.shone_into.push(pane_index);
                }
            }
        }
        Ok(())
    }

    /// A point that the glass of a pane and the surface of a mesh share.
    fn mesh_against(&mut self, pane: &Pane, around: &[DVec3; 2], boxes: &Boxes) -> Option<DVec3> {
        self.count_boxes(boxes.parts.len());
        for (triangles, part) in &boxes.parts {
            if self.parts == 0 {
                return None;
            }
            if !overlap(around, part) {
                continue;
            }
            self.count_boxes(triangles.len());
            let meets = |triangle| {
                let shape = Shape::Polygon(self.accelerator.corners(triangle));
                overlap(around, &shape.bounds()).then(|| contact(pane, &shape, &mut self.parts)).flatten()
            };
            let found = triangles.clone().find_map(meets);
            if found.is_some() {
                return found;
            }
        }
        None
    }

    /// Whether a mesh is a body in which a pane stands that is apart from its surface, or the other way round.
    fn holds(&mut self, pane: &Pane, mesh: u32) -> bool {
        let place = pane.outline.middle();
        let middle = 0.5 * (pane.front.height(place) + pane.thickness + pane.back.height(place));
        let of_pane = pane.frame.point_to_world(place.extend(middle));
        let first = self.accelerator.corners(self.meshes[mesh as usize].triangle_range().start)[0];
        (self.is_body)(mesh) && (pane.holds(first) || self.is_in(of_pane, mesh))
    }

    fn is_in(&mut self, point: DVec3, mesh: u32) -> bool {
        overlap(&self.mesh_bounds[mesh as usize], &[point, point])
            && self.pays(RAYS_OF_A_POINT)
            && self.accelerator.winding(point, &self.meshes[mesh as usize].triangle_range()) > 0
    }

    fn refuse(&self, mesh: u32, pane: u32, at: DVec3) -> Check {
        let root = JsonPath::Root;
        let path = root.member("meshes");
        let found = format!(
            "mesh {} in or against the glass of pane {} (panes[{pane}]) at {}",
            Quoted(self.meshes[mesh as usize].name()),
            Quoted(&self.panes()[pane as usize].name),
            Metres(at)
        );
        let expected = "apart from it: a dielectric without an inside, or a mirror, would be wrong in glass";
        Err(SceneError::value(&path.element(mesh as usize).member("source"), found, expected))
    }

    /// Pays for rays; false where there are none left.
    fn pays(&mut self, rays: u32) -> bool {
        let left = self.rays.checked_sub(rays);
        self.rays = left.unwrap_or(0);
        left.is_some()
    }

    /// Pays for boxes that are compared with that of a pane.
    fn count_boxes(&mut self, boxes: usize) {
        self.parts = self.parts.saturating_sub(boxes.div_ceil(BOXES_FOR_A_PART) as u32);
    }

    fn find_meshes(&mut self) {
        let may_be_body = |mesh: &u32| self.meshes[*mesh as usize].interior().is_some();
        let mut order: Vec<u32> = (0..self.meshes.len() as u32).filter(may_be_body).collect();
        let bounds = |mesh: u32| &self.mesh_bounds[mesh as usize];
        order.sort_by(|a, b| bounds(*a)[0].x.total_cmp(&bounds(*b)[0].x));
        for (place, &first) in order.iter().enumerate() {
            let beside = order[place + 1..].iter().take_while(|other| bounds(**other)[0].x <= bounds(first)[1].x);
            for &second in beside {
                let are_near = overlap(bounds(first), bounds(second));
                if are_near && (self.is_body)(first) && (self.is_body)(second) && self.meet(first, second) {
                    let [low, high] = [first.min(second), first.max(second)].map(|mesh| self.body(mesh));
                    self.found.pairs.push([low, high]);
                }
            }
        }
    }

    /// Whether two meshes that are bodies have a point in common.
    fn meet(&mut self, first: u32, second: u32) -> bool {
        let pairs = [[first, second], [second, first]];
        pairs.iter().any(|[one, other]| self.has_corner_in(*one, *other))
            || pairs.iter().any(|[one, other]| self.cross(*one, *other))
    }

    /// Whether a corner of one mesh is in the other, of some that are spread over it.
    fn has_corner_in(&mut self, one: u32, other: u32) -> bool {
        let triangles = self.meshes[one as usize].triangle_range();
        let step = (triangles.len() as u32).div_ceil(MOST_CORNERS).max(1);
        let accelerator = self.accelerator;
        triangles.step_by(step as usize).any(|triangle| self.is_in(accelerator.corners(triangle)[0], other))
    }

    /// Whether an edge of one mesh goes through a triangle of the other.
    fn cross(&mut self, one: u32, other: u32) -> bool {
        let around = &self.mesh_bounds[other as usize];
        let target = self.meshes[other as usize].triangle_range();
        for triangle in self.meshes[one as usize].triangle_range() {
            let corners = self.accelerator.corners(triangle);
            if !overlap(&Shape::Polygon(corners).bounds(), around) {
                continue;
            }
            if !self.pays(3) {
                return false;
            }
            let goes_through = |from: DVec3, to: DVec3| {
                let length = from.distance(to);
                let mut is_met = false;
                let ray = Ray::new(from, (to - from) / length);
                self.accelerator.triangles_along(&ray, length, &mut |met, _| is_met |= target.contains(&met));
                is_met
            };
            let [a, b, c] = *corners;
            if goes_through(a, b) || goes_through(b, c) || goes_through(c, a) {
                return true;
            }
        }
        false
    }
}

/// For each pane, whether a light that is no mesh stands in it or against it.
pub(super) fn lit_panes(panes: &[Pane], lights: &[Light]) -> Vec<u32> {
    let mut budget = MOST_PARTS;
    let mut lit = Vec::new();
    for body in lights.iter().filter_map(|light| light.body()) {
        let shape = match &body {
            Body::Ball { centre, radius } => Shape::Ball { centre: *centre, radius: *radius },
            Body::Polygon(corners) => Shape::Polygon(corners),
        };
        lit.extend((0u32..).zip(panes).filter_map(|(index, pane)| contact(pane, &shape, &mut budget).map(|_| index)));
    }
    lit
}

#[cfg(test)]
mod tests;
