//! The pilot that chooses an [`Allocation`]: a small picture of the scene, with each of a few choices.
//!
//! It is a function of the scene alone. Its random numbers are those of no frame, and its costs are counted and not
//! timed. So every process decides alike, and a sample stays a function of the scene, the frame, the pixel and its
//! number. The choice changes the noise of an image and not its mean, since the weights of techniques know it.

use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, SamplerSettings, TileGrid};
use glam::{DVec2, DVec3};

use super::allocation::{Allocation, Sharing};
use super::path::PathTracer;
use super::prepared::PreparedScene;
use crate::specular::settings::LightSubpaths;

impl PreparedScene {
    /// How much effort goes into light subpaths. Where a pilot decides it, this takes half a second or so at first.
    pub(super) fn allocation(&self) -> Allocation {
        match self.description().integrator.light_subpaths() {
            LightSubpaths::Shared => *self.kept_allocation().get_or_init(|| allocate(self)),
            LightSubpaths::Alone(splats) if self.starts().is_some() => Allocation::alone(splats),
            LightSubpaths::Alone(_) | LightSubpaths::None => Allocation::NONE,
        }
    }

    /// What the integrator chooses where it chooses among methods, in words.
    pub fn chosen_methods(&self) -> Vec<String> {
        let integrator = &self.description().integrator;
        let mut chosen = integrator.chosen(self.scene());
        if self.starts().is_some() && integrator.light_subpaths() == LightSubpaths::Shared {
            chosen.push(self.allocation().describe());
        }
        chosen
    }
}

/// Many light subpaths, and some, for each camera sample.
const MANY: u32 = 16;
const SOME: u32 = 4;

/// Pixels of the pilot's picture, about.
const PIXELS: f64 = 300.0;

/// Samples of each pixel, and batches of light subpaths.
const SAMPLES: u32 = 8;

/// The frame whose random numbers the pilot has: no job has as many.
const NO_FRAME: u32 = u32::MAX;

/// Another choice has to be better than the usual one by this factor, as far as the pilot can tell.
const BETTER: f64 = 1.2;

/// A picture whose mean is off by more than can be by chance, in squared standard errors, lacks light so far.
const SURE: f64 = 16.0;

/// As in the relative error of an image: this part of the mean, squared, is added to a pixel's square.
const DARK: f64 = 0.01;

/// What work takes, in microseconds, about.
const COSTS: Costs = Costs { sample: 2.0, subpath: 0.2, ray: 0.6, height_evaluation: 0.4, solver_call: 2.0 };

struct Costs {
    sample: f64,
    subpath: f64,
    ray: f64,
    height_evaluation: f64,
    solver_call: f64,
}

impl Costs {
    fn of(&self, counters: &Counters) -> f64 {
        self.ray * counters.rays as f64
            + self.height_evaluation * counters.height_evaluations as f64
            + self.solver_call * counters.solver_calls as f64
    }
}

/// The choice for a scene, of which the integrator shares paths with light subpaths.
fn allocate(prepared: &PreparedScene) -> Allocation {
    let grid = prepared.description().grid(1);
    let choices = choices(prepared, &grid);
    let Some(first) = choices.first() else { return Allocation::NONE };
    if choices.len() == 1 {
        return *first;
    }
    let pictures: Vec<Picture> = choices.iter().map(|choice| Picture::new(prepared, &grid, *choice)).collect();
    let expected = Expected::of(&pictures);
    let noise: Vec<f64> = pictures.iter().map(|picture| picture.noise(&expected)).collect();
    // The first is the usual one.
    let mut best = 0;
    for other in 1..choices.len() {
        let least = if best == 0 { noise[0] / (BETTER * BETTER) } else { noise[best] };
        if noise[other] < least {
            best = other;
        }
    }
    choices[best]
}

