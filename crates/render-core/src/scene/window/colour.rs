//! Colours of historical glass.
//!
//! Three channels stand for a spectrum. Linear Rec. 709 has no colour as pure as cobalt or ruby glass. Light through
//! two coloured glasses is not that of their spectra.

use std::fmt;

use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use crate::settings::check::{Quoted, check_triple};
use crate::settings::{Check, JsonPath, SceneError, Triple};

/// What colours a kind of glass: the body, and layers on its faces that are thin against it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Tint {
    /// Absorption coefficient of the body for red, green and blue light, per metre.
    #[schemars(inner(range(min = 0.0)))]
    pub body: Triple,
    /// Absorbance (natural logarithm) of a flashed layer on the outer face, for light that crosses it straight.
    #[schemars(inner(range(min = 0.0, max = 100.0)))]
    pub flash: Triple,
    /// Absorbance of silver stain on the outer face, for light that crosses it straight.
    #[schemars(inner(range(min = 0.0, max = 100.0)))]
    pub stain: Triple,
}

/// The colour of a kind of glass: a name, or an object.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum GlassColour {
    /// The name of a historical colour.
    Named(String),
    /// What colours it.
    Tint(Tint),
}

impl<'de> Deserialize<'de> for GlassColour {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NameOrTint;

        impl<'de> Visitor<'de> for NameOrTint {
            type Value = GlassColour;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str("the name of a colour, or an object with body, flash and stain")
            }

            fn visit_str<E: Error>(self, name: &str) -> Result<Self::Value, E> {
                Ok(GlassColour::Named(name.to_owned()))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                Tint::deserialize(MapAccessDeserializer::new(map)).map(GlassColour::Tint)
            }
        }

        deserializer.deserialize_any(NameOrTint)
    }
}

impl Default for GlassColour {
    fn default() -> Self {
        Self::Named("clear".to_owned())
    }
}

/// A colour of glass that was common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HistoricalColour {
    /// Its name in a scene file.
    pub name: &'static str,
    /// What colours it.
    pub tint: Tint,
    /// Thickness of its sheets, metres.
    pub thickness: f64,
    /// What it was, and where the numbers come from.
    pub provenance: &'static str,
}

/// A body that lets these shares of light through between its faces, over a thickness in metres.
const fn body(absorption: Triple) -> Tint {
    Tint { body: absorption, flash: [0.0; 3], stain: [0.0; 3] }
}

/// Thickness of crown and cylinder glass for windows, metres.
const WINDOW_GLASS: f64 = 0.0018;

/// Thickness of the coloured glass of medieval windows, metres.
const POT_METAL: f64 = 0.003;

