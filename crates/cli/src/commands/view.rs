//! `clerestory view`: a scene in the browser, rendered again whenever the camera or the sun moves.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;
use rayon::ThreadPoolBuilder;
use tokio::net::TcpListener;

use crate::activity::Activity;
use crate::failure::Failure;
use crate::numbers::whole;
use crate::output::print_line;
use crate::progress::Progress;
use crate::render_limits::{DEFAULT_SAMPLES_PER_PIXEL, UNREACHABLE_SAMPLES_PER_PIXEL};
use crate::scene_overrides::{LoadedScene, SamplingOverrides, SceneOverrides};
use crate::shutdown::{self, Parent};
use crate::threads::ThreadCount;
use crate::viewer::Viewer;

/// Options of `clerestory view`.
#[derive(Debug, Args)]
pub(crate) struct ViewArguments {
    /// The scene file.
    scene: PathBuf,
    /// Samples per pixel at which rendering stops.
    #[arg(long, value_name = "N", default_value_t = DEFAULT_SAMPLES_PER_PIXEL,
          value_parser = whole(1..=UNREACHABLE_SAMPLES_PER_PIXEL))]
    spp: u32,
    #[command(flatten)]
    overrides: SceneOverrides,
    /// Address of the page. A user who reaches it can use this machine's processors, so it must be local.
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:7272")]
    listen: SocketAddr,
    /// Threads that render [default: one for each core].
    #[arg(long, value_name = "N", env = "CLERESTORY_THREADS")]
    threads: Option<ThreadCount>,
}

pub(crate) async fn run(arguments: ViewArguments) -> Result<(), Failure> {
    if !arguments.listen.ip().is_loopback() {
        let found = arguments.listen;
        return Err(Failure::Usage(format!(
            "--listen: found {found}, expected an address of this machine alone, such as 127.0.0.1:7272"
        )));
    }
    let activity = Activity::begin("Reading the scene and its files");
    let LoadedScene { bundle, .. } = arguments.overrides.load(&arguments.scene, SamplingOverrides::default())?;
    let scene = activity.build(&bundle).map_err(|source| Failure::scene(&arguments.scene, source))?;
    activity.done("The scene is ready");
    Progress::new().import_notes(scene.import_notes());
    let threads = arguments.threads.unwrap_or_else(ThreadCount::of_cores).get();
    let pool = ThreadPoolBuilder::new().num_threads(threads.get()).build().map_err(Failure::Threads)?;
    let failure = |source| Failure::Listen { address: arguments.listen.to_string(), source };
    let listener = TcpListener::bind(arguments.listen).await.map_err(failure)?;
    let address = listener.local_addr().map_err(failure)?;
    let stop = shutdown::token(Parent::None);
    let viewer = Viewer::start(bundle, scene, pool, arguments.spp)?;
    print_line(&format!("http://{address}"))?;
    viewer.serve(listener, stop).await
}
