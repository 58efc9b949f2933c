//! Renders the nodes of a lease in their order on a pool of threads.
//!
//! When threads have no rows left in a node while others still work on its last rows, they begin the next node.

use std::any::Any;
use std::num::NonZeroUsize;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use clerestory_film::{NodeAddress, Rendered};
use clerestory_render_core::integrator::{RenderError, render_nodes, rendered_together};
use clerestory_render_core::probe::{self, ProbeDigests, ProbeError};
use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use tokio::sync::mpsc;
use tracing::info;

use crate::job_cache::JobPlan;

/// Nodes that are rendered at a time: one, and the next for threads that have no rows left in the first. With more, a
/// worker that dies would lose more.
const NODES_IN_FLIGHT: usize = 2;

/// A node and the time that it took.
pub(crate) struct RenderedNode {
    /// The node and its counters.
    pub(crate) rendered: Rendered,
    /// Time since the previous node was complete, or since this one was begun if that was later, times the cores.
    pub(crate) core_time: Duration,
}

/// Why the nodes of a lease were not rendered.
#[derive(Debug, thiserror::Error)]
pub(crate) enum LeaseError {
    #[error("told to stop")]
    Stopped,
    #[error("the image has no frame {0}")]
    NoSuchFrame(u32),
    #[error("cannot render {address:?}")]
    Render { address: NodeAddress, source: RenderError },
    #[error("rendering {address:?} panicked: {message}")]
    Panic { address: NodeAddress, message: String },
}

/// The pool of threads that render.
pub(crate) struct Renderer {
    pool: ThreadPool,
}

impl Renderer {
    pub(crate) fn new(threads: NonZeroUsize) -> Result<Self, ThreadPoolBuildError> {
        let name = |index| format!("render-{index}");
        Ok(Self { pool: ThreadPoolBuilder::new().num_threads(threads.get()).thread_name(name).build()? })
    }

    /// The digests of the probe on this machine. They are those of the first worker in this process.
    pub(crate) fn probe(&self) -> Result<ProbeDigests, ProbeError> {
        static DIGESTS: Mutex<Option<ProbeDigests>> = Mutex::new(None);
        let mut digests = DIGESTS.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = &*digests {
            return Ok(known.clone());
        }
        Ok(digests.insert(self.pool.install(probe::digests)?).clone())
    }

    /// Renders `nodes` in their order and sends each when it is complete. It blocks its thread.
    pub(crate) fn render(
        &self,
        plan: &JobPlan,
        nodes: &[clerestory_api::NodeAddress],
        cancelled: &AtomicBool,
        complete: &mpsc::Sender<RenderedNode>,
    ) -> Result<(), LeaseError> {
        let start = Instant::now();
        let mut last_completed = start;
        let mut samples = 0;
        let (ends, ended) = std::sync::mpsc::channel();
        let addresses = nodes.iter().map(|node| NodeAddress {
            frame: node.frame,
            tile: node.tile,
            level: node.level,
            index: node.index,
        });
        let addresses: Vec<NodeAddress> = addresses.collect();
        let mut nodes_left = rendered_together(&plan.grid, &addresses);
        self.pool.in_place_scope(|scope| {
            let mut begin_next = || {
                let Some(together) = nodes_left.next() else { return false };
                let ends = ends.clone();
                scope.spawn(move |_| {
                    // The result may wait in the channel while the coordinator is away. That time belongs to no node.
                    let begun = Instant::now();
                    let rendered = self.render_nodes(plan, together, cancelled);
                    // After a failure the receiver is gone, and no further node counts.
                    let _ = ends.send((rendered, begun, Instant::now()));
                });
                true
            };
            let mut in_flight = (0..NODES_IN_FLIGHT).filter(|_| begin_next()).count();
            while in_flight > 0 {
                let Ok((rendered, begun, completed)) = ended.recv() else { break };
                // The other node in flight is of no use either.
                let rendered = rendered.inspect_err(|_| cancelled.store(true, Ordering::Relaxed))?;
                if !begin_next() {
                    in_flight -= 1;
                }
                let took = completed.saturating_duration_since(begun.max(last_completed));
                let core_time = took.saturating_mul(u32::try_from(self.pool.current_num_threads()).unwrap_or(u32::MAX));
                last_completed = last_completed.max(completed);
                let core_time = core_time / u32::try_from(rendered.len()).unwrap_or(u32::MAX).max(1);
                for rendered in rendered {
                    samples += rendered.counters.samples;
                    if complete.blocking_send(RenderedNode { rendered, core_time }).is_err() {
                        return Err(LeaseError::Stopped);
                    }
                }
            }
            Ok(())
        })?;
        let seconds = start.elapsed().as_secs_f64();
        info!(job = %plan.job, nodes = nodes.len(), seconds, rate = samples as f64 / seconds, "rendered a lease");
        Ok(())
    }

    /// Renders some nodes together: at least one.
    fn render_nodes(
        &self,
        plan: &JobPlan,
        addresses: &[NodeAddress],
        cancelled: &AtomicBool,
    ) -> Result<Vec<Rendered>, LeaseError> {
        let [address, ..] = *addresses else { return Ok(Vec::new()) };
        if address.frame != 0 {
            return Err(LeaseError::NoSuchFrame(address.frame));
        }
        let work = || render_nodes(&plan.scene, &plan.grid, addresses, cancelled);
        // A panic leaves nothing half written: the scene is immutable and the node is dropped.
        match catch_unwind(AssertUnwindSafe(work)) {
            Ok(Ok(rendered)) => Ok(rendered),
            Ok(Err(RenderError::Cancelled)) => Err(LeaseError::Stopped),
            Ok(Err(source)) => Err(LeaseError::Render { address, source }),
            Err(payload) => Err(LeaseError::Panic { address, message: panic_message(&*payload) }),
        }
    }
}

fn panic_message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| payload.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".to_owned())
}
