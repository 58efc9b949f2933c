//! The published equations (Granizo-Hidalgo and Holzschuch 2024) against values found by other means. The corrected
//! equations agree, and the printed ones do not. The list is in `docs/integrators.md`.

use crate::specular::constraint::ManifoldConstraint;
use crate::specular::manifold::WalkSteps;
use std::collections::BTreeMap;

use glam::{DMat3, DVec2, DVec3, Vec3Swizzles};
use serde_json::json;

use super::{
    curve::{arcs_within, crossings, quadratic_form, straight_through, value},
    degenerate::any_facet,
    ends::Ends,
    facet::Facet,
    testing::WATER,
};
use crate::bsdf::fresnel::refract;
use crate::document::{SceneBundle, SceneDescription};
use crate::geometry::SurfaceId;
use crate::light::{Source, SourceSample};
use crate::scene::{Scene, ShadingPoint};
use crate::specular::SpecularEvent;
use crate::specular::caster::Caster;
use crate::specular::manifold::ManifoldWalk;
use crate::specular::testing::{between, pair, random};
use clerestory_film::TrialStream;
use clerestory_film::counters::Counters;

/// A bent facet, and ends below and above it.
fn bent(random: &mut TrialStream) -> (Facet, Ends) {
    let facet = any_facet(random, 0.4);
    let mut end = |height: f64| {
        DVec3::new(between(random, -1.0, 1.0), between(random, -1.0, 1.0), height * between(random, 0.5, 2.0))
    };
    let (point, light) = (end(-1.0), end(1.5));
    (facet, Ends::refracted(point, Source::Point(light), WATER, false))
}

fn columns(corners: &[DVec3; 3]) -> DMat3 {
    DMat3::from_cols(corners[0], corners[1], corners[2])
}

fn place(facet: &Facet, [alpha, beta]: [f64; 2]) -> DVec3 {
    facet.place(DVec2::new(alpha, beta))
}

/// The triple product of equation 9, over the lengths of its vectors.
fn out_of_plane(facet: &Facet, ends: &Ends, at: [f64; 2]) -> f64 {
    let [across, to_place] = [ends.across(), place(facet, at) - ends.point].map(DVec3::normalize);
    facet.normal(DVec2::from(at)).normalize().dot(across.cross(to_place))
}

/// The matrix of equation 10, for places `(alpha, beta, 1)`.
fn matrix(facet: &Facet, ends: &Ends) -> DMat3 {
    let ([v0, v1, v2], [n0, n1, n2]) = (facet.corners, facet.normals);
    let across = ends.across();
    let normals = DMat3::from_cols(n1 - n0, n2 - n0, n0);
    let turned = DMat3::from_cols(across.cross(v1 - v0), across.cross(v2 - v0), across.cross(v0 - ends.point));
    normals.transpose() * turned
}

/// The roots of `a x^2 + b x + c` between zero and one.
fn roots_within([a, b, c]: [f64; 3]) -> Vec<f64> {
    let root = (b * b - 4.0 * a * c).sqrt();
    [(-b - root) / (2.0 * a), (-b + root) / (2.0 * a)].into_iter().filter(|x| (0.0..=1.0).contains(x)).collect()
}

#[test]
fn the_curve_crosses_edges_where_equations_22_to_24_say_with_their_letters_in_order() {
    let mut random = random(31);
    let (mut met, mut printed_met, mut printed_beside) = (0, 0, 0);
    for _ in 0..5000 {
        let (facet, ends) = bent(&mut random);
        let m = matrix(&facet, &ends);
        let [a, b, c] = [m.x_axis.x, m.y_axis.y, m.x_axis.y + m.y_axis.x];
        let [d, e, f] = [m.x_axis.z + m.z_axis.x, m.y_axis.z + m.z_axis.y, m.z_axis.z];
        let at_alpha = |middle: f64| roots_within([b, middle, f]).into_iter().map(|beta| [0.0, beta]);
        let at_beta = |middle: f64| roots_within([a, middle, f]).into_iter().map(|alpha| [alpha, 0.0]);
        let last = [a + b - c, c + e - 2.0 * a - d, a + d + f];
        let at_third = roots_within(last).into_iter().map(|beta| [1.0 - beta, beta]);
        let right: Vec<[f64; 2]> = at_alpha(e).chain(at_beta(d)).chain(at_third).collect();
        for &at in &right {
            let residual = out_of_plane(&facet, &ends, at);
            assert!(residual.abs() < 1e-9, "{residual} at {at:?} of {facet:?}, {ends:?}");
        }
        // The search along the curve goes by the same crossings.
        let form = quadratic_form(&columns(&facet.corners), &columns(&facet.normals), &ends).unwrap();
        let ours = crossings(&form);
        assert_eq!(ours.len(), right.len(), "{facet:?}, {ends:?}");
        for crossing in ours {
            let near = |at: &[f64; 2]| (DVec2::from(*at) - crossing.yz()).abs().max_element() < 1e-7;
            assert!(right.iter().any(near), "{crossing:?} of {right:?}");
        }
        met += right.len();
        for at in at_alpha(d).chain(at_beta(c)) {
            printed_met += 1;
            printed_beside += usize::from(out_of_plane(&facet, &ends, at).abs() > 1e-4);
        }
    }
    assert!(met > 2000, "{met}");
    assert!(printed_met > 500 && printed_beside * 10 > printed_met * 9, "{printed_beside} of {printed_met}");
}

