//! `fnee`: Fermat next event estimation (Huan et al. 2023).
//!
//! A point S is drawn on the light. A seed starts Newton's method on the optical length of the path O, X1, X2, S. If it
//! converges, the path carries light with two weights. One is the generalised geometry factor, the other the inverse of
//! the probability that a seed leads to this path. The number of independent seeds until the same path is found again
//! estimates that inverse without bias (Booth 2007; Zeltner et al. 2020, section 4.3).
//!
//! [`FneeSolver::Published`] follows the paper: uniform seeds over both faces, backtracking on the optical length.
//! [`FneeSolver::Complete`] finds minima, saddles and maxima alike. It first enumerates the paths in the deflection
//! window ([`super::enumeration`]): what that finds is a function of the problem, so it counts with weight one. One
//! random seed follows, whose path is weighted by trials if the enumeration missed it. This keeps the estimate
//! unbiased. It always follows near a fold of the caustic, where the enumeration cannot tell whether it is complete.
//! Elsewhere it follows one time in sixteen.
//!
//! Under a light with an extent, the geometry factor of a point has no finite mean square where the caustic of that
//! point folds. There, rays towards the light (`light_view`) find paths better. The balance heuristic combines both
//! ways. The density of the search is that of S over the geometry factor. The search is unbiased for each path by
//! itself, so any weights that sum to one keep the whole unbiased.
//!
//! Light that the outside of a pane reflects is found in the same way, in two unknowns, when `reflected` is set
//! (`reflection`).
//!
//! An estimate that exceeds `max_trials` is cut off there, which loses light; the counter `truncated` says how often.

mod density;
mod reflection;
mod settings;
mod solver;

pub use settings::FneeSettings;
pub use solver::FneeSolver;

use crate::specular::selection::PaneSelection;
use glam::{DVec2, DVec3};
use smallvec::{SmallVec, smallvec};

use self::reflection::Reflections;
use super::assumed_density::assumed_density;
use super::caster::Caster;
use super::effort::Effort;
use super::enumeration::{Enumeration, enumerate};
use super::fermat::Connection;
use super::light_view::{LightSample, LightView};
use super::newton::{Root, SearchRegion, solve_complete, solve_published};
use super::passage::{Found, Passage, transmission};
use super::selection::Choice;
use super::side::{PaneSide, Transmission};
use super::trials::RandomSearch;
use super::window::{SourceBounds, Window};
use super::{Arrival, Link, SampledPath, SpecularEvent, SpecularMethod, SpecularPath, THROUGH_PANE, coverage};
use crate::geometry::SurfaceId;
use crate::light::{Source, SourceSample};
use crate::scene::Scene;
use crate::scene::ShadingPoint;
use crate::scene::pane_tree::{LightRegion, Panes};
use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, TrialStream};

/// Fermat next event estimation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fnee {
    /// How stationary paths are searched for.
    pub solver: FneeSolver,
    /// Which panes are searched.
    pub selection: PaneSelection,
    /// Largest number of trials of one estimate of an inverse probability.
    pub max_trials: u32,
    /// Whether it looks for the light that panes reflect, too.
    pub reflected: bool,
}

/// The search for paths from one point to one source through one pane, in the pane's frame.
#[derive(Clone, Copy, Debug)]
pub struct PathSearch<'a> {
    connection: Connection<'a>,
    window: Window<'a>,
    region: SearchRegion,
    solver: FneeSolver,
}

/// Mirrored by the outside of a pane.
const REFLECTED: [SpecularEvent; 1] = [SpecularEvent::Reflection];

/// How often a random seed is tried although the enumeration says that it is complete.
const CHECKED: f64 = 1.0 / 16.0;

impl<'a> PathSearch<'a> {
    /// Prepares the search; `None` when no path can exist.
    pub fn new(side: PaneSide<'a>, origin: DVec3, source: Source, solver: FneeSolver) -> Option<Self> {
        let bounds = match source {
            Source::Point(centre) => SourceBounds::Ball { centre, radius: 0.0 },
            Source::Direction(direction) => SourceBounds::Cap { direction, sin_radius: 0.0 },
        };
        let window = Window::new(&side, origin, &bounds)?;
        let region = SearchRegion::around(&window.entry(), side.pane.thickness);
        Some(Self { connection: Connection::new(&side, origin, source), window, region, solver })
    }

