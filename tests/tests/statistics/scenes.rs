//! What `scenes/README.md` promises of the scenes that ship for experiments.

use std::path::{Path, PathBuf};

use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, SamplerSettings};
use clerestory_render_core::document;
use clerestory_render_core::document::SceneBundle;
use clerestory_render_core::document::{SamplingDescription, SceneDescription};
use clerestory_render_core::geometry::{Pane, SurfaceId};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::light::LightDescription;
use clerestory_render_core::light::Source;
use clerestory_render_core::light::{DiskLight, PointLight, SphereLight};
use clerestory_render_core::scene::ShadingPoint;
use clerestory_render_core::specular::cache::MethodCache;
use clerestory_render_core::specular::conic::{Conic, ConicSearch, ConicSettings};
use clerestory_render_core::specular::constraint::ManifoldConstraint;
use clerestory_render_core::specular::fnee::FneeSolver;
use clerestory_render_core::specular::fnee::PathSearch;
use clerestory_render_core::specular::manifold::WalkSteps;
use clerestory_render_core::specular::path::PathSettings;
use clerestory_render_core::specular::registry::IntegratorDescription;
use clerestory_render_core::specular::scope::Scope;
use clerestory_render_core::specular::selection::PaneSelection;
use clerestory_render_core::specular::side::PaneSide;
use clerestory_render_core::specular::sms::ManifoldEstimator;
use clerestory_render_core::specular::sms::Sms;
use clerestory_render_core::specular::{SpecularEvent, SpecularMethod};
use clerestory_tests::bias::{BLOCK, compare};
use clerestory_tests::estimate::{Estimate, check_agreement};
use clerestory_tests::forward_tracer::{Exit, Fault, LightSample, Side, Tracing, trace};
use clerestory_tests::pool::{Caustic, EDGE, Water};
use clerestory_tests::reference::{Image, Reference};
use clerestory_tests::rendering::{Rendering, block_means};
use clerestory_tests::slab::{SlabFace, smallest_spread};
use clerestory_tests::traced_scene::{TracedLight, TracedScene, read_height_map};
use glam::{DVec2, DVec3};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes")
}

fn bundle(name: &str) -> SceneBundle {
    document::load(&folder().join(name)).expect("the scene ships")
}

/// What the camera sees in `count` by `count` places of the picture.
fn seen(scene: &PreparedScene, count: u32) -> Vec<DVec3> {
    let film = scene.description().film;
    let size = DVec2::new(f64::from(film.width), f64::from(film.height));
    let place = |k: u32| DVec2::new(f64::from(k % count) + 0.5, f64::from(k / count) + 0.5) / f64::from(count);
    (0..count * count)
        .filter_map(|k| {
            let ray = scene.scene().camera().ray(place(k) * size);
            let hit = scene.scene().accelerator().closest_hit(
                &ray,
                f64::INFINITY,
                SurfaceId::Nothing,
                &mut Counters::default(),
            )?;
            Some(ray.at(hit.distance))
        })
        .collect()
}

/// Paths through a pane from a point of the receiver to a point of a light, and whether these are proven to be all.
fn paths(pane: &Pane, origin: DVec3, source: DVec3) -> (usize, bool) {
    let [origin, source] = [origin, source].map(|point| pane.frame.point_to_local(point));
    let side = PaneSide::facing(pane, origin).expect("receivers lie in front of their pane");
    let Some(search) = PathSearch::new(side, origin, Source::Point(source), FneeSolver::Complete) else {
        return (0, true);
    };
    let counters = &mut Counters::default();
    let enumeration = search.enumerate(counters);
    let through = enumeration.roots.iter().filter(|root| search.transmission(root, counters).is_some());
    (through.count(), enumeration.complete)
}

/// Pictures of a scene with different seeds, in `size` by `size` pixels.
fn replicates(bundle: &SceneBundle, integrator: &str, size: u32, samples: u32) -> Vec<Image> {
    (1..=32)
        .map(|seed| {
            let description = bundle.description().clone().with_seed(seed).with_integrator_named(integrator);
            let mut description =
                description.and_then(|description| description.with_size(size, size)).expect("a valid change");
            description.sampling = SamplingDescription { samples_per_pass: samples, samples_per_block: samples };
            let bundle = bundle.clone().with_description(description).expect("a valid change");
            let scene = PreparedScene::build(&bundle).expect("the scene can be built");
            let mut rendering = Rendering::new(&scene);
            rendering.render_pass().expect("the scene renders");
            rendering.image()
        })
        .collect()
}

