//! The integrators that scenes may name.

use axum::Json;
use clerestory_api::IntegratorView;
use clerestory_render_core::document::{IntegratorEntry, integrators};

/// The integrators that a scene may name, with the schemas of their settings. The first is the default.
#[utoipa::path(
    get, path = "/integrators", tag = "integrators", responses((status = 200, body = Vec<IntegratorView>))
)]
pub(super) async fn list() -> Json<Vec<IntegratorView>> {
    let view = |(index, IntegratorEntry { name, summary, schema, defaults })| IntegratorView {
        name: String::from(name),
        summary: String::from(summary),
        is_default: index == 0,
        schema,
        defaults,
    };
    Json(integrators().into_iter().enumerate().map(view).collect())
}
