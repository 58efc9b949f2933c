//! Tests that whatever chance comes up with, triangles, meshes and scenes of any kind, has an end, and paths that are
//! paths.

use super::ConicSearch;
use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use rayon::prelude::*;
use serde_json::json;

use super::{
    Conic, curve,
    ends::Ends,
    facet::Facet,
    facet_tree::FacetTree,
    facet_trees::facet,
    neighbours::Neighbours,
    testing::{ball, water},
    walk::first_path,
};
use crate::document::{SceneBundle, SceneDescription};
use crate::geometry::{Ray, Surface, SurfaceId};
use crate::light::{LightBounds, Source};
use crate::scene::{Scene, ShadingPoint};
use crate::specular::cache::MethodCache;
use crate::specular::scope::Scope;
use crate::specular::testing::{between, pair, random};
use crate::specular::{Arrival, SpecularEvent, SpecularMethod};
use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, SamplerSettings, TrialStream};

/// Something of a small lattice, or anything.
fn coordinate(random: &mut TrialStream, on_lattice: bool) -> f64 {
    let value = between(random, -1.0, 1.0);
    if on_lattice { (value * 2.0).round() * 0.5 } else { value }
}

/// A triangle of which nothing can be said but that scenes keep it.
fn anything(random: &mut TrialStream) -> Facet {
    let on_lattice = random.next_f64() < 0.3;
    let corners = any_corners(random, on_lattice);
    Facet { corners, normals: any_normals(random, on_lattice, &corners) }
}

/// Whether scenes keep a triangle (`scene::mesh::is_degenerate`).
fn is_kept([a, b, c]: [DVec3; 3]) -> bool {
    let longest_squared = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    (b - a).cross(c - a).length() > 1e-12 * longest_squared
}

/// Every fifth triangle is a sliver, down to the thinnest that scenes keep.
fn any_corners(random: &mut TrialStream, on_lattice: bool) -> [DVec3; 3] {
    let is_thin = random.next_f64() < 0.2;
    let thinness = libm::exp10(between(random, -12.0, -1.0));
    loop {
        let mut corners = [(); 3].map(|()| any_vector(random, on_lattice, 0.0));
        if is_thin {
            let [a, b, c] = corners;
            let edge = b - a;
            let across = edge.cross(c - a).cross(edge).normalize_or_zero() * edge.length();
            corners[2] = a + edge * between(random, -0.2, 1.2) + across * thinness;
            corners.rotate_left((random.next_f64() * 3.0) as usize);
        }
        if is_kept(corners) {
            return corners;
        }
    }
}

/// Normals that are upright, of any direction, within the triangle's plane, or such that what is interpolated between
/// them vanishes on an edge or within the triangle.
fn any_normals(random: &mut TrialStream, on_lattice: bool, corners: &[DVec3; 3]) -> [DVec3; 3] {
    let mut normals = match (random.next_f64() * 10.0) as u32 {
        0 => [(); 3].map(|()| any_direction(random, on_lattice)),
        1 => [(); 3].map(|()| within_plane(random, corners)),
        2 => {
            let [first, other] = [(); 2].map(|()| any_direction(random, on_lattice));
            [first, -first, other]
        }
        3 => {
            let [first, other] = [(); 2].map(|()| within_plane(random, corners));
            [first, -first, other]
        }
        4 => {
            let [first, second] = [(); 2].map(|()| any_direction(random, on_lattice));
            let between_both = first.lerp(second, between(random, 0.1, 0.9));
            [first, second, -between_both.try_normalize().unwrap_or(first)]
        }
        _ => [(); 3].map(|()| any_vector(random, on_lattice, 1.5).normalize()),
    };
    normals.rotate_left((random.next_f64() * 3.0) as usize);
    normals
}

fn any_direction(random: &mut TrialStream, on_lattice: bool) -> DVec3 {
    loop {
        if let Some(direction) = any_vector(random, on_lattice, 0.0).try_normalize() {
            return direction;
        }
    }
}

/// A direction along a triangle.
fn within_plane(random: &mut TrialStream, [a, b, c]: &[DVec3; 3]) -> DVec3 {
    loop {
        let along = (*b - *a) * between(random, -1.0, 1.0) + (*c - *a) * between(random, -1.0, 1.0);
        if let Some(direction) = along.try_normalize() {
            return direction;
        }
    }
}

/// An index of refraction. Every fifth refracts nothing.
fn any_index(random: &mut TrialStream) -> f64 {
    if random.next_f64() < 0.2 { 1.0 } else { between(random, 1.0, 2.4) }
}

