//! `conic`: all paths over one interface, a triangle mesh with interpolated normals, found on the curves along which the
//! shading point, the light and the normal lie in one plane (Granizo-Hidalgo and Holzschuch 2024).
//!
//! Published is a walk along one curve, from the straight line to the light to the first path. Here all triangles that may hold
//! a path are opened (`facet_tree`), and all paths on each are found (`curve`): no derivative of a path is needed, no start,
//! and no random number, so that the light of a point over one interface is without noise, and reflections are found as refractions
//! are. Where waves focus a light that has an extent, a ray is sent as well (`focus`).

#[cfg(test)]
mod certified;
mod curve;
#[cfg(test)]
mod degenerate;
mod ends;
mod facet;
mod facet_leaf;
mod facet_tree;
mod focus;
mod neighbours;
#[cfg(test)]
mod published_equations;
#[cfg(test)]
mod scale;
mod seen_ends;
#[cfg(test)]
mod testing;
mod walk;

use arrayvec::ArrayVec;
use glam::{DVec2, DVec3};

use self::{
    ends::Ends,
    focus::{Focus, STRONG},
    walk::first_path,
};
use super::{
    Arrival, ShadingPoint, SpecularEvent, SpecularMethod, SpecularPath,
    caster::Caster,
    manifold::{ManifoldWalk, SolvedChain},
    scope::Scope,
    view::light_bounds,
    window::SourceBounds,
};
use crate::{
    counters::Counters,
    film::SampleStream,
    geometry::{Frame, Leaving, PaneBoundary, Ray, Surface},
    optics::{Interface, Light, Source, SourceSample},
    scene::{
        Scene,
        description::{ConicSearch, ManifoldConstraint, WalkSteps},
        visibility::straight,
    },
};

pub(crate) use self::{facet::Facet, facet_tree::FacetTree, neighbours::Neighbours};

/// Light over one smooth mesh.
#[derive(Clone, Debug)]
pub struct Conic {
    /// Which of the paths over it are found.
    pub search: ConicSearch,
    /// Which paths are looked for; their chains have one vertex, which is on a mesh.
    pub scope: Scope,
}

impl SpecularMethod for Conic {
    fn chains(&self) -> Vec<Vec<SpecularEvent>> {
        self.scope.chains.clone()
    }

    fn gather(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        light: u32,
        events: &[SpecularEvent],
        stream: &mut SampleStream,
        counters: &mut Counters,
        arrive: &mut dyn FnMut(Arrival),
    ) {
        let Some(sample) = self.scope.light_sample(scene, point, light, stream) else { return };
        for &caster in &self.scope.casters {
            let (Caster::Mesh(mesh), [event]) = (caster, events) else { continue };
            let Some(seen) = caster.seen_from(scene, point) else { continue };
            let (constraint, steps) = (ManifoldConstraint::AngleDifference, WalkSteps::default());
            let walk = ManifoldWalk { scene, point, source: sample.source, caster: seen, events, constraint, steps };
            let connection = Connection { mesh, event: *event, light, sample: &sample, walk };
            match self.search {
                ConicSearch::Complete => connection.all(stream, counters, arrive),
                ConicSearch::Published => connection.first(counters, arrive),
            }
        }
    }

    fn owns(&self, scene: &Scene, point: &ShadingPoint, path: &SpecularPath<'_>, _counters: &mut Counters) -> bool {
        self.scope.holds(scene, point, path)
    }
}

/// A shading point, a mesh and a point of a light.
struct Connection<'a> {
    mesh: u32,
    event: SpecularEvent,
    light: u32,
    sample: &'a SourceSample,
    walk: ManifoldWalk<'a>,
}

