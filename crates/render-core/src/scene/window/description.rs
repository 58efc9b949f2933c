//! A window as it stands in a scene file.

use std::collections::{BTreeMap, BTreeSet};

use clerestory_glazing::{GlazingError, Lead, WindowDesign};
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::colour::{GlassColour, named};
use super::glass::{GlassDescription, GlassSheet};
use crate::scene::description::SheetDescription;
use crate::scene::paint::PaintDescription;
use crate::settings::check::{MIN_SINE, Numbers, Quoted, check_above, check_direction, check_name, check_triple};
use crate::settings::limits::MAX_COORDINATE;
use crate::settings::{Check, JsonPath, SceneError, Triple};

/// A leaded window. It becomes panes, and meshes of lead, iron and stone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WindowDescription {
    /// A short name, with which the names of its panes and meshes begin; no two windows share one.
    #[schemars(length(min = 1, max = 100))]
    pub name: String,
    /// The middle of the sill, in the middle of the glass, metres.
    pub sill: Triple,
    /// Direction to the right, seen from inside.
    pub x_axis: Triple,
    /// Direction upwards; made perpendicular to `x_axis`. The inside is towards `x_axis` x `y_axis`.
    #[serde(default = "upwards")]
    pub y_axis: Triple,
    /// How the opening is divided, leaded and barred.
    pub design: WindowDesign,
    /// Kinds of glass by the names that `design` gives them. A kind that has the name of a historical colour and is not
    /// here is crown glass of that colour.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub glass: BTreeMap<String, GlassDescription>,
    /// Vitreous paint on all pieces, with one mask over the rectangle around the opening.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub paint: Option<Box<PaintDescription>>,
    /// A protective pane outside.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outer: Option<OuterGlazing>,
}

/// Protective glazing before a leaded window: one sheet over the whole opening.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OuterGlazing {
    /// Distance of its inner face from the middle of the leaded glass, metres; more than 0, at most 1.
    #[serde(default = "outer_distance")]
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0))]
    pub distance: f64,
    /// Its glass; flat and clear where nothing is said.
    #[serde(default = "GlassDescription::float")]
    pub glass: GlassDescription,
}

fn upwards() -> Triple {
    [0.0, 0.0, 1.0]
}

fn outer_distance() -> f64 {
    0.06
}

/// Bytes of the name of a window: names of its things are longer.
const MAX_WINDOW_NAME_BYTES: usize = 100;

/// Checks the windows of a scene, as far as they can be checked without planning them.
pub(crate) fn check_windows(windows: &[WindowDescription], path: &JsonPath<'_>) -> Check {
    let mut names = BTreeSet::new();
    for (index, window) in windows.iter().enumerate() {
        let path = path.element(index);
        window.check(&path)?;
        if !names.insert(window.name.as_str()) {
            let expected = "a name that no other window has";
            return Err(SceneError::value(&path.member("name"), Quoted(&window.name), expected));
        }
    }
    Ok(())
}

/// All paints of a window, its kinds of glass and its protective pane, with their places below it.
pub(in crate::scene) fn paints<'a>(
    own: Option<&'a PaintDescription>,
    glass: &'a BTreeMap<String, GlassDescription>,
    outer: Option<&'a OuterGlazing>,
) -> Vec<(String, &'a PaintDescription)> {
    let root = JsonPath::Root;
    let kinds = root.member("glass");
    let of_kinds = glass
        .iter()
        .filter_map(|(name, kind)| Some((kinds.member(name).member("paint").to_string(), kind.paint.as_deref()?)));
    let own = own.map(|paint| ("paint".to_owned(), paint));
    let outer = outer.and_then(|outer| Some(("outer.glass.paint".to_owned(), outer.glass.paint.as_deref()?)));
    own.into_iter().chain(of_kinds).chain(outer).collect()
}

/// The sheets with a relief of their own among kinds of glass, with their places.
pub(in crate::scene) fn own_sheets<'a>(
    glass: &'a BTreeMap<String, GlassDescription>,
    outer: Option<&'a OuterGlazing>,
) -> Vec<(String, &'a SheetDescription)> {
    let root = JsonPath::Root;
    let kinds = root.member("glass");
    let of_kinds = glass.iter().map(|(name, kind)| (kinds.member(name).to_string(), kind));
    let of_outer = outer.map(|outer| ("outer.glass".to_owned(), &outer.glass));
    let own = |(place, kind): (String, &'a GlassDescription)| match &kind.sheet {
        GlassSheet::Own(sheet) => Some((format!("{place}.sheet.own"), sheet)),
        _ => None,
    };
    of_kinds.chain(of_outer).filter_map(own).collect()
}

