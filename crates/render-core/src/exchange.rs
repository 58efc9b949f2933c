//! What things are in words that other programs know.
//!
//! A material, a light or a camera describes itself by one of these models ([`MaterialSettings::model`],
//! [`LightSettings::model`], [`CameraDescription::model`]). What writes files for other programs knows the models, and
//! none of the kinds of things. A kind that no model describes cannot be exported.
//!
//! [`MaterialSettings::model`]: crate::bsdf::MaterialSettings::model
//! [`LightSettings::model`]: crate::light::LightSettings::model
//! [`CameraDescription::model`]: crate::scene::description::CameraDescription::model

use std::sync::Arc;

use glam::DVec3;
use serde::Serialize;

use crate::settings::Triple;
use crate::texture::{Bitmap, Colour};

/// A colour over a surface; pictures are whatever `P` is.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ColourModel<P = Arc<Bitmap>> {
    /// The same everywhere, linear Rec. 709.
    Colour(Triple),
    /// A picture that is repeated without end and filtered bilinearly.
    Texture(P),
}

/// How a surface scatters light.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SurfaceModel<P = Arc<Bitmap>> {
    /// Lambertian reflection on both sides.
    Diffuse {
        /// Fraction of light reflected.
        reflectance: ColourModel<P>,
    },
    /// Specular reflection on both sides, alike from all directions.
    Mirror {
        /// Fraction of light reflected.
        reflectance: Triple,
    },
    /// A smooth boundary between air, on the side to which normals point, and a clear dielectric.
    Dielectric {
        /// Index of refraction behind the surface.
        index_of_refraction: f64,
    },
}

/// A light that is nothing but a light: it reflects nothing.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LightModel {
    /// A point that shines equally in all directions.
    Point {
        /// Where it is.
        position: Triple,
        /// Radiant intensity, W/sr.
        intensity: Triple,
    },
    /// A sphere that shines outwards.
    Sphere {
        /// Its centre.
        centre: Triple,
        /// Its radius, metres.
        radius: f64,
        /// Emitted radiance, W/(m2 sr).
        radiance: Triple,
    },
    /// A rectangle that shines to the side to which `edge_u` cross `edge_v` points.
    Rectangle {
        /// Its centre.
        centre: Triple,
        /// One edge, metres.
        edge_u: Triple,
        /// The other edge, metres, perpendicular to `edge_u`.
        edge_v: Triple,
        /// Emitted radiance, W/(m2 sr).
        radiance: Triple,
    },
    /// A disk that shines to the side to which `normal` points.
    Disk {
        /// Its centre.
        centre: Triple,
        /// Unit vector perpendicular to it.
        normal: Triple,
        /// Its radius, metres.
        radius: f64,
        /// Emitted radiance, W/(m2 sr).
        radiance: Triple,
    },
    /// A disc at infinity.
    Distant {
        /// Unit vector from the scene towards its middle.
        direction: Triple,
        /// Half the angle under which it is seen, degrees.
        angular_radius: f64,
        /// Emitted radiance, W/(m2 sr).
        radiance: Triple,
    },
}

/// A camera with square pixels; row 0 is the top of the picture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CameraModel {
    /// The pinhole, or a point on the plane from which parallel rays start.
    pub position: Triple,
    /// A point in the middle of the picture.
    pub look_at: Triple,
    /// A direction that points up in the picture.
    pub up: Triple,
    /// How rays go through the picture.
    #[serde(flatten)]
    pub projection: ProjectionModel,
}

/// How the rays of a camera go through the picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ProjectionModel {
    /// Through one point.
    Perspective {
        /// Angle between the top and the bottom of the picture, degrees.
        vertical_field_of_view: f64,
    },
    /// In parallel.
    Orthographic {
        /// Height of the picture in the scene, metres.
        height: f64,
    },
}

impl ColourModel {
    /// The model of a colour; `None` for a picture that is not looked up as it is.
    pub(crate) fn of(colour: Colour) -> Option<Self> {
        match colour {
            Colour::Uniform(colour) => Some(Self::Colour(colour.to_array())),
            Colour::Textured(picture) => picture.unchanged().map(Self::Texture),
        }
    }
}

impl<P> SurfaceModel<P> {
    /// The model with other pictures.
    ///
    /// # Errors
    ///
    /// The first error of `other`.
    pub fn try_map_pictures<Q, E>(self, mut other: impl FnMut(P) -> Result<Q, E>) -> Result<SurfaceModel<Q>, E> {
        let mut colour = |colour| {
            Ok(match colour {
                ColourModel::Texture(picture) => ColourModel::Texture(other(picture)?),
                ColourModel::Colour(colour) => ColourModel::Colour(colour),
            })
        };
        Ok(match self {
            Self::Diffuse { reflectance } => SurfaceModel::Diffuse { reflectance: colour(reflectance)? },
            Self::Mirror { reflectance } => SurfaceModel::Mirror { reflectance },
            Self::Dielectric { index_of_refraction } => SurfaceModel::Dielectric { index_of_refraction },
        })
    }
}

impl LightModel {
    /// The same light with its place seen from another origin.
    #[must_use]
    pub fn seen_from(mut self, origin: DVec3) -> Self {
        match &mut self {
            Self::Point { position: place, .. }
            | Self::Sphere { centre: place, .. }
            | Self::Rectangle { centre: place, .. }
            | Self::Disk { centre: place, .. } => *place = (DVec3::from(*place) - origin).to_array(),
            Self::Distant { .. } => {}
        }
        self
    }
}

impl CameraModel {
    /// The same camera with its place seen from another origin.
    #[must_use]
    pub fn seen_from(mut self, origin: DVec3) -> Self {
        for place in [&mut self.position, &mut self.look_at] {
            *place = (DVec3::from(*place) - origin).to_array();
        }
        self
    }
}
