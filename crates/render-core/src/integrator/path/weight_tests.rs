//! Techniques that find one path share it: their weights sum to one, path by path.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::light_vertex::{LightVertex, OneSubpath};
use super::*;
use crate::bsdf::{Bsdf, SurfacePoint};
use crate::document::{SceneBundle, SceneDescription};
use crate::integrator::allocation::Splats;
use crate::integrator::light_subpaths::{Edge, FromLight, On, PlaceOnFace, connection_share, splat_share};
use crate::scene::media::Bodies;
use crate::specular::{Arrival, SampledPath};
use clerestory_film::SamplerSettings;

/// A room with an old pane, and another one outside of it, in one wall.
pub(super) fn room(lights: &Value, panes: usize) -> Value {
    let wall = |name: &str, material: &str, corners: [[f64; 3]; 4]| {
        let source = json!({"inline": {"positions": corners, "triangles": [[0, 1, 2], [0, 2, 3]]}});
        json!({"name": name, "material": material, "source": source})
    };
    let pane = |index: usize| {
        let face = |seed: usize| json!({"hammered": {"wavelength": 0.05, "amplitude": 1e-4, "seed": seed}});
        json!({
            "name": format!("pane {index}"), "centre": [2.0 + 0.1 * index as f64, 0, 1.5],
            "x_axis": [0, 1, 0], "y_axis": [0, 0, 1], "width": 1, "height": 1, "thickness": 0.004,
            "absorption": [5, 20, 50], "front": face(index), "back": face(index + 7)
        })
    };
    let gloss = json!({"metallic_roughness": {
        "base_colour": {"colour": [0.8, 0.6, 0.4]}, "metallic": 0.5, "roughness": 0.4}});
    json!({
        "version": 2, "name": "room", "film": {"width": 4, "height": 4},
        "camera": {"perspective": {
            "position": [1.9, 1.8, 1.5], "look_at": [-1, -1, 0.5], "up": [0, 0, 1], "vertical_field_of_view": 60}},
        "integrator": "auto",
        "materials": {"plaster": {"diffuse": {"reflectance": {"colour": [0.7, 0.7, 0.7]}}}, "gloss": gloss},
        "meshes": [
            wall("floor", "gloss", [[-2.0, -2.0, 0.0], [2.0, -2.0, 0.0], [2.0, 2.0, 0.0], [-2.0, 2.0, 0.0]]),
            wall("back", "plaster", [[-2.0, -2.0, 0.0], [-2.0, 2.0, 0.0], [-2.0, 2.0, 3.0], [-2.0, -2.0, 3.0]]),
            wall("side", "gloss", [[-2.0, -2.0, 0.0], [2.0, -2.0, 0.0], [2.0, -2.0, 3.0], [-2.0, -2.0, 3.0]]),
            wall("ceiling", "plaster", [[-2.0, -2.0, 3.0], [2.0, -2.0, 3.0], [2.0, 2.0, 3.0], [-2.0, 2.0, 3.0]])
        ],
        "panes": (0..panes).map(pane).collect::<Vec<_>>(), "lights": lights
    })
}

/// The same room with sheets of window glass over its open sides, two over one of them.
pub(super) fn glazed_room(lights: &Value) -> Value {
    let mut scene = room(lights, 0);
    scene["materials"]["sheet"] = json!({"thin_wall": {"tint": {"colour": [0.8, 0.9, 1]}}});
    let corners = [
        [[2.0, -2.0, 0.0], [2.0, 2.0, 0.0], [2.0, 2.0, 3.0], [2.0, -2.0, 3.0]],
        [[2.1, -2.1, -0.1], [2.1, 2.1, -0.1], [2.1, 2.1, 3.1], [2.1, -2.1, 3.1]],
        [[-2.0, 2.0, 0.0], [2.0, 2.0, 0.0], [2.0, 2.0, 3.0], [-2.0, 2.0, 3.0]],
    ];
    let sheets = corners.iter().enumerate().map(|(number, corners)| {
        let source = json!({"inline": {"positions": corners, "triangles": [[0, 1, 2], [0, 2, 3]]}});
        json!({"name": format!("sheet {number}"), "material": "sheet", "source": source})
    });
    scene["meshes"].as_array_mut().unwrap().extend(sheets);
    scene
}

