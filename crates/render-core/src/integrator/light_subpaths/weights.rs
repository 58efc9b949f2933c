//! How the techniques that find one path share it: the balance heuristic (Veach and Guibas 1995), path by path.
//!
//! A path has the vertices v1 to vn, from the camera, at which light is scattered into a solid angle. Specular vertices
//! between two of them, or between vn and the light, belong to the edge there. Edges without any are straight. Each
//! straight edge between vi and vi+1 is a technique: a camera's walk to vi and a light subpath to vi+1 are connected.
//! One more is that the camera's walk has found all vertices, and a specular method or chance the light at vn. The last
//! one is that a light subpath of the light plane has found all vertices, and v1 is seen straight by the camera.
//!
//! Densities are for each unit of area at v1 and of solid angle at each vi, towards the light. Let c be the densities
//! of the camera's directions, and l those of the light's. An edge has the length d and a cosine at each end. Light
//! keeps its etendue on an edge. The camera finds v1 by one sample in each pixel, and all but the last technique have
//! that in common. So their P are for each such sample: a(1) is the number of pixels that a unit of area at v1 covers.
//!
//! ```text
//! D(n) = start(path) cos(n)                           a light subpath begins
//! D(i) = D(i+1) l(i+1) cos(i) / cos(i+1)              and goes on: density at vi
//! P(i) = M c(1) ... c(i-1) D(i+1) d^2 / cos(i+1)      a connection of vi and vi+1, one of M
//! P(n) = c(1) ... c(n-1) m                            a method that finds light at vn with the density m
//! P(0) = R D(1) / a(1)                                a splat of one of the R subpaths for a sample of each pixel
//! ```
//!
//! Both walks follow a specular chain with the same probability. It is the fraction of unpolarised light that a chain
//! of transparent faces lets through, which is the same in both directions. So it stands in D(n) alone.
//!
//! Each walk carries the sum of the P of all techniques before it, over the densities that it has in common with them.
//! Roulette changes no weight.

/// Light subpaths for each camera sample.
pub(in crate::integrator) const SUBPATHS: u32 = 1;

/// What light subpaths find of a path up to a vertex vi of the camera's walk: the sum of all P(k) with k < i, over c(1)
/// to c(i-1) and D(i).
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::integrator) struct FromCamera {
    /// The connection to the vertex before.
    near: f64,
    /// The others, for each unit of l(i).
    beyond: f64,
}

/// An edge of a path, as the walk that has found it sees it.
#[derive(Clone, Copy, Debug)]
pub(in crate::integrator) struct Edge {
    /// The square of its length if it is straight; `None` where it goes through panes.
    pub(in crate::integrator) straight: Option<f64>,
    /// Cosines at its beginning and its end.
    pub(in crate::integrator) cosines: [f64; 2],
    /// Density with which its direction was drawn.
    pub(in crate::integrator) pdf: f64,
}

impl Edge {
    /// What connects its ends, and what goes beyond its beginning.
    fn parts(&self) -> [f64; 2] {
        let [first, last] = self.cosines;
        let drawn = self.pdf * last;
        [f64::from(SUBPATHS) * self.straight.unwrap_or(0.0) / drawn, first / drawn]
    }
}

impl FromCamera {
    /// At v1, which light subpaths of the light plane find, `splats` of them for a sample of each pixel. `seen` is the
    /// number of pixels that a unit of area there covers.
    pub(in crate::integrator) fn seen(splats: f64, seen: f64) -> Self {
        Self { near: splats / seen, beyond: 0.0 }
    }

    /// Whether light subpaths find no such path.
    pub(in crate::integrator) fn is_nothing(&self) -> bool {
        self.near == 0.0 && self.beyond == 0.0
    }

    /// At the end of an edge, at whose beginning light subpaths find `before`.
    pub(in crate::integrator) fn behind(edge: &Edge, before: f64) -> Self {
        let [near, beyond] = edge.parts();
        Self { near, beyond: beyond * before }
    }

    /// The sum, if light would go on from the vertex with a density, which is asked for only where it matters.
    pub(in crate::integrator) fn total(&self, of_light: impl FnOnce() -> f64) -> f64 {
        if self.beyond == 0.0 { self.near } else { self.near + self.beyond * of_light() }
    }
}

/// What techniques find of a path of which a light subpath has found the rest, at a vertex vi of that: the sum of all
/// P(k) with k >= i, over c(1) to c(i-1) and D(i).
#[derive(Clone, Copy, Debug)]
pub(in crate::integrator) struct FromLight {
    near: f64,
    /// The others, for each unit of c(i) and of the sum at the vertex before.
    beyond: f64,
}

impl FromLight {
    /// At the end of an edge.
    pub(in crate::integrator) fn behind(edge: &Edge) -> Self {
        let [near, beyond] = edge.parts();
        Self { near, beyond }
    }

    /// The sum, if the camera would go on from the vertex with the density `of_camera`, and if that at the vertex
    /// before is `before`.
    pub(in crate::integrator) fn total(&self, of_camera: f64, before: f64) -> f64 {
        self.near + self.beyond * of_camera * before
    }
}

/// The share of a splat, of which there are `splats` for a sample of each pixel: `seen` is the number of pixels that a
/// unit of area at its vertex covers, and `by_camera` the sum of what the other techniques find.
pub(in crate::integrator) fn splat_share(splats: f64, seen: f64, by_camera: f64) -> f64 {
    splats / (splats + seen * by_camera)
}

/// The share of a connection of a camera's vertex and a light's vertex: cosines at both, the square of the length, and,
/// at each, the sum of what the other techniques find with the density of drawing the edge from there.
pub(in crate::integrator) fn connection_share(cosines: [f64; 2], squared: f64, from: [(f64, f64); 2]) -> f64 {
    let [(by_light, of_camera), (by_camera, of_light)] = from;
    let others = of_light * cosines[0] * by_light + of_camera * cosines[1] * by_camera;
    1.0 / (1.0 + others / (f64::from(SUBPATHS) * squared))
}
