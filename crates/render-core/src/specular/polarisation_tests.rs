//! What two faces transmit together, by the code of every method, against Fresnel's equations in their textbook form.
//!
//! `fnee`, `cone` and the search for environments ask [`PaneSide::transmit`]; `sms`, `mnee` and `conic` ask [`Chain`].

use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

use clerestory_film::counters::Counters;
use clerestory_film::{NodeAddress, TileGrid};
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

use super::caster::Caster;
use super::chain::Chain;
use super::side::{PaneSide, unit_normal};
use super::testing::wedge;
use super::{SpecularEvent, THROUGH_PANE};
use crate::bsdf::fresnel::refract;
use crate::document::{SceneBundle, SceneDescription};
use crate::geometry::{Face, Ray, SurfaceId};
use crate::integrator::{PreparedScene, render_node};
use crate::scene::ShadingPoint;

const GLASS: f64 = 1.5;

/// Angles of incidence, in degrees.
const ANGLES: [f64; 7] = [0.0, 20.0, 40.0, 60.0, 70.0, 80.0, 85.0];

/// Angles between planes of incidence, in degrees.
const TURNS: [f64; 5] = [0.0, 30.0, 45.0, 60.0, 90.0];

/// The unit vector at an angle, in degrees.
fn at(degrees: f64) -> DVec2 {
    let (sin, cos) = libm::sincos(degrees.to_radians());
    DVec2::new(cos, sin)
}

/// What light loses at two faces.
struct Expected {
    transmittance: f64,
    /// As if light were unpolarised between the faces.
    averaged: f64,
}

/// A ray that meets the first face, with the normals of both and the ray behind them.
#[derive(Clone, Copy, Debug)]
struct TwoFaces {
    direction: DVec3,
    normals: [DVec3; 2],
    inner: DVec3,
    outer: DVec3,
}

impl TwoFaces {
    /// `None` at total reflection.
    fn of(direction: DVec3, normals: [DVec3; 2]) -> Option<Self> {
        let inner = refract(direction, normals[0], 1.0, GLASS)?.direction;
        let outer = refract(inner, normals[1], GLASS, 1.0)?.direction;
        Some(Self { direction, normals, inner, outer })
    }

    /// Faces at which light has these angles of incidence in air, with `turn` between their planes of incidence.
    fn with_angles([first, second]: [f64; 2], turn: f64) -> Self {
        let near = DVec3::new(at(first).y, 0.0, -at(first).x);
        let inner = refract(DVec3::Z, near, 1.0, GLASS).unwrap().direction;
        let sine = at(second).y / GLASS;
        let tilt = inner.cross(DVec3::Y) * at(turn).x + DVec3::Y * at(turn).y;
        let far = inner * (1.0 - sine * sine).sqrt() + tilt * sine;
        Self::of(DVec3::Z, [near, far]).unwrap()
    }

    fn turn(&self) -> f64 {
        let [first, second] = self.normals.map(|normal| normal.cross(self.inner));
        let cosine = first.dot(second) / (first.length() * second.length());
        libm::acos(cosine.abs().min(1.0)).to_degrees()
    }

    fn expected(&self) -> Expected {
        // By angles and not by cosines: sin^2(i - t) / sin^2(i + t), and the same of tangents.
        let face = |[before, behind]: [DVec3; 2], normal: DVec3| {
            let angle = |ray: DVec3| libm::atan2(ray.cross(normal).length(), ray.dot(normal).abs());
            let (i, t) = (angle(before), angle(behind));
            let square = |ratio: f64| ratio * ratio;
            let straight = square((GLASS - 1.0) / (GLASS + 1.0));
            let reflected = if i < 1e-9 {
                [straight; 2]
            } else {
                [square(libm::sin(i - t) / libm::sin(i + t)), square(libm::tan(i - t) / libm::tan(i + t))]
            };
            reflected.map(|reflected| 1.0 - reflected)
        };
        let [first, second] =
            [face([self.direction, self.inner], self.normals[0]), face([self.inner, self.outer], self.normals[1])];
        let mean = |[s, p]: [f64; 2]| 0.5 * (s + p);
        let half = |[s, p]: [f64; 2]| 0.5 * (s - p);
        let averaged = mean(first) * mean(second);
        let turn = if self.turn().is_finite() { self.turn() } else { 0.0 };
        let by_turn = libm::cos(2.0 * turn.to_radians());
        Expected { transmittance: averaged + half(first) * half(second) * by_turn, averaged }
    }

