//! The noise of `auto` and of `light` beside LuxCore's engines, in the same core time, on scenes that `clerestory
//! export` wrote. Writes a page with a table for each scene.
//!
//! ```text
//! tests/run luxcore
//! target/release/luxcore --python target/luxcore/bin/python --page page.md room
//! ```

use std::error::Error;
use std::fmt::Write;
use std::fs;
use std::path::PathBuf;

use clap::Parser;
use clerestory_experiments::Machine;
use clerestory_experiments::pairs::{Pair, SIZE, find, rendered_by};
use clerestory_experiments::ratio::Logarithm;
use clerestory_tests::luxcore::{ENGINES, Exported, Noise, noise, ours};
use glam::DVec3;

/// Compares noise with that of LuxCore.
#[derive(Parser)]
struct Arguments {
    /// A Python with the packages pyluxcore, numpy and pillow.
    #[arg(long)]
    python: PathBuf,
    /// The page to write.
    #[arg(long)]
    page: PathBuf,
    /// Core seconds of each picture.
    #[arg(long, default_value_t = 20.0)]
    seconds: f64,
    /// Pairs of pictures by each method.
    #[arg(long, default_value_t = 5)]
    pairs: u32,
    /// Names of pairs of a scene and its lights.
    #[arg(default_values = ["room", "chapel"])]
    scenes: Vec<String>,
}

/// Largest distance of the triangles of a pane from its faces, metres.
const TOLERANCE: f64 = 5e-6;

/// The share of the error of others that `auto` is to have.
const GOAL: f64 = 1.0 / 3.0;

const INTRODUCTION: &str = "\
# `auto` and LuxCore

`tests/run luxcore` measures again and writes this page.

Scenes are exported, and rendered by LuxCore 2.11 with Metropolis sampling, on one thread, for the same core time as
ours. `HYBRID` is its path tracer with light tracing for caustics. Errors are half the squared difference of two
pictures, so what LuxCore lacks or renders in another way is no error. The column *brightness* shows it: the mean over
that of `auto`. What LuxCore's light tracing leaves black counts for nothing: what the camera sees through glass. Ratios
have intervals of 95 percent, by the jackknife over the pairs of pictures. The goal is that `auto` has a third of the
error of `light` and of LuxCore's best.
";

/// The pictures of a method.
struct Rendered {
    method: String,
    pairs: Vec<[Vec<DVec3>; 2]>,
}

/// A row of the table.
struct Measured {
    method: String,
    brightness: f64,
    noises: Vec<Noise>,
}

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let arguments = Arguments::parse();
    let machine = serde_json::to_value(Machine::this(env!("CARGO_PKG_VERSION")))?;
    let processor = machine["processor"].as_str().unwrap_or("unknown");
    let Arguments { seconds, pairs, .. } = &arguments;
    let mut page =
        format!("{INTRODUCTION}\n{processor}, {seconds} core seconds a picture, {pairs} pairs by each method.\n");
    for name in &arguments.scenes {
        let pair = find(name).ok_or_else(|| format!("found no pair {name}"))?;
        let table = table(&measure(pair, &arguments)?)?;
        println!("{name}\n{table}");
        write!(page, "\n## {name}\n\n{table}")?;
        fs::write(&arguments.page, &page)?;
    }
    Ok(())
}

/// What all methods make of a scene; `auto` and `light` come first.
fn measure(pair: &Pair, arguments: &Arguments) -> Result<Vec<Measured>, Box<dyn Error + Send + Sync>> {
    let Arguments { python, seconds, pairs, .. } = arguments;
    let bundle = pair.bundle(SIZE)?;
    let exported = Exported::new(&bundle, TOLERANCE);
    let mut all: Vec<Rendered> = Vec::new();
    for method in ["auto", "light"] {
        let picture = |seed: u32| -> Result<_, Box<dyn Error + Send + Sync>> {
            Ok(ours(&rendered_by(&bundle, method, seed.into())?, *seconds))
        };
        let pairs = (0..*pairs).map(|number| Ok([picture(2 * number + 1)?, picture(2 * number + 2)?]));
        let pairs = pairs.collect::<Result<_, Box<dyn Error + Send + Sync>>>()?;
        all.push(Rendered { method: method.to_owned(), pairs });
    }
    for engine in ENGINES {
        let picture = |seed| exported.render(python, engine, seed, *seconds);
        let pairs = (0..*pairs).map(|number| [2 * number + 1, 2 * number + 2].map(picture)).collect();
        all.push(Rendered { method: engine.to_owned(), pairs });
    }
    let mean = mean(&all[0]);
    let traced = all.iter().find(|rendered| rendered.method == ENGINES[0]);
    let counts: Vec<bool> = traced.map_or_else(Vec::new, |traced| {
        (0..mean.len())
            .map(|pixel| traced.pairs.iter().flatten().any(|picture| picture[pixel] != DVec3::ZERO))
            .collect()
    });
    let light = |picture: &[DVec3]| {
        let counted = picture.iter().zip(&counts).filter(|(_, counts)| **counts);
        counted.map(|(pixel, _)| pixel.element_sum()).sum::<f64>()
    };
    Ok(all
        .iter()
        .map(|rendered| Measured {
            method: rendered.method.clone(),
            brightness: light(&self::mean(rendered)) / light(&mean),
            noises: rendered.pairs.iter().map(|pair| noise(pair, &mean, &counts)).collect(),
        })
        .collect())
}

/// The mean of all pictures.
fn mean(rendered: &Rendered) -> Vec<DVec3> {
    let count = 2.0 * rendered.pairs.len() as f64;
    let mut sum = vec![DVec3::ZERO; rendered.pairs.first().map_or(0, |[first, _]| first.len())];
    for picture in rendered.pairs.iter().flatten() {
        sum.iter_mut().zip(picture).for_each(|(sum, pixel)| *sum += *pixel / count);
    }
    sum
}

/// The table of a scene.
fn table(measured: &[Measured]) -> Result<String, std::fmt::Error> {
    let values = |measured: &Measured, of: fn(&Noise) -> f64| measured.noises.iter().map(of).collect::<Vec<_>>();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let errors: [fn(&Noise) -> f64; 2] = [|noise| noise.mse, |noise| noise.relative];
    let mut table =
        "| method | brightness | MSE | relMSE | MSE of auto over it | relMSE of auto over it |\n".to_owned();
    table += "| --- | ---: | ---: | ---: | ---: | ---: |\n";
    for row in measured {
        write!(table, "| {} | {:.3} |", row.method, row.brightness)?;
        for of in errors {
            write!(table, " {:.2e} |", mean(&values(row, of)))?;
        }
        for of in errors {
            let logarithms = [&measured[0], row].map(|measured| Logarithm::of_mean(&values(measured, of)));
            match logarithms {
                [Some(auto), Some(other)] if row.method != measured[0].method => {
                    let ratio = auto.over(other).interval();
                    let verdict = if ratio.lower <= GOAL { "met" } else { "missed" };
                    write!(table, " {:.2} [{:.2}, {:.2}] {verdict} |", ratio.estimate, ratio.lower, ratio.upper)?;
                }
                _ => table += " |",
            }
        }
        table += "\n";
    }
    Ok(table)
}
