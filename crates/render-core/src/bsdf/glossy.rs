//! Reflection by a rough metal, by a coat on a matt base, or by a mixture of both: the core model of glTF.
//!
//! With V, L and H the directions to the viewer and the light and the normal of the facet between them:
//!
//! ```text
//! metal = D G2 F(c) / (4 cos V cos L) + multiple(c)
//! coat  = D G2 F(f0) / (4 cos V cos L) + multiple(f0)
//! base  = c / pi ((1 - s) + s (1 - C(V)) (1 - C(L)) / (1 - C_avg))
//! through = c (1 - s F(f0)) D G2 / (4 cos V cos L') + c (1 - s F_ms) (1 - E(V)) (1 - E(L')) / (pi (1 - E_avg))
//! all   = m metal + (1 - m) (s coat + (1 - t) base + t through)
//! ```
//!
//! A part t of what the coat leaves goes through a wall without a thickness, as `KHR_materials_transmission` says. It
//! leaves in the mirror image L' of a direction of reflection.
//!
//! Here c is the colour, m how metallic it is, and s the strength of the coat. F is Schlick's Fresnel term, and C the
//! albedo of the coat. The base is scaled as `KHR_materials_specular` says: so a white base and its coat reflect all
//! light together. `multiple` is the light that leaves after several facets (Kulla and Conty 2017):
//!
//! ```text
//! multiple(f0) = F_ms (1 - E(V)) (1 - E(L)) / (pi (1 - E_avg))
//! F_ms = F_avg^2 E_avg / (1 - F_avg (1 - E_avg)),  F_avg = f0 + (1 - f0) / 21
//! ```
//!
//! Directions are drawn from the visible facets, or by the cosine for base and multiple scattering. The choice between
//! the two is by their albedos.

use std::f64::consts::{FRAC_1_PI, PI};

use clerestory_film::SampleStream;
use glam::DVec3;

use super::albedo_table::{Albedo, AlbedoRow};
use super::fresnel::{reflect, schlick_weight};
use super::microfacet::Ggx;
use super::shading_frame::ShadingFrame;
use super::{BsdfSample, SampleKind, SurfacePoint};

/// Below this the part of light that several facets scatter is lost in rounding.
const NEGLIGIBLE: f64 = 1e-7;

/// A rough surface at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Glossy {
    /// Reflectance of the metal along its normal, and of the base.
    pub(super) colour: DVec3,
    /// The part that is metal, 0 to 1.
    pub(super) metallic: f64,
    /// Reflectance of the coat along its normal, 0 to 1.
    pub(super) coat: DVec3,
    /// The strength of the coat, 0 to 1.
    pub(super) coat_strength: f64,
    /// The part of what the coat leaves that goes through, 0 to 1.
    pub(super) transmission: f64,
    /// The microfacets of metal and coat.
    pub(super) facets: Ggx,
    /// Whether light fades out before the terminator of the triangles.
    pub(super) soft_terminator: bool,
}

/// A rough surface as a path sees it.
struct SeenGlossy<'a> {
    surface: &'a Glossy,
    frame: ShadingFrame,
    albedos: AlbedoRow,
    /// The albedo of the microfacets for the view.
    view: Albedo,
    /// What the coat leaves to the base for the view, over what it leaves on average. Zero where that is nothing.
    base_of_view: f64,
    /// The probabilities with which a visible facet is drawn to reflect, and to transmit; and those of directions by
    /// their cosines, on this side and on the other.
    shares: Shares,
    /// Whether anything is reflected.
    is_black: bool,
}

/// The probabilities of lobes.
struct Shares {
    mirrored: f64,
    spread: f64,
    mirrored_through: f64,
    spread_through: f64,
}

impl Glossy {
    /// The fraction of light that is scattered, averaged over all directions.
    pub(super) fn albedo(&self) -> DVec3 {
        let average = AlbedoRow::new(self.facets.alpha).average;
        let [metal, coat] = [self.colour, self.coat].map(|f0| reflected(f0, average, average));
        let base = self.colour * self.base(1.0 - coat.max_element());
        metal * self.metallic + (coat * self.coat_strength + base) * (1.0 - self.metallic)
    }

    /// BSDF times cosine.
    pub(super) fn eval(&self, at: &SurfacePoint, incident: DVec3, outgoing: DVec3) -> DVec3 {
        self.seen(at, incident).eval(outgoing)
    }

