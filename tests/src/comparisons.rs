//! What is held against which reference: every method on every reference scene that it can render.
//!
//! The reference scenes have small and far lights, which path tracing alone does not find. For it, each pane gets a
//! large light near by and a receiver close behind, in a picture of fewer pixels. The forward tracer makes the
//! reference on demand.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use clerestory_film::NodeAddress;
use clerestory_film::counters::Counters;
use clerestory_render_core::document::{SamplingDescription, SceneDescription};
use clerestory_render_core::document::{SceneBundle, load};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::integrator::render_node;
use clerestory_render_core::light::LightDescription;
use clerestory_render_core::light::{DiskLight, RectangleLight, SphereLight, SunLight};
use clerestory_render_core::scene::description::CameraDescription;
use glam::DVec3;
use rayon::prelude::*;

use crate::allocation::TILE;
use crate::folds::{Folds, fold_pixels};
use crate::forward_tracer::{Fault, Tracing, trace};
use crate::methods;
use crate::reference::{Image, Reference, ReferenceError};
use crate::sun_scene::SunScene;
use crate::traced_scene::TracedScene;

/// Number of independently seeded pictures of ours.
pub const REPLICATES: u64 = 32;

/// A method on a scene.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// Name of the case, of the light and of the method.
    pub name: String,
    bundle: SceneBundle,
    traced: TracedScene,
    stored: Option<PathBuf>,
    folds: Folds,
    has_saddles: bool,
}

/// The folder of the reference scenes.
pub fn reference_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/references")
}

/// The comparison of `integrator` (a name of [`methods::settings`]) with the reference of a case and a light. Cases are
/// `crown`, `bump`, `flat`, `cathedral` and `room`. Lights are `point`, `sphere`, `sun`, `near` for a large light near
/// by, and `steep` for one at 60 degrees. `distant-METRES` is a sphere at this distance, compared with the sun. In the
/// room, lights are `sun`, or `sun-DEGREES` for a sun of another angular radius.
///
/// # Panics
///
/// When the repository's own scenes cannot be read, or there is no such integrator.
pub fn comparison(case: &str, light: &str, integrator: &str) -> Comparison {
    let Setting { bundle, folder, stored, has_saddles } = setting(case, light);
    let mut description = bundle.description().clone();
    description.integrator = methods::integrator(integrator, description.integrator.max_depth());
    let bundle = bundle.with_description(description).expect("the changed scene is valid");
    let traced = TracedScene::build(&bundle, &folder).expect("the scenes can be traced");
    // Of those that draw one point of a light. A light so large has folds everywhere, and they weigh little.
    let is_large = ["near", "steep"].contains(&light) || light.starts_with("sun-");
    let draws_points = !methods::looks_at_whole_lights(integrator) && !is_large;
    let folds = if draws_points { Folds::OfAllLights } else { Folds::OfPoints };
    Comparison { name: format!("{integrator} {case}-{light}"), bundle, traced, stored, folds, has_saddles }
}

/// The scene of a case with a light, both as in [`comparison`].
///
/// # Panics
///
/// When the repository's own scenes cannot be read.
pub(crate) fn setting(case: &str, light: &str) -> Setting {
    if case == "room" { in_the_room(light) } else { through_one_pane(case, light) }
}

/// A scene with its light.
pub(crate) struct Setting {
    /// The scene.
    pub(crate) bundle: SceneBundle,
    folder: PathBuf,
    /// The reference, where one is stored.
    stored: Option<PathBuf>,
    /// Whether a picture without saddles looks different.
    has_saddles: bool,
}

fn through_one_pane(case: &str, light: &str) -> Setting {
    let folder = reference_folder();
    let distance = light.strip_prefix("distant-").map(|metres| metres.parse().expect("a number of metres"));
    let is_moved = ["near", "steep"].contains(&light);
    let similar = if is_moved || distance.is_some() { "sun" } else { light };
    let stored = (!is_moved).then(|| folder.join(format!("{case}-{similar}-reference.exr")));
    let bundle = load(&folder.join(format!("{case}-{similar}.json"))).expect("the reference scenes are valid");
    let mut description = bundle.description().clone();
    if let Some(metres) = distance {
        bring_the_sun_to(&mut description, metres);
    }
    if light == "near" {
        move_near(&mut description, case);
    }
    if light == "steep" {
        tilt(&mut description);
    }
    let bundle = bundle.with_description(description).expect("the changed scene is valid");
    // A flat pane has none, and a light so large washes them out.
    Setting { bundle, folder, has_saddles: stored.is_some() && case != "flat", stored }
}

