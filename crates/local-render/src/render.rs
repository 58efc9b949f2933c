//! Rendering round by round, up to a plan.

use std::ops::ControlFlow;
use std::sync::atomic::Ordering;

use clerestory_film::adaptive::{noise, shares};
use clerestory_film::counters::Counters;
use clerestory_film::{Adaptation, PILOT_ROUND, Rounds, Share, TileSum};
use clerestory_render_core::integrator::PreparedScene;
use rayon::prelude::*;

use crate::control::Control;
use crate::error::LocalRenderError;
use crate::film::{LocalFilm, render_leaves};
use crate::plan::PassPlan;

/// A complete round.
pub struct Round<'a> {
    /// Its number, from 0.
    pub number: u32,
    /// Passes in every tile, or, in an adaptive render, in the tiles that have most.
    pub passes: u32,
    /// The sums of all tiles.
    pub sums: &'a [TileSum],
}

/// What a render returns.
pub struct Outcome {
    /// The sums over the complete passes of each tile, without tiles that have none.
    pub sums: Vec<TileSum>,
    /// The work on the image, unfinished passes included.
    pub counters: Counters,
    /// The work on the pilot, which is not in the image.
    pub pilot: Counters,
    /// Whether the whole plan is rendered.
    pub is_complete: bool,
}

