//! Usual reliefs of old glass, by the name of how it was made.
//!
//! Wavelengths and amplitudes are assumptions: no measurements of historic panes are published.

use crate::scene::description::ProfileDescription;

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_has_a_relief() {
        assert!(OLD_GLASS.iter().all(|name| profile(name, 1).is_some()) && profile("float", 1).is_none());
    }
}
