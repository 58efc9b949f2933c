//! Fermat's principle for light that the outside of a pane reflects: the reflected caustic (Huan et al. 2023, section
//! 3.1, "Other configurations").
//!
//! The unknowns are the tangential coordinates x of one vertex X on the face that looks at the shading point O. Let a
//! and w be the unit directions of the segments O X and X S, and t the tangents of the face. The optical length
//! `|O X| + |X S|` changes by `(a - w).dX`, and its Hessian is
//!
//! ```text
//! H = T^T (P_a/d0 + P_w/d2) T + (a_z - w_z) h'',    P_v = I - v v^T,    without P_w for a light at infinity
//! ```
//!
//! As for a path through the pane, the generalised geometry factor is in closed form
//!
//! ```text
//! G = |m.a| |m.w| / (d0^2 d2^2 |det H|),    without d2 for a light at infinity
//! ```
//!
//! Seeds lie in a window around the point at which a flat pane would reflect the light. The window is as large as the
//! slopes of the relief can move that point. Some seeds lie anywhere, so paths outside the window have a probability as
//! well.

use super::density::{last_segment, of_light};
use super::solver::FneeSolver;
use glam::{DMat2, DVec2, DVec3};

use super::super::fermat::{inverse, normal, projector, pulled_back, second_derivatives};
use super::super::newton::{
    MAX_ITERATIONS, PUBLISHED_ALPHA, PUBLISHED_BETA, PUBLISHED_GRADIENT, PUBLISHED_T_MIN, SHORTEST_STEP,
};
use super::super::side::{PaneSide, unit_normal};
use super::super::trials::RandomSearch;
use super::super::{Arrival, SampledPath, SpecularPath};
use crate::bsdf::fresnel::refract;
use crate::geometry::{Face, PaneBoundary, Ray, Surface, SurfaceId, SurfaceJet};
use crate::light::{LightHit, Source, SourceSample};
use crate::math::Rect;
use crate::scene::Scene;
use crate::scene::ShadingPoint;
use clerestory_film::TrialStream;
use clerestory_film::counters::Counters;

/// Share of the seeds that lie anywhere on the pane.
const ANYWHERE: f64 = 0.125;

/// The window is so much larger than the slopes demand to first order.
const MARGIN: f64 = 1.5;

/// Newton steps shorter than this part of the shorter segment are the last.
const TOLERANCE: f64 = 1e-9;

/// Roots closer than this many tolerances are the same root.
const SAME_ROOT: f64 = 100.0;

/// Light from a point of a light that one pane reflects to a shading point, in the pane's frame.
pub(super) struct ReflectionSearch<'a> {
    side: PaneSide<'a>,
    origin: DVec3,
    source: Source,
    solver: FneeSolver,
    window: Rect,
    /// The probability with which it is worth a search.
    odds: f64,
    tolerance: f64,
}

/// A vertex at which light may or may not be reflected.
#[derive(Clone, Copy, Debug)]
pub(super) struct ReflectedPath {
    place: DVec2,
    vertex: DVec3,
    /// Towards the vertex and from there to the source.
    directions: [DVec3; 2],
    lengths: [f64; 2],
    jet: SurfaceJet,
}

/// A vertex at which light is reflected, and the determinant of the Hessian there.
#[derive(Clone, Copy, Debug)]
pub(super) struct ReflectionRoot {
    path: ReflectedPath,
    determinant: f64,
}

impl<'a> ReflectionSearch<'a> {
    /// `None` when the pane cannot reflect the light to the point.
    pub(super) fn new(side: PaneSide<'a>, origin: DVec3, source: Source, solver: FneeSolver) -> Option<Self> {
        if !side.is_lit_from_here(source) {
            return None;
        }
        let base = side.near_base();
        let height = (origin.z - base).abs();
        // The light's image in the undisplaced face, and how steeply the optical length rises around where it is seen.
        let (image, curvature) = match source {
            Source::Point(point) => {
                let above = (point.z - base) * -side.sign;
                let seen = origin.truncate().lerp(point.truncate(), height / (height + above));
                let [near, far] = [origin, point].map(|end| (seen.extend(base) - end).length());
                let cosine = height / near;
                (seen, cosine * cosine * (1.0 / near + 1.0 / far))
            }
            Source::Direction(direction) => {
                let cosine = -direction.z * side.sign;
                let seen = origin.truncate() + direction.truncate() * (height / cosine);
                (seen, cosine * cosine * cosine / height)
            }
        };
        let slopes = side.pane.bounds(side.near).gradient.map(|slope| slope.magnitude());
        let reach = MARGIN * 2.0 * DVec2::from(slopes).length() / curvature + 1e-3 * height;
        let around = Rect::new(image - reach, image + reach);
        let outline = &side.pane.outline;
        let window = outline.narrowed(&around);
        // Beside the window there is hardly ever light: as many seeds go there as beside one that is not empty.
        let (window, odds) = if window.is_empty() { (*outline.bounds(), ANYWHERE) } else { (window, 1.0) };
        let nearest = match source {
            Source::Point(point) => height.min((point.z - base).abs()),
            Source::Direction(_) => height,
        };
        Some(Self { side, origin, source, solver, window, odds, tolerance: TOLERANCE * nearest })
    }

