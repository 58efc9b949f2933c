//! The variants that experiments compare: integrators with settings, named alike in all figures.

use clerestory_render_core::specular::cone::ConeSettings;
use clerestory_render_core::specular::conic::ConicSearch;
use clerestory_render_core::specular::conic::ConicSettings;
use clerestory_render_core::specular::constraint::ManifoldConstraint;
use clerestory_render_core::specular::fnee::FneeSettings;
use clerestory_render_core::specular::fnee::FneeSolver;
use clerestory_render_core::specular::manifold::WalkSteps;
use clerestory_render_core::specular::mnee::MissedPaths;
use clerestory_render_core::specular::mnee::MneeSettings;
use clerestory_render_core::specular::path::PathSettings;
use clerestory_render_core::specular::registry::IntegratorDescription;
use clerestory_render_core::specular::selection::PaneSelection;
use clerestory_render_core::specular::sms::ManifoldEstimator;
use clerestory_render_core::specular::sms::SmsSettings;
use serde::Serialize;

/// Largest number of trials of `fnee`, as in the FNEE paper, section 3.2.
const PAPER_TRIALS: u32 = 1000;

/// Largest number of trials of unbiased `sms`, as in the scenes of its authors.
const MANIFOLD_TRIALS: u32 = 10_000_000;

/// An integrator with settings. The scene's `max_depth` and `chains` replace its own, because which chains exist is a
/// property of the scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Variant {
    /// What figures and files call it.
    pub(crate) name: String,
    pub(crate) integrator: IntegratorDescription,
}

/// Replaced by the scene's.
const DEPTH: u32 = 1;

impl Variant {
    fn new(name: &str, integrator: IntegratorDescription) -> Self {
        Self { name: name.to_owned(), integrator }
    }

    /// Path tracing alone.
    pub(crate) fn path() -> Self {
        Self::new("path", IntegratorDescription::Path(PathSettings { max_depth: DEPTH }))
    }

    /// Forward sampling.
    pub(crate) fn cone() -> Self {
        Self::new("cone", IntegratorDescription::Cone(ConeSettings { max_depth: DEPTH }))
    }

    /// `fnee` with its default settings.
    pub(crate) fn fnee() -> Self {
        Self::fnee_with(FneeSolver::Complete, PaneSelection::All)
    }

    /// `fnee` as the paper has it.
    pub(crate) fn fnee_published() -> Self {
        Self::fnee_with(FneeSolver::Published, PaneSelection::Sharp)
    }

    /// `fnee` with a solver and a choice of panes.
    pub(crate) fn fnee_with(solver: FneeSolver, selection: PaneSelection) -> Self {
        let solver_name = match solver {
            FneeSolver::Complete => "",
            FneeSolver::Published => " published",
        };
        let selection_name = match selection {
            PaneSelection::All => "",
            PaneSelection::Sharp => " sharp",
            PaneSelection::Bleed => " bleed",
            PaneSelection::Random => " random",
        };
        Self::fnee_trials(&format!("fnee{solver_name}{selection_name}"), solver, selection, PAPER_TRIALS)
    }

    /// `fnee` with everything that it can be given.
    pub(crate) fn fnee_trials(name: &str, solver: FneeSolver, selection: PaneSelection, max_trials: u32) -> Self {
        let reflected = false;
        Self::new(
            name,
            IntegratorDescription::Fnee(FneeSettings { max_depth: DEPTH, solver, selection, max_trials, reflected }),
        )
    }

    /// Unbiased specular manifold sampling, with an estimate for every pane, as its authors have it.
    pub(crate) fn sms() -> Self {
        let estimator = ManifoldEstimator::Unbiased { max_trials: MANIFOLD_TRIALS };
        Self::new("sms unbiased", sms(estimator, PaneSelection::All, WalkSteps::OnPanes))
    }

    /// The same by walks as published.
    pub(crate) fn sms_published() -> Self {
        let estimator = ManifoldEstimator::Unbiased { max_trials: MANIFOLD_TRIALS };
        Self::new("sms published", sms(estimator, PaneSelection::All, WalkSteps::Published))
    }

    /// Unbiased specular manifold sampling with the choice of panes of the FNEE paper.
    pub(crate) fn sms_sharp() -> Self {
        let estimator = ManifoldEstimator::Unbiased { max_trials: MANIFOLD_TRIALS };
        Self::new("sms unbiased sharp", sms(estimator, PaneSelection::Sharp, WalkSteps::OnPanes))
    }

    /// The same by walks as published, and with the same choice of panes.
    pub(crate) fn sms_published_sharp() -> Self {
        let estimator = ManifoldEstimator::Unbiased { max_trials: MANIFOLD_TRIALS };
        Self::new("sms published sharp", sms(estimator, PaneSelection::Sharp, WalkSteps::Published))
    }

    /// Unbiased specular manifold sampling of one pane at random.
    pub(crate) fn sms_random() -> Self {
        let estimator = ManifoldEstimator::Unbiased { max_trials: MANIFOLD_TRIALS };
        Self::new("sms unbiased random", sms(estimator, PaneSelection::Random, WalkSteps::OnPanes))
    }

