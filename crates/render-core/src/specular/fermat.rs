//! Fermat's principle for a path through both faces of a pane: optical length, gradient, Hessian and the generalised
//! geometry factor.
//!
//! The unknowns are theta = (x1, y1, x2, y2), tangential coordinates in metres. They belong to the vertex X1 on the
//! face near the shading point O, and to X2 on the far face. A path is physical where the optical length
//! `L = |O X1| + n |X1 X2| + |X2 S|` is stationary (Huan et al. 2023, section 3.1). With a, b, w the unit directions of
//! the three segments from O to S, and t the tangents of a face,
//!
//! ```text
//! dL = (a - n b).dX1 + (n b - w).dX2
//! ```
//!
//! The paper's equation (1) prints other signs, whose zeros are not Snell paths. For a light at infinity the last term
//! of L is `-w_S.X2`, the difference of optical lengths.

use glam::{DMat2, DVec2, DVec3};

use super::side::{PaneSide, unit_normal};
use crate::{
    bsdf::fresnel::refract,
    geometry::{HeightField, SurfaceJet},
    light::Source,
};
use clerestory_film::counters::Counters;

/// The two vertices: `[X1, X2]` in tangential coordinates.
pub type Theta = [DVec2; 2];

/// One connection problem: a shading point, a light point or direction, and a pane, all in the pane's frame.
#[derive(Clone, Copy, Debug)]
pub struct Connection<'a> {
    /// The shading point.
    pub origin: DVec3,
    /// The light point or direction.
    pub source: Source,
    /// Index of refraction of the glass relative to the air.
    pub index: f64,
    pub(super) surfaces: [&'a HeightField; 2],
    pub(super) bases: [f64; 2],
}

/// A path that need not be physical, with the derivatives of its optical length.
#[derive(Clone, Copy, Debug)]
pub struct FermatPath {
    /// X1 and X2.
    pub vertices: [DVec3; 2],
    /// Unit directions of the segments O X1, X1 X2, X2 S.
    pub directions: [DVec3; 3],
    /// Their lengths; the last is infinite for a light at infinity.
    pub lengths: [f64; 3],
    /// Gradient of the optical length with respect to X1 and X2: the mismatch of tangential optical momentum.
    pub gradient: [DVec2; 2],
    pub(super) jets: [SurfaceJet; 2],
    index: f64,
}

/// The symmetric 4x4 Hessian of the optical length in 2x2 blocks.
#[derive(Clone, Copy, Debug)]
pub struct Hessian {
    /// With respect to X1 twice.
    pub near: DMat2,
    /// With respect to X1 (rows) and X2 (columns).
    pub mixed: DMat2,
    /// With respect to X2 twice.
    pub far: DMat2,
}

/// A factorised Hessian, by the Schur complement of the far block.
#[derive(Clone, Copy, Debug)]
pub struct Factorisation {
    far_inverse: DMat2,
    mixed: DMat2,
    schur_inverse: DMat2,
    /// Determinant of the Hessian.
    pub determinant: f64,
}

impl<'a> Connection<'a> {
    /// The problem of connecting `origin` to `source` through the pane.
    pub fn new(side: &PaneSide<'a>, origin: DVec3, source: Source) -> Self {
        Self {
            origin,
            source,
            index: side.pane.index_of_refraction,
            surfaces: [side.near_surface(), side.far_surface()],
            bases: [side.near_base(), side.far_base()],
        }
    }

    /// The optical length at `theta`, up to a constant for a light at infinity.
    #[inline(always)]
    pub fn optical_length(&self, theta: &Theta, counters: &mut Counters) -> f64 {
        counters.height_evaluations += 2;
        let x1 = theta[0].extend(self.bases[0] + self.surfaces[0].height(theta[0]));
        let x2 = theta[1].extend(self.bases[1] + self.surfaces[1].height(theta[1]));
        let outside = match self.source {
            Source::Point(point) => (point - x2).length(),
            Source::Direction(direction) => -direction.dot(x2),
        };
        (x1 - self.origin).length() + self.index * (x2 - x1).length() + outside
    }

    /// The path through `theta` and what its derivatives need.
    #[inline(always)]
    pub fn path(&self, theta: &Theta, counters: &mut Counters) -> FermatPath {
        counters.height_evaluations += 2;
        let jets = [self.surfaces[0].jet(theta[0]), self.surfaces[1].jet(theta[1])];
        let vertices =
            [theta[0].extend(self.bases[0] + jets[0].height), theta[1].extend(self.bases[1] + jets[1].height)];
        let first = vertices[0] - self.origin;
        let inner = vertices[1] - vertices[0];
        let (last_direction, last_length) = match self.source {
            Source::Point(point) => {
                let last = point - vertices[1];
                let length = last.length();
                (last / length, length)
            }
            Source::Direction(direction) => (direction, f64::INFINITY),
        };
        let lengths = [first.length(), inner.length(), last_length];
        let directions = [first / lengths[0], inner / lengths[1], last_direction];
        let [a, b, w] = directions;
        let gradient = [pulled_back(&jets[0], a - b * self.index), pulled_back(&jets[1], b * self.index - w)];
        FermatPath { vertices, directions, lengths, gradient, jets, index: self.index }
    }