#[test]
fn the_tangent_of_equations_13_to_15_is_that_of_the_matrix_and_its_transpose() {
    let mut random = random(32);
    let (mut checked, mut printed_beside) = (0, 0);
    for _ in 0..2000 {
        let (facet, ends) = bent(&mut random);
        let form = quadratic_form(&columns(&facet.corners), &columns(&facet.normals), &ends).unwrap();
        let m = matrix(&facet, &ends);
        for arc in arcs_within(&form).unwrap_or_default() {
            let weights = |t: f64| value(&arc, t) / value(&arc, t).element_sum();
            let at = weights(0.3).yz();
            let homogeneous = at.extend(1.0);
            let tangent = |gradient: DVec3| DVec2::new(-gradient.y, gradient.x).normalize();
            let right = tangent((m + m.transpose()) * homogeneous);
            // How fast the triple product grows along a direction, over how fast it can.
            let slope = |direction: DVec2| {
                let step = direction * 1e-6;
                out_of_plane(&facet, &ends, (at + step).into()) - out_of_plane(&facet, &ends, (at - step).into())
            };
            let steepest = DVec2::new(slope(DVec2::X), slope(DVec2::Y)).length();
            assert!(slope(right).abs() < 1e-4 * steepest, "{} of {steepest}", slope(right));
            // The arcs that the walk follows run in that direction, or the opposite.
            let along = (weights(0.3 + 1e-6) - weights(0.3 - 1e-6)).yz().normalize();
            assert!(along.perp_dot(right).abs() < 1e-3, "{along} {right}");
            checked += 1;
            printed_beside += usize::from(slope(tangent(m.transpose() * homogeneous)).abs() > 1e-2 * steepest);
        }
    }
    assert!(checked > 1000 && printed_beside * 10 > checked * 9, "{printed_beside} of {checked}");
}

#[test]
fn the_defect_changes_its_sign_on_flat_surfaces_where_that_of_equations_20_and_21_has_none() {
    let mut random = random(33);
    let mut checked = 0;
    for _ in 0..1000 {
        let (facet, ends) = bent(&mut random);
        let facet = Facet { normals: [facet.area().normalize(); 3], ..facet };
        let form = quadratic_form(&columns(&facet.corners), &columns(&facet.normals), &ends).unwrap();
        let [first, second] = crossings(&form)[..] else { continue };
        let [path] = facet.paths(&ends)[..] else { continue };
        let path = DVec3::new(1.0 - path.element_sum(), path.x, path.y);
        let mut defects = Vec::new();
        let along = (second - first).yz();
        let tangent = place(&facet, along.into()) - facet.corners[0];
        for weights in [first, second] {
            let weights = path.lerp(weights, 0.5);
            let at = facet.place(weights.yz());
            let towards = (at - ends.point).normalize();
            let Some(behind) = refract(towards, facet.normals[0], WATER, 1.0).map(|refraction| refraction.direction)
            else {
                continue;
            };
            let missed = behind.cross(ends.offset_to_light(at).normalize());
            let printed = tangent.normalize().dot(missed);
            assert!(printed.abs() < 1e-9 * missed.length(), "{printed}");
            defects.push(facet.defect(&ends, weights.yz()).unwrap());
            assert!((defects[defects.len() - 1].abs() - missed.length()).abs() < 1e-12);
        }
        let [before, behind] = defects[..] else { continue };
        // Between the two places is the path, and perhaps the straight line, where the sign changes as well.
        let part = |weights: DVec2| (weights - first.yz()).dot(along) / along.length_squared();
        let ends_at = [first, second].map(|end| part(path.lerp(end, 0.5).yz()));
        let straight = straight_through(&facet, &ends).map(part);
        let is_between = straight.is_some_and(|at| (ends_at[0]..ends_at[1]).contains(&at));
        assert_eq!(before * behind > 0.0, is_between, "{defects:?}");
        checked += 1;
    }
    assert!(checked > 100, "{checked}");
}

