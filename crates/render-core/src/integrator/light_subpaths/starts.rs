//! Where light subpaths begin: on the first face of a pane that a light meets, in an opening, or on a light itself.
//!
//! Light that goes through panes begins on one of their faces. What comes straight from a light begins on that, if it
//! has a place. Straight light of suns and skies begins in openings: it goes through thin walls. A light and one of
//! these are chosen together, by what the light brings there.

use clerestory_film::SampleStream;
use clerestory_film::counters::Counters;
use glam::DVec3;
use rayon::prelude::*;

use super::on_face::{self, FACES};
use super::start::{On, Start};
use super::{on_light, on_opening};
use crate::geometry::{Face, Ray, SurfaceId};
use crate::light::{LightHit, with_finer_places};
use crate::scene::Scene;
use crate::scene::openings::{area, seen_area};

/// The part of all starts on faces, and of all others, that is spread over them alike, whatever the looks have found.
const EVENLY: f64 = 0.1;

/// A kind of starts: what looks have found that they bring, and how large they are, each summed over all.
#[derive(Clone, Copy, Debug)]
struct Kind {
    brought: f64,
    even: f64,
    /// Whether starts are drawn even where looks have found nothing: light of points may be found by nothing else.
    is_needed: bool,
}

impl Kind {
    fn is_used(&self) -> bool {
        self.brought > 0.0 || (self.is_needed && self.even > 0.0)
    }

    /// The part of its starts that a place gets.
    fn part(&self, brought: f64, even: f64) -> f64 {
        match self.is_used() {
            false => 0.0,
            true if self.brought == 0.0 => even / self.even,
            true => (1.0 - EVENLY) * brought / self.brought + EVENLY * even / self.even,
        }
    }
}

/// The starts of a scene's light subpaths.
#[derive(Debug)]
pub(in crate::integrator) struct Starts {
    /// For each light: each face of each pane; then the light itself, or each opening for lights at infinity.
    probabilities: Vec<f64>,
    /// Their sums, up to each.
    sums: Vec<f64>,
    /// Where those of each light begin.
    firsts: Vec<usize>,
    /// Of all panes.
    faces: usize,
}

impl Starts {
    /// The starts of a scene; `None` where there are none.
    pub(in crate::integrator) fn new(scene: &Scene) -> Option<Self> {
        let faces = FACES.len() * scene.panes().len();
        let [mut brought, mut even]: [Vec<f64>; 2] = [Vec::new(), Vec::new()];
        let mut firsts = Vec::with_capacity(scene.lights().len());
        for (light, source) in (0u32..).zip(scene.lights()) {
            firsts.push(brought.len());
            brought.par_extend((0..faces).into_par_iter().map(|number| {
                let face = face(number);
                if scene.media().is_immersed(face.0) { 0.0 } else { on_face::brought(scene, light, face) }
            }));
            even.extend((0..faces).map(|number| {
                let (pane, _) = face(number);
                if scene.media().is_immersed(pane) { 0.0 } else { scene.panes()[pane as usize].outline.area() }
            }));
            if source.bounding_box().is_some() {
                let kept = on_light::kept(scene, light);
                even.push(f64::from(kept.is_some()));
                brought.push(kept.unwrap_or(0.0));
            } else {
                let openings = scene.straight_triangles();
                even.extend(openings.iter().map(|opening| area(scene.accelerator().corners(*opening))));
                brought.par_extend(openings.par_iter().map(|opening| on_opening::brought(scene, light, *opening)));
            }
        }
        let starts = Self { sums: Vec::new(), probabilities: Vec::new(), firsts, faces };
        let is_straight: Vec<bool> = (0..brought.len()).map(|place| starts.slot(place).1 >= faces).collect();
        let total = |parts: &[f64], straight: bool| {
            let of_kind = parts.iter().zip(&is_straight).filter(|(_, is_straight)| **is_straight == straight);
            of_kind.map(|(part, _)| part).sum::<f64>()
        };
        let has_points = scene.lights().iter().any(|light| light.is_delta());
        let kinds = [false, true].map(|straight| Kind {
            brought: total(&brought, straight),
            even: total(&even, straight),
            is_needed: has_points && !straight,
        });
        let used = kinds.iter().filter(|kind| kind.is_used()).count();
        let probability =
            |place: usize| kinds[usize::from(is_straight[place])].part(brought[place], even[place]) / used as f64;
        let probabilities: Vec<f64> = (0..brought.len()).map(probability).collect();
        let mut sum = 0.0;
        let sums = probabilities.iter().map(|part| {
            sum += part;
            sum
        });
        let sums = sums.collect();
        (used > 0).then_some(Self { sums, probabilities, ..starts })
    }

