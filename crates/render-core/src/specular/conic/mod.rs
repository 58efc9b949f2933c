//! `conic`: all paths over one interface, a triangle mesh with interpolated normals, found on the curves along which the
//! shading point, the light and the normal lie in one plane (Granizo-Hidalgo and Holzschuch 2024).
//!
//! Published is a walk along one curve, from the straight line to the light to the first path. Here all triangles that may hold
//! a path are opened (`facet_tree`), and all paths on each are found (`curve`): no derivative of a path is needed, no start,
//! and no random number, so that light over one interface is without noise, and reflections are found as refractions are.

#[cfg(test)]
mod certified;
mod curve;
#[cfg(test)]
mod degenerate;
mod ends;
mod facet;
mod facet_tree;
mod neighbours;
#[cfg(test)]
mod testing;
mod walk;

use arrayvec::ArrayVec;
use glam::DVec2;

use self::{ends::Ends, walk::first_path};
use super::{
    Arrival, ShadingPoint, SpecularEvent, SpecularMethod, SpecularPath,
    caster::Caster,
    manifold::{ManifoldWalk, SolvedChain},
    scope::Scope,
};
use crate::{
    counters::Counters,
    film::SampleStream,
    geometry::{Leaving, PaneBoundary, Surface},
    optics::{Interface, Source},
    scene::{
        Scene,
        description::{ConicSearch, ManifoldConstraint},
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
            for path in self.paths_over(scene, point, sample.source, caster, events, counters) {
                if let Some(arrival) = path.arrival(scene, point, light, &sample, counters) {
                    arrive(arrival);
                }
            }
        }
    }

    fn owns(&self, scene: &Scene, point: &ShadingPoint, path: &SpecularPath<'_>, _counters: &mut Counters) -> bool {
        self.scope.holds(scene, point, path)
    }
}

impl Conic {
    /// The paths from `point` to `source` over one vertex on `caster` that the search finds.
    fn paths_over(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        source: Source,
        caster: Caster,
        events: &[SpecularEvent],
        counters: &mut Counters,
    ) -> Vec<SolvedChain> {
        let mut paths: Vec<SolvedChain> = Vec::new();
        let (Caster::Mesh(mesh), [event]) = (caster, events) else { return paths };
        let Some(seen) = caster.seen_from(scene, point) else { return paths };
        let constraint = ManifoldConstraint::AngleDifference;
        let walk = ManifoldWalk { scene, point, source, caster: seen, events, constraint };
        let mut add = |triangle: u32, weights: DVec2, counters: &mut Counters| {
            // It sees that nothing else is met before, and what the interface does.
            if let Some(path) = walk.walk_towards(scene.facet(triangle).place(weights), counters)
                && !paths.iter().any(|known| known.same(&path))
            {
                paths.push(path);
            }
        };
        for ends in ways(scene, point, source, mesh, *event) {
            match self.search {
                ConicSearch::Complete => {
                    let Some(tree) = scene.facets(mesh) else { continue };
                    tree.visit(&ends, |triangle| {
                        scene
                            .facet(triangle)
                            .paths(&ends)
                            .into_iter()
                            .for_each(|weights| add(triangle, weights, counters));
                    });
                }
                ConicSearch::Published => {
                    let Some(start) = on_straight_line(scene, point, source, mesh, counters) else { continue };
                    let facet = |triangle| scene.facet(triangle);
                    let (triangle, weights) = start;
                    let started = facet(triangle);
                    if !ends.may_see(started.normal(weights).dot(point.position - started.place(weights)), 0.0) {
                        continue;
                    }
                    if let Some((triangle, weights)) = first_path(start, facet, scene.neighbours(mesh), &ends) {
                        add(triangle, weights, counters);
                    }
                }
            }
        }
        paths
    }
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
    use glam::{DVec2, DVec3};

    use super::{
        ends::Ends,
        facet::Facet,
        facet_tree::FacetTree,
        testing::{WATER, distinct, found, problem, water},
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
    fn every_processor_opens_the_same_triangles() {
        let facets = water(40, 0.1);
        let tree = FacetTree::over(0..facets.len() as u32, |k| facets[k as usize]).unwrap();
        let mut random = random(6);
        let mut opened = 0;
        for case in 0..300 {
            let ends = problem(&mut random, case);
            let (mut widest, mut plain) = (Vec::new(), Vec::new());
            let looks = tree.visit(&ends, |triangle| widest.push(triangle));
            assert_eq!(looks, tree.visit_nodes(pulp::Scalar256b, &ends, |triangle| plain.push(triangle)));
            assert_eq!(widest, plain);
            opened += plain.len();
        }
        assert!(opened > 100, "{opened}");
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
