//! The thread that renders. When the view changes, it gives up its frame and begins with coarse frames, which come at
//! once. The first frame of a view is always finished, so that the page has pictures while the view keeps changing.

use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use bytes::Bytes;
use clerestory_film::{Exposure, PreviewSettings, ToneCurve, encode_png, smallest_tile};
use clerestory_local_render::{self as local_render, Control, LocalFilm, PassPlan, Provenance};
use clerestory_render_core::document::{SamplingDescription, SceneBundle, SceneDescription};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::description::FilmDescription;
use clerestory_render_core::scene::{Obstacles, SceneError};
use rayon::ThreadPool;
use serde::Serialize;
use tokio::sync::{oneshot, watch};

use super::look::Look;
use crate::failure::Failure;
use crate::version::BUILD;

/// Time for a first frame.
const FIRST_FRAME: Duration = Duration::from_millis(60);

/// Shortest time between two frames.
const FRAME_PERIOD: Duration = Duration::from_millis(80);

/// Edge of a pixel of the coarsest frames, in pixels of the scene.
const COARSEST: u32 = 16;

/// Edge of a tile, pixels.
const TILE: u32 = 32;

/// Passes of one sample, so that the first comes soon.
const SAMPLING: SamplingDescription = SamplingDescription { samples_per_pass: 1, samples_per_block: 256 };

/// The number of a frame. Frames of later views are greater, and so are frames of one view with more samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct FrameNumber {
    /// The view that it shows.
    pub(super) look: u64,
    /// Its number among the frames of the view.
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

/// The scene and its view.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Shown {
    pub(super) name: String,
    /// The view of the scene file.
    pub(super) original: Look,
    pub(super) look: Look,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) most_samples: u32,
}

/// The state that the rendering thread shares with the server.
pub(super) struct Engine {
    original: SceneBundle,
    obstacles: Obstacles,
    most_samples: u32,
    /// The wanted view.
    wanted: Mutex<Wanted>,
    /// Wakes the thread when the wanted view changes.
    changed: watch::Sender<u64>,
    frames: watch::Sender<Option<Frame>>,
}

/// Receives the result of the thread.
pub(super) type Ended = oneshot::Receiver<Result<(), Failure>>;

struct Wanted {
    number: u64,
    look: Look,
    bundle: SceneBundle,
    control: Arc<Control>,
    is_over: bool,
}

impl Engine {
    /// Starts the thread. The receiver gets nothing if the thread panics.
    pub(super) fn start(
        original: SceneBundle,
        scene: PreparedScene,
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
        // The receiver may be gone.
        let render = move || _ = ended.send(pool.install(|| shared.render(scene)));
        thread::Builder::new().name("viewer".to_owned()).spawn(render).map_err(Failure::Runtime)?;
        Ok((engine, end))
    }

    /// The wanted view and the scene.
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

    /// Changes the view and returns its number.
    pub(super) fn show(&self, look: Look) -> Result<u64, SceneError> {
        let bundle = look.applied(&self.original)?;
        self.obstacles.check(bundle.description().parts())?;
        let mut wanted = self.wanted();
        wanted.control.cancelled.store(true, Ordering::Relaxed);
        *wanted = Wanted { number: wanted.number + 1, look, bundle, control: Arc::default(), ..*wanted };
        self.changed.send_replace(wanted.number);
        Ok(wanted.number)
    }

    /// The latest frame.
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
        // Wakes pages that wait for a frame.
        self.frames.send_modify(|_| ());
    }

    /// Whether the thread has ended or is about to end.
    pub(super) fn is_over(&self) -> bool {
        self.wanted().is_over
    }

    /// No code leaves the value half changed while it holds the lock.
    fn wanted(&self) -> MutexGuard<'_, Wanted> {
        self.wanted.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn render(&self, mut scene: PreparedScene) -> Result<(), Failure> {
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
            // Waits for the next view.
            if runtime.block_on(changed.wait_for(|&wanted| wanted != look)).is_err() {
                return Ok(());
            }
        }
    }

    /// Renders the frames of one size. Returns the scene, and the time of a sample of the first pass if that was
    /// finished.
    fn render_stage(
        &self,
        scene: PreparedScene,
        stage: &Stage<'_>,
        number: &mut FrameNumber,
    ) -> Result<(PreparedScene, Option<f64>), Failure> {
        let Stage { bundle, coarseness, most, first, control } = *stage;
        let failure = |source| Failure::scene(bundle.description().name.as_ref(), source);
        let FilmDescription { width, height } = bundle.description().film;
        let film = FilmDescription { width: width.div_ceil(coarseness), height: height.div_ceil(coarseness) };
        let description = SceneDescription { film, sampling: SAMPLING, ..bundle.description().clone() };
        let bundle = bundle.clone().with_description(description).map_err(failure)?;
        // Frames come in many sizes, and a pilot would come before each.
        let scene = scene.changed(&bundle).map_err(failure)?.without_pilot();
        let tile_size = TILE.max(smallest_tile(film.width, film.height));
        let grid = scene.description().grid(tile_size);
        let plan = PassPlan {
            frame: 0,
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
                let provenance =
                    Provenance { build: BUILD, counters: rendered.counters, elapsed: None, assumptions: &[] };
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
    /// Edge of a pixel, in pixels of the scene.
    coarseness: u32,
    /// Passes.
    most: u32,
    /// The controls of the first pass and of the others.
    first: &'a Control,
    control: &'a Control,
}

/// Edge of the pixels of a first frame, by the time of earlier samples.
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
