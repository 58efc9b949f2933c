//! What a light does: where it is, how it is sampled, where rays meet it.

use std::fmt;
use std::ops::Range;

use glam::{DVec2, DVec3};

use super::{EmissionCone, Receiver};
use crate::geometry::{Frame, Ray};

/// Where light comes from: a point, or a direction for a light at infinity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Source {
    /// A point, metres.
    Point(DVec3),
    /// A unit vector towards a light at infinity.
    Direction(DVec3),
}

impl Source {
    /// The same, in the coordinates of a frame.
    pub fn in_frame(self, frame: &Frame) -> Self {
        match self {
            Self::Point(position) => Self::Point(frame.point_to_local(position)),
            Self::Direction(direction) => Self::Direction(frame.vector_to_local(direction)),
        }
    }
}

/// A point of a light, drawn at random.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SourceSample {
    /// Where the light comes from.
    pub source: Source,
    /// Unit normal of the light's surface; `None` for a point light and lights at infinity.
    pub normal: Option<DVec3>,
    /// The triangle of the scene on which it lies, and which shines to both sides; `None` for lights that are no
    /// surfaces of the scene.
    pub triangle: Option<u32>,
    /// Largest intensity of a point light [W/sr], else radiance [W/(m2 sr)], divided by the probability density: per
    /// area for surfaces, per solid angle for lights at infinity, 1 for a point light.
    pub weight: DVec3,
}

impl SourceSample {
    /// The cosine at which light leaves the surface against `direction`, a unit vector towards the light; 1 for lights
    /// without a surface.
    pub fn cosine(&self, direction: DVec3) -> f64 {
        let cosine = self.normal.map_or(1.0, |normal| -normal.dot(direction));
        if self.triangle.is_some() { cosine.abs() } else { cosine }
    }
}

/// A direction from a shading point straight to a light, drawn at random.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LiSample {
    /// Unit vector from the shading point to the light.
    pub direction: DVec3,
    /// Distance to the light; infinite for lights at infinity.
    pub distance: f64,
    /// Radiance times solid angle [W/m2]: radiance / pdf, or intensity / distance squared for a point light.
    pub weight: DVec3,
    /// Density per solid angle; `None` for a point light, which nothing else can find.
    pub pdf: Option<f64>,
}

/// Light that leaves a light, drawn at random.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emission {
    /// Along which it leaves.
    pub ray: Ray,
    /// Radiance [W/(m2 sr)]; intensity of a point light [W/sr].
    pub radiance: DVec3,
    /// Density of the ray for each unit of area and of solid angle, over the cosine at which it leaves; of solid angle
    /// alone for a point light.
    pub density: f64,
}

/// Where a ray meets a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightHit {
    /// Distance along the ray; infinite for lights at infinity.
    pub distance: f64,
    /// Radiance towards the ray's origin (`le`); zero on the dark side of a rectangle or a disk.
    pub radiance: DVec3,
    /// The triangle of the scene that is met, where the light is made of such.
    pub triangle: Option<u32>,
}

/// A region that holds all of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightBounds {
    /// A ball; a point light has radius 0.
    Ball {
        /// Its centre, metres.
        centre: DVec3,
        /// Its radius, metres.
        radius: f64,
    },
    /// Directions around one.
    Cap {
        /// Unit vector towards the middle.
        direction: DVec3,
        /// Sine of the angular radius.
        sin_radius: f64,
    },
    /// All directions.
    Everywhere,
}

/// The shape of a light that is somewhere.
#[derive(Clone, Debug, PartialEq)]
pub enum Body {
    /// A ball; a point has radius 0.
    Ball {
        /// Its centre, metres.
        centre: DVec3,
        /// Its radius, metres.
        radius: f64,
    },
    /// A flat convex polygon with these corners, metres.
    Polygon(Vec<DVec3>),
}

/// How a light emits. Units are W, m and sr; colours are linear Rec.709.
pub trait Emitter: fmt::Debug + Send + Sync {
    /// The largest radiance, W/(m2 sr); the largest intensity of a point light, W/sr.
    fn emission(&self) -> DVec3;

    /// Radiated power, W, as the mean over the channels. That of a light at infinity is the integral of its radiance:
    /// for the sun, the power for each square metre that faces it.
    fn power(&self) -> f64;

