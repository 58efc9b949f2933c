//! Renders reference images of a scene lit by the sun through old glass, by `cone`.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use clerestory_render_core::document;
use clerestory_tests::sun_scene::{self, SunScene};
use indicatif::{ProgressBar, ProgressStyle};

/// Renders reference images of a scene lit by the sun through old glass, by `cone`, with their standard error.
#[derive(Parser)]
struct Arguments {
    /// The scene file.
    #[arg(default_value = "scenes/room.json")]
    scene: PathBuf,
    /// Angular radii of the sun, degrees.
    #[arg(long, value_delimiter = ',', default_value = "0.27,1,3")]
    angles: Vec<f64>,
    /// Size of the images.
    #[arg(long, value_delimiter = 'x', default_value = "96x72")]
    size: Vec<u32>,
    /// Samples in each pixel, at least.
    #[arg(long, default_value_t = 4096)]
    samples: u32,
    /// Where the images go.
    #[arg(long, default_value = "scenes/room")]
    output: PathBuf,
}

/// Far from the seeds of the renders that are compared with the reference.
const SEED: u64 = 1_000_000;

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    let bundle = document::load(&arguments.scene)?;
    let [width, height] = arguments.size[..] else { return Err("--size takes WIDTHxHEIGHT".into()) };
    let style = ProgressStyle::with_template("{msg} {wide_bar} {percent} % {elapsed} (about {eta} left)")?;
    for &angular_radius in &arguments.angles {
        let variant =
            SunScene { angular_radius, integrator: "cone", seed: SEED, size: [width, height], path_filter: None };
        let scene = variant.build(&bundle)?;
        let progress =
            ProgressBar::new(1000).with_style(style.clone()).with_message(format!("{angular_radius} degrees"));
        let told = |part: f64| progress.set_position((part * 1000.0) as u64);
        let reference = sun_scene::render_reference(&scene, arguments.samples, told)?;
        progress.finish_and_clear();
        let file = sun_scene::reference_file(&arguments.output, angular_radius);
        reference.write(&file)?;
        println!("wrote {}", file.display());
    }
    Ok(())
}
