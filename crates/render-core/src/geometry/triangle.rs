//! The watertight intersection of a ray with a triangle.
//!
//! Woop, Benthin, Wald, *Watertight Ray/Triangle Intersection*, JCGT 2(1), 2013, in double precision. The triangle is
//! sheared so that the ray becomes the z axis. Then the side of an edge on which the ray passes is the sign of one
//! difference of products. The neighbour on that edge computes the same number with the opposite sign, so a ray cannot
//! slip between them. A ray exactly through an edge hits both.

use glam::DVec3;

use super::Ray;

/// A ray prepared for many triangles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShearedRay {
    origin: DVec3,
    /// The axes in cyclic order, the ray's largest component last.
    axes: [usize; 3],
    shear: [f64; 3],
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TriangleHit {
    /// Distance along the ray, not negative.
    pub(crate) distance: f64,
    /// Weights of the second and third corner.
    pub(crate) barycentric: [f64; 2],
}

impl ShearedRay {
    pub(crate) fn new(ray: &Ray) -> Self {
        let d = ray.direction;
        let size = d.abs();
        let z = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let shear = [d[axes[0]] / d[z], d[axes[1]] / d[z], 1.0 / d[z]];
        Self { origin: ray.origin, axes, shear }
    }

    pub(crate) fn intersect(&self, corners: &[DVec3; 3]) -> Option<TriangleHit> {
        let [a, b, c] = corners.map(|corner| self.sheared(corner));
        let u = c[0] * b[1] - c[1] * b[0];
        let v = a[0] * c[1] - a[1] * c[0];
        let w = b[0] * a[1] - b[1] * a[0];
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let determinant = u + v + w;
        if determinant == 0.0 {
            return None;
        }
        let [u, v, w] = [u, v, w].map(|weight| weight / determinant);
        let distance = (u * a[2] + v * b[2] + w * c[2]) * self.shear[2];
        (distance >= 0.0).then_some(TriangleHit { distance, barycentric: [v, w] })
    }

    /// A point relative to the origin, in coordinates in which the ray is the z axis; z is not scaled.
    #[inline(always)]
    fn sheared(&self, point: DVec3) -> [f64; 3] {
        let p = (point - self.origin).to_array();
        let z = p[self.axes[2]];
        [p[self.axes[0]] - self.shear[0] * z, p[self.axes[1]] - self.shear[1] * z, z]
    }
}

/// Whether two triangles lie in one plane, to rounding.
pub(crate) fn coplanar(a: &[DVec3; 3], b: &[DVec3; 3]) -> bool {
    let normal = (a[1] - a[0]).cross(a[2] - a[0]);
    let largest = a.iter().chain(b).fold(0f64, |largest, p| largest.max(p.abs().max_element()));
    let slack = 64.0 * f64::EPSILON * largest * normal.length();
    b.iter().all(|corner| (corner - a[0]).dot(normal).abs() <= slack)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::testing::fixed_seed;
    use proptest::prelude::*;

    fn hit(origin: [f64; 3], direction: [f64; 3], corners: [[f64; 3]; 3]) -> Option<TriangleHit> {
        let ray = Ray::new(DVec3::from(origin), DVec3::from(direction).normalize());
        ShearedRay::new(&ray).intersect(&corners.map(DVec3::from))
    }

    fn vector(reach: f64) -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-reach..reach).prop_map(DVec3::from)
    }

    const UNIT: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    #[test]
    fn distance_and_weights_of_a_hit_are_right_from_both_sides() {
        for (z, direction) in [(3.0, -1.0), (-3.0, 1.0)] {
            let found = hit([0.25, 0.5, z], [0.0, 0.0, direction], UNIT).unwrap();
            assert_eq!(found, TriangleHit { distance: 3.0, barycentric: [0.25, 0.5] });
        }
    }

    #[test]
    fn a_triangle_behind_the_ray_or_edge_on_is_missed() {
        assert_eq!(hit([0.25, 0.25, 1.0], [0.0, 0.0, 1.0], UNIT), None);
        assert_eq!(hit([-1.0, 0.25, 0.0], [1.0, 0.0, 0.0], UNIT), None);
        assert_eq!(hit([0.75, 0.75, 1.0], [0.0, 0.0, -1.0], UNIT), None);
    }

    #[test]
    fn rays_exactly_on_the_diagonal_of_a_quad_hit_both_triangles() {
        let halves = [[UNIT[0], UNIT[1], [1.0, 1.0, 0.0]], [UNIT[0], [1.0, 1.0, 0.0], UNIT[2]]];
        for i in 0..=1024 {
            let s = f64::from(i) / 1024.0;
            for z in [1.0, -1.0] {
                for half in halves {
                    assert!(hit([s, s, z], [0.0, 0.0, -z], half).is_some(), "{s} {z}");
                }
            }
        }
    }

    #[test]
    fn triangles_of_one_plane_are_coplanar_and_others_are_not() {
        let plane = |x: f64, y: f64| DVec3::new(x, y, 0.3 * x - 0.7 * y + 100.0);
        let a = [plane(0.0, 0.0), plane(1.0, 0.1), plane(0.2, 1.3)];
        let b = [plane(1.0, 0.1), plane(0.2, 1.3), plane(2.0, 2.1)];
        assert!(coplanar(&a, &b));
        assert!(!coplanar(&a, &[b[0], b[1], b[2] + DVec3::new(0.0, 0.0, 1e-9)]));
    }

    proptest! {
        #![proptest_config(fixed_seed(2000))]

        #[test]
        fn no_ray_slips_through_a_closed_fan(
            apex in vector(1.0), rim in prop::collection::vec((0.5..2.0f64, -0.5..0.5f64), 5), origin in vector(3.0),
            toward in 0usize..12, s in 0.0..1.0f64,
        ) {
            // A fan around an apex, seen from a point above: rays at its edges, at its apex, and between.
            let corner = |i: usize| {
                let angle = std::f64::consts::TAU * (i % 5) as f64 / 5.0;
                let (radius, height) = rim[i % 5];
                apex + DVec3::new(radius * libm::cos(angle), radius * libm::sin(angle), height - 1.0)
            };
            let origin = DVec3::new(origin.x, origin.y, 30.0);
            let target = match toward {
                0 => apex,
                1..6 => apex.lerp(corner(toward), s * 0.999),
                _ => apex.lerp(corner(toward).lerp(corner(toward + 1), 0.5), s * 0.5),
            };
            let ray = ShearedRay::new(&Ray::new(origin, (target - origin).normalize()));
            let hits = (0..5).filter_map(|i| ray.intersect(&[apex, corner(i), corner(i + 1)])).count();
            prop_assert!(hits >= 1);
        }

        #[test]
        fn the_point_of_a_hit_lies_on_the_ray(corners in prop::array::uniform3(vector(1.0)), origin in vector(2.0)) {
            let target = (corners[0] + corners[1] + corners[2]) / 3.0;
            let ray = Ray::new(origin, (target - origin).normalize());
            let area = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            prop_assume!(area.length() > 1e-3 && area.normalize().dot(ray.direction).abs() > 1e-3);
            let TriangleHit { distance, barycentric: [v, w] } = ShearedRay::new(&ray).intersect(&corners).unwrap();
            let point = corners[0] * (1.0 - v - w) + corners[1] * v + corners[2] * w;
            prop_assert!((point - ray.at(distance)).length() < 1e-11);
        }
    }
}
