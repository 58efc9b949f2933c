//! The known paths between a shading point and a point of a light through all panes of a scene. The complete search of
//! `fnee` lists them, with an estimate of what it may have missed. Searches from uniform seeds show how often each is
//! found.

use clerestory_film::counters::Counters;
use clerestory_render_core::light::SourceSample;
use clerestory_render_core::scene::Scene;
use clerestory_render_core::scene::ShadingPoint;
use clerestory_render_core::specular::SpecularMethod;
use clerestory_render_core::specular::constraint::ManifoldConstraint;
use clerestory_render_core::specular::fnee::FneeSolver;
use clerestory_render_core::specular::fnee::PathSearch;
use clerestory_render_core::specular::manifold::WalkSteps;
use clerestory_render_core::specular::newton::Root;
use clerestory_render_core::specular::side::PaneSide;
use clerestory_render_core::specular::sms::ManifoldSearch;
use glam::{DVec2, DVec3};

use crate::found_paths::{FoundPath, search_through};
use crate::random::Random;

/// Searches for a path that one search found, at the most.
const MOST_TRIALS: u32 = 10_000_000;

/// Two searches that end as near to each other found the same path, relative to the shortest of its three parts.
const SAME_PATH: f64 = 1e-6;

/// A search from uniform seeds, as the method under test makes them.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Search {
    /// A manifold walk.
    Walk { constraint: ManifoldConstraint, steps: WalkSteps },
    /// A line search on the optical length.
    LineSearch,
}

/// Runs a search from a uniform seed and tells where the path that it finds enters the pane, in the pane's frame.
type RunSearch<'a> = Box<dyn FnMut(&mut Random, &mut Counters) -> Option<DVec3> + 'a>;

/// What the complete search knows of a connection.
pub(crate) struct Known<'a> {
    panes: Vec<ThroughPane<'a>>,
    listed: Vec<Listed>,
    /// Whether no path is missing.
    pub(crate) complete: bool,
    /// The light of all listed paths, irradiance of the red channel over the density of their point on the light.
    pub(crate) whole: f64,
}

impl<'a> Known<'a> {
    /// `None` when no listed path has light.
    pub(crate) fn of(panes: Vec<ThroughPane<'a>>, counters: &mut Counters) -> Option<Self> {
        let (mut listed, mut complete): (Vec<Listed>, bool) = (Vec::new(), true);
        for (index, pane) in panes.iter().enumerate() {
            let found = pane.search.enumerate(counters);
            complete &= found.complete;
            let path = |root| Listed { pane: index, root, light: pane.light_of(&root, counters) };
            listed.extend(found.roots.into_iter().map(path));
        }
        let whole: f64 = listed.iter().map(|path| path.light).sum();
        (whole > 0.0).then_some(Self { panes, listed, complete, whole })
    }

    /// The paths that have light.
    pub(crate) fn lit(&self) -> impl Iterator<Item = &Listed> {
        self.listed.iter().filter(|path| path.light > 0.0)
    }

    /// The share of all listed light that some paths have.
    pub(crate) fn share<'p>(&self, paths: impl IntoIterator<Item = &'p Listed>) -> f64 {
        paths.into_iter().map(|path| path.light).sum::<f64>() / self.whole
    }

    /// The share that saddles of the optical length among some paths have.
    pub(crate) fn in_saddles<'p>(&self, paths: impl IntoIterator<Item = &'p Listed>) -> f64 {
        self.share(paths.into_iter().filter(|path| path.root.determinant < 0.0))
    }

    /// The paths with light that `searches` searches through each pane find less than `times` times.
    pub(crate) fn unfound(&self, search: Search, searches: u32, times: u32, random: &mut Random) -> Vec<&Listed> {
        let of_pane = |(index, pane): (usize, &ThroughPane<'_>)| {
            pane.unfound(self.lit().filter(|path| path.pane == index), search, searches, times, random)
        };
        self.panes.iter().enumerate().flat_map(of_pane).collect()
    }

    /// Whether a listed path brings light from a direction.
    pub(crate) fn brings_light(&self, direction: DVec3) -> bool {
        self.lit().any(|Listed { pane, root, .. }| {
            let frame = &self.panes[*pane].search.side().pane.frame;
            let first = frame.vector_to_world(root.path.directions[0]) * root.path.lengths[0];
            first.dot(direction) > 0.0 && first.cross(direction).length() <= SAME_PATH * shortest_part(root)
        })
    }

    /// An estimate without bias of the light of the paths that are not listed, over that of those that are.
    pub(crate) fn others(&self, random: &mut Random, counters: &mut Counters) -> f64 {
        let of_pane = |(index, pane): (usize, &ThroughPane<'_>)| {
            let listed = self.listed.iter().filter(|path| path.pane == index);
            pane.others(listed.map(|path| &path.root), random, counters)
        };
        self.panes.iter().enumerate().map(of_pane).sum::<f64>() / self.whole
    }
}

