//! Whether Mitsuba 3 renders the pictures that we render, of scenes that `clerestory export` wrote.
//!
//! Prints a line for each scene. Then faults are planted into exported scenes, which must be noticed. It fails when a
//! scene disagrees, or a fault goes unnoticed.
//!
//! ```text
//! tests/run parity
//! target/release/parity --python target/mitsuba/bin/python box glass
//! ```

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use clerestory_tests::parity::mitsuba::Exported;
use clerestory_tests::parity::pictures::Pictures;
use clerestory_tests::parity::scenes::ParityScene;
use clerestory_tests::parity::statistic::Parity;

/// Compares pictures of exported scenes with those of Mitsuba.
#[derive(Parser)]
struct Arguments {
    /// A Python with the packages mitsuba and numpy.
    #[arg(long)]
    python: PathBuf,
    /// A few scenes in small pictures.
    #[arg(long)]
    small: bool,
    /// All scenes in pictures of this height, pixels.
    #[arg(long, default_value_t = 128, conflicts_with = "small")]
    height: u32,
    /// Names of scenes [default: all].
    scenes: Vec<String>,
}

fn main() -> ExitCode {
    let Arguments { python, small, height, scenes: names } = Arguments::parse();
    let (all, height, part, pictures) =
        if small { (ParityScene::few(), 64, 4, 8) } else { (ParityScene::all(), height, 1, 16) };
    let all: Vec<ParityScene> = all.into_iter().map(|scene| scene.with_size(height, part)).collect();
    let known: Vec<&str> = all.iter().map(|scene| scene.name).collect();
    if let Some(unknown) = names.iter().find(|name| !known.contains(&name.as_str())) {
        eprintln!("found no scene {unknown}, expected one of {}", known.join(", "));
        return ExitCode::from(2);
    }
    let mut is_right = true;
    for scene in all.iter().filter(|scene| names.is_empty() || names.iter().any(|name| *name == scene.name)) {
        let ours = Pictures::render(&scene.prepared(), pictures);
        let exported = Exported::new(scene);
        let parity = Parity::of(&ours, &exported.render(&python, scene.samples, 0, pictures));
        println!("{:<14} {parity}{}", scene.name, if parity.holds() { "" } else { ": DISAGREES" });
        is_right &= parity.holds();
        if let Some(fault) = &scene.fault {
            exported.plant(fault);
            let parity = Parity::of(&ours, &exported.render(&python, scene.samples, 1000, pictures));
            println!("  with {}: {parity}{}", fault.name, if parity.holds() { ": NOT NOTICED" } else { ", noticed" });
            is_right &= !parity.holds();
        }
    }
    if is_right { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
