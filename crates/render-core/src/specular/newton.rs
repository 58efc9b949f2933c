//! Newton's method for stationary paths through a pane: the published line search and a solver that finds every kind.

use glam::DVec2;

use super::{
    fermat::{Connection, FermatPath, Theta},
    widest::{self, Computation},
};
use crate::math::Rect;
use crate::math::simd::Instructions;
use clerestory_film::counters::Counters;

/// A stationary path: minimum, saddle or maximum of the optical length.
#[derive(Clone, Copy, Debug)]
pub struct Root {
    /// Tangential coordinates of its vertices.
    pub theta: Theta,
    /// The path.
    pub path: FermatPath,
    /// Determinant of the Hessian; its sign tells saddles from extrema.
    pub determinant: f64,
}

/// Where and how exactly roots are sought.
#[derive(Clone, Copy, Debug)]
pub struct SearchRegion {
    /// Iterates whose X1 leaves this rectangle are given up.
    pub bounds: Rect,
    /// Newton steps shorter than this are the last, metres.
    pub tolerance: f64,
}

/// Huan et al. 2023, section 3.1.
pub(super) const MAX_ITERATIONS: usize = 20;
/// Huan et al. 2023: convergence threshold on the gradient, in the paper's coordinates (u, v, h), where it is
/// dimensionless.
pub(super) const PUBLISHED_GRADIENT: f64 = 1e-4;
/// Huan et al. 2023, Algorithm 1.
pub(super) const PUBLISHED_ALPHA: f64 = 0.45;
/// Huan et al. 2023, Algorithm 1.
pub(super) const PUBLISHED_BETA: f64 = 0.5;
/// Huan et al. 2023, section 3.1.
pub(super) const PUBLISHED_T_MIN: f64 = 0.004;

/// The damped step is given up below this length, relative to the full one.
pub(super) const SHORTEST_STEP: f64 = 1.0 / 64.0;

/// Roots closer than this many tolerances are the same root.
const SAME_ROOT: f64 = 100.0;

impl SearchRegion {
    /// A region around a window on a pane of the given thickness.
    pub fn around(window: &Rect, thickness: f64) -> Self {
        let size = window.max - window.min;
        Self { bounds: window.grown(0.25 * size.max_element() + thickness), tolerance: 1e-7 * thickness }
    }

    /// Whether two roots are one and the same.
    pub fn same(&self, first: &Root, second: &Root) -> bool {
        let limit = SAME_ROOT * self.tolerance;
        first.determinant.signum() == second.determinant.signum()
            && first.theta.iter().zip(&second.theta).all(|(a, b)| (*a - *b).length_squared() < limit * limit)
    }
}

/// A run from one seed.
pub(super) struct Solve<'a, 'b> {
    pub(super) connection: &'b Connection<'a>,
    pub(super) seed: Theta,
    pub(super) region: &'b SearchRegion,
    pub(super) counters: &'b mut Counters,
}

pub(super) struct Complete<'a, 'b>(pub(super) Solve<'a, 'b>);

impl Computation for Complete<'_, '_> {
    type Output = Option<Root>;

    #[inline(always)]
    fn run<S: Instructions>(self, _: S) -> Self::Output {
        complete(self.0)
    }
}

pub(super) struct Published<'a, 'b>(pub(super) Solve<'a, 'b>);

impl Computation for Published<'_, '_> {
    type Output = Option<Root>;

    #[inline(always)]
    fn run<S: Instructions>(self, _: S) -> Self::Output {
        published(self.0)
    }
}

/// Newton's method on the gradient, damped by the natural monotonicity test (Deuflhard 2011, section 3.3): a step is
/// accepted when the Newton correction shrinks, measured with the Jacobian of the step's start. Unlike a line search on
/// the optical length it does not prefer minima, and unlike one on the norm of the gradient it does not feel how stiff
/// the glass segment is.
pub fn solve_complete(
    connection: &Connection<'_>,
    seed: Theta,
    region: &SearchRegion,
    counters: &mut Counters,
) -> Option<Root> {
    widest::run(Complete(Solve { connection, seed, region, counters }))
}

