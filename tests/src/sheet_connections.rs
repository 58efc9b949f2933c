//! The light of single connections between a point of the floor and a lamp through waves of water, relative to what
//! `conic` finds there. The water is one mesh.
//!
//! Why not pictures: as in [`crate::single_connections`]. What is tested is which paths are found, and how often:
//! method and truth have the same light of a path. The pictures of `conic` have the light that is traced forward
//! through these meshes (`tests/tests/statistics/water_caustics.rs`). Interval arithmetic over other meshes shows that
//! no path is missing.

use std::collections::BTreeMap;

use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, SamplerSettings};
use clerestory_render_core::document::{SceneBundle, SceneDescription};
use clerestory_render_core::geometry::{Ray, Surface, SurfaceId};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::ShadingPoint;
use clerestory_render_core::specular::{SpecularEvent, SpecularMethod};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::estimate::Estimate;
use crate::mesh_tracer::{Sheet, SheetScene};
use crate::methods;
use crate::random::Random;
use crate::single_connections::{REPLICATES, RelativeLight};

/// Slopes of waves that throw no folds onto the floor.
pub const GENTLE: f64 = 0.08;

/// Slopes of waves that throw the first folds onto the floor.
pub const FOLDING: f64 = 0.11;

/// Slopes of waves by which several paths lead to many places of the floor.
pub const STEEP: f64 = 0.22;

/// Two directions in which light arrives along the same path differ by less than this.
const SAME_DIRECTION: f64 = 1e-6;

/// The floor is met from so far above, metres, below all water.
const ABOVE_FLOOR: f64 = 0.1;

/// Waves on a mesh whose triangles can be seen in their light, over a floor.
pub fn water(steepness: f64) -> SheetScene {
    let waves = [(DVec2::new(27.0, 12.0), 0.3), (DVec2::new(-15.0, 24.0), 1.1), (DVec2::new(42.0, -18.0), 2.0)];
    let sheet = Sheet::new(1.0, 80, |place| {
        let (mut height, mut slope) = (0.0, DVec2::ZERO);
        for (wave, phase) in waves {
            height += steepness / wave.length() * libm::sin(wave.dot(place) + phase);
            slope += wave * (steepness / wave.length() * libm::cos(wave.dot(place) + phase));
        }
        (height, slope)
    });
    SheetScene {
        sheet,
        index: 1.33,
        lamp: DVec3::new(0.3, -0.2, 4.0),
        intensity: 16.0,
        floor: -0.7,
        reflectance: 0.6,
        edge: 1.0,
        pixels: 64,
    }
}

/// The scene of a sheet for an integrator.
///
/// # Panics
///
/// When the integrator's settings are not valid.
pub fn bundle(sheet: &SheetScene, integrator: &Value, samples: u32) -> SceneBundle {
    let description = sheet.description(integrator, samples).to_string();
    let description = SceneDescription::parse(description.as_bytes()).expect("a valid scene");
    SceneBundle::from_parts(description, BTreeMap::new()).expect("nothing is missing")
}

/// Light from a lamp to the floor under water, and a method.
pub struct SheetConnections {
    /// Name of the method and of the waves.
    pub name: String,
    sheet: SheetScene,
    /// With the method, and with `conic`.
    ours: PreparedScene,
    theirs: PreparedScene,
}

/// Sums over connections.
#[derive(Clone, Copy, Default)]
struct Sums {
    ours: f64,
    saddles: f64,
    elsewhere: f64,
    connections: f64,
}

impl SheetConnections {
    /// Those under `gentle` or `steep` waves, for a method (a name of [`methods::settings`]).
    ///
    /// # Panics
    ///
    /// When there are no such waves or no such method.
    pub fn new(waves: &str, method: &str) -> Self {
        let sheet = water(match waves {
            "gentle" => GENTLE,
            "steep" => STEEP,
            _ => panic!("no waves are called {waves}"),
        });
        let mut settings = methods::settings(method);
        for settings in settings.as_object_mut().into_iter().flat_map(|integrator| integrator.values_mut()) {
            settings["chains"] = json!(["T"]);
        }
        let build = |integrator| PreparedScene::build(&bundle(&sheet, integrator, 1)).expect("the scene can be built");
        let (ours, theirs) = (build(&settings), build(&json!({"conic": {"chains": ["T"]}})));
        Self { name: Self::name(waves, method), sheet, ours, theirs }
    }

