//! Laws that every material obeys. Each is shown to reject materials with a fault.
//!
//! Densities are compared with counts of drawn directions by Pearson's chi-square test, over cells that are small where
//! a lobe is narrow. Integrals are refined until they change no more.

mod cases;
mod cells;
mod delta;
mod loss;

use clerestory_film::{SampleStream, SamplerSettings};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use serde_json::json;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use self::cases::{
    ALPHAS, COSINES, Case, Faulty, GLASS, diffuse, direction, frosted, half_metal, material, metallic_roughness,
    plastic, rough_glass, scattering, tilted, translucent, white_conductor,
};
use self::cells::Cells;
use super::microfacet::Ggx;
use super::{Bsdf, SampleKind};

/// Directions that are drawn for each case.
const SAMPLES: u32 = 20_000;

/// Cells are joined until so many directions are expected in them.
const LEAST_EXPECTED: f64 = 5.0;

/// Probability with which all cases of a correct material together are rejected.
const SIGNIFICANCE: f64 = 0.01;

/// A mean may be so many standard errors off.
const MOST_ERRORS: f64 = 4.5;

/// What is found of a material.
#[derive(Debug)]
struct Findings {
    /// Probability of counts at least as far from what the density says.
    probability: f64,
    /// The integral of the density.
    density: f64,
    /// How many standard errors lie between the means of drawn light and the integrals.
    errors: f64,
    /// Largest relative difference between what a draw says and what it should say by density and value.
    contradiction: f64,
    /// Whether any light was drawn to the other side.
    transmits: bool,
}

/// Stream of draw `index`, independent of all others.
fn stream(index: u32) -> SampleStream {
    SampleStream::new(&SamplerSettings { seed: 11, samples_per_block: 1 }, 0, [3, 5], index)
}

fn examine(case: &Case) -> Findings {
    let cells = case.cells();
    let integrals = cells.map(|cells| {
        cells.integrals(&|direction| {
            let value = case.value(direction);
            [case.bsdf.pdf(&case.at, case.incident, direction), value.x, value.y, value.z]
        })
    });
    let integrals = integrals.concat();
    let total: [f64; 4] = std::array::from_fn(|k| integrals.iter().map(|integral| integral[k]).sum());

    let mut counts = vec![0.0; 2 * Cells::COUNT];
    let (mut sum, mut squares, mut drawn, mut contradiction) = (DVec3::ZERO, DVec3::ZERO, 0.0, 0.0_f64);
    for index in 0..SAMPLES {
        let Some(sample) = case.bsdf.sample(&case.at, case.incident, &mut stream(index)) else { continue };
        let SampleKind::Density(density) = sample.kind else { panic!("{} scatters into single directions", case.name) };
        drawn += 1.0;
        sum += sample.weight;
        squares += sample.weight * sample.weight;
        let stated = case.bsdf.pdf(&case.at, case.incident, sample.direction);
        let value = case.value(sample.direction);
        let of_weight = (value - sample.weight * density).length() / value.length().max(1e-9);
        contradiction = contradiction.max((density / stated - 1.0).abs()).max(of_weight);
        let [reflected, transmitted] = cells.map(|cells| cells.cell_of(sample.direction));
        if let Some(cell) = reflected.or(transmitted.map(|cell| Cells::COUNT + cell)) {
            counts[cell] += 1.0;
        }
    }
    let count = f64::from(SAMPLES);
    let lost = (count - drawn, (1.0 - total[0]).max(0.0) * count);
    let expected = integrals.iter().map(|integral| integral[0] * count);
    let bins = counts.iter().copied().zip(expected).chain([lost]).collect();
    let mean = sum / count;
    let variance = (squares / count - mean * mean).max(DVec3::ZERO) / count;
    let integral = DVec3::new(total[1], total[2], total[3]);
    // What the quadrature leaves open.
    let slack = integral * 2e-4;
    let error = (mean - integral).abs() / (variance + slack * slack).map(f64::sqrt);
    Findings {
        probability: probability(bins),
        density: total[0],
        errors: error.max_element(),
        contradiction,
        transmits: counts[Cells::COUNT..].iter().any(|count| *count > 0.0),
    }
}

