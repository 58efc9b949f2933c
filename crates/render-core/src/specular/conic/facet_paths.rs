//! All paths on a facet.

use std::f64::consts::SQRT_2;

use arrayvec::ArrayVec;
use glam::DVec2;

use super::curve::all_paths;
use super::ends::Ends;
use super::facet::{Facet, ON_EDGE, TOLERANCE, is_within};

/// Paths closer than this part of the triangle are the same.
const SAME: f64 = 1e-7;

/// Most paths on one triangle: there are twelve roots on each of two arcs.
const MOST_PATHS: usize = 24;

impl Facet {
    /// The weights of the second and third corner at all paths.
    pub(super) fn paths(&self, ends: &Ends) -> ArrayVec<DVec2, MOST_PATHS> {
        let mut paths = ArrayVec::<DVec2, MOST_PATHS>::new();
        match self.only_path(ends) {
            Only::Here(path) => paths.push(path),
            Only::Nowhere => {}
            Only::Unknown => all_paths(self, ends, &mut |weights| {
                if let Some(path) = self.polished(ends, weights)
                    && paths.iter().all(|known| (*known - path).abs().max_element() > SAME)
                {
                    let _ = paths.try_push(path);
                }
            }),
        }
        paths
    }

    /// The path on a triangle so small that it holds one at the most. With G the misfit and K its derivative in the
    /// middle, a path at x has `|G + K (x - middle)|` at most half of what the second derivatives of G can be, times
    /// `|x - middle|^2`; and two, at x and y, would make `|K (x - y)|` at most what the derivative changes between them
    /// times `|x - y|`.
    fn only_path(&self, ends: &Ends) -> Only {
        const MIDDLE: DVec2 = DVec2::splat(1.0 / 3.0);
        let misfit = self.misfit(ends, MIDDLE);
        // The smaller singular value is at least this.
        let least = misfit.determinant().abs() / misfit.most();
        // What weights change, as the sum over both, moves a place by that much of the longest edge.
        let bending = self.bending(ends, MIDDLE, 1.0);
        let linear = MIDDLE - misfit.step();
        let beside = f64::max(-linear.min_element(), (linear.element_sum() - 1.0) / SQRT_2);
        if beside > 0.5 * bending / least + ON_EDGE {
            return Only::Nowhere;
        }
        let alone = |extent: f64, bending: f64| least > SQRT_2 * extent * bending;
        if !alone(1.0, bending) {
            return Only::Unknown;
        }
        // Where only one path can be, a step so small is followed by one of about its square.
        let Some(path) = self.stationary(ends, linear, TOLERANCE.sqrt()) else { return Only::Unknown };
        let distance = (path - MIDDLE).abs().element_sum().max(1.0);
        if is_within(path) {
            if self.takes_sides(ends, path) { Only::Here(path) } else { Only::Nowhere }
        } else if alone(distance, self.bending(ends, MIDDLE, distance)) {
            Only::Nowhere
        } else {
            Only::Unknown
        }
    }
}

/// What is known of the paths on a triangle that may be too large to tell.
enum Only {
    /// There is one, here.
    Here(DVec2),
    /// There is none.
    Nowhere,
    /// There may be several.
    Unknown,
}