    #[track_caller]
    fn check(&self, found: f64, precision: f64) {
        let Expected { transmittance, .. } = self.expected();
        assert!((found - transmittance).abs() < precision, "{self:?}: {found}, not {transmittance}");
    }
}

/// Two squares of glass in the way of a ray along z, with an angle of incidence and a turn.
fn squares(faces: &TwoFaces) -> Vec<Value> {
    let square = |name: &str, centre: DVec3, normal: DVec3| {
        let (u, v) = normal.any_orthonormal_pair();
        let corners = [-u - v, u - v, u + v, v - u].map(|corner| (centre + corner * 0.1).to_array());
        json!({"name": name, "material": "glass", "source": {"inline": {
            "positions": corners, "triangles": [[0, 1, 2], [0, 2, 3]]}}})
    };
    vec![square("near", DVec3::ZERO, faces.normals[0]), square("far", faces.inner * 0.5, faces.normals[1])]
}

/// A flat pane in the way of the ray, at an angle in degrees.
fn flat_pane(angle: f64) -> Value {
    let DVec2 { x: cos, y: sin } = at(angle);
    json!({
        "name": "pane", "centre": [0, 0, 0], "x_axis": [cos, 0, sin], "y_axis": [0, 1, 0],
        "width": 1, "height": 1, "thickness": 0.003, "index_of_refraction": GLASS})
}

/// A camera that looks along z through things at a white sky, of one pixel.
fn looking_through(meshes: &[Value], panes: &[Value], samples: u32) -> PreparedScene {
    let scene = json!({
        "version": 2, "name": "looking through", "film": {"width": 1, "height": 1},
        "camera": {"orthographic": {
            "position": [0, 0, -1], "look_at": [0, 0, 0], "up": [0, 1, 0], "height": 1e-6}},
        "integrator": {"path": {"max_depth": 4}}, "path_filter": "TT L",
        "sampling": {"samples_per_pass": samples, "samples_per_block": samples},
        "materials": {"glass": {"dielectric": {"index_of_refraction": GLASS}}},
        "meshes": meshes, "panes": panes,
        "lights": [{"environment": {"name": "sky", "radiance": {"colour": [1, 1, 1]}}}]});
    let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
    PreparedScene::build(&SceneBundle::from_parts(description, BTreeMap::new()).unwrap()).unwrap()
}

/// What the path tracer sees.
fn seen(scene: &PreparedScene, samples: u32) -> f64 {
    let grid = TileGrid::new(1, 1, 1);
    let address = NodeAddress { frame: 0, tile: 0, level: 0, index: 0 };
    let rendered = render_node(scene, &grid, address, &AtomicBool::new(false)).unwrap();
    f64::from(rendered.node.layers().beauty[0][0]) / f64::from(samples)
}

/// The chain that a ray along z meets.
fn traced(scene: &PreparedScene, caster: Caster, events: &[SpecularEvent]) -> Chain {
    let position = DVec3::NEG_Z;
    let point = ShadingPoint { position, normal: DVec3::Z, surface: SurfaceId::Nothing, bounces: 0 };
    let seen = caster.seen_from(scene.scene(), &point).unwrap();
    Chain::trace(scene.scene(), &point, DVec3::Z, &seen, events, &mut Counters::default()).unwrap()
}

#[test]
fn averages_at_each_face_lose_light_at_large_angles() {
    for (angle, loss) in [(45.0, 0.0019), (60.0, 0.0091), (70.0, 0.0235), (80.0, 0.0573)] {
        let Expected { transmittance, averaged } = TwoFaces::with_angles([angle; 2], 0.0).expected();
        assert!((1.0 - averaged / transmittance - loss).abs() < 1e-4, "{angle}: {averaged} of {transmittance}");
    }
}

