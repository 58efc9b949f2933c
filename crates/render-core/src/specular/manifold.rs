//! The manifold walk: Newton's method on the constraints of a chain, in which every iterate is a path of light. It
//! follows Zeltner et al. 2020, Algorithm 1, and for several vertices the authors' published code.
//!
//! A step moves the first vertex along its tangent plane. A ray from the shading point through that place is traced
//! through the scene and gives the next iterate. Where that ray does not meet surfaces on which the same things can
//! happen, the step is halved. So whatever stands in the way of the ray stands in the way of the walk as well. A step
//! that leaves a pane's outline ends at its border if that helps, or if nothing else does. Halving alone would end
//! where the direction of descent points outwards, although the path may be far along the border.
//!
//! Lengths below which the authors' code gives up are absolute and exceed the thickness of a window pane. All lengths
//! here are relative to the shortest segment of the path.

use crate::specular::constraint::ManifoldConstraint;
use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::block_tridiagonal::solve;
use super::caster::SeenCaster;
use super::chain::{ByVertex, Chain, Segments};
use super::constraint::Residual;
use super::{Arrival, SpecularEvent};
use crate::scene::ShadingPoint;
use crate::{
    geometry::{Ray, SurfaceId},
    light::{Source, SourceSample},
    scene::Scene,
};
use clerestory_film::counters::Counters;

/// Where a manifold walk goes whose next step, or whose seed, misses the pane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WalkSteps {
    /// To the border of the pane, where that gains or nothing else helps, and half as far otherwise.
    #[default]
    OnPanes,
    /// Half as far, and nowhere from a seed (Zeltner et al. 2020).
    Published,
}

/// Zeltner et al. 2020, the published configuration.
const MAX_ITERATIONS: usize = 20;

/// Zeltner et al. 2020, the published configuration: largest component of a constraint that counts as zero.
const THRESHOLD: f64 = 1e-5;

/// A step ends at a pane's border if it leaves at most this part of the error there: steps that point outwards because
/// the walk is far from any path would lead into a corner. What is beyond that border already, where light leaves by
/// the edge, cannot lose by it.
const PROGRESS: f64 = 0.5;

/// A walk whose steps have been halved to less than this part is stuck, and goes to the border wherever that leads.
const STUCK: f64 = 0.1;

/// Where the published walk ends, full Newton steps follow until they are shorter than this part of the shortest
/// segment, so that paths can be told apart.
const TOLERANCE: f64 = 1e-7;

/// Most of these steps: they converge quadratically.
const POLISHING_STEPS: usize = 8;

/// Paths whose first vertices are closer than this many tolerances are the same path.
const SAME_PATH: f64 = 100.0;

/// The last vertex may bend light this far past the light's point. Both kinds of constraint hold to rounding there;
/// only a path that bends to the wrong side of the surface is as far away as this.
const SAME_DIRECTION: f64 = 1e-4;

/// The search for the chains of one kind that join a shading point to a point of a light and begin on one caster.
pub(super) struct ManifoldWalk<'a> {
    pub(super) scene: &'a Scene,
    pub(super) point: &'a ShadingPoint,
    pub(super) source: Source,
    pub(super) caster: SeenCaster,
    pub(super) events: &'a [SpecularEvent],
    pub(super) constraint: ManifoldConstraint,
    pub(super) steps: WalkSteps,
}

/// A chain that obeys all constraints.
#[derive(Clone)]
pub(super) struct SolvedChain {
    chain: Chain,
    segments: Segments,
    /// The generalised geometry factor, with its sign.
    factor: f64,
}

/// A chain, and where Newton's method wants its first vertex.
struct Iterate {
    chain: Chain,
    segments: Segments,
    residuals: ByVertex<Residual>,
    /// Largest component of a constraint.
    error: f64,
    step: DVec3,
}

