//! A point of a smooth surface with the derivatives there. Manifold walks need them for faces of panes and for
//! triangles alike. All in world coordinates.

use glam::{DMat2, DVec3};

use super::{Frame, SurfaceJet};

/// The surface around a point, in two coordinates of its own whose unit is about a metre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceDifferential {
    /// The point, metres.
    pub position: DVec3,
    /// Its derivatives by both coordinates.
    pub tangents: [DVec3; 2],
    /// The unit normal that bends light.
    pub normal: DVec3,
    /// Its derivatives by both coordinates, 1/metre.
    pub normal_by: [DVec3; 2],
}

impl SurfaceDifferential {
    /// A point of a face of a pane that hangs at `frame`, whose derivatives are `jet`; the coordinates are the pane's x
    /// and y.
    pub fn of_face(frame: &Frame, position: DVec3, jet: &SurfaceJet) -> Self {
        let [x, y] = jet.gradient.to_array();
        let raw = DVec3::new(-x, -y, 1.0);
        let length = raw.length();
        let normal = raw / length;
        let [xx, xy, yy] = jet.hessian;
        let turned = |by: DVec3| frame.vector_to_world((by - normal * normal.dot(by)) / length);
        Self {
            position,
            tangents: [frame.vector_to_world(DVec3::new(1.0, 0.0, x)), frame.vector_to_world(DVec3::new(0.0, 1.0, y))],
            normal: frame.vector_to_world(normal),
            normal_by: [turned(DVec3::new(-xx, -xy, 0.0)), turned(DVec3::new(-xy, -yy, 0.0))],
        }
    }

    /// A point of a triangle with these corners and normals at them, which are interpolated linearly and then
    /// normalised; the coordinates are along the first edge and across it.
    pub fn of_triangle(corners: &[DVec3; 3], normals: &[DVec3; 3], position: DVec3, barycentric: [f64; 2]) -> Self {
        let [a, b, c] = *corners;
        let first = (b - a).normalize();
        let across = (b - a).cross(c - a).normalize().cross(first);
        // The edges as functions of the coordinates, and so the coordinates as functions of the weights.
        let edges = DMat2::from_cols_array(&[(b - a).length(), 0.0, (c - a).dot(first), (c - a).dot(across)]);
        let weights = edges.inverse();
        let [v, w] = barycentric;
        let raw = normals[0] * (1.0 - v - w) + normals[1] * v + normals[2] * w;
        let length = raw.length();
        let normal = raw / length;
        let (by_v, by_w) = (normals[1] - normals[0], normals[2] - normals[0]);
        let turned = |column: glam::DVec2| {
            let by = by_v * column.x + by_w * column.y;
            (by - normal * normal.dot(by)) / length
        };
        Self {
            position,
            tangents: [first, across],
            normal,
            normal_by: [turned(weights.x_axis), turned(weights.y_axis)],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;

    #[test]
    fn the_normal_of_a_triangle_varies_as_its_differential_says() {
        let corners = [DVec3::new(0.1, 0.2, 1.0), DVec3::new(0.9, 0.1, 1.2), DVec3::new(0.3, 0.8, 0.7)];
        let normals = [DVec3::new(0.1, 0.2, 1.0), DVec3::new(-0.3, 0.1, 0.9), DVec3::new(0.0, -0.4, 1.1)];
        let at = |barycentric: [f64; 2]| {
            let [v, w] = barycentric;
            let position = corners[0] * (1.0 - v - w) + corners[1] * v + corners[2] * w;
            SurfaceDifferential::of_triangle(&corners, &normals, position, barycentric)
        };
        let here = at([0.3, 0.25]);
        let step = 1e-6;
        for barycentric in [[0.3 + step, 0.25], [0.3, 0.25 + step]] {
            let there = at(barycentric);
            let moved = there.position - here.position;
            let along = DVec2::new(moved.dot(here.tangents[0]), moved.dot(here.tangents[1]));
            assert!((here.tangents[0] * along.x + here.tangents[1] * along.y - moved).length() < 1e-15);
            let turned = here.normal_by[0] * along.x + here.normal_by[1] * along.y;
            assert!((there.normal - here.normal - turned).length() < 1e-11);
        }
    }
}
