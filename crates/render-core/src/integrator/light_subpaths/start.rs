//! The start of a light subpath: where it begins, and how densely.

use glam::{DVec2, DVec3};

use crate::geometry::{Face, Hit, Ray};
use crate::light::SourceSample;
use crate::scene::visibility::StraightWay;

/// Points of a light at which it is looked what that brings to a face or an opening.
pub(super) const LOOKS: u32 = 8;

/// The start of a light subpath.
#[derive(Clone, Debug)]
pub(in crate::integrator) struct Start {
    /// Index of the light.
    pub(in crate::integrator) light: u32,
    /// Where it begins.
    pub(in crate::integrator) on: On,
    /// Along which light comes from there.
    pub(in crate::integrator) ray: Ray,
    /// Radiance over density, times the cosine there.
    pub(in crate::integrator) weight: DVec3,
    /// Density of the place and the direction, over that cosine.
    pub(in crate::integrator) density: f64,
}

/// Where a light subpath begins.
#[derive(Clone, Debug)]
pub(in crate::integrator) enum On {
    /// On a face of a pane.
    Face(PlaceOnFace),
    /// On a light, or in an opening. Light comes straight from there, through thin walls at the most.
    Straight {
        /// What it meets behind them.
        hit: Hit,
        /// The way to there.
        way: StraightWay,
        /// How far the light is behind the ray's beginning.
        behind: f64,
    },
}

/// A place of a face to which light comes.
#[derive(Clone, Copy, Debug)]
pub(in crate::integrator) struct PlaceOnFace {
    /// Index of the pane.
    pub(in crate::integrator) pane: u32,
    /// Its face.
    pub(in crate::integrator) face: Face,
    /// The place, in the pane's frame.
    pub(in crate::integrator) point: DVec3,
    /// Gradient of the face there.
    pub(in crate::integrator) gradient: DVec2,
    /// The point of the light.
    pub(in crate::integrator) sample: SourceSample,
}