    /// A point of the near face refracted towards the light's side: the seed that obeys Snell's law at X1.
    #[inline(always)]
    pub fn thin_seed(&self, near: DVec2, counters: &mut Counters) -> Option<Theta> {
        counters.height_evaluations += 2;
        let (height, gradient) = self.surfaces[0].slope(near);
        let x1 = near.extend(self.bases[0] + height);
        let incident = (x1 - self.origin).normalize();
        let inner = refract(incident, unit_normal(gradient), 1.0, self.index)?;
        let rise = (self.bases[1] - x1.z) / inner.direction.z;
        let flat = near + inner.direction.truncate() * rise;
        let rise = rise + self.surfaces[1].height(flat) / inner.direction.z;
        Some([near, near + inner.direction.truncate() * rise])
    }
}

impl FermatPath {
    /// The Hessian of the optical length.
    #[inline(always)]
    pub fn hessian(&self) -> Hessian {
        let [a, b, w] = self.directions;
        let [d0, d1, d2] = self.lengths;
        let n = self.index;
        let bend_near = a.z - n * b.z;
        let bend_far = n * b.z - w.z;
        let [near, far] = &self.jets;
        Hessian {
            near: projector(near, near, a) * (1.0 / d0)
                + projector(near, near, b) * (n / d1)
                + second_derivatives(near) * bend_near,
            mixed: projector(near, far, b) * (-n / d1),
            far: projector(far, far, b) * (n / d1)
                + projector(far, far, w) * (1.0 / d2)
                + second_derivatives(far) * bend_far,
        }
    }

    /// Whether each segment crosses its face from the shading point's side to the light's, `sign` being that of z on
    /// the way: a stationary path need not (it may be a reflection).
    pub fn crosses(&self, sign: f64) -> bool {
        let [a, b, w] = self.directions;
        let [m1, m2] = [normal(&self.jets[0]), normal(&self.jets[1])];
        [m1.dot(a), m1.dot(b), m2.dot(b), m2.dot(w)].into_iter().all(|cosine| cosine * sign > 0.0)
    }

    /// The generalised geometry factor of a stationary path, with the determinant of its Hessian: solid angle at O per
    /// area, perpendicular to the path, at a light point, or per solid angle of a light at infinity.
    ///
    /// Closed form: with V(O, S) the optical length of the stationary path, `|det V_OS|` is the projected solid angle
    /// per area; the implicit function theorem and Jacobi's identity for complementary minors reduce it to
    ///
    /// ```text
    /// G = n^2 |m1.a| |m1.b| |m2.b| |m2.w| / (d0^2 d1^2 d2^2 |det H|),    without d2 for a light at infinity
    /// ```
    ///
    /// where m are unnormalised normals. The cosines at O and S are left to the caller.
    pub fn geometry_factor(&self, determinant: f64) -> f64 {
        let [a, b, w] = self.directions;
        let [d0, d1, d2] = self.lengths;
        let [m1, m2] = [normal(&self.jets[0]), normal(&self.jets[1])];
        let cosines = m1.dot(a) * m1.dot(b) * m2.dot(b) * m2.dot(w);
        let spread = if d2.is_finite() { d0 * d1 * d2 } else { d0 * d1 };
        (self.index * self.index * cosines / (spread * spread * determinant)).abs()
    }
}

impl Hessian {
    /// Factorises; `None` when singular.
    #[inline(always)]
    pub fn factorise(&self) -> Option<Factorisation> {
        let far_determinant = self.far.determinant();
        let far_inverse = inverse(&self.far, far_determinant)?;
        let schur = self.near - self.mixed * far_inverse * self.mixed.transpose();
        let schur_determinant = schur.determinant();
        let schur_inverse = inverse(&schur, schur_determinant)?;
        Some(Factorisation {
            far_inverse,
            mixed: self.mixed,
            schur_inverse,
            determinant: far_determinant * schur_determinant,
        })
    }
}

impl Factorisation {
    /// `-H^-1 gradient`.
    #[inline(always)]
    pub fn newton_step(&self, gradient: &[DVec2; 2]) -> Theta {
        let reduced = gradient[0] - self.mixed * (self.far_inverse * gradient[1]);
        let near = -(self.schur_inverse * reduced);
        let far = -(self.far_inverse * (gradient[1] + self.mixed.transpose() * near));
        [near, far]
    }
}