    /// Name of the connections under some waves, for a method.
    pub fn name(waves: &str, method: &str) -> String {
        format!("{method} {waves}-waves, single connections")
    }

    /// The light that the method finds over about `count` connections, and what is there.
    ///
    /// # Panics
    ///
    /// When the method is path tracing alone, there is no floor, or the method finds light where there is none.
    pub fn relative_light(&self, count: u32, seed: u64) -> RelativeLight {
        let [ours, theirs] = [&self.ours, &self.theirs].map(|scene| scene.method().expect("a specular method"));
        let each = count.div_ceil(REPLICATES);
        let sums: Vec<Sums> = (0..REPLICATES)
            .into_par_iter()
            .map(|replicate| {
                let mut random = Random::new(seed, u64::from(replicate));
                let mut sums = Sums::default();
                for index in 0..each {
                    self.connect([&*ours, &*theirs], [index, replicate], seed, &mut random, &mut sums);
                }
                sums
            })
            .collect();
        let mean = |value: fn(&Sums) -> f64| {
            Estimate::of(&sums.iter().map(|sums| value(sums) / sums.connections).collect::<Vec<_>>())
        };
        RelativeLight {
            ours: mean(|sums| sums.ours),
            theirs: Estimate::exact(1.0),
            without_saddles: mean(|sums| sums.connections - sums.saddles),
            saddles: mean(|sums| sums.saddles).mean,
            elsewhere: mean(|sums| sums.elsewhere).mean,
            left_out: 0.0,
            searched: 0.0,
            unreached: 0.0,
            uncertain: 0.0,
        }
    }

    fn connect(
        &self,
        [ours, theirs]: [&dyn SpecularMethod; 2],
        number: [u32; 2],
        seed: u64,
        random: &mut Random,
        sums: &mut Sums,
    ) {
        let settings = SamplerSettings { seed, samples_per_block: 1 };
        let place = (DVec2::new(random.uniform(), random.uniform()) - 0.5) * self.sheet.edge;
        let counters = &mut Counters::default();
        let down = Ray::new(place.extend(self.sheet.floor + ABOVE_FLOOR), DVec3::NEG_Z);
        let hit = self.theirs.scene().accelerator().closest_hit(&down, 2.0 * ABOVE_FLOOR, SurfaceId::Nothing, counters);
        let Some((Surface::Triangle { index, .. }, position)) = hit.map(|hit| (hit.surface, down.at(hit.distance)))
        else {
            panic!("no floor at {place}");
        };
        let point = ShadingPoint { position, normal: DVec3::Z, surface: SurfaceId::Triangle(index), bounces: 0 };
        let mut gather = |method: &dyn SpecularMethod, scene| {
            let mut stream = SampleStream::new(&settings, 0, number, 0);
            let mut arrivals: Vec<(DVec3, f64)> = Vec::new();
            let events = [SpecularEvent::Transmission];
            method.sample_li(scene, &point, 0, &events, &mut stream, counters, &mut |arrival| {
                arrivals.push((arrival.direction, arrival.weight.x * arrival.direction.z));
            });
            arrivals
        };
        let (listed, found) = (gather(theirs, self.theirs.scene()), gather(ours, self.ours.scene()));
        let whole: f64 = listed.iter().map(|(_, light)| light).sum();
        if whole == 0.0 {
            assert!(found.is_empty(), "light where there is none: {found:?} at {place}");
            return;
        }
        let share = |arrivals: &[(DVec3, f64)], counts: &dyn Fn(DVec3) -> bool| {
            arrivals.iter().filter(|(direction, _)| counts(*direction)).map(|(_, light)| light).sum::<f64>() / whole
        };
        let is_listed = |direction: DVec3| listed.iter().any(|(known, _)| known.distance(direction) < SAME_DIRECTION);
        sums.ours += share(&found, &|_| true);
        sums.elsewhere += share(&found, &|direction| !is_listed(direction));
        sums.saddles += share(&listed, &|direction| self.is_saddle(&point, direction));
        sums.connections += 1.0;
    }

    /// Whether light from a direction comes by a place of the water beside which it lands the other way round.
    fn is_saddle(&self, point: &ShadingPoint, direction: DVec3) -> bool {
        let ray = Ray::new(point.position, direction);
        let accelerator = self.theirs.scene().accelerator();
        let hit = accelerator.closest_hit(&ray, f64::INFINITY, point.surface, &mut Counters::default());
        hit.is_some_and(|hit| self.sheet.reverses_at(ray.at(hit.distance).truncate()))
    }
}
