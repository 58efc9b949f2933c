//! What things are in words that other programs know.
//!
//! A material, a light or a camera describes itself by one of these models ([`MaterialSettings::model`],
//! [`LightSettings::model`], [`CameraDescription::model`]). What writes files for other programs knows the models, and
//! none of the kinds of things. For a kind that no model describes, it has to find something like it.
//!
//! [`MaterialSettings::model`]: crate::bsdf::MaterialSettings::model
//! [`LightSettings::model`]: crate::light::LightSettings::model
//! [`CameraDescription::model`]: crate::scene::description::CameraDescription::model

use std::sync::Arc;

use glam::DVec3;
use serde::Serialize;

use crate::settings::Triple;
use crate::texture::{Bitmap, Channel, Colour, Filter, MappedPicture, NormalMap, Value, Wrap};

/// What a picture is multiplied by and which of its channels count.
#[derive(Clone, Debug)]
pub struct Texels {
    /// The picture.
    pub bitmap: Arc<Bitmap>,
    /// By what red, green and blue are multiplied.
    pub factor: Triple,
    /// The channel that is a number; `None` for a colour.
    pub channel: Option<Channel>,
    /// From which number on it is 1, and 0 below.
    pub threshold: Option<f64>,
}

/// A picture over a surface; its texels are whatever `P` is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TextureModel<P = Texels> {
    /// The picture.
    pub file: P,
    /// Which texture coordinates of a mesh: 0 or 1.
    pub coordinates: usize,
    /// How it goes on beyond its borders along u and v.
    pub wrap: [Wrap; 2],
    /// How it is seen between its texels.
    pub filter: Filter,
    /// Two rows by which (u, v, 1) is multiplied before the picture is looked up.
    pub transform: [[f64; 3]; 2],
}

/// A colour over a surface.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ColourModel<P = Texels> {
    /// The same everywhere, linear Rec. 709.
    Colour(Triple),
    /// A picture.
    Texture(TextureModel<P>),
}

/// A number over a surface, 0 to 1.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ValueModel<P = Texels> {
    /// The same everywhere.
    Value(f64),
    /// A picture, as its numbers stand in the file.
    Texture(TextureModel<P>),
}

/// How a surface scatters light. The square of a roughness is the width of the distribution of microfacets (GGX).
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SurfaceModel<P = Texels> {
    /// Lambertian reflection on both sides.
    Diffuse {
        /// Fraction of light reflected.
        reflectance: ColourModel<P>,
    },
    /// Lambertian reflection, and Lambertian transmission to the other side, alike from both sides.
    DiffuseTransmission {
        /// Fraction of light scattered back.
        reflectance: ColourModel<P>,
        /// Fraction of light scattered to the other side.
        transmittance: ColourModel<P>,
    },
    /// Specular reflection on both sides, alike from all directions.
    Mirror {
        /// Fraction of light reflected.
        reflectance: Triple,
    },
    /// A metal on both sides, polished below a roughness of 0.03.
    Metal {
        /// Fraction of light reflected along the normal. More is reflected at grazing incidence (Schlick 1994).
        reflectance: ColourModel<P>,
        /// Roughness.
        roughness: ValueModel<P>,
    },
    /// On both sides a mixture of metal, and of a matt base under a clear coat: the core model of glTF.
    Coated {
        /// Colour of metal and base.
        colour: ColourModel<P>,
        /// The part that is metal.
        metallic: ValueModel<P>,
        /// Roughness of metal and coat.
        roughness: ValueModel<P>,
        /// Fraction of light that an uncoloured coat reflects along the normal.
        coat: f64,
        /// By what that is multiplied.
        coat_colour: ColourModel<P>,
        /// Strength of the coat.
        coat_strength: ValueModel<P>,
    },
    /// A smooth boundary between air, on the side to which normals point, and a clear dielectric.
    Dielectric {
        /// Index of refraction behind the surface.
        index_of_refraction: f64,
    },
    /// The same with microfacets.
    RoughDielectric {
        /// Index of refraction behind the surface.
        index_of_refraction: f64,
        /// Roughness.
        roughness: f64,
    },
    /// A clear sheet without a thickness: light goes straight on, or is mirrored by either of two faces.
    ThinSheet {
        /// Index of refraction of the sheet.
        index_of_refraction: f64,
        /// Fraction of the light that enters the sheet and leaves it on the other side.
        tint: ColourModel<P>,
    },
}