/// The probability of counts at least as far from those that are expected, by Pearson's test.
fn probability(mut bins: Vec<(f64, f64)>) -> f64 {
    bins.sort_by(|one, other| one.1.total_cmp(&other.1));
    let (mut statistic, mut joined, mut open) = (0.0, 0_u32, (0.0, 0.0));
    for (index, (count, expected)) in bins.iter().enumerate() {
        open = (open.0 + count, open.1 + expected);
        let rest: f64 = bins[index + 1..].iter().map(|(_, expected)| expected).sum();
        if open.1 >= LEAST_EXPECTED && (rest >= LEAST_EXPECTED || index + 1 == bins.len()) {
            statistic += (open.0 - open.1) * (open.0 - open.1) / open.1;
            joined += 1;
            open = (0.0, 0.0);
        }
    }
    assert!(joined > 1, "too few directions");
    1.0 - ChiSquared::new(f64::from(joined - 1)).unwrap().cdf(statistic)
}

#[test]
fn directions_are_drawn_with_the_stated_density_and_carry_the_light_that_is_scattered() {
    let cases = scattering();
    let least = SIGNIFICANCE / cases.len() as f64;
    let findings: Vec<Findings> = cases.par_iter().map(examine).collect();
    let mut wrong = Vec::new();
    for (case, findings) in cases.iter().zip(&findings) {
        let is_right = findings.probability > least
            && findings.density < 1.001
            && findings.errors < MOST_ERRORS
            && findings.contradiction < 1e-6
            && findings.transmits == case.bsdf.transmits();
        if !is_right {
            wrong.push(format!("{}: {findings:?}", case.name));
        }
    }
    assert!(wrong.is_empty(), "{} of {} cases:\n{}", wrong.len(), cases.len(), wrong.join("\n"));
}

#[test]
fn faults_of_densities_and_of_values_are_found() {
    let glass = Case::flat("glass", rough_glass(0.3), 0.3, 0.8);
    let metal = Case::flat("metal", white_conductor(0.25), 0.25, 0.5);
    let coated = Case::flat("plastic", plastic(0.3), 0.3, 0.5);
    let of_other = |case: &Case, name: &str, other: std::sync::Arc<dyn Bsdf>| {
        case.with(name, Faulty::of_pdf(case.bsdf.clone(), move |_, at, i, o| other.pdf(at, i, o)))
    };
    let of_pdf = |case: &Case, name: &str, fault: fn(f64, DVec3, DVec3, DVec3) -> f64| {
        let fault = Faulty::of_pdf(case.bsdf.clone(), move |pdf, at, i, o| fault(pdf, at.normals.facing(i), -i, o));
        case.with(name, fault)
    };
    let water = material(json!({"rough_dielectric": {"index_of_refraction": 1.33, "roughness": 0.3_f64.sqrt()}}));
    let densities = [
        of_other(&coated, "the facets alone", white_conductor(0.3)),
        of_other(&coated, "the base alone", diffuse()),
        of_other(&metal, "alpha for roughness", white_conductor(0.5)),
        of_other(&glass, "another index", water),
        of_pdf(&metal, "no Jacobian of reflection", |pdf, _, view, light| {
            pdf * 4.0 * view.dot((view + light).normalize())
        }),
        of_pdf(&metal, "masked twice", |pdf, normal, _, light| {
            let cosine = light.dot(normal);
            pdf * Ggx { alpha: 0.25 }.masking(DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine))
        }),
        of_pdf(
            &glass,
            "no squared ratio",
            |pdf, normal, _, light| {
                if light.dot(normal) < 0.0 { pdf / (GLASS * GLASS) } else { pdf }
            },
        ),
    ];
    for case in densities {
        let findings = examine(&case);
        assert!(findings.probability < 1e-9, "{}: {findings:?}", case.name);
    }
    let bright = [glass, metal, coated].map(|case| {
        let bright = Faulty::of_eval(case.bsdf.clone(), |value, _, _, _| value * 1.02);
        case.with("too bright", bright)
    });
    for case in bright {
        let findings = examine(&case);
        assert!(findings.errors > 2.0 * MOST_ERRORS && findings.contradiction > 0.01, "{}: {findings:?}", case.name);
    }
}

#[test]
fn matt_materials_scatter_their_albedo() {
    for case in scattering().iter().filter(|case| case.name.starts_with("diffuse") || case.name.starts_with("parch")) {
        let [reflected, transmitted] = case.cells().map(|cells| cells.integral(&|way| case.value(way).to_array()));
        let sum = DVec3::from(reflected) + DVec3::from(transmitted);
        assert!((sum - case.bsdf.albedo(&case.at)).length() < 1e-3, "{}: {sum}", case.name);
    }
}