    /// Draws a start; `None` where nothing comes from there.
    pub(in crate::integrator) fn sample(
        &self,
        scene: &Scene,
        stream: &mut SampleStream,
        counters: &mut Counters,
    ) -> Option<Start> {
        let coarse = stream.next_1d();
        // Places may be many, and some seldom drawn.
        let chosen = with_finer_places(coarse, stream) * self.sums.last()?;
        let place = self.sums.partition_point(|sum| *sum <= chosen).min(self.sums.len() - 1);
        let (light, slot) = self.slot(place);
        let start = if slot < self.faces {
            on_face::start(scene, light, face(slot), stream, counters)?
        } else if scene.lights()[light as usize].bounding_box().is_some() {
            on_light::start(scene, light, stream, counters)?
        } else {
            return self.in_opening(scene, light, slot - self.faces, stream, counters);
        };
        let probability = self.probabilities[place];
        Some(Start { weight: start.weight / probability, density: start.density * probability, ..start })
    }

    /// The light of a place among all, and the place among that light's.
    fn slot(&self, place: usize) -> (u32, usize) {
        let light = self.firsts.partition_point(|first| *first <= place) - 1;
        (light as u32, place - self.firsts[light])
    }

    /// A start in an opening.
    fn in_opening(
        &self,
        scene: &Scene,
        light: u32,
        number: usize,
        stream: &mut SampleStream,
        counters: &mut Counters,
    ) -> Option<Start> {
        let opening = *scene.straight_triangles().get(number)?;
        let on_opening::Beam { ray, hit, way, weight, density } =
            on_opening::beam(scene, light, opening, stream, counters)?;
        let place_density = self.density_in_openings(scene, light, &way.walls, ray.direction);
        (place_density > 0.0).then(|| Start {
            light,
            on: On::Straight { hit, way, behind: f64::INFINITY },
            ray,
            weight: weight / place_density,
            density: density * place_density,
        })
    }

    /// The density of a line that goes through thin walls, for each unit of area across it.
    fn density_in_openings(&self, scene: &Scene, light: u32, walls: &[u32], direction: DVec3) -> f64 {
        let of_light = self.firsts[light as usize] + self.faces;
        let densities = walls.iter().filter_map(|wall| {
            let number = scene.straight_triangles().binary_search(wall).ok()?;
            let seen = seen_area(scene.accelerator().corners(*wall), direction);
            (seen > 0.0).then(|| self.probabilities[of_light + number] / seen)
        });
        densities.sum()
    }

    /// The density with which a path begins that comes straight from a light, through thin walls at the most, over the
    /// cosine at the surface from which a ray leads to the light.
    pub(in crate::integrator) fn straight_density(
        &self,
        scene: &Scene,
        light: u32,
        walls: &[u32],
        to_light: &Ray,
        hit: &LightHit,
    ) -> f64 {
        let source = &scene.lights()[light as usize];
        if source.bounding_box().is_some() {
            let probability = self.probabilities[self.firsts[light as usize] + self.faces];
            return probability * source.emission_density(to_light);
        }
        if walls.is_empty() {
            return 0.0;
        }
        self.density_in_openings(scene, light, walls, to_light.direction)
            * on_opening::direction_density(scene, light, to_light, hit)
    }

    /// The density with which a path begins that comes to a specular surface from a light, over the cosine there: the
    /// ray leads to the light. 0 where no light subpath begins.
    pub(in crate::integrator) fn density(
        &self,
        scene: &Scene,
        light: u32,
        surface: SurfaceId,
        to_light: &Ray,
        hit: &LightHit,
    ) -> f64 {
        let SurfaceId::Pane { index, face } = surface else { return 0.0 };
        let place = self.firsts[light as usize] + FACES.len() * index as usize + usize::from(face == FACES[1]);
        let probability = self.probabilities[place];
        if probability == 0.0 {
            return 0.0;
        }
        on_face::density(scene, light, (index, face), to_light, hit).map_or(0.0, |density| probability * density)
    }
}

/// The pane and the face of a number among all faces.
fn face(number: usize) -> (u32, Face) {
    ((number / FACES.len()) as u32, FACES[number % FACES.len()])
}