/// Holds pictures of integrators against light traced forward.
#[track_caller]
fn check_against_forward_tracing(name: &str, integrators: &[&str], size: u32, samples: u32) {
    let bundle = bundle(name);
    let description = bundle.description().clone().with_size(size, size).expect("a valid size");
    let smaller = bundle.clone().with_description(description).expect("a valid size");
    let traced = TracedScene::build(&smaller, &folder()).expect("the scene can be traced");
    let reference =
        |photons, fault| Reference::from_batches(&trace(&traced, &Tracing { photons, batches: 32, seed: 3, fault }));
    let (right, wrong) = (reference(4_000_000, Fault::None), reference(1_000_000, Fault::MissingFresnelFactor));
    for integrator in integrators {
        let ours = replicates(&bundle, integrator, size, samples);
        let report = compare(&ours, &right, &[], BLOCK);
        println!("{integrator} {name}: {report}");
        assert!(report.agrees() && report.mean_error < 0.005, "{integrator} {name}: {report}");
        let report = compare(&ours, &wrong, &[], BLOCK);
        assert!(!report.agrees(), "{integrator} {name} without a Fresnel factor: {report}");
    }
}

mod slab {
    use super::*;

    #[test]
    fn the_faces_are_waves_of_5_to_12_centimetres() {
        for (seed, name) in (1..).zip(["slab/front.exr", "slab/back.exr"]) {
            let file = folder().join(name);
            let face = SlabFace::new(seed);
            if std::env::var_os("UPDATE_SCENES").is_some() {
                face.write(&file).expect("a file that can be written");
            }
            let (stored, columns, rows) = read_height_map(&file).expect("a height map");
            assert_eq!((stored.len(), columns, rows), (64 * 64, 64, 64));
            assert!(stored == face.coefficients(), "{name} is out of date; write it with UPDATE_SCENES=1");
            let highest = stored.iter().fold(0_f32, |highest, height| highest.max(height.abs()));
            assert_eq!(highest, 3e-4);
        }
    }

    #[test]
    fn no_point_of_the_picture_sees_a_point_of_the_light_twice() {
        // Neither does any other point that the waves light: the borders of the slab, where they end, are out of sight.
        let spread = smallest_spread(&SlabFace::new(1), &SlabFace::new(2), 1.5);
        assert!(spread > 0.2, "{spread}");
        let scene = PreparedScene::build(&bundle("slab.json")).expect("the scene can be built");
        // The middle of the light and places on its rim.
        let rim = |turn: f64| DVec3::new(0.005 * turn.cos(), 0.005 * turn.sin(), 4.0);
        let places = [DVec3::new(0.0, 0.0, 4.0), rim(0.0), rim(2.1), rim(4.2)];
        let (mut connections, mut proven) = (0, 0);
        for origin in seen(&scene, 64) {
            for source in places {
                let (count, complete) = paths(&scene.scene().panes()[0], origin, source);
                assert_eq!(count, 1, "{origin} {source}");
                connections += 1;
                proven += u32::from(complete);
            }
        }
        println!("{proven} of {connections} connections are proven to have no other path");
        assert!(connections == 4 * 64 * 64 && proven * 1000 > connections * 999, "{proven} of {connections}");
    }

    #[test]
    fn its_light_is_that_of_forward_tracing() {
        check_against_forward_tracing("slab.json", &["cone", "fnee"], 32, 4);
    }
}

mod pool {
    use super::*;

    /// Seed of the waves.
    const SEED: u64 = 1;

    /// Parts of the picture along an edge.
    const BLOCKS: usize = 4;

    /// The same pool with another light.
    fn lit_by(light: LightDescription) -> SceneBundle {
        let bundle = bundle("pool.json");
        let description = SceneDescription { lights: vec![light], ..bundle.description().clone() };
        bundle.with_description(description).expect("a valid light")
    }

    /// The scene as an integrator renders it in 16 by 16 pixels.
    fn small(bundle: &SceneBundle, integrator: IntegratorDescription) -> PreparedScene {
        let description = SceneDescription { integrator, ..bundle.description().clone() };
        let description = description.with_size(16, 16).expect("a valid size");
        PreparedScene::build(&bundle.clone().with_description(description).expect("a valid change")).expect("a scene")
    }

    #[test]
    fn its_water_is_waves_of_30_to_70_centimetres() {
        let file = folder().join("pool/water.ply");
        let computed = Water::new(SEED).ply();
        if std::env::var_os("UPDATE_SCENES").is_some() {
            std::fs::write(&file, &computed).expect("a file that can be written");
        }
        let stored = std::fs::read(&file).expect("the scene ships");
        assert!(stored == computed, "pool/water.ply is out of date; write it with UPDATE_SCENES=1");
        assert!(stored.len() < 300_000, "{}", stored.len());
    }

