//! All ways through two interfaces by curves, as a check of the methods that search for them otherwise.
//!
//! A way is given by the place where it meets the first interface: from there light can be followed. How far it then
//! leaves from the direction to the light has two components, both zero on a path. Coplanarity at one interface puts
//! the place on a curve (Granizo-Hidalgo and Holzschuch 2024). At two interfaces it does not, because the second vertex
//! moves as well. What takes its place: the component of the miss that is perpendicular to the way from the straight
//! line's place. It is zero on curves, which in the limit of thin glass are those of the published method. They are
//! found cell by cell of a grid from its signs at the corners. Along a curve the miss points to the straight line's
//! place or away from it, and turns round only at a path.
//!
//! What is found is complete to the resolution of the grid: of two paths on one curve within a cell, neither is seen.

use clerestory_film::counters::Counters;
use clerestory_render_core::geometry::{Frame, Ray, Surface, SurfaceId};
use clerestory_render_core::scene::Scene;
use clerestory_render_core::scene::ShadingPoint;
use glam::{DMat2, DVec2, DVec3};
use rayon::prelude::*;

use crate::forward_tracer::{LightSample, Side};
use crate::traced_pane::TracedPane;
use crate::traced_scene::TracedLight;

/// Cells are cut into four at most so often where the miss turns round but Newton's method finds no path.
const MOST_CUTS: u32 = 8;

/// Steps of Newton's method from where the sign changes.
const NEWTON_STEPS: usize = 16;

/// Steps of at most this length end Newton's method, metres.
const SHORTEST_STEP: f64 = 1e-11;

/// Half the step of difference quotients, metres.
const DIFFERENCE: f64 = 1e-7;

/// Steps towards where a curve crosses the edge of a cell.
const EDGE_STEPS: usize = 12;

/// Where light leaves the second interface, and its unit direction there.
type Onward = (DVec3, DVec3);

/// Two interfaces between a point and a light.
pub struct TwoInterfaces<'a> {
    follow: Box<dyn Fn(DVec2) -> Option<Onward> + Sync + 'a>,
    target: LightSample,
    /// Axes of the plane of the places, in the world.
    axes: [DVec3; 2],
    /// Edges of the rectangle of the places, whose middle is the origin, metres.
    size: DVec2,
    /// Where the straight line from the point to the light meets it.
    straight: DVec2,
}

/// A rectangle, and how far light misses at its corners: lower row first.
#[derive(Clone, Copy)]
struct Cell {
    low: DVec2,
    high: DVec2,
    misses: [DVec2; 4],
}

/// Where a curve crosses the edge of a cell, and how far light misses there.
#[derive(Clone, Copy)]
struct EdgeCrossing {
    place: DVec2,
    miss: DVec2,
}

impl<'a> TwoInterfaces<'a> {
    /// The faces of a pane, seen from `origin`: light is followed by the forward tracer, which shares nothing with the
    /// renderer. Places are those of the near face.
    pub fn of_pane(pane: &'a TracedPane, origin: DVec3, target: LightSample) -> Self {
        let side = Side::towards(pane, &TracedLight::Point { position: origin, intensity: DVec3::ONE });
        let follow = move |place: DVec2| {
            let start = side.start(pane, (place / pane.size + 0.5).to_array());
            let exit = side.refract(pane, &start, (origin - start.world).normalize())?;
            Some((exit.origin, exit.direction))
        };
        let local = |v: DVec3| pane.vector_to_local(v);
        let [from, towards] = [local(origin - pane.origin), local(target.direction_from(origin))];
        Self {
            follow: Box::new(follow),
            target,
            axes: [pane.axes[0], pane.axes[1]],
            size: pane.size,
            straight: (from - towards * (from.z / towards.z)).truncate(),
        }
    }

    /// The first two specular meshes, or two sides of one, that a ray from `point` meets. Places are those of the plane
    /// z = 0 of `frame`, through which rays start.
    pub fn of_meshes(
        scene: &'a Scene,
        point: &'a ShadingPoint,
        target: LightSample,
        frame: &'a Frame,
        size: DVec2,
    ) -> Self {
        let follow = move |place: DVec2| {
            let towards = frame.point_to_world(place.extend(0.0)) - point.position;
            let mut ray = Ray::new(point.position, towards.normalize());
            let mut ray_origin = point.surface;
            for _ in 0..2 {
                let hit = scene.accelerator().closest_hit(&ray, f64::INFINITY, ray_origin, &mut Counters::default())?;
                let Surface::Triangle { index, barycentric } = hit.surface else { return None };
                let normals = scene.normals(index, barycentric);
                let crossing = scene.delta_bsdf(index)?.transmit(ray.direction, &normals)?;
                ray = Ray::new(ray.at(hit.distance), crossing.direction);
                ray_origin = SurfaceId::Triangle(index);
            }
            Some((ray.origin, ray.direction))
        };
        let from = frame.point_to_local(point.position);
        let towards = frame.vector_to_local(target.direction_from(point.position));
        Self {
            follow: Box::new(follow),
            target,
            axes: [frame.axes.x_axis, frame.axes.y_axis],
            size,
            straight: (from - towards * (from.z / towards.z)).truncate(),
        }
    }

