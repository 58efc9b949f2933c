//! Panes that are cut from a sheet anywhere and in any direction. Their bounds hold all that is found in a patch of
//! them, by evaluation and by rays through it.

use std::collections::BTreeMap;

use clerestory_film::TrialStream;
use clerestory_film::counters::Counters;
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

use super::coverage::steep;
use super::side::PaneSide;
use super::testing::{between, pair, random};
use super::window::{SourceBounds, Window};
use crate::document::{SceneBundle, SceneDescription};
use crate::geometry::{Face, JetBounds, Pane, Ray, SurfaceJet};
use crate::integrator::PreparedScene;
use crate::math::{Interval, Rect};
use crate::scene::pane_tree::{LightRegion, PaneTree};

/// Panes, a third of them from each sheet.
const PANES: u32 = 96;

/// Evaluations in each patch.
const EVALUATIONS: usize = 8;

/// Corners of a pane about its middle, metres; no two sides are parallel.
const OUTLINE: [[f64; 2]; 5] = [[-0.05, -0.06], [0.03, -0.07], [0.05, 0.01], [0.01, 0.07], [-0.04, 0.05]];

/// How a pane is cut from its sheet and how it hangs.
struct Cut {
    at: DVec2,
    degrees: f64,
    centre: DVec3,
    axes: [DVec3; 2],
}

const SHEETS: [&str; 3] = ["crown", "cylinder", "hammered"];

fn cuts() -> Vec<Cut> {
    let mut random = random(1);
    let mut any = |reach: f64| between(&mut random, -reach, reach);
    let cut = |number: u32| {
        let place = DVec2::new(f64::from(number % 8), f64::from(number / 8)) * 0.2;
        let x = DVec3::new(1.0, any(0.3), any(0.05)).normalize();
        let y = DVec3::new(any(0.3), 1.0, any(0.05));
        let z = x.cross(y).normalize();
        let degrees = any(180.0);
        Cut { at: DVec2::new(any(0.15), any(0.15)), degrees, centre: place.extend(any(0.05)), axes: [x, z.cross(x)] }
    };
    (0..PANES).map(cut).collect()
}

fn panes(cuts: &[Cut]) -> PreparedScene {
    let sheet = |front: Value, back: Value| json!({"width": 0.5, "height": 0.5, "front": front, "back": back});
    let rings = |seed: u64| json!({"crown": {"centre": [0.1, 0], "wavelength": 0.04, "amplitude": 5e-5, "seed": seed}});
    let ripples = |seed: u64| json!({"cylinder": {"axis": 80, "wavelength": 0.03, "amplitude": 6e-5, "seed": seed}});
    let dimples = |seed: u64| json!({"hammered": {"wavelength": 0.02, "amplitude": 9e-5, "seed": seed}});
    let pane = |(number, cut): (usize, &Cut)| {
        json!({
            "name": number.to_string(), "centre": cut.centre.to_array(), "x_axis": cut.axes[0].to_array(),
            "y_axis": cut.axes[1].to_array(), "width": 0.1, "height": 0.14, "thickness": 0.003, "outline": OUTLINE,
            "sheet": {"name": SHEETS[number % 3], "at": cut.at.to_array(), "rotation": cut.degrees}
        })
    };
    let scene = json!({
        "version": 2, "name": "cuts", "film": {"width": 4, "height": 4},
        "camera": {"perspective": {
            "position": [0, 0, -3], "look_at": [0, 0, 0], "up": [0, 1, 0], "vertical_field_of_view": 40
        }},
        "integrator": "cone",
        "sheets": {
            "crown": sheet(rings(1), rings(2)), "cylinder": sheet(ripples(1), ripples(2)),
            "hammered": sheet(dimples(1), dimples(2))
        },
        "panes": cuts.iter().enumerate().map(pane).collect::<Vec<_>>(),
        "lights": [{"point": {"name": "lamp", "position": [0, 0, 9], "intensity": [1, 1, 1]}}]
    });
    let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
    PreparedScene::build(&SceneBundle::from_parts(description, BTreeMap::new()).unwrap()).unwrap()
}

/// Whether bounds hold an evaluation.
fn hold(bounds: &JetBounds, jet: &SurfaceJet) -> bool {
    let within = |bounds: Interval, value: f64| bounds.min <= value && value <= bounds.max;
    let slopes = bounds.gradient.into_iter().zip(jet.gradient.to_array());
    let curvatures = bounds.hessian.into_iter().zip(jet.hessian);
    within(bounds.height, jet.height) && slopes.chain(curvatures).all(|(bounds, value)| within(bounds, value))
}

/// A rectangle in the axes of a pane.
struct Patch {
    middle: DVec2,
    half: DVec2,
}

impl Patch {
    fn any(random: &mut TrialStream) -> Self {
        // From some millimetres to all of the pane.
        let half = DVec2::splat(0.002) * (pair(random) * 3.5).map(|power| libm::exp2(power * 1.4));
        Self { middle: (pair(random) - 0.5) * DVec2::new(0.1, 0.14), half }
    }

    fn point(&self, random: &mut TrialStream) -> DVec2 {
        self.middle + (2.0 * pair(random) - 1.0) * self.half
    }