    /// The pane from the side of the shading point.
    pub fn side(&self) -> &PaneSide<'a> {
        self.window.side()
    }

    /// Runs the solver from one seed. `random` gives numbers in [0, 1): two for the complete solver, four for the
    /// published one.
    pub fn solve(&self, mut random: impl FnMut() -> DVec2, counters: &mut Counters) -> Option<Root> {
        match self.solver {
            FneeSolver::Complete => {
                let place = self.window.outline().shape(self.window.rect())?.sample(random());
                let seed = self.connection.thin_seed(place, counters)?;
                solve_complete(&self.connection, seed, &self.region, counters)
            }
            FneeSolver::Published => {
                let outline = &self.side().pane.outline;
                let seed = [outline.sample(random()), outline.sample(random())];
                solve_published(&self.connection, seed, &self.region, counters)
            }
        }
    }

    /// The paths that are found without chance, so that their probability is one. None with the published solver.
    pub fn enumerate(&self, counters: &mut Counters) -> Enumeration {
        match self.solver {
            FneeSolver::Complete => enumerate(&self.window, &self.connection, &self.region, counters),
            FneeSolver::Published => Enumeration { roots: SmallVec::new(), complete: false },
        }
    }

    /// Whether two roots are the same path.
    pub fn same(&self, first: &Root, second: &Root) -> bool {
        self.region.same(first, second)
    }

    /// What the pane lets through along a root; `None` when the root is no path of light that the method owns: outside
    /// the outline, not crossing both faces, or blocked by the pane's own relief.
    pub fn transmission(&self, root: &Root, counters: &mut Counters) -> Option<Transmission> {
        transmission(self.side(), self.connection.origin, root, counters)
    }
}

impl RandomSearch for PathSearch<'_> {
    type Path = Root;

    fn solve(&self, random: &mut TrialStream, counters: &mut Counters) -> Option<Root> {
        Self::solve(self, || DVec2::new(random.next_f64(), random.next_f64()), counters)
    }

    fn same(&self, first: &Root, second: &Root) -> bool {
        Self::same(self, first, second)
    }
}

impl SpecularMethod for Fnee {
    fn chains(&self) -> Vec<Vec<SpecularEvent>> {
        let reflected = self.reflected.then(|| REFLECTED.to_vec());
        [THROUGH_PANE.to_vec()].into_iter().chain(reflected).collect()
    }

    fn sample_li(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        light: u32,
        events: &[SpecularEvent],
        stream: &mut SampleStream,
        counters: &mut Counters,
        arrive: &mut dyn FnMut(Arrival),
    ) {
        let panes = scene.accelerator().panes();
        let (centre, radius) = scene.specular_ball();
        let source = &scene.lights()[light as usize];
        let sample = source.sample_source(centre, radius, source.random(stream));
        if events == REFLECTED {
            let mirrors = scene.pane_tree().mirrors(point.position, &LightRegion::of_source(sample.source));
            for pane in mirrors {
                let mut trials = stream.trials();
                let search = Reflections {
                    scene,
                    point,
                    light,
                    sample: &sample,
                    solver: self.solver,
                    max_trials: self.max_trials,
                };
                search.sample_li(pane, &mut trials, counters, &mut |arrival| {
                    arrive(Arrival { path: arrival.path.filter(|_| self.combines()), ..arrival });
                });
            }
            return;
        }
        let random = stream.next_2d();
        let is_met = !source.is_delta();
        let effort = self.effort(point);
        let view = (is_met && self.combines()).then(|| LightView::new(scene, point, light, &effort, None, counters));
        if let Some(view) = &view {
            view.cast(random, counters, &mut |LightSample { arrival, density, through, exit, hit }, aperture| {
                let vertices = [through.entry, through.exit];
                let found =
                    density::through_pane(scene, light, &aperture.side, aperture.origin, vertices, (&exit, &hit));
                let path = arrival.path.map(|path| SampledPath { density: path.density + found, ..path });
                arrive(Arrival { weight: arrival.weight * (density / (density + found)), path, ..arrival });
            });
        }
        let choice = self.selection.choose(scene, point, &sample, panes.len(), stream, counters);
        let (chosen, inverse_selection): (Panes, f64) = match choice {
            Choice::All => match &view {
                // A pane that shows a point of the light shows the light.
                Some(view) => (view.panes().collect(), 1.0),
                None => (scene.pane_tree().candidates(point.position, &LightRegion::of_source(sample.source)), 1.0),
            },
            Choice::One(Caster::Pane(pane)) => (smallvec![pane], 1.0),
            Choice::AtRandom(index) => (smallvec![index as u32], panes.len() as f64),
            Choice::One(Caster::Mesh(_)) | Choice::None => return,
        };
        for index in chosen {
            let random = stream.next_2d();
            let mut trials = stream.trials();
            let sampled = SampledLight { index: light, sample: &sample, view: view.as_ref() };
            self.connect(scene, point, &sampled, index, random, &mut trials, counters, &mut |arrival| {
                let path = arrival.path.filter(|_| self.combines());
                arrive(Arrival { weight: arrival.weight * inverse_selection, path, ..arrival });
            });
        }
    }

