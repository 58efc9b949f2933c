//! The noise of `auto` and of `light` beside LuxCore's engines, in the same core time, on scenes that `clerestory
//! export` wrote. Prints a line for each, and how `auto` compares with the best of the others.
//!
//! ```text
//! tests/run luxcore
//! target/release/luxcore --python target/luxcore/bin/python room
//! ```

use std::path::PathBuf;

use clap::Parser;
use clerestory_experiments::pairs::{SIZE, find, rendered_by};
use clerestory_tests::luxcore::{ENGINES, Exported, Noise, noise, ours};
use glam::DVec3;

/// Compares noise with that of LuxCore.
#[derive(Parser)]
struct Arguments {
    /// A Python with the packages pyluxcore, numpy and pillow.
    #[arg(long)]
    python: PathBuf,
    /// Core seconds of each picture. Two make the noise.
    #[arg(long, default_value_t = 60.0)]
    seconds: f64,
    /// Names of pairs of a scene and its lights.
    #[arg(default_values = ["room", "chapel"])]
    scenes: Vec<String>,
}

/// Largest distance of the triangles of a pane from its faces, metres.
const TOLERANCE: f64 = 5e-6;

fn main() -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    let Arguments { python, seconds, scenes } = Arguments::parse();
    for name in &scenes {
        let pair = find(name).ok_or_else(|| format!("found no pair {name}"))?;
        let bundle = pair.bundle(SIZE)?;
        let mut pictures: Vec<(String, [Vec<DVec3>; 2])> = Vec::new();
        for method in ["auto", "light"] {
            let [first, second] = [1, 2].map(|seed| rendered_by(&bundle, method, seed));
            pictures.push((method.to_owned(), [ours(&first?, seconds), ours(&second?, seconds)]));
        }
        let exported = Exported::new(&bundle, TOLERANCE);
        for engine in ENGINES {
            let both = [1, 2].map(|seed| exported.render(&python, engine, seed, seconds));
            pictures.push((engine.to_owned(), both));
        }
        let mean: Vec<DVec3> = pictures[0].1[0].iter().zip(&pictures[0].1[1]).map(|(a, b)| (*a + *b) * 0.5).collect();
        // LuxCore's light tracing leaves black what the camera sees through glass.
        let [first, second] = &pictures[2].1;
        let counts: Vec<bool> = first.iter().zip(second).map(|(a, b)| *a + *b != DVec3::ZERO).collect();
        let noises: Vec<Noise> = pictures.iter().map(|(_, both)| noise(both, &mean, &counts)).collect();
        for ((method, _), Noise { mse, relative }) in pictures.iter().zip(&noises) {
            println!("{name}, {seconds} core seconds: {method:<9} MSE {mse:.2e}, relMSE {relative:.2e}");
        }
        let best = |of: fn(&Noise) -> f64, others: &[Noise]| {
            of(&noises[0]) / others.iter().map(of).fold(f64::INFINITY, f64::min)
        };
        for (peer, others) in [("light", &noises[1..2]), ("LuxCore's best", &noises[2..])] {
            let [mse, relative] = [best(|noise| noise.mse, others), best(|noise| noise.relative, others)];
            println!("{name}: auto has {mse:.2} of the MSE of {peer}, {relative:.2} of its relMSE (goal: 0.33)");
        }
    }
    Ok(())
}
