//! `manifold`: the lecture's settings for specular manifold sampling, biased and unbiased, at equal time.

use crate::comparison::{Case, Comparison};
use crate::error::ExperimentError;
use crate::experiment::{Defaults, Experiment};
use crate::reference::reference;
use crate::region::Region;
use crate::report::Report;
use crate::scenes::{EmbeddedScene, POOL, SLAB};
use crate::session::Session;
use crate::variant::Variant;

/// Zeltner et al. 2020, figure 18, and the lecture's swimming pool.
pub(crate) const EXPERIMENT: Experiment = Experiment {
    name: "manifold",
    title: "Specular manifold sampling, biased and unbiased (SMS paper, figure 18; lecture, swimming pool)",
    question: "A slab of glass and a pool of water are rendered by specular manifold sampling with M = 1, 4 and 16 \
               trials, and without bias, for the same time, beside the other methods. Zeltner et al. 2020 show such a \
               slab after 5 minutes with M = 1, 2, 4 and 8, and the lecture a pool after 5 minutes with M = 4 (28 \
               samples a pixel), without bias (52) and by path tracing (976); neither states errors. Biased images are \
               too dark: a path found with probability p lacks the part (1 - p)^M of its light. From each point the \
               slab has one path to the light; the caustic of the pool folds, and where it does, points have three \
               paths or more. Methods that know panes only are left out of the pool. Its lamp is so small that path \
               tracing, and what mnee leaves to it, looks dark until it has had its rare bright finds.",
    defaults: Defaults {
        times: Some(&[1.0, 2.0, 4.0, 8.0]),
        seeds: Some(5),
        size: [128, 128],
        reference_samples: Some(1024),
        renders: true,
        references: None,
    },
    run,
};

/// A scene and what is compared on it.
struct Setting {
    file: &'static EmbeddedScene,
    name: &'static str,
    /// Methods beside those on manifolds.
    others: fn() -> Vec<Variant>,
}

/// The scenes.
const SETTINGS: [Setting; 2] = [
    Setting { file: &SLAB, name: "slab", others: of_panes },
    Setting { file: &POOL, name: "pool", others: || vec![Variant::conic(), Variant::path()] },
];

/// Walks over water never leave it, so only walks through panes differ from the published ones.
fn of_panes() -> Vec<Variant> {
    vec![Variant::sms_published(), Variant::sms_published_biased(1), Variant::fnee(), Variant::cone()]
}

/// The methods on manifolds.
fn manifold_variants() -> Vec<Variant> {
    let biased = [1, 4, 16].map(Variant::sms_biased);
    let others = [Variant::sms(), Variant::mnee(), Variant::mnee_dropped()];
    biased.into_iter().chain(others).collect()
}

impl Setting {
    /// What is rendered of the scene.
    fn variants(&self) -> Vec<Variant> {
        [manifold_variants(), (self.others)()].concat()
    }
}

/// The variants of all scenes, each once.
fn all_variants() -> Vec<Variant> {
    let others = SETTINGS.iter().map(|setting| (setting.others)());
    std::iter::once(manifold_variants()).chain(others).flatten().collect()
}

fn run(session: &mut Session) -> Result<Report, ExperimentError> {
    session.plan(SETTINGS.iter().map(|setting| 1 + Comparison::steps(session, &setting.variants())).sum());
    let all = all_variants();
    let mut report = Report::default();
    let mut comparison = Comparison::default();
    for setting in &SETTINGS {
        let name = setting.name;
        let bundle = setting.file.bundle(session.settings.size)?;
        let reference = reference(session, name, &bundle)?;
        let regions = [Region::whole(&reference.image)];
        let region = &regions[0].name;
        let case = Case { scene: name, bundle: &bundle, reference: &reference, regions: &regions };
        comparison.run(session, &[case], &setting.variants())?;
        report.add_scene(name, &bundle, &reference);
        report.add_pictures(name, &reference, &mut comparison);
        // Out of all variants, so that each has the same colour in both figures.
        report.add_figure(&comparison.error_against_time(name, region, &all))?;
        report.statements.push(comparison.energies(name, region, &all));
        let words = |variant: &Variant| comparison.efficiency(name, region, variant);
        report.statements.extend(all.iter().filter_map(words));
    }
    report.tables = comparison.tables().into();
    report.variants = all;
    Ok(report)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_variant_is_listed_twice() {
        let all = all_variants();
        for (index, variant) in all.iter().enumerate() {
            assert!(all[..index].iter().all(|other| other.name != variant.name), "{}", variant.name);
        }
    }
}
