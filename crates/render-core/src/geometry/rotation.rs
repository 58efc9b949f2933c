//! Rotations as scene files write them.

use glam::DMat3;

/// The rotation about the fixed axes x, then y, then z, in degrees. Positive angles turn counterclockwise for whoever
/// looks against the axis.
pub(crate) fn rotation(degrees: [f64; 3]) -> DMat3 {
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
    use glam::DVec3;

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
}
