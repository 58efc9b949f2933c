//! `solvers`: FNEE paper, figures 9 and 10. Error against time of all methods on panes of four profiles.

use clerestory_render_core::integrator::PreparedScene;

use crate::comparison::{Case, Comparison};
use crate::error::ExperimentError;
use crate::experiment::{Defaults, Experiment};
use crate::reference::reference;
use crate::region::Region;
use crate::report::Report;
use crate::scenes::FOUR_PANES;
use crate::session::Session;
use crate::table::rounded_number;
use crate::variant::Variant;

/// FNEE paper, figures 9 and 10.
pub(crate) const EXPERIMENT: Experiment = Experiment {
    name: "solvers",
    title: "Error against time on four profiles of old glass (FNEE paper, figures 9 and 10)",
    question: "The window of four panes is rendered by every method for the same time, with several seeds, and \
               compared with a reference. Huan et al. 2023 show FNEE and SMS, both with FNEE's choice of panes, after \
               100 s at 256 x 256 pixels: FNEE has the lower error on all four profiles. The paper gives curves and no \
               numbers. Estimates of inverse probabilities are cut off after 1000 trials for fnee, as in the paper, \
               and after 10 million for sms, as in its authors' scenes.",
    defaults: Defaults {
        times: Some(&[1.0, 2.0, 4.0, 8.0]),
        seeds: Some(5),
        size: [128, 128],
        reference_samples: Some(512),
        renders: true,
        references: None,
    },
    run,
};

const SCENE: &str = "four panes";

fn run(session: &mut Session) -> Result<Report, ExperimentError> {
    let variants = [
        Variant::fnee(),
        Variant::fnee_published(),
        Variant::sms_published_sharp(),
        Variant::sms_sharp(),
        Variant::sms_biased_sharp(4),
        Variant::mnee(),
        Variant::mnee_dropped(),
        Variant::cone(),
        Variant::path(),
    ];
    session.plan(1 + Comparison::steps(session, &variants));
    let bundle = FOUR_PANES.bundle(session.settings.size)?;
    let scene = PreparedScene::build(&bundle).map_err(|source| FOUR_PANES.failure(source))?;
    let reference = reference(session, SCENE, &bundle)?;
    let mut regions = Region::of_panes(&scene);
    regions.push(Region::whole(&reference.image));
    let mut comparison = Comparison::default();
    let case = Case { scene: SCENE, bundle: &bundle, reference: &reference, regions: &regions };
    comparison.run(session, &[case], &variants)?;

    let mut report = Report { statements: statements(&comparison, &regions), ..Report::default() };
    report.add_scene(SCENE, &bundle, &reference);
    report.add_pictures(SCENE, &reference, &mut comparison);
    for region in &regions {
        report.add_figure(&comparison.error_against_time(SCENE, &region.name, &variants))?;
    }
    report.tables = comparison.tables().into();
    report.variants = variants.into();
    Ok(report)
}

/// The methods against `fnee` in each region.
fn statements(comparison: &Comparison, regions: &[Region]) -> Vec<String> {
    let of_region = |region: &Region| {
        let mse = |variant: &Variant| Some(comparison.last(SCENE, &region.name, &variant.name)?.mse);
        let fnee = mse(&Variant::fnee())?;
        let ratio = |variant: Variant| Some(format!("{} {}", variant.name, rounded_number(mse(&variant)? / fnee)));
        let others = [
            Variant::fnee_published(),
            Variant::sms_published_sharp(),
            Variant::sms_sharp(),
            Variant::mnee(),
            Variant::cone(),
            Variant::path(),
        ];
        let ratios: Vec<String> = others.into_iter().filter_map(ratio).collect();
        Some(format!(
            "{}: mean squared error at the longest time, over that of fnee: {}.",
            region.name,
            ratios.join(", ")
        ))
    };
    regions.iter().filter_map(of_region).collect()
}