impl Connection<'_> {
    /// The light over all places of the mesh.
    fn all(&self, stream: &mut SampleStream, counters: &mut Counters, arrive: &mut dyn FnMut(Arrival)) {
        let ManifoldWalk { scene, point, source, .. } = self.walk;
        let Some(tree) = scene.facets(self.mesh) else { return };
        let ways = |source| ways(scene, point, source, self.mesh, self.event);
        let whole = (point.bounces == 0).then(|| whole(&scene.lights()[self.light as usize], point.position)).flatten();
        let mut wholes =
            whole.iter().flat_map(|(source, spread)| ways(*source).into_iter().map(|ends| ends.spread(*spread)));
        let mut paths: Vec<SolvedChain> = Vec::new();
        let mut focus = Focus::default();
        for ends in &ways(source) {
            let mut solve = |triangle, facet: Facet| {
                for weights in facet.paths(ends) {
                    if let Some(path) = self.walk.path_over(triangle, facet.place(weights), weights, counters)
                        && !paths.iter().any(|known| known.same(&path))
                    {
                        paths.push(path);
                    }
                }
            };
            match wholes.next() {
                Some(whole) => tree.visit_whole(&whole, ends, STRONG, |triangle, may| {
                    let facet = scene.facet_of(self.mesh, triangle);
                    if may.focus {
                        focus.consider(triangle, &facet, &whole);
                    }
                    if may.hold {
                        solve(triangle, facet);
                    }
                }),
                None => tree.visit(ends, |triangle| solve(triangle, scene.facet_of(self.mesh, triangle))),
            };
        }
        for path in &paths {
            self.weighted(path, self.sample, &focus, counters, arrive);
        }
        if whole.is_some() {
            let (choice, place) = (stream.next_1d(), stream.next_2d());
            if let Some((triangle, weights)) = focus.draw(choice, place) {
                self.ray(triangle, scene.facet(triangle).place(weights), &focus, counters, arrive);
            }
        }
    }

    /// The light that a ray through a place of a triangle meets.
    fn ray(
        &self,
        triangle: u32,
        place: DVec3,
        focus: &Focus,
        counters: &mut Counters,
        arrive: &mut dyn FnMut(Arrival),
    ) {
        let ManifoldWalk { scene, .. } = self.walk;
        let light = &scene.lights()[self.light as usize];
        let Some(chain) = self.walk.trace(place, counters) else { return };
        let last = &chain.vertices[chain.vertices.len() - 1];
        if last.surface != Leaving::Triangle(triangle) {
            return;
        }
        let ray = Ray::new(last.at.position, chain.exit);
        let Some(hit) = light.intersect(&ray) else { return };
        let (centre, radius) = scene.specular_ball();
        let sample = light.sample_met(centre, radius, &ray, &hit);
        let walk = ManifoldWalk { source: sample.source, ..self.walk };
        if let Some(path) = walk.solved(chain) {
            self.weighted(&path, &sample, focus, counters, arrive);
        }
    }

    /// The light along a path that both the search and a ray may find, by the balance heuristic (Veach and Guibas 1995).
    fn weighted(
        &self,
        path: &SolvedChain,
        sample: &SourceSample,
        focus: &Focus,
        counters: &mut Counters,
        arrive: &mut dyn FnMut(Arrival),
    ) {
        let ManifoldWalk { scene, point, .. } = self.walk;
        let Some(arrival) = path.arrival(scene, point, self.light, sample, counters) else { return };
        let Leaving::Triangle(triangle) = path.first_surface() else { return };
        let drawn = focus.share(triangle);
        let share = if drawn > 0.0 {
            let by_ray = drawn * focus::density(&scene.facet(triangle), point.position, path.first_vertex());
            let (centre, radius) = scene.specular_ball();
            let of_light = scene.lights()[self.light as usize].source_density(centre, radius, sample.source);
            of_light / (of_light + by_ray * path.magnification(sample))
        } else {
            1.0
        };
        arrive(Arrival { weight: arrival.weight * share, ..arrival });
    }

    /// The light along the first path on the curve from the straight line to the light.
    fn first(&self, counters: &mut Counters, arrive: &mut dyn FnMut(Arrival)) {
        let ManifoldWalk { scene, point, source, .. } = self.walk;
        let Some(start) = on_straight_line(scene, point, source, self.mesh, counters) else { return };
        let facet = |triangle| scene.facet(triangle);
        let (triangle, weights) = start;
        let started = facet(triangle);
        let mut paths: Vec<SolvedChain> = Vec::new();
        for ends in ways(scene, point, source, self.mesh, self.event) {
            if !ends.may_see(started.normal(weights).dot(point.position - started.place(weights)), 0.0) {
                continue;
            }
            if let Some((triangle, weights)) = first_path(start, facet, scene.neighbours(self.mesh), &ends)
                && let Some(path) = self.walk.path_over(triangle, facet(triangle).place(weights), weights, counters)
                && !paths.iter().any(|known| known.same(&path))
            {
                paths.push(path);
            }
        }
        for path in paths {
            if let Some(arrival) = path.arrival(scene, point, self.light, self.sample, counters) {
                arrive(arrival);
            }
        }
    }
}

/// Lights that look larger than this from the shading point, radians about, get no rays: what they would be sent to is most of the mesh, and
/// the folds of their caustics are blurred.
const LARGE: f64 = 0.2;