#[inline(always)]
fn complete(Solve { connection, seed, region, counters }: Solve<'_, '_>) -> Option<Root> {
    counters.solver_calls += 1;
    let longest = (region.bounds.max - region.bounds.min).length();
    let mut theta = seed;
    let mut path = connection.path(&theta, counters);
    for _ in 0..MAX_ITERATIONS {
        let factorisation = path.hessian().factorise()?;
        let step = factorisation.newton_step(&path.gradient);
        let length = norm(&step);
        if !length.is_finite() {
            return None;
        }
        if length < region.tolerance {
            // The step and its correction would both be rounding.
            counters.converged += 1;
            return Some(Root { theta, path, determinant: factorisation.determinant });
        }
        let mut fraction = (longest / length).min(1.0);
        let (next, next_path, correction) = loop {
            if fraction < SHORTEST_STEP {
                return None;
            }
            let next = moved(&theta, &step, fraction);
            if region.bounds.contains(next[0]) {
                let next_path = connection.path(&next, counters);
                let correction = factorisation.newton_step(&next_path.gradient);
                if norm(&correction) <= (1.0 - 0.25 * fraction) * length {
                    break (next, next_path, correction);
                }
            }
            fraction *= 0.5;
        };
        if norm(&correction) < region.tolerance {
            // So small a step changes neither the path nor its derivatives: they need not be evaluated again.
            let determinant = next_path.hessian().factorise()?.determinant;
            counters.converged += 1;
            return Some(Root { theta: moved(&next, &correction, 1.0), path: next_path, determinant });
        }
        theta = next;
        path = next_path;
    }
    None
}

/// Algorithm 1 of Huan et al. 2023: Newton's method for optimisation with backtracking on the optical length. Accepts
/// almost only steps that descend and so finds minima almost exclusively. What it finds is polished by plain Newton
/// steps, so that roots can be told apart.
pub fn solve_published(
    connection: &Connection<'_>,
    seed: Theta,
    region: &SearchRegion,
    counters: &mut Counters,
) -> Option<Root> {
    widest::run(Published(Solve { connection, seed, region, counters }))
}

#[inline(always)]
fn published(Solve { connection, seed, region, counters }: Solve<'_, '_>) -> Option<Root> {
    counters.solver_calls += 1;
    let mut theta = seed;
    let mut length = connection.optical_length(&theta, counters);
    for _ in 0..MAX_ITERATIONS {
        let path = connection.path(&theta, counters);
        if norm(&path.gradient) < PUBLISHED_GRADIENT {
            return polished(connection, theta, region, counters);
        }
        let step = path.hessian().factorise()?.newton_step(&path.gradient);
        let slope = path.gradient[0].dot(step[0]) + path.gradient[1].dot(step[1]);
        if !slope.is_finite() {
            return None;
        }
        let mut fraction = 1.0;
        let (next, next_length) = loop {
            let next = moved(&theta, &step, fraction);
            let next_length = connection.optical_length(&next, counters);
            if next_length <= length + PUBLISHED_ALPHA * fraction * slope || fraction == PUBLISHED_T_MIN {
                break (next, next_length);
            }
            fraction = f64::max(PUBLISHED_BETA * fraction, PUBLISHED_T_MIN);
        };
        theta = next;
        length = next_length;
    }
    None
}

#[inline(always)]
pub(super) fn polished(
    connection: &Connection<'_>,
    mut theta: Theta,
    region: &SearchRegion,
    counters: &mut Counters,
) -> Option<Root> {
    for _ in 0..MAX_ITERATIONS {
        let path = connection.path(&theta, counters);
        let step = path.hessian().factorise()?.newton_step(&path.gradient);
        theta = moved(&theta, &step, 1.0);
        let length = norm(&step);
        if !length.is_finite() {
            return None;
        }
        if length < region.tolerance {
            return finished(connection, theta, counters);
        }
    }
    None
}

#[inline(always)]
fn finished(connection: &Connection<'_>, theta: Theta, counters: &mut Counters) -> Option<Root> {
    let path = connection.path(&theta, counters);
    let determinant = path.hessian().factorise()?.determinant;
    counters.converged += 1;
    Some(Root { theta, path, determinant })
}

#[inline(always)]
fn moved(theta: &Theta, step: &Theta, fraction: f64) -> Theta {
    [theta[0] + step[0] * fraction, theta[1] + step[1] * fraction]
}

#[inline(always)]
fn norm(step: &[DVec2; 2]) -> f64 {
    (step[0].length_squared() + step[1].length_squared()).sqrt()
}
