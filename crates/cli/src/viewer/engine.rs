//! The thread that renders: whenever the look changes it gives up what it is doing, and begins with frames so coarse that they come
//! at once. The first frame of a look is always finished: there are pictures also while the look changes all the time.

use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use bytes::Bytes;
use clerestory_film::{Exposure, PreviewSettings, TileGrid, ToneCurve, encode_png, smallest_tile};
use clerestory_local_render::{self as local_render, Control, LocalFilm, PassPlan, Provenance};
use clerestory_render_core::scene::description::{FilmDescription, SamplingDescription, SceneDescription};
use clerestory_render_core::scene::{Obstacles, Scene, SceneBundle, SceneError};
use rayon::ThreadPool;
use serde::Serialize;
use tokio::sync::{oneshot, watch};

use super::look::Look;
use crate::failure::Failure;
use crate::version::BUILD;

/// A first frame takes about so long.
const FIRST_FRAME: Duration = Duration::from_millis(60);

/// Frames do not follow each other faster.
const FRAME_PERIOD: Duration = Duration::from_millis(80);

/// The coarsest frames have a pixel for so many by so many.
const COARSEST: u32 = 16;

/// Edge of a tile, pixels.
const TILE: u32 = 32;

/// Passes of one sample, so that the first is there soon.
const SAMPLING: SamplingDescription = SamplingDescription { samples_per_pass: 1, samples_per_block: 256 };

/// Which frame: those of later looks are larger, and of one look those with more samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct FrameNumber {
    /// The look that it shows.
    pub(super) look: u64,
    /// Its number among those of the look.
    pub(super) frame: u32,
}

/// A picture.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    pub(super) number: FrameNumber,
    /// Samples in each pixel; 0 while pixels are larger than those of the scene.
    pub(super) samples: u32,
    /// As a PNG.
    pub(super) png: Bytes,
}

/// What is shown.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Shown {
    pub(super) name: String,
    /// That of the scene file.
    pub(super) original: Look,
    pub(super) look: Look,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) most_samples: u32,
}

/// What the thread that renders and those that serve share.
pub(super) struct Engine {
    original: SceneBundle,
    obstacles: Obstacles,
    most_samples: u32,
    /// The look that is wanted, with its number, and how what is being rendered is stopped.
    wanted: Mutex<Wanted>,
    /// Tells the thread that something else is wanted.
    changed: watch::Sender<u64>,
    frames: watch::Sender<Option<Frame>>,
}

/// Gets how the thread ended.
pub(super) type Ended = oneshot::Receiver<Result<(), Failure>>;

struct Wanted {
    number: u64,
    look: Look,
    bundle: SceneBundle,
    control: Arc<Control>,
    is_over: bool,
}

impl Engine {
    /// Starts the thread. Nothing is said of its end if it panicked.
    pub(super) fn start(
        original: SceneBundle,
        scene: Scene,
        pool: ThreadPool,
        most_samples: u32,
    ) -> Result<(Arc<Self>, Ended), Failure> {
        let look = Look::of(original.description());
        let wanted = Wanted { number: 1, look, bundle: original.clone(), control: Arc::default(), is_over: false };
        let engine = Arc::new(Self {
            original,
            obstacles: scene.obstacles(),
            most_samples,
            wanted: Mutex::new(wanted),
            changed: watch::channel(1).0,
            frames: watch::channel(None).0,
        });
        let shared = engine.clone();
        let (ended, end) = oneshot::channel();
        // Whoever was to hear of it may be gone.
        let render = move || _ = ended.send(pool.install(|| shared.render(scene)));
        thread::Builder::new().name("viewer".to_owned()).spawn(render).map_err(Failure::Runtime)?;
        Ok((engine, end))
    }

    /// What is shown, or about to be.
    pub(super) fn shown(&self) -> Shown {
        let SceneDescription { name, film, .. } = self.original.description();
        Shown {
            name: name.clone(),
            original: Look::of(self.original.description()),
            look: self.wanted().look.clone(),
            width: film.width,
            height: film.height,
            most_samples: self.most_samples,
        }
    }

    /// Shows something else; returns its number.
    pub(super) fn show(&self, look: Look) -> Result<u64, SceneError> {
        let bundle = look.applied(&self.original)?;
        self.obstacles.check(bundle.description())?;
        let mut wanted = self.wanted();
        wanted.control.cancelled.store(true, Ordering::Relaxed);
        *wanted = Wanted { number: wanted.number + 1, look, bundle, control: Arc::default(), ..*wanted };
        self.changed.send_replace(wanted.number);
        Ok(wanted.number)
    }

    /// The frames, each in place of the one before.
    pub(super) fn frames(&self) -> watch::Receiver<Option<Frame>> {
        self.frames.subscribe()
    }

    /// Ends the thread.
    pub(super) fn end(&self) {
        let mut wanted = self.wanted();
        wanted.is_over = true;
        wanted.number += 1;
        wanted.control.cancelled.store(true, Ordering::Relaxed);
        self.changed.send_replace(wanted.number);
        // Pages that wait for a frame wait no longer.
        self.frames.send_modify(|_| ());
    }

    /// Whether the thread has ended, or is about to.
    pub(super) fn is_over(&self) -> bool {
        self.wanted().is_over
    }

