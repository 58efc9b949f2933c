//! Laws of smooth boundaries.

use super::dielectric::Dielectric;
use super::mirror::Mirror;
use super::*;

/// A point of a surface with these normals.
fn at(normals: Normals) -> SurfacePoint {
    SurfacePoint { normals, texture: TextureCoordinates::default(), colour: DVec3::ONE }
}

const FLAT: Normals = Normals { geometric: DVec3::Z, shading: DVec3::Z };
const WATER: Dielectric = Dielectric { index_of_refraction: 1.33, absorption: DVec3::ZERO, priority: 0 };

#[test]
fn power_is_conserved_and_radiance_grows_with_the_square_of_the_index() {
    for direction in [DVec3::new(0.4, 0.1, -1.0), DVec3::new(-0.3, 0.2, 1.0)] {
        let direction = direction.normalize();
        let crossing = WATER.transmit(direction, &FLAT).unwrap();
        let mirrored = WATER.reflect(direction, &at(FLAT)).unwrap();
        let parts = crossing.fresnel.transmittance() + mirrored.fresnel.reflectance();
        assert!((parts - 1.0).abs() < 1e-15 && mirrored.colour == DVec3::ONE);
        assert_eq!(mirrored.direction, direction * DVec3::new(1.0, 1.0, -1.0));
        let entering = direction.z < 0.0;
        assert_eq!(crossing.ratio, if entering { 1.33 } else { 1.0 / 1.33 });
        let there = WATER.transmit(crossing.direction, &FLAT);
        assert!(there.is_none_or(|there| (there.direction.z < 0.0) == entering));
        // Into the water and out again, the squares cancel.
        let out = WATER.transmit(-crossing.direction, &FLAT).unwrap();
        let parts = [crossing, out].map(|crossing| crossing.fresnel.transmittance());
        let both = crossing.radiance_factor(parts[0]) * out.radiance_factor(parts[1]);
        assert!((both - parts[0] * parts[1]).abs() < 1e-15);
    }
}

#[test]
fn beyond_the_critical_angle_all_light_is_reflected() {
    let direction = DVec3::new(0.9, 0.0, 0.3).normalize();
    assert_eq!(WATER.transmit(direction, &FLAT), None);
    let mirrored = WATER.reflect(direction, &at(FLAT)).unwrap();
    assert_eq!((mirrored.colour, mirrored.fresnel.reflectance()), (DVec3::ONE, 1.0));
}

#[test]
fn rays_never_end_up_on_the_wrong_side() {
    let bent = Normals { geometric: DVec3::Z, shading: DVec3::new(0.9, 0.0, 0.5).normalize() };
    let mirror = Mirror { reflectance: DVec3::splat(0.9) };
    // Reflected at the interpolated normal, this ray would go on below the triangle.
    assert_eq!(mirror.reflect(DVec3::new(0.3, 0.0, -0.95).normalize(), &at(bent)), None);
    assert_eq!(mirror.transmit(DVec3::NEG_Z, &FLAT), None);
    let straight = Mirrored { direction: DVec3::Z, colour: DVec3::splat(0.9), fresnel: Fresnel::MIRROR };
    assert_eq!(mirror.reflect(DVec3::NEG_Z, &at(FLAT)), Some(straight));
    // Seen from the side of one normal and not of the other.
    assert_eq!(WATER.transmit(DVec3::new(0.6, 0.0, -0.3).normalize(), &bent), None);
}
