//! The things of imported files, of leaded windows, of painted panes and of daylight among those of the scene.

use std::borrow::Cow;
use std::collections::BTreeSet;

use super::SceneDescription;
use crate::light::LightDescription;
use crate::scene::import::{Expansion, expand};
use crate::scene::painting::take_paint;
use crate::scene::window::{self, WindowExpansion};
use crate::scene::{Assets, BuildStep};
use crate::settings::check::Quoted;
use crate::settings::limits::MAX_PANES;
use crate::settings::{JsonPath, SceneError};

/// Most notes on the imports of a scene. Those beyond are counted in the last one.
pub const MAX_NOTES: usize = 100;

/// Most characters of such a note.
pub const MAX_NOTE_CHARACTERS: usize = 300;

impl SceneDescription {
    /// The same scene without imports and windows: their things are among its own.
    ///
    /// # Errors
    ///
    /// When a file or a window makes no sense, or what is in it is no part of a valid scene.
    pub fn expanded(&self, assets: &Assets) -> Result<Cow<'_, Self>, SceneError> {
        Ok(self.expanded_with_notes(assets)?.0)
    }

    /// The same, and what is in the imported files and not in the scene, or differs: at most [`MAX_NOTES`] sentences
    /// of [`MAX_NOTE_CHARACTERS`] characters.
    ///
    /// # Errors
    ///
    /// As [`Self::expanded`].
    pub fn expanded_with_notes(&self, assets: &Assets) -> Result<(Cow<'_, Self>, Vec<String>), SceneError> {
        self.expanded_step_by_step(assets, &mut |_| ())
    }

    /// The same. Tells of each step before it begins.
    ///
    /// # Errors
    ///
    /// As [`Self::expanded`].
    pub(crate) fn expanded_step_by_step(
        &self,
        assets: &Assets,
        begin: &mut dyn FnMut(BuildStep<'_>),
    ) -> Result<(Cow<'_, Self>, Vec<String>), SceneError> {
        if self.is_expanded() {
            return Ok((Cow::Borrowed(self), Vec::new()));
        }
        let mut scene = self.clone();
        let own: BTreeSet<&str> = self.lights.iter().filter_map(|light| light.mesh()).collect();
        let mut notes = Vec::new();
        if !self.imports.is_empty() {
            begin(BuildStep::Imports { count: self.imports.len() });
        }
        for (index, import) in std::mem::take(&mut scene.imports).iter().enumerate() {
            let root = JsonPath::Root;
            let imports = root.member("imports");
            let expansion = expand(import, assets, &imports.element(index))?;
            notes.extend(expansion.remarks());
            let Expansion { materials, meshes, panes, lights, leaded, .. } = expansion;
            scene.materials.extend(materials);
            scene.meshes.extend(meshes);
            scene.panes.extend(panes);
            scene.add_window(leaded, &imports.element(index))?;
            // A light of the scene itself takes the place of one that the file makes of the same mesh.
            let is_own = |light: &LightDescription| light.mesh().is_some_and(|mesh| own.contains(mesh));
            scene.lights.extend(lights.into_iter().filter(|light| !is_own(light)));
        }
        for (index, window) in std::mem::take(&mut scene.windows).iter().enumerate() {
            begin(BuildStep::Windows { done: index, count: self.windows.len() });
            let root = JsonPath::Root;
            let windows = root.member("windows");
            let path = windows.element(index);
            scene.add_window(window::expand(window, &path)?, &path)?;
        }
        for (mesh, material) in take_paint(&mut scene.panes, &scene.sheets) {
            scene.materials.entry(mesh.material.clone()).or_insert(material);
            scene.meshes.push(mesh);
        }
        scene.take_daylight()?;
        scene.validate().map_err(|error| scene.named(error))?;
        Ok((Cow::Owned(scene), bounded(notes)))
    }

    /// Adds what a window at `path` is made of.
    fn add_window(&mut self, window: WindowExpansion, path: &JsonPath<'_>) -> Result<(), SceneError> {
        let WindowExpansion { materials, meshes, sheets, panes } = window;
        let count = self.panes.len() + panes.len();
        if count > MAX_PANES {
            let found = format!("a window with which there are {count} panes");
            let expected = format!("larger pieces or fewer windows: a scene has at most {MAX_PANES} panes");
            return Err(SceneError::value(path, found, expected));
        }
        if let Some(name) = sheets.keys().find(|name| self.sheets.contains_key(*name)) {
            let found = format!("a name with which a sheet of it is called {}, as another one", Quoted(name));
            return Err(SceneError::value(&path.member("name"), found, "another name"));
        }
        for (name, material) in materials {
            self.materials.entry(name).or_insert(material);
        }
        self.sheets.extend(sheets);
        self.meshes.extend(meshes);
        self.panes.extend(panes);
        Ok(())
    }

    /// Whether all of its things stand in the file: there are no imports, windows, painted panes or daylight.
    pub(super) fn is_expanded(&self) -> bool {
        let are_lights_there = self.daylight.is_none();
        let are_things_there = self.imports.is_empty() && self.windows.is_empty();
        are_lights_there && are_things_there && self.panes.iter().all(|pane| pane.paint.is_none())
    }

    /// An error about a thing that the scene file does not have, with its name in place of its number.
    pub(crate) fn named(&self, error: SceneError) -> SceneError {
        let name = |list: &str, index: usize| match list {
            "meshes" => self.meshes.get(index).map(|mesh| mesh.name.clone()),
            "panes" => self.panes.get(index).map(|pane| pane.name.clone()),
            "lights" => self.lights.get(index).map(|light| light.name().to_owned()),
            _ => None,
        };
        error.with_path(|path| {
            let (list, rest) = path.split_once('[')?;
            let (number, rest) = rest.split_once(']')?;
            Some(format!("{list}[{}]{rest}", name(list, number.parse().ok()?)?))
        })
    }
}

/// The first notes, none of which is long. Names in files are as long as strangers like.
fn bounded(mut notes: Vec<String>) -> Vec<String> {
    if notes.len() > MAX_NOTES {
        let left = notes.len() - (MAX_NOTES - 1);
        notes.truncate(MAX_NOTES - 1);
        notes.push(format!("and {left} more"));
    }
    for note in &mut notes {
        if let Some((end, _)) = note.char_indices().nth(MAX_NOTE_CHARACTERS) {
            let kept = note[..end].char_indices().next_back().map_or(0, |(start, _)| start);
            note.replace_range(kept.., "\u{2026}");
        }
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_are_few_and_short_and_say_what_they_leave_out() {
        let notes = bounded((0..250).map(|number| format!("{number} {}", "\u{e9}".repeat(500))).collect());
        assert_eq!((notes.len(), notes[99].as_str()), (100, "and 151 more"));
        assert!(notes[..99].iter().all(|note| note.chars().count() == 300 && note.ends_with('\u{2026}')));
        let few = vec!["\u{e9}".repeat(300)];
        assert_eq!(bounded(few.clone()), few);
    }
}