fn prepared(scene: &Value) -> PreparedScene {
    let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
    PreparedScene::build(&SceneBundle::from_parts(description, BTreeMap::new()).unwrap()).unwrap()
}

/// A vertex of a path, with the unit directions towards the camera and the light.
struct Vertex<'a> {
    bsdf: &'a dyn Bsdf,
    at: SurfacePoint,
    position: DVec3,
    triangle: u32,
    towards: [DVec3; 2],
}

impl Vertex<'_> {
    /// Densities with which the camera's walk and light go on.
    fn densities(&self) -> [f64; 2] {
        let [camera, light] = self.towards;
        [self.bsdf.pdf(&self.at, -camera, light), self.bsdf.pdf(&self.at, -light, camera)]
    }

    fn cosines(&self) -> [f64; 2] {
        self.towards.map(|direction| self.at.normals.geometric.dot(direction).abs())
    }
}

/// The shares of all techniques in the path that joins the camera's first vertex to the last one of a light subpath;
/// `None` where they do not see each other. With `is_behind_glass`, the camera sees the first vertex through glass, and
/// nothing splats there.
fn shares(tracer: &PathTracer<'_>, ray: &Ray, subpath: &OneSubpath<'_>, is_behind_glass: bool) -> Option<Vec<f64>> {
    let counters = &mut Counters::default();
    let hit = tracer.scene.accelerator().closest_hit(ray, f64::INFINITY, SurfaceId::Nothing, counters)?;
    let Surface::Triangle { index, barycentric } = hit.surface else { return None };
    let first = (tracer.scene.bsdf(index), tracer.scene.surface_point(index, barycentric), ray.at(hit.distance), index);
    let of_light =
        subpath.vertices.iter().rev().map(|vertex| (vertex.bsdf, vertex.at, vertex.position, vertex.triangle));
    let places: Vec<_> = std::iter::once(first).chain(of_light).collect();
    // Light may have been mirrored by a pane between two surfaces.
    let is_straight = |pair: &[LightVertex<'_>]| {
        let offset = pair[1].position - pair[0].position;
        offset.normalize().dot(pair[0].outgoing) > 1.0 - 1e-9
    };
    if !subpath.vertices.windows(2).all(is_straight) {
        return None;
    }
    let incident = subpath.vertices[0].incident;
    let vertices: Vec<Vertex<'_>> = (0..places.len())
        .map(|number| {
            let (bsdf, at, position, triangle) = places[number];
            let towards = |other: usize| (places[other].2 - position).normalize();
            let camera = if number == 0 { -ray.direction } else { towards(number - 1) };
            let light = if number + 1 == places.len() { -incident } else { towards(number + 1) };
            Vertex { bsdf, at, position, triangle, towards: [camera, light] }
        })
        .collect();
    let onwards = Ray::new(vertices[0].position, vertices[0].towards[1]);
    let squared = |number: usize| vertices[number].position.distance_squared(vertices[number + 1].position);
    let surface = SurfaceId::Triangle(index);
    let blocked =
        tracer.scene.blocked_from_triangle(&onwards, squared(0).sqrt(), surface, vertices[1].triangle, counters);
    // On one surface, no light goes from one to the other.
    let sees = vertices.iter().all(|vertex| vertex.densities().into_iter().all(|density| density > 0.0));
    if blocked || !sees {
        return None;
    }
    let asks_methods = is_behind_glass || !tracer.light_plane.is_alone;
    let splats = if is_behind_glass { 0.0 } else { tracer.light_plane.shared_by };
    let sight = tracer.scene.camera().sight(vertices[0].position)?;
    let seen = sight.density * vertices[0].cosines()[0];
    let mut by_light = vec![if splats > 0.0 { FromCamera::seen(splats, seen) } else { FromCamera::default() }];
    for number in 1..vertices.len() {
        let [before, vertex] = [&vertices[number - 1], &vertices[number]];
        let [of_camera, of_light] = before.densities();
        let cosines = [before.cosines()[1], vertex.cosines()[0]];
        let straight = tracer.is_connected.then(|| squared(number - 1));
        let edge = Edge { straight, cosines, pdf: of_camera };
        by_light.push(FromCamera::behind(&edge, by_light[number - 1].total(|| of_light)));
    }
    let last = vertices.len() - 1;
    let connections = if tracer.is_connected { last } else { 0 };
    // What others share with none, light subpaths leave to them.
    let mut shares: Vec<f64> = (0..connections)
        .map(|number| {
            let [here, next] = [&vertices[number], &vertices[number + 1]];
            let [of_camera, of_light] = here.densities();
            let in_subpath = last - number - 1;
            let by_camera =
                tracer.by_camera(subpath, in_subpath, next.towards[0], (last as u32, asks_methods), counters);
            by_camera.map_or(0.0, |by_camera| {
                let from = [(by_light[number].total(|| of_light), of_camera), (by_camera, next.densities()[1])];
                connection_share([here.cosines()[1], next.cosines()[0]], squared(number), from)
            })
        })
        .collect();
    if splats > 0.0 {
        let [here, next] = [&vertices[0], &vertices[1]];
        let by_camera = tracer.by_camera(subpath, last - 1, next.towards[0], (last as u32, asks_methods), counters);
        let cosines = [next.cosines()[0], here.cosines()[1]];
        let straight = tracer.is_connected.then(|| squared(0));
        let edge = Edge { straight, cosines, pdf: next.densities()[1] };
        shares.push(by_camera.map_or(0.0, |by_camera| {
            splat_share(splats, seen, FromLight::behind(&edge).total(here.densities()[0], by_camera))
        }));
    }
    let end = &vertices[last];
    let start = &subpath.start;
    let light = start.light;
    let source = &tracer.scene.lights()[light as usize];
    let [of_camera, of_light] = end.densities();
    let normal = end.at.normals.facing(-end.towards[0]);
    let surface = SurfaceId::Triangle(end.triangle);
    let point = ShadingPoint { position: end.position, normal, surface, bounces: last as u32 };
    let receiver = Receiver::anywhere(end.position);
    let origin = Origin {
        point,
        receiver,
        pdf: of_camera,
        gathers_behind: false,
        cosine: end.cosines()[1],
        by_light: by_light[last].total(|| of_light),
    };
    let to_light = Ray::new(start.ray.origin, -start.ray.direction);
    let of_end = if let On::Face(PlaceOnFace { pane, face, sample, .. }) = &start.on {
        let (pane, face) = (*pane, *face);
        let hit = if let Source::Point(position) = sample.source
            && source.is_delta()
        {
            LightHit { distance: position.distance(start.ray.origin), radiance: DVec3::ONE, triangle: None }
        } else {
            source.intersect(&to_light)?
        };
        let links = subpath.links.clone();
        let path = SpecularPath {
            light,
            source: sample.source,
            triangle: sample.triangle,
            last_direction: to_light.direction,
            links: &links,
        };
        let surface = SurfaceId::Pane { index: pane, face };
        if let Some(point) = tracer.owner(point, false, &path, counters) {
            let density = tracer.method.unwrap().density(tracer.scene, &point, &path, counters);
            let transmitted = subpath.choices;
            let path = density.map(|density| SampledPath { density, surface, exit: to_light, hit, transmitted });
            let arrival = Arrival { direction: end.towards[1], weight: DVec3::ONE, path };
            let air = Bodies::default();
            let lobe = Lobe {
                bsdf: end.bsdf,
                at: &end.at,
                incident: -end.towards[0],
                receiver,
                bodies: [DVec3::ZERO; 2],
                around: [&air; 2],
                by_light: by_light[last],
            };
            let asked = tracer.scene.light_sampler().probability(light, &receiver);
            tracer.share_of_method(&arrival, light, asked, &lobe)
        } else if source.is_delta() {
            0.0
        } else {
            let mut walk = Walk {
                ray: to_light,
                ray_origin: surface,
                inside: None,
                around: Around::default(),
                body: DVec3::ZERO,
                throughput: DVec3::ONE,
                polarisation: Polarisation::NONE,
                stretch: Stretch::new(Some(origin)),
                asks_methods: false,
                filter: None,
                depth: 0,
            };
            links.iter().for_each(|link| walk.stretch.push(*link));
            tracer.share_of_chance(&origin, &walk, light, &hit)
        }
    } else if let On::Straight { way, behind, .. } = &start.on {
        let distance = start.ray.origin.distance(end.position) + behind;
        let hit = LightHit { distance, radiance: DVec3::ZERO, triangle: None };
        let ray = Ray::new(end.position, end.towards[1]);
        let by_chance = if source.is_delta() { 0.0 } else { of_camera };
        let found = tracer.asked_density(subpath, *behind, normal) + by_chance;
        found / (found + tracer.straight_by_light(light, &way.walls, (&ray, &hit), origin.cosine, origin.by_light))
    } else {
        return None;
    };
    shares.push(of_end);
    Some(shares)
}