    #[test]
    fn its_caustic_folds_where_the_waves_of_its_mesh_do() {
        let LightDescription::Disk(DiskLight { name, centre: position, .. }) =
            bundle("pool.json").description().lights[0].clone()
        else {
            panic!("a disk")
        };
        let bundle = lit_by(LightDescription::Point(PointLight { name, position, intensity: [1.0; 3] }));
        let scene = PreparedScene::build(&bundle).expect("the scene can be built");
        let sms = Sms {
            constraint: ManifoldConstraint::AngleDifference,
            steps: WalkSteps::default(),
            estimator: ManifoldEstimator::Biased { trials: 500 },
            selection: PaneSelection::All,
            scope: Scope::new(scene.scene(), &["T".to_owned()], None, None),
        };
        let scope = Scope::new(scene.scene(), &["T".to_owned()], None, None);
        let conic = Conic::new(scene.scene(), ConicSearch::Complete, scope, &MethodCache::default());
        let caustic = Caustic::new(&Water::new(SEED), position.into(), 250);
        let (mut folded, mut same, mut points) = (0, 0, 0);
        for (pixel, place) in (0..).zip(seen(&scene, 16)) {
            let point = ShadingPoint { position: place, normal: DVec3::Z, surface: SurfaceId::Triangle(0), bounces: 0 };
            let mut stream = SampleStream::new(&SamplerSettings { seed: 1, samples_per_block: 1 }, 0, [pixel, 0], 0);
            let mut paths = 0;
            let events = [SpecularEvent::Transmission];
            sms.sample_li(scene.scene(), &point, 0, &events, &mut stream, &mut Counters::default(), &mut |_| {
                paths += 1
            });
            let mut all = 0;
            conic
                .sample_li(scene.scene(), &point, 0, &events, &mut stream, &mut Counters::default(), &mut |_| all += 1);
            // Walks from random places may miss some.
            assert!(all >= paths && all % 2 == 1, "{place}: {all} paths, of which walks find {paths}");
            let rays = caustic.rays(place.truncate());
            assert!(rays % 2 == 1, "{place}: {rays} rays");
            points += 1;
            folded += u32::from(rays > 1);
            same += u32::from(paths == rays);
        }
        println!(
            "{folded} of {points} points are lit more than once; at {same} the mesh throws as many paths as its waves"
        );
        assert!(points == 256 && folded * 100 > points * 8 && folded * 100 < points * 25, "{folded} of {points}");
        // Between the vertices the mesh is not quite its waves, which matters where the light is about to fold.
        assert!(same * 100 > points * 95, "{same} of {points}");
    }

    /// The picture's red, in parts, by light that is traced from places all over the lamp through places all over the
    /// waves.
    fn traced_forward(bundle: &SceneBundle) -> Vec<Estimate> {
        /// Rays along an edge of the surface.
        const RAYS: u32 = 700;
        let LightDescription::Disk(DiskLight { centre, normal, radius, radiance, .. }) = bundle.description().lights[0]
        else {
            panic!("a disk")
        };
        let (centre, normal) = (DVec3::from(centre), DVec3::from(normal).normalize());
        let (across, along) = normal.any_orthonormal_pair();
        let intensity = std::f64::consts::PI * radius * radius * radiance[0];
        let water = Water::new(SEED);
        let piece = EDGE / f64::from(RAYS);
        let mut expected = [0.0; BLOCKS * BLOCKS];
        for k in 0..RAYS * RAYS {
            // Points that fill the unit square evenly (Roberts' sequence), mapped onto the disk.
            let even = DVec2::new(0.754_877_666_246_692_8, 0.569_840_290_998_053_2) * f64::from(k);
            let (distance, turn) = (radius * even.x.fract().sqrt(), std::f64::consts::TAU * even.y.fract());
            let lamp = centre + (across * turn.cos() + along * turn.sin()) * distance;
            let place = (DVec2::new(f64::from(k % RAYS), f64::from(k / RAYS)) + 0.5) * piece - 0.5 * EDGE;
            let from_lamp = place.extend(water.surface(place).0) - lamp;
            let landing = water.landing(place, lamp);
            // 1.6 m of the floor, of reflectance 0.6.
            let block = (landing.place * DVec2::new(1.0, -1.0) / 1.6 + 0.5) * BLOCKS as f64;
            if block.min_element() >= 0.0 && block.max_element() < BLOCKS as f64 {
                let towards = normal.dot(from_lamp.normalize());
                let flux = intensity * towards / from_lamp.length_squared() * landing.weight * piece * piece;
                let area = (1.6 / BLOCKS as f64).powi(2);
                expected[block.y as usize * BLOCKS + block.x as usize] += flux / area * 0.6 / std::f64::consts::PI;
            }
        }
        expected.map(Estimate::exact).to_vec()
    }

