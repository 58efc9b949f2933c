//! Refraction and Fresnel's equations at a smooth dielectric interface.

use glam::DVec3;

use super::polarisation::Fresnel;

/// What happens to a ray at a smooth dielectric interface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refraction {
    /// Unit direction behind the interface.
    pub direction: DVec3,
    /// What the interface does to light.
    pub fresnel: Fresnel,
}

impl Refraction {
    /// Fraction of the power that is transmitted of unpolarised light.
    #[inline(always)]
    pub fn transmittance(&self) -> f64 {
        self.fresnel.transmittance()
    }
}

/// Refracts `direction` at an interface with the unit normal `normal`, of either orientation, from a medium of index
/// `index_in` into one of index `index_out`. `None` on total internal reflection.
#[inline(always)]
pub fn refract(direction: DVec3, normal: DVec3, index_in: f64, index_out: f64) -> Option<Refraction> {
    let signed_cos = direction.dot(normal);
    let (cos_in, normal) = if signed_cos > 0.0 { (signed_cos, -normal) } else { (-signed_cos, normal) };
    let ratio = index_in / index_out;
    let cos_out_squared = 1.0 - ratio * ratio * (1.0 - cos_in * cos_in);
    if cos_out_squared <= 0.0 {
        return None;
    }
    let cos_out = cos_out_squared.sqrt();
    Some(Refraction {
        direction: direction * ratio + normal * (ratio * cos_in - cos_out),
        fresnel: Fresnel::of_face(index_in, index_out, cos_in, cos_out),
    })
}

/// Mirrors `direction` at a surface with the unit normal `normal`.
pub fn reflect(direction: DVec3, normal: DVec3) -> DVec3 {
    direction - normal * (2.0 * direction.dot(normal))
}

/// What a smooth dielectric interface does, by the cosine before it and the index of refraction behind it over that
/// before it.
pub(super) fn fresnel(cos_in: f64, ratio: f64) -> Fresnel {
    let cos_out_squared = 1.0 - (1.0 - cos_in * cos_in) / (ratio * ratio);
    if cos_out_squared <= 0.0 {
        return Fresnel::TOTAL;
    }
    Fresnel::of_face(1.0, ratio, cos_in, cos_out_squared.sqrt())
}

/// What Schlick's approximation adds of the part that is not reflected along the normal: `(1 - cos)^5` (Schlick 1994).
pub(super) fn schlick_weight(cosine: f64) -> f64 {
    let rest = (1.0 - cosine).clamp(0.0, 1.0);
    let squared = rest * rest;
    squared * squared * rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refraction_obeys_snell_and_is_reversible() {
        let normal = DVec3::new(0.1, -0.2, 1.0).normalize();
        for direction in [DVec3::new(0.3, 0.2, -1.0), DVec3::new(-0.9, 0.1, -0.4), DVec3::new(0.0, 0.5, 1.0)] {
            let direction = direction.normalize();
            let refraction = refract(direction, normal, 1.0, 1.5).unwrap();
            let tangential = |v: DVec3| v - normal * v.dot(normal);
            assert!((tangential(direction) - 1.5 * tangential(refraction.direction)).length() < 1e-15);
            assert!((refraction.direction.length() - 1.0).abs() < 1e-15);
            let back = refract(-refraction.direction, normal, 1.5, 1.0).unwrap();
            assert!((back.direction + direction).length() < 1e-14);
            assert!((back.transmittance() - refraction.transmittance()).abs() < 1e-15);
        }
    }

    #[test]
    fn normal_incidence_transmits_the_textbook_fraction() {
        let refraction = refract(DVec3::NEG_Z, DVec3::Z, 1.0, 1.5).unwrap();
        assert!((refraction.transmittance() - 0.96).abs() < 1e-15);
        assert_eq!(refraction.direction, DVec3::NEG_Z);
    }

    #[test]
    fn beyond_the_critical_angle_nothing_is_refracted() {
        let direction = DVec3::new(0.7, 0.0, -0.714).normalize();
        assert_eq!(refract(direction, DVec3::Z, 1.5, 1.0), None);
    }

    #[test]
    fn transmittance_vanishes_at_grazing_incidence_and_never_exceeds_one() {
        for step in 0..=1000 {
            let cos_in = f64::from(step) / 1000.0;
            let transmittance = fresnel(cos_in, 1.5).transmittance();
            assert!((0.0..=0.960_000_001).contains(&transmittance), "{cos_in} {transmittance}");
        }
        assert!(fresnel(0.0, 1.5).transmittance().abs() < 1e-15);
    }
}