/// The middle of a light and how far its points are from there, metres or the chord between unit directions; `None` for points and large
/// lights.
fn whole(light: &Light, point: DVec3) -> Option<(Source, f64)> {
    let (source, spread, size) = match light_bounds(light, &Frame::WORLD) {
        SourceBounds::Ball { centre, radius } => (Source::Point(centre), radius, radius / (centre - point).length()),
        SourceBounds::Cap { direction, sin_radius } => {
            let cosine = (1.0 - sin_radius * sin_radius).max(0.0).sqrt();
            let chord = sin_radius * (2.0 / (1.0 + cosine)).sqrt();
            (Source::Direction(direction), chord, chord)
        }
    };
    (spread > 0.0 && size < LARGE).then_some((source, spread))
}

/// The ends of paths over a mesh, for each side of it on which the shading point can be.
fn ways(scene: &Scene, point: &ShadingPoint, source: Source, mesh: u32, event: SpecularEvent) -> ArrayVec<Ends, 2> {
    let first = scene.meshes()[mesh as usize].triangle_range().start;
    match (event, scene.interface(first)) {
        (SpecularEvent::Transmission, Some(&Interface::Dielectric { index_of_refraction })) => [true, false]
            .into_iter()
            .map(|outside| Ends::refracted(point.position, source, index_of_refraction, outside))
            .collect(),
        (SpecularEvent::Reflection, Some(_)) => [Ends::mirrored(point.position, source)].into_iter().collect(),
        _ => ArrayVec::new(),
    }
}

/// Surfaces on the straight line to a light that are passed over in search of a mesh. Without an end, a line through an edge would
/// meet its two triangles in turn for ever.
const MOST_PASSED: usize = 32;