/// A facet of the scene: water, lit by a lamp of unit intensity.
fn scene_of(facet: &Facet) -> Scene {
    let vectors = |vectors: [DVec3; 3]| vectors.map(|vector| vector.to_array());
    let description = json!({
        "version": 1, "name": "a bent triangle", "film": {"width": 4, "height": 4},
        "camera": {"orthographic": {"position": [0, 0, -1], "look_at": [0, 0, 0], "up": [0, 1, 0], "height": 1}},
        "integrator": {"path": {}},
        "materials": {"water": {"dielectric": {"index_of_refraction": WATER}}},
        "meshes": [{"name": "water", "material": "water", "source": {"inline": {
            "positions": vectors(facet.corners), "normals": vectors(facet.normals), "triangles": [[0, 1, 2]]}}}],
        "lights": [{"point": {"name": "lamp", "position": [0, 0, 9], "intensity": [1, 1, 1]}}],
    });
    let description = SceneDescription::parse(description.to_string().as_bytes()).unwrap();
    SceneBundle::from_parts(description, BTreeMap::new()).unwrap().build_scene().unwrap()
}

/// A path over a facet, as the equations have it.
struct Path {
    facet: Facet,
    /// Weights of the second and third corner.
    at: DVec2,
    /// From M to P and to L, unit vectors.
    to_point: DVec3,
    to_light: DVec3,
    /// The lengths d_P and d_L.
    lengths: [f64; 2],
}

/// How equations 28 and 31 are read.
#[derive(Clone, Copy, Debug)]
enum Reading {
    Corrected,
    /// As printed, a prime being the derivative of the direction from M to P.
    Printed,
    /// As printed, a prime being the derivative of the direction from P to M.
    PrintedFromPoint,
}

impl Path {
    /// A path over any place of a bent facet whose light does not graze it; the light is where the ray is refracted to.
    fn any(random: &mut TrialStream) -> Option<Self> {
        let (facet, ends) = bent(random);
        let at = 0.1 + 0.4 * pair(random);
        let place = facet.place(at);
        let direction = (place - ends.point).normalize();
        let to_light = refract(direction, facet.normal(at).normalize(), WATER, 1.0)?.direction;
        let lengths = [(ends.point - place).length(), between(random, 0.5, 2.0)];
        (to_light.z > 0.2).then_some(Self { facet, at, to_point: -direction, to_light, lengths })
    }

    fn place(&self) -> DVec3 {
        self.facet.place(self.at)
    }

    fn point(&self) -> DVec3 {
        self.place() + self.to_point * self.lengths[0]
    }

    fn light(&self) -> DVec3 {
        self.place() + self.to_light * self.lengths[1]
    }

    /// How the weights change when M moves along the triangle.
    fn turned(&self, moved: DVec3) -> DVec2 {
        let [a, b, c] = self.facet.corners;
        (DMat3::from_cols(b - a, c - a, self.facet.area()).inverse() * moved).truncate()
    }

    /// The distance correction D of equations 28 to 33.
    fn correction(&self, reading: Reading) -> f64 {
        let [first, second] = [1, 2].map(|k: usize| self.facet.normals[k] - self.facet.normals[0]);
        let (p, l) = (self.to_point, self.to_light);
        let geometric = self.facet.area().normalize();
        let unnormalised = self.facet.normal(self.at);
        let normal = unnormalised.normalize();
        let (u, v) = p.any_orthonormal_pair();
        let [along_u, along_v] = [u, v].map(|turn| {
            let (p_turned, sign) = match reading {
                Reading::Corrected => (turn, -1.0),
                Reading::Printed => (turn, 1.0),
                Reading::PrintedFromPoint => (-turn, 1.0),
            };
            let moved = (p_turned - p * (p_turned.dot(geometric) / p.dot(geometric))) * (sign * self.lengths[0]);
            let weights = self.turned(moved);
            let normal_moved = first * weights.x + second * weights.y;
            let normal_moved = (normal_moved - normal * normal.dot(normal_moved)) / unnormalised.length();
            let mu = l.dot(normal) + WATER * p.dot(normal);
            let mu_turned =
                (WATER * WATER * p.dot(normal) / l.dot(normal) + WATER) * (p_turned.dot(normal) + p.dot(normal_moved));
            let l_turned = p_turned * (sign * WATER) + normal * mu_turned + normal_moved * mu;
            moved - l * moved.dot(l) + l_turned * self.lengths[1]
        });
        along_u.cross(along_v).length()
    }