    fn path(&self, place: DVec2, counters: &mut Counters) -> ReflectedPath {
        counters.height_evaluations += 1;
        ReflectedPath::new(&self.side, self.origin, self.source, place)
    }

    fn solve_from(&self, seed: DVec2, counters: &mut Counters) -> Option<ReflectionRoot> {
        counters.solver_calls += 1;
        match self.solver {
            FneeSolver::Complete => self.solve_damped(seed, counters),
            FneeSolver::Published => self.solve_published(seed, counters),
        }
    }

    /// Newton's method on the gradient, damped by the natural monotonicity test, as in `newton`.
    fn solve_damped(&self, seed: DVec2, counters: &mut Counters) -> Option<ReflectionRoot> {
        let bounds = *self.side.pane.outline.bounds();
        let bounds = bounds.grown(0.25 * (bounds.max - bounds.min).max_element());
        let longest = (bounds.max - bounds.min).length();
        let mut path = self.path(seed, counters);
        for _ in 0..MAX_ITERATIONS {
            let hessian = path.hessian();
            let inverse = inverse(&hessian, hessian.determinant())?;
            let step = -(inverse * path.gradient());
            let length = step.length();
            if !length.is_finite() {
                return None;
            }
            if length < self.tolerance {
                counters.converged += 1;
                return Some(ReflectionRoot { path, determinant: hessian.determinant() });
            }
            let mut fraction = (longest / length).min(1.0);
            path = loop {
                if fraction < SHORTEST_STEP {
                    return None;
                }
                let next = path.place + step * fraction;
                if bounds.contains(next) {
                    let next = self.path(next, counters);
                    let correction = inverse * next.gradient();
                    if correction.length() <= (1.0 - 0.25 * fraction) * length {
                        break next;
                    }
                }
                fraction *= 0.5;
            };
        }
        None
    }

    /// Algorithm 1 of Huan et al. 2023 in two unknowns. What it finds is polished.
    fn solve_published(&self, seed: DVec2, counters: &mut Counters) -> Option<ReflectionRoot> {
        let mut path = self.path(seed, counters);
        for _ in 0..MAX_ITERATIONS {
            let gradient = path.gradient();
            if gradient.length() < PUBLISHED_GRADIENT {
                return self.solve_damped(path.place, counters);
            }
            let hessian = path.hessian();
            let step = -(inverse(&hessian, hessian.determinant())? * gradient);
            let slope = gradient.dot(step);
            if !slope.is_finite() {
                return None;
            }
            let length = path.optical_length();
            let mut fraction = 1.0;
            path = loop {
                let next = self.path(path.place + step * fraction, counters);
                if next.optical_length() <= length + PUBLISHED_ALPHA * fraction * slope || fraction == PUBLISHED_T_MIN {
                    break next;
                }
                fraction = f64::max(PUBLISHED_BETA * fraction, PUBLISHED_T_MIN);
            };
        }
        None
    }

    /// The light along a root that arrives at the point, if nothing is in the way. Counts it.
    pub(super) fn arrival(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        [light, pane]: [u32; 2],
        sample: &SourceSample,
        root: &ReflectionRoot,
        counters: &mut Counters,
    ) -> Option<Arrival> {
        let ReflectedPath { place, vertex, directions: [first, last], jet, lengths } = root.path;
        let geometry = self.side.pane;
        let frame = &geometry.frame;
        let (direction, outwards) = (frame.vector_to_world(first), frame.vector_to_world(last));
        let light_cosine = sample.cosine(outwards);
        let falloff = scene.lights()[light as usize].falloff(outwards);
        let towards = normal(&jet).dot(first) * self.side.sign;
        let away = -normal(&jet).dot(last) * self.side.sign;
        let is_reflected = towards > 0.0 && away > 0.0 && geometry.outline.contains(place);
        if !is_reflected || light_cosine.min(falloff) <= 0.0 || direction.dot(point.normal) <= 0.0 {
            return None;
        }
        let incident = Ray::new(point.position, direction);
        if scene.blocked_by_light(&incident, lengths[0], None) {
            return None;
        }
        let hit = scene.accelerator().closest_hit(&incident, f64::INFINITY, point.surface, counters)?;
        let Surface::Pane { index, hit } = hit.surface else { return None };
        let is_here = (hit.point - vertex).length() < SAME_ROOT * SAME_ROOT * self.tolerance;
        if index != pane || hit.boundary != PaneBoundary::Face(self.side.near) || !is_here {
            return None;
        }
        let exit = Ray::new(frame.point_to_world(vertex), outwards);
        let ray_origin = SurfaceId::Pane { index: pane, face: self.side.near };
        if scene.blocked_from_light(&exit, lengths[1], ray_origin, light, sample, counters) {
            return None;
        }
        counters.unique_solutions += 1;
        let refraction = refract(first, unit_normal(jet.gradient), 1.0, geometry.index_of_refraction);
        let reflected = refraction.map_or(1.0, |refraction| refraction.fresnel.reflectance());
        let factor = root.path.geometry_factor(root.determinant) * light_cosine;
        let hit = LightHit { distance: lengths[1], radiance: DVec3::ZERO, triangle: sample.triangle };
        let density = of_light(scene, light, sample.source) / factor;
        let path = SampledPath { density, surface: ray_origin, exit, hit, transmitted: reflected };
        Some(Arrival { direction, weight: sample.weight * (reflected * factor * falloff), path: Some(path) })
    }
}

