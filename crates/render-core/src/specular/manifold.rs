//! The manifold walk: Newton's method on the constraints of a chain, in which every iterate is a path that light takes
//! (Zeltner et al. 2020, Algorithm 1; for two vertices the authors' published code).
//!
//! A step moves the first vertex along its tangent plane; a ray from the shading point through where it lands is traced
//! through the scene and refracted at both faces, and gives the next iterate. Where that ray does not cross the pane, the
//! step is halved. So whatever stands in the way of the ray stands in the way of the walk as well.
//!
//! Lengths below which the authors' code gives up are absolute and exceed the thickness of a window pane; there are none
//! here.

use glam::{DMat2, DVec2, DVec3};

use super::{
    block_tridiagonal::{Row, solve},
    constraint::{Residual, Vertex},
    fermat::{FermatPath, Theta},
    newton::{Root, SearchRegion, polished},
    passage::Passage,
    side::unit_normal,
};
use crate::{
    counters::Counters,
    geometry::{Face, Leaving, PaneBoundary, Ray, Surface},
    optics::dielectric::refract,
    scene::{description::ManifoldConstraint, visibility::straight},
};

/// Zeltner et al. 2020, the published configuration.
const MAX_ITERATIONS: usize = 20;

/// Zeltner et al. 2020, the published configuration: largest component of a constraint that counts as zero.
const THRESHOLD: f64 = 1e-5;

/// The search for paths through one pane by manifold walks.
pub(super) struct ManifoldWalk<'a> {
    passage: &'a Passage<'a>,
    constraint: ManifoldConstraint,
    region: SearchRegion,
}

impl<'a> ManifoldWalk<'a> {
    pub(super) fn new(passage: &'a Passage<'a>, constraint: ManifoldConstraint) -> Self {
        let pane = passage.side.pane;
        Self { passage, constraint, region: SearchRegion::around(&pane.outline(), pane.thickness) }
    }

    /// Whether two roots are the same path.
    pub(super) fn same(&self, first: &Root, second: &Root) -> bool {
        self.region.same(first, second)
    }

    /// Walks from the path that light takes from the shading point through a place of the near face, given by its
    /// tangential coordinates.
    pub(super) fn walk_from(&self, place: DVec2, counters: &mut Counters) -> Option<Root> {
        counters.solver_calls += 1;
        counters.height_evaluations += 1;
        let height = self.passage.side.near_surface().height(place);
        let seed = self.trace(place.extend(self.passage.side.near_base() + height), counters)?;
        self.walk(seed, counters)
    }

    /// Walks from where the straight line to the light crosses both faces; `None` when anything but this pane is on it.
    pub(super) fn walk_from_straight_line(&self, counters: &mut Counters) -> Option<Root> {
        counters.solver_calls += 1;
        let Passage { scene, point, light, sample, side, .. } = self.passage;
        let frame = &side.pane.frame;
        let (outside, distance) = straight(point.position, sample.source);
        let hit = scene.accelerator().closest_hit(&outside, distance, point.leaving, counters)?;
        let (entry, _) = self.crossing(&hit.surface, side.near)?;
        let inside = Ray::new(frame.point_to_world(entry), outside.direction);
        let hit = scene.accelerator().closest_hit_inside(self.passage.pane, &inside, Some(side.near), counters)?;
        let (exit, _) = self.crossing(&hit.surface, side.far)?;
        let (beyond, distance) = straight(frame.point_to_world(exit), sample.source);
        let leaving = Leaving::Pane { index: self.passage.pane, face: side.far };
        if scene.blocked(&beyond, distance, leaving, None, Some(*light), counters) {
            return None;
        }
        self.walk([entry.truncate(), exit.truncate()], counters)
    }

    /// Walks from a pair of vertices.
    fn walk(&self, seed: Theta, counters: &mut Counters) -> Option<Root> {
        let connection = &self.passage.connection;
        let mut theta = seed;
        let mut fraction = 1.0;
        let mut ahead: Option<(FermatPath, DVec2)> = None;
        for _ in 0..MAX_ITERATIONS {
            let (path, step) = match ahead {
                Some(ahead) => ahead,
                None => {
                    let path = connection.path(&theta, counters);
                    let [near, far] = residuals(&path, self.constraint, connection.index)?;
                    if near.value.abs().max(far.value.abs()).max_element() <= THRESHOLD {
                        return polished(connection, theta, &self.region, counters);
                    }
                    let mut rows = rows(&path, &[near, far]);
                    solve(&mut rows)?;
                    (path, rows[0].right)
                }
            };
            ahead = Some((path, step));
            let slope = path.jets[0].gradient.dot(step);
            if let Some(next) = self.trace(path.vertices[0] - step.extend(slope) * fraction, counters) {
                theta = next;
                ahead = None;
                fraction = f64::min(1.0, 2.0 * fraction);
            } else {
                fraction *= 0.5;
            }
        }
        None
    }

