//! The pilot that chooses an [`Allocation`]: a small picture of the scene, with each of a few choices.
//!
//! It is a function of the scene alone. Its random numbers are those of no frame, and its costs are counted and not
//! timed. So every process decides alike, and a sample stays a function of the scene, the frame, the pixel and its
//! number. The choice changes the noise of an image and not its mean, since the weights of techniques know it.

use std::ops::AddAssign;

use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, SamplerSettings, TileGrid};
use glam::{DVec2, DVec3};

use super::allocation::{Allocation, Sharing, Splats};
use super::path::PathTracer;
use super::prepared::PreparedScene;
use crate::scene::Scene;
use crate::scene::looks::Looks;
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

/// Pixels of the pilot's pictures, about: of those that tell what a sample costs, and the most that follow.
const PIXELS: [f64; 2] = [16.0, 150.0];

/// Blocks of samples of each pixel, and batches of light subpaths. Samples of a block are stratified, as those of an
/// image are.
const BLOCKS: u32 = 2;
const IN_BLOCK: u32 = 8;
const SAMPLES: u32 = BLOCKS * IN_BLOCK;

/// What pictures of more pixels may cost, in microseconds of a core, about.
const BUDGET: f64 = 4e5;

/// A choice whose first picture has more noise than another by this factor is given up.
const HOPELESS: f64 = 4.0;

/// The frame whose random numbers the pilot has: no job has as many.
const NO_FRAME: u32 = u32::MAX;

/// Another choice has to be better than the usual one by this factor, as far as the pilot can tell.
const BETTER: f64 = 1.2;

/// A picture whose mean is lower than that of others by more than this, in squared standard errors, lacks light that
/// it has not met so far.
const SURE: f64 = 16.0;

/// So does one that has found less than this part of what the others have.
const LITTLE: f64 = 0.5;

/// As in the relative error of an image: this part of the mean, squared, is added to a pixel's square.
const DARK: f64 = 0.01;

/// What work takes, in microseconds, about: a fit to the times of 16 scenes with three choices each, most of which it
/// tells within a factor of 1.4.
const COSTS: Costs =
    Costs { vertex: 0.15, ray: 0.38, height_evaluation: 0.22, solver_call: 3.4, window: 4.5, node: 0.16, portal: 1.8 };

/// A pane counts as this number of triangles.
const TRIANGLES_OF_PANE: usize = 4;

struct Costs {
    /// For each doubling of the number of triangles: what is there is the farther away in memory.
    vertex: f64,
    ray: f64,
    height_evaluation: f64,
    solver_call: f64,
    window: f64,
    node: f64,
    portal: f64,
}

/// Work that was done.
#[derive(Clone, Copy, Debug, Default)]
struct Work {
    counters: Counters,
    looks: Looks,
}

impl Work {
    /// What comes of a piece of work, and what it took.
    fn of<T>(work: impl FnOnce(&mut Counters) -> T) -> (T, Self) {
        let (mut counters, before) = (Counters::default(), Looks::so_far());
        let done = work(&mut counters);
        (done, Self { counters, looks: Looks::so_far() - before })
    }

    /// In microseconds, about.
    fn cost(&self, scene: &Scene) -> f64 {
        let Self { counters, looks } = self;
        let triangles: usize = scene.meshes().iter().map(|mesh| mesh.triangle_range().len()).sum();
        let triangles = triangles + TRIANGLES_OF_PANE * scene.panes().len();
        COSTS.vertex * libm::log2(triangles.max(2) as f64) * looks.vertices as f64
            + COSTS.ray * counters.rays as f64
            + COSTS.height_evaluation * counters.height_evaluations as f64
            + COSTS.solver_call * counters.solver_calls as f64
            + COSTS.window * looks.windows as f64
            + COSTS.node * looks.nodes as f64
            + COSTS.portal * looks.portals as f64
    }
}

impl AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        self.counters += other.counters;
        self.looks += other.looks;
    }
}

/// The choice for a scene, of which the integrator shares paths with light subpaths.
fn allocate(prepared: &PreparedScene) -> Allocation {
    let grid = &prepared.description().grid(1);
    let choices = &choices(prepared, grid)[..];
    let usual = match choices {
        [] => return Allocation::NONE,
        [only] => return *only,
        [usual, ..] => *usual,
    };
    let [few, most] = PIXELS;
    let small: Vec<Picture> = choices.iter().map(|choice| Picture::new(prepared, grid, *choice, (few, 0))).collect();
    let noise_of_small = noise(&small);
    let least = noise_of_small.iter().copied().fold(f64::INFINITY, f64::min);
    let hopeful = small.into_iter().zip(choices).zip(&noise_of_small);
    let hopeful = hopeful.filter(|(_, noise)| **noise <= least * HOPELESS * HOPELESS).map(|(choice, _)| choice);
    let (small, hopeful): (Vec<Picture>, Vec<Allocation>) = hopeful.unzip();
    let cost: f64 = small.iter().map(|picture| picture.cost).sum();
    let pixels = (BUDGET / (f64::from(SAMPLES) * cost)).min(most);
    if hopeful.len() < 2 || pixels < 0.5 * few {
        return best(usual, choices, &noise_of_small);
    }
    let more = |(small, choice): (Picture, &Allocation)| small.and(Picture::new(prepared, grid, *choice, (pixels, 1)));
    let pictures: Vec<Picture> = small.into_iter().zip(&hopeful).map(more).collect();
    best(usual, &hopeful, &noise(&pictures))
}

