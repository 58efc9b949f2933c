//! What a window of twenty thousand quarries costs.
//!
//! The first figure is the time to build such a window with its lead, and the memory that this takes. The second is
//! relMSE times core seconds of a sheet that is cut in place into 4 to 20,000 pieces, the largest over the smallest.
//! Both are medians of some runs.

use std::collections::BTreeMap;
use std::error::Error;
use std::time::Instant;

use clap::Parser;
use clerestory_render_core::document::SceneBundle;
use clerestory_render_core::document::window_scene::{window_of, window_scene};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_tests::cut_sheet::CutSheet;
use clerestory_tests::reference::Image;
use clerestory_tests::rendering::Rendering;
use serde_json::json;

/// Prints what a window of twenty thousand quarries costs.
#[derive(Parser)]
struct Arguments {
    /// Runs of which the median is printed.
    #[arg(long, default_value_t = 5)]
    runs: usize,
    /// Passes of each picture, of four samples.
    #[arg(long, default_value_t = 4)]
    passes: u32,
}

/// Pieces across and up the sheet.
const PIECES: [[u32; 2]; 4] = [[2, 2], [4, 16], [20, 50], [100, 200]];

type Failure = Box<dyn Error + Send + Sync>;

fn main() -> Result<(), Failure> {
    let Arguments { runs, passes } = Arguments::parse();
    build(runs)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build()?;
    pool.install(|| pictures(runs, passes))
}

/// Builds the window on all cores.
fn build(runs: usize) -> Result<(), Failure> {
    let bundle = window()?;
    let mut times = Vec::new();
    let mut quarries = 0;
    for _ in 0..runs {
        let start = Instant::now();
        let scene = PreparedScene::build(&bundle)?;
        times.push(start.elapsed().as_secs_f64());
        quarries = scene.scene().panes().len();
    }
    let (seconds, memory) = (median(&mut times), peak_memory()?);
    println!("{quarries} quarries in lead: built in {seconds:.2} s (goal: 5), with {memory} MiB (goal: 1024)");
    Ok(())
}

/// A wall of glass of 20,000 rectangular quarries with lead.
fn window() -> Result<SceneBundle, Failure> {
    let design = serde_json::from_value(json!({
        "opening": {"arch": {"width": 10, "height": 20}},
        "filling": {"rectangles": {"width": 0.1, "height": 0.1, "offset": 0}}
    }))?;
    let scene = window_scene(window_of(design, BTreeMap::new()))?;
    Ok(SceneBundle::from_parts(scene, BTreeMap::new())?)
}

fn pictures(runs: usize, passes: u32) -> Result<(), Failure> {
    let mut ratios = Vec::new();
    for run in 0..runs {
        let seed = 100 * run as u64;
        let mut costs = Vec::new();
        for pieces in PIECES {
            let (first, seconds) = picture(pieces, seed, passes)?;
            let (second, _) = picture(pieces, seed + 1, passes)?;
            let error = first.relative_error(&second);
            println!("{} pieces: relMSE {error:.3e} in {seconds:.2} s", pieces[0] * pieces[1]);
            costs.push(error * seconds);
        }
        costs.sort_by(f64::total_cmp);
        ratios.push(costs[PIECES.len() - 1] / costs[0]);
    }
    println!("4 to 20000 pieces: largest cost {:.2} times the smallest (goal: at most 1.5)", median(&mut ratios));
    Ok(())
}

/// A picture, and the core seconds that it took without those of building the scene.
fn picture(pieces: [u32; 2], seed: u64, passes: u32) -> Result<(Image, f64), Failure> {
    let scene = PreparedScene::build(&CutSheet { pieces, integrator: "auto", samples: 4, seed }.scene())?;
    let start = Instant::now();
    let mut rendering = Rendering::new(&scene);
    for _ in 0..passes {
        rendering.render_pass()?;
    }
    Ok((rendering.image(), start.elapsed().as_secs_f64()))
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The most memory that this process has taken, MiB.
fn peak_memory() -> Result<u64, Failure> {
    let status = std::fs::read_to_string("/proc/self/status")?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).ok_or("no VmHWM in /proc/self/status")?;
    Ok(line.trim().trim_end_matches("kB").trim().parse::<u64>()? / 1024)
}