    /// The vertices of the path that light takes from the shading point towards `target` (in the pane's frame); `None` when
    /// it does not cross the pane.
    fn trace(&self, target: DVec3, counters: &mut Counters) -> Option<Theta> {
        let Passage { scene, point, side, connection, .. } = self.passage;
        let direction = (target - connection.origin).normalize();
        let outside = Ray::new(point.position, side.pane.frame.vector_to_world(direction));
        let hit = scene.accelerator().closest_hit(&outside, f64::INFINITY, point.leaving, counters)?;
        let (entry, gradient) = self.crossing(&hit.surface, side.near)?;
        let inner = refract(direction, unit_normal(gradient), 1.0, connection.index)?.direction;
        let inside = Ray::new(side.pane.frame.point_to_world(entry), side.pane.frame.vector_to_world(inner));
        let hit = scene.accelerator().closest_hit_inside(self.passage.pane, &inside, Some(side.near), counters)?;
        let (exit, _) = self.crossing(&hit.surface, side.far)?;
        Some([entry.truncate(), exit.truncate()])
    }

    /// Where a ray met the given face of this pane, and the slope there; `None` when it met something else.
    fn crossing(&self, surface: &Surface, face: Face) -> Option<(DVec3, DVec2)> {
        match surface {
            Surface::Pane { index, hit } if *index == self.passage.pane && hit.boundary == PaneBoundary::Face(face) => {
                Some((hit.point, hit.gradient))
            }
            _ => None,
        }
    }
}

/// The constraints at both vertices of a path through a pane of the given index of refraction.
fn residuals(path: &FermatPath, constraint: ManifoldConstraint, index: f64) -> Option<[Residual; 2]> {
    let [first, inner, last] = path.directions;
    let [near, far] = &path.jets;
    let entry = Vertex { jet: near, to_previous: -first, to_next: inner, ratio: index };
    let exit = Vertex { jet: far, to_previous: -inner, to_next: last, ratio: 1.0 / index };
    Some([entry.residual(constraint)?, exit.residual(constraint)?])
}

/// The linearised constraints: each vertex moves along its face.
fn rows(path: &FermatPath, residuals: &[Residual; 2]) -> [Row; 2] {
    let [first, inner, last] = path.directions;
    let [to_shading_point, thickness, to_light] = path.lengths;
    let tangents = [0, 1].map(|face| {
        let gradient = path.jets[face].gradient;
        [DVec3::new(1.0, 0.0, gradient.x), DVec3::new(0.0, 1.0, gradient.y)]
    });
    let [near, far] = residuals;
    let by_inner = |gradients: &[DVec3; 2], face: usize| turned(gradients, inner, thickness, &tangents[face]);
    [
        Row {
            before: DMat2::ZERO,
            // Moving a vertex turns the directions to its neighbours the other way.
            own: near.by_normal
                - turned(&near.by_previous, first, to_shading_point, &tangents[0])
                - by_inner(&near.by_next, 0),
            after: by_inner(&near.by_next, 1),
            right: near.value,
        },
        Row {
            before: by_inner(&far.by_previous, 0),
            own: far.by_normal - by_inner(&far.by_previous, 1) - turned(&far.by_next, last, to_light, &tangents[1]),
            after: DMat2::ZERO,
            right: far.value,
        },
    ]
}

/// Derivatives of two components, given by their gradients with respect to a direction, when the far end of a segment
/// with this direction (of either sign) and this length moves along two tangents.
fn turned(gradients: &[DVec3; 2], direction: DVec3, length: f64, tangents: &[DVec3; 2]) -> DMat2 {
    let across = gradients.map(|gradient| (gradient - direction * direction.dot(gradient)) / length);
    let column = |tangent: DVec3| DVec2::new(across[0].dot(tangent), across[1].dot(tangent));
    DMat2::from_cols(column(tangents[0]), column(tangents[1]))
}