#[test]
fn a_pane_transmits_by_the_angle_between_its_planes_of_incidence() {
    let slopes = [[0.0, 0.0], [0.5, 0.0], [-0.4375, 0.25], [0.0, -0.5]].map(DVec2::from_array);
    let (mut turns, mut effect) = ([false; 3], [0.0_f64; 2]);
    for (front, back) in slopes.iter().flat_map(|front| slopes.map(|back| (*front, back))) {
        let pane = wedge(GLASS, [front, back]);
        let side = PaneSide { pane: &pane, near: Face::Front, far: Face::Back, sign: 1.0 };
        let normals = [front, back].map(unit_normal);
        for (angle, azimuth) in ANGLES.into_iter().flat_map(|angle| [0.0, 1.0, 2.5, 4.0, 5.5].map(|turn| (angle, turn)))
        {
            let (sine, cosine) = libm::sincos(f64::to_radians(angle));
            let (u, v) = normals[0].any_orthonormal_pair();
            let across = u * libm::cos(azimuth) + v * libm::sin(azimuth);
            let Some(faces) = TwoFaces::of((normals[0] * cosine + across * sine).normalize(), normals) else {
                continue;
            };
            // The ray in the glass goes through the middle of the pane.
            let middle = DVec3::new(0.0, 0.0, 0.5 * pane.thickness);
            let entry = middle - faces.inner * (middle.dot(normals[0]) / faces.inner.dot(normals[0]));
            let ray = Ray::new(entry - faces.direction * 0.05, faces.direction);
            let Some(found) = side.transmit(&ray, &mut Counters::default()) else { continue };
            // Beside the planes, faces are bent.
            if (found.direction - faces.outer).length() > 1e-12 {
                continue;
            }
            faces.check(found.transmittance.x, 1e-12);
            let Expected { transmittance, averaged } = faces.expected();
            effect = [effect[0].min(transmittance / averaged - 1.0), effect[1].max(transmittance / averaged - 1.0)];
            if faces.turn().is_finite() {
                turns[(faces.turn() / 30.1) as usize] = true;
            }
        }
    }
    assert!(turns == [true; 3] && effect[0] < -0.002 && effect[1] > 0.03, "no power: {turns:?}, {effect:?}");
}

#[test]
fn chains_transmit_by_the_angle_between_planes_of_incidence() {
    for angle in ANGLES {
        for faces in TURNS.map(|turn| TwoFaces::with_angles([angle, 0.9 * angle], turn)) {
            let scene = looking_through(&squares(&faces), &[], 1);
            let chain = traced(&scene, Caster::Mesh(0), &THROUGH_PANE);
            faces.check(chain.throughput.x, 1e-12);
        }
        let chain = traced(&looking_through(&[], &[flat_pane(angle)], 1), Caster::Pane(0), &THROUGH_PANE);
        TwoFaces::with_angles([angle; 2], 0.0).check(chain.throughput.x, 1e-12);
    }
}

#[test]
fn the_path_tracer_transmits_by_the_angle_between_planes_of_incidence() {
    const SAMPLES: u32 = 1 << 16;
    const PRECISION: f64 = 1e-4;
    for (angle, turn) in [(0.0, 0.0), (40.0, 45.0), (60.0, 0.0), (60.0, 60.0), (70.0, 90.0), (80.0, 30.0)] {
        let faces = TwoFaces::with_angles([angle; 2], turn);
        faces.check(seen(&looking_through(&squares(&faces), &[], SAMPLES), SAMPLES), PRECISION);
        let Expected { transmittance, averaged } = faces.expected();
        let is_noticed = (averaged - transmittance).abs() > 10.0 * PRECISION;
        assert!(is_noticed || angle == 0.0 || turn == 45.0, "no power at {angle}, {turn}");
    }
    for angle in [0.0, 60.0, 75.0, 85.0] {
        let found = seen(&looking_through(&[], &[flat_pane(angle)], SAMPLES), SAMPLES);
        TwoFaces::with_angles([angle; 2], 0.0).check(found, PRECISION);
    }
}
