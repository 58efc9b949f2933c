//! `selection`: FNEE paper, figure 8. What the choice of panes loses, and where.

use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::specular::fnee::FneeSolver;
use clerestory_render_core::specular::selection::PaneSelection;

use crate::comparison::{Case, Comparison};
use crate::error::ExperimentError;
use crate::experiment::{Defaults, Experiment};
use crate::reference::reference;
use crate::region::Region;
use crate::report::Report;
use crate::scenes::{EmbeddedScene, FOUR_PANES, FOUR_PANES_POINT};
use crate::session::Session;
use crate::variant::Variant;

/// FNEE paper, figure 8.
pub(crate) const EXPERIMENT: Experiment = Experiment {
    name: "selection",
    title: "Bias of the choice of panes (FNEE paper, figure 8)",
    question: "The window of four panes is rendered with each choice of panes: all whose deflection window is not \
               empty; sharp, the one on the straight line to the light; bleed, one at random wherever something blocks \
               that line. Huan et al. 2023 show that sharp loses the light that bleeds out of the shadow of the panes, \
               and that bleed keeps it at the price of noise; the paper gives pictures and no numbers. Before a point \
               of light, nothing else can find what the choice passes over. Before a small sphere, our path tracer \
               owns exactly those paths, so that no choice is biased; but it meets the sphere so rarely that a short \
               render is as dark, with rare bright finds.",
    defaults: Defaults {
        times: Some(&[4.0]),
        seeds: Some(5),
        size: [96, 96],
        reference_samples: Some(512),
        renders: true,
        references: None,
    },
    run,
};

/// The scenes.
const SCENES: [(&EmbeddedScene, &str); 2] = [(&FOUR_PANES_POINT, "point of light"), (&FOUR_PANES, "small sphere")];

fn variants() -> Vec<Variant> {
    let solvers = [FneeSolver::Complete, FneeSolver::Published];
    let selections = [PaneSelection::All, PaneSelection::Sharp, PaneSelection::Bleed];
    let of = |solver| selections.into_iter().map(move |selection| Variant::fnee_with(solver, selection));
    solvers.into_iter().flat_map(of).collect()
}

fn run(session: &mut Session) -> Result<Report, ExperimentError> {
    let variants = variants();
    session.plan(SCENES.len() * (1 + Comparison::steps(session, &variants)));
    let mut report = Report::default();
    let mut comparison = Comparison::default();
    for (file, name) in SCENES {
        let bundle = file.bundle(session.settings.size)?;
        let scene = PreparedScene::build(&bundle).map_err(|source| file.failure(source))?;
        let reference = reference(session, name, &bundle)?;
        let mut regions = Region::by_straight_line(&scene);
        regions.push(Region::whole(&reference.image));
        let case = Case { scene: name, bundle: &bundle, reference: &reference, regions: &regions };
        comparison.run(session, &[case], &variants)?;
        report.add_scene(name, &bundle, &reference);
        report.add_pictures(name, &reference, &mut comparison);
        let words = |region: &Region| comparison.energies(name, &region.name, &variants);
        report.statements.extend(regions.iter().map(words));
    }
    report.tables = comparison.tables().into();
    report.variants = variants;
    Ok(report)
}
