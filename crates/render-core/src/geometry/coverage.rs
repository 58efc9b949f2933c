//! Surfaces that are only partly there: leaves cut out of a picture, veils.
//!
//! A surface of opacity a is met by the part a of all rays. A hash decides whether a ray meets a triangle: of the bits
//! of its origin and direction, and of the triangle's number. So no random number is drawn during traversal, and its
//! order does not matter. The same ray always meets the same things. Rays that differ in the last bit are independent.
//!
//! A search that traces rays again and again to find one path must not decide again for each of them. It looks at what
//! is [solid](super::accelerator::Solid) alone, and asks once for the path that it has found.

use std::fmt;

use super::Ray;
use crate::math::hash::mix;

/// How much of the triangles of a scene is there.
pub trait Coverage: fmt::Debug + Send + Sync {
    /// The part of the surface that is there at a point of a triangle, 0 to 1. The weights of its second and third
    /// corner are `barycentric`.
    fn opacity(&self, triangle: u32, barycentric: [f64; 2]) -> f64;
}

/// Which parts of surfaces a ray may meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Parts {
    /// What is there for this ray.
    Drawn,
    /// What is there for all rays.
    Solid,
    /// What is there for this ray, but not for all.
    Veils,
}

impl Parts {
    /// Whether a ray meets a triangle at a place of this opacity.
    pub(super) fn is_met(self, opacity: f64, ray: &Ray, triangle: u32) -> bool {
        if opacity >= 1.0 {
            return self != Self::Veils;
        }
        self != Self::Solid && opacity > 0.0 && chance(ray, triangle) < opacity
    }
}

/// A number in [0, 1) for a ray and a triangle.
fn chance(ray: &Ray, triangle: u32) -> f64 {
    let words = ray.origin.to_array().into_iter().chain(ray.direction.to_array()).map(f64::to_bits);
    let state = words.chain([u64::from(triangle)]).fold(0, |state, word| mix(state ^ word));
    (state >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// The part of some rays that meet a triangle of this opacity.
    fn part(opacity: f64, rays: impl Iterator<Item = (Ray, u32)>) -> f64 {
        let met: Vec<bool> = rays.map(|(ray, triangle)| Parts::Drawn.is_met(opacity, &ray, triangle)).collect();
        met.iter().filter(|met| **met).count() as f64 / met.len() as f64
    }

    #[test]
    fn the_part_of_rays_that_meet_a_surface_is_its_opacity() {
        let count = 100_000;
        let last_bits = |bits: u64| f64::from_bits(1.0f64.to_bits() + bits);
        for opacity in [0.0, 0.1, 0.5, 0.9, 1.0] {
            let error = (opacity * (1.0 - opacity) / count as f64).sqrt();
            // Rays that differ by little from each other, each in another way.
            let from = |bits| (Ray::new(DVec3::new(last_bits(bits), 0.0, 0.0), DVec3::Z), 0);
            let towards = |bits| (Ray::new(DVec3::ZERO, DVec3::new(0.6, 0.0, last_bits(bits))), 7);
            let at = |bits| (Ray::new(DVec3::ZERO, DVec3::Z), bits as u32);
            let parts = [part(opacity, (0..count).map(from)), part(opacity, (0..count).map(towards))];
            for part in parts.into_iter().chain([part(opacity, (0..count).map(at))]) {
                assert!((part - opacity).abs() <= 4.0 * error, "{part}, not {opacity} +- {error}");
            }
        }
    }

    #[test]
    fn a_triangle_is_solid_or_a_veil_and_one_of_both_when_met() {
        for opacity in [0.0, 0.3, 1.0] {
            for triangle in 0..100 {
                let ray = Ray::new(DVec3::X, DVec3::Z);
                let [drawn, solid, veil] =
                    [Parts::Drawn, Parts::Solid, Parts::Veils].map(|parts| parts.is_met(opacity, &ray, triangle));
                assert_eq!(drawn, solid != veil, "opacity {opacity}");
                assert_eq!(solid, opacity == 1.0);
            }
        }
    }
}
