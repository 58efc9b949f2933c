//! Which things of a file are windows, and by which names rules find them and nothing else.

use std::collections::{BTreeMap, BTreeSet};

use crate::bsdf::{MaterialDescription, ThinWallMaterial};
use crate::settings::Triple;
use crate::texture::{ColourDescription, ValueDescription};

/// A window of a file for which there is no rule.
#[derive(Clone, Debug, PartialEq)]
pub struct Window {
    /// A name that fits windows alone.
    pub name: String,
    /// Number of panes that it could become.
    pub panes: usize,
    /// A sheet for what lets no light through, or only by chance; `None` for what lets light through as it is.
    pub sheet: Option<ThinWallMaterial>,
}

/// Parts of words of windows, in lower case.
const WINDOWS: [&str; 8] = ["window", "glass", "glazing", "fenster", "vitrail", "vitraux", "fenetre", "vetrat"];

/// Whole words of windows, with `glas` at the end of compounds.
const WORDS: [&str; 4] = ["pane", "panes", "vitre", "vetro"];

/// Words of what is beside the glass.
const BESIDE: [&str; 18] = [
    "frame", "sill", "shutter", "panel", "blind", "curtain", "ledge", "lintel", "mullion", "jamb", "board", "trim",
    "handle", "rahmen", "bank", "laden", "telaio", "volet",
];

/// Whether a name is that of a window.
pub(super) fn is_called_window(name: &str) -> bool {
    let plain = name.to_lowercase().replace('ê', "e");
    let is_word = |word: &str| WORDS.contains(&word) || word.ends_with("glas");
    let is_window = WINDOWS.iter().any(|part| plain.contains(part)) || words(name).any(|word| is_word(&word));
    is_window && !BESIDE.iter().any(|word| plain.contains(word))
}

/// The words of a name, in lower case: `FrontPane_2` is `front` and `pane`.
fn words(name: &str) -> impl Iterator<Item = String> {
    let mut words = vec![String::new()];
    let mut was_lower = false;
    for character in name.chars() {
        if !character.is_alphabetic() || was_lower && character.is_uppercase() {
            words.push(String::new());
        }
        was_lower = character.is_lowercase();
        if character.is_alphabetic() {
            words.last_mut().into_iter().for_each(|word| word.extend(character.to_lowercase()));
        }
    }
    words.into_iter().filter(|word| !word.is_empty())
}

/// A thing without a rule.
pub(super) struct Candidate {
    /// What it is called, then what its mesh is called.
    pub(super) names: Vec<String>,
    /// What its material is called in the file.
    pub(super) material: Option<String>,
    /// Whether the material is that of a window.
    pub(super) is_glass: bool,
    /// Number of panes that it could become.
    pub(super) panes: usize,
    /// See [`Window::sheet`].
    pub(super) sheet: Option<ThinWallMaterial>,
}

/// The things of a file without rules.
#[derive(Default)]
pub(super) struct Windows {
    candidates: Vec<Candidate>,
    /// All names of what is no window.
    others: BTreeSet<String>,
}

impl Windows {
    /// Remembers a thing that is no window.
    pub(super) fn add_other(&mut self, names: impl IntoIterator<Item = String>) {
        self.others.extend(names);
    }

    /// Remembers what may be a window.
    pub(super) fn add(&mut self, candidate: Candidate) {
        self.candidates.push(candidate);
    }

