//! What is exported.

use clerestory_render_core::scene::{Assets, Scene, SceneParts};

/// A scene that is exported.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its things.
    pub parts: SceneParts<'a>,
    /// The files that it names.
    pub assets: &'a Assets,
    /// What was built of them.
    pub scene: &'a Scene,
    /// Largest number of vertices between camera and light.
    pub max_depth: u32,
    /// The light path expression to which it is restricted.
    pub path_filter: Option<&'a str>,
}
