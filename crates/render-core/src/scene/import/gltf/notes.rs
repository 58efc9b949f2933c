//! What this build leaves out of a file: one sentence for each kind, with a count.

use std::collections::BTreeMap;

use super::extensions::{SUPPORTED, consequence};
use super::schema::{Document, Extensions};

/// A kind of thing that is left out, in the order of the sentences.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Note {
    Animations,
    Skins,
    MorphTargets,
    PointsAndLines,
    WithoutPositions,
    TextureSets,
    TexturesWithoutPicture,
    LightRanges,
}

impl Note {
    /// The sentence about `count` of them.
    fn sentence(self, count: usize) -> String {
        match self {
            Self::Animations => format!("animations are left out ({count}): nodes stand where they are stored"),
            Self::Skins => format!("skins are left out ({count}): meshes have the shape in which they are stored"),
            Self::MorphTargets => {
                format!("morph targets are left out (primitives: {count}): meshes have their base shape")
            }
            Self::PointsAndLines => format!("points and lines are left out (primitives: {count})"),
            Self::WithoutPositions => format!("geometry without positions is left out (primitives: {count})"),
            Self::TextureSets => {
                format!("textures with a third or later set of texture coordinates are left out ({count})")
            }
            Self::TexturesWithoutPicture => {
                format!("textures without a PNG, JPEG or WebP picture are left out ({count})")
            }
            Self::LightRanges => format!("ranges of lights are left out ({count}): light does not end at a distance"),
        }
    }
}

/// Counts what is left out.
#[derive(Debug, Default)]
pub(super) struct Notes(BTreeMap<Note, usize>);

impl Notes {
    /// Counts one.
    pub(super) fn add(&mut self, note: Note) {
        self.add_all(note, 1);
    }

    /// Counts several.
    pub(super) fn add_all(&mut self, note: Note, count: usize) {
        if count > 0 {
            *self.0.entry(note).or_default() += count;
        }
    }

    /// All sentences, with those about extensions that the file uses and this build does not know.
    pub(super) fn sentences(&self, document: &Document<'_>) -> Vec<String> {
        let mut sentences: Vec<String> = self.0.iter().map(|(note, count)| note.sentence(*count)).collect();
        let extensions = unsupported(document);
        for (name, uses) in extensions.iter().take(MAX_EXTENSIONS) {
            let uses = if *uses > 0 { format!(" ({uses})") } else { String::new() };
            let shown: String = name.chars().filter(|sign| !sign.is_control()).take(MAX_NAME).collect();
            sentences.push(format!("the extension {shown} is left out{uses}{}", consequence(name)));
        }
        if extensions.len() > MAX_EXTENSIONS {
            sentences.push(format!("{} more extensions are left out", extensions.len() - MAX_EXTENSIONS));
        }
        sentences
    }
}

/// Extensions that are reported by name.
const MAX_EXTENSIONS: usize = 30;

/// Characters of such a name.
const MAX_NAME: usize = 80;

/// The extensions that the file uses and this build does not, and how many objects have each.
fn unsupported<'d>(document: &'d Document<'_>) -> BTreeMap<&'d str, usize> {
    let mut uses: BTreeMap<&str, usize> = document.extensions_used.iter().map(|name| (name.as_str(), 0)).collect();
    // Extensions of the file itself only hold what objects refer to.
    document.extensions.keys().for_each(|name| _ = uses.entry(name.as_str()).or_default());
    let mut count = |extensions: &'d Extensions| {
        extensions.keys().for_each(|name| *uses.entry(name.as_str()).or_default() += 1);
    };
    document.scenes.iter().for_each(|scene| count(&scene.extensions));
    document.nodes.iter().for_each(|node| count(&node.extensions));
    document.textures.iter().for_each(|texture| count(&texture.extensions));
    document.materials.iter().for_each(|material| count(&material.extensions));
    document.meshes.iter().for_each(|mesh| {
        count(&mesh.extensions);
        mesh.primitives.iter().for_each(|primitive| count(&primitive.extensions));
    });
    uses.retain(|name, _| !SUPPORTED.contains(name));
    uses
}