/// Renders on the current rayon pool until the plan is complete, or until `control` or `on_round` stops it.
///
/// # Errors
///
/// When a pass cannot be rendered.
pub fn render(
    scene: &PreparedScene,
    plan: &PassPlan,
    control: &Control,
    mut on_round: impl FnMut(&Round<'_>) -> ControlFlow<()>,
) -> Result<Outcome, LocalRenderError> {
    let mut film = LocalFilm::new(scene, plan);
    let mut pilot = Counters::default();
    control.planned.store(plan.samples(), Ordering::Relaxed);
    let is_complete = render_rounds(&mut film, &mut pilot, control, &mut on_round)?;
    Ok(Outcome { sums: film.sums()?, counters: film.counters, pilot, is_complete })
}

fn render_rounds(
    film: &mut LocalFilm<'_>,
    pilot: &mut Counters,
    control: &Control,
    on_round: &mut impl FnMut(&Round<'_>) -> ControlFlow<()>,
) -> Result<bool, LocalRenderError> {
    let plan = film.plan;
    let mut shares: Option<Vec<Share>> = None;
    // A round is complete in every tile, so a tile without passes leaves no rounds.
    let rounds = Rounds::new(plan.tile_passes.iter().copied().min().unwrap_or(0));
    for (number, passes) in (0..).map_while(|number| Some((number, rounds.end(number)?))) {
        let in_tiles = match (&plan.adaptation, &shares) {
            (Some(adaptation), Some(shares)) => shares.iter().map(|share| adaptation.passes(*share, passes)).collect(),
            _ => vec![passes; plan.tile_passes.len()],
        };
        if !film.render_up_to(&in_tiles, control)? {
            return Ok(false);
        }
        if on_round(&Round { number, passes, sums: &film.sums()? }).is_break() {
            return Ok(false);
        }
        if let Some(adaptation) = plan.adaptation.filter(|_| number == PILOT_ROUND) {
            shares = render_pilot(film, &adaptation, pilot, control)?;
            let Some(shares) = &shares else { return Ok(false) };
            let most = plan.tile_passes.iter().zip(shares).map(|(passes, share)| adaptation.passes(*share, *passes));
            let planned = plan.samples_of(&most.collect::<Vec<_>>()).saturating_add(pilot.samples);
            control.planned.store(planned, Ordering::Relaxed);
        }
    }
    match shares {
        Some(_) => Ok(true),
        None => film.render_up_to(&plan.tile_passes, control),
    }
}

/// Renders the pilot and decides the share of each tile; `None` when `control` stopped it.
fn render_pilot(
    film: &LocalFilm<'_>,
    adaptation: &Adaptation,
    counters: &mut Counters,
    control: &Control,
) -> Result<Option<Vec<Share>>, LocalRenderError> {
    let LocalFilm { scene, plan, .. } = film;
    let noise_of = |tile: u32| -> Result<Option<(f64, Counters)>, LocalRenderError> {
        let (mut nodes, mut counters) = (Vec::new(), Counters::default());
        for pass in adaptation.pilot() {
            let rendered = if control.is_late() { None } else { render_leaves(scene, plan, &[tile], pass, control)? };
            let Some(rendered) = rendered else { return Ok(None) };
            for rendered in rendered {
                nodes.push(rendered.node);
                counters += rendered.counters;
            }
        }
        Ok(Some((noise(&nodes), counters)))
    };
    let tiles: Vec<Option<_>> =
        (0..plan.grid.camera_tiles()).into_par_iter().map(noise_of).collect::<Result<_, _>>()?;
    tiles.iter().flatten().for_each(|(_, tile)| *counters += *tile);
    let noise: Option<Vec<f64>> = tiles.into_iter().map(|tile| tile.map(|(noise, _)| noise)).collect();
    Ok(noise.map(|noise| shares(&plan.grid, &noise)))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use clerestory_film::decomposition::{mean, standard_error};
    use clerestory_film::{Targets, TileGrid};
    use clerestory_render_core::document;
    use clerestory_render_core::document::SamplingDescription;
    use clerestory_render_core::document::SceneBundle;
    use clerestory_render_core::scene::description::FilmDescription;

    use super::*;
    use crate::image::{Provenance, image};

    const PASSES: u32 = 40;

    /// The caustic of a crown pane in a few pixels, with small blocks.
    fn bundle(seed: u64) -> SceneBundle {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/references/crown-sphere.json");
        let bundle = document::load(&file).unwrap();
        let mut description = bundle.description().clone();
        description.seed = seed;
        description.film = FilmDescription { width: 16, height: 16 };
        description.sampling = SamplingDescription { samples_per_pass: 4, samples_per_block: 16 };
        bundle.with_description(description).unwrap()
    }

    /// Mean radiance of the image, with passes shared out or not, and passes of the tiles.
    fn light(scene: &PreparedScene, is_adaptive: bool) -> (f64, Vec<u32>) {
        let grid = TileGrid::new(16, 16, 4);
        let adaptation = is_adaptive.then(|| Targets::default().adaptation(scene.sampling(), PASSES).unwrap());
        let plan = PassPlan { frame: 0, grid, sampling: scene.sampling(), tile_passes: vec![PASSES; 16], adaptation };
        let control = Control::default();
        let outcome = render(scene, &plan, &control, |_| ControlFlow::Continue(())).unwrap();
        assert!(outcome.is_complete);
        assert_eq!(control.planned.into_inner(), outcome.counters.samples + outcome.pilot.samples);
        let provenance = Provenance { build: "test", counters: outcome.counters, elapsed: None, assumptions: &[] };
        let image = image(scene, &plan, &outcome.sums, &provenance).unwrap();
        let numbers: Vec<f64> = image.layers().mean.as_flattened().iter().map(|number| f64::from(*number)).collect();
        (mean(&numbers), image.metadata().unwrap().tile_passes.clone())
    }

    #[test]
    fn passes_shared_out_bring_as_much_light_as_the_same_in_every_tile() {
        check_light(8, 0.02);
    }

    #[test]
    #[ignore = "takes a minute; `tests/run long` has it"]
    fn passes_shared_out_bring_as_much_light_to_half_a_percent() {
        check_light(48, 0.005);
    }

    /// Checks that so many images have the same light to four standard errors of this share of it.
    fn check_light(images: u64, share: f64) {
        // The two share samples, so that their difference says more than each of them.
        let (mut differences, mut even) = (Vec::new(), Vec::new());
        for seed in 0..images {
            let scene = PreparedScene::build(&bundle(seed)).unwrap();
            let ((adaptive, passes), (same, _)) = (light(&scene, true), light(&scene, false));
            assert!(passes.contains(&PASSES) && passes.iter().any(|passes| *passes < PASSES * 3 / 4), "{passes:?}");
            differences.push(adaptive - same);
            even.push(same);
        }
        let (difference, error, light) = (mean(&differences), standard_error(&differences).unwrap(), mean(&even));
        assert!(error < share * light, "the test has no power: {difference} +- {error} of {light}");
        assert!(difference.abs() < 4.0 * error, "{difference} +- {error} of {light}");
    }
}