    /// The rectangle on the sheet that holds it.
    fn on_sheet(&self, to_sheet: impl Fn(DVec2) -> DVec2) -> Rect {
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let corners = corners.map(|sign| to_sheet(self.middle + self.half * DVec2::from(sign)));
        let [min, max] = corners
            .iter()
            .fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[min, max], corner| [min.min(*corner), max.max(*corner)]);
        Rect::new(min, max).grown(1e-12)
    }
}

/// Looks at so many patches. Returns how many evaluations and how many rays through panes there were.
fn check(patches: u32) -> [u32; 2] {
    let cuts = cuts();
    let scene = panes(&cuts);
    let tree = PaneTree::new(scene.scene().panes());
    let mut random = random(2);
    let mut counts = [0; 2];
    for number in 0..patches {
        let index = number % PANES;
        let (cut, pane) = (&cuts[index as usize], &scene.scene().panes()[index as usize]);
        let (sine, cosine) = libm::sincos(cut.degrees.to_radians());
        let to_sheet = |at: DVec2| cut.at + DVec2::new(cosine, sine).rotate(at);
        let patch = Patch::any(&mut random);
        let rect = patch.on_sheet(to_sheet);
        for face in [Face::Front, Face::Back] {
            let bounds = pane.surface(face).bounds(&rect);
            let narrowed = pane.outline.narrowed(&rect);
            let narrow = pane.surface(face).bounds(&narrowed);
            for _ in 0..EVALUATIONS {
                let at = patch.point(&mut random);
                let jet = pane.surface(face).jet(to_sheet(at));
                assert!(hold(&bounds, &jet), "patch {number}, {face:?}: {jet:?} in {bounds:?}");
                if pane.outline.contains(to_sheet(at)) {
                    let holds = hold(&narrow, &jet) && hold(pane.bounds(face), &jet);
                    assert!(holds, "patch {number}, {face:?} of the pane: {jet:?} in {narrow:?}");
                    counts[0] += 1;
                    // The relief hangs where the glazier has turned it to.
                    let [x, y] = cut.axes;
                    let height = pane.base_height(face) + jet.height;
                    let hung = cut.centre + x * at.x + y * at.y + x.cross(y) * height;
                    let there = pane.frame.point_to_world(to_sheet(at).extend(height));
                    assert!((hung - there).length() < 1e-12, "patch {number}: at {there}, not {hung}");
                }
            }
        }
        counts[1] += u32::from(check_ray(pane, index, &tree, (to_sheet(patch.point(&mut random)), &rect), &mut random));
    }
    counts
}

/// Sends a ray through a place of a pane and looks whether its light is looked for there. False where none comes
/// through.
fn check_ray(pane: &Pane, index: u32, tree: &PaneTree, (at, patch): (DVec2, &Rect), random: &mut TrialStream) -> bool {
    let sign = if random.next_f64() < 0.5 { 1.0 } else { -1.0 };
    let way = ((pair(random) - 0.5) * 3.0).extend(sign);
    let origin = at.extend(0.0) - way * between(random, 0.01, 3.0);
    let Some(side) = PaneSide::facing(pane, origin) else { return false };
    let direction = way.normalize();
    let ray = Ray::new(origin, direction);
    let Some(through) = side.transmit(&ray, &mut Counters::default()) else { return false };
    if !steep(&side, [direction, through.inner_direction, through.direction]) {
        return false;
    }
    let source = through.exit + through.direction * between(random, 0.1, 5.0);
    let sources = [
        SourceBounds::Cap { direction: through.direction, sin_radius: 0.0 },
        SourceBounds::Ball { centre: source, radius: 0.0 },
    ];
    for bounds in sources {
        let window = Window::new(&side, origin, &bounds).expect("light comes through");
        let place = window.place_of(through.entry);
        assert!(window.rect().contains(place), "{place} is not in {:?}, {bounds:?}", window.rect());
        // The part of the window about the patch, which the place may be beside by the height of the relief.
        let part = Rect::new(patch.min.min(place), patch.max.max(place));
        let part = window.part(&part).expect("light comes through this part");
        assert!(part.rect.contains(place), "{place} is not in {:?}, {bounds:?}", part.rect);
    }
    let [origin, source] = [origin, source].map(|at| pane.frame.point_to_world(at));
    let direction = pane.frame.vector_to_world(through.direction);
    for region in [LightRegion::Cap { direction, chord: 0.0 }, LightRegion::Ball { centre: source, radius: 0.0 }] {
        assert!(tree.candidates(origin, &region).contains(&index), "pane {index} from {origin} to {region:?}");
    }
    true
}

#[track_caller]
fn check_enough(patches: u32) {
    let [evaluations, rays] = check(patches);
    assert!(evaluations > 4 * patches && rays > patches / 4, "{evaluations} evaluations and {rays} rays");
}

#[test]
fn bounds_of_rotated_sheets_hold() {
    check_enough(10_000);
}

#[test]
#[ignore = "long: a million patches"]
fn bounds_of_rotated_sheets_hold_on_a_million_patches() {
    check_enough(1_000_000);
}
