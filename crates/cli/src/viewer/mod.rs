//! A scene in the browser: a page, a camera that the user moves, and a thread that renders its view.
//!
//! The page sends a new view ([`look::Look`]). The render in progress is given up, and frames follow, coarse ones first
//! ([`engine`]). The page requests the frame after the one that it shows, and waits for the answer.

mod engine;
mod look;
mod server;

use std::sync::Arc;

use clerestory_render_core::document::SceneBundle;
use clerestory_render_core::integrator::PreparedScene;
use rayon::ThreadPool;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;

use self::engine::{Ended, Engine};
use crate::failure::Failure;

/// A scene that a page shows.
pub(crate) struct Viewer {
    engine: Arc<Engine>,
    /// The result of the thread that renders.
    ended: Ended,
}

impl Viewer {
    /// Starts to render a scene with at most `most_samples` samples in each pixel.
    pub(crate) fn start(
        bundle: SceneBundle,
        scene: PreparedScene,
        pool: ThreadPool,
        most_samples: u32,
    ) -> Result<Self, Failure> {
        let (engine, ended) = Engine::start(bundle, scene, pool, most_samples)?;
        Ok(Self { engine, ended })
    }

    /// Serves the page and its frames until `stop`, or until rendering fails.
    pub(crate) async fn serve(self, listener: TcpListener, stop: CancellationToken) -> Result<(), Failure> {
        let Self { engine, ended } = self;
        let rendering = engine.clone();
        let stopped = async move {
            stop.cancelled().await;
            rendering.end();
        };
        let serving = axum::serve(listener, server::routes(engine)).with_graceful_shutdown(stopped);
        tokio::select! {
            served = serving => served.map_err(Failure::Viewer),
            ended = ended => ended.unwrap_or_else(|_| {
                Err(Failure::Job("rendering failed, which is a fault of Clerestory".to_owned()))
            }),
        }
    }
}
