//! The cutting law. Of the paths through a whole sheet, those that enter and leave within one convex piece carry their
//! light through the pieces as well. What crosses a cut in the glass is dark.

use std::collections::BTreeMap;

use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, SamplerSettings};
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

use super::caster::Caster;
use super::testing::{between, pair, random};
use super::{Arrival, THROUGH_PANE};
use crate::document::{SceneBundle, SceneDescription};
use crate::geometry::SurfaceId;
use crate::integrator::PreparedScene;
use crate::scene::ShadingPoint;

/// Width and height of the sheet, metres.
const SIZE: DVec2 = DVec2::new(0.12, 0.1);

/// Directions to one and the same path.
const SAME: f64 = 1e-7;

/// Lines through the sheet: a point and a direction.
const CUTS: [[f64; 4]; 5] = [
    [0.0, 0.0, 1.0, 0.3],
    [0.01, 0.0, -0.2, 1.0],
    [-0.03, 0.02, 0.7, -1.0],
    [0.03, -0.02, 1.0, 1.0],
    [0.0, 0.035, 1.0, -0.1],
];

/// The pieces into which the lines cut the sheet.
fn pieces() -> Vec<Vec<DVec2>> {
    let half = 0.5 * SIZE;
    let mut pieces = vec![vec![-half, DVec2::new(half.x, -half.y), half, DVec2::new(-half.x, half.y)]];
    for [x, y, along_x, along_y] in CUTS {
        let (through, normal) = (DVec2::new(x, y), DVec2::new(along_x, along_y).normalize().perp());
        let side = |corners: &[DVec2], sign: f64| {
            let inside = |corner: DVec2| sign * normal.dot(corner - through);
            let mut kept: Vec<DVec2> = Vec::new();
            for (index, &corner) in corners.iter().enumerate() {
                let before = corners[(index + corners.len() - 1) % corners.len()];
                let (was, is) = (inside(before), inside(corner));
                if (was < 0.0) != (is < 0.0) {
                    kept.push(before + (corner - before) * (was / (was - is)));
                }
                if is >= 0.0 {
                    kept.push(corner);
                }
            }
            kept
        };
        pieces =
            pieces.iter().flat_map(|piece| [side(piece, 1.0), side(piece, -1.0)]).filter(|p| p.len() > 2).collect();
    }
    pieces
}

fn scene(integrator: &Value, panes: Value) -> PreparedScene {
    let lamp = json!({"point": {"name": "lamp", "position": [0.9, 0.7, 0.8], "intensity": [1, 1, 1]}});
    scene_under(&lamp, integrator, panes)
}

fn scene_under(lamp: &Value, integrator: &Value, panes: Value) -> PreparedScene {
    // Too flat for folds, near which a search finds paths by chance, and weights are random.
    let dimples = |seed: u64| json!({"hammered": {"wavelength": 0.03, "amplitude": 6e-6, "seed": seed}});
    let scene = json!({
        "version": 2,
        "name": "cut",
        "film": {"width": 4, "height": 4},
        "camera": {"perspective": {
            "position": [0, 0, -3], "look_at": [0, 0, 0], "up": [0, 1, 0], "vertical_field_of_view": 40
        }},
        "integrator": integrator,
        "sheets": {"sheet": {"width": SIZE.x, "height": SIZE.y, "front": dimples(1), "back": dimples(2)}},
        "panes": panes,
        "lights": [lamp]
    });
    let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
    PreparedScene::build(&SceneBundle::from_parts(description, BTreeMap::new()).unwrap()).unwrap()
}

fn pane(name: &str, corners: &[DVec2]) -> Value {
    let (min, max) = corners
        .iter()
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(min, max), corner| (min.min(*corner), max.max(*corner)));
    let middle = 0.5 * (min + max);
    let outline: Vec<[f64; 2]> = corners.iter().map(|corner| (*corner - middle).to_array()).collect();
    json!({
        "name": name, "centre": [middle.x, middle.y, 0.0], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0],
        "width": max.x - min.x, "height": max.y - min.y, "thickness": 0.003, "outline": outline,
        "sheet": {"name": "sheet", "at": middle.to_array()}
    })
}

