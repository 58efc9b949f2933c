//! The commands: one file for each, with its options and what it does.

pub(crate) mod bench;
pub(crate) mod cancel;
pub(crate) mod compare;
pub(crate) mod coordinator;
pub(crate) mod demo;
pub(crate) mod farm;
pub(crate) mod jobs;
pub(crate) mod release;
pub(crate) mod render;
pub(crate) mod scene;
pub(crate) mod submit;
pub(crate) mod view;
pub(crate) mod watch;
pub(crate) mod worker;

use crate::arguments::Command;
use crate::failure::Failure;

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
        Command::Bench(arguments) => bench::run(arguments).await,
        Command::Scene(arguments) => scene::run(&arguments),
        Command::View(arguments) => view::run(arguments).await,
        Command::Demo(arguments) => demo::run(arguments).await,
    }
}
