//! Kinds of glass: how a sheet was made, how thick it is, and what colours it.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::colour::GlassColour;
use crate::scene::description::{ProfileDescription, SheetDescription};
use crate::scene::paint::PaintDescription;
use crate::scene::profile_limits::check_sheet;
use crate::settings::check::{check_above, check_range};
use crate::settings::{Check, JsonPath};

/// A kind of glass, as a glazier has it in store.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GlassDescription {
    /// How it was made, which decides its relief.
    pub sheet: GlassSheet,
    /// How pieces are cut from the sheet.
    #[serde(skip_serializing_if = "crate::settings::is_default")]
    pub cutting: Cutting,
    /// Thickness of the sheet, metres; more than 0, at most 0.1. Pieces differ from it as `design` says. Absent: usual
    /// for the colour, 0.003 for the coloured glass of medieval windows and 0.0018 for window glass.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(max = 0.1), extend("exclusiveMinimum" = 0))]
    pub thickness: Option<f64>,
    /// Index of refraction, 1 to 3.
    #[schemars(range(min = 1.0, max = 3.0))]
    pub index_of_refraction: f64,
    /// What colours it.
    pub colour: GlassColour,
    /// Vitreous paint on each piece, with the mask over the rectangle around it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub paint: Option<Box<PaintDescription>>,
}

/// How a sheet was made.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum GlassSheet {
    /// Spun to a disc: rings about its middle, on a piece of 1.2 x 1.2 m.
    #[default]
    Crown,
    /// Blown to a cylinder and opened: ripples along y, on a piece of 0.9 x 1.2 m.
    Cylinder,
    /// Cast or rolled with dimples, on a piece of 0.8 x 0.8 m.
    Hammered,
    /// A small disc of 0.25 m, spun for itself, with the mark of the rod in its middle; best cut `centred`.
    Bullion,
    /// Without relief.
    Flat,
    /// A relief of its own.
    Own(SheetDescription),
}

/// How pieces are cut from a sheet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Cutting {
    /// Anywhere and in any direction, by the seed of the design.
    #[default]
    Scattered,
    /// Where it comes to lie in the window: the sheet goes through behind the lead, with its middle over that of the
    /// opening.
    InPlace,
    /// About the middle of the sheet, as roundels are, and in any direction.
    Centred,
}

/// A sheet without relief has to be as large as the largest piece.
const FLAT_EDGE: f64 = 100.0;

impl Default for GlassDescription {
    fn default() -> Self {
        Self {
            sheet: GlassSheet::default(),
            cutting: Cutting::default(),
            thickness: None,
            index_of_refraction: 1.52,
            colour: GlassColour::default(),
            paint: None,
        }
    }
}

impl GlassDescription {
    /// Modern glass without relief, 4 mm thick.
    pub fn float() -> Self {
        Self { sheet: GlassSheet::Flat, thickness: Some(0.004), ..Self::default() }
    }

    /// Thickness of the sheet, metres.
    pub fn thickness(&self) -> f64 {
        self.thickness.unwrap_or_else(|| self.colour.usual_thickness())
    }

    pub(super) fn check(&self, path: &JsonPath<'_>) -> Check {
        check_above(self.thickness(), 0.0, 0.1, &path.member("thickness"))?;
        check_range(self.index_of_refraction, 1.0, 3.0, &path.member("index_of_refraction"))?;
        self.colour.check(&path.member("colour"))?;
        if let GlassSheet::Own(sheet) = &self.sheet {
            check_sheet(sheet, &path.member("sheet").member("own"))?;
        }
        self.paint.as_ref().map_or(Ok(()), |paint| paint.check(&path.member("paint")))
    }
}

impl GlassSheet {
    /// The relief. Wavelengths and amplitudes are assumptions: no measurements of historic panes are published.
    pub(super) fn description(&self, seed: u64) -> SheetDescription {
        let size = |width: f64, height: f64, front: ProfileDescription, back: ProfileDescription| SheetDescription {
            width,
            height,
            front,
            back,
        };
        match self {
            Self::Crown => {
                // The disc is thicker towards its middle, and the faces of its rings run nearly in parallel.
                let rings = |wavelength, amplitude, seed| ProfileDescription::Crown {
                    centre: [0.0, 0.0],
                    wavelength,
                    amplitude,
                    seed,
                };
                size(1.2, 1.2, rings(0.045, 2.2e-5, seed), rings(0.06, 1.2e-5, seed + 1))
            }
            Self::Cylinder => {
                let ripples = |axis, wavelength, amplitude, seed| ProfileDescription::Cylinder {
                    axis,
                    wavelength,
                    amplitude,
                    seed,
                };
                size(0.9, 1.2, ripples(90.0, 0.05, 2.5e-5, seed), ripples(86.0, 0.07, 1.2e-5, seed + 1))
            }
            Self::Hammered => {
                let dimples = ProfileDescription::Hammered { wavelength: 0.02, amplitude: 6e-5, seed };
                size(0.8, 0.8, dimples, ProfileDescription::Flat)
            }
            Self::Bullion => {
                let rings = |wavelength, amplitude, seed| ProfileDescription::Crown {
                    centre: [0.0, 0.0],
                    wavelength,
                    amplitude,
                    seed,
                };
                let mark = ProfileDescription::Bump {
                    centre: [0.0, 0.0],
                    radius: [0.011, 0.009],
                    rotation: 0.0,
                    amplitude: 1.2e-3,
                };
                size(0.25, 0.25, rings(0.014, 3.5e-5, seed), mark)
            }
            Self::Flat => size(FLAT_EDGE, FLAT_EDGE, ProfileDescription::Flat, ProfileDescription::Flat),
            Self::Own(sheet) => sheet.clone(),
        }
    }

    /// Whether pieces of it differ by where they are cut.
    pub(super) fn has_relief(&self) -> bool {
        match self {
            Self::Flat => false,
            Self::Own(sheet) => [&sheet.front, &sheet.back].into_iter().any(|face| *face != ProfileDescription::Flat),
            _ => true,
        }
    }
}

impl SheetDescription {
    /// Where on the sheet a piece is cut: the place of its middle, and its rotation in degrees. `u`, `v` and `rotation`
    /// are random. A piece that fits only as it stands, or lying, is cut like that. `None` for a piece that does not
    /// fit.
    pub(super) fn place_for(&self, corners: &[DVec2], random: DVec2, rotation: f64) -> Option<(DVec2, f64)> {
        let half = 0.5 * DVec2::new(self.width, self.height);
        [rotation, 0.0, 90.0].into_iter().find_map(|rotation| {
            let (sine, cosine) = libm::sincos(rotation.to_radians());
            let turned = corners.iter().map(|corner| DVec2::new(cosine, sine).rotate(*corner));
            let (min, max) = turned
                .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(min, max), corner| (min.min(corner), max.max(corner)));
            let (low, high) = (-half - min, half - max);
            low.cmple(high).all().then(|| (low + (high - low) * random, rotation))
        })
    }
}
