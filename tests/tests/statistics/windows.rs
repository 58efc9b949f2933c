//! Light through panes that are cut from a sheet, and through leaded windows, against photons that are traced forward.

use std::path::Path;

use clerestory_render_core::document::SceneBundle;
use clerestory_tests::bias::{BLOCK, BiasReport, compare};
use clerestory_tests::comparisons::pictures;
use clerestory_tests::cut_sheet::CutSheet;
use clerestory_tests::forward_tracer::{Fault, Tracing, trace};
use clerestory_tests::reference::Reference;
use clerestory_tests::traced_scene::TracedScene;

/// The fewest photons of faulty references, and their part of those of the right one: enough for what the test has to
/// notice.
const FAULTY_PHOTONS: [u64; 2] = [200_000, 20];

/// A scene as the forward tracer sees it, with changes.
fn traced(bundle: &SceneBundle, change: &dyn Fn(&mut TracedScene)) -> TracedScene {
    let mut scene = TracedScene::build(bundle, Path::new(".")).expect("a scene that can be traced");
    change(&mut scene);
    scene
}

fn reference(scene: &TracedScene, photons: u64, fault: Fault) -> Reference {
    Reference::from_batches(&trace(scene, &Tracing { photons, batches: 32, seed: 11, fault }))
}

/// Pictures of one scene by several methods agree with photons in each block of `block` by `block` pixels, and not with
/// those of a faulty tracer or of a changed scene.
#[track_caller]
pub(crate) fn check_against_photons(
    methods: &[(String, SceneBundle)],
    [samples, photons]: [u64; 2],
    block: usize,
    change: (&str, &dyn Fn(&mut TracedScene)),
) -> Vec<BiasReport> {
    let scene = traced(&methods[0].1, &|_| ());
    let right = reference(&scene, photons, Fault::None);
    let [fewest, part] = FAULTY_PHOTONS;
    let few = fewest.max(photons / part);
    let without_fresnel = reference(&scene, few, Fault::MissingFresnelFactor);
    let changed = reference(&traced(&methods[0].1, change.1), few, Fault::None);
    let check = |(what, bundle): &(String, SceneBundle)| {
        let (replicates, _) = pictures(bundle, samples as u32, 1, &|_| 1);
        let verdict = compare(&replicates, &right, &[], block);
        println!("{what}: {verdict}");
        assert!(verdict.agrees() && verdict.mean_error < 0.005, "{what}: {verdict}");
        for (fault, reference) in [("a missing Fresnel factor", &without_fresnel), (change.0, &changed)] {
            let report = compare(&replicates, reference, &[], block);
            println!("{what} against {fault}: {report}");
            assert!(!report.agrees(), "{what} against {fault}: {report}");
        }
        verdict
    };
    methods.iter().map(check).collect()
}

/// Without the cuts, light crosses from piece to piece.
fn without_cuts(scene: &mut TracedScene) {
    for pane in &mut scene.panes {
        pane.outline.clear();
    }
}

fn check_cut_sheet(pieces: [u32; 2], integrators: &[&str], work: [u64; 2]) -> Vec<BiasReport> {
    let method = |integrator: &&str| {
        let bundle = CutSheet { pieces, integrator, samples: 1, seed: 1 }.scene();
        (format!("{pieces:?} pieces, {integrator}"), bundle)
    };
    let methods: Vec<_> = integrators.iter().map(method).collect();
    check_against_photons(&methods, work, BLOCK, ("no cuts", &without_cuts))
}

#[test]
fn cone_obeys_the_cutting_law() {
    check_cut_sheet([4, 8], &["cone"], [1, 1_000_000]);
}

#[test]
#[ignore = "takes minutes; `tests/run long` has it"]
fn every_method_obeys_the_cutting_law() {
    for report in check_cut_sheet([8, 16], &["cone", "fnee", "auto"], [8, 100_000_000]) {
        assert!(report.has_power(), "{report}");
    }
}