    /// Where rays from one end that are turned a little arrive around the other, across the path: area for each solid
    /// angle, by finite differences.
    fn spread(&self, from: DVec3, indices: [f64; 2], to: DVec3, arriving: DVec3) -> f64 {
        let towards = (self.place() - from).normalize();
        let deflection = |turn: DVec3| {
            let direction = (towards + turn).normalize();
            let area = self.facet.area();
            let place = from + direction * ((self.place() - from).dot(area) / direction.dot(area));
            let normal = self.facet.normal(self.at + self.turned(place - self.place())).normalize();
            let behind = refract(direction, normal, indices[0], indices[1]).unwrap().direction;
            place + behind * ((to - place).dot(arriving) / behind.dot(arriving)) - to
        };
        let (u, v) = towards.any_orthonormal_pair();
        let step = 1e-5;
        let [along_u, along_v] = [u, v].map(|axis| (deflection(axis * step) - deflection(axis * -step)) / (2.0 * step));
        along_u.cross(along_v).length()
    }
}

#[test]
fn the_distance_correction_of_equations_28_to_33_is_that_of_rays_beside_the_path_and_one_over_the_geometry_factor() {
    let mut random = random(34);
    let (mut checked, mut printed_wrong) = (0, [0; 2]);
    while checked < 300 {
        let Some(path) = Path::any(&mut random) else { continue };
        let spread = path.spread(path.point(), [WATER, 1.0], path.light(), path.to_light);
        let (point, to) = (path.point(), path.light());
        let backwards = path.spread(to, [1.0, WATER], point, path.to_point);
        // Close to a fold, differences of rays are too coarse.
        if spread < 0.05 {
            continue;
        }
        let correction = path.correction(Reading::Corrected);
        assert!((correction / spread - 1.0).abs() < 1e-5, "{correction} is not {spread}");
        for (reading, wrong) in [Reading::Printed, Reading::PrintedFromPoint].into_iter().zip(&mut printed_wrong) {
            *wrong += usize::from((path.correction(reading) / spread - 1.0).abs() > 1e-2);
        }
        // The lamp's rays arrive in an area that is smaller by the square of the indices' ratio, which equation 25
        // lacks: etendue is kept, but for what refraction about normals other than the triangle's own makes of it
        // (Veach 1997, section 5.3).
        let (geometric, normal) = (path.facet.area().normalize(), path.facet.normal(path.at).normalize());
        let tilted = |direction: DVec3| direction.dot(normal) / direction.dot(geometric);
        let kept = tilted(path.to_light) / tilted(path.to_point) * correction / (WATER * WATER);
        assert!((backwards / kept - 1.0).abs() < 1e-5, "{backwards} is not {kept}");

        let scene = scene_of(&path.facet);
        let shading = ShadingPoint { position: point, normal: DVec3::Z, surface: SurfaceId::Nothing, bounces: 0 };
        let counters = &mut Counters::default();
        let events = [SpecularEvent::Transmission];
        let (constraint, steps) = (ManifoldConstraint::AngleDifference, WalkSteps::default());
        let caster = Caster::Mesh(0).seen_from(&scene, &shading).unwrap();
        let source = Source::Point(to);
        let walk = ManifoldWalk { scene: &scene, point: &shading, source, caster, events: &events, constraint, steps };
        let solved = walk.path_over(0, path.place(), path.at, counters).unwrap();
        let sample = SourceSample { source, normal: None, triangle: None, weight: DVec3::ONE };
        assert!((solved.magnification(&sample) * correction - 1.0).abs() < 1e-6, "{correction}");
        let transmitted = refract(-path.to_point, normal, WATER, 1.0).unwrap().transmittance();
        let light = solved.arrival(&scene, &shading, 0, &sample, counters).unwrap().weight.x;
        assert!((light * correction / (transmitted * WATER * WATER) - 1.0).abs() < 1e-6, "{light}");
        checked += 1;
    }
    assert!(printed_wrong.iter().all(|&wrong| wrong > 250), "{printed_wrong:?} of {checked}");
}
