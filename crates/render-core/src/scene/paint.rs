//! Vitreous paint on panes, as it stands in a scene file: ground glass and iron or copper oxide, fired onto a face.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::bsdf::{DiffuseTransmissionMaterial, MaterialSettings};
use crate::settings::check::check_above;
use crate::settings::{Check, JsonPath, is_default};
use crate::texture::{ColourDescription, TextureUse, ValueDescription};

/// Vitreous paint on a face of a pane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PaintDescription {
    /// Where it is: 1 for paint, 0 for clear glass, and a part of both in between.
    pub mask: ValueDescription,
    /// Fraction of light that the paint scatters back. Default: dark brown.
    #[serde(default = "reflectance", skip_serializing_if = "is_usual_reflectance")]
    pub reflectance: ColourDescription,
    /// Fraction of light that the paint scatters to the other side. Default: what a thick trace line lets through.
    #[serde(default = "transmittance", skip_serializing_if = "is_usual_transmittance")]
    pub transmittance: ColourDescription,
    /// The face on which it is. The inner face of a window's pieces is the back.
    #[serde(default, skip_serializing_if = "is_default")]
    pub face: PaintedFace,
    /// Distance of the paint from the highest point of the face, metres; more than 0, at most 0.01. On a measured face,
    /// from its mean plane.
    #[serde(default = "distance", skip_serializing_if = "is_usual_distance")]
    #[schemars(range(max = 0.01), extend("exclusiveMinimum" = 0))]
    pub distance: f64,
}

/// A face of a pane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PaintedFace {
    /// The front, which is outside in a window.
    Front,
    /// The back, which is inside in a window.
    #[default]
    Back,
}

/// Measured values for fired paint are hardly published; these are estimates for a dense brown trace line.
fn reflectance() -> ColourDescription {
    ColourDescription::Colour([0.07, 0.055, 0.045])
}

fn is_usual_reflectance(colour: &ColourDescription) -> bool {
    *colour == reflectance()
}

fn transmittance() -> ColourDescription {
    ColourDescription::Colour([0.02, 0.012, 0.006])
}

fn is_usual_transmittance(colour: &ColourDescription) -> bool {
    *colour == transmittance()
}

fn distance() -> f64 {
    0.0003
}

fn is_usual_distance(metres: &f64) -> bool {
    *metres == distance()
}

impl PaintDescription {
    /// Dense brown trace lines, where a mask has them.
    pub fn of_mask(mask: ValueDescription) -> Self {
        Self {
            mask,
            reflectance: reflectance(),
            transmittance: transmittance(),
            face: PaintedFace::default(),
            distance: distance(),
        }
    }

    /// Checks it.
    pub(crate) fn check(&self, path: &JsonPath<'_>) -> Check {
        self.mask.check(0.0, 1.0, &path.member("mask"))?;
        DiffuseTransmissionMaterial { opacity: ValueDescription::number(1.0), ..self.material() }.check(path)?;
        check_above(self.distance, 0.0, 0.01, &path.member("distance"))
    }

    /// The pictures that it names, with their places below it.
    pub(crate) fn textures(&self) -> Vec<TextureUse<'_>> {
        let colours = [("reflectance", &self.reflectance), ("transmittance", &self.transmittance)];
        let colours = colours.into_iter().filter_map(|(member, colour)| colour.texture(member));
        self.mask.texture("mask").into_iter().chain(colours).collect()
    }

    /// What it does to light.
    pub(super) fn material(&self) -> DiffuseTransmissionMaterial {
        DiffuseTransmissionMaterial {
            reflectance: self.reflectance.clone(),
            transmittance: self.transmittance.clone(),
            opacity: self.mask.clone(),
            opacity_threshold: None,
        }
    }
}
