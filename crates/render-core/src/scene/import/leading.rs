//! Leaded windows in the openings of a building, in place of the flat shapes that modellers put there.

use std::collections::BTreeMap;

use clerestory_glazing::{
    Arch, Bars, DrawnOpening, Filling, GlassPattern, Head, Lead, Opening, StoneSection, Tracery, WindowDesign,
};
use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::glazing::PaneFit;
use crate::math::hash::mix;
use crate::scene::description::SheetDescription;
use crate::scene::paint::PaintDescription;
use crate::scene::window::{
    GlassDescription, OuterGlazing, WindowDescription, WindowExpansion, expand, own_sheets, paints,
};
use crate::settings::{Check, JsonPath};

/// Makes leaded windows of flat shapes and of thin closed bodies of an import. They have the members of the windows of
/// a scene; their openings are the shapes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LeadingRule {
    /// Which: a pattern of the names of meshes and materials, in which `*` stands for any characters.
    #[serde(rename = "match")]
    pub pattern: String,
    /// How the openings are divided, leaded and barred.
    #[serde(default)]
    pub design: FittedDesign,
    /// Kinds of glass by the names that `design` gives them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub glass: BTreeMap<String, GlassDescription>,
    /// Vitreous paint on all pieces, with one mask over each opening.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub paint: Option<Box<PaintDescription>>,
    /// A protective pane outside.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outer: Option<OuterGlazing>,
}

/// A window without its opening and its wall: those of the building.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FittedDesign {
    /// How stone or timber divides the opening into lights.
    pub tracery: Tracery,
    /// The section of the tracery; not used where there is none.
    pub stone: StoneSection,
    /// How each light is divided into pieces.
    pub filling: Filling,
    /// Which kinds of glass the pieces are cut from, where the filling does not say it.
    pub glass: GlassPattern,
    /// What holds the pieces.
    pub lead: Lead,
    /// Iron bars on the inside of the glass.
    pub bars: Bars,
    /// Standard deviation of the rotation of pieces about x and y, degrees; 0 to 5.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub tilt: f64,
    /// Standard deviation of the thickness of pieces, as a part of it; 0 to 0.3.
    #[schemars(range(min = 0.0, max = 0.3))]
    pub thickness_variation: f64,
    /// Seed of everything that differs from piece to piece. Each window has another one, which follows from it.
    pub seed: u64,
}

impl Default for FittedDesign {
    fn default() -> Self {
        let WindowDesign {
            opening: _,
            tracery,
            stone,
            filling,
            glass,
            lead,
            bars,
            wall: _,
            tilt,
            thickness_variation,
            seed,
        } = WindowDesign::new(Opening::Arch(Arch { width: 1.0, height: 1.0, head: Head::Rectangle }));
        Self { tracery, stone, filling, glass, lead, bars, tilt, thickness_variation, seed }
    }
}

impl FittedDesign {
    /// The design in an opening; `number` makes it another than that of others.
    fn within(&self, opening: Opening, number: u64) -> WindowDesign {
        let Self { tracery, stone, filling, glass, lead, bars, tilt, thickness_variation, seed } = self.clone();
        WindowDesign {
            opening,
            tracery,
            stone,
            filling,
            glass,
            lead,
            bars,
            wall: None,
            tilt,
            thickness_variation,
            seed: mix(seed.wrapping_add(number)),
        }
    }
}

impl LeadingRule {
    /// Diamonds of clear sheet glass, as is usual, of what has such a name.
    pub fn new(pattern: &str) -> Self {
        Self {
            pattern: pattern.to_owned(),
            design: FittedDesign::default(),
            glass: BTreeMap::new(),
            paint: None,
            outer: None,
        }
    }

    /// Its paints with their places below it.
    pub(in crate::scene) fn paints(&self) -> Vec<(String, &PaintDescription)> {
        paints(self.paint.as_deref(), &self.glass, self.outer.as_ref())
    }

    /// Its sheets with a relief of their own, with their places below it.
    pub(in crate::scene) fn own_sheets(&self) -> Vec<(String, &SheetDescription)> {
        own_sheets(&self.glass, self.outer.as_ref())
    }

    /// Checks what can be checked without an opening.
    pub(super) fn check(&self, path: &JsonPath<'_>) -> Check {
        let window = self.window(String::from("window"), &LARGE, 0);
        window.check_made(path)
    }

    /// What a window in a shape is made of.
    ///
    /// # Errors
    ///
    /// Why the design does not fit it.
    pub(super) fn window_in(
        &self,
        name: String,
        fit: &PaneFit,
        number: u64,
        path: &JsonPath<'_>,
    ) -> Result<WindowExpansion, String> {
        expand(&self.window(name, fit, number), path).map_err(|error| error.to_string())
    }

    fn window(&self, name: String, fit: &PaneFit, number: u64) -> WindowDescription {
        let inwards = fit.axes[0].cross(fit.axes[1]);
        // The height is what points upwards most.
        let tall = usize::from(fit.axes[1].z.abs() >= fit.axes[0].z.abs());
        let up = fit.axes[tall] * if fit.axes[tall].z < 0.0 { -1.0 } else { 1.0 };
        let [width, height] = [fit.size[1 - tall], fit.size[tall]];
        let x_axis = up.cross(inwards);
        let opening = match &fit.outline {
            Some(outline) => {
                let [x, y] = [x_axis, up].map(|axis| DVec2::new(fit.axes[0].dot(axis), fit.axes[1].dot(axis)));
                let corners: Vec<DVec2> = outline.iter().map(|at| DVec2::new(at.dot(x), at.dot(y))).collect();
                Opening::Drawn(DrawnOpening::around(&corners))
            }
            None => Opening::Arch(Arch { width, height, head: Head::Rectangle }),
        };
        WindowDescription {
            name,
            sill: (fit.centre - up * (0.5 * height)).to_array(),
            x_axis: x_axis.to_array(),
            y_axis: up.to_array(),
            design: self.design.within(opening, number),
            glass: self.glass.clone(),
            paint: self.paint.clone(),
            outer: self.outer.clone(),
        }
    }
}

/// An opening in which any filling fits.
const LARGE: PaneFit =
    PaneFit { centre: DVec3::ZERO, axes: [DVec3::X, DVec3::Z], size: [10.0, 10.0], outline: None, thickness: None };
