//! What absorbs light on its way.

use glam::DVec3;

/// Transmittance by Beer and Lambert's law over `distance` metres, for an absorption coefficient per metre.
pub fn absorption(coefficient: DVec3, distance: f64) -> DVec3 {
    if coefficient == DVec3::ZERO {
        return DVec3::ONE;
    }
    DVec3::new(
        libm::exp(-coefficient.x * distance),
        libm::exp(-coefficient.y * distance),
        libm::exp(-coefficient.z * distance),
    )
}