impl ManifoldWalk<'_> {
    /// Walks from the chain that light takes from the shading point in the direction of `target`.
    pub(super) fn walk_towards(&self, target: DVec3, counters: &mut Counters) -> Option<SolvedChain> {
        counters.solver_calls += 1;
        let seed = self.trace(target, counters).or_else(|| self.trace_within(target, counters))?;
        self.walk(self.linearised(seed)?, counters)
    }

    /// Walks from where the straight line to the light crosses the surfaces.
    pub(super) fn walk_from(&self, seed: Chain, counters: &mut Counters) -> Option<SolvedChain> {
        counters.solver_calls += 1;
        let mut seed = self.linearised(seed)?;
        if seed.error <= THRESHOLD {
            // Nothing was refracted on the straight line, so nothing is known of what is transmitted.
            seed = self.linearised(self.trace(seed.target(1.0), counters)?)?;
        }
        self.walk(seed, counters)
    }

    fn walk(&self, seed: Iterate, counters: &mut Counters) -> Option<SolvedChain> {
        let mut current = seed;
        let mut fraction = 1.0;
        for _ in 0..MAX_ITERATIONS {
            if current.error <= THRESHOLD {
                return self.polished(current, counters);
            }
            let target = current.target(fraction);
            if let Some(next) = self.trace(target, counters) {
                current = self.linearised(next)?;
                fraction = f64::min(1.0, 2.0 * fraction);
            } else {
                fraction *= 0.5;
                if let Some(next) = self.at_border(&current, target, fraction, counters) {
                    current = next;
                }
            }
        }
        None
    }

    fn polished(&self, mut current: Iterate, counters: &mut Counters) -> Option<SolvedChain> {
        for _ in 0..POLISHING_STEPS {
            if current.step.length() <= TOLERANCE * current.segments.shortest() {
                let Iterate { chain, segments, residuals, .. } = current;
                return self.path_of(chain, segments, &residuals).inspect(|_| counters.converged += 1);
            }
            current = self.linearised(self.trace(current.target(1.0), counters)?)?;
        }
        None
    }

    /// The path over a place of a specular triangle, with the weights of its second and third corner, at which the
    /// chain of one vertex is known to lead to the source; `None` where something is in the way.
    pub(super) fn path_over(
        &self,
        triangle: u32,
        place: DVec3,
        weights: DVec2,
        counters: &mut Counters,
    ) -> Option<SolvedChain> {
        let [event] = *self.events else { return None };
        counters.solver_calls += 1;
        let chain = Chain::over_place(self.scene, self.point, triangle, place, weights, event, counters)?;
        self.solved(chain).inspect(|_| counters.converged += 1)
    }

    /// The path that a chain is, if it leads to the source.
    pub(super) fn solved(&self, chain: Chain) -> Option<SolvedChain> {
        let segments = chain.segments(self.point.position, self.source);
        let residuals = chain.residuals(&segments, self.constraint)?;
        self.path_of(chain, segments, &residuals)
    }

    fn path_of(&self, chain: Chain, segments: Segments, residuals: &[Residual]) -> Option<SolvedChain> {
        let factor = chain.geometry_factor(&segments, residuals)?;
        let arrives = (chain.exit - segments.last()).length() < SAME_DIRECTION;
        arrives.then_some(SolvedChain { chain, segments, factor })
    }

    /// Where a step to a target beside a pane's outline ends at its border, if it is to.
    fn at_border(&self, current: &Iterate, target: DVec3, fraction: f64, counters: &mut Counters) -> Option<Iterate> {
        let next = self.linearised(self.trace_within(target, counters)?)?;
        let beyond = self.caster.brought_within(self.scene, current.target(0.0)).is_some();
        (beyond || fraction < STUCK || next.error < PROGRESS * current.error).then_some(next)
    }

    /// As [`Self::trace`], for a target beside a pane's outline, which is brought onto the pane, if steps are to stay
    /// there.
    fn trace_within(&self, target: DVec3, counters: &mut Counters) -> Option<Chain> {
        if self.steps == WalkSteps::Published {
            return None;
        }
        self.trace(self.caster.brought_within(self.scene, target)?, counters)
    }

    /// The chain that light takes from the shading point through a target and on.
    pub(super) fn trace(&self, target: DVec3, counters: &mut Counters) -> Option<Chain> {
        let direction = (target - self.point.position).normalize();
        Chain::trace(self.scene, self.point, direction, &self.caster, self.events, counters)
    }

    fn linearised(&self, chain: Chain) -> Option<Iterate> {
        let segments = chain.segments(self.point.position, self.source);
        let residuals = chain.residuals(&segments, self.constraint)?;
        let error = residuals.iter().fold(0.0, |largest, residual| residual.value.abs().max_element().max(largest));
        let mut rows = chain.rows(&segments, &residuals, |k| residuals[k].value);
        solve(&mut rows)?;
        let [x, y] = chain.vertices[0].at.tangents;
        let step = -(x * rows[0].right.x + y * rows[0].right.y);
        step.is_finite().then_some(Iterate { chain, segments, residuals, error, step })
    }
}

