//! Light from both ends: `auto`, and light tracing alone, agree with the ground truth on every reference, with power.
//!
//! These references have light through panes alone, which one surface scatters. Light that is scattered again has tests
//! of its own (`integrator/path/from_light_tests.rs`), and so have all shares (`weight_tests.rs`).

use clerestory_tests::bias::{BLOCK, compare};
use clerestory_tests::comparisons::comparison;
use clerestory_tests::forward_tracer::Fault;

/// Photons of references that are traced here.
const PHOTONS: u64 = 10_000_000;

/// Tests for bias with `samples` samples for each pixel in each replicate, and requires that faults are noticed.
#[track_caller]
fn check(case: &str, light: &str, integrator: &str, samples: u32) {
    let comparison = comparison(case, light, integrator);
    let folds = comparison.folds();
    let replicates = comparison.replicates(samples, 1).0;
    for fault in [Fault::None].into_iter().chain(comparison.faults()) {
        let reference = comparison.reference(PHOTONS, fault).expect("the reference ships");
        let report = compare(&replicates, &reference, &folds, BLOCK);
        println!("{} against {fault:?}: {report}", comparison.name);
        assert!(report.has_power(), "{} against {fault:?}: {report}", comparison.name);
        assert_eq!(report.agrees(), fault == Fault::None, "{} against {fault:?}: {report}", comparison.name);
    }
}

#[test]
#[ignore = "takes minutes; `tests/run long` has it"]
fn auto_is_unbiased_for_points() {
    for (case, samples) in [("flat", 2), ("bump", 4), ("crown", 8), ("cathedral", 8)] {
        check(case, "point", "auto", samples);
    }
}

#[test]
#[ignore = "takes minutes; `tests/run long` has it"]
fn auto_is_unbiased_for_spheres() {
    for (case, samples) in [("flat", 2), ("bump", 4), ("crown", 8), ("cathedral", 8)] {
        check(case, "sphere", "auto", samples);
    }
}

#[test]
#[ignore = "takes minutes; `tests/run long` has it"]
fn auto_is_unbiased_for_the_sun() {
    for (case, samples) in [("flat", 2), ("bump", 4), ("crown", 8), ("cathedral", 8)] {
        check(case, "sun", "auto", samples);
    }
}

#[test]
#[ignore = "takes minutes; `tests/run long` has it"]
fn light_tracing_is_unbiased() {
    for case in ["flat", "bump", "crown", "cathedral"] {
        for light in ["point", "sphere", "sun"] {
            check(case, light, "light", 2);
        }
    }
}

#[test]
#[ignore = "takes minutes; `tests/run long` has it"]
fn auto_and_light_tracing_are_unbiased_in_the_room() {
    check("room", "sun", "auto", 4);
    check("room", "sun", "light", 1);
}
