//! What a rough dielectric loses, because light that meets several facets is left out.

use rayon::prelude::*;

use super::cases::{ALPHAS, COSINES, Case, GLASS, rough_glass};

/// The part of the power that is scattered, for light from a direction with this cosine to the normal.
fn scattered(alpha: f64, cosine: f64) -> f64 {
    let case = Case::flat("glass", rough_glass(alpha), alpha, cosine);
    let [reflected, transmitted] = case.cells().map(|cells| {
        let [sum] = cells.integral(&|direction| [case.value(direction).x]);
        sum
    });
    // Radiance grows with the square of the index behind the boundary, power does not.
    let ratio = if cosine > 0.0 { GLASS } else { 1.0 / GLASS };
    reflected + transmitted * ratio * ratio
}

#[test]
fn a_rough_dielectric_scatters_no_more_light_than_arrives() {
    let cases: Vec<(f64, f64)> = ALPHAS
        .into_iter()
        .flat_map(|alpha| COSINES.into_iter().flat_map(move |cosine| [(alpha, cosine), (alpha, -cosine)]))
        .collect();
    let parts: Vec<f64> = cases.par_iter().map(|(alpha, cosine)| scattered(*alpha, *cosine)).collect();
    for ((alpha, cosine), part) in cases.into_iter().zip(parts) {
        assert!(part < 1.0005, "alpha {alpha} at cosine {cosine}: {part}");
        assert!(alpha > 0.02 || cosine.abs() < 0.5 || part > 0.99, "alpha {alpha} at cosine {cosine}: {part}");
    }
}

#[test]
fn the_scene_format_says_how_much_light_a_rough_dielectric_loses() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/scene-format.md");
    let text = std::fs::read_to_string(path).unwrap();
    let rows: Vec<String> = [0.2_f64, 0.4, 0.6, 0.8, 1.0]
        .into_par_iter()
        .map(|roughness| {
            let lost = |cosine| 100.0 * (1.0 - scattered(roughness * roughness, cosine));
            let percent = [1.0, 0.5, -1.0, -0.5].map(|cosine| format!("{:.1} %", lost(cosine).abs()));
            format!("| {roughness} | {} |", percent.join(" | "))
        })
        .collect();
    println!("{}", rows.join("\n"));
    for row in rows {
        assert!(text.contains(&row), "docs/scene-format.md lacks the row {row}");
    }
}