impl RandomSearch for ReflectionSearch<'_> {
    type Path = ReflectionRoot;

    fn solve(&self, random: &mut TrialStream, counters: &mut Counters) -> Option<ReflectionRoot> {
        let anywhere = self.solver == FneeSolver::Published || random.next_f64() < ANYWHERE;
        let outline = &self.side.pane.outline;
        let window = if anywhere { outline.bounds() } else { &self.window };
        let random = DVec2::new(random.next_f64(), random.next_f64());
        self.solve_from(outline.sample_within(window, random)?, counters)
    }

    fn same(&self, first: &ReflectionRoot, second: &ReflectionRoot) -> bool {
        first.determinant.signum() == second.determinant.signum()
            && (first.path.place - second.path.place).length() < SAME_ROOT * self.tolerance
    }
}

impl ReflectedPath {
    /// Over a place of the near face.
    pub(super) fn new(side: &PaneSide<'_>, origin: DVec3, source: Source, place: DVec2) -> Self {
        let jet = side.near_surface().jet(place);
        let vertex = place.extend(side.near_base() + jet.height);
        let first = vertex - origin;
        let (last, last_length) = match source {
            Source::Point(point) => {
                let last = point - vertex;
                (last / last.length(), last.length())
            }
            Source::Direction(direction) => (direction, f64::INFINITY),
        };
        let lengths = [first.length(), last_length];
        Self { place, vertex, directions: [first / lengths[0], last], lengths, jet }
    }

    fn gradient(&self) -> DVec2 {
        pulled_back(&self.jet, self.directions[0] - self.directions[1])
    }

    pub(super) fn hessian(&self) -> DMat2 {
        let [a, w] = self.directions;
        projector(&self.jet, &self.jet, a) * (1.0 / self.lengths[0])
            + projector(&self.jet, &self.jet, w) * (1.0 / self.lengths[1])
            + second_derivatives(&self.jet) * (a.z - w.z)
    }

    /// Up to a constant for a light at infinity.
    fn optical_length(&self) -> f64 {
        let outside = if self.lengths[1].is_finite() { self.lengths[1] } else { -self.directions[1].dot(self.vertex) };
        self.lengths[0] + outside
    }

    pub(super) fn geometry_factor(&self, determinant: f64) -> f64 {
        let [a, w] = self.directions;
        let [d0, d2] = self.lengths;
        let spread = if d2.is_finite() { d0 * d2 } else { d0 };
        (normal(&self.jet).dot(a) * normal(&self.jet).dot(w) / (spread * spread * determinant)).abs()
    }
}

/// How densely the search finds a path by way of one reflection at a face of a pane, which the path tracer has found.
pub(super) fn density_of(
    scene: &Scene,
    point: &ShadingPoint,
    (pane, face): (u32, Face),
    path: &SpecularPath<'_>,
) -> Option<f64> {
    let pane = &scene.panes()[pane as usize];
    let origin = pane.frame.point_to_local(point.position);
    let side = PaneSide::facing(pane, origin).filter(|side| side.near == face)?;
    let place = pane.frame.point_to_local(path.links[0].position).truncate();
    let last = last_segment(path)?;
    let (_, cosine) = scene.lights()[path.light as usize].source_at(&last.ray, &last.hit);
    let reflected = ReflectedPath::new(&side, origin, path.source.in_frame(&pane.frame), place);
    let factor = reflected.geometry_factor(reflected.hessian().determinant()) * cosine;
    Some(of_light(scene, path.light, path.source) / factor).filter(|density| density.is_finite())
}

