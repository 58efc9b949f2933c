//! The nave is the same building for any number of panes. It is lit through glass only, and by most of the glass in
//! sight of the camera.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec2, DVec3};

use super::stonework::{OPENING, window_centre};
use super::*;
use crate::document::SceneBundle;
use crate::geometry::{Frame, Ray, Surface, SurfaceId};
use crate::light::LightBounds;
use crate::scene::Scene;
use clerestory_film::counters::Counters;

fn built(description: SceneDescription) -> Scene {
    SceneBundle::from_parts(description, BTreeMap::new()).unwrap().build_scene().unwrap()
}

/// Points of the unit cube, evenly spread (Roberts 2018).
fn spread(count: u32) -> impl Iterator<Item = DVec3> {
    let step = DVec3::new(0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_3);
    (1..=count).map(move |k| (step * f64::from(k)).fract())
}

/// The direction and the sine of the angular radius of the sun.
fn sun(scene: &Scene) -> (DVec3, f64) {
    let LightBounds::Cap { direction, sin_radius } = scene.lights()[0].bounds() else { panic!("the nave has a sun") };
    (direction, sin_radius)
}

/// Numbers of rays to the sun.
#[derive(Default)]
struct Sunlight {
    through_glass: u32,
    unhindered: u32,
}

/// Looks at the sun from many places in the beams that come through the openings and 5 cm around them.
fn sunlight(scene: &Scene) -> Sunlight {
    const MARGIN: f64 = 0.05;
    let (direction, sin_radius) = sun(scene);
    let axes = Frame::around(direction).axes;
    let mut sunlight = Sunlight::default();
    for window in 0..WINDOWS {
        for (place, blur) in spread(100_000).zip(spread(100_007).skip(7)) {
            let half = DVec2::new(OPENING.half_width, 0.5 * (OPENING.head - OPENING.sill)) + MARGIN;
            let across = (place.truncate() * 2.0 - 1.0) * half;
            let in_glass =
                DVec3::new(-0.6, window_centre(window) + across.x, 0.5 * (OPENING.head + OPENING.sill) + across.y);
            // From just behind the glass to the far end of the beam.
            let origin = in_glass - direction * (0.05 + 10.5 * place.z);
            let blur = blur.truncate() * 2.0 - 1.0;
            let to_sun = (direction + axes * (blur * sin_radius).extend(0.0)).normalize();
            let ray = Ray::new(origin, to_sun);
            let hit =
                scene.accelerator().closest_hit(&ray, f64::INFINITY, SurfaceId::Nothing, &mut Counters::default());
            match hit.map(|hit| hit.surface) {
                None => sunlight.unhindered += 1,
                Some(Surface::Pane { .. }) => sunlight.through_glass += 1,
                Some(Surface::Triangle { .. }) => {}
            }
        }
    }
    sunlight
}

#[test]
fn a_nave_has_the_panes_that_were_asked_for() {
    for panes in [4, 16, 64, 256] {
        let count: PaneCount = panes.to_string().parse().unwrap();
        let scene = nave(count);
        assert_eq!(scene.panes.len(), panes);
        for kind in ["crown", "cylinder", "bump", "hammered"] {
            assert_eq!(scene.panes.iter().filter(|pane| pane.front.name() == kind).count(), panes / 4, "{kind}");
        }
        assert_eq!(built(scene).panes().len(), panes);
    }
}

#[test]
fn other_numbers_of_panes_are_refused_with_those_that_are_possible() {
    for text in ["0", "5", "1024", "-4", "many", ""] {
        let message = text.parse::<PaneCount>().unwrap_err().to_string();
        assert!(message.starts_with(&format!("found {text}, expected 4, 16, 64 or 256")), "{message}");
    }
}

#[test]
fn naves_differ_in_panes_and_cames_alone() {
    let stripped = |count| {
        let mut scene = nave(count);
        scene.name.clear();
        let area: f64 = scene.panes.drain(..).map(|pane| pane.width * pane.height).sum();
        scene.meshes.retain(|mesh| mesh.name != "cames");
        (scene, area)
    };
    let counts: Vec<PaneCount> = PaneCount::all().collect();
    let (first, openings) = (stripped(counts[0]).0, 4.0 * 1.0 * 2.4);
    for &count in &counts {
        let (scene, area) = stripped(count);
        assert_eq!(scene, first);
        assert!(area < openings && area > 0.97 * openings, "{count} panes: {area} of {openings} square metres");
    }
}

#[test]
fn the_sun_comes_in_through_glass_alone() {
    for count in PaneCount::all() {
        let scene = nave(count);
        let glazed = sunlight(&built(scene.clone()));
        assert_eq!(glazed.unhindered, 0, "{count} panes");
        assert!(glazed.through_glass > 200_000, "{count} panes: {}", glazed.through_glass);
        // They would notice a pane that is missing: without glass, the sun comes in wherever no lead is before it.
        let open = sunlight(&built(SceneDescription { panes: Vec::new(), ..scene }));
        assert!(open.unhindered * 10 > glazed.through_glass * 9, "{count} panes: {}", open.unhindered);
    }
}

#[test]
fn the_sun_comes_into_the_leaded_nave_through_glass_alone() {
    let leaded = sunlight(&built(nave_with_diamonds()));
    assert_eq!(leaded.unhindered, 0);
    assert!(leaded.through_glass > 150_000, "{}", leaded.through_glass);
    // The lead covers more than the few cames of the nave that is cut into 16 panes.
    let cut = sunlight(&built(nave("16".parse().unwrap())));
    assert!(leaded.through_glass < cut.through_glass, "{} {}", leaded.through_glass, cut.through_glass);
}

#[test]
fn the_camera_sees_the_light_of_at_least_half_of_the_panes() {
    for count in PaneCount::all() {
        let description = nave(count);
        let film = description.film;
        let scene = built(description);
        let (direction, _) = sun(&scene);
        let counters = &mut Counters::default();
        let mut panes = BTreeSet::new();
        for pixel in 0..film.width * film.height {
            let place = DVec2::new(f64::from(pixel % film.width), f64::from(pixel / film.width)) + 0.5;
            let ray = scene.camera().ray(place);
            let hit = scene.accelerator().closest_hit(&ray, f64::INFINITY, SurfaceId::Nothing, counters).unwrap();
            let Surface::Triangle { index, .. } = hit.surface else { panic!("the camera looks at a pane") };
            let to_sun = Ray::new(ray.at(hit.distance), direction);
            let above = scene.accelerator().closest_hit(&to_sun, f64::INFINITY, SurfaceId::Triangle(index), counters);
            if let Some(Surface::Pane { index, .. }) = above.map(|hit| hit.surface) {
                panes.insert(index);
            }
        }
        println!("{} of {count} panes light what the camera sees", panes.len());
        assert!(panes.len() as u32 * 2 >= count.get(), "{} of {count}", panes.len());
    }
}
