//! Computes a reference image by tracing light forward.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use clerestory_tests::forward_tracer::{Fault, Tracing, trace};
use clerestory_tests::reference::Reference;
use clerestory_tests::traced_scene::TracedScene;
use indicatif::ProgressBar;

/// Computes a reference image by tracing light forward, from the lights through one pane onto diffuse surfaces.
#[derive(Parser)]
struct Arguments {
    /// The scene file.
    scene: PathBuf,
    /// The image to write.
    #[arg(short, long)]
    output: PathBuf,
    /// Photons in all.
    #[arg(long, default_value_t = 200_000_000)]
    photons: u64,
    /// Independent batches, an even number.
    #[arg(long, default_value_t = 16)]
    batches: u32,
    /// Seed of every random number.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let mut message = error.to_string();
            let mut cause = error.source();
            while let Some(error) = cause {
                message = format!("{message}: {error}");
                cause = error.source();
            }
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    let scene = TracedScene::load(&arguments.scene)?;
    let spinner = ProgressBar::new_spinner().with_message(format!("tracing {} photons", arguments.photons));
    spinner.enable_steady_tick(Duration::from_millis(200));
    let Arguments { photons, batches, seed, .. } = *arguments;
    let batches = trace(&scene, &Tracing { photons, batches, seed, fault: Fault::None });
    let reference = Reference::from_batches(&batches);
    spinner.finish_and_clear();
    reference.write(&arguments.output)?;
    let mean = reference.mean.pixels.iter().sum::<glam::DVec3>() / reference.mean.pixels.len() as f64;
    println!("{}: mean radiance {:.7e} {:.7e} {:.7e}", arguments.output.display(), mean.x, mean.y, mean.z);
    Ok(())
}