/// The choice with the least noise, as far as it is sure that it has less than the usual one.
fn best(usual: Allocation, choices: &[Allocation], noise: &[f64]) -> Allocation {
    let counted = choices.iter().zip(noise).map(|(choice, noise)| {
        let handicap = if *choice == usual { BETTER * BETTER } else { 1.0 };
        (choice, noise / handicap)
    });
    counted.min_by(|one, other| one.1.total_cmp(&other.1)).map_or(usual, |(choice, _)| *choice)
}

/// The noise of each picture, over a constant.
fn noise(pictures: &[Picture]) -> Vec<f64> {
    let expected = Expected::of(pictures);
    pictures.iter().map(|picture| picture.noise(&expected)).collect()
}

/// What may be chosen, the usual choice first.
fn choices(prepared: &PreparedScene, grid: &TileGrid) -> Vec<Allocation> {
    if prepared.starts().is_none() {
        return Vec::new();
    }
    let scene = prepared.scene();
    // Of points, connections find what is mirrored within panes and is seen through glass, and no chance does.
    let has_points = !scene.panes().is_empty() && scene.lights().iter().any(|light| light.is_delta());
    let usual = Allocation::USUAL;
    // Light subpaths do not go through specular meshes.
    let is_open = !scene.meshes().iter().any(|mesh| mesh.is_specular());
    match (grid.has_light_plane, has_points) {
        (true, true) => {
            let numbers = [usual.splats, Splats::each(SOME), Splats::each(MANY)];
            let mut choices: Vec<_> = numbers.map(|splats| Allocation { splats, ..usual }).into();
            choices.push(Allocation { sharing: Sharing::Chance, ..usual });
            // Nor through thin walls, behind which no method looks for light then.
            if is_open && !scene.has_straight_meshes() {
                choices
                    .extend([SOME, MANY].map(|splats| Allocation { is_connected: true, ..Allocation::alone(splats) }));
            }
            choices
        }
        (true, false) => {
            let unconnected = Allocation { is_connected: false, ..usual };
            // Chance alone would find what panes mirror within, as bright single pixels that a pilot seldom sees.
            let least = if scene.panes().is_empty() {
                Allocation::NONE
            } else {
                Allocation { splats: Splats::FEW, is_connected: false, sharing: Sharing::Chance }
            };
            let mut choices = vec![usual, least];
            choices.extend([SOME, MANY].map(|number| Allocation { splats: Splats::each(number), ..unconnected }));
            if is_open {
                choices.extend([SOME, MANY].map(Allocation::alone));
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
    splats: Splats,
}

impl Picture {
    /// A picture of `about` this number of pixels. Each `number` has random numbers of its own.
    fn new(prepared: &PreparedScene, grid: &TileGrid, choice: Allocation, (about, number): (f64, u32)) -> Self {
        let tracer = PathTracer::with(prepared, grid, choice);
        let (width, height) = (f64::from(grid.width), f64::from(grid.height));
        let scale = (about / (width * height)).sqrt().min(1.0);
        let [columns, rows] = [width, height].map(|edge| (edge * scale).round().max(1.0) as u32);
        let pixels = columns * rows;
        let seen = on_all_cores(pixels, |pixel| {
            let [x, y] = [(pixel % columns, columns, width), (pixel / columns, rows, height)]
                .map(|(index, count, edge)| ((f64::from(index) + 0.5) * edge / f64::from(count)) as u32);
            camera_moments(prepared, &tracer, [x, y], number)
        });
        let mut work = Work::default();
        let mut moments: Vec<Moments> = Vec::with_capacity(pixels as usize);
        for (of_pixel, taken) in seen {
            work += taken;
            moments.push(of_pixel);
        }
        let samples = f64::from(pixels * SAMPLES);
        let mut cost = work.cost(prepared.scene()) / samples;
        let mut splatted = vec![Moments::default(); pixels as usize];
        if !choice.splats.is_none() {
            let batches = on_all_cores(BLOCKS, |batch| {
                Work::of(|counters| {
                    let mut sums = vec![DVec3::ZERO; pixels as usize];
                    for subpath in 0..pixels * IN_BLOCK {
                        let pass = number * BLOCKS + batch;
                        let mut stream = SampleStream::of_light(0, NO_FRAME, pass, subpath.into());
                        tracer.splat(&mut stream, counters, |splat| {
                            let [column, row] =
                                [(splat.pixel[0], columns, grid.width), (splat.pixel[1], rows, grid.height)].map(
                                    |(place, count, edge)| {
                                        (u64::from(place) * u64::from(count) / u64::from(edge)) as u32
                                    },
                                );
                            sums[(row * columns + column) as usize] += splat.radiance / f64::from(IN_BLOCK);
                        });
                    }
                    sums
                })
            });
            let mut work = Work::default();
            for (sums, taken) in batches {
                work += taken;
                for (moments, sum) in splatted.iter_mut().zip(sums) {
                    moments.add(sum);
                }
            }
            cost += choice.splats.ratio() * work.cost(prepared.scene()) / samples;
        }
        // Each sample of a batch has one light subpath, of as many as were chosen.
        let Allocation { splats, .. } = choice;
        let times = splats.ratio();
        let means = moments.iter().zip(&splatted).map(|(camera, light)| camera.mean() + light.mean() * times);
        let variances =
            moments.iter().zip(&splatted).map(|(camera, light)| camera.variance() + light.variance() * times);
        Self { means: means.collect(), variances: variances.collect(), cost, splats }
    }

    /// Both pictures, as one.
    fn and(mut self, other: Self) -> Self {
        let [here, there] = [self.means.len(), other.means.len()].map(|count| count as f64);
        self.cost = (here * self.cost + there * other.cost) / (here + there);
        self.means.extend(other.means);
        self.variances.extend(other.variances);
        self
    }

    /// Of all pixels and channels.
    fn mean(&self) -> f64 {
        self.means.iter().map(|pixel| pixel.element_sum()).sum::<f64>() / (3.0 * self.means.len() as f64)
    }

    /// Of a sample, the mean over all pixels and channels.
    fn variance(&self) -> f64 {
        self.variances.iter().map(|pixel| pixel.element_sum()).sum::<f64>() / (3.0 * self.variances.len() as f64)
    }

    /// The squared error times cost, times the relative squared error times cost, over constants.
    fn noise(&self, expected: &Expected) -> f64 {
        let count = self.means.len() as f64;
        let Expected { pixels, mean, variance } = expected;
        let mut squares = self.variance();
        let relative = self.variances.iter().zip(pixels);
        let relative =
            relative.map(|(variance, pixel)| (variance / (pixel * pixel + DARK * mean * mean)).element_sum());
        let mut relative = relative.sum::<f64>() / (3.0 * count);
        // What has found nothing has no variance either. What has found more has missed nothing.
        let found = self.mean();
        if found == 0.0 && pixels.iter().any(|pixel| *pixel != DVec3::ZERO) {
            return f64::INFINITY;
        }
        let off = (mean - found).max(0.0);
        let off = off * off * f64::from(SAMPLES) * count;
        if off > SURE * (squares + variance) || found < LITTLE * mean {
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
    /// How much a sample is off that is compared with it.
    variance: f64,
}

impl Expected {
    fn of(pictures: &[Picture]) -> Self {
        let count = pictures.first().map_or(0, |picture| picture.means.len());
        let mut pixels = vec![DVec3::ZERO; count];
        for picture in pictures {
            for (sum, mean) in pixels.iter_mut().zip(&picture.means) {
                *sum += mean / pictures.len() as f64;
            }
        }
        let mut by_mean: Vec<&Picture> = pictures.iter().collect();
        by_mean.sort_by(|one, other| one.mean().total_cmp(&other.mean()));
        let (mean, mut variance) =
            by_mean.get(pictures.len() / 2).map_or((0.0, 0.0), |median| (median.mean(), median.variance()));
        // Camera samples see some pixels, and light subpaths all.
        if pictures.windows(2).any(|two| two[0].splats != two[1].splats) {
            let off = |pixel: &DVec3| (*pixel - mean).length_squared();
            variance += f64::from(SAMPLES) * pixels.iter().map(off).sum::<f64>() / (3.0 * count as f64);
        }
        Self { pixels, mean, variance }
    }
}

/// What a pixel's camera samples see.
fn camera_moments(prepared: &PreparedScene, tracer: &PathTracer<'_>, pixel: [u32; 2], number: u32) -> (Moments, Work) {
    let settings = SamplerSettings { seed: number.into(), samples_per_block: IN_BLOCK };
    Work::of(|counters| {
        let mut moments = Moments::default();
        for block in 0..BLOCKS {
            let mut sum = DVec3::ZERO;
            for sample in block * IN_BLOCK..(block + 1) * IN_BLOCK {
                let mut stream = SampleStream::new(&settings, NO_FRAME, pixel, sample);
                let position = DVec2::new(f64::from(pixel[0]), f64::from(pixel[1])) + stream.next_2d();
                sum += tracer.sample(prepared.scene().camera().ray(position), &mut stream, counters).radiance;
            }
            moments.add(sum / f64::from(IN_BLOCK));
        }
        moments
    })
}

/// Sums of the means of [`BLOCKS`] blocks and of their squares.
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
        self.sum / f64::from(BLOCKS)
    }

    /// Of a sample, as far as blocks tell.
    fn variance(&self) -> DVec3 {
        let count = f64::from(BLOCKS);
        let of_blocks = (self.squares - self.sum * self.sum / count) / (count - 1.0);
        (of_blocks * f64::from(IN_BLOCK)).max(DVec3::ZERO)
    }
}
