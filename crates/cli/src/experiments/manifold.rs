//! `manifold`: the lecture's settings for specular manifold sampling, biased and unbiased, at equal time.

use super::comparison::{Case, Comparison};
use super::reference::reference;
use super::region::Region;
use super::scenes::{EmbeddedScene, SLAB};
use super::session::Session;
use super::variant::Variant;
use super::{Defaults, Experiment, Report};
use crate::failure::Failure;

/// Zeltner et al. 2020, figure 18, and the lecture.
pub(super) const EXPERIMENT: Experiment = Experiment {
    name: "manifold",
    title: "Specular manifold sampling, biased and unbiased (SMS paper, figure 18)",
    question: "A slab of glass is rendered by specular manifold sampling with M = 1, 4 and 16 trials, and without bias, for the \
               same time, beside the other methods. Zeltner et al. 2020 show such a slab after 5 minutes with M = 1, 2, 4 and 8, \
               and state no errors. Biased images are too dark: a path found with probability p lacks the part (1 - p)^M of its \
               light.",
    defaults: Defaults {
        times: Some(&[1.0, 2.0, 4.0, 8.0]),
        seeds: Some(5),
        size: [128, 128],
        reference_samples: Some(1024),
        renders: true,
    },
    run,
};

/// The scenes.
const SCENES: [(&EmbeddedScene, &str); 1] = [(&SLAB, "slab")];

fn run(session: &mut Session) -> Result<Report, Failure> {
    let variants = [
        Variant::sms_biased(1),
        Variant::sms_biased(4),
        Variant::sms_biased(16),
        Variant::sms(),
        Variant::mnee(),
        Variant::fnee(),
        Variant::cone(),
    ];
    session.plan(SCENES.len() * (1 + Comparison::steps(session, &variants)));
    let mut report = Report::default();
    let mut comparison = Comparison::default();
    for (file, name) in SCENES {
        let bundle = file.bundle(session.settings.size)?;
        let reference = reference(session, name, &bundle)?;
        let regions = [Region::whole(&reference.image)];
        let region = &regions[0].name;
        let case = Case { scene: name, bundle: &bundle, reference: &reference, regions: &regions };
        comparison.run(session, &case, &variants)?;
        report.add_scene(name, &bundle, &reference);
        report.add_pictures(name, &reference, &mut comparison);
        report.add_figure(&comparison.error_against_time(name, region, &variants))?;
        report.statements.push(comparison.energies(name, region, &variants));
        let words = |variant: &Variant| comparison.efficiency(name, region, variant);
        report.statements.extend(variants.iter().filter_map(words));
    }
    report.tables = comparison.tables().into();
    report.variants = variants.into();
    Ok(report)
}
