//! Options for files of other programs, and what they become in a scene.

use std::str::FromStr;

use clap::{Args, ValueEnum};
use clerestory_render_core::bsdf::MaterialDescription;
use clerestory_render_core::document::ModelOptions;
use clerestory_render_core::scene::import::{
    GlazeRule, LeadingRule, MaterialRule, OLD_GLASS, UpAxis, hex_colour, profile,
};
use serde_json::json;

use crate::leading_options::{FILLINGS, SHEETS, check_quarry, colours, filling, kinds, mixed};

/// Options for glTF and OBJ files.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct FileOptions {
    /// Unit of a glTF or OBJ file that does not say: m, cm, mm, in or ft [default: m].
    #[arg(long, value_name = "UNIT")]
    unit: Option<Unit>,
    /// Axis of a glTF or OBJ file that points up [default: y].
    #[arg(long, value_name = "AXIS")]
    up: Option<Axis>,
}

impl FileOptions {
    pub(crate) fn is_empty(&self) -> bool {
        self.unit.is_none() && self.up.is_none()
    }

    /// The options for the reader.
    pub(crate) fn model(&self) -> ModelOptions {
        ModelOptions {
            metres_per_unit: self.unit.map(Unit::metres),
            up: self.up.map(|axis| match axis {
                Axis::Y => UpAxis::Y,
                Axis::Z => UpAxis::Z,
            }),
            ..ModelOptions::default()
        }
    }
}

/// A unit of length.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Unit {
    M,
    Cm,
    Mm,
    In,
    Ft,
}

impl Unit {
    fn metres(self) -> f64 {
        match self {
            Self::M => 1.0,
            Self::Cm => 0.01,
            Self::Mm => 0.001,
            Self::In => 0.0254,
            Self::Ft => 0.3048,
        }
    }
}

/// An axis that points up.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Axis {
    Y,
    Z,
}

/// What rectangles of a building become: panes of `PATTERN=PROFILE[,thickness=METRES][,colour=#RRGGBB][,seed=N]`, or
/// leaded windows of `PATTERN=FILLING[,quarry=WxH][,glass=COLOUR+...][,sheet=NAME][,seed=N]`.
#[derive(Clone, Debug)]
pub(crate) enum Glaze {
    Panes(GlazeRule),
    Lead(Box<LeadingRule>),
}

impl FromStr for Glaze {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let usual = "PATTERN=GLASS with settings after commas, such as 'Window*=crown,colour=#d8e8d0' or \
                     'Window*=diamonds,quarry=0.1x0.15'";
        let (pattern, rest) = text.split_once('=').ok_or_else(|| format!("expected {usual}"))?;
        let (name, settings) = rest.split_once(',').unwrap_or((rest, ""));
        let settings: Vec<(&str, &str)> = settings
            .split(',')
            .filter(|setting| !setting.is_empty())
            .map(|setting| setting.split_once('=').unwrap_or((setting, "")))
            .collect();
        if FILLINGS.contains(&name) {
            return leaded(pattern, name, &settings).map(|rule| Self::Lead(Box::new(rule)));
        }
        if OLD_GLASS.contains(&name) {
            return panes(pattern, name, &settings).map(Self::Panes);
        }
        let known: Vec<&str> = OLD_GLASS.into_iter().chain(FILLINGS).collect();
        Err(format!("found the glass {name:?}, expected one of {}", known.join(", ")))
    }
}

fn wrong(name: &str, value: &str, expected: &str) -> String {
    format!("{name}: found {value:?}, expected {expected}")
}

fn seed_in(value: &str) -> Result<u64, String> {
    value.parse().map_err(|_| wrong("seed", value, "a whole number"))
}

fn panes(pattern: &str, name: &str, settings: &[(&str, &str)]) -> Result<GlazeRule, String> {
    let (mut thickness, mut transmitted, mut seed) = (None, [1.0; 3], 1);
    for (setting, value) in settings {
        match *setting {
            "thickness" => {
                let metres = value.parse().ok().filter(|metres: &f64| *metres > 0.0 && *metres <= 1.0);
                thickness = Some(metres.ok_or_else(|| wrong(setting, value, "metres, more than 0 and at most 1"))?);
            }
            "colour" | "color" => {
                transmitted = hex_colour(value).ok_or_else(|| wrong(setting, value, "a colour such as #d8e8d0"))?;
            }
            "seed" => seed = seed_in(value)?,
            _ => return Err(format!("found {setting:?}, expected thickness=, colour= or seed=")),
        }
    }
    let [front, back] = [seed, seed.wrapping_add(1)].map(|seed| profile(name, seed).unwrap_or_default());
    let rule = GlazeRule { thickness, front, back, ..GlazeRule::flat(pattern) };
    Ok(rule.coloured(transmitted))
}