/// What may be chosen, the usual choice first.
fn choices(prepared: &PreparedScene, grid: &TileGrid) -> Vec<Allocation> {
    if prepared.starts().is_none() {
        return Vec::new();
    }
    let scene = prepared.scene();
    // Some of the light of points is found by light subpaths alone, and some by methods alone.
    let has_points = !scene.panes().is_empty() && scene.lights().iter().any(|light| light.is_delta());
    let usual = Allocation::USUAL;
    match (grid.has_light_plane, has_points) {
        (true, true) => {
            let mut choices: Vec<_> = [usual.splats, SOME, MANY].map(|splats| Allocation { splats, ..usual }).into();
            choices.push(Allocation { sharing: Sharing::Chance, ..usual });
            choices
        }
        (true, false) => {
            let unconnected = Allocation { is_connected: false, ..usual };
            // Chance alone would find what panes mirror within, as bright single pixels that a pilot seldom sees.
            let least = if scene.panes().is_empty() {
                Allocation::NONE
            } else {
                Allocation { sharing: Sharing::Chance, ..unconnected }
            };
            let mut choices = vec![usual, least];
            choices.extend([SOME, MANY].map(|splats| Allocation { splats, ..unconnected }));
            // Light subpaths do not go through specular meshes.
            if !scene.meshes().iter().any(|mesh| mesh.is_specular()) {
                choices.push(Allocation::alone(MANY));
            }
            choices
        }
        (false, true) => vec![usual.on(grid)],
        (false, false) => vec![usual.on(grid), Allocation::NONE],
    }
}

/// The pilot's picture with one choice.
struct Picture {
    /// For each pixel, the mean.
    means: Vec<DVec3>,
    /// For each pixel, the variance of a sample with the light subpaths that come with it.
    variances: Vec<DVec3>,
    /// Of a sample, microseconds.
    cost: f64,
}

impl Picture {
    fn new(prepared: &PreparedScene, grid: &TileGrid, choice: Allocation) -> Self {
        let tracer = PathTracer::with(prepared, grid, choice);
        let (width, height) = (f64::from(grid.width), f64::from(grid.height));
        let scale = (PIXELS / (width * height)).sqrt().min(1.0);
        let [columns, rows] = [width, height].map(|edge| (edge * scale).round().max(1.0) as u32);
        let pixels = columns * rows;
        let seen = on_all_cores(pixels, |pixel| {
            let [x, y] = [(pixel % columns, columns, width), (pixel / columns, rows, height)]
                .map(|(index, count, edge)| ((f64::from(index) + 0.5) * edge / f64::from(count)) as u32);
            camera_moments(prepared, &tracer, [x, y])
        });
        let mut counters = Counters::default();
        let mut moments: Vec<Moments> = Vec::with_capacity(pixels as usize);
        for (of_pixel, counted) in seen {
            counters += counted;
            moments.push(of_pixel);
        }
        let samples = f64::from(pixels * SAMPLES);
        let mut cost = COSTS.sample + COSTS.of(&counters) / samples;
        let mut splatted = vec![Moments::default(); pixels as usize];
        if choice.splats > 0 {
            let batches = on_all_cores(SAMPLES, |batch| {
                let (mut sums, mut counters) = (vec![DVec3::ZERO; pixels as usize], Counters::default());
                for number in 0..pixels {
                    let mut stream = SampleStream::of_light(0, NO_FRAME, batch, number.into());
                    tracer.splat(&mut stream, &mut counters, |splat| {
                        let [column, row] =
                            [(splat.pixel[0], columns, grid.width), (splat.pixel[1], rows, grid.height)].map(
                                |(place, count, edge)| (u64::from(place) * u64::from(count) / u64::from(edge)) as u32,
                            );
                        sums[(row * columns + column) as usize] += splat.radiance;
                    });
                }
                (sums, counters)
            });
            let mut counters = Counters::default();
            for (sums, counted) in batches {
                counters += counted;
                for (moments, sum) in splatted.iter_mut().zip(sums) {
                    moments.add(sum);
                }
            }
            cost += f64::from(choice.splats) * (COSTS.subpath + COSTS.of(&counters) / samples);
        }
        // A batch has one light subpath for each sample, of as many as were chosen.
        let splats = f64::from(choice.splats);
        let means = moments.iter().zip(&splatted).map(|(camera, light)| camera.mean() + light.mean() * splats);
        let variances =
            moments.iter().zip(&splatted).map(|(camera, light)| camera.variance() + light.variance() * splats);
        Self { means: means.collect(), variances: variances.collect(), cost }
    }

    /// Of all pixels and channels.
    fn mean(&self) -> f64 {
        self.means.iter().map(|pixel| pixel.element_sum()).sum::<f64>() / (3.0 * self.means.len() as f64)
    }