/// What is known of the shares in paths of which light subpaths have found a part.
#[derive(Debug, Default)]
struct Found {
    /// How many paths have each number of techniques that have a share.
    techniques: [u32; 8],
    /// The smallest of the largest shares.
    smallest: f64,
    /// How many paths lead straight to a light, through each pane once, and otherwise through panes.
    kinds: [u32; 3],
}

/// Checks that the shares of all techniques sum to one, path by path.
#[track_caller]
fn check(scene: &Value, panes: usize, has_light_plane: bool, allocation: Allocation) -> Found {
    let scene = prepared(scene);
    let grid = TileGrid::new(4, 4, 4).with_light_plane(has_light_plane);
    let tracer = PathTracer::with(&scene, &grid, allocation);
    let settings = SamplerSettings { seed: 3, samples_per_block: 4096 };
    let mut found = Found { smallest: 1.0, ..Found::default() };
    for sample in 0..4096 {
        let counters = &mut Counters::default();
        let stream = &mut SampleStream::new(&settings, 0, [1, 2], sample);
        let position = stream.next_2d() * 4.0;
        let ray = tracer.scene.camera().ray(position);
        for subpath in tracer.light_subpath(stream, counters) {
            let sum_to_one = |shares: &[f64]| {
                let sum: f64 = shares.iter().sum();
                assert!((sum - 1.0).abs() < 1e-6, "{sum} {shares:?} {:?} {:?}", subpath.links, subpath.start);
            };
            if tracer.is_connected {
                shares(&tracer, &ray, &subpath, true).iter().for_each(|shares| sum_to_one(shares));
            }
            let Some(shares) = shares(&tracer, &ray, &subpath, false) else { continue };
            sum_to_one(&shares);
            let count = shares.iter().filter(|share| **share > 0.0).count();
            found.techniques[count.min(7)] += 1;
            let largest = shares.iter().copied().fold(0.0, f64::max);
            found.smallest = found.smallest.min(largest);
            let kind = if subpath.links.is_empty() { 0 } else { 1 + usize::from(subpath.links.len() > 2 * panes) };
            found.kinds[kind] += 1;
        }
    }
    println!("{panes} panes: {found:?}");
    found
}