/// Ends of which nothing can be said.
fn any_ends(random: &mut TrialStream) -> Ends {
    let on_lattice = random.next_f64() < 0.3;
    let (point, light) = (any_vector(random, on_lattice, 0.0), any_vector(random, on_lattice, 0.0));
    let is_near = random.next_f64() < 0.5;
    let source = if is_near { Source::Point(light) } else { Source::Direction(light.normalize_or(DVec3::Z)) };
    match (random.next_f64() * 5.0) as u32 {
        0 | 1 => Ends::refracted(point, source, any_index(random), false),
        2 | 3 => Ends::refracted(point, source, any_index(random), true),
        _ => Ends::mirrored(point, source),
    }
}

fn any_vector(random: &mut TrialStream, on_lattice: bool, height: f64) -> DVec3 {
    let [x, y, z] = [(); 3].map(|()| coordinate(random, on_lattice));
    DVec3::new(x, y, z + height)
}

/// Triangles of such a mesh: a leaf, two, and trees of one and two levels of nodes above them.
const TRIANGLES: [u32; 4] = [1, 9, 20, 70];

#[test]
fn a_million_triangles_of_any_kind_have_paths_that_are_paths_and_that_the_tree_opens() {
    check_triangles_of_any_kind(10);
}

#[test]
#[ignore = "takes half a minute; `tests/run long` has it"]
fn ten_million_triangles_of_any_kind_have_paths_that_are_paths_and_that_the_tree_opens() {
    check_triangles_of_any_kind(100);
}

/// Checks the paths over `chunks` times a hundred thousand triangles.
fn check_triangles_of_any_kind(chunks: u32) {
    const MESHES: usize = 100;
    const QUERIES: usize = 10;
    let paths: usize = (0..chunks)
        .into_par_iter()
        .map(|chunk| {
            let mut random = random(100 + chunk);
            let mut count = 0;
            for triangles in TRIANGLES.repeat(MESHES) {
                let facets: Vec<Facet> = (0..triangles).map(|_| anything(&mut random)).collect();
                let tree = FacetTree::over(0..triangles, |k| facets[k as usize]).unwrap();
                for _ in 0..QUERIES {
                    let ends = any_ends(&mut random);
                    let mut opened = Vec::new();
                    tree.visit(&ends, |triangle| opened.push(triangle));
                    for (triangle, facet) in (0u32..).zip(&facets) {
                        for weights in facet.paths(&ends) {
                            check_path(facet, weights, &ends);
                            assert!(opened.contains(&triangle), "not opened: {weights} of {facet:?}, {ends:?}");
                            count += 1;
                        }
                    }
                }
            }
            count
        })
        .sum();
    println!("{paths} paths");
    assert!(paths > 4_000 * chunks as usize, "{paths}");
}

/// Whether a place is on the facet, and obeys the law of refraction or reflection.
#[track_caller]
fn check_path(facet: &Facet, weights: DVec2, ends: &Ends) {
    let (place, normal) = (facet.place(weights), facet.normal(weights).normalize());
    let half =
        (ends.point - place).normalize() * ends.indices[0] + ends.offset_to_light(place).normalize() * ends.indices[1];
    assert!(weights.is_finite() && half.cross(normal).length() < 1e-6, "{weights} of {facet:?}, {ends:?}");
    assert!(weights.min_element() > -1e-6 && weights.element_sum() < 1.0 + 1e-6, "{weights}");
}

/// Triangles around a corner, with whatever normals.
fn any_fan(random: &mut TrialStream) -> Vec<Facet> {
    let count = 3 + (random.next_f64() * 38.0) as usize;
    let (middle, rim) = (anything(random), anything(random));
    let (apex, normal) = (any_vector(random, false, 0.0) * 0.5, middle.normals[0]);
    let corner = |k: usize| {
        let (sine, cosine) = libm::sincos(std::f64::consts::TAU * k as f64 / count as f64);
        let bent = 0.3 * libm::sin(3.0 * k as f64);
        (DVec3::new(cosine, sine, bent), (rim.normals[k % 3] + DVec3::new(sine, -cosine, 0.0) * 0.2).normalize())
    };
    let facet = |k: usize| {
        let [a, b] = [corner(k), corner((k + 1) % count)];
        Facet { corners: [a.0, b.0, apex], normals: [a.1, b.1, normal] }
    };
    (0..count).map(facet).collect()
}

/// Waves, a ball, a fan, or waves with more triangles on some of their edges.
fn any_mesh(random: &mut TrialStream) -> Vec<Facet> {
    let kind = (random.next_f64() * 4.0) as u32;
    let mut facets = match kind {
        0 => any_fan(random),
        1 => ball(5, 0.6),
        _ => water(8, between(random, 0.05, 0.3)),
    };
    if kind == 3 {
        for k in 0..20 {
            let Facet { corners: [a, b, _], normals: [m, n, _] } = facets[6 * k];
            let third = anything(random);
            facets.push(Facet { corners: [a, b, third.corners[0]], normals: [m, n, third.normals[0]] });
        }
    }
    facets
}

