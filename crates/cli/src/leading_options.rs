//! How options say what leaded windows are made of.

use std::collections::BTreeMap;
use std::str::FromStr;

use clerestory_glazing::{
    Border, Diamonds, Filling, GlassPattern, MixedGlass, Rectangles, Roundels, UniformGlass, WeightedGlass,
};
use clerestory_render_core::scene::window::{COLOURS, Cutting, GlassColour, GlassDescription, GlassSheet};

/// The names of fillings.
pub(crate) const FILLINGS: [&str; 5] = ["diamonds", "rectangles", "roundels", "border", "plain"];

/// Width of a border, metres.
const BORDER: f64 = 0.06;

/// A width and a height, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Quarry([f64; 2]);

impl FromStr for Quarry {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (width, height) = text.split_once('x').unwrap_or((text, text));
        let [width, height] = [width, height].map(|part| part.trim().parse::<f64>().ok().filter(|size| *size > 0.0));
        match (width, height) {
            (Some(width), Some(height)) => Ok(Self([width, height])),
            _ => Err(format!("found {text}, expected metres such as 0.1x0.15, or one number for both")),
        }
    }
}

/// The filling of this name, with quarries of a size other than the usual one if one is given; `None` for a name that
/// is none of [`FILLINGS`].
pub(crate) fn filling(name: &str, quarry: Option<Quarry>) -> Option<Filling> {
    let diamonds = || quarry.map_or_else(Diamonds::default, |Quarry([width, height])| Diamonds { width, height });
    Some(match name {
        "diamonds" => Filling::Diamonds(diamonds()),
        "rectangles" => {
            let usual = Rectangles::default();
            let Quarry([width, height]) = quarry.unwrap_or(Quarry([usual.width, usual.height]));
            Filling::Rectangles(Rectangles { width, height, ..usual })
        }
        "roundels" => {
            let usual = Roundels::default();
            let Quarry([diameter, _]) = quarry.unwrap_or(Quarry([usual.diameter; 2]));
            Filling::Roundels(Roundels { diameter, ..usual })
        }
        "border" => {
            let field = Box::new(Filling::Diamonds(diamonds()));
            Filling::Border(Border { width: BORDER, length: None, glass: None, field })
        }
        "plain" => Filling::Plain,
        _ => return None,
    })
}

/// Refuses a size of quarries that a filling has not.
///
/// # Errors
///
/// What is wrong.
pub(crate) fn check_quarry(name: &str, quarry: Option<Quarry>) -> Result<(), String> {
    match (name, quarry) {
        ("plain", Some(_)) => Err("plain lights have no quarries, so no size of them".to_owned()),
        ("roundels", Some(Quarry([width, height]))) if width != height => {
            Err(format!("found {width}x{height}, expected one number, the diameter of the roundels"))
        }
        _ => Ok(()),
    }
}

/// How sheets of old glass were made, by name.
pub(crate) const SHEETS: [&str; 5] = ["crown", "cylinder", "hammered", "bullion", "flat"];

/// Kinds of glass of these colours from sheets that were made in this way; none for a name that is none of [`SHEETS`].
pub(crate) fn kinds(colours: &[String], sheet: &str) -> BTreeMap<String, GlassDescription> {
    let usual = GlassDescription::default();
    let (sheet, cutting) = match sheet {
        "crown" => (GlassSheet::Crown, Cutting::Scattered),
        "cylinder" => (GlassSheet::Cylinder, Cutting::Scattered),
        "hammered" => (GlassSheet::Hammered, Cutting::Scattered),
        "bullion" => (GlassSheet::Bullion, Cutting::Centred),
        "flat" => (GlassSheet::Flat, Cutting::Scattered),
        _ => return BTreeMap::new(),
    };
    let kind = |name: &String| {
        let colour = GlassColour::Named(name.clone());
        (name.clone(), GlassDescription { sheet: sheet.clone(), cutting, colour, ..usual.clone() })
    };
    colours.iter().map(kind).collect()
}

/// A list of colours, with commas or plus signs.
pub(crate) fn colours(text: &str) -> Result<Vec<String>, String> {
    let names: Vec<String> = text.split([',', '+']).map(|name| name.trim().to_owned()).collect();
    match names.iter().find(|name| !COLOURS.iter().any(|colour| colour.name == name.as_str())) {
        Some(unknown) => {
            let known = COLOURS.map(|colour| colour.name).join(", ");
            Err(format!("found the colour {unknown:?}, expected some of {known}"))
        }
        None => Ok(names),
    }
}

/// Kinds of glass that are mixed at random, or one for all pieces.
pub(crate) fn mixed(names: &[String]) -> GlassPattern {
    match names {
        [name] => GlassPattern::Uniform(UniformGlass { name: name.clone() }),
        names => {
            let kind = |name: &String| WeightedGlass { name: name.clone(), weight: 1.0 };
            GlassPattern::Mixed(MixedGlass { kinds: names.iter().map(kind).collect() })
        }
    }
}