    /// Biased specular manifold sampling with `trials` trials for every pane.
    pub(crate) fn sms_biased(trials: u32) -> Self {
        let estimator = ManifoldEstimator::Biased { trials };
        Self::new(&format!("sms biased M = {trials}"), sms(estimator, PaneSelection::All, WalkSteps::OnPanes))
    }

    /// The same by walks as published.
    pub(crate) fn sms_published_biased(trials: u32) -> Self {
        let estimator = ManifoldEstimator::Biased { trials };
        Self::new(&format!("sms published M = {trials}"), sms(estimator, PaneSelection::All, WalkSteps::Published))
    }

    /// Biased specular manifold sampling with `trials` trials and the choice of panes of the FNEE paper.
    pub(crate) fn sms_biased_sharp(trials: u32) -> Self {
        let estimator = ManifoldEstimator::Biased { trials };
        Self::new(&format!("sms biased M = {trials} sharp"), sms(estimator, PaneSelection::Sharp, WalkSteps::OnPanes))
    }

    /// Manifold next event estimation; chance finds what its walk misses.
    pub(crate) fn mnee() -> Self {
        Self::mnee_with("mnee", MissedPaths::LeftToChance)
    }

    /// Manifold next event estimation that drops what its walk misses.
    pub(crate) fn mnee_dropped() -> Self {
        Self::mnee_with("mnee biased", MissedPaths::Dropped)
    }

    fn mnee_with(name: &str, missed: MissedPaths) -> Self {
        let (casters, receivers) = (None, None);
        Self::new(
            name,
            IntegratorDescription::Mnee(MneeSettings {
                max_depth: DEPTH,
                missed,
                chains: through_panes(),
                casters,
                receivers,
            }),
        )
    }

    /// All light over one interface of a specular mesh.
    pub(crate) fn conic() -> Self {
        Self::conic_with("conic", ConicSearch::Complete)
    }

    /// The same by the search alone, as manifold sampling is: without rays to where the mesh focuses a light.
    pub(crate) fn conic_without_rays() -> Self {
        Self::conic_with("conic without rays", ConicSearch::WithoutRays)
    }

    /// The published walk to the first path over one interface of a specular mesh.
    pub(crate) fn conic_published() -> Self {
        Self::conic_with("conic published", ConicSearch::Published)
    }

    fn conic_with(name: &str, search: ConicSearch) -> Self {
        let (chains, casters, receivers) = (vec!["T".to_owned()], None, None);
        Self::new(
            name,
            IntegratorDescription::Conic(ConicSettings { max_depth: DEPTH, search, chains, casters, receivers }),
        )
    }

    /// The integrator for a scene, whose own integrator is `scenes`.
    pub(crate) fn integrator(&self, scenes: &IntegratorDescription) -> IntegratorDescription {
        let mut integrator = self.integrator.clone();
        if let (
            IntegratorDescription::Sms(SmsSettings { chains, .. })
            | IntegratorDescription::Mnee(MneeSettings { chains, .. })
            | IntegratorDescription::Conic(ConicSettings { chains, .. }),
            IntegratorDescription::Sms(SmsSettings { chains: named, .. })
            | IntegratorDescription::Mnee(MneeSettings { chains: named, .. })
            | IntegratorDescription::Conic(ConicSettings { chains: named, .. }),
        ) = (&mut integrator, scenes)
        {
            chains.clone_from(named);
        }
        integrator.set_max_depth(scenes.max_depth());
        integrator
    }
}

/// A name as part of a file name: everything but letters and digits becomes a hyphen.
pub(crate) fn file_name(name: &str) -> String {
    let words = name.split(|letter: char| !letter.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.collect::<Vec<_>>().join("-").to_ascii_lowercase()
}

fn through_panes() -> Vec<String> {
    vec!["TT".to_owned()]
}

fn sms(estimator: ManifoldEstimator, selection: PaneSelection, steps: WalkSteps) -> IntegratorDescription {
    let constraint = ManifoldConstraint::AngleDifference;
    IntegratorDescription::Sms(SmsSettings {
        max_depth: DEPTH,
        constraint,
        steps,
        estimator,
        selection,
        chains: through_panes(),
        casters: None,
        receivers: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variants_take_depth_and_chains_of_the_scene_and_names_that_files_can_have() {
        let deep = IntegratorDescription::Path(PathSettings { max_depth: 7 });
        assert_eq!(Variant::sms().integrator(&deep).max_depth(), 7);
        let chains = |variant: Variant, scenes: &IntegratorDescription| match variant.integrator(scenes) {
            IntegratorDescription::Sms(SmsSettings { chains, .. })
            | IntegratorDescription::Mnee(MneeSettings { chains, .. }) => chains,
            other => panic!("{other:?} has no chains"),
        };
        let pool = crate::scenes::POOL.bundle([8, 8]).unwrap();
        for variant in [Variant::sms(), Variant::sms_biased(4), Variant::mnee()] {
            assert_eq!(chains(variant.clone(), &deep), ["TT"], "panes, where the scene names none");
            assert_eq!(chains(variant, &pool.description().integrator), ["T"]);
        }
        assert_eq!(file_name(&Variant::sms_biased_sharp(16).name), "sms-biased-m-16-sharp");
        assert_eq!(file_name("N_max = 100, complete"), "n-max-100-complete");
    }
}