/// Walks twenty thousand times in each of `chunks` chunks, checks each path that is found, and counts them.
fn paths_of_walks_over_any_mesh(chunks: u32) -> usize {
    (0..chunks)
        .into_par_iter()
        .map(|chunk| {
            let mut random = random(300 + chunk);
            let mut paths = 0;
            for _ in 0..20 {
                let facets = any_mesh(&mut random);
                let neighbours = Neighbours::of(0..facets.len() as u32, |k| facets[k as usize]);
                for _ in 0..1000 {
                    let ends = any_ends(&mut random);
                    let triangle = ((random.next_f64() * facets.len() as f64) as u32, pair(&mut random) * 0.5);
                    let crossed = |(k, facet)| Some((k, curve::straight_through(facet, &ends)?));
                    // From the straight line to the light where that crosses the mesh, as it should be, or from
                    // anywhere.
                    let start = (0u32..).zip(&facets).find_map(crossed).unwrap_or(triangle);
                    let path = first_path(start, |k| facets[k as usize], &neighbours, &ends);
                    if let Some((triangle, weights)) = path {
                        check_path(&facets[triangle as usize], weights, &ends);
                        paths += 1;
                    }
                }
            }
            paths
        })
        .sum()
}

#[test]
fn walks_from_anywhere_over_any_mesh_end_with_paths() {
    let paths = paths_of_walks_over_any_mesh(10);
    println!("{paths} paths");
    assert!(paths > 10_000, "{paths}");
}

#[test]
#[ignore = "takes minutes; `tests/run long` has it"]
fn ten_million_walks_from_anywhere_over_any_mesh_end_with_paths() {
    let paths = paths_of_walks_over_any_mesh(500);
    println!("{paths} paths");
    assert!(paths > 500_000, "{paths}");
}

/// A scene of triangles of any kind, or of a mesh, with a light of every kind. Those that lie face to face are refused.
fn any_scene(random: &mut TrialStream) -> Scene {
    loop {
        match any_bundle(random).build_scene() {
            Ok(scene) => return scene,
            Err(error) => assert!(error.to_string().contains("two faces lie in one place"), "{error}"),
        }
    }
}

fn any_bundle(random: &mut TrialStream) -> SceneBundle {
    let triangles = TRIANGLES[(random.next_f64() * 4.0) as usize];
    let is_mesh = random.next_f64() < 0.2;
    let facets: Vec<Facet> =
        if is_mesh { any_mesh(random) } else { (0..triangles).map(|_| anything(random)).collect() };
    let all = |vectors: fn(&Facet) -> [DVec3; 3]| -> Vec<[f64; 3]> {
        facets.iter().flat_map(vectors).map(|vector| vector.to_array()).collect()
    };
    let corners: Vec<[usize; 3]> = (0..facets.len()).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    let smooth = if random.next_f64() < 0.7 {
        json!({"dielectric": {"index_of_refraction": any_index(random)}})
    } else {
        json!({"mirror": {"reflectance": [0.9, 0.8, 0.7]}})
    };
    let [lamp, sphere, disk, panel] = [(); 4].map(|()| (any_vector(random, false, 0.0) * 2.0).to_array());
    let [towards, sunwards] = [(); 2].map(|()| any_direction(random, false).to_array());
    // Small enough for rays, and too large for them.
    let size = libm::exp10(between(random, -3.0, -0.3));
    let description = json!({
        "version": 1, "name": "anything", "film": {"width": 4, "height": 4},
        "camera": {"orthographic": {"position": [0, 0, 3], "look_at": [0, 0, 0], "up": [0, 1, 0], "height": 1}},
        "integrator": {"path": {}},
        "materials": {"smooth": smooth},
        "meshes": [{"name": "anything", "material": "smooth", "source": {"inline": {
            "positions": all(|facet| facet.corners), "normals": all(|facet| facet.normals), "triangles": corners}}}],
        "lights": [
            {"point": {"name": "lamp", "position": lamp, "intensity": [1, 1, 1]}},
            {"sphere": {"name": "sphere", "centre": sphere, "radius": size, "radiance": [1, 1, 1]}},
            {"disk": {"name": "disk", "centre": disk, "normal": towards, "radius": size, "radiance": [1, 1, 1]}},
            {"rectangle": {"name": "panel", "centre": panel, "edge_u": [size, 0, 0], "edge_v": [0, size, 0],
                "radiance": [1, 1, 1]}},
            {"sun": {"name": "sun", "direction": sunwards, "angular_radius": 60.0 * size, "radiance": [1, 1, 1]}}],
    });
    let description = SceneDescription::parse(description.to_string().as_bytes()).unwrap();
    SceneBundle::from_parts(description, BTreeMap::new()).unwrap()
}