    /// The places of all paths that a grid of `cells` by `cells` tells apart, metres from the middle.
    pub fn paths(&self, cells: usize) -> Vec<DVec2> {
        let place =
            |column: usize, row: usize| (DVec2::new(column as f64, row as f64) / cells as f64 - 0.5) * self.size;
        let misses: Vec<Vec<Option<DVec2>>> = (0..=cells)
            .into_par_iter()
            .map(|row| (0..=cells).map(|column| self.miss(place(column, row))).collect())
            .collect();
        let mut found = Vec::new();
        for row in 0..cells {
            for column in 0..cells {
                let corners = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[x, y]| misses[row + y][column + x]);
                let [Some(a), Some(b), Some(c), Some(d)] = corners else { continue };
                let (low, high) = (place(column, row), place(column + 1, row + 1));
                self.search(&Cell { low, high, misses: [a, b, c, d] }, MOST_CUTS, &mut found);
            }
        }
        found
    }

    /// How the direction in which light leaves differs from that to the light, in the plane of the places.
    fn miss(&self, place: DVec2) -> Option<DVec2> {
        let (from, direction) = (self.follow)(place)?;
        let miss = self.target.direction_from(from) - direction;
        Some(DVec2::from(self.axes.map(|axis| axis.dot(miss))))
    }

    /// The component of a miss perpendicular to the way from the straight line's place, times the length of that way.
    fn across(&self, place: DVec2, miss: DVec2) -> f64 {
        (place - self.straight).perp_dot(miss)
    }

    fn search(&self, cell: &Cell, cuts: u32, found: &mut Vec<DVec2>) {
        let corners = cell.corners();
        let crossings: Vec<EdgeCrossing> = [[0, 1], [1, 3], [3, 2], [2, 0]]
            .iter()
            .filter_map(|edge| self.crossing(edge.map(|corner| (corners[corner], cell.misses[corner]))))
            .collect();
        // Of four, the first lies on the lower edge. It is joined to the last, or to the next if the corner between
        // them differs from the middle.
        let shift = if crossings.len() == 4 {
            let middle = 0.5 * (cell.low + cell.high);
            let Some(miss) = self.miss(middle) else { return };
            usize::from((self.across(middle, miss) > 0.0) != (self.across(corners[1], cell.misses[1]) > 0.0))
        } else {
            0
        };
        let mut unsettled = false;
        for k in (shift..crossings.len() + shift).step_by(2) {
            let [first, second] = [k + crossings.len() - 1, k].map(|index| crossings[index % crossings.len()]);
            if first.miss.dot(second.miss) >= 0.0 {
                continue;
            }
            let part = first.miss.length() / (first.miss.length() + second.miss.length());
            let start = first.place.lerp(second.place, part);
            match self.newton(start, cell) {
                Some(path) if found.iter().any(|known| known.distance(path) < 10.0 * DIFFERENCE) => {}
                Some(path) => found.push(path),
                None => unsettled = true,
            }
        }
        if unsettled && cuts > 0 {
            for part in self.cut(cell).iter().flatten() {
                self.search(part, cuts - 1, found);
            }
        }
    }

    /// Where a curve crosses the edge between two corners; `None` when it does not, or twice.
    fn crossing(&self, ends: [(DVec2, DVec2); 2]) -> Option<EdgeCrossing> {
        let across = |(place, miss)| self.across(place, miss);
        let [mut low, mut high] = ends;
        if (across(low) > 0.0) == (across(high) > 0.0) {
            return None;
        }
        for step in 0..EDGE_STEPS {
            let part = if step % 3 == 2 { 0.5 } else { across(low) / (across(low) - across(high)) };
            let place = low.0.lerp(high.0, part);
            let middle = (place, self.miss(place)?);
            *(if (across(middle) > 0.0) == (across(low) > 0.0) { &mut low } else { &mut high }) = middle;
        }
        let (place, miss) = if across(low).abs() < across(high).abs() { low } else { high };
        Some(EdgeCrossing { place, miss })
    }

    /// The path near a place, if Newton's method finds it in the cell or just beside it.
    fn newton(&self, start: DVec2, cell: &Cell) -> Option<DVec2> {
        let margin = 0.1 * (cell.high - cell.low);
        let mut place = start;
        for _ in 0..NEWTON_STEPS {
            let column = |axis: DVec2| {
                let [ahead, behind] = [1.0, -1.0].map(|sign| self.miss(place + axis * (sign * DIFFERENCE)));
                Some((ahead? - behind?) / (2.0 * DIFFERENCE))
            };
            let slope = DMat2::from_cols(column(DVec2::X)?, column(DVec2::Y)?);
            let step = slope.inverse() * self.miss(place)?;
            place -= step;
            let within = place.cmpge(cell.low - margin).all() && place.cmple(cell.high + margin).all();
            if !within {
                return None;
            }
            if step.length() < SHORTEST_STEP {
                return Some(place);
            }
        }
        None
    }

    /// The quarters of a cell; `None` for those that light does not go through everywhere.
    fn cut(&self, cell: &Cell) -> [Option<Cell>; 4] {
        let half = 0.5 * (cell.high - cell.low);
        [DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::ONE].map(|corner| {
            let low = cell.low + corner * half;
            let mut part = Cell { low, high: low + half, misses: [DVec2::ZERO; 4] };
            for (place, miss) in part.corners().into_iter().zip(&mut part.misses) {
                *miss = self.miss(place)?;
            }
            Some(part)
        })
    }
}

impl Cell {
    fn corners(&self) -> [DVec2; 4] {
        let Self { low, high, .. } = *self;
        [low, DVec2::new(high.x, low.y), DVec2::new(low.x, high.y), high]
    }
}
