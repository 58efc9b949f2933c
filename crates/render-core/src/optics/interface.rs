//! Smooth boundaries of triangle meshes: dielectrics and mirrors.
//!
//! A mesh has two normals: that of the triangle, which says on which side a ray is, and the interpolated one, which says
//! where the ray goes. Where they disagree so much that a reflected ray would go through the surface or a refracted one
//! would not, the surface is black.

use glam::DVec3;

use super::dielectric::{Refraction, reflect, refract};

/// What a smooth boundary does to light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Interface {
    /// The boundary between air, on the side to which the normal points, and a clear dielectric.
    Dielectric {
        /// Index of refraction behind the boundary.
        index_of_refraction: f64,
    },
    /// A mirror on both sides.
    Mirror {
        /// Fraction of light reflected.
        reflectance: DVec3,
    },
}

/// The normals at a point of a mesh, on the same side of it. Unit length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normals {
    /// That of the triangle.
    pub geometric: DVec3,
    /// That which is interpolated between the triangle's corners.
    pub shading: DVec3,
}

/// A ray that goes through a boundary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Unit direction behind the boundary.
    pub direction: DVec3,
    /// Index of refraction behind the boundary over that before it.
    pub ratio: f64,
    /// Fraction of the power that is transmitted.
    pub transmittance: f64,
}

impl Crossing {
    /// What radiance from behind the boundary is multiplied by on its way back to where the ray came from: it is
    /// proportional to the square of the index of refraction.
    pub fn radiance_factor(&self) -> f64 {
        self.transmittance / (self.ratio * self.ratio)
    }
}

impl Interface {
    /// Index of refraction behind the boundary over that before it, for a ray in `direction`; `None` at a mirror.
    pub fn ratio(&self, direction: DVec3, normals: &Normals) -> Option<f64> {
        match *self {
            Self::Mirror { .. } => None,
            Self::Dielectric { index_of_refraction } if direction.dot(normals.geometric) < 0.0 => {
                Some(index_of_refraction)
            }
            Self::Dielectric { index_of_refraction } => Some(1.0 / index_of_refraction),
        }
    }

    /// The ray that is refracted; `None` at a mirror, at total reflection, and where the normals contradict each other.
    pub fn transmit(&self, direction: DVec3, normals: &Normals) -> Option<Crossing> {
        let ratio = self.ratio(direction, normals).filter(|_| normals.agree(direction))?;
        let Refraction { direction: refracted, transmittance } = refract(direction, normals.shading, 1.0, ratio)?;
        let goes_through = refracted.dot(normals.geometric) * direction.dot(normals.geometric) > 0.0;
        goes_through.then_some(Crossing { direction: refracted, ratio, transmittance })
    }

    /// The direction that is reflected, and the fraction of light that is; `None` where the normals contradict each
    /// other.
    pub fn reflect(&self, direction: DVec3, normals: &Normals) -> Option<(DVec3, DVec3)> {
        if !normals.agree(direction) {
            return None;
        }
        let reflected = reflect(direction, normals.shading);
        let comes_back = reflected.dot(normals.geometric) * direction.dot(normals.geometric) < 0.0;
        let fraction = match (self, self.ratio(direction, normals)) {
            (Self::Dielectric { .. }, Some(ratio)) => {
                let refraction = refract(direction, normals.shading, 1.0, ratio);
                DVec3::splat(1.0 - refraction.map_or(0.0, |refraction| refraction.transmittance))
            }
            (Self::Dielectric { .. }, None) => DVec3::ONE,
            (Self::Mirror { reflectance }, _) => *reflectance,
        };
        comes_back.then_some((reflected, fraction))
    }
}

impl Normals {
    /// Whether a ray comes from the same side of both planes.
    fn agree(&self, direction: DVec3) -> bool {
        direction.dot(self.geometric) * direction.dot(self.shading) > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLAT: Normals = Normals { geometric: DVec3::Z, shading: DVec3::Z };
    const WATER: Interface = Interface::Dielectric { index_of_refraction: 1.33 };

    #[test]
    fn power_is_conserved_and_radiance_grows_with_the_square_of_the_index() {
        for direction in [DVec3::new(0.4, 0.1, -1.0), DVec3::new(-0.3, 0.2, 1.0)] {
            let direction = direction.normalize();
            let crossing = WATER.transmit(direction, &FLAT).unwrap();
            let (back, fraction) = WATER.reflect(direction, &FLAT).unwrap();
            assert!((crossing.transmittance + fraction.x - 1.0).abs() < 1e-15);
            assert_eq!(back, direction * DVec3::new(1.0, 1.0, -1.0));
            let entering = direction.z < 0.0;
            assert_eq!(crossing.ratio, if entering { 1.33 } else { 1.0 / 1.33 });
            let there = WATER.transmit(crossing.direction, &FLAT);
            assert!(there.is_none_or(|there| (there.direction.z < 0.0) == entering));
            // Into the water and out again, the squares cancel.
            let out = WATER.transmit(-crossing.direction, &FLAT).unwrap();
            let both = crossing.radiance_factor() * out.radiance_factor();
            assert!((both - crossing.transmittance * out.transmittance).abs() < 1e-15);
        }
    }

    #[test]
    fn beyond_the_critical_angle_all_light_is_reflected() {
        let direction = DVec3::new(0.9, 0.0, 0.3).normalize();
        assert_eq!(WATER.transmit(direction, &FLAT), None);
        assert_eq!(WATER.reflect(direction, &FLAT).unwrap().1, DVec3::ONE);
    }

    #[test]
    fn rays_never_end_up_on_the_wrong_side() {
        let bent = Normals { geometric: DVec3::Z, shading: DVec3::new(0.9, 0.0, 0.5).normalize() };
        let mirror = Interface::Mirror { reflectance: DVec3::splat(0.9) };
        // Reflected at the interpolated normal, this ray would go on below the triangle.
        assert_eq!(mirror.reflect(DVec3::new(0.3, 0.0, -0.95).normalize(), &bent), None);
        assert_eq!(mirror.transmit(DVec3::NEG_Z, &FLAT), None);
        assert_eq!(mirror.reflect(DVec3::NEG_Z, &FLAT), Some((DVec3::Z, DVec3::splat(0.9))));
        // Seen from the side of one normal and not of the other.
        assert_eq!(WATER.transmit(DVec3::new(0.6, 0.0, -0.3).normalize(), &bent), None);
    }
}