    /// Density per solid angle of [`Self::sample`].
    pub(super) fn pdf(&self, at: &SurfacePoint, incident: DVec3, outgoing: DVec3) -> f64 {
        self.seen(at, incident).pdf(outgoing)
    }

    /// Draws a direction; `None` where it would go into the surface.
    pub(super) fn sample(&self, at: &SurfacePoint, incident: DVec3, stream: &mut SampleStream) -> Option<BsdfSample> {
        self.seen(at, incident).sample(stream)
    }

    fn seen(&self, at: &SurfacePoint, incident: DVec3) -> SeenGlossy<'_> {
        let frame = ShadingFrame::new(at, incident);
        let albedos = AlbedoRow::new(self.facets.alpha);
        let view = albedos.at(frame.view.z);
        let left_on_average = 1.0 - self.coat_albedo(albedos.average, albedos.average);
        let base_of_view = if left_on_average > NEGLIGIBLE {
            (1.0 - self.coat_albedo(view, albedos.average)) / left_on_average
        } else {
            0.0
        };
        let [metal, coat] = [self.colour, self.coat].map(|f0| {
            let several = multiple(f0, albedos.average) * (1.0 - view.total);
            [once(f0, view), several].map(DVec3::element_sum)
        });
        let base = self.colour.element_sum() * self.base(base_of_view * left_on_average);
        let mix = |metal: f64, coat: f64| metal * self.metallic + coat * (1.0 - self.metallic);
        let mirrored = mix(metal[0], self.coat_strength * coat[0]);
        let spread = mix(metal[1], self.coat_strength * coat[1] + base * (1.0 - self.transmission));
        let through = self.colour.element_sum() * self.transmission * (1.0 - self.metallic);
        let [once, several] = self.through(view, albedos.average);
        let (mirrored_through, spread_through) = (through * once, through * several);
        let sum = mirrored + spread + mirrored_through + spread_through;
        let share = |weight: f64| if sum > 0.0 { weight / sum } else { 0.0 };
        let shares = Shares {
            mirrored: share(mirrored),
            spread: share(spread),
            mirrored_through: share(mirrored_through),
            spread_through: share(spread_through),
        };
        SeenGlossy { surface: self, frame, albedos, view, base_of_view, shares, is_black: sum <= 0.0 }
    }

    /// What single facets transmit, and several, of white light from one direction.
    fn through(&self, view: Albedo, average: Albedo) -> [f64; 2] {
        let coat = DVec3::splat(self.coat.max_element());
        let several = (1.0 - self.coat_strength * multiple(coat, average).x) * (1.0 - view.total);
        [view.total - self.coat_strength * once(coat, view).x, several]
    }

    /// C: what a coat of full strength reflects, in the channel where that is most.
    fn coat_albedo(&self, albedo: Albedo, average: Albedo) -> f64 {
        reflected(DVec3::splat(self.coat.max_element()), albedo, average).x
    }

    /// The reflectance of a white base, of which the coat leaves a part.
    fn base(&self, left: f64) -> f64 {
        (1.0 - self.coat_strength) + self.coat_strength * left
    }
}

/// The part of light that single facets reflect whose reflectance along the normal is `f0`.
fn once(f0: DVec3, albedo: Albedo) -> DVec3 {
    f0 * (albedo.total - albedo.grazing) + albedo.grazing
}

/// `F_ms`: the part that leaves of the light that is reflected by several facets, each with the reflectance `f0` along
/// its normal.
fn multiple(f0: DVec3, average: Albedo) -> DVec3 {
    let fresnel = f0 + (1.0 - f0) / 21.0;
    fresnel * fresnel * average.total / (1.0 - fresnel * (1.0 - average.total))
}

/// The part of light that one facet or several reflect.
fn reflected(f0: DVec3, albedo: Albedo, average: Albedo) -> DVec3 {
    once(f0, albedo) + multiple(f0, average) * (1.0 - albedo.total)
}