impl Iterate {
    /// Where the first vertex is to go.
    fn target(&self, fraction: f64) -> DVec3 {
        self.chain.vertices[0].at.position + self.step * fraction
    }
}

impl SolvedChain {
    /// Whether two chains are the same path.
    pub(super) fn same(&self, other: &Self) -> bool {
        self.is_at(other.first_vertex()) && self.factor.signum() == other.factor.signum()
    }

    /// Whether its first vertex, and with it the whole chain, is the one given.
    pub(super) fn is_at(&self, first_vertex: DVec3) -> bool {
        let limit = SAME_PATH * TOLERANCE * self.segments.shortest();
        (self.first_vertex() - first_vertex).length_squared() < limit * limit
    }

    /// Where it leaves the shading point's side.
    pub(super) fn first_vertex(&self) -> DVec3 {
        self.chain.vertices[0].at.position
    }

    /// The surface of its first vertex.
    pub(super) fn first_surface(&self) -> SurfaceId {
        self.chain.vertices[0].surface
    }

    /// Solid angle at the shading point for each area of the light, or solid angle of one at infinity.
    pub(super) fn magnification(&self, sample: &SourceSample) -> f64 {
        let light_cosine = sample.cosine(self.segments.last());
        self.factor.abs() * light_cosine
    }

    /// The light of a point of a light that arrives along it, if nothing is in the way. Counts it.
    pub(super) fn arrival(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        light: u32,
        sample: &SourceSample,
        counters: &mut Counters,
    ) -> Option<Arrival> {
        let direction = self.segments.directions[0];
        let light_cosine = sample.cosine(self.segments.last());
        let falloff = scene.lights()[light as usize].falloff(self.segments.last());
        let is_lit = light_cosine.min(falloff) > 0.0 && direction.dot(point.normal) > 0.0;
        if !is_lit || self.is_blocked(scene, point, light, sample, counters) {
            return None;
        }
        counters.unique_solutions += 1;
        let weight = sample.weight * self.chain.throughput * (self.factor.abs() * light_cosine * falloff);
        Some(Arrival { direction, weight, path: None })
    }

    /// Whether a light or a veil stands in the way before the last vertex, or anything behind it. The chain was traced
    /// through what is solid.
    fn is_blocked(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        light: u32,
        sample: &SourceSample,
        counters: &mut Counters,
    ) -> bool {
        let mut from = (point.position, point.surface, None);
        for (vertex, length) in self.chain.vertices.iter().zip(&self.segments.lengths) {
            let (position, ray_origin, inside) = from;
            let ray = Ray::new(position, (vertex.at.position - position) / *length);
            if inside.is_none() && scene.blocked_by_light(&ray, *length, None)
                || scene.accelerator().is_veiled(&ray, *length, ray_origin, counters)
            {
                return true;
            }
            from = (vertex.at.position, vertex.surface, vertex.inside);
        }
        let (position, ray_origin, inside) = from;
        let ray = Ray::new(position, self.segments.last());
        let length = self.segments.lengths[self.chain.vertices.len()];
        inside.is_some() || scene.blocked_from_light(&ray, length, ray_origin, light, sample, counters)
    }
}
