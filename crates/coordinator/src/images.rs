//! Images as they are now, for whoever looks at a job while it converges.
//!
//! An image is computed at most once a second for a running job, however many look, and by one thread at a time, so that
//! watchers do not take the machine from the farm.

use std::collections::BTreeMap;
use std::sync::Arc;

use clerestory_api::JobId;
use clerestory_render_core::film::FrameImage;
use tokio::sync::Mutex;

use crate::farm::Farm;
use crate::film::{self, Extent, FilmError};
use crate::store::JobRecord;

/// How long the image of a running job may stay as it is although its film has grown.
const FRESH_MS: i64 = 1000;

/// Jobs whose images are kept.
const KEPT: usize = 4;

/// Tries to read the film while its nodes are being merged away.
const TRIES: u32 = 3;

/// The images that were computed last.
#[derive(Debug, Default)]
pub(crate) struct Images {
    kept: Mutex<BTreeMap<JobId, Kept>>,
}

#[derive(Debug)]
struct Kept {
    accepted_nodes: u64,
    final_state: bool,
    computed_ms: i64,
    image: Arc<FrameImage>,
}

/// The image of a job's first frame: every tile as far as it is complete.
pub(crate) async fn current(farm: &Farm, job: &JobRecord) -> Result<Arc<FrameImage>, FilmError> {
    let mut kept = farm.images.kept.lock().await;
    let now_ms = farm.config.clock.now_ms();
    let final_state = job.state.is_final();
    if let Some(known) = kept.get(&job.id) {
        let same = known.accepted_nodes == job.accepted_nodes && known.final_state == final_state;
        let fresh = !final_state && now_ms - known.computed_ms < FRESH_MS;
        if same || fresh {
            return Ok(Arc::clone(&known.image));
        }
    }
    let image = Arc::new(compute(farm, job).await?);
    if kept.len() >= KEPT && !kept.contains_key(&job.id) {
        let oldest = kept.iter().min_by_key(|(_, known)| known.computed_ms).map(|(job, _)| *job);
        oldest.and_then(|job| kept.remove(&job));
    }
    let entry =
        Kept { accepted_nodes: job.accepted_nodes, final_state, computed_ms: now_ms, image: Arc::clone(&image) };
    kept.insert(job.id, entry);
    Ok(image)
}

async fn compute(farm: &Farm, job: &JobRecord) -> Result<FrameImage, FilmError> {
    let metadata = film::metadata(farm, job, 0).await?;
    let mut tries = 1;
    let (rows, nodes) = loop {
        let mut rows = farm.store.nodes(job.id).await?;
        rows.retain(|row| row.address.frame == 0);
        match farm.film.load(&rows).await {
            Ok(nodes) => break (rows, nodes),
            // The keeper has merged and removed a node between the two reads; the new rows name its parent.
            Err(FilmError::Lost { .. }) if tries < TRIES => tries += 1,
            Err(error) => return Err(error),
        }
    };
    let job = job.clone();
    tokio::task::spawn_blocking(move || film::assemble(&job, &rows, &nodes, Extent::Complete, metadata)).await?
}
