//! Triangle meshes as they come out of a scene file, a PLY file or an OBJ file.

use glam::{DMat3, DVec2, DVec3};

use super::description::MeshDescription;
use crate::settings::Triple;

/// Triangles with shared vertices, in the coordinates of their file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct TriangleMesh {
    /// Positions of the vertices.
    pub(super) positions: Vec<DVec3>,
    /// Three vertices for each triangle.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Texture coordinates, one for each vertex; empty when there are none.
    pub(super) texture_coordinates: Vec<DVec2>,
    /// Normals of any length, one for each vertex; empty when there are none.
    pub(super) normals: Vec<DVec3>,
}

/// Whether three points lie on one line, as far as double precision can tell.
pub(super) fn is_degenerate([a, b, c]: [DVec3; 3]) -> bool {
    let longest_squared = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    let doubled_area = (b - a).cross(c - a).length();
    // Written so that a number that is not finite counts as degenerate.
    !(doubled_area > longest_squared * 1e-12 && doubled_area.is_finite())
}

/// How a mesh is placed in the scene: scaled, then rotated, then moved.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    rotation: DMat3,
    scale: f64,
    translate: DVec3,
}

impl Placement {
    /// The placement that a scene file describes.
    pub(super) fn of(mesh: &MeshDescription) -> Self {
        Self { rotation: rotation(mesh.rotate), scale: mesh.scale, translate: DVec3::from(mesh.translate) }
    }

    /// Where a point of the file lies in the scene.
    pub(super) fn apply(&self, point: DVec3) -> DVec3 {
        self.rotation * self.scale * point + self.translate
    }

    /// Where a normal of the file points in the scene.
    pub(super) fn turn(&self, normal: DVec3) -> DVec3 {
        self.rotation * normal
    }
}

/// The rotation about the fixed axes x, then y, then z, in degrees.
fn rotation(degrees: Triple) -> DMat3 {
    let [x, y, z] = degrees.map(sine_and_cosine);
    let about_x = DMat3::from_cols_array(&[1.0, 0.0, 0.0, 0.0, x.1, x.0, 0.0, -x.0, x.1]);
    let about_y = DMat3::from_cols_array(&[y.1, 0.0, -y.0, 0.0, 1.0, 0.0, y.0, 0.0, y.1]);
    let about_z = DMat3::from_cols_array(&[z.1, z.0, 0.0, -z.0, z.1, 0.0, 0.0, 0.0, 1.0]);
    about_z * about_y * about_x
}

/// Sine and cosine of an angle in degrees, exact at multiples of a right angle, so that turned walls still meet.
fn sine_and_cosine(degrees: f64) -> (f64, f64) {
    match degrees.rem_euclid(360.0) {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        turn => libm::sincos(turn.to_radians()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotations_turn_counterclockwise_about_x_then_y_then_z() {
        let x = DVec3::X;
        assert_eq!(rotation([0.0, 0.0, 90.0]) * x, DVec3::Y);
        assert_eq!(rotation([0.0, 90.0, 0.0]) * x, DVec3::NEG_Z);
        assert_eq!(rotation([90.0, 0.0, 0.0]) * DVec3::Y, DVec3::Z);
        assert_eq!(rotation([90.0, 0.0, 90.0]) * DVec3::Y, DVec3::Z);
        let turned = rotation([20.0, -35.0, 110.0]);
        assert!((turned.determinant() - 1.0).abs() < 1e-14);
    }

    #[test]
    fn slivers_are_triangles_and_lines_are_not() {
        let line = [DVec3::ZERO, DVec3::new(1.0, 1.0, 1.0), DVec3::new(0.3, 0.3, 0.3)];
        assert!(is_degenerate(line));
        assert!(is_degenerate([DVec3::ZERO; 3]));
        assert!(is_degenerate([DVec3::ZERO, DVec3::X, DVec3::splat(f64::NAN)]));
        assert!(!is_degenerate([DVec3::ZERO, DVec3::X, DVec3::new(0.5, 1e-6, 0.0)]));
    }
}
