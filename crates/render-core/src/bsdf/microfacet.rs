//! The GGX distribution of microfacets, with Smith's masking and shadowing.
//!
//! A rough surface is a height field of small mirrors, the microfacets. Vectors here are in the frame of the surface,
//! whose normal is z, and point away from it. `alpha` is the width of the distribution of slopes.
//!
//! - D, and G of one direction: Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces".
//! - G of two directions, correlated by height: Heitz 2014, "Understanding the Masking-Shadowing Function in
//!   Microfacet-Based BRDFs".
//! - Sampling: Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with Spherical Caps".

use std::f64::consts::{FRAC_1_PI, PI};

use glam::{DVec2, DVec3};

/// Below this width a surface scatters into single directions.
pub(super) const MIN_ALPHA: f64 = 1e-3;

/// A distribution of microfacets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ggx {
    /// The width of the distribution of slopes, up to 1.
    pub(super) alpha: f64,
}

impl Ggx {
    /// D: area of the facets around the normal `facet`, for each area of the surface and solid angle of normals.
    pub(super) fn distribution(self, facet: DVec3) -> f64 {
        let alpha_squared = self.alpha * self.alpha;
        // From the tangential components, which keep their digits near the pole.
        let spread = facet.x * facet.x + facet.y * facet.y + alpha_squared * facet.z * facet.z;
        alpha_squared * FRAC_1_PI / (spread * spread)
    }

    /// G1: the part of the facets that a direction sees, among those that face it.
    pub(super) fn masking(self, direction: DVec3) -> f64 {
        direction.z.abs() * self.masking_over_cosine(direction)
    }

    /// G1 over the cosine of the direction, which is finite along the surface too.
    pub(super) fn masking_over_cosine(self, direction: DVec3) -> f64 {
        2.0 / (direction.z.abs() + self.root(direction))
    }

    /// G2 over four cosines: the part of the facets that both directions see, both in front of the surface, over
    /// `4 cos(view) cos(light)`.
    pub(super) fn visibility(self, view: DVec3, light: DVec3) -> f64 {
        0.5 / (light.z * self.root(view) + view.z * self.root(light))
    }

    /// The cosine of a direction times `1 + 2 Lambda`, where `Lambda` is Smith's function.
    fn root(self, direction: DVec3) -> f64 {
        let sine_squared = direction.x * direction.x + direction.y * direction.y;
        (self.alpha * self.alpha * sine_squared + direction.z * direction.z).sqrt()
    }

    /// Draws a facet from those that a direction in front of the surface sees, in proportion to how large it sees them.
    pub(super) fn sample_visible(self, view: DVec3, random: DVec2) -> DVec3 {
        // Stretched by alpha, the facets are those of a hemisphere. The mirror directions of what the view sees of a
        // hemisphere fill a spherical cap evenly.
        let stretched = DVec3::new(self.alpha * view.x, self.alpha * view.y, view.z).normalize();
        let z = (1.0 - random.x) * (1.0 + stretched.z) - stretched.z;
        let radius = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = libm::sincos(2.0 * PI * random.y);
        let half = DVec3::new(radius * cos, radius * sin, z) + stretched;
        DVec3::new(self.alpha * half.x, self.alpha * half.y, half.z).normalize()
    }

    /// Density of [`Self::sample_visible`] per solid angle of normals.
    pub(super) fn visible_density(self, view: DVec3, facet: DVec3) -> f64 {
        self.distribution(facet) * self.masking_over_cosine(view) * view.dot(facet).max(0.0)
    }
}
