//! The renders of an experiment as ordinary jobs on a farm.

use clerestory_film::smallest_tile;
use clerestory_render_core::document::SceneBundle;
use clerestory_render_core::scene::Asset;
use serde_json::{Value, json};

use crate::error::ExperimentError;
use crate::host::{Amount, FarmOrder, FarmRender};
use crate::session::Session;
use crate::snapshot::Snapshot;

/// Edge of a tile in pixels.
pub(crate) const TILE: u32 = 64;

/// Whether a farm renders.
pub(crate) fn is_there(session: &mut Session) -> bool {
    session.host.farm().is_some()
}

/// Renders a scene as a job. The farm measures the error against the reference, if there is one, at each round.
pub(crate) fn render(
    session: &mut Session,
    bundle: &SceneBundle,
    amount: Amount,
    reference: Option<&Asset>,
) -> Result<Snapshot, ExperimentError> {
    let film = bundle.description().film;
    let name = session.activity().to_owned();
    let order = FarmOrder {
        name: &name,
        bundle,
        amount,
        tile_size: TILE.max(smallest_tile(film.width, film.height)),
        reference,
        cancelled: &session.control.cancelled,
    };
    let rendered = match session.host.farm() {
        Some(farm) => farm.render(&order)?,
        None => None,
    };
    let Some(FarmRender { image, wall_seconds, core_seconds, points }) = rendered else {
        return Err(session.interrupted());
    };
    let description = bundle.description();
    session.series.push(json!({
        "job": name,
        "integrator": description.integrator,
        "seed": description.seed,
        "points": points,
    }));
    let counters = image.metadata().map(|metadata| metadata.counters).unwrap_or_default();
    let samples = image.layers().samples.as_deref().unwrap_or_default();
    let in_image: u64 = samples.iter().map(|samples| u64::from(*samples)).sum();
    let samples = in_image / (samples.len() as u64).max(1);
    Ok(Snapshot { samples, wall_seconds, core_seconds, counters, image })
}

/// What a report says of the farm: its address, its workers, and the errors of its jobs.
pub(crate) fn record(session: &mut Session) -> Result<Option<Value>, ExperimentError> {
    let Some(farm) = session.host.farm() else { return Ok(None) };
    let view = farm.view()?;
    Ok(Some(json!({ "address": view.address, "workers": view.workers, "convergence": session.series })))
}
