//! `clerestory bench`: measurements that any user can repeat.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use clap::{Args, Subcommand};
use clerestory_experiments::{self as experiments, Experiment, Session, Settings, Surroundings};
use clerestory_local_render::Control;
use rayon::ThreadPoolBuilder;
use tokio::runtime::Handle;

use crate::connection::ConnectionArguments;
use crate::experiment_host::ExperimentHost;
use crate::failure::Failure;
use crate::local_scene;
use crate::numbers::whole;
use crate::output::print_line;
use crate::output_file::create_folder;
use crate::render_limits::parse_seconds;
use crate::scene_overrides::Size;
use crate::shutdown::{self, Parent};
use crate::threads::ThreadCount;
use crate::version::BUILD;

/// Most samples of a reference: more would not end.
const MOST: u32 = 1 << 24;

/// Options of `clerestory bench`.
#[derive(Debug, Args)]
pub(crate) struct BenchArguments {
    #[command(subcommand)]
    command: BenchCommand,
}

/// What to measure.
#[derive(Debug, Subcommand)]
enum BenchCommand {
    /// Measure again what a paper shows, and write JSON, CSV, OpenEXR images and a page with figures.
    Experiment(ExperimentArguments),
}

/// Options of `clerestory bench experiment`.
#[derive(Debug, Args)]
struct ExperimentArguments {
    /// The experiment; --list shows what there is.
    #[arg(value_name = "NAME", value_parser = experiments::find, required_unless_present = "list")]
    experiment: Option<&'static Experiment>,
    /// List the experiments, and end.
    #[arg(long, conflicts_with_all =
        ["experiment", "output", "times", "seeds", "size", "reference_spp", "references", "threads", "farm"])]
    list: bool,
    /// Folder to write into [default: experiment-NAME]. References that are there already are used again.
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Render times, seconds, such as 1,2,4,8.
    #[arg(long, value_name = "SECONDS", value_delimiter = ',', value_parser = parse_seconds)]
    times: Vec<Duration>,
    /// Independent renders of each variant.
    #[arg(long, value_name = "N", value_parser = whole(1..=1000_u32))]
    seeds: Option<u32>,
    /// Size of the pictures in pixels.
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// Samples in each pixel of the references.
    #[arg(long, value_name = "N", value_parser = whole(1..=MOST))]
    reference_spp: Option<u32>,
    /// Folder of the references that `pair-references` rendered, for the experiment `regret` [default: scenes/pairs].
    #[arg(long, value_name = "FOLDER")]
    references: Option<PathBuf>,
    /// Threads that render [default: one for each core].
    #[arg(long, value_name = "N", env = "CLERESTORY_THREADS")]
    threads: Option<ThreadCount>,
    /// Render on a farm, as ordinary jobs, instead of in this process.
    #[arg(long)]
    farm: bool,
    #[command(flatten)]
    connection: ConnectionArguments,
}

pub(crate) async fn run(arguments: BenchArguments) -> Result<(), Failure> {
    match arguments.command {
        BenchCommand::Experiment(arguments) => run_experiment(arguments).await,
    }
}

async fn run_experiment(arguments: ExperimentArguments) -> Result<(), Failure> {
    let Some(experiment) = arguments.experiment else { return list() };
    let settings = interpret(experiment, &arguments)?;
    let folder = arguments.output.unwrap_or_else(|| PathBuf::from(format!("experiment-{}", experiment.name)));
    let references = arguments.references.or_else(|| experiment.defaults.references.map(PathBuf::from));
    let farm = if arguments.farm { Some((arguments.connection.open()?, Handle::current())) } else { None };
    create_folder(&folder)?;
    let pool = ThreadPoolBuilder::new().num_threads(settings.threads.get()).build().map_err(Failure::Threads)?;
    let control = Arc::new(Control::default());
    let surroundings = Surroundings {
        folder,
        references: references.unwrap_or_default(),
        pool,
        control: control.clone(),
        build_scene: |bundle| local_scene::build(bundle, &mut |_| ()),
        build: BUILD,
        host: Box::new(ExperimentHost::new(farm)),
    };
    let mut work = tokio::task::spawn_blocking(move || experiment.run(&mut Session::new(settings, surroundings)));
    let stop = shutdown::token(Parent::None);
    let result = loop {
        tokio::select! {
            result = &mut work => break result,
            () = stop.cancelled(), if !control.cancelled.load(Ordering::Relaxed) => {
                control.cancelled.store(true, Ordering::Relaxed);
            }
        }
    };
    match result {
        Ok(files) => files?.iter().try_for_each(|file| print_line(&format!("Wrote {}", file.display()))),
        Err(panic) => Err(Failure::RenderPanic(panic)),
    }
}

/// Lists the experiments.
fn list() -> Result<(), Failure> {
    let width = experiments::ALL.iter().map(|experiment| experiment.name.len()).max().unwrap_or(0);
    experiments::ALL
        .iter()
        .try_for_each(|experiment| print_line(&format!("{:width$}  {}", experiment.name, experiment.title)))
}

/// The settings of an experiment. An option for a setting that the experiment lacks is an error.
fn interpret(experiment: &Experiment, arguments: &ExperimentArguments) -> Result<Settings, Failure> {
    let defaults = experiment.defaults;
    let given = [
        ("--times", !arguments.times.is_empty(), defaults.times.is_some()),
        ("--seeds", arguments.seeds.is_some(), defaults.seeds.is_some()),
        ("--reference-spp", arguments.reference_spp.is_some(), defaults.reference_samples.is_some()),
        ("--references", arguments.references.is_some(), defaults.references.is_some()),
        ("--farm", arguments.farm, defaults.renders),
    ];
    if let Some((option, ..)) = given.into_iter().find(|(_, is_given, is_known)| *is_given && !is_known) {
        return Err(Failure::Usage(format!(
            "{option} is not for the experiment {}, which has no such setting",
            experiment.name
        )));
    }
    let mut times: Vec<f64> = arguments.times.iter().map(Duration::as_secs_f64).collect();
    if times.is_empty() {
        times.extend(defaults.times.unwrap_or_default());
    }
    if !times.is_sorted_by(|first, second| first < second) {
        return Err(Failure::Usage(format!(
            "--times are {}: expected each to be longer than the one before it",
            times.iter().map(f64::to_string).collect::<Vec<_>>().join(",")
        )));
    }
    Ok(Settings {
        times,
        seeds: arguments.seeds.or(defaults.seeds).unwrap_or(1),
        size: arguments.size.map_or(defaults.size, |size| [size.width, size.height]),
        reference_samples: arguments.reference_spp.or(defaults.reference_samples).unwrap_or(0),
        threads: arguments.threads.unwrap_or_else(ThreadCount::of_cores).get(),
    })
}
