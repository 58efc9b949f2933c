//! What a window that is cut into many panes costs, in daylight.
//!
//! The figure is relMSE times core seconds of a room whose window has 300 panes, over that of one pane of the same
//! area. It is a median of some runs.

use std::error::Error;
use std::time::Instant;

use clap::Parser;
use clerestory_tests::daylit_room::daylit_room;
use clerestory_tests::reference::Image;
use clerestory_tests::rendering::Rendering;

/// Prints what a window of many panes costs.
#[derive(Parser)]
struct Arguments {
    /// Runs of which the median is printed.
    #[arg(long, default_value_t = 5)]
    runs: usize,
    /// Passes of each run, of four samples.
    #[arg(long, default_value_t = 64)]
    passes: u32,
}

/// The window as a whole, and cut into 300 panes.
const PANES: [[u32; 2]; 2] = [[1, 1], [20, 15]];

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let Arguments { runs, passes } = Arguments::parse();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build()?;
    pool.install(|| {
        let mut ratios = Vec::new();
        for run in 0..runs {
            let seed = 100 * run as u64;
            let mut costs = [0.0; 2];
            for (cost, panes) in costs.iter_mut().zip(PANES) {
                let (first, seconds) = picture(panes, seed, passes)?;
                let (second, _) = picture(panes, seed + 1, passes)?;
                let error = first.relative_error(&second);
                *cost = error * seconds;
                println!("{} x {} panes: relMSE {error:.3e} in {seconds:.2} s", panes[0], panes[1]);
            }
            ratios.push(costs[1] / costs[0]);
        }
        ratios.sort_by(f64::total_cmp);
        println!("300 panes: {:.2} times the cost of one (goal: at most 1.5)", ratios[ratios.len() / 2]);
        Ok(())
    })
}

fn picture(panes: [u32; 2], seed: u64, passes: u32) -> Result<(Image, f64), Box<dyn Error + Send + Sync>> {
    let scene = daylit_room(panes, "cone", 4, seed);
    let start = Instant::now();
    let mut rendering = Rendering::new(&scene);
    for _ in 0..passes {
        rendering.render_pass()?;
    }
    Ok((rendering.image(), start.elapsed().as_secs_f64()))
}