/// The search for light from one point of a light that panes reflect to one shading point.
pub(super) struct Reflections<'a> {
    pub(super) scene: &'a Scene,
    pub(super) point: &'a ShadingPoint,
    /// Index of the light in the scene.
    pub(super) light: u32,
    /// The point on it.
    pub(super) sample: &'a SourceSample,
    pub(super) solver: FneeSolver,
    /// Largest number of trials of one estimate of an inverse probability.
    pub(super) max_trials: u32,
}

impl Reflections<'_> {
    /// Estimates what one pane reflects.
    pub(super) fn sample_li(
        &self,
        pane: u32,
        random: &mut TrialStream,
        counters: &mut Counters,
        arrive: &mut dyn FnMut(Arrival),
    ) {
        let Self { scene, point, light, sample, solver, max_trials } = *self;
        if scene.media().is_immersed(pane) {
            return;
        }
        let geometry = &scene.panes()[pane as usize];
        let frame = &geometry.frame;
        let origin = frame.point_to_local(point.position);
        let Some(side) = PaneSide::facing(geometry, origin) else { return };
        if !side.rises_above(origin, frame.vector_to_local(point.normal)) {
            return;
        }
        let Some(search) = ReflectionSearch::new(side, origin, sample.source.in_frame(frame), solver) else { return };
        if search.odds < 1.0 && random.next_f64() >= search.odds {
            return;
        }
        let Some(root) = search.solve(random, counters) else { return };
        let Some(arrival) = search.arrival(scene, point, [light, pane], sample, &root, counters) else { return };
        let inverse = search.inverse_probability(&root, max_trials, random, counters);
        arrive(Arrival { weight: arrival.weight * (inverse / search.odds), ..arrival });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::testing::Glass,
        specular::testing::{between, pair, pane, random},
    };

    /// Problems on both sides of a pane, for point lights and lights at infinity.
    fn for_each_search(check: impl Fn(&ReflectionSearch<'_>, DVec2)) {
        for glass in [Glass::Crown, Glass::Bumpy] {
            let pane = pane(glass, 0.05e-3);
            let mut random = random(16);
            for case in 0..60 {
                let sign = if case % 2 == 0 { 1.0 } else { -1.0 };
                let mut end = || (pair(&mut random) - 0.5).extend(-sign * between(&mut random, 0.3, 2.0));
                let (origin, light) = (end(), end());
                let source = if case % 4 < 2 { Source::Point(light) } else { Source::Direction(light.normalize()) };
                let side = PaneSide::facing(&pane, origin).unwrap();
                let search = ReflectionSearch::new(side, origin, source, FneeSolver::Complete).unwrap();
                check(&search, (pair(&mut random) - 0.5) * pane.size() * 0.9);
            }
        }
    }

    #[test]
    fn gradient_and_hessian_are_the_derivatives_of_the_optical_length() {
        for_each_search(|search, place| {
            let counters = &mut Counters::default();
            let path = search.path(place, counters);
            let step = 1e-6;
            for (index, axis) in [DVec2::X, DVec2::Y].into_iter().enumerate() {
                let [before, after] = [-step, step].map(|step| search.path(place + axis * step, counters));
                let slope = (after.optical_length() - before.optical_length()) / (2.0 * step);
                assert!((slope - path.gradient()[index]).abs() < 1e-7);
                let bend = (after.gradient() - before.gradient()) / (2.0 * step);
                assert!((bend - path.hessian().col(index)).length() < 1e-5 * (1.0 + bend.length()));
            }
        });
    }

    #[test]
    fn the_geometry_factor_is_how_directions_turn_when_the_light_moves() {
        let checked = std::cell::Cell::new(0);
        for_each_search(|search, seed| {
            let counters = &mut Counters::default();
            let Some(root) = search.solve_from(seed, counters) else { return };
            let towards = match search.source {
                Source::Point(_) => root.path.directions[1],
                Source::Direction(direction) => direction,
            };
            let (u, v) = towards.any_orthonormal_pair();
            let step = 1e-6;
            let moved = |by: DVec3| {
                let source = match search.source {
                    Source::Point(point) => Source::Point(point + by),
                    Source::Direction(direction) => Source::Direction((direction + by).normalize()),
                };
                let search = ReflectionSearch { source, side: search.side, ..*search };
                search.solve_damped(root.path.place, &mut Counters::default()).unwrap().path.directions[0]
            };
            let turned = [u, v].map(|axis| (moved(axis * step) - moved(-axis * step)) / (2.0 * step));
            let expected = turned[0].cross(turned[1]).length();
            let factor = root.path.geometry_factor(root.determinant);
            assert!((factor - expected).abs() < 1e-4 * expected, "{factor} {expected}");
            checked.set(checked.get() + 1);
        });
        assert!(checked.get() > 25, "{} problems only", checked.get());
    }
}