/// Where the straight line from `point` to `source` first meets a mesh, whatever else it meets: triangle and weights of its
/// second and third corner.
fn on_straight_line(
    scene: &Scene,
    point: &ShadingPoint,
    source: Source,
    mesh: u32,
    counters: &mut Counters,
) -> Option<(u32, DVec2)> {
    let (mut ray, mut distance) = straight(point.position, source);
    let mut leaving = point.leaving;
    for _ in 0..MOST_PASSED {
        let hit = scene.accelerator().closest_hit(&ray, distance, leaving, counters)?;
        if let Surface::Triangle { index, barycentric } = hit.surface
            && scene.mesh_of(index) == mesh
        {
            return Some((index, barycentric.into()));
        }
        leaving = match hit.surface {
            Surface::Triangle { index, .. } => Leaving::Triangle(index),
            Surface::Pane { index, hit } => match hit.boundary {
                PaneBoundary::Face(face) => Leaving::Pane { index, face },
                PaneBoundary::Edge => return None,
            },
        };
        (ray, distance) = straight(ray.at(hit.distance), source);
    }
    None
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec2, DVec3};

    use super::{
        ends::Ends,
        facet::Facet,
        facet_tree::FacetTree,
        focus::STRONG,
        testing::{WATER, ball, distinct, found, problem, water},
    };
    use crate::{
        optics::{
            Source,
            dielectric::{reflect, refract},
        },
        specular::testing::{between, random},
    };

    /// Newton's method from many places of each triangle.
    fn sought_everywhere(facets: &[Facet], ends: &Ends) -> Vec<DVec3> {
        const SEEDS: u32 = 5;
        let mut places = Vec::new();
        for facet in facets {
            for i in 0..SEEDS {
                for j in 0..SEEDS - i {
                    let seed = (DVec2::new(f64::from(i), f64::from(j)) + 0.3) / f64::from(SEEDS);
                    if let Some(weights) = facet.polished(ends, seed) {
                        distinct(&mut places, facet.place(weights));
                    }
                }
            }
        }
        places
    }

    #[test]
    fn all_paths_over_water_are_found() {
        let mut paths = 0;
        for (cells, amplitude) in [(4, 0.05), (16, 0.05), (16, 0.15), (40, 0.1)] {
            let facets = water(cells, amplitude);
            let tree = FacetTree::over(0..facets.len() as u32, |k| facets[k as usize]).unwrap();
            let mut random = random(5);
            let (mut opened, mut several) = (0, 0);
            let problems = 200;
            for case in 0..problems {
                let ends = problem(&mut random, case);
                let ours = found(&facets, &tree, &ends);
                let theirs = sought_everywhere(&facets, &ends);
                tree.visit(&ends, |_| opened += 1);
                for place in &theirs {
                    assert!(
                        ours.iter().any(|known| (*known - *place).length() < 1e-7),
                        "{cells} {case}: {place} of {theirs:?} is not in {ours:?}"
                    );
                }
                paths += ours.len();
                several += usize::from(ours.len() > theirs.len());
            }
            println!(
                "{cells} {amplitude}: {opened} triangles opened for {problems} problems, {paths} paths, {several} with more than seeds find"
            );
        }
        assert!(paths > 0);
    }

    #[test]
    fn paths_are_found_however_the_surface_lies() {
        let askew = DVec3::new(1.0, 2.0, 3.0).normalize();
        let (first, second) = askew.any_orthonormal_pair();
        let turns = [
            DMat3::IDENTITY,
            DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X),
            DMat3::from_cols(DVec3::Z, DVec3::X, DVec3::Y),
            DMat3::from_cols(first, second, askew),
        ];
        for (name, facets) in [("water", water(16, 0.15)), ("ball", ball(12, 0.4))] {
            for (number, turn) in turns.into_iter().enumerate() {
                let turned = |vectors: [DVec3; 3]| vectors.map(|vector| turn * vector);
                let facets: Vec<Facet> = facets
                    .iter()
                    .map(|facet| Facet { corners: turned(facet.corners), normals: turned(facet.normals) })
                    .collect();
                let tree = FacetTree::over(0..facets.len() as u32, |k| facets[k as usize]).unwrap();
                let mut random = random(11);
                let (mut paths, mut opened) = (0, 0);
                for case in 0..200 {
                    let ends = problem(&mut random, case);
                    let ends = Ends { point: turn * ends.point, light: turn * ends.light, ..ends };
                    let mut all = Vec::new();
                    for facet in &facets {
                        facet.paths(&ends).into_iter().for_each(|path| distinct(&mut all, facet.place(path)));
                    }
                    let ours = found(&facets, &tree, &ends);
                    assert!(
                        ours.len() == all.len()
                            && all.iter().all(|place| ours.iter().any(|known| (*known - *place).length() < 1e-7)),
                        "{name}, turn {number}, {case}: {ours:?} are not {all:?}"
                    );
                    paths += all.len();
                    tree.visit(&ends, |_| opened += 1);
                }
                println!("{name}, turn {number}: {paths} paths, {opened} triangles opened");
                assert!(paths > 100 && opened < 20 * paths, "{name}, turn {number}: {paths} {opened}");
            }
        }
    }

    #[test]
    fn every_processor_opens_the_same_triangles() {
        let facets = water(40, 0.1);
        let tree = FacetTree::over(0..facets.len() as u32, |k| facets[k as usize]).unwrap();
        let mut random = random(6);
        let mut opened = 0;
        for case in 0..300 {
            let ends = problem(&mut random, case);
            let (mut widest, mut plain) = (Vec::new(), Vec::new());
            let looks = tree.visit(&ends, |triangle| widest.push(triangle));
            let looks_plain = tree.visit_with(pulp::Scalar256b, &ends, None, |triangle, _| plain.push(triangle));
            assert_eq!(looks, looks_plain);
            assert_eq!(widest, plain);
            opened += plain.len();
        }
        assert!(opened > 100, "{opened}");
    }

    #[test]
    fn a_whole_light_opens_what_each_of_its_points_does() {
        let facets = water(16, 0.15);
        let tree = FacetTree::over(0..facets.len() as u32, |k| facets[k as usize]).unwrap();
        let mut random = random(8);
        let (mut all, mut may_hold, mut with_paths, mut may_focus, mut focus) = (0, 0, 0, 0, 0);
        for case in 0..300 {
            let ends = problem(&mut random, case);
            let mut aside = || {
                DVec3::new(
                    between(&mut random, -1.0, 1.0),
                    between(&mut random, -1.0, 1.0),
                    between(&mut random, -1.0, 1.0),
                )
            };
            let (towards, part) = (aside().normalize(), aside().x.abs());
            // A lamp of up to 0.4 m, within a metre or so, or the sun with a radius of 60 degrees.
            let (whole, light) = if ends.near > 0.0 {
                (ends.spread(0.4), ends.light + towards * (0.4 * part))
            } else {
                let across = ends.light.cross(towards).normalize();
                let angle = part * std::f64::consts::FRAC_PI_3;
                let turned = ends.light * libm::cos(angle) + across * libm::sin(angle);
                (ends.spread(2.0 * libm::sin(std::f64::consts::FRAC_PI_6)), turned)
            };
            let drawn = Ends { light, ..ends };
            let (mut opened, mut holding, mut focusing) = (Vec::new(), Vec::new(), Vec::new());
            tree.visit(&whole, |triangle| opened.push(triangle));
            tree.visit_whole(&whole, &drawn, STRONG, |triangle, may| {
                assert!(may.hold || may.focus);
                holding.extend(may.hold.then_some(triangle));
                focusing.extend(may.focus.then_some(triangle));
            });
            for (triangle, facet) in (0u32..).zip(&facets) {
                if !facet.paths(&drawn).is_empty() {
                    with_paths += 1;
                    assert!(opened.contains(&triangle) && holding.contains(&triangle), "{case}: {triangle}");
                }
            }
            for triangle in &opened {
                if facets[*triangle as usize].focus(&whole) > STRONG {
                    focus += 1;
                    assert!(focusing.contains(triangle), "{case}: {triangle}");
                }
            }
            all += opened.len();
            may_hold += holding.len();
            may_focus += focusing.len();
        }
        println!(
            "{all} triangles for whole lights, {may_hold} for points, {with_paths} with paths; {may_focus} may focus, {focus} do"
        );
        assert!(2 * may_hold < all && with_paths > 300);
        assert!(may_focus < 2 * focus && focus > 300);
    }

    #[test]
    fn finer_meshes_of_the_same_water_cost_hardly_more() {
        let problems = 500;
        let mut costs = Vec::new();
        for cells in [22, 71, 224] {
            let facets = water(cells, 0.05);
            let tree = FacetTree::over(0..facets.len() as u32, |k| facets[k as usize]).unwrap();
            let mut random = random(5);
            let (mut looks, mut opened, mut paths) = (0, 0, 0);
            for _ in 0..problems {
                let below = DVec3::new(between(&mut random, -0.8, 0.8), between(&mut random, -0.8, 0.8), -1.0);
                let ends = Ends::refracted(below, Source::Point(DVec3::new(1.0, -0.8, 12.0)), WATER, false);
                looks += tree.visit(&ends, |triangle| {
                    opened += 1;
                    paths += facets[triangle as usize].paths(&ends).len();
                });
            }
            println!("{} triangles: {looks} nodes, {opened} triangles, {paths} paths", facets.len());
            assert!(paths >= problems && opened < 4 * paths);
            costs.push(looks);
        }
        assert!(costs[2] * 2 < costs[0] * 3, "{costs:?}");
    }

    #[test]
    fn paths_through_corners_and_edges_of_waves_are_found() {
        let facets = water(12, 0.05);
        let tree = FacetTree::over(0..facets.len() as u32, |k| facets[k as usize]).unwrap();
        let mut random = random(6);
        for case in 0..1000 {
            let facet = facets[case * 7919 % facets.len()];
            // Even cases through a corner, odd ones through an edge.
            let along = if case % 2 == 0 { 0.0 } else { between(&mut random, 0.1, 0.9) };
            let at = if case % 3 == 0 { DVec2::new(1.0 - along, along) } else { DVec2::new(along, 0.0) };
            let (place, normal) = (facet.place(at), facet.normal(at).normalize());
            let point = place + DVec3::new(between(&mut random, -0.5, 0.5), between(&mut random, -0.5, 0.5), -1.0);
            let direction = (place - point).normalize();
            let Some(refraction) = refract(direction, normal, WATER, 1.0) else { continue };
            let light = place + refraction.direction * between(&mut random, 0.5, 3.0);
            let below = place + reflect(direction, normal) * between(&mut random, 0.5, 3.0);
            for ends in [
                Ends::refracted(point, Source::Point(light), WATER, false),
                Ends::refracted(light, Source::Point(point), WATER, true),
                Ends::mirrored(point, Source::Point(below)),
            ] {
                let places = found(&facets, &tree, &ends);
                assert!(places.iter().any(|known| (*known - place).length() < 1e-8), "{case}: {place} in {places:?}");
            }
        }
    }

    #[test]
    fn paths_on_edges_and_corners_are_found() {
        // Flat, with corners at thirds: light straight above an edge, a corner, and along an edge or a diagonal.
        let third = 1.0 / 3.0;
        let flat = water(3, 0.0);
        let tree = FacetTree::over(0..flat.len() as u32, |k| flat[k as usize]).unwrap();
        for [px, py, lx, ly] in [
            [0.5, -0.4, 0.2, 0.1],
            [third, 0.1, third, 0.1],
            [third, third, third, third],
            [third, -0.2, third, 0.3],
            [-0.2, -0.2, 0.1, 0.1],
            [third, -0.9, third, 0.9],
            [0.0, third, 0.7, third],
        ] {
            let (point, light) = (DVec3::new(px, py, -1.0), DVec3::new(lx, ly, 0.8));
            let mirrored = Ends::mirrored(point, Source::Point(light - DVec3::Z * 1.6));
            for ends in [Ends::refracted(point, Source::Point(light), WATER, false), mirrored] {
                assert_eq!(found(&flat, &tree, &ends).len(), 1, "{point} {light}");
            }
        }
    }
}