    /// The squared error times cost, times the relative squared error times cost, over constants.
    fn noise(&self, expected: &Expected) -> f64 {
        let count = self.means.len() as f64;
        let Expected { pixels, mean } = expected;
        let (mut squares, mut relative) = (0.0, 0.0);
        for (variance, pixel) in self.variances.iter().zip(pixels) {
            squares += variance.element_sum() / (3.0 * count);
            relative += (variance / (pixel * pixel + DARK * mean * mean)).element_sum() / (3.0 * count);
        }
        // What has found nothing has no variance either.
        let off = self.mean() - mean;
        let off = off * off * f64::from(SAMPLES) * count;
        if off > SURE * squares {
            squares += off;
            relative += off / (mean * mean);
        }
        let noise = squares * relative * self.cost * self.cost;
        // Of a black picture there is nothing to tell.
        if noise.is_finite() { noise } else { 0.0 }
    }
}

/// Does pieces of work, and gives what comes of them in their order. It has threads of its own: a thread of the pool
/// that waits for work may take up another node, which would wait for this pilot.
fn on_all_cores<T: Send>(count: u32, work: impl Fn(u32) -> T + Sync) -> Vec<T> {
    let threads = rayon::current_num_threads().min(count as usize).max(1);
    if threads == 1 {
        // Clocks of a thread see it.
        return (0..count).map(work).collect();
    }
    let work = &work;
    let done = std::thread::scope(|scope| {
        let started: Vec<_> = (0..threads as u32)
            .map(|thread| scope.spawn(move || (thread..count).step_by(threads).map(work).collect::<Vec<T>>()))
            .collect();
        started.into_iter().map(|thread| thread.join()).collect::<Vec<_>>()
    });
    let mut of_threads: Vec<_> = done
        .into_iter()
        .map(|done| done.unwrap_or_else(|panic| std::panic::resume_unwind(panic)).into_iter())
        .collect();
    (0..count as usize).filter_map(|piece| of_threads[piece % threads].next()).collect()
}

/// What all choices expect alike.
struct Expected {
    /// For each pixel, the mean of all pictures.
    pixels: Vec<DVec3>,
    /// Of all pixels and channels, the median of all pictures: some may have found nothing yet.
    mean: f64,
}

impl Expected {
    fn of(pictures: &[Picture]) -> Self {
        let mut pixels = vec![DVec3::ZERO; pictures.first().map_or(0, |picture| picture.means.len())];
        for picture in pictures {
            for (sum, mean) in pixels.iter_mut().zip(&picture.means) {
                *sum += mean / pictures.len() as f64;
            }
        }
        let mut means: Vec<f64> = pictures.iter().map(Picture::mean).collect();
        means.sort_by(f64::total_cmp);
        let mean = means.get(means.len() / 2).copied().unwrap_or(0.0);
        Self { pixels, mean }
    }
}

/// What a pixel's camera samples see.
fn camera_moments(prepared: &PreparedScene, tracer: &PathTracer<'_>, pixel: [u32; 2]) -> (Moments, Counters) {
    let settings = SamplerSettings { seed: 0, samples_per_block: SAMPLES };
    let (mut moments, mut counters) = (Moments::default(), Counters::default());
    for sample in 0..SAMPLES {
        let mut stream = SampleStream::new(&settings, NO_FRAME, pixel, sample);
        let position = DVec2::new(f64::from(pixel[0]), f64::from(pixel[1])) + stream.next_2d();
        let seen = tracer.sample(prepared.scene().camera().ray(position), &mut stream, &mut counters);
        moments.add(seen.radiance);
    }
    (moments, counters)
}

/// Sums of [`SAMPLES`] values and of their squares.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    sum: DVec3,
    squares: DVec3,
}

impl Moments {
    fn add(&mut self, value: DVec3) {
        self.sum += value;
        self.squares += value * value;
    }

    fn mean(&self) -> DVec3 {
        self.sum / f64::from(SAMPLES)
    }

    fn variance(&self) -> DVec3 {
        let count = f64::from(SAMPLES);
        ((self.squares - self.sum * self.sum / count) / (count - 1.0)).max(DVec3::ZERO)
    }
}