/// The part of light that is reflected, in the channel that is farthest from 1.
fn furnace(case: &Case) -> f64 {
    let [reflected, _] = case.cells();
    let parts = reflected.integral(&|way| case.value(way).to_array());
    parts
        .into_iter()
        .fold(1.0, |farthest, part| if (part - 1.0_f64).abs() > (farthest - 1.0_f64).abs() { part } else { farthest })
}

#[test]
fn white_surfaces_reflect_all_light() {
    let gltf = [
        json!({"metallic": 0}),
        json!({"metallic": 0, "index_of_refraction": 2.5}),
        json!({"metallic": 0, "index_of_refraction": 0}),
        json!({"metallic": 0, "specular": 0.5}),
        json!({"metallic": 0.5}),
        json!({}),
    ];
    let mut cases = Vec::new();
    for (alpha, cosine) in ALPHAS.into_iter().flat_map(|alpha| COSINES.map(|cosine| (alpha, cosine))) {
        cases.push(Case::flat("conductor", white_conductor(alpha), alpha, cosine));
        let of = |members| Case::flat(&format!("{members}"), metallic_roughness(alpha, members), alpha, cosine);
        cases.extend(gltf.iter().map(of));
    }
    let reflected: Vec<f64> = cases.par_iter().map(furnace).collect();
    let off = |part: f64| (part - 1.0).abs();
    let worst = (0..cases.len()).max_by(|a, b| off(reflected[*a]).total_cmp(&off(reflected[*b]))).unwrap();
    println!("farthest from 1: {} of {}", reflected[worst], cases[worst].name);
    assert!(off(reflected[worst]) < 0.005, "{}: {}", cases[worst].name, reflected[worst]);

    let wall = json!({"metallic": 0, "transmission": 1});
    for (alpha, cosine) in ALPHAS.into_iter().flat_map(|alpha| COSINES.map(|cosine| (alpha, cosine))) {
        let flat = Case::flat("wall", metallic_roughness(alpha, &wall), alpha, cosine);
        let case = Case { index_behind: 1.0, ..flat };
        let [parts, through] = case.cells().map(|cells| cells.integral(&|way| case.value(way).to_array()));
        assert!((parts[0] + through[0] - 1.0).abs() < 0.005, "alpha {alpha}, cosine {cosine}: {parts:?} {through:?}");
    }

    // Without what several facets reflect.
    let once = Faulty::of_eval(white_conductor(0.3), |_, at, incident, outgoing| {
        let frame = crate::geometry::Frame::around(at.normals.geometric);
        let [view, light] = [-incident, outgoing].map(|way| frame.vector_to_local(way));
        let facets = Ggx { alpha: 0.3 };
        let half = (view + light).normalize();
        DVec3::splat(facets.distribution(half) * facets.visibility(view, light) * light.z)
    });
    assert!(furnace(&Case::flat("once", once, 0.3, 0.5)) < 0.97);
}

/// The integral of what one sees of the facets over all directions into which they mirror light.
fn weak_furnace(seen: Ggx, facets: Ggx, view: DVec3) -> f64 {
    let axis = DVec3::new(-view.x, -view.y, view.z);
    [1.0, -1.0]
        .map(|side| {
            let cells = Cells::new(axis, 2.0 * facets.alpha, DVec3::Z * side);
            let [sum] = cells.integral(&|light| {
                let half = (view + light).normalize();
                let density = facets.distribution(half) * seen.masking_over_cosine(view) / 4.0;
                [if half.z > 0.0 { density } else { 0.0 }]
            });
            sum
        })
        .iter()
        .sum()
}

#[test]
fn the_facets_that_are_seen_cover_the_view() {
    for (alpha, cosine) in ALPHAS.into_iter().flat_map(|alpha| COSINES.map(|cosine| (alpha, cosine))) {
        let view = DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
        let facets = Ggx { alpha };
        let sum = weak_furnace(facets, facets, view);
        assert!((sum - 1.0).abs() < 0.005, "alpha {alpha} at cosine {cosine}: {sum}");
        if (0.1..1.0).contains(&alpha) && cosine < 0.5 {
            let sum = weak_furnace(Ggx { alpha: alpha.sqrt() }, facets, view);
            assert!((sum - 1.0).abs() > 0.01, "roughness for alpha {alpha} at cosine {cosine}: {sum}");
        }
    }
}