/// The sun's light that falls through one pane onto stone. The lamp, whose light leaves the room through glass and does
/// not come back, is taken out.
fn in_the_room(light: &str) -> Setting {
    const SUN: f64 = 0.27;
    let folder = reference_folder().join("..");
    let bundle = load(&folder.join("room.json")).expect("the room ships");
    let degrees = light.strip_prefix("sun-").map(|degrees| degrees.parse().expect("a number of degrees"));
    let scene = SunScene {
        angular_radius: degrees.unwrap_or(SUN),
        integrator: "path",
        seed: 0,
        size: [96, 72],
        path_filter: Some("D TT L"),
    };
    let bundle = scene.bundle(&bundle).expect("the changed room is valid");
    let mut description = bundle.description().clone();
    description.lights.retain(|light| matches!(light, LightDescription::Sun(SunLight { .. })));
    let bundle = bundle.with_description(description).expect("the room without its lamp is valid");
    Setting { bundle, folder, stored: None, has_saddles: degrees.is_none() }
}

/// A sphere instead of the sun, under the same angle.
fn bring_the_sun_to(description: &mut SceneDescription, distance: f64) {
    for light in &mut description.lights {
        if let LightDescription::Sun(SunLight { name, direction, angular_radius, radiance }) = light {
            *light = LightDescription::Sphere(SphereLight {
                name: name.clone(),
                centre: (DVec3::from(*direction).normalize() * distance).into(),
                radius: libm::sin(angular_radius.to_radians()) * distance,
                radiance: *radiance,
            });
        }
    }
}

/// How far the receiver of a large light is from the pane, metres.
const RECEIVER_DISTANCE: f64 = 0.1;

/// A large light at 0.8 m, and the receiver behind the pane.
fn move_near(description: &mut SceneDescription, case: &str) {
    move_receiver(description, DVec3::new(0.0, 0.0, -RECEIVER_DISTANCE));
    let (name, centre, radiance) = ("lamp".to_owned(), [0.15, 0.1, 0.8], [3.0, 2.5, 2.0]);
    description.lights = vec![match case {
        "crown" | "cathedral" => LightDescription::Sphere(SphereLight { name, centre, radius: 0.35, radiance }),
        "flat" => LightDescription::Disk(DiskLight { name, centre, normal: [-0.2, 0.1, -1.0], radius: 0.36, radiance }),
        _ => LightDescription::Rectangle(RectangleLight {
            name,
            centre,
            edge_u: [0.0, 0.6, 0.0],
            edge_v: [0.7, 0.0, 0.0],
            radiance,
        }),
    }];
}

/// A large light at 60 degrees to the pane's normal, and the receiver opposite it.
fn tilt(description: &mut SceneDescription) {
    let towards = DVec3::new(3f64.sqrt(), 0.0, 1.0);
    move_receiver(description, towards * -RECEIVER_DISTANCE);
    description.lights = vec![LightDescription::Sphere(SphereLight {
        name: "lamp".to_owned(),
        centre: (towards * 0.5).into(),
        radius: 0.25,
        radiance: [3.0, 2.5, 2.0],
    })];
}

/// Moves the middle of the receiver, in a picture of fewer pixels.
fn move_receiver(description: &mut SceneDescription, middle: DVec3) {
    let CameraDescription::Orthographic { position, look_at, .. } = &mut description.camera else {
        unreachable!("the reference scenes have orthographic cameras")
    };
    let shift = middle - DVec3::from(*look_at);
    *position = (DVec3::from(*position) + shift).into();
    *look_at = (DVec3::from(*look_at) + shift).into();
    for mesh in description.meshes.iter_mut().filter(|mesh| mesh.name == "receiver") {
        mesh.translate = shift.into();
    }
    description.film.width = 32;
    description.film.height = 32;
}

impl Comparison {
    /// The reference: the stored one, or, where there is none or a fault is wanted, one that is traced now.
    ///
    /// # Errors
    ///
    /// When the stored reference cannot be read.
    pub fn reference(&self, photons: u64, fault: Fault) -> Result<Reference, ReferenceError> {
        match (&self.stored, fault) {
            (Some(file), Fault::None) => Reference::read(file),
            (Some(file), Fault::Scaled) => Ok(Reference::read(file)?.scaled(1.005)),
            _ => {
                let batches = trace(&self.traced, &Tracing { photons, batches: 32, seed: 11, fault });
                Ok(Reference::from_batches(&batches))
            }
        }
    }

    /// The faults that a test on this scene has to notice. A flat pane, and a light so large that it washes the caustic
    /// out, have no saddles to lose.
    pub fn faults(&self) -> Vec<Fault> {
        let saddles = self.has_saddles.then_some(Fault::DroppedSaddles);
        [Fault::MissingFresnelFactor, Fault::Scaled].into_iter().chain(saddles).collect()
    }

