//! Whether a point is in a body.

use std::ops::Range;

use glam::DVec3;

use super::{Accelerator, Face, Pane, Ray};

/// A direction along no axis, for rays that count what is around a point. Edges of meshes seldom lie along it.
const AROUND: DVec3 = DVec3::new(0.537_659_4, 0.281_904_7, 0.794_632_1);

impl Pane {
    /// Whether a point of the world lies in the glass.
    pub fn holds(&self, point: DVec3) -> bool {
        let local = self.frame.point_to_local(point);
        let place = local.truncate();
        self.outline.contains(place)
            && local.z >= self.front.height(place)
            && local.z - self.thickness <= self.back.height(place)
    }

    /// The face of the pane within `reach` of a point, through which a direction leads into the glass or, with `enters`
    /// false, out of it; and the unit normal there, in the world.
    pub fn face_near(&self, point: DVec3, direction: DVec3, enters: bool, reach: f64) -> Option<(Face, DVec3)> {
        let (local, direction) = (self.frame.point_to_local(point), self.frame.vector_to_local(direction));
        let place = local.truncate();
        if !self.outline.contains(place) {
            return None;
        }
        [Face::Front, Face::Back].into_iter().find_map(|face| {
            let (height, gradient) = self.surface(face).slope(place);
            let normal = DVec3::new(-gradient.x, -gradient.y, 1.0).normalize();
            let distance = (local.z - self.base_height(face) - height) * normal.z;
            let rises = direction.dot(normal) > 0.0;
            let leads_in = rises == (face == Face::Front);
            (distance.abs() <= reach && leads_in == enters).then(|| (face, self.frame.vector_to_world(normal)))
        })
    }
}

impl Accelerator {
    /// How many times the triangles of a range wind around a point: not at all outside of a solid.
    pub fn winding(&self, point: DVec3, triangles: &Range<u32>) -> i32 {
        // An edge on one of three rays does not decide.
        let mut windings =
            [AROUND, DVec3::new(-AROUND.y, AROUND.z, AROUND.x), DVec3::new(AROUND.z, -AROUND.x, -AROUND.y)].map(
                |direction| {
                    let ray = Ray::new(point, direction.normalize());
                    let mut winding = 0;
                    self.triangles_along(&ray, f64::INFINITY, &mut |triangle, _| {
                        if triangles.contains(&triangle) {
                            let [a, b, c] = self.corners(triangle);
                            winding += if (*b - *a).cross(*c - *a).dot(ray.direction) > 0.0 { 1 } else { -1 };
                        }
                    });
                    winding
                },
            );
        windings.sort_unstable();
        windings[1]
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::geometry::Frame;
    use crate::geometry::testing::{Glass, rectangular};

    #[test]
    fn a_pane_holds_what_lies_between_its_faces_and_has_a_face_near_each() {
        let size = DVec2::new(0.5, 0.4);
        let faces = [0.2, 0.7].map(|variant| Glass::Flat.face(size, 1e-3, variant));
        let frame = Frame::new(DVec3::new(1.0, 2.0, 3.0), DVec3::Y, DVec3::Z);
        let pane = rectangular(frame, size, 0.003, 1.5, DVec3::ZERO, faces);
        let depth = pane.depth();
        let inside = pane.frame.point_to_world(DVec3::new(0.0, 0.0, 0.5 * depth.max));
        assert!(pane.holds(inside) && !pane.holds(inside + pane.frame.axes.z_axis * depth.max));
        let outwards = pane.frame.axes.z_axis;
        let surface = pane.frame.point_to_world(DVec3::new(0.0, 0.0, depth.max));
        let found = |offset: f64, direction: DVec3, enters| {
            pane.face_near(surface + outwards * offset, direction, enters, 1e-6).map(|(face, _)| face)
        };
        assert_eq!(found(5e-7, outwards, false), Some(Face::Back));
        assert_eq!(found(-5e-7, -outwards, true), Some(Face::Back));
        assert_eq!([found(5e-7, outwards, true), found(2e-6, outwards, false)], [None; 2]);
    }
}