/// An error of a design that stands in a window at `path`.
pub(super) fn of_design(error: GlazingError, path: &JsonPath<'_>) -> SceneError {
    SceneError::Value {
        path: format!("{}.{}", path.member("design"), error.path),
        found: error.found,
        expected: error.expected,
    }
}

impl WindowDescription {
    fn check(&self, path: &JsonPath<'_>) -> Check {
        if self.name.len() > MAX_WINDOW_NAME_BYTES || check_name(&self.name, &path.member("name")).is_err() {
            let expected = format!("1 to {MAX_WINDOW_NAME_BYTES} bytes without control characters");
            return Err(SceneError::value(&path.member("name"), Quoted(&self.name), expected));
        }
        check_triple(self.sill, -MAX_COORDINATE, MAX_COORDINATE, &path.member("sill"))?;
        let x = check_direction(self.x_axis, &path.member("x_axis"))?;
        let y = check_direction(self.y_axis, &path.member("y_axis"))?;
        if x.cross(y).length() < MIN_SINE {
            let expected = format!("a direction that is not parallel to x_axis ({})", Numbers(&self.x_axis));
            return Err(SceneError::value(&path.member("y_axis"), Numbers(&self.y_axis), expected));
        }
        self.check_made(path)
    }

    /// Checks the design, the kinds of glass and the protective pane.
    pub(crate) fn check_made(&self, path: &JsonPath<'_>) -> Check {
        self.design.validate().map_err(|error| of_design(error, path))?;
        let kinds = path.member("glass");
        for (name, glass) in &self.glass {
            check_name(name, &kinds)?;
            glass.check(&kinds.member(name))?;
        }
        self.paint.as_ref().map_or(Ok(()), |paint| paint.check(&path.member("paint")))?;
        if let Some(outer) = &self.outer {
            let path = path.member("outer");
            check_above(outer.distance, 0.0, 1.0, &path.member("distance"))?;
            outer.glass.check(&path.member("glass"))?;
        }
        self.check_depth(path)
    }

    /// Checks that glass and lead have room in each other and behind the protective pane.
    fn check_depth(&self, path: &JsonPath<'_>) -> Check {
        let Lead::Cames(cames) = &self.design.lead else { return Ok(()) };
        for name in self.design.glass_names() {
            let thickness = self.kind(name).map_or(0.0, |kind| kind.thickness());
            if thickness > cames.heart_height {
                let expected = format!("at most {}, the heart_height of the cames", cames.heart_height);
                let kinds = path.member("glass");
                return Err(SceneError::value(&kinds.member(name).member("thickness"), thickness, expected));
            }
        }
        let depth = 0.5 * cames.heart_height + cames.flange_thickness;
        match &self.outer {
            Some(outer) if outer.distance <= depth => {
                let expected = format!("more than {depth}, up to where the cames reach");
                Err(SceneError::value(&path.member("outer").member("distance"), outer.distance, expected))
            }
            _ => Ok(()),
        }
    }

    /// The sheets with a relief of its own, with their places below it.
    pub(in crate::scene) fn own_sheets(&self) -> Vec<(String, &SheetDescription)> {
        own_sheets(&self.glass, self.outer.as_ref())
    }

    /// Its paints with their places below it.
    pub(in crate::scene) fn paints(&self) -> Vec<(String, &PaintDescription)> {
        paints(self.paint.as_deref(), &self.glass, self.outer.as_ref())
    }

    /// The kind of glass of this name; `None` where there is none.
    pub(super) fn kind(&self, name: &str) -> Option<GlassDescription> {
        self.glass.get(name).cloned().or_else(|| {
            named(name)?;
            Some(GlassDescription { colour: GlassColour::Named(name.to_owned()), ..GlassDescription::default() })
        })
    }

    /// The colour of white light behind a kind of glass, `#RRGGBB` of the sRGB space.
    pub fn css_colour(&self, name: &str) -> String {
        let kind = self.kind(name).unwrap_or_default();
        let tint = kind.colour.tint().unwrap_or_default();
        let channel = |channel: usize| {
            let absorbance = tint.body[channel] * kind.thickness() + tint.flash[channel] + tint.stain[channel];
            let value = libm::pow(libm::exp(-absorbance), 1.0 / 2.2);
            (value * 255.0).round() as u8
        };
        format!("#{:02x}{:02x}{:02x}", channel(0), channel(1), channel(2))
    }

    /// Unit vectors to the right, upwards and inwards.
    pub(super) fn axes(&self) -> [DVec3; 3] {
        let x = DVec3::from(self.x_axis).normalize();
        let z = x.cross(DVec3::from(self.y_axis).normalize()).normalize();
        [x, z.cross(x), z]
    }
}
