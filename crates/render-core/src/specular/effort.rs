//! What is spent on the light that arrives at a shading point through panes.

use crate::scene::ShadingPoint;

/// Slopes that spread the end points by less than this part of the light's extent are not worth telling apart.
pub(super) const SETTLED: f64 = 0.5;

/// What is spent on the light that arrives at one point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    /// Rays over all panes, at the least.
    pub(super) rays: u32,
    /// Rays for each window, and for each pane that is smaller than the light, up to a limit: these cost about as much
    /// as to find it does.
    pub(super) rays_for: [u32; 2],
    /// Parts into which the windows of all panes are cut, about, at the most.
    pub(super) parts: usize,
    /// Whether panes that show no point of the light on a fold get no rays: a search finds it there.
    pub(super) is_beside_search: bool,
}

impl Effort {
    /// Light at the first diffuse vertex of a path is seen in the picture as it falls; at later vertices the path's
    /// other choices make most of the noise.
    pub(super) fn at(point: &ShadingPoint) -> Self {
        match point.bounces {
            0 => Self { rays: 16, rays_for: [7, 2], parts: 48, is_beside_search: false },
            1 => Self { rays: 2, rays_for: [0; 2], parts: 16, is_beside_search: false },
            _ => Self { rays: 1, rays_for: [0; 2], parts: 8, is_beside_search: false },
        }
    }

    /// The same where a search finds what comes through panes that show no point of the light on a fold. At later
    /// vertices of a path, it would cost more than the ray or two that it saves.
    pub(super) fn beside_search(point: &ShadingPoint) -> Self {
        Self { is_beside_search: point.bounces == 0, ..Self::at(point) }
    }
}