/// The colours that have a name.
///
/// Coefficients of the soda-lime glasses follow from measured spectra. All others are chosen to match published
/// luminous transmittances at 3 mm.
pub const COLOURS: [HistoricalColour; 13] = [
    HistoricalColour {
        name: "clear",
        tint: body([13.9, 4.5, 5.35]),
        thickness: WINDOW_GLASS,
        provenance: "modern clear soda-lime glass (Rubin 1985), under D65",
    },
    HistoricalColour {
        name: "greenish",
        tint: body([64.7, 25.5, 27.2]),
        thickness: WINDOW_GLASS,
        provenance: "green soda-lime glass with 0.5 % iron (Rubin 1985), near that of crown and cylinder glass of the \
                     18th and 19th century",
    },
    HistoricalColour {
        name: "potash",
        tint: body([140.0, 95.0, 170.0]),
        thickness: POT_METAL,
        provenance: "medieval potash glass with about 1 % iron: 0.74 of light at 3 mm, estimated from its composition \
                     (Schalm et al., Verre et Histoire)",
    },
    HistoricalColour {
        name: "ruby",
        tint: Tint { body: [140.0, 95.0, 170.0], flash: [1.3, 5.4, 4.6], stain: [0.0; 3] },
        thickness: POT_METAL,
        provenance: "copper ruby flashed on potash glass, about 4 % of light at 3 mm (rule of thumb: 1 to 5 %)",
    },
    HistoricalColour {
        name: "gold_ruby",
        tint: Tint { body: [13.9, 4.5, 5.35], flash: [0.35, 2.6, 1.5], stain: [0.0; 3] },
        thickness: POT_METAL,
        provenance: "gold ruby flashed on clear glass, from the 17th century on; estimate",
    },
    HistoricalColour {
        name: "cobalt",
        tint: body([1150.0, 1000.0, 330.0]),
        thickness: POT_METAL,
        provenance: "cobalt blue, about 7 % of light, with the red that it leaks beyond 690 nm (Ceglia et al. 2012)",
    },
    HistoricalColour {
        name: "smalt",
        tint: body([620.0, 420.0, 120.0]),
        thickness: POT_METAL,
        provenance: "pale cobalt blue of the 15th to 17th century; estimate",
    },
    HistoricalColour {
        name: "turquoise",
        tint: body([900.0, 330.0, 300.0]),
        thickness: POT_METAL,
        provenance: "copper (Cu2+) blue, band at 780 nm; estimate",
    },
    HistoricalColour {
        name: "green",
        tint: body([900.0, 480.0, 950.0]),
        thickness: POT_METAL,
        provenance: "copper and iron green, about 19 % of light (rule of thumb: 5 to 20 %)",
    },
    HistoricalColour {
        name: "purple",
        tint: body([430.0, 900.0, 520.0]),
        thickness: POT_METAL,
        provenance: "manganese (Mn3+) purple, band at 490 nm, about 12 % of light; estimate",
    },
    HistoricalColour {
        name: "murrey",
        tint: body([250.0, 620.0, 700.0]),
        thickness: POT_METAL,
        provenance: "manganese brown-pink, as for flesh; estimate",
    },
    HistoricalColour {
        name: "amber",
        tint: body([180.0, 430.0, 1200.0]),
        thickness: POT_METAL,
        provenance: "iron-sulphur amber, band at 410 nm; estimate",
    },
    HistoricalColour {
        name: "silver_stain",
        tint: Tint { body: [140.0, 95.0, 170.0], flash: [0.0; 3], stain: [0.06, 0.35, 2.6] },
        thickness: POT_METAL,
        provenance: "silver (Ag0) stain on potash glass, from the 14th century on, band at 400 to 430 nm, about half \
                     the light (rule of thumb: 40 to 60 %)",
    },
];

impl GlassColour {
    /// What colours it; `None` for a name that is not known.
    pub fn tint(&self) -> Option<Tint> {
        match self {
            Self::Named(name) => named(name).map(|colour| colour.tint),
            Self::Tint(tint) => Some(*tint),
        }
    }

    /// Usual thickness of such glass, metres; that of window glass for a tint, or for a name that is not known.
    pub(super) fn usual_thickness(&self) -> f64 {
        let Self::Named(name) = self else { return WINDOW_GLASS };
        named(name).map_or(WINDOW_GLASS, |colour| colour.thickness)
    }

    pub(super) fn check(&self, path: &JsonPath<'_>) -> Check {
        match self {
            Self::Named(name) if named(name).is_none() => {
                let known: Vec<&str> = COLOURS.iter().map(|colour| colour.name).collect();
                let expected = format!("{}, or an object with body, flash and stain", known.join(", "));
                Err(SceneError::value(path, Quoted(name), expected))
            }
            Self::Named(_) => Ok(()),
            Self::Tint(Tint { body, flash, stain }) => {
                check_triple(*body, 0.0, 1e9, &path.member("body"))?;
                check_triple(*flash, 0.0, 100.0, &path.member("flash"))?;
                check_triple(*stain, 0.0, 100.0, &path.member("stain"))
            }
        }
    }
}

/// The historical colour of this name.
pub(super) fn named(name: &str) -> Option<&'static HistoricalColour> {
    COLOURS.iter().find(|colour| colour.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_manual_has_each_colour_with_its_provenance() {
        let manual = include_str!("../../../../../docs/scene-format.md");
        for HistoricalColour { name, tint, provenance, .. } in COLOURS {
            let channel = |channel: usize| {
                let absorbance = 0.003 * tint.body[channel] + tint.flash[channel] + tint.stain[channel];
                let through = libm::exp(-absorbance);
                if through < 0.01 { format!("{through:.3}") } else { format!("{through:.2}") }
            };
            let row = format!("| `{name}` | {}, {}, {} | {provenance} |\n", channel(0), channel(1), channel(2));
            assert!(manual.contains(&row), "docs/scene-format.md lacks {row}");
        }
    }
}
