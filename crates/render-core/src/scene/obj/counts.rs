//! How much an OBJ file holds, so that its size is known before memory is taken.

use super::statements::{Kind, Statements};
use crate::scene::text::Words;

/// What a file holds.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counts {
    pub(super) positions: usize,
    pub(super) texture_coordinates: usize,
    pub(super) normals: usize,
    pub(super) triangles: usize,
    /// Groups with faces.
    pub(super) groups: usize,
}

impl Counts {
    pub(super) fn of(bytes: &[u8]) -> Self {
        let mut counts = Self::default();
        let mut is_new_group = true;
        let mut statements = Statements::new(bytes);
        while let Some(statement) = statements.next() {
            match statement.kind {
                Kind::Position => counts.positions += 1,
                Kind::TextureCoordinate => counts.texture_coordinates += 1,
                Kind::Normal => counts.normals += 1,
                Kind::Face => {
                    counts.triangles += Words(statement.arguments).count().saturating_sub(2);
                    counts.groups += usize::from(is_new_group);
                    is_new_group = false;
                }
                Kind::Object | Kind::Group => is_new_group = true,
                Kind::Material | Kind::Libraries => {}
            }
        }
        counts
    }

    /// Things that corners name.
    pub(super) fn named(&self) -> usize {
        self.positions + self.texture_coordinates + self.normals
    }
}
