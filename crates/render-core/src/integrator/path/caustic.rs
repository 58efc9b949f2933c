//! Which light is caustic: between a light and the surface that scatters it first, it has met glass or water.
//!
//! Glass and water are panes and the smooth boundaries of bodies. A thin wall is glass where it mirrors light. Light
//! that goes straight through it is not caustic. Mirrors of metal make no caustics either.

use glam::DVec3;

use crate::bsdf::Bsdf;
use crate::scene::Scene;
use crate::specular::SpecularEvent;

/// Light that a vertex gathers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Gathered {
    /// All of it.
    pub(super) all: DVec3,
    /// The part that is caustic.
    pub(super) caustic: DVec3,
}

/// Which specular things of a scene mirror light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mirrors {
    /// Glass and water alone.
    Glass,
    /// Metal alone.
    Metal,
    /// Both.
    Both,
}

impl Gathered {
    pub(super) fn add(&mut self, light: DVec3, is_caustic: bool) {
        self.all += light;
        if is_caustic {
            self.caustic += light;
        }
    }
}

impl Mirrors {
    pub(super) fn of(scene: &Scene) -> Self {
        let specular = || scene.meshes().iter().filter(|mesh| mesh.is_specular());
        let has_glass = !scene.panes().is_empty() || specular().any(|mesh| mesh.interior().is_some());
        match (specular().any(|mesh| mesh.interior().is_none()), has_glass) {
            (false, _) => Self::Glass,
            (true, false) => Self::Metal,
            (true, true) => Self::Both,
        }
    }
}

/// Whether light that a surface sends into a single direction has met glass or water there.
pub(super) fn is_glass(bsdf: &dyn Bsdf, event: SpecularEvent) -> bool {
    let is_mirrored_by_wall = bsdf.as_straight().is_some() && event == SpecularEvent::Reflection;
    bsdf.interior().is_some() || is_mirrored_by_wall
}