    /// The directions in which light leaves.
    fn emission_cone(&self) -> EmissionCone;

    /// Whether the light is a point, which no ray can meet.
    fn is_delta(&self) -> bool {
        false
    }

    /// The part of its largest intensity that a point light sends against `direction`, a unit vector towards the light.
    /// 1 for all others.
    fn falloff(&self, _direction: DVec3) -> f64 {
        1.0
    }

    /// Whether the light is an environment: at infinity in all directions. It is behind everything, suns included, and
    /// no sun covers it.
    fn is_environment(&self) -> bool {
        self.bounds() == LightBounds::Everywhere
    }

    /// A region that holds the whole light.
    fn bounds(&self) -> LightBounds;

    /// The smallest and the largest corner of a box that holds the whole light; `None` for a light that is nowhere.
    fn bounding_box(&self) -> Option<[DVec3; 2]> {
        match self.bounds() {
            LightBounds::Ball { centre, radius } => Some([centre - radius, centre + radius]),
            LightBounds::Cap { .. } | LightBounds::Everywhere => None,
        }
    }

    /// Its shape; `None` for a light that is nowhere or a surface of the scene.
    fn body(&self) -> Option<Body>;

    /// The triangles of the scene that shine, where the light is made of such. Rays meet them as surfaces of the scene.
    fn triangles(&self) -> Option<Range<u32>> {
        None
    }

    /// Radiance of a point of one of these triangles. The weights of its second and third corner are `barycentric`.
    fn radiance_at(&self, _triangle: u32, _barycentric: [f64; 2]) -> DVec3 {
        DVec3::ZERO
    }

    /// The largest solid angle at which the light may be seen from a box; `None` for a point light.
    fn largest_solid_angle(&self, bounds: [DVec3; 2]) -> Option<f64>;

    /// Draws a point of the light that may be seen from inside a ball. Every point that can be seen from anywhere in
    /// the ball has a positive density, so that light that arrives there by refraction is not lost at a sphere's limb.
    fn sample_source(&self, centre: DVec3, radius: f64, random: DVec2) -> SourceSample;

    /// Density with which [`Self::sample_source`] draws a source: per area for surfaces, per solid angle for lights at
    /// infinity, infinite for a point light.
    fn source_density(&self, centre: DVec3, radius: f64, source: Source) -> f64;

    /// Draws a ray along which light leaves, about in proportion to the light on it; `None` for lights at infinity and
    /// those that are surfaces of the scene.
    fn emit(&self, _place: DVec2, _direction: DVec2) -> Option<Emission> {
        None
    }

    /// [`Emission::density`] of light that arrives along a ray, which leads to the light; 0 where [`Self::emit`] draws
    /// none.
    fn emission_density(&self, _to_light: &Ray) -> f64 {
        0.0
    }

    /// The source where a ray meets the light, and the cosine of the angle at which it does; 1 for lights at infinity.
    fn source_at(&self, ray: &Ray, hit: &LightHit) -> (Source, f64);

    /// Unit normal of the light's surface at a source where a ray meets it; `None` for a point light and lights at
    /// infinity.
    fn normal_at(&self, source: Source, hit: &LightHit) -> Option<DVec3>;

    /// Draws a direction in which the light is seen from a point if nothing is in the way; `None` when it cannot be.
    fn sample_li(&self, receiver: &Receiver, random: DVec2) -> Option<LiSample>;

    /// Density per solid angle with which [`Self::sample_li`] draws, from the point where a ray begins, the direction
    /// of the ray, which meets the light at `hit`.
    fn pdf_li(&self, receiver: &Receiver, ray: &Ray, hit: &LightHit) -> f64;

    /// Where a ray meets the light from outside; `None` when it misses.
    fn intersect(&self, ray: &Ray) -> Option<LightHit>;

    /// The sample that [`Self::sample_source`] would draw where a ray meets the light.
    fn sample_at(&self, centre: DVec3, radius: f64, ray: &Ray, hit: &LightHit) -> SourceSample {
        let (source, _) = self.source_at(ray, hit);
        let density = self.source_density(centre, radius, source);
        let weight = if density > 0.0 { hit.radiance / density } else { DVec3::ZERO };
        SourceSample { source, normal: self.normal_at(source, hit), triangle: hit.triangle, weight }
    }
}