    #[test]
    fn its_light_is_that_of_its_waves_traced_forward() {
        let bundle = bundle("pool.json");
        let sms = small(&bundle, bundle.description().integrator.clone());
        let expected = traced_forward(&bundle);
        // Unbiased estimates of paths that few seeds find are noisy.
        check_agreement("sms", &block_means(&sms, 60, BLOCKS), &expected, 0.2);
        let conic = bundle.description().clone().with_integrator_named("conic").expect("there is one").integrator;
        check_agreement("conic", &block_means(&small(&bundle, conic.clone()), 60, BLOCKS), &expected, 0.05);
        let IntegratorDescription::Conic(ConicSettings { max_depth, chains, casters, receivers, .. }) = conic else {
            panic!("conic")
        };
        let search = ConicSearch::Published;
        let first = IntegratorDescription::Conic(ConicSettings { max_depth, search, chains, casters, receivers });
        let first = Estimate::mean(&block_means(&small(&bundle, first), 16, BLOCKS));
        let part = first.mean / Estimate::mean(&expected).mean;
        println!("the published walk finds {part:.3} of the light");
        assert!((0.3..0.9).contains(&part), "{part}");
    }

    #[test]
    fn the_path_tracer_finds_as_much_of_a_large_lamp() {
        let mut light = bundle("pool.json").description().lights[0].clone();
        let LightDescription::Disk(DiskLight { radius, radiance, .. }) = &mut light else { panic!("a disk") };
        (*radius, *radiance) = (1.0, [100.0; 3]);
        let bundle = lit_by(light);
        let chance = small(&bundle, IntegratorDescription::Path(PathSettings { max_depth: 16 }));
        check_agreement("path", &block_means(&chance, 1000, BLOCKS), &traced_forward(&bundle), 0.05);
    }
}

mod four_panes {
    use super::*;

    /// Rays through a pane, along each of its edges.
    const RAYS: u32 = 300;

    #[test]
    fn each_caustic_stays_in_its_quarter_of_the_picture_and_folds() {
        let scene = TracedScene::load(&folder().join("four-panes-point.json")).expect("the scene can be traced");
        let light = &scene.lights[0];
        let TracedLight::Point { position, .. } = *light else { panic!("a point light") };
        // From the middle of the picture: left or right, up or down.
        for (pane, quarter) in scene.panes.iter().zip([[-1.0, 1.0], [1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) {
            let side = Side::towards(pane, light);
            let sample = LightSample::Point(position);
            let land = |exit: &Exit| exit.origin + exit.direction * ((-1.0 - exit.origin.z) / exit.direction.z);
            let (mut through, mut reversed) = (0, 0);
            for k in 0..RAYS * RAYS {
                let along = |index: u32| (f64::from(index) + 0.5) / f64::from(RAYS);
                let face = [along(k % RAYS), along(k / RAYS)];
                let start = side.start(pane, face);
                let Some(exit) = side.refract(pane, &start, sample.direction_from(start.world)) else { continue };
                let place = land(&exit).truncate();
                // Further from its borders than the sphere blurs the caustics, which is by 5 mm to each side.
                let within = place * DVec2::from(quarter);
                assert!(within.min_element() > 0.005 && within.max_element() < 0.455, "{place} from {:?}", pane.origin);
                through += 1;
                reversed += u32::from(side.reverses(pane, face, &sample, &exit, land));
            }
            println!("{:?}: {reversed} of {through} rays reversed", pane.origin);
            assert!(through * 100 > RAYS * RAYS * 97, "{through}");
            assert!(reversed * 50 > through, "{reversed} of {through}");
        }
    }

    #[test]
    fn the_point_differs_from_the_sphere_in_the_light_alone() {
        let [sphere, point] = ["four-panes.json", "four-panes-point.json"].map(|name| {
            let mut description = bundle(name).description().clone();
            let lights = std::mem::take(&mut description.lights);
            let description = description.with_integrator_named("fnee").expect("an integrator");
            (SceneDescription { name: String::new(), ..description }, lights)
        });
        assert_eq!(sphere.0, point.0);
        let [LightDescription::Sphere(SphereLight { centre, radius, radiance, .. })] = sphere.1[..] else {
            panic!("a sphere")
        };
        let [LightDescription::Point(PointLight { position, intensity, .. })] = point.1[..] else { panic!("a point") };
        assert_eq!(centre, position);
        // From afar a sphere shines like a point of intensity pi r^2 L.
        let expected = std::f64::consts::PI * radius * radius * radiance[0];
        assert!((intensity[0] / expected - 1.0).abs() < 0.02, "{} {expected}", intensity[0]);
    }
}
