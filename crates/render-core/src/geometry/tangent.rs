//! The frame of a normal map at a place of a triangle.
//!
//! A normal map stores normals in a frame that follows the texture coordinates (u, v). Its x axis lies along growing u,
//! y along growing v, and z along the normal of the surface.

use glam::{DVec2, DVec3};

/// The frame in which a normal map stores normals. Orthonormal; it is left-handed where the map lies mirrored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TangentFrame {
    /// Along growing u.
    pub tangent: DVec3,
    /// Along growing v.
    pub bitangent: DVec3,
    /// The normal of the surface.
    pub normal: DVec3,
}

/// Sine of the smallest angle between the normal and growing u at which there is a frame.
const LEAST_SINE: f64 = 1e-9;

impl TangentFrame {
    /// The frame of a triangle with these texture coordinates, around a unit `normal`, which may be interpolated.
    /// `None` where the coordinates of the corners lie on one line, or u grows along the normal alone.
    pub fn of_triangle(corners: &[DVec3; 3], coordinates: &[DVec2; 3], normal: DVec3) -> Option<Self> {
        let [first, second] = [corners[1] - corners[0], corners[2] - corners[0]];
        let [by_first, by_second] = [coordinates[1] - coordinates[0], coordinates[2] - coordinates[0]];
        let area = by_first.perp_dot(by_second);
        if area == 0.0 || !area.is_finite() {
            return None;
        }
        // Derivatives of the position by u and by v, times the area that the triangle has in the picture.
        let along_u = (first * by_second.y - second * by_first.y) * area.signum();
        let along_v = (second * by_first.x - first * by_second.x) * area.signum();
        let across_normal = along_u - normal * normal.dot(along_u);
        let tangent =
            across_normal.try_normalize().filter(|_| across_normal.length() > LEAST_SINE * along_u.length())?;
        let across = normal.cross(tangent);
        let bitangent = if across.dot(along_v) < 0.0 { -across } else { across };
        Some(Self { tangent, bitangent, normal })
    }

    /// The normal in the world that a map says, as a unit vector. Where the map says nothing, that of the surface.
    pub fn mapped(&self, stored: DVec3) -> DVec3 {
        let mapped = self.tangent * stored.x + self.bitangent * stored.y + self.normal * stored.z;
        mapped.normalize_or(self.normal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Frame;

    /// A triangle over which (u, v) grow along these edges.
    fn triangle(along_u: DVec3, along_v: DVec3) -> ([DVec3; 3], [DVec2; 3]) {
        let coordinates = [DVec2::new(0.2, 0.7), DVec2::new(1.1, 0.5), DVec2::new(0.4, 1.6)];
        (coordinates.map(|DVec2 { x, y }| DVec3::new(3.0, -2.0, 5.0) + along_u * x + along_v * y), coordinates)
    }

    #[test]
    fn axes_follow_the_texture_coordinates_however_the_triangle_is_placed() {
        let turn = Frame::around(DVec3::new(1.0, -2.0, 0.5).normalize()).axes;
        for (u, v) in [(DVec3::X, DVec3::Y), (DVec3::X * 3.0, DVec3::Y * 0.1), (-DVec3::X, DVec3::Y)] {
            let (corners, coordinates) = triangle(turn * u, turn * v);
            let frame = TangentFrame::of_triangle(&corners, &coordinates, turn * DVec3::Z).unwrap();
            assert!((frame.tangent - turn * u.normalize()).length() < 1e-12, "{u}, {v}");
            assert!((frame.bitangent - turn * v.normalize()).length() < 1e-12, "{u}, {v}");
            assert_eq!(frame.mapped(DVec3::Z), frame.normal.normalize());
            let bump = DVec3::new(0.3, -0.2, 0.9).normalize();
            let expected = turn * (u.normalize() * bump.x + v.normalize() * bump.y + DVec3::Z * bump.z);
            assert!((frame.mapped(bump) - expected).length() < 1e-12, "{u}, {v}");
        }
    }

    #[test]
    fn the_order_of_the_corners_changes_nothing() {
        let (corners, coordinates) = triangle(DVec3::new(1.0, 0.2, 0.1), DVec3::new(-0.3, 0.8, 0.4));
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        let frame = TangentFrame::of_triangle(&corners, &coordinates, normal).unwrap();
        let [a, b, c] = corners;
        let [p, q, r] = coordinates;
        for (corners, coordinates) in [([b, c, a], [q, r, p]), ([b, a, c], [q, p, r])] {
            let other = TangentFrame::of_triangle(&corners, &coordinates, normal).unwrap();
            let difference = (other.tangent - frame.tangent).length() + (other.bitangent - frame.bitangent).length();
            assert!(difference < 1e-12);
        }
    }

    #[test]
    fn around_an_interpolated_normal_the_frame_is_orthonormal() {
        let (corners, coordinates) = triangle(DVec3::new(1.0, 0.5, 0.0), DVec3::new(0.2, 1.0, 0.0));
        let normal = DVec3::new(0.4, -0.3, 0.8).normalize();
        let TangentFrame { tangent, bitangent, .. } =
            TangentFrame::of_triangle(&corners, &coordinates, normal).unwrap();
        for (one, other, expected) in [
            (tangent, tangent, 1.0),
            (bitangent, bitangent, 1.0),
            (tangent, bitangent, 0.0),
            (tangent, normal, 0.0),
            (bitangent, normal, 0.0),
        ] {
            assert!((one.dot(other) - expected).abs() < 1e-14);
        }
    }

    #[test]
    fn a_triangle_without_an_extent_in_the_picture_has_no_frame() {
        let (corners, coordinates) = triangle(DVec3::X, DVec3::Y);
        let on_a_line = coordinates.map(|place| DVec2::new(place.x, 2.0 * place.x));
        assert_eq!(TangentFrame::of_triangle(&corners, &[DVec2::ZERO; 3], DVec3::Z), None);
        assert_eq!(TangentFrame::of_triangle(&corners, &[on_a_line[0], on_a_line[0], on_a_line[1]], DVec3::Z), None);
        assert_eq!(TangentFrame::of_triangle(&corners, &coordinates, DVec3::X), None);
    }
}
