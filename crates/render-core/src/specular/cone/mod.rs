//! `cone`: light through glass by forward sampling of the cone from which it can come.
//!
//! Rays start at the shading point and go into the deflection window of the whole light. They are traced exactly
//! through both faces, and count when they meet the light. No root is sought. The solid angle of the window bounds the
//! weights. The estimate is unbiased for every light with an extent, because the window is a true bound. It is the
//! house's own reference generator. A point light is never met: its light through glass is missing.
//!
//! Behind rippled glass the sun shows as a few small patches in a large window. The rays are spread over the parts of
//! the window that may hold one (`light_view`).

mod settings;

pub use settings::ConeSettings;

use super::assumed_density::assumed_density;
use super::effort::Effort;
use super::light_view::LightView;
use super::{Arrival, SpecularEvent, SpecularMethod, SpecularPath, THROUGH_PANE, coverage};
use crate::scene::Scene;
use crate::scene::ShadingPoint;
use clerestory_film::SampleStream;
use clerestory_film::counters::Counters;

/// Forward sampling of the cone from which a light's rays can come through each pane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cone;

impl SpecularMethod for Cone {
    fn chains(&self) -> Vec<Vec<SpecularEvent>> {
        vec![THROUGH_PANE.to_vec()]
    }

    fn sample_li(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        light: u32,
        _: &[SpecularEvent],
        stream: &mut SampleStream,
        counters: &mut Counters,
        arrive: &mut dyn FnMut(Arrival),
    ) {
        let random = stream.next_2d();
        let view = LightView::new(scene, point, light, &Effort::at(point), None, counters);
        view.cast(random, counters, &mut |light_sample, _| arrive(light_sample.arrival));
    }

    fn owns(&self, scene: &Scene, point: &ShadingPoint, path: &SpecularPath<'_>, _: &mut Counters) -> bool {
        coverage::through_one_pane(scene, point, path).is_some()
    }

    fn density(&self, scene: &Scene, point: &ShadingPoint, path: &SpecularPath<'_>, _: &mut Counters) -> Option<f64> {
        let pane = coverage::through_one_pane(scene, point, path)?;
        Some(assumed_density(scene, point, path.light, pane, &Effort::at(point)))
    }
}