/// What arrives at a point, each path by itself.
fn arrivals(scene: &PreparedScene, point: &ShadingPoint, number: u32) -> Vec<Arrival> {
    let mut found = Vec::new();
    let mut stream = SampleStream::new(&SamplerSettings { seed: 7, samples_per_block: 1 }, 0, [0, 0], number);
    let mut arrive = |arrival| found.push(arrival);
    let (method, counters) = (scene.method().unwrap(), &mut Counters::default());
    method.sample_li(scene.scene(), point, 0, &THROUGH_PANE, &mut stream, counters, &mut arrive);
    found
}

/// The paths through a whole sheet beside those through its pieces.
#[derive(Debug, Default)]
struct Compared {
    /// Those through the whole sheet.
    paths: usize,
    /// Those of them that enter and leave in different pieces.
    across: usize,
    /// Those of them within a piece that were not found through it.
    missing: usize,
    /// Paths through a piece that were not found through the whole sheet.
    extra: usize,
}

/// Compares the paths through a whole sheet with those through its pieces.
fn compare(integrator: &Value) -> Compared {
    let whole = scene(integrator, json!([pane("whole", &pieces_of_whole())]));
    let pieces = pieces();
    let cut = (0..).zip(&pieces).map(|(number, piece): (u32, _)| pane(&number.to_string(), piece)).collect();
    let cut = scene(integrator, cut);
    let mut random = random(31);
    let mut counts = Compared::default();
    for number in 0..400 {
        // Aslant, so that light travels far along the glass.
        let through = (pair(&mut random) - 0.5) * SIZE;
        let way = DVec3::new(0.9, 0.7, 0.8) - through.extend(0.0);
        let position = through.extend(0.0) - way * between(&mut random, 0.4, 1.5);
        let point = ShadingPoint { position, normal: DVec3::Z, surface: SurfaceId::Nothing, bounces: 0 };
        let [of_whole, of_cut] = [&whole, &cut].map(|scene| arrivals(scene, &point, number));
        let glass = &whole.scene().panes()[0];
        let side = super::side::PaneSide::facing(glass, position).unwrap();
        let mut left = of_cut.clone();
        for Arrival { direction, weight, .. } in of_whole {
            let ray = crate::geometry::Ray::new(position, direction);
            let through = side.transmit(&ray, &mut Counters::default()).unwrap();
            let piece_of =
                |at: DVec3| cut.scene().panes().iter().position(|pane| pane.outline.contains(at.truncate())).unwrap();
            let is_within = piece_of(through.entry) == piece_of(through.exit);
            counts.paths += 1;
            counts.across += usize::from(!is_within);
            let same = left.iter().position(|other| (other.direction - direction).length() < SAME);
            match (is_within, same) {
                (true, Some(at)) => {
                    let found = left.swap_remove(at);
                    let off = (found.weight - weight).length() / weight.length();
                    assert!(off < 1e-6, "{integrator}: {} is not {weight}", found.weight);
                }
                (true, None) => counts.missing += 1,
                (false, None) => {}
                (false, Some(_)) => panic!("{integrator}: light crosses a cut at {}", through.entry),
            }
        }
        counts.extra += left.len();
    }
    counts
}

fn pieces_of_whole() -> Vec<DVec2> {
    let half = 0.5 * SIZE;
    vec![-half, DVec2::new(half.x, -half.y), half, DVec2::new(-half.x, half.y)]
}

#[test]
fn cuts_make_convex_pieces_that_fill_the_sheet() {
    let area = |corners: &Vec<DVec2>| {
        let doubled = |pair: &[DVec2]| (pair[0] - corners[0]).perp_dot(pair[1] - corners[0]);
        0.5 * corners.windows(2).map(doubled).sum::<f64>()
    };
    let pieces = pieces();
    assert!(pieces.len() > 8, "{} pieces", pieces.len());
    assert!((pieces.iter().map(area).sum::<f64>() - SIZE.x * SIZE.y).abs() < 1e-15);
}

#[test]
fn fnee_finds_the_paths_within_each_piece() {
    let found = compare(&json!({"fnee": {}}));
    println!("{found:?}");
    assert!(found.paths > 300 && found.across > 3, "{found:?}");
    assert_eq!([found.missing, found.extra], [0; 2], "{found:?}");
}

#[test]
fn sms_finds_the_paths_within_each_piece() {
    let found = compare(&json!({"sms": {"estimator": {"biased": {"trials": 40}}}}));
    println!("{found:?}");
    assert!(found.paths > 300 && found.across > 3, "{found:?}");
    // Walks start anywhere: now and then, none of all reaches a path.
    assert!((found.missing + found.extra) * 25 < found.paths, "{found:?}");
}