#[cfg(test)]
mod tests {
    use glam::dvec2;

    use super::*;
    use crate::{
        geometry::testing::Glass,
        optics::Source,
        specular::{
            fermat::Connection,
            side::PaneSide,
            testing::{between, pair, pane, random},
        },
    };

    const CONSTRAINTS: [ManifoldConstraint; 2] = [ManifoldConstraint::AngleDifference, ManifoldConstraint::HalfVector];

    fn residuals_at(connection: &Connection<'_>, theta: &Theta, constraint: ManifoldConstraint) -> [Residual; 2] {
        residuals(&connection.path(theta, &mut Counters::default()), constraint, connection.index).unwrap()
    }

    /// Problems on both sides of a pane, with a pair of vertices that is no path of light.
    fn for_each_problem(check: impl Fn(&Connection<'_>, &Theta)) {
        for glass in [Glass::Crown, Glass::Bumpy] {
            let pane = pane(glass, 0.1e-3);
            let mut random = random(6);
            for case in 0..60 {
                let sign = if case % 2 == 0 { 1.0 } else { -1.0 };
                let origin = (pair(&mut random) - 0.5).extend(-sign * between(&mut random, 0.3, 3.0));
                let far = (pair(&mut random) - 0.5).extend(sign * between(&mut random, 0.3, 3.0));
                let source = if case % 4 < 2 { Source::Point(far) } else { Source::Direction(far.normalize()) };
                let side = PaneSide::facing(&pane, origin).unwrap();
                let near = (pair(&mut random) - 0.5) * pane.size * 0.9;
                check(&Connection::new(&side, origin, source), &[near, near + (pair(&mut random) - 0.5) * 0.004]);
            }
        }
    }

    #[test]
    fn constraints_vanish_just_where_the_optical_length_is_stationary() {
        for_each_problem(|connection, theta| {
            let counters = &mut Counters::default();
            let region = SearchRegion::around(&crate::geometry::Rect::new(dvec2(-1.0, -1.0), dvec2(1.0, 1.0)), 0.003);
            let Some(root) = polished(connection, *theta, &region, counters) else { return };
            for constraint in CONSTRAINTS {
                if !root.path.crosses(root.path.directions[0].z.signum()) {
                    continue;
                }
                let at_root = residuals_at(connection, &root.theta, constraint);
                assert!(at_root.iter().all(|residual| residual.value.length() < 1e-9), "{constraint:?}");
                let beside = [root.theta[0] + dvec2(1e-4, 0.0), root.theta[1]];
                let beside = residuals_at(connection, &beside, constraint);
                assert!(beside.iter().any(|residual| residual.value.length() > 1e-5), "{constraint:?}");
            }
        });
    }

    #[test]
    fn the_linearised_constraints_are_their_derivatives() {
        for_each_problem(|connection, theta| {
            for constraint in CONSTRAINTS {
                let counters = &mut Counters::default();
                // The axes of the chord turn with the path, which is left out: at a path of light that makes no difference.
                let region =
                    SearchRegion::around(&crate::geometry::Rect::new(dvec2(-1.0, -1.0), dvec2(1.0, 1.0)), 0.003);
                let Some(root) = polished(connection, *theta, &region, counters) else { return };
                if !root.path.crosses(root.path.directions[0].z.signum()) {
                    return;
                }
                let rows = rows(&root.path, &residuals_at(connection, &root.theta, constraint));
                let step = 1e-6;
                for vertex in 0..2 {
                    for axis in [dvec2(step, 0.0), dvec2(0.0, step)] {
                        let moved = |sign: f64| {
                            let mut theta = root.theta;
                            theta[vertex] += axis * sign;
                            residuals_at(connection, &theta, constraint).map(|residual| residual.value)
                        };
                        let (before, after) = (moved(-1.0), moved(1.0));
                        for (row, difference) in
                            [0, 1].map(|k| (after[k] - before[k]) / (2.0 * step)).into_iter().enumerate()
                        {
                            let blocks = [rows[row].before, rows[row].own, rows[row].after];
                            let expected = blocks[vertex + 1 - row] * (axis / step);
                            // Derivatives are of the order of one over the thickness; third ones times the step squared.
                            assert!(
                                (difference - expected).length() < 2e-3,
                                "{constraint:?} {row} {vertex}: {difference} {expected}"
                            );
                        }
                    }
                }
            }
        });
    }
}
