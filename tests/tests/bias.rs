//! Every method agrees with the ground truth, and would not if it had one of the planted faults.
//!
//! This is the short version: it notices the planted faults, but its standard errors are larger than a verdict needs. The
//! binary `bias` of this crate is the long version; `docs/validation.md` explains both.

use clerestory_tests::bias::compare;
use clerestory_tests::comparisons::comparison;
use clerestory_tests::forward_tracer::Fault;

/// Largest standard error of the image mean, relative: a quarter of what a missing Fresnel factor takes away.
const SHORT_MEAN_ERROR: f64 = 0.01;

/// Photons of references that are traced here.
const PHOTONS: u64 = 1_000_000;

/// Photons of faulty references: enough for what the test has to notice.
const FAULTY_PHOTONS: u64 = 200_000;

const FRESNEL: Fault = Fault::MissingFresnelFactor;
const SADDLES: Fault = Fault::DroppedSaddles;
const SCALED: Fault = Fault::Scaled;

/// Tests for bias, prints with what power, and requires that the faults are noticed.
#[track_caller]
fn check(case: &str, light: &str, integrator: &str, samples: u32, faults: &[Fault]) {
    let comparison = comparison(case, light, integrator);
    let folds = comparison.folds();
    let (replicates, counters) = comparison.replicates(samples, 1);
    let reference = comparison.reference(PHOTONS, Fault::None).expect("the reference ships");
    let report = compare(&replicates, &reference, &folds);
    println!("{}: {report}", comparison.name);
    assert!(report.agrees(), "{}: {report}", comparison.name);
    assert!(report.mean_error < SHORT_MEAN_ERROR, "{}: {report}", comparison.name);
    assert!(counters.truncated * 1000 <= counters.unique_solutions, "{}: {counters:?}", comparison.name);
    for fault in faults {
        let faulty = comparison.reference(FAULTY_PHOTONS, *fault).expect("the reference ships");
        let report = compare(&replicates, &faulty, &folds);
        println!("{} against {fault:?}: {report}", comparison.name);
        assert!(!report.agrees(), "{} against {fault:?}: {report}", comparison.name);
    }
}

#[test]
fn fnee_is_unbiased_for_a_point_light_through_crown_glass() {
    check("crown", "point", "fnee", 2, &[FRESNEL, SADDLES, SCALED]);
}

#[test]
fn fnee_is_unbiased_for_a_point_light_through_a_bump() {
    check("bump", "point", "fnee", 2, &[FRESNEL, SADDLES, SCALED]);
}

#[test]
fn fnee_is_unbiased_for_a_point_light_through_a_flat_pane() {
    check("flat", "point", "fnee", 1, &[FRESNEL, SCALED]);
}

#[test]
fn fnee_is_unbiased_for_a_point_light_through_cathedral_glass() {
    check("cathedral", "point", "fnee", 3, &[FRESNEL, SADDLES]);
}

#[test]
fn fnee_is_unbiased_for_a_sphere_through_crown_glass() {
    check("crown", "sphere", "fnee", 4, &[FRESNEL, SADDLES]);
}

#[test]
fn fnee_is_unbiased_for_a_sphere_through_a_bump() {
    check("bump", "sphere", "fnee", 2, &[FRESNEL, SADDLES]);
}

#[test]
fn fnee_is_unbiased_for_a_sphere_through_a_flat_pane() {
    check("flat", "sphere", "fnee", 1, &[FRESNEL]);
}

#[test]
fn fnee_is_unbiased_for_a_sphere_through_cathedral_glass() {
    check("cathedral", "sphere", "fnee", 5, &[FRESNEL, SADDLES]);
}

#[test]
fn cone_is_unbiased_for_a_sphere() {
    check("crown", "sphere", "cone", 12, &[FRESNEL, SADDLES]);
    check("bump", "sphere", "cone", 12, &[FRESNEL, SADDLES]);
    check("flat", "sphere", "cone", 12, &[FRESNEL]);
    check("cathedral", "sphere", "cone", 24, &[FRESNEL, SADDLES]);
}

#[test]
fn cone_is_unbiased_for_the_sun() {
    check("crown", "sun", "cone", 12, &[FRESNEL, SADDLES]);
    check("cathedral", "sun", "cone", 24, &[FRESNEL, SADDLES]);
}

#[test]
fn cone_finds_the_same_light_from_a_sphere_at_five_kilometres_as_from_the_sun() {
    check("crown", "distant", "cone", 12, &[FRESNEL]);
}

#[test]
fn path_and_cone_are_unbiased_for_a_large_light() {
    for case in ["crown", "bump", "flat", "cathedral"] {
        check(case, "near", "path", 64, &[FRESNEL]);
        check(case, "near", "cone", 64, &[FRESNEL]);
    }
}
