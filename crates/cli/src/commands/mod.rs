//! The commands: one file for each with its options. [`Command`] is the one list.

mod bench;
mod cancel;
mod compare;
mod convert;
mod coordinator;
mod demo;
mod export;
mod farm;
mod import;
mod jobs;
mod release;
mod render;
mod scene;
mod submit;
mod sun;
mod view;
mod watch;
mod window;
mod worker;

use clap::Subcommand;

use crate::failure::Failure;
use crate::job_argument::OneJob;

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Render a scene in this process, without a farm.
    Render(render::RenderArguments),
    /// Run the coordinator: queue, merge, HTTP API and dashboard.
    Coordinator(coordinator::CoordinatorArguments),
    /// Run a worker: lease, render, upload.
    Worker(worker::WorkerArguments),
    /// Run a coordinator and workers on this machine.
    Farm(farm::FarmArguments),
    /// Submit a scene to a farm.
    Submit(submit::SubmitArguments),
    /// List the jobs of a farm.
    Jobs(jobs::JobsArguments),
    /// Watch a job until it ends.
    Watch(watch::WatchArguments),
    /// Cancel a job; what is complete is kept.
    Cancel(OneJob),
    /// Get a job going again that is held because workers died with it.
    Release(OneJob),
    /// Measure how far an image is from a reference.
    Compare(compare::CompareArguments),
    /// Make a PNG of an OpenEXR image: another exposure, another layer, a part of it.
    Convert(convert::ConvertArguments),
    /// Write a scene as a folder of files that other programs read.
    Export(export::ExportArguments),
    /// Measure again what papers show.
    Bench(bench::BenchArguments),
    /// Write a scene around a building or another model: a glTF or OBJ file.
    Import(import::ImportArguments),
    /// Write a scene that is computed.
    Scene(scene::SceneArguments),
    /// Say where the sun stands at a place and a moment, and what clocks of all kinds show.
    Sun(sun::SunArguments),
    /// Look at a scene in the browser: move the camera and the sun, and watch the picture become clear.
    View(view::ViewArguments),
    /// Start a farm on this machine, render sunlight through four old panes on it, and show the error falling.
    Demo(demo::DemoArguments),
}

impl Command {
    /// Whether the command serves until it is stopped, so that its log says what it does.
    pub(crate) fn is_service(&self) -> bool {
        matches!(self, Self::Coordinator(_) | Self::Worker(_) | Self::Farm(_))
    }
}

/// Runs a command.
pub(crate) async fn run(command: Command) -> Result<(), Failure> {
    match command {
        Command::Render(arguments) => render::run(arguments).await,
        Command::Coordinator(arguments) => coordinator::run(arguments).await,
        Command::Worker(arguments) => worker::run(arguments).await,
        Command::Farm(arguments) => farm::run(arguments).await,
        Command::Submit(arguments) => submit::run(arguments).await,
        Command::Jobs(arguments) => jobs::run(arguments).await,
        Command::Watch(arguments) => watch::run(arguments).await,
        Command::Cancel(arguments) => cancel::run(arguments).await,
        Command::Release(arguments) => release::run(arguments).await,
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Convert(arguments) => convert::run(&arguments),
        Command::Export(arguments) => export::run(&arguments),
        Command::Bench(arguments) => bench::run(arguments).await,
        Command::Import(arguments) => import::run(&arguments),
        Command::Scene(arguments) => scene::run(&arguments),
        Command::Sun(arguments) => sun::run(&arguments),
        Command::View(arguments) => view::run(arguments).await,
        Command::Demo(arguments) => demo::run(arguments).await,
    }
}
