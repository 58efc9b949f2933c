//! Usual reliefs of old glass, by the name of how it was made.
//!
//! Wavelengths and amplitudes are assumptions: no measurements of historic panes are published.

use super::description::GlazeRule;
use super::things::FLAT_THICKNESS;
use crate::scene::description::ProfileDescription;
use crate::settings::Triple;
use crate::texture::srgb_to_linear;

/// The names of [`profile`].
pub const OLD_GLASS: [&str; 4] = ["crown", "cylinder", "hammered", "flat"];

/// The usual relief of a face of glass that was made in this way; `None` for a way that is not known.
pub fn profile(name: &str, seed: u64) -> Option<ProfileDescription> {
    match name {
        "crown" => Some(ProfileDescription::Crown { centre: [0.21, -0.34], wavelength: 0.04, amplitude: 2e-5, seed }),
        "cylinder" => Some(ProfileDescription::Cylinder { axis: 90.0, wavelength: 0.04, amplitude: 2e-5, seed }),
        "hammered" => Some(ProfileDescription::Hammered { wavelength: 0.02, amplitude: 1e-4, seed }),
        "flat" => Some(ProfileDescription::Flat),
        _ => None,
    }
}

impl GlazeRule {
    /// The same of coloured glass, which lets this share of the light through between its faces.
    #[must_use]
    pub fn coloured(self, share: Triple) -> Self {
        let travelled = self.thickness.unwrap_or(FLAT_THICKNESS);
        let absorption = share.map(|share| (-libm::log(share.max(1e-4)) / travelled).max(0.0));
        Self { absorption, ..self }
    }
}

/// A colour `#RRGGBB` of the sRGB space, linear.
pub fn hex_colour(text: &str) -> Option<Triple> {
    let digits = text.strip_prefix('#').filter(|digits| digits.len() == 6 && digits.is_ascii())?;
    let channel = |place: usize| {
        let value = u8::from_str_radix(digits.get(place..place + 2)?, 16).ok()?;
        Some(f64::from(srgb_to_linear(f64::from(value) / 255.0)))
    };
    Some([channel(0)?, channel(2)?, channel(4)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_has_a_relief() {
        assert!(OLD_GLASS.iter().all(|name| profile(name, 1).is_some()) && profile("float", 1).is_none());
    }
}
