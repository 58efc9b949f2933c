//! `fine-detail`: FNEE paper, figure 12. Light that is lost behind finely detailed glass.

use clerestory_render_core::document::SceneBundle;
use clerestory_render_core::document::SceneDescription;
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::SceneError;
use clerestory_render_core::scene::description::{CameraDescription, ProfileDescription};
use clerestory_render_core::specular::fnee::FneeSolver;
use clerestory_render_core::specular::selection::PaneSelection;

use crate::comparison::{Case, Comparison};
use crate::error::ExperimentError;
use crate::experiment::{Defaults, Experiment};
use crate::figure::{Curve, Figure, Point};
use crate::reference::reference;
use crate::region::Region;
use crate::report::Report;
use crate::scenes::FOUR_PANES;
use crate::session::Session;
use crate::variant::Variant;

/// FNEE paper, figure 12.
pub(crate) const EXPERIMENT: Experiment = Experiment {
    name: "fine-detail",
    title: "Light lost behind finely detailed glass (FNEE paper, figure 12)",
    question: "The pane with fine detail is rendered with estimates of inverse probabilities cut off after N_max \
               trials. Huan et al. 2023 show unnaturally dark caustics and explain them by N_max being too low for \
               small basins; the paper gives a picture and no numbers. The published line search finds saddles and \
               maxima, too, but so rarely that their basins are the smallest: how far a larger N_max mends that is \
               measured here.",
    defaults: Defaults {
        times: Some(&[4.0]),
        seeds: Some(5),
        size: [64, 64],
        reference_samples: Some(1024),
        renders: true,
        references: None,
    },
    run,
};

/// Largest numbers of trials.
const TRIALS: [u32; 4] = [10, 100, 1000, 10_000];

/// Distances between dimples, metres, at equal slopes.
const WAVELENGTHS: [(&str, f64); 2] = [("dimples 15 mm apart", 0.015), ("dimples 7.5 mm apart", 0.0075)];

/// The solvers and their names. There is one pane, and both search it, so the choice of panes loses nothing.
const SOLVERS: [(&str, FneeSolver); 2] = [("published", FneeSolver::Published), ("complete", FneeSolver::Complete)];

fn variant((name, solver): (&str, FneeSolver), trials: u32) -> Variant {
    Variant::fnee_trials(&format!("{name} N_max = {trials}"), solver, PaneSelection::All, trials)
}

fn run(session: &mut Session) -> Result<Report, ExperimentError> {
    let variants: Vec<Variant> =
        SOLVERS.into_iter().flat_map(|solver| TRIALS.map(|trials| variant(solver, trials))).collect();
    session.plan(WAVELENGTHS.len() * (1 + Comparison::steps(session, &variants)));
    let whole_window = FOUR_PANES.bundle(session.settings.size)?;
    let mut report = Report::default();
    let mut comparison = Comparison::default();
    for (name, wavelength) in WAVELENGTHS {
        let bundle = fine_pane(&whole_window, wavelength).map_err(|source| FOUR_PANES.failure(source))?;
        let reference = reference(session, name, &bundle)?;
        let regions = [Region::whole(&reference.image)];
        let case = Case { scene: name, bundle: &bundle, reference: &reference, regions: &regions };
        comparison.run(session, &[case], &variants)?;
        report.add_scene(name, &bundle, &reference);
        report.add_pictures(name, &reference, &mut comparison);
        report.add_figure(&figure(&comparison, name, &regions[0].name))?;
        report.statements.push(comparison.energies(name, &regions[0].name, &variants));
    }
    report.tables = comparison.tables().into();
    report.variants = variants;
    Ok(report)
}

/// The window with its fine pane alone. Its dimples have another distance and the same slopes, and the camera sees its
/// light.
fn fine_pane(window: &SceneBundle, distance: f64) -> Result<SceneBundle, SceneError> {
    let mut description: SceneDescription = window.description().clone();
    description.panes.retain(|pane| pane.name == "fine");
    for pane in &mut description.panes {
        if let ProfileDescription::Hammered { wavelength, amplitude, .. } = &mut pane.front {
            *amplitude *= distance / *wavelength;
            *wavelength = distance;
        }
        // The picture of the whole window is cut into quarters.
        if let CameraDescription::Orthographic { position, look_at, height, .. } = &mut description.camera {
            for axis in 0..2 {
                let shift = 0.25 * *height * pane.centre[axis].signum();
                position[axis] += shift;
                look_at[axis] += shift;
            }
            *height *= 0.5;
        }
    }
    let bundle = window.clone().with_description(description)?;
    PreparedScene::build(&bundle)?;
    Ok(bundle)
}

/// Mean energy over the truth against N_max.
fn figure(comparison: &Comparison, scene: &str, region: &str) -> Figure {
    let point = |variant: Variant, trials: u32| {
        let row = comparison.last(scene, region, &variant.name)?;
        let error = row.mean_ratio_standard_error.unwrap_or(0.0);
        Some(Point { x: f64::from(trials), y: row.mean_ratio?, error })
    };
    let curve = |(colour, solver): (usize, (&str, FneeSolver))| Curve {
        label: solver.0.to_owned(),
        points: TRIALS.into_iter().filter_map(|trials| point(variant(solver, trials), trials)).collect(),
        colour,
    };
    let curves = SOLVERS.into_iter().enumerate().map(curve).collect();
    Figure { title: scene.to_owned(), axes: ["N_max", "mean energy over that of the reference"], curves }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fine_pane_is_alone_and_its_slopes_stay() {
        let window = FOUR_PANES.bundle([8, 8]).unwrap();
        let bundle = fine_pane(&window, 0.0075).unwrap();
        let description = bundle.description();
        assert_eq!(description.panes.len(), 1);
        let slope = |description: &SceneDescription| {
            let fine = description.panes.iter().find(|pane| pane.name == "fine").unwrap();
            let ProfileDescription::Hammered { wavelength, amplitude, .. } = fine.front else { panic!("{fine:?}") };
            amplitude / wavelength
        };
        assert!((slope(description) / slope(window.description()) - 1.0).abs() < 1e-12);
        let CameraDescription::Orthographic { look_at, height, .. } = description.camera else { panic!("a camera") };
        assert!((look_at[0] - 0.23).abs() < 1e-12 && (look_at[1] + 0.23).abs() < 1e-12 && height == 0.46);
    }
}
