//! A window as it stands in a scene file.

use std::collections::{BTreeMap, BTreeSet};

use clerestory_glazing::WindowDesign;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::colour::{GlassColour, named};
use super::glass::GlassDescription;
use crate::scene::paint::PaintDescription;
use crate::settings::check::{
    MIN_SINE, Numbers, Quoted, check_above, check_direction, check_name, check_range, check_triple,
};
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

impl WindowDescription {
    fn check(&self, path: &JsonPath<'_>) -> Check {
        check_name(&self.name, &path.member("name"))?;
        if self.name.len() > MAX_WINDOW_NAME_BYTES {
            let expected = format!("at most {MAX_WINDOW_NAME_BYTES} bytes");
            return Err(SceneError::value(&path.member("name"), Quoted(&self.name), expected));
        }
        check_triple(self.sill, -MAX_COORDINATE, MAX_COORDINATE, &path.member("sill"))?;
        let x = check_direction(self.x_axis, &path.member("x_axis"))?;
        let y = check_direction(self.y_axis, &path.member("y_axis"))?;
        if x.cross(y).length() < MIN_SINE {
            let expected = format!("a direction that is not parallel to x_axis ({})", Numbers(&self.x_axis));
            return Err(SceneError::value(&path.member("y_axis"), Numbers(&self.y_axis), expected));
        }
        self.check_kinds(path)?;
        check_range(self.name.len(), 1, MAX_WINDOW_NAME_BYTES, &path.member("name"))
    }

    /// Checks the kinds of glass and the protective pane.
    pub(crate) fn check_kinds(&self, path: &JsonPath<'_>) -> Check {
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
        Ok(())
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