#[test]
fn mnee_finds_the_paths_within_each_piece() {
    let found = compare(&json!({"mnee": {"missed": "dropped"}}));
    println!("{found:?}");
    assert!(found.paths > 200 && found.across > 3, "{found:?}");
    // A walk begins where the straight line meets the glass, and ends where it leaves the piece.
    assert!(found.missing * 5 < found.paths && found.extra * 100 < found.paths, "{found:?}");
}

/// A strip along the diagonal of the sheet, a twelfth of it.
fn strip() -> Vec<DVec2> {
    let half = 0.5 * SIZE;
    let across = DVec2::new(-SIZE.y, SIZE.x).normalize() * 0.0035;
    let inside = 0.93 * half;
    vec![-inside - across, inside - across, inside + across, -inside + across]
}

/// Places from which light is looked for.
const PLACES: u32 = 2000;

/// What it costs to look for light through a piece of glass from places before all of its sheet: solver calls, heights
/// and rays.
fn work(lamp: &Value, integrator: &Value, piece: &[DVec2]) -> [u64; 3] {
    let scene = scene_under(lamp, integrator, json!([pane("piece", piece)]));
    let mut random = random(47);
    let mut counters = Counters::default();
    for number in 0..PLACES {
        let through = (pair(&mut random) - 0.5) * SIZE;
        let way = DVec3::new(0.1, 0.2, 2.0) - through.extend(0.0);
        let position = through.extend(0.0) - way * 0.2;
        let point = ShadingPoint { position, normal: DVec3::Z, surface: SurfaceId::Nothing, bounces: 0 };
        let mut stream = SampleStream::new(&SamplerSettings { seed: 9, samples_per_block: 1 }, 0, [0, 0], number);
        let method = scene.method().unwrap();
        method.sample_li(scene.scene(), &point, 0, &THROUGH_PANE, &mut stream, &mut counters, &mut |_| ());
    }
    [counters.solver_calls, counters.height_evaluations, counters.rays]
}

/// Seeds of `sms` are uniform over a caster, wherever the point and the light are.
#[test]
fn random_seeds_lie_within_the_outline() {
    let scene = scene(&json!({"sms": {}}), json!([pane("strip", &strip())]));
    let point = ShadingPoint {
        position: DVec3::new(0.0, 0.0, -1.0),
        normal: DVec3::Z,
        surface: SurfaceId::Nothing,
        bounces: 0,
    };
    let caster = Caster::Pane(0).seen_from(scene.scene(), &point).unwrap();
    let glass = &scene.scene().panes()[0];
    for number in 0..1000 {
        let mut stream = SampleStream::new(&SamplerSettings { seed: 3, samples_per_block: 1 }, 0, [0, 0], number);
        let seed = caster.sample(scene.scene(), &mut stream.trials(), &mut Counters::default()).unwrap();
        assert!(glass.outline.contains(glass.frame.point_to_local(seed).truncate()), "{seed}");
    }
}

/// The light is small: from places behind the lead, there is no way through the glass.
#[test]
fn nothing_is_spent_on_what_the_lead_covers() {
    let at = json!([0.1, 0.2, 2.0]);
    let point = json!({"point": {"name": "lamp", "position": at, "intensity": [1, 1, 1]}});
    let ball = json!({"sphere": {"name": "lamp", "centre": at, "radius": 0.005, "radiance": [1, 1, 1]}});
    // The strip is a twelfth of the sheet; light bends across its edges here and there.
    let methods = [
        (&point, json!({"fnee": {}}), 0, 8),
        // A ray for each place tells which glass is on the straight line to the light.
        (&point, json!({"mnee": {}}), u64::from(PLACES), 8),
        (&ball, json!({"cone": {}}), 0, 8),
        // It sends rays through windows that the edges cut, and searches most windows of the sheet without.
        (&ball, json!({"fnee": {}}), 0, 6),
    ];
    for (lamp, integrator, straight, share) in methods {
        let [of_strip, of_sheet] = [strip(), pieces_of_whole()].map(|piece| {
            let [calls, heights, rays] = work(lamp, &integrator, &piece);
            [calls, heights, rays - straight]
        });
        println!("{integrator}: {of_strip:?} of {of_sheet:?}");
        for (strip, sheet) in of_strip.into_iter().zip(of_sheet) {
            assert!(strip * share <= sheet, "{integrator}: {of_strip:?} for the strip, {of_sheet:?} for the sheet");
        }
    }
}