#[test]
fn shares_of_all_techniques_in_a_path_sum_to_one() {
    let sun = json!({"sun": {"name": "sun", "direction": [1, 0.3, 0.7], "angular_radius": 0.5, "radiance": [9, 9, 9]}});
    let lamp = json!({"sphere": {"name": "lamp", "centre": [4, -1, 2], "radius": 0.3, "radiance": [9, 9, 9]}});
    let sky = json!({"environment": {"name": "sky", "radiance": {"colour": [1, 1, 1]}}});
    let bulb = json!({"sphere": {"name": "bulb", "centre": [0.5, 1, 2], "radius": 0.1, "radiance": [9, 9, 9]}});
    let spark = json!({"point": {"name": "spark", "position": [1, 0.5, 1], "intensity": [1, 1, 1]}});
    let panel = json!({"rectangle": {
        "name": "panel", "centre": [0.2, 0, 2.9], "edge_u": [0, 0.6, 0], "edge_v": [0.8, 0, 0],
        "radiance": [1, 1, 1]}});
    for (panes, has_light_plane) in [(1, false), (1, true), (2, true)] {
        let scene = room(&json!([sun, lamp, sky, bulb, spark, panel]), panes);
        let found = check(&scene, panes, has_light_plane, Allocation::USUAL);
        // Paths of two to four vertices, straight from lights, by methods and by chance; no technique has all of one.
        let first = 2 + usize::from(has_light_plane);
        let techniques = &found.techniques[first..first + 3];
        assert!(techniques.iter().chain(&found.kinds).all(|count| *count > 5), "{found:?}");
        assert!(found.smallest < 0.7, "{found:?}");
    }
}