    /// Nothing is left half done while it is held.
    fn wanted(&self) -> MutexGuard<'_, Wanted> {
        self.wanted.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn render(&self, mut scene: Scene) -> Result<(), Failure> {
        let runtime = tokio::runtime::Builder::new_current_thread().build().map_err(Failure::Runtime)?;
        let mut changed = self.changed.subscribe();
        let mut seconds_per_sample = None;
        loop {
            let (look, bundle, control) = {
                let wanted = self.wanted();
                if wanted.is_over {
                    return Ok(());
                }
                changed.borrow_and_update();
                (wanted.number, wanted.bundle.clone(), wanted.control.clone())
            };
            let mut number = FrameNumber { look, frame: 0 };
            let mut coarseness = coarseness(bundle.description().film, seconds_per_sample);
            loop {
                let most = if coarseness > 1 { 1 } else { self.most_samples };
                let first = Control::default();
                let first = if number.frame == 0 { &first } else { &control };
                let stage = Stage { bundle: &bundle, coarseness, most, first, control: &control };
                let (next, seconds) = self.render_stage(scene, &stage, &mut number)?;
                scene = next;
                seconds_per_sample = seconds.or(seconds_per_sample);
                if coarseness == 1 || control.cancelled.load(Ordering::Relaxed) {
                    break;
                }
                coarseness = (coarseness / 4).max(1);
            }
            // Until the next look.
            if runtime.block_on(changed.wait_for(|&wanted| wanted != look)).is_err() {
                return Ok(());
            }
        }
    }

    /// Renders frames; returns the scene, and how long a sample of the first pass took, if it was finished.
    fn render_stage(
        &self,
        scene: Scene,
        stage: &Stage<'_>,
        number: &mut FrameNumber,
    ) -> Result<(Scene, Option<f64>), Failure> {
        let Stage { bundle, coarseness, most, first, control } = *stage;
        let failure = |source| Failure::scene(bundle.description().name.as_ref(), source);
        let FilmDescription { width, height } = bundle.description().film;
        let film = FilmDescription { width: width.div_ceil(coarseness), height: height.div_ceil(coarseness) };
        let description = SceneDescription { film, sampling: SAMPLING, ..bundle.description().clone() };
        let scene = scene.changed(&bundle.clone().with_description(description).map_err(failure)?).map_err(failure)?;
        let tile_size = TILE.max(smallest_tile(film.width, film.height));
        let grid = TileGrid { width: film.width, height: film.height, tile_size };
        let plan = PassPlan {
            grid,
            sampling: scene.sampling(),
            tile_passes: vec![most; grid.len() as usize],
            adaptation: None,
        };
        let mut rendered = LocalFilm::new(&scene, &plan);
        let mut seconds_per_sample = None;
        let mut shown = Instant::now();
        for pass in 0..most {
            let control = if pass == 0 { first } else { control };
            if !rendered.render_pass(control).map_err(Failure::Render)? {
                break;
            }
            if pass == 0 {
                seconds_per_sample = Some(shown.elapsed().as_secs_f64() / rendered.counters.samples as f64);
            }
            if pass == 0 || pass + 1 == most || shown.elapsed() >= FRAME_PERIOD {
                let sums = rendered.sums().map_err(Failure::Render)?;
                let provenance = Provenance { build: BUILD, counters: rendered.counters, elapsed: None };
                let image = local_render::image(&scene, &plan, &sums, &provenance);
                let settings = PreviewSettings { exposure: Exposure::Automatic, curve: ToneCurve::Filmic };
                let png = encode_png(&image.map_err(Failure::BadImage)?, &settings).map_err(Failure::Preview)?;
                number.frame += 1;
                let samples = if coarseness > 1 { 0 } else { pass + 1 };
                self.frames.send_replace(Some(Frame { number: *number, samples, png: png.into() }));
                shown = Instant::now();
            }
        }
        Ok((scene, seconds_per_sample))
    }
}

/// Frames of one size.
struct Stage<'a> {
    bundle: &'a SceneBundle,
    /// A pixel stands for so many by so many of the scene's.
    coarseness: u32,
    /// Passes.
    most: u32,
    /// What stops the first pass, and the others.
    first: &'a Control,
    control: &'a Control,
}

/// Edge of the pixels of a first frame, by how long samples took; nothing is known before the first.
fn coarseness(film: FilmDescription, seconds_per_sample: Option<f64>) -> u32 {
    let Some(seconds_per_sample) = seconds_per_sample else { return COARSEST };
    let pixels = f64::from(film.width) * f64::from(film.height);
    let affordable = FIRST_FRAME.as_secs_f64() / seconds_per_sample;
    let mut edge = 1;
    while edge < COARSEST && pixels / f64::from(edge * edge) > affordable {
        edge *= 4;
    }
    edge
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_frame_is_as_coarse_as_it_must_be_to_come_at_once() {
        let film = FilmDescription { width: 640, height: 400 };
        assert_eq!(coarseness(film, None), 16, "of an unknown scene");
        assert_eq!(coarseness(film, Some(1e-7)), 1);
        assert_eq!(coarseness(film, Some(1e-6)), 4);
        assert_eq!(coarseness(film, Some(1.0)), 16);
    }
}
