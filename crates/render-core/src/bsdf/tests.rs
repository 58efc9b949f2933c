//! Laws of boundaries, and of sampling.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use clerestory_film::{SampleStream, SamplerSettings};

use super::dielectric::Dielectric;
use super::mirror::Mirror;
use super::*;

const FLAT: Normals = Normals { geometric: DVec3::Z, shading: DVec3::Z };
const WATER: Dielectric = Dielectric { index_of_refraction: 1.33 };

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
    let mirror = Mirror { reflectance: DVec3::splat(0.9) };
    // Reflected at the interpolated normal, this ray would go on below the triangle.
    assert_eq!(mirror.reflect(DVec3::new(0.3, 0.0, -0.95).normalize(), &bent), None);
    assert_eq!(mirror.transmit(DVec3::NEG_Z, &FLAT), None);
    assert_eq!(mirror.reflect(DVec3::NEG_Z, &FLAT), Some((DVec3::Z, DVec3::splat(0.9))));
    // Seen from the side of one normal and not of the other.
    assert_eq!(WATER.transmit(DVec3::new(0.6, 0.0, -0.3).normalize(), &bent), None);
}

/// Materials that scatter into a solid angle, with that of docs/extending.md, read as scene files are.
fn scattering() -> Vec<Arc<dyn Bsdf>> {
    let bitmaps = BTreeMap::new();
    let diffuse = serde_json::json!({"diffuse": {"reflectance": {"colour": [0.6, 0.5, 0.4]}}});
    let diffuse: MaterialDescription = serde_json::from_value(diffuse).unwrap();
    let example = serde_json::json!({"albedo": [0.8, 0.7, 0.6]});
    let example: example::ParchmentMaterial = serde_json::from_value(example).unwrap();
    assert!(example.check(&JsonPath::Root).is_ok());
    vec![diffuse.build(&bitmaps), example.build(&bitmaps)]
}

#[test]
fn directions_are_drawn_with_the_stated_density_and_scatter_the_albedo() {
    const DIRECTIONS: u32 = 4096;
    let settings = SamplerSettings { seed: 3, samples_per_block: DIRECTIONS };
    let normal = DVec3::new(0.2, -0.3, 0.9).normalize();
    let at = SurfacePoint { normals: Normals { geometric: normal, shading: normal }, texture: DVec2::ZERO };
    let incident = DVec3::new(0.3, 0.5, -1.0).normalize();
    for bsdf in scattering() {
        assert!(!bsdf.is_delta());
        let mut drawn = DVec3::ZERO;
        // By the density of a uniform sphere, the same light: whether the density integrates to 1 as well.
        let (mut uniform, mut density, mut behind) = (DVec3::ZERO, 0.0, 0);
        for index in 0..DIRECTIONS {
            let mut stream = SampleStream::new(&settings, 0, [0, 0], index);
            let sample = bsdf.sample(&at, incident, &mut stream).unwrap();
            let SampleKind::Density(pdf) = sample.kind else { panic!("{bsdf:?} scatters into single directions") };
            assert!((pdf / bsdf.pdf(&at, incident, sample.direction) - 1.0).abs() < 1e-9, "{bsdf:?}");
            let value = bsdf.scale(&at) * bsdf.eval(&at, incident, sample.direction);
            assert!((value / pdf - sample.weight).length() < 1e-9, "{bsdf:?}");
            drawn += sample.weight / f64::from(DIRECTIONS);
            behind += u32::from(sample.direction.dot(at.normals.facing(incident)) < 0.0);
            let [z, turn] = stream.next_2d().to_array();
            let z = 2.0 * z - 1.0;
            let (sin, cos) = libm::sincos(2.0 * PI * turn);
            let direction = DVec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z);
            let share = 4.0 * PI / f64::from(DIRECTIONS);
            uniform += bsdf.scale(&at) * bsdf.eval(&at, incident, direction) * share;
            density += bsdf.pdf(&at, incident, direction) * share;
        }
        assert!((drawn - bsdf.albedo(&at)).length() < 1e-9, "{bsdf:?}: {drawn}");
        assert!((uniform - drawn).length() < 0.01 && (density - 1.0).abs() < 0.01, "{bsdf:?}: {uniform}, {density}");
        assert_eq!(behind > 0, bsdf.transmits(), "{bsdf:?}");
    }
}