#[test]
fn shares_sum_to_one_of_light_straight_through_thin_walls() {
    let sun = json!({"sun": {"name": "sun", "direction": [1, -0.3, 0.7], "angular_radius": 3, "radiance": [9, 9, 9]}});
    let lamp = json!({"sphere": {"name": "lamp", "centre": [4, -1, 2], "radius": 0.3, "radiance": [9, 9, 9]}});
    let spark = json!({"point": {"name": "spark", "position": [4, 0.5, 1], "intensity": [1, 1, 1]}});
    let sky = json!({"environment": {"name": "sky", "radiance": {"colour": [1, 1, 1]}}});
    for lights in [json!([sun]), json!([sky]), json!([lamp, spark]), json!([sun, lamp, spark, sky])] {
        for has_light_plane in [false, true] {
            let found = check(&glazed_room(&lights), 0, has_light_plane, Allocation::USUAL);
            assert!(found.kinds[0] > 200 && found.smallest < 0.7, "{found:?}");
        }
    }
}

#[test]
fn shares_sum_to_one_where_a_search_finds_the_light() {
    let sun = json!({"sun": {"name": "sun", "direction": [1, 0.3, 0.7], "angular_radius": 0.5, "radiance": [9, 9, 9]}});
    let lamp = json!({"sphere": {"name": "lamp", "centre": [4, -1, 2], "radius": 0.01, "radiance": [9, 9, 9]}});
    let candle = json!({"point": {"name": "candle", "position": [4, -1, 2], "intensity": [1, 1, 1]}});
    let inside = json!({"point": {"name": "inside", "position": [1, 0.5, 1.2], "intensity": [1, 1, 1]}});
    let star = json!({"sphere": {"name": "star", "centre": [4, -1, 2], "radius": 2e-4, "radiance": [9e4, 9e4, 9e4]}});
    let gentle = |lights: &Value| {
        let mut scene = room(lights, 1);
        let face = |seed: usize| json!({"hammered": {"wavelength": 0.2, "amplitude": 2e-5, "seed": seed}});
        (scene["panes"][0]["front"], scene["panes"][0]["back"]) = (face(1), face(2));
        scene
    };
    let many = Allocation { splats: Splats::each(4), ..Allocation::USUAL };
    let splats = Allocation { splats: Splats::each(16), is_connected: false, ..Allocation::USUAL };
    for (lights, allocation) in [
        (json!([sun, lamp]), Allocation::USUAL),
        (json!([sun, lamp]), many),
        (json!([candle, inside]), Allocation::USUAL),
        (json!([candle, star, sun]), splats),
    ] {
        let found = check(&gentle(&lights), 1, true, allocation);
        assert!(found.kinds[1] > 100 && found.kinds[2] > 0, "{found:?}");
        assert!(found.smallest < 0.9, "{found:?}");
    }
    // Light subpaths have all that they find.
    let alone = Allocation { is_connected: true, ..Allocation::alone(4) };
    let found = check(&gentle(&json!([candle, inside])), 1, true, alone);
    assert!(found.kinds[1] > 100 && found.kinds[2] > 0 && found.smallest > 0.999, "{found:?}");
    // Many paths are the method's alone, and some are shared with chance.
    let by_chance = Allocation { sharing: Sharing::Chance, ..Allocation::USUAL };
    for lights in [json!([sun, lamp]), json!([candle, star, sun])] {
        let found = check(&gentle(&lights), 1, true, by_chance);
        let [one, shared] = [found.techniques[1], found.techniques[2..].iter().sum()];
        assert!(one > 100 && shared > 0 && found.smallest < 0.9, "{found:?}");
    }
}