/// A place that light can be gathered at: anywhere, or on the mesh itself.
fn any_point(random: &mut TrialStream, scene: &Scene) -> ShadingPoint {
    let triangles = scene.meshes()[0].triangle_range();
    let triangle = triangles.start + (random.next_f64() * triangles.len() as f64) as u32;
    let (anywhere, on_it) = (any_vector(random, false, 0.0), facet(scene, 0, triangle).place(pair(random) * 0.5));
    let position = if random.next_f64() < 0.9 { anywhere } else { on_it };
    let bounces = u32::from(random.next_f64() < 0.2);
    ShadingPoint { position, normal: any_direction(random, false), surface: SurfaceId::Nothing, bounces }
}

/// Whether a ray against arriving light comes to the light.
fn leads_to_light(scene: &Scene, point: &ShadingPoint, direction: DVec3, event: SpecularEvent, light: u32) -> bool {
    let ray = Ray::new(point.position, direction);
    let hit = scene.accelerator().closest_hit(&ray, f64::INFINITY, point.surface, &mut Counters::default());
    let Some((Surface::Triangle { index, barycentric }, place)) = hit.map(|hit| (hit.surface, ray.at(hit.distance)))
    else {
        return false;
    };
    let (interface, at) = (scene.delta_bsdf(index).unwrap(), scene.surface_point(index, barycentric));
    let next = match event {
        SpecularEvent::Transmission => interface.transmit(direction, &at.normals).map(|crossing| crossing.direction),
        SpecularEvent::Reflection => interface.reflect(direction, &at).map(|mirrored| mirrored.direction),
    };
    let light = &scene.lights()[light as usize];
    next.is_some_and(|next| match light.bounds() {
        LightBounds::Ball { centre, .. } if light.is_delta() => (centre - place).normalize().distance(next) < 1e-4,
        _ => light.intersect(&Ray::new(place, next)).is_some(),
    })
}

#[test]
fn a_hundred_thousand_calls_of_the_method_end_with_finite_light_over_any_mesh_under_any_light() {
    const SCENES: u32 = 640;
    const POINTS: u32 = 8;
    let counts: Vec<[[usize; 3]; 2]> = (0..SCENES)
        .into_par_iter()
        .map(|number| {
            let mut random = random(1000 + number);
            let scene = any_scene(&mut random);
            let scope = Scope::new(&scene, &["R".to_owned(), "T".to_owned()], None, None);
            [ConicSearch::Complete, ConicSearch::Published].map(|search| {
                let method = Conic::new(&scene, search, scope.clone(), &MethodCache::default());
                let (mut calls, mut arrivals, mut led) = (0, 0, 0);
                for index in 0..POINTS {
                    let point = any_point(&mut random, &scene);
                    for light in 0..scene.lights().len() as u32 {
                        for event in [SpecularEvent::Transmission, SpecularEvent::Reflection] {
                            let settings = SamplerSettings { seed: 6, samples_per_block: 1 };
                            let mut stream = SampleStream::new(&settings, 0, [index, number], 0);
                            let counters = &mut Counters::default();
                            let mut arrive = |Arrival { direction, weight, .. }: Arrival| {
                                let is_light = weight.is_finite() && weight.min_element() >= 0.0;
                                let is_direction = (direction.length() - 1.0).abs() < 1e-9;
                                assert!(
                                    is_light && is_direction,
                                    "{number}: {weight} along {direction} at {point:?} from {light}, {event:?}, \
                                     {search:?}"
                                );
                                arrivals += 1;
                                led += usize::from(leads_to_light(&scene, &point, direction, event, light));
                            };
                            method.sample_li(&scene, &point, light, &[event], &mut stream, counters, &mut arrive);
                            calls += 1;
                        }
                    }
                }
                [calls, arrivals, led]
            })
        })
        .collect();
    for (search, (name, least)) in [("complete", 4000), ("published", 400)].into_iter().enumerate() {
        let [calls, arrivals, led] =
            [0, 1, 2].map(|which| counts.iter().map(|by_search| by_search[search][which]).sum::<usize>());
        println!("{name}: {calls} calls, {arrivals} arrivals, {led} of them by rays that come to the light");
        assert!(calls > 50_000 && arrivals > least, "{name}: {calls} {arrivals}");
        // Slivers are met beside where the path is, and the rims of lights are missed by rounding.
        assert!(led * 100 >= arrivals * 95, "{name}: {led} of {arrivals}");
    }
}