/// What lies over a surface, whatever it does to light.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CoverModel<P = Texels> {
    /// The part of the surface that is there; `None` where all of it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub opacity: Option<ValueModel<P>>,
    /// Red, green and blue from 0 to 1 are the components of normals from -1 to 1, along growing u, along growing v and
    /// along the normal of the surface.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normals: Option<TextureModel<P>>,
}

/// A light. All but meshes reflect nothing.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LightModel<P = Texels> {
    /// A point that shines equally in all directions.
    Point {
        /// Where it is.
        position: Triple,
        /// Radiant intensity, W/sr.
        intensity: Triple,
    },
    /// A point that shines into a cone. With θ the angle to its axis, intensity is multiplied by the square of
    /// `(cos θ - cos outer) / (cos inner - cos outer)`, between 0 and 1.
    Spot {
        /// Where it is.
        position: Triple,
        /// Unit vector in which it shines.
        direction: Triple,
        /// Radiant intensity along `direction`, W/sr.
        intensity: Triple,
        /// Up to this angle the intensity is full, degrees.
        inner_angle: f64,
        /// From this angle on there is no light, degrees.
        outer_angle: f64,
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
    /// A mesh that shines to both of its sides, besides what its material does.
    Mesh {
        /// Name of the mesh.
        mesh: String,
        /// Emitted radiance, W/(m2 sr). That of a picture is in linear Rec. 709.
        radiance: ColourModel<P>,
    },
    /// Light from all directions.
    Environment {
        /// Emitted radiance, W/(m2 sr).
        radiance: RadianceModel,
    },
}

