//! Directions in which the lights of a scene may be seen.
//!
//! Indoors nearly every ray towards an environment ends on a wall. So half the rays to it go through an opening, and
//! half where the environment is bright. One density stands for both: no light is lost where an opening is not seen,
//! and none is found twice. Bitterli, Novak and Jarosz 2015, "Portal-Masked Environment Map Sampling", sample by the
//! openings alone.

use clerestory_film::SampleStream;

use super::Scene;
use crate::geometry::Ray;
use crate::light::{LiSample, LightHit, Receiver, with_finer_places};

/// The part of the rays to an environment that go through an opening.
const THROUGH_OPENINGS: f64 = 0.5;

impl Scene {
    /// Draws a direction in which a light is seen from a point if nothing is in the way; `None` when it cannot be.
    pub fn sample_li(&self, light: u32, receiver: &Receiver, stream: &mut SampleStream) -> Option<LiSample> {
        let emitter = &self.lights()[light as usize];
        let random = emitter.random(stream);
        let Some(openings) = self.openings().filter(|_| emitter.is_environment()) else {
            return emitter.sample_li(receiver, random);
        };
        let coarse = stream.next_1d();
        let choice = with_finer_places(coarse, stream);
        let direction = if choice < THROUGH_OPENINGS {
            openings.sample(self.accelerator(), receiver, choice / THROUGH_OPENINGS, random)?
        } else {
            emitter.sample_li(receiver, random)?.direction
        };
        let ray = Ray::new(receiver.position, direction);
        let hit = emitter.intersect(&ray)?;
        let pdf = self.pdf_li(light, receiver, &ray, &hit);
        (pdf > 0.0 && pdf.is_finite()).then(|| LiSample {
            direction,
            distance: hit.distance,
            weight: hit.radiance / pdf,
            pdf: Some(pdf),
        })
    }

    /// Density per solid angle with which [`Self::sample_li`] draws the direction of a ray from the point that meets
    /// the light at `hit`.
    pub fn pdf_li(&self, light: u32, receiver: &Receiver, ray: &Ray, hit: &LightHit) -> f64 {
        let emitter = &self.lights()[light as usize];
        let of_light = emitter.pdf_li(receiver, ray, hit);
        match self.openings().filter(|_| emitter.is_environment()) {
            Some(openings) => {
                (1.0 - THROUGH_OPENINGS) * of_light
                    + THROUGH_OPENINGS * openings.pdf(self.accelerator(), receiver, ray.direction)
            }
            None => of_light,
        }
    }
}
