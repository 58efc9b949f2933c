//! How options say what leaded windows are made of.

use std::str::FromStr;

use clerestory_glazing::{
    Border, Diamonds, Filling, GlassPattern, MixedGlass, Rectangles, Roundels, UniformGlass, WeightedGlass,
};

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