impl SeenGlossy<'_> {
    fn eval(&self, outgoing: DVec3) -> DVec3 {
        let Some(light) = self.frame.reflected(outgoing) else { return self.through(outgoing) };
        let Glossy { colour, metallic, coat, coat_strength, transmission, facets, soft_terminator } = *self.surface;
        let average = self.albedos.average;
        let half = (self.frame.view + light).normalize();
        let weight = schlick_weight(self.frame.view.dot(half));
        let fresnel = |f0: DVec3| f0 + (1.0 - f0) * weight;
        let mix = |metal: DVec3, coat: DVec3| metal * metallic + coat * (1.0 - metallic);

        let mirrored = facets.distribution(half) * facets.visibility(self.frame.view, light);
        let once = mix(fresnel(colour), fresnel(coat) * coat_strength) * mirrored;

        let of_light = self.albedos.at(light.z);
        let several = mix(multiple(colour, average), multiple(coat, average) * coat_strength) * self.several(of_light);
        let left = self.base_of_view * (1.0 - self.surface.coat_albedo(of_light, average));
        let base = colour * (self.surface.base(left) * (1.0 - transmission) * (1.0 - metallic));
        let sum = (once + (several + base) * FRAC_1_PI) * light.z;
        if soft_terminator { sum * self.frame.terminator(outgoing) } else { sum }
    }

    /// Light that goes through, to the other side.
    fn through(&self, outgoing: DVec3) -> DVec3 {
        let Glossy { colour, metallic, coat, coat_strength, transmission, facets, .. } = *self.surface;
        let Some(light) = self.mirror_image(outgoing) else { return DVec3::ZERO };
        let coat = DVec3::splat(coat.max_element());
        let half = (self.frame.view + light).normalize();
        let fresnel = coat + (1.0 - coat) * schlick_weight(self.frame.view.dot(half));
        let once =
            (1.0 - coat_strength * fresnel.x) * facets.distribution(half) * facets.visibility(self.frame.view, light);
        let several = (1.0 - coat_strength * multiple(coat, self.albedos.average).x)
            * self.several(self.albedos.at(light.z))
            * FRAC_1_PI;
        colour * (transmission * (1.0 - metallic) * (once + several) * light.z)
    }

    /// The direction of reflection, in the frame, of which a direction through the surface is the mirror image; `None`
    /// where nothing goes through.
    fn mirror_image(&self, outgoing: DVec3) -> Option<DVec3> {
        let light = self.frame.transmitted(outgoing).filter(|_| self.surface.transmission > 0.0)?;
        Some(DVec3::new(light.x, light.y, -light.z))
    }

    /// `pi` times the lobe of light that several facets scatter without a loss.
    fn several(&self, of_light: Albedo) -> f64 {
        let lost = 1.0 - self.albedos.average.total;
        if lost > NEGLIGIBLE { (1.0 - self.view.total) * (1.0 - of_light.total) / lost } else { 0.0 }
    }

    fn pdf(&self, outgoing: DVec3) -> f64 {
        if self.is_black {
            return 0.0;
        }
        let Shares { mirrored, spread, mirrored_through, spread_through } = self.shares;
        let (light, [facet_share, share]) = match (self.frame.reflected(outgoing), self.mirror_image(outgoing)) {
            (Some(light), _) => (light, [mirrored, spread]),
            (None, Some(light)) => (light, [mirrored_through, spread_through]),
            (None, None) => return 0.0,
        };
        let (view, facets) = (self.frame.view, self.surface.facets);
        let half = (view + light).normalize();
        // The density of normals over 4 cos(V, H), where the cosine cancels.
        let density = facets.distribution(half) * facets.masking_over_cosine(view) * 0.25;
        facet_share * density + share * light.z * FRAC_1_PI
    }

    fn sample(&self, stream: &mut SampleStream) -> Option<BsdfSample> {
        let (choice, random) = (stream.next_1d(), stream.next_2d());
        let Shares { mirrored, spread, mirrored_through, .. } = self.shares;
        let of_facet = || {
            let view = self.frame.view;
            -reflect(view, self.surface.facets.sample_visible(view, random))
        };
        let by_cosine = || {
            let (sin, cos) = libm::sincos(2.0 * PI * random.y);
            DVec3::new(random.x.sqrt() * cos, random.x.sqrt() * sin, (1.0 - random.x).sqrt())
        };
        let is_reflected = choice < mirrored + spread || self.surface.transmission == 0.0;
        let is_of_facet = choice < mirrored || !is_reflected && choice < mirrored + spread + mirrored_through;
        let mut local = if is_of_facet { of_facet() } else { by_cosine() };
        // A tilted facet may mirror light to the other side. The model leaves it out.
        if local.z <= 0.0 {
            return None;
        }
        if !is_reflected {
            local.z = -local.z;
        }
        let direction = self.frame.vector_to_world(local).normalize();
        let density = self.pdf(direction);
        (density > 0.0).then(|| BsdfSample {
            direction,
            weight: self.eval(direction) / density,
            kind: SampleKind::Density(density),
        })
    }
}