    /// The pixels at the folds of caustics where the method has infinite variance.
    pub fn folds(&self) -> Vec<bool> {
        fold_pixels(&self.traced, self.folds)
    }

    /// Renders [`REPLICATES`] pictures with `samples` samples for each pixel, with different seeds from `first_seed`
    /// on.
    ///
    /// # Panics
    ///
    /// When the renderer fails on a scene of the repository.
    pub fn replicates(&self, samples: u32, first_seed: u64) -> (Vec<Image>, Counters) {
        self.replicates_with(samples, first_seed, &|_| 1)
    }

    /// Renders one picture with `samples` samples for each pixel.
    ///
    /// # Panics
    ///
    /// When the renderer fails on a scene of the repository.
    pub fn picture(&self, samples: u32, seed: u64) -> Image {
        let scene = PreparedScene::build(&seeded(&self.bundle, samples, seed)).expect("the scene can be built");
        picture(&scene, &|_| 1).0
    }

    /// Renders [`REPLICATES`] pictures with different seeds from `first_seed` on. `passes` has the passes of each tile
    /// (tiles of [`TILE`], row by row), each of `samples` samples for each pixel.
    ///
    /// # Panics
    ///
    /// When the renderer fails on a scene of the repository.
    pub fn replicates_with(
        &self,
        samples: u32,
        first_seed: u64,
        passes: &(dyn Fn(usize) -> u32 + Sync),
    ) -> (Vec<Image>, Counters) {
        pictures(&self.bundle, samples, first_seed, passes)
    }
}

/// [`REPLICATES`] pictures of a scene with different seeds from `first_seed` on. `passes` has the passes of each tile,
/// each of `samples` samples for each pixel.
///
/// # Panics
///
/// When the scene cannot be built or rendered.
pub fn pictures(
    bundle: &SceneBundle,
    samples: u32,
    first_seed: u64,
    passes: &(dyn Fn(usize) -> u32 + Sync),
) -> (Vec<Image>, Counters) {
    let mut counters = Counters::default();
    let mut images = Vec::new();
    let mut scene = PreparedScene::build(&seeded(bundle, samples, first_seed)).expect("the scene can be built");
    for seed in first_seed..first_seed + REPLICATES {
        scene = scene.changed(&seeded(bundle, samples, seed)).expect("another seed is valid");
        let (image, work) = picture(&scene, passes);
        counters += work;
        images.push(image);
    }
    (images, counters)
}

fn seeded(bundle: &SceneBundle, samples: u32, seed: u64) -> SceneBundle {
    let mut description = bundle.description().clone().with_seed(seed);
    description.sampling = SamplingDescription { samples_per_pass: samples, samples_per_block: samples };
    bundle.clone().with_description(description).expect("another seed is valid")
}

/// The mean of `passes` passes in each tile, those of the light plane among them.
fn picture(scene: &PreparedScene, passes: &(dyn Fn(usize) -> u32 + Sync)) -> (Image, Counters) {
    let film = scene.description().film;
    let grid = scene.description().grid(TILE as u32);
    let tiles: Vec<(Vec<DVec3>, Counters)> = (0..grid.len())
        .into_par_iter()
        .map(|tile| {
            let count = passes(tile as usize);
            let mut sums = Vec::new();
            let mut counters = Counters::default();
            for index in 0..count {
                let address = NodeAddress { frame: 0, tile, level: 0, index };
                let rendered = render_node(scene, &grid, address, &AtomicBool::new(false)).expect("finite samples");
                let beauty = &rendered.node.layers().beauty;
                sums.resize(beauty.len(), DVec3::ZERO);
                for (sum, pass) in sums.iter_mut().zip(beauty) {
                    *sum += DVec3::from(pass.map(f64::from));
                }
                counters += rendered.counters;
            }
            let scale = 1.0 / f64::from(count * scene.sampling().samples_per_pass());
            (sums.into_iter().map(|sum| sum * scale).collect(), counters)
        })
        .collect();
    let [width, height] = [film.width as usize, film.height as usize];
    let mut image = Image { width, height, pixels: vec![DVec3::ZERO; width * height] };
    let mut counters = Counters::default();
    for (index, (pixels, work)) in (0..).zip(tiles) {
        let tile = grid.tile(index).expect("a tile of the grid");
        for (row, values) in pixels.chunks(tile.width as usize).enumerate() {
            let start = (tile.y as usize + row) * width + tile.x as usize;
            for (pixel, value) in image.pixels[start..start + values.len()].iter_mut().zip(values) {
                *pixel += *value;
            }
        }
        counters += work;
    }
    (image, counters)
}