/// Radiance from all directions, W/(m2 sr).
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RadianceModel {
    /// The same from all directions.
    Colour(Triple),
    /// A picture by longitude and latitude, its top row up. Seen from inside, left of its middle is towards `left`.
    Picture {
        /// The file.
        file: String,
        /// By what its radiance is multiplied.
        scale: f64,
        /// Unit vector towards its middle.
        middle: Triple,
        /// Unit vector towards what is a quarter of the picture left of the middle.
        left: Triple,
        /// Unit vector towards its top row.
        up: Triple,
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

impl TextureModel {
    /// The model of a picture, of which one channel counts or all.
    pub(crate) fn of(picture: &MappedPicture, channel: Option<Channel>) -> Self {
        let factor = picture.factor.to_array();
        let texels = Texels { bitmap: Arc::clone(&picture.bitmap), factor, channel, threshold: None };
        Self {
            file: texels,
            coordinates: picture.coordinates,
            wrap: picture.wrap,
            filter: picture.filter,
            transform: picture.transform.unwrap_or_default().0,
        }
    }
}

impl ColourModel {
    /// The model of a colour.
    pub(crate) fn of(colour: &Colour) -> Self {
        match colour {
            Colour::Uniform(colour) => Self::Colour(colour.to_array()),
            Colour::Textured(picture) => Self::Texture(TextureModel::of(picture, None)),
        }
    }
}

impl ValueModel {
    /// The model of a number.
    pub(crate) fn of(value: &Value) -> Self {
        match value {
            Value::Uniform(value) => Self::Value(*value),
            Value::Textured(picture, lane) => {
                let channel = [Channel::Red, Channel::Green, Channel::Blue][*lane];
                Self::Texture(TextureModel::of(picture, Some(channel)))
            }
        }
    }
}

impl CoverModel {
    /// Nothing.
    pub(crate) const NONE: Self = Self { opacity: None, normals: None };

    /// The model of an opacity, of which all is there from a threshold on.
    pub(crate) fn of_opacity(value: &Value, threshold: Option<f64>) -> Self {
        let mut model = ValueModel::of(value);
        match (&mut model, threshold) {
            (ValueModel::Value(value), Some(threshold)) => *value = if *value < threshold { 0.0 } else { 1.0 },
            (ValueModel::Texture(texture), threshold) => texture.file.threshold = threshold,
            (ValueModel::Value(_), None) => {}
        }
        let is_whole = matches!(model, ValueModel::Value(1.0));
        Self { opacity: (!is_whole).then_some(model), normals: None }
    }

    /// The same with a normal map.
    #[must_use]
    pub(crate) fn with_normals(self, map: &NormalMap) -> Self {
        Self { normals: Some(TextureModel::of(map.picture(), None)), ..self }
    }
}

impl<P> CoverModel<P> {
    /// The model with other textures.
    ///
    /// # Errors
    ///
    /// The first error of `other`.
    pub fn try_map_textures<Q, E>(self, other: &mut MapTexture<'_, P, Q, E>) -> Result<CoverModel<Q>, E> {
        Ok(CoverModel {
            opacity: self.opacity.map(|opacity| opacity.try_map(other)).transpose()?,
            normals: self.normals.map(&mut *other).transpose()?,
        })
    }
}

impl<P> ColourModel<P> {
    /// The model with other textures.
    fn try_map<Q, E>(self, other: &mut MapTexture<'_, P, Q, E>) -> Result<ColourModel<Q>, E> {
        Ok(match self {
            Self::Colour(colour) => ColourModel::Colour(colour),
            Self::Texture(texture) => ColourModel::Texture(other(texture)?),
        })
    }
}

impl<P> ValueModel<P> {
    /// The model with other textures.
    fn try_map<Q, E>(self, other: &mut MapTexture<'_, P, Q, E>) -> Result<ValueModel<Q>, E> {
        Ok(match self {
            Self::Value(value) => ValueModel::Value(value),
            Self::Texture(texture) => ValueModel::Texture(other(texture)?),
        })
    }
}

/// What makes another texture of each.
type MapTexture<'a, P, Q, E> = dyn FnMut(TextureModel<P>) -> Result<TextureModel<Q>, E> + 'a;

impl<P> SurfaceModel<P> {
    /// The model with other textures.
    ///
    /// # Errors
    ///
    /// The first error of `other`.
    pub fn try_map_textures<Q, E>(self, other: &mut MapTexture<'_, P, Q, E>) -> Result<SurfaceModel<Q>, E> {
        Ok(match self {
            Self::Diffuse { reflectance } => SurfaceModel::Diffuse { reflectance: reflectance.try_map(other)? },
            Self::DiffuseTransmission { reflectance, transmittance } => SurfaceModel::DiffuseTransmission {
                reflectance: reflectance.try_map(other)?,
                transmittance: transmittance.try_map(other)?,
            },
            Self::Mirror { reflectance } => SurfaceModel::Mirror { reflectance },
            Self::Metal { reflectance, roughness } => {
                SurfaceModel::Metal { reflectance: reflectance.try_map(other)?, roughness: roughness.try_map(other)? }
            }
            Self::Coated { colour, metallic, roughness, coat, coat_colour, coat_strength } => SurfaceModel::Coated {
                colour: colour.try_map(other)?,
                metallic: metallic.try_map(other)?,
                roughness: roughness.try_map(other)?,
                coat,
                coat_colour: coat_colour.try_map(other)?,
                coat_strength: coat_strength.try_map(other)?,
            },
            Self::Dielectric { index_of_refraction } => SurfaceModel::Dielectric { index_of_refraction },
            Self::RoughDielectric { index_of_refraction, roughness } => {
                SurfaceModel::RoughDielectric { index_of_refraction, roughness }
            }
            Self::ThinSheet { index_of_refraction, tint } => {
                SurfaceModel::ThinSheet { index_of_refraction, tint: tint.try_map(other)? }
            }
        })
    }
}

impl<P> LightModel<P> {
    /// The model with other textures.
    ///
    /// # Errors
    ///
    /// The first error of `other`.
    pub fn try_map_textures<Q, E>(self, other: &mut MapTexture<'_, P, Q, E>) -> Result<LightModel<Q>, E> {
        Ok(match self {
            Self::Point { position, intensity } => LightModel::Point { position, intensity },
            Self::Spot { position, direction, intensity, inner_angle, outer_angle } => {
                LightModel::Spot { position, direction, intensity, inner_angle, outer_angle }
            }
            Self::Sphere { centre, radius, radiance } => LightModel::Sphere { centre, radius, radiance },
            Self::Rectangle { centre, edge_u, edge_v, radiance } => {
                LightModel::Rectangle { centre, edge_u, edge_v, radiance }
            }
            Self::Disk { centre, normal, radius, radiance } => LightModel::Disk { centre, normal, radius, radiance },
            Self::Distant { direction, angular_radius, radiance } => {
                LightModel::Distant { direction, angular_radius, radiance }
            }
            Self::Mesh { mesh, radiance } => LightModel::Mesh { mesh, radiance: radiance.try_map(other)? },
            Self::Environment { radiance } => LightModel::Environment { radiance },
        })
    }

    /// The same light with its place seen from another origin.
    #[must_use]
    pub fn seen_from(mut self, origin: DVec3) -> Self {
        match &mut self {
            Self::Point { position: place, .. }
            | Self::Spot { position: place, .. }
            | Self::Sphere { centre: place, .. }
            | Self::Rectangle { centre: place, .. }
            | Self::Disk { centre: place, .. } => *place = (DVec3::from(*place) - origin).to_array(),
            Self::Distant { .. } | Self::Mesh { .. } | Self::Environment { .. } => {}
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
