//! Lights of the extension `KHR_lights_punctual`.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use serde::Deserialize;
use serde_json::Value;

use super::extensions::LIGHTS;
use super::fault::{check_range, check_ranges, fault, no_element};
use super::list::List;
use super::schema::{Document, extension};
use crate::settings::AssetProblem;

/// A light at the origin of its node, which shines along -z.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Light {
    /// Its name, as written.
    pub(crate) name: Option<String>,
    /// What other programs stored with it; null without.
    pub(crate) extras: Value,
    /// Linear red, green and blue, each 0 to 1.
    pub(crate) colour: [f64; 3],
    /// Luminous intensity, cd; of a directional light illuminance, lx.
    pub(crate) intensity: f64,
    /// The distance beyond which other programs let it end, metres. Real light has none.
    pub(crate) range: Option<f64>,
    /// How it shines.
    pub(crate) kind: LightKind,
}

/// How a light shines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum LightKind {
    /// From infinitely far away along the direction of its node.
    Directional,
    /// From one point in all directions.
    Point,
    /// From one point into a cone.
    Spot {
        /// The angle from the axis at which it begins to fade, radians.
        inner_angle: f64,
        /// The angle from the axis at which it ends, radians.
        outer_angle: f64,
    },
}

#[derive(Deserialize)]
struct Lights {
    lights: List<Stored>,
}

#[derive(Deserialize)]
struct Stored {
    #[serde(default)]
    name: Option<String>,
    #[serde(default)]
    color: Option<[f64; 3]>,
    #[serde(default)]
    intensity: Option<f64>,
    #[serde(default)]
    range: Option<f64>,
    #[serde(rename = "type")]
    kind: String,
    #[serde(default)]
    spot: Option<Spot>,
    #[serde(default)]
    extras: Value,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct Spot {
    inner_cone_angle: Option<f64>,
    outer_cone_angle: Option<f64>,
}

#[derive(Deserialize)]
struct OfNode {
    light: usize,
}

/// Programs write angles in single precision, radians.
const ROUNDING: f64 = 1e-6;

/// Reads all lights.
pub(super) fn read(document: &Document<'_>) -> Result<Vec<Light>, AssetProblem> {
    let Some(Lights { lights }) = extension(&document.extensions, LIGHTS, "file")? else { return Ok(Vec::new()) };
    let light = |(index, light)| read_light(light, &format!("extensions.{LIGHTS}.lights[{index}]"));
    lights.iter().enumerate().map(light).collect()
}

/// The light of each node, if it has one.
pub(super) fn of_nodes(document: &Document<'_>, lights: usize) -> Result<Vec<Option<usize>>, AssetProblem> {
    let light = |(index, node): (usize, &super::schema::Node)| {
        let place = format!("nodes[{index}]");
        let Some(OfNode { light }) = extension(&node.extensions, LIGHTS, &place)? else { return Ok(None) };
        if light >= lights {
            return Err(no_element(light, lights, "lights", format_args!("{place}.extensions.{LIGHTS}.light")));
        }
        Ok(Some(light))
    };
    document.nodes.iter().enumerate().map(light).collect()
}

fn read_light(light: &Stored, place: &str) -> Result<Light, AssetProblem> {
    let at_least_zero = 0.0..=f64::INFINITY;
    let kind = match light.kind.as_str() {
        "directional" => LightKind::Directional,
        "point" => LightKind::Point,
        "spot" => read_spot(light.spot.as_ref(), &format!("{place}.spot"))?,
        kind => {
            let message = format!("found \"{kind}\", must be \"directional\", \"point\" or \"spot\"");
            return Err(fault(format_args!("{place}.type"), message));
        }
    };
    let intensity =
        check_range(format_args!("{place}.intensity"), light.intensity.unwrap_or(1.0), at_least_zero.clone())?;
    if let Some(range) = light.range {
        check_range(format_args!("{place}.range"), range, at_least_zero)?;
    }
    Ok(Light {
        name: light.name.clone(),
        extras: light.extras.clone(),
        colour: check_ranges(&format!("{place}.color"), light.color.unwrap_or([1.0; 3]), 0.0..=1.0)?,
        intensity,
        range: light.range,
        kind,
    })
}

fn read_spot(spot: Option<&Spot>, place: &str) -> Result<LightKind, AssetProblem> {
    let Some(spot) = spot else { return Err(fault(place, "is missing, a spot light must have it")) };
    let outer = spot.outer_cone_angle.unwrap_or(FRAC_PI_4);
    let most = FRAC_PI_2 + ROUNDING;
    let outer = check_range(format_args!("{place}.outerConeAngle"), outer, f64::MIN_POSITIVE..=most)?;
    let inner = spot.inner_cone_angle.unwrap_or(0.0);
    let inner = check_range(format_args!("{place}.innerConeAngle"), inner, 0.0..=outer + ROUNDING)?;
    Ok(LightKind::Spot { inner_angle: inner.min(outer), outer_angle: outer.min(FRAC_PI_2) })
}