#[inline(always)]
pub(super) fn inverse(matrix: &DMat2, determinant: f64) -> Option<DMat2> {
    let scale = 1.0 / determinant;
    scale.is_finite().then(|| {
        let [a, b, c, d] = matrix.to_cols_array();
        DMat2::from_cols_array(&[d * scale, -b * scale, -c * scale, a * scale])
    })
}

/// The unnormalised normal `(-h_x, -h_y, 1)`.
#[inline(always)]
pub(super) fn normal(jet: &SurfaceJet) -> DVec3 {
    DVec3::new(-jet.gradient.x, -jet.gradient.y, 1.0)
}

/// `T^T v` for the tangents `(1, 0, h_x)` and `(0, 1, h_y)`.
#[inline(always)]
pub(super) fn pulled_back(jet: &SurfaceJet, vector: DVec3) -> DVec2 {
    vector.truncate() + jet.gradient * vector.z
}

/// `T1^T (I - v v^T) T2`.
#[inline(always)]
pub(super) fn projector(first: &SurfaceJet, second: &SurfaceJet, direction: DVec3) -> DMat2 {
    let left = pulled_back(first, direction);
    let right = pulled_back(second, direction);
    let (g1, g2) = (first.gradient, second.gradient);
    // Columns: derivatives with respect to the second face's x and y.
    DMat2::from_cols(
        DVec2::new(1.0 + g1.x * g2.x - left.x * right.x, g1.y * g2.x - left.y * right.x),
        DVec2::new(g1.x * g2.y - left.x * right.y, 1.0 + g1.y * g2.y - left.y * right.y),
    )
}

