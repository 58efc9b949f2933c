//! Every path of light in a closed room is found once: by the specular method that owns it, or by chance.

use clerestory_film::counters::Counters;
use clerestory_render_core::geometry::{Pane, SurfaceId};
use clerestory_render_core::scene::ShadingPoint;
use clerestory_render_core::specular::SpecularEvent;
use clerestory_render_core::specular::side::PaneSide;
use clerestory_tests::closed_room::{ClosedRoom, globe, panel};
use clerestory_tests::estimate::check_agreement;
use clerestory_tests::found_paths::FoundPath;
use clerestory_tests::methods::{selections, settings, unbiased_integrators};
use clerestory_tests::random::Random;
use glam::DVec3;
use serde_json::{Value, json};

/// What a method makes of the light in a room may be off by less than this part.
const FAULT: f64 = 0.04;

/// Independent passes of each picture of the room.
const PASSES: u32 = 64;

/// Compares methods with the path tracer in a room, cell by cell and on the whole. Both take the samples that are given
/// for a pass, those of the methods by their names.
#[track_caller]
fn check_room(
    light: (&str, Value),
    filter: Option<&'static str>,
    by_chance: u32,
    methods: Vec<(&'static str, Value)>,
    samples: impl Fn(&str) -> u32,
) {
    let (light_name, light) = light;
    let room = ClosedRoom { light, integrator: json!({"path": {}}), max_depth: 5, filter, seed: 1 };
    let chance = room.radiance(by_chance, PASSES);
    for (seed, (name, integrator)) in (2..).zip(methods) {
        let found = ClosedRoom { integrator, seed, ..room.clone() }.radiance(samples(name), PASSES);
        let paths = filter.unwrap_or("all light");
        check_agreement(&format!("{paths} of the {light_name} in the closed room, {name}"), &found, &chance, FAULT);
    }
}

/// All methods that find the light of a panel.
fn all_methods() -> Vec<(&'static str, Value)> {
    unbiased_integrators().into_iter().skip(1).chain(selections()).collect()
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn every_method_finds_all_light_in_a_closed_room_once() {
    check_room(("panel", panel()), None, 250, all_methods(), |_| 7);
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn every_method_finds_the_light_of_a_globe_in_a_closed_room_once() {
    // The complete search takes long before so large a light.
    let quick = |name: &str| !name.starts_with("fnee") || name == "fnee, published";
    let methods = all_methods().into_iter().filter(|(name, _)| quick(name)).collect();
    check_room(("globe", globe()), None, 500, methods, |_| 20);
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn every_method_finds_light_that_is_seen_through_a_pane_and_came_through_one_once() {
    check_room(("panel", panel()), Some("TT D TT L"), 1000, all_methods(), |name| match name {
        "cone" | "fnee" | "fnee, reflected" => 4,
        "fnee, bleed" | "fnee, random" | "sms, random" | "mnee" => 24,
        "sms, half vector" => 40,
        _ => 8,
    });
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn every_method_finds_light_at_the_second_diffuse_vertex_once() {
    check_room(("panel", panel()), Some("D D TT L"), 2000, all_methods(), |name| match name {
        "cone" | "fnee, bleed" | "fnee, random" => 60,
        "sms, random" => 80,
        "sms, half vector" => 60,
        _ => 24,
    });
}

/// Chains of what happens from a shading point to a light, as letters.
fn chain(letters: &str) -> Vec<SpecularEvent> {
    let event = |letter| if letter == 'R' { SpecularEvent::Reflection } else { SpecularEvent::Transmission };
    letters.chars().map(event).collect()
}

#[test]
fn of_the_ways_that_light_goes_in_a_room_those_are_owned_that_are_looked_for() {
    const CHAINS: [&str; 5] = ["R", "TT", "TRT", "TRRT", "TTTT"];
    let with_chains = |name: &str, chains: &[&str]| json!({name: {"chains": chains}});
    let dropping = json!({"mnee": {"missed": "dropped", "chains": ["TT", "TTTT"]}});
    let methods = [
        ("cone", settings("cone")),
        ("fnee", settings("fnee")),
        ("fnee, published", settings("fnee, published")),
        ("fnee, reflected", json!({"fnee": {"reflected": true}})),
        ("fnee, random", settings("fnee, random")),
        ("sms", settings("sms")),
        ("sms over other chains", with_chains("sms", &["R", "TRT", "TTTT"])),
        ("sms, random", settings("sms, random")),
        ("mnee, dropped", settings("mnee, dropped")),
        ("mnee, dropped, over two chains", dropping),
    ];
    for (light_name, light) in [("panel", panel()), ("globe", globe())] {
        for (name, integrator) in &methods {
            let integrator = integrator.clone();
            let room = ClosedRoom { light: light.clone(), integrator, max_depth: 5, filter: None, seed: 1 };
            let scene = room.build(1);
            let method = scene.method().expect("a specular method");
            let mut random = Random::new(37, 0);
            let mut unit = || loop {
                let place = DVec3::from([(); 3].map(|()| 2.0 * random.uniform() - 1.0));
                if place.length_squared() < 1.0 {
                    break place;
                }
            };
            let is_in_a_face = |position: DVec3| {
                let side = |pane: &Pane| PaneSide::facing(pane, pane.frame.point_to_local(position)).is_none();
                scene.scene().panes().iter().any(side)
            };
            let mut met = [0; CHAINS.len()];
            for _ in 0..100_000 {
                let (position, direction) = (unit(), unit().normalize());
                if is_in_a_face(position) {
                    continue;
                }
                let point = ShadingPoint { position, normal: direction, surface: SurfaceId::Nothing, bounces: 0 };
                for (met, letters) in met.iter_mut().zip(CHAINS) {
                    let events = chain(letters);
                    let Some(path) = FoundPath::followed(scene.scene(), &point, direction, &events, None) else {
                        continue;
                    };
                    let owned = method.owns(scene.scene(), &point, &path.described(), &mut Counters::default());
                    let looked_for = method.chains().contains(&events);
                    assert!(owned == looked_for, "{name}, {light_name}, {letters}: owned {owned}, {path:?}");
                    *met += 1;
                }
            }
            println!("{name}, {light_name}: {met:?} paths over {CHAINS:?}");
            assert!(met.into_iter().all(|met| met > 10), "{name}, {light_name}: {met:?}");
        }
    }
}