    /// The windows, each name once. Beside a part of glass, the other parts of a thing are its frame, whatever it is
    /// called.
    pub(super) fn settle(mut self) -> Vec<Window> {
        let of_glass: BTreeSet<String> =
            self.candidates.iter().filter(|one| one.is_glass).flat_map(|one| one.names.first().cloned()).collect();
        let is_frame = |one: &Candidate| !one.is_glass && one.names.first().is_some_and(|name| of_glass.contains(name));
        for frame in self.candidates.iter().filter(|one| is_frame(one)) {
            self.others.extend(frame.names.iter().chain(&frame.material).cloned());
        }
        let mut windows: Vec<Window> = Vec::new();
        let mut places: BTreeMap<String, usize> = BTreeMap::new();
        for one in self.candidates.into_iter().filter(|one| !is_frame(one)) {
            let material = one.material.filter(|_| one.is_glass);
            let mut names = one.names.into_iter().chain(material);
            let Some(name) = names.find(|name| !self.others.contains(name)) else { continue };
            let place = *places.entry(name.clone()).or_insert(windows.len());
            match windows.get_mut(place) {
                Some(window) => {
                    window.panes += one.panes;
                    window.sheet = window.sheet.take().or(one.sheet);
                }
                None => windows.push(Window { name, panes: one.panes, sheet: one.sheet }),
            }
        }
        windows
    }
}

/// The sheet that stands for a window of a material and of this thickness, in metres; `None` where light goes through
/// it as it is.
pub(super) fn sheet_for(material: &MaterialDescription, thickness: f64) -> Option<ThinWallMaterial> {
    let clear = ThinWallMaterial::default();
    let body = |index_of_refraction: f64, absorption: Triple| {
        // A box has two faces, of which each becomes a sheet.
        let tint = absorption.map(|coefficient| libm::exp(-coefficient * thickness / 2.0));
        Some(ThinWallMaterial { index_of_refraction, tint: ColourDescription::Colour(tint), ..clear.clone() })
    };
    match material {
        MaterialDescription::ThinWall(_) => None,
        MaterialDescription::Dielectric(glass) => body(glass.index_of_refraction, glass.absorption),
        MaterialDescription::RoughDielectric(glass) => body(glass.index_of_refraction, glass.absorption),
        MaterialDescription::MetallicRoughness(surface)
            if surface.transmission != ValueDescription::number(0.0)
                || surface.opacity != ValueDescription::number(1.0) =>
        {
            None
        }
        _ => Some(clear),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_called_so_and_what_is_beside_the_glass_is_not() {
        for name in ["Window.001", "stained_glass", "FrontPane", "Kirchenfenster", "Buntglas", "Fenêtre sud", "pane 2"]
        {
            assert!(is_called_window(name), "{name}");
        }
        for name in ["OakPanel.001", "WindowSill", "window frame", "GlazedTile", "Panel", "Glasgow", "Fensterrahmen"] {
            assert!(!is_called_window(name), "{name}");
        }
    }

    fn candidate(name: &str, material: &str, is_glass: bool) -> Candidate {
        let (names, material) = (vec![name.to_owned()], Some(material.to_owned()));
        Candidate { names, material, is_glass, panes: 1, sheet: None }
    }

    fn settled(candidates: Vec<Candidate>, others: &[&str]) -> Vec<(String, usize)> {
        let mut windows = Windows::default();
        candidates.into_iter().for_each(|candidate| windows.add(candidate));
        windows.add_other(others.iter().map(|name| (*name).to_owned()));
        windows.settle().into_iter().map(|window| (window.name, window.panes)).collect()
    }

    #[test]
    fn a_window_has_a_name_that_fits_nothing_else() {
        let named = |name: &str, panes| (name.to_owned(), panes);
        // A house of one thing, whose glass only its material tells.
        assert_eq!(settled(vec![candidate("House", "Glass", true)], &["House", "Stone"]), [named("Glass", 1)]);
        // Windows with frames.
        let frames = vec![candidate("Window", "Glass", true), candidate("Window", "Oak", false)];
        assert_eq!(settled(frames, &[]), [named("Glass", 1)]);
        let two = vec![candidate("Window 1", "Glass", true), candidate("Window 2", "Glass", true)];
        assert_eq!(settled(two, &["Wall"]), [named("Window 1", 1), named("Window 2", 1)]);
        assert_eq!(settled(vec![candidate("Window", "Stone", false)], &["Window", "Stone"]), []);
    }
}