#[inline(always)]
pub(super) fn second_derivatives(jet: &SurfaceJet) -> DMat2 {
    let [xx, xy, yy] = jet.hessian;
    DMat2::from_cols(DVec2::new(xx, xy), DVec2::new(xy, yy))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::testing::Glass,
        specular::{
            newton::{Root, SearchRegion, solve_complete},
            testing::{between, pair, pane, random},
        },
    };

    const SOURCES: [Source; 2] =
        [Source::Point(DVec3::new(-0.4, 0.3, 2.1)), Source::Direction(DVec3::new(-0.231, 0.154, 0.960_682))];

    fn for_each_problem(check: impl Fn(&Connection<'_>, &Theta)) {
        for glass in [Glass::Crown, Glass::Bumpy] {
            let pane = pane(glass, 0.1e-3);
            let mut random = random(2);
            for case in 0..100 {
                let front = case % 2 == 0;
                let distance = between(&mut random, 0.3, 3.0);
                let origin = (pair(&mut random) - 0.5).extend(if front { -distance } else { distance });
                let source = match SOURCES[case % 4 / 2] {
                    Source::Point(point) if front => Source::Point(point),
                    Source::Point(point) => Source::Point(-point),
                    Source::Direction(direction) if front => Source::Direction(direction.normalize()),
                    Source::Direction(direction) => Source::Direction(-direction.normalize()),
                };
                let side = PaneSide::facing(&pane, origin).unwrap();
                let near = (pair(&mut random) - 0.5) * pane.size() * 0.9;
                let theta = [near, near + (pair(&mut random) - 0.5) * 0.004];
                check(&Connection::new(&side, origin, source), &theta);
            }
        }
    }

    fn moved(theta: &Theta, coordinate: usize, by: f64) -> Theta {
        let mut flat = [theta[0].x, theta[0].y, theta[1].x, theta[1].y];
        flat[coordinate] += by;
        [DVec2::new(flat[0], flat[1]), DVec2::new(flat[2], flat[3])]
    }

    #[test]
    fn the_gradient_is_the_derivative_of_the_optical_length() {
        for_each_problem(|connection, theta| {
            let counters = &mut Counters::default();
            let [near, far] = connection.path(theta, counters).gradient;
            for (coordinate, derivative) in [near.x, near.y, far.x, far.y].into_iter().enumerate() {
                let difference = |step: f64, counters: &mut Counters| {
                    connection.optical_length(&moved(theta, coordinate, step), counters)
                        - connection.optical_length(&moved(theta, coordinate, -step), counters)
                };
                // Without the third derivative, which is of the order of n / d1^2. Lengths of metres are rounded to
                // 1e-15.
                let step = 1e-6;
                let slope = (8.0 * difference(step, counters) - difference(2.0 * step, counters)) / (12.0 * step);
                assert!((derivative - slope).abs() < 1e-8, "{derivative} {slope}");
            }
        });
    }

    #[test]
    fn the_hessian_is_the_derivative_of_the_gradient() {
        for_each_problem(|connection, theta| {
            let counters = &mut Counters::default();
            let hessian = connection.path(theta, counters).hessian();
            let columns = [
                [hessian.near.x_axis, hessian.mixed.transpose().x_axis],
                [hessian.near.y_axis, hessian.mixed.transpose().y_axis],
                [hessian.mixed.x_axis, hessian.far.x_axis],
                [hessian.mixed.y_axis, hessian.far.y_axis],
            ];
            for (coordinate, column) in columns.into_iter().enumerate() {
                let step = 1e-8;
                let ahead = connection.path(&moved(theta, coordinate, step), counters).gradient;
                let behind = connection.path(&moved(theta, coordinate, -step), counters).gradient;
                let scale = hessian.near.x_axis.length() + hessian.far.y_axis.length();
                for face in 0..2 {
                    let difference = (ahead[face] - behind[face]) / (2.0 * step);
                    assert!((column[face] - difference).length() < 1e-8 * scale, "{column:?} {difference}");
                }
            }
        });
    }

    fn solve(side: &PaneSide<'_>, origin: DVec3, source: Source, near: DVec2) -> Option<Root> {
        let counters = &mut Counters::default();
        let connection = Connection::new(side, origin, source);
        let region = SearchRegion { bounds: side.pane.outline.bounds().grown(1.0), tolerance: 1e-12 };
        solve_complete(&connection, connection.thin_seed(near, counters)?, &region, counters)
    }

    /// Solid angle at O over area at S, by solving again for light points nearby.
    #[test]
    fn the_geometry_factor_is_the_spread_of_neighbouring_paths() {
        for glass in [Glass::Crown, Glass::Bumpy] {
            let pane = pane(glass, 0.05e-3);
            for source in SOURCES {
                let source = match source {
                    Source::Direction(direction) => Source::Direction(direction.normalize()),
                    point @ Source::Point(_) => point,
                };
                let origin = DVec3::new(0.13, -0.04, -0.8);
                let side = PaneSide::facing(&pane, origin).unwrap();
                let start = DVec2::new(0.02, 0.03);
                let root = solve(&side, origin, source, start).unwrap();
                let [a, _, w] = root.path.directions;
                let across = crate::geometry::Frame::around(w);
                let step = 1e-5;
                let derivative = |axis: DVec3| {
                    let direction = |by: f64| {
                        let source = match source {
                            Source::Point(point) => Source::Point(point + axis * by),
                            Source::Direction(direction) => Source::Direction((direction + axis * by).normalize()),
                        };
                        solve(&side, origin, source, root.theta[0]).unwrap().path.directions[0]
                    };
                    (direction(step) - direction(-step)) / (2.0 * step)
                };
                let spread = derivative(across.axes.x_axis).cross(derivative(across.axes.y_axis)).dot(a).abs();
                let factor = root.path.geometry_factor(root.determinant);
                assert!((factor / spread - 1.0).abs() < 1e-6, "{factor} {spread}");
            }
        }
    }

    #[test]
    fn a_path_spreads_the_same_in_both_directions() {
        let pane = pane(Glass::Crown, 0.1e-3);
        let (front, back) = (DVec3::new(0.1, -0.05, -0.9), DVec3::new(-0.2, 0.1, 1.4));
        let there = solve(&PaneSide::facing(&pane, front).unwrap(), front, Source::Point(back), DVec2::ZERO).unwrap();
        let side = PaneSide::facing(&pane, back).unwrap();
        let again = solve(&side, back, Source::Point(front), there.theta[1]).unwrap();
        assert!((there.theta[0] - again.theta[1]).length() < 1e-12);
        let ratio = there.path.geometry_factor(there.determinant) / again.path.geometry_factor(again.determinant);
        assert!((ratio - 1.0).abs() < 1e-9);
    }

    /// Plane-parallel plate: irradiance spreads as if the glass were thinner by its index.
    #[test]
    fn a_flat_pane_at_normal_incidence_spreads_by_the_reduced_distance() {
        let pane = pane(Glass::Flat, 0.0);
        let origin = DVec3::new(0.0, 0.0, -1.0);
        let side = PaneSide::facing(&pane, origin).unwrap();
        let source = Source::Point(DVec3::new(0.0, 0.0, 2.003));
        let root = solve(&side, origin, source, DVec2::new(0.01, 0.0)).unwrap();
        let reduced = 1.0 + 0.003 / 1.5 + 2.0;
        let factor = root.path.geometry_factor(root.determinant);
        assert!((factor * reduced * reduced - 1.0).abs() < 1e-12);
    }
}