/// A path that the complete search lists.
pub(crate) struct Listed {
    /// Index of the pane's search.
    pane: usize,
    root: Root,
    /// Irradiance of the red channel; zero when it is no path of light.
    light: f64,
}

/// The complete search from a point to a point of a light through one pane.
pub(crate) struct ThroughPane<'a> {
    scene: &'a Scene,
    method: &'a dyn SpecularMethod,
    point: &'a ShadingPoint,
    light: u32,
    sample: &'a SourceSample,
    pane: u32,
    search: PathSearch<'a>,
}

impl<'a> ThroughPane<'a> {
    /// `None` when no path leads through the pane.
    pub(crate) fn new(
        scene: &'a Scene,
        method: &'a dyn SpecularMethod,
        point: &'a ShadingPoint,
        light: u32,
        sample: &'a SourceSample,
        pane: u32,
    ) -> Option<Self> {
        let search = search_through(scene, point, sample.source, pane, FneeSolver::Complete)?;
        Some(Self { scene, method, point, light, sample, pane, search })
    }

    /// The given paths that `searches` searches find less than `times` times.
    fn unfound<'p>(
        &self,
        paths: impl Iterator<Item = &'p Listed>,
        search: Search,
        searches: u32,
        times: u32,
        random: &mut Random,
    ) -> Vec<&'p Listed> {
        let counters = &mut Counters::default();
        let mut missing: Vec<(&Listed, u32)> = paths.map(|path| (path, times)).collect();
        let mut find = self.run(search);
        for _ in 0..searches {
            if missing.is_empty() {
                break;
            }
            let Some(entry) = find(random, counters) else { continue };
            missing.retain_mut(|(Listed { root, .. }, times)| {
                *times -= u32::from(entry.distance(root.path.vertices[0]) <= SAME_PATH * shortest_part(root));
                *times > 0
            });
        }
        missing.into_iter().map(|(path, _)| path).collect()
    }

    /// A search of the kind that is named.
    fn run(&self, search: Search) -> RunSearch<'_> {
        let Self { scene, point, sample, .. } = *self;
        let PaneSide { near, pane, .. } = *self.search.side();
        match search {
            Search::Walk { constraint, steps } => {
                let search = ManifoldSearch::new(scene, point, sample.source, self.pane, constraint, steps);
                Box::new(move |random, counters| {
                    let place = (DVec2::new(random.uniform(), random.uniform()) - 0.5) * pane.size();
                    let height = pane.base_height(near) + pane.surface(near).height(place);
                    let target = pane.frame.point_to_world(place.extend(height));
                    let entry = search.as_ref()?.walk_towards(target, counters)?;
                    Some(pane.frame.point_to_local(entry))
                })
            }
            Search::LineSearch => {
                let search = search_through(scene, point, sample.source, self.pane, FneeSolver::Published);
                Box::new(move |random, counters| {
                    let seed = || DVec2::new(random.uniform(), random.uniform());
                    search.as_ref()?.solve(seed, counters).map(|root| root.path.vertices[0])
                })
            }
        }
    }

    /// An estimate without bias of the light of the paths that are not listed.
    fn others<'r>(&self, listed: impl Iterator<Item = &'r Root>, random: &mut Random, counters: &mut Counters) -> f64 {
        let mut solve =
            |counters: &mut Counters| self.search.solve(|| DVec2::new(random.uniform(), random.uniform()), counters);
        let Some(root) = solve(counters) else { return 0.0 };
        let is_listed = { listed }.any(|known| self.search.same(known, &root));
        let light = if is_listed { 0.0 } else { self.light_of(&root, counters) };
        if light <= 0.0 {
            return 0.0;
        }
        let mut again = || solve(counters).is_some_and(|other| self.search.same(&root, &other));
        let trials = (1..=MOST_TRIALS).find(|_| again());
        light * f64::from(trials.expect("a path that was found once is found again"))
    }

    /// Irradiance of the red channel by a path, over the density of its point on the light. Zero when it is no path of
    /// light, is blocked, or is not owned by the method.
    fn light_of(&self, root: &Root, counters: &mut Counters) -> f64 {
        let Self { scene, point, light, sample, pane, .. } = *self;
        let found = FoundPath::of_root(scene, point, [light, pane], sample, &self.search, root, counters);
        let owned = found.filter(|(path, _)| self.method.owns(scene, point, &path.described(), counters));
        owned.map_or(0.0, |(_, irradiance)| irradiance)
    }
}

/// The shortest of a path's three parts, metres.
fn shortest_part(root: &Root) -> f64 {
    root.path.lengths.into_iter().fold(f64::INFINITY, f64::min)
}