/// Pairs of directions in front of a flat surface.
fn pairs() -> impl Iterator<Item = [DVec3; 2]> {
    (0..200).map(|index| {
        let mut stream = stream(index);
        [stream.next_2d(), stream.next_2d()].map(|DVec2 { x, y }| direction(x.max(0.01), y * std::f64::consts::TAU))
    })
}

/// Largest relative difference when the ways of light are reversed.
fn irreciprocity(bsdf: &dyn Bsdf, index_behind: f64) -> f64 {
    let at = tilted(0.0);
    let normal = at.normals.geometric;
    // BSDF between two directions away from the surface, for radiance that goes from the second to the first.
    let between = |to: DVec3, from: DVec3| bsdf.scale(&at) * bsdf.eval(&at, -to, from) / from.dot(normal).abs();
    let mut largest: f64 = 0.0;
    for [one, other] in pairs() {
        let mut compare = |forth: DVec3, back: DVec3| {
            largest = largest.max((forth - back).length() / (forth + back).length().max(1e-9));
        };
        compare(between(one, other), between(other, one));
        if bsdf.transmits() {
            // Radiance over the squared index is what is kept.
            compare(between(one, -other) * (index_behind * index_behind), between(-other, one));
        }
    }
    largest
}

#[test]
fn light_takes_the_same_ways_in_both_directions() {
    for alpha in ALPHAS {
        for bsdf in [white_conductor(alpha), half_metal(alpha), plastic(alpha), rough_glass(alpha)] {
            let found = irreciprocity(&*bsdf, GLASS);
            assert!(found < 1e-9, "{bsdf:?}: {found}");
        }
        let found = irreciprocity(&*frosted(alpha), 1.0);
        assert!(found < 1e-9, "frosted: {found}");
    }
    assert!(irreciprocity(&*diffuse(), GLASS) < 1e-12);
    assert!(irreciprocity(&*translucent(), 1.0) < 1e-12);
    // What is scaled by the albedo of the view alone, as Turquin does.
    let one_sided = Faulty::of_eval(plastic(0.5), |value, at, incident, _| value * at.normals.geometric.dot(incident));
    assert!(irreciprocity(&*one_sided, GLASS) > 0.01);
}

/// Largest value or density in a direction through the triangle.
fn leak(case: &Case) -> f64 {
    let mut largest: f64 = 0.0;
    let facing = case.at.normals.facing(case.incident);
    for index in 0..4000 {
        let mut stream = stream(index);
        let DVec2 { x, y } = stream.next_2d();
        let way = direction(2.0 * x - 1.0, y * std::f64::consts::TAU);
        let (value, density) = (case.value(way), case.bsdf.pdf(&case.at, case.incident, way));
        assert!(value.is_finite() && value.min_element() >= 0.0, "{}: {value}", case.name);
        assert!(density.is_finite() && density >= 0.0, "{}: {density}", case.name);
        if way.dot(facing) < 0.0 {
            largest = largest.max(value.max_element()).max(density);
        }
        if let Some(sample) = case.bsdf.sample(&case.at, case.incident, &mut stream) {
            assert!((sample.direction.length() - 1.0).abs() < 1e-12 && sample.weight.is_finite(), "{}", case.name);
            if sample.direction.dot(facing) < 0.0 {
                largest = f64::INFINITY;
            }
        }
    }
    largest
}

#[test]
fn no_light_goes_through_a_triangle_whose_normals_contradict_each_other() {
    for case in scattering() {
        let tilted = Case { at: tilted(80.0), ..case };
        let leaked = leak(&tilted);
        assert!(tilted.bsdf.transmits() || leaked == 0.0, "{}: {leaked}", tilted.name);
    }
    // Sides by the interpolated normal.
    let flattened = |at: &super::SurfacePoint| {
        let normals = super::Normals { geometric: at.normals.shading, shading: at.normals.shading };
        super::SurfacePoint { normals, ..*at }
    };
    let inner = plastic(0.5);
    let leaking = Faulty::of_eval(plastic(0.5), move |_, at, i, o| inner.eval(&flattened(at), i, o));
    assert!(leak(&Case { at: tilted(80.0), ..Case::flat("leaking", leaking, 0.5, 0.8) }) > 0.01);
}