    fn owns(&self, scene: &Scene, point: &ShadingPoint, path: &SpecularPath<'_>, counters: &mut Counters) -> bool {
        if self.reflected && coverage::off_one_pane(scene, point, path) {
            return true;
        }
        let Some(pane) = coverage::through_one_pane(scene, point, path) else { return false };
        self.selection.may_choose(scene, point, path, Caster::Pane(pane), counters)
    }

    fn density(&self, scene: &Scene, point: &ShadingPoint, path: &SpecularPath<'_>, _: &mut Counters) -> Option<f64> {
        if !self.combines() {
            return None;
        }
        if let [Link { event: SpecularEvent::Reflection, surface: SurfaceId::Pane { index, face }, .. }] = path.links {
            return reflection::density_of(scene, point, (*index, *face), path);
        }
        let pane = coverage::through_one_pane(scene, point, path)?;
        let found = density::of_path_through(scene, point, pane, path)?;
        if scene.lights()[path.light as usize].is_delta() {
            return Some(found);
        }
        Some(found + assumed_density(scene, point, path.light, pane, &self.effort(point)))
    }
}

/// A light, the point on it that was drawn, and the rays that are sent to it besides.
pub(super) struct SampledLight<'a> {
    pub(super) index: u32,
    pub(super) sample: &'a SourceSample,
    pub(super) view: Option<&'a LightView<'a>>,
}

impl Fnee {
    /// Whether rays towards the light are combined with the search. The other selections leave paths out by the
    /// straight line to the source, and the published method knows no rays.
    fn combines(&self) -> bool {
        self.solver == FneeSolver::Complete && self.selection == PaneSelection::All
    }

    /// The rays that are combined with the search. It goes through all panes, at all vertices.
    fn effort(&self, point: &ShadingPoint) -> Effort {
        Effort { is_beside_search: true, ..Effort::at(point) }
    }

    /// Light from one source point through one pane.
    #[expect(clippy::too_many_arguments, reason = "one estimate depends on all of them, and none belong together")]
    pub(super) fn connect(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        light: &SampledLight<'_>,
        index: u32,
        random: DVec2,
        trials: &mut TrialStream,
        counters: &mut Counters,
        arrive: &mut dyn FnMut(Arrival),
    ) {
        let Some(passage) = Passage::new(scene, point, light.index, light.sample, index) else { return };
        let Connection { origin, source, .. } = passage.connection;
        let Some(search) = PathSearch::new(passage.side, origin, source, self.solver) else { return };
        let arrival = |root: &Root, counters: &mut Counters| {
            let Found { arrival, factor } = passage.found(root, counters)?;
            let rays =
                light.view.map_or(0.0, |view| view.density(index, search.window.place_of(root.path.vertices[0])));
            let found = density::of_light(scene, light.index, light.sample.source) / factor;
            // The balance heuristic (Veach and Guibas 1995); a point light is found by the search alone.
            let share = if rays > 0.0 { found / (found + rays) } else { 1.0 };
            let assumed = found + light.view.map_or(0.0, |view| view.assumed(index));
            let path = arrival.path.map(|path| SampledPath { density: assumed, ..path });
            Some(Arrival { weight: arrival.weight * share, path, ..arrival })
        };
        let Enumeration { roots: known, complete } = search.enumerate(counters);
        for root in &known {
            if let Some(arrival) = arrival(root, counters) {
                arrive(arrival);
            }
        }
        // Where there should be no other path, one look in a while keeps the estimate unbiased if there is.
        let odds = if complete { CHECKED } else { 1.0 };
        if trials.next_f64() >= odds {
            return;
        }
        // The first seed is stratified over the pixel's samples; further coordinates and trials are not.
        let mut first = Some(random);
        let seed = || first.take().unwrap_or_else(|| DVec2::new(trials.next_f64(), trials.next_f64()));
        let Some(root) = search.solve(seed, counters) else { return };
        if known.iter().any(|known| search.same(known, &root)) {
            return;
        }
        let Some(arrival) = arrival(&root, counters) else { return };
        let inverse = search.inverse_probability(&root, self.max_trials, trials, counters);
        arrive(Arrival { weight: arrival.weight * (inverse / odds), ..arrival });
    }
}