fn leaded(pattern: &str, name: &str, settings: &[(&str, &str)]) -> Result<LeadingRule, String> {
    let (mut quarry, mut names, mut sheet) = (None, vec!["greenish".to_owned()], "crown");
    let mut rule = LeadingRule::new(pattern);
    for (setting, value) in settings {
        match *setting {
            "quarry" => quarry = Some(value.parse().map_err(|error| format!("quarry: {error}"))?),
            "glass" => names = colours(value).map_err(|error| format!("glass: {error}"))?,
            "sheet" if SHEETS.contains(value) => sheet = value,
            "sheet" => return Err(wrong(setting, value, &format!("one of {}", SHEETS.join(", ")))),
            "seed" => rule.design.seed = seed_in(value)?,
            _ => {
                let names = "quarry=, glass= (colours joined by +), sheet= or seed=";
                return Err(format!("found {setting:?}, expected {names}"));
            }
        }
    }
    check_quarry(name, quarry).map_err(|error| format!("quarry: {error}"))?;
    rule.design.glass = mixed(&names);
    rule.glass = kinds(&names, sheet);
    rule.design.filling = filling(name, quarry).unwrap_or_default();
    Ok(rule)
}

/// Longest name of a material that is named by its settings, bytes.
const LONGEST_NAME: usize = 200;

/// `PATTERN=MATERIAL`.
#[derive(Clone, Debug)]
pub(crate) struct MaterialChoice(pub(crate) MaterialRule, pub(crate) MaterialDescription);

impl FromStr for MaterialChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = "expected PATTERN=MATERIAL, where a material is a colour such as #d8d0c0, or mirror, glass, \
                        water, or JSON as in a scene file";
        let (pattern, material) = text.split_once('=').ok_or(expected)?;
        let settings = match material {
            "mirror" => json!({"mirror": {}}),
            "glass" => json!({"dielectric": {"index_of_refraction": 1.52}}),
            "water" => json!({"dielectric": {"index_of_refraction": 1.33}}),
            colour if colour.starts_with('#') => {
                let colour = hex_colour(colour).ok_or_else(|| format!("found {colour:?}, expected #RRGGBB"))?;
                json!({"diffuse": {"reflectance": {"colour": colour}}})
            }
            json => serde_json::from_str(json).map_err(|_| expected)?,
        };
        let description = serde_json::from_value(settings).map_err(|error| error.to_string())?;
        let mut name = format!("{pattern} {material}");
        name.truncate(name.floor_char_boundary(LONGEST_NAME));
        let rule = MaterialRule { pattern: pattern.to_owned(), material: name };
        Ok(Self(rule, description))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glass_is_a_profile_with_thickness_and_colour() {
        let Glaze::Panes(rule) = "Window*=crown,thickness=0.002,colour=#ffff80".parse().unwrap() else { panic!() };
        assert_eq!((rule.pattern.as_str(), rule.thickness), ("Window*", Some(0.002)));
        assert_eq!(&rule.absorption[..2], [0.0, 0.0]);
        // A byte of 128 lets 21.6 % through.
        assert!(((-rule.absorption[2] * 0.002).exp() - 0.2159).abs() < 1e-3);
        assert_ne!(rule.front, rule.back);
        for (text, expected) in [
            ("Window*", "PATTERN=GLASS"),
            ("Window*=float", "one of crown, cylinder"),
            ("Window*=diamonds,glass=blue", "some of clear, greenish"),
            ("Window*=diamonds,sheet=float", "one of crown, cylinder"),
            ("Window*=diamonds,quarry=0", "metres such as 0.1x0.15"),
            ("Window*=diamonds,colour=#ffffff", "quarry=, glass="),
            ("Window*=plain,quarry=0.1", "no quarries"),
            ("Window*=roundels,quarry=0.1x0.2", "the diameter"),
            ("Window*=flat,thickness=-1", "more than 0"),
            ("Window*=flat,colour=red", "#d8e8d0"),
            ("Window*=flat,tint=#ffffff", "thickness="),
        ] {
            let message = text.parse::<Glaze>().unwrap_err();
            assert!(message.contains(expected), "{text}: {message}");
        }
    }

    #[test]
    fn a_material_is_a_colour_a_name_or_json() {
        for text in
            ["Wall*=#d8d0c0", "Mirror*=mirror", "a=water", r#"a={"diffuse":{"reflectance":{"colour":[1,1,1]}}}"#]
        {
            assert!(text.parse::<MaterialChoice>().is_ok(), "{text}");
        }
        for text in ["Wall*", "Wall*=stone", "Wall*=#12", r#"a={"velvet":{}}"#] {
            assert!(text.parse::<MaterialChoice>().is_err(), "{text}");
        }
    }
}
