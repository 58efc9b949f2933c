//! The page and its frames over HTTP.

use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::extract::rejection::JsonRejection;
use axum::extract::{Json, Query, State};
use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE};
use axum::http::{HeaderName, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use serde::Deserialize;
use serde_json::json;
use tokio::time::timeout;

use super::engine::{Engine, FrameNumber};
use super::look::Look;

/// How long a page waits for a frame before it asks again.
const LONGEST_WAIT: Duration = Duration::from_secs(20);

/// The headers that say what a frame is.
const LOOK: HeaderName = HeaderName::from_static("clerestory-look");
const FRAME: HeaderName = HeaderName::from_static("clerestory-frame");
const SAMPLES: HeaderName = HeaderName::from_static("clerestory-samples");

/// The files of the page.
const FILES: [(&str, &str, &str); 4] = [
    ("/", "text/html; charset=utf-8", include_str!("page/index.html")),
    ("/viewer.js", "text/javascript; charset=utf-8", include_str!("page/viewer.js")),
    ("/camera.js", "text/javascript; charset=utf-8", include_str!("page/camera.js")),
    ("/viewer.css", "text/css; charset=utf-8", include_str!("page/viewer.css")),
];

/// The routes of the page.
pub(super) fn routes(engine: Arc<Engine>) -> Router {
    let mut router = Router::new();
    for (path, media_type, content) in FILES {
        let file = move || async move { ([(CONTENT_TYPE, media_type), (CACHE_CONTROL, "no-cache")], content) };
        router = router.route(path, get(file));
    }
    router.route("/look", get(shown).post(show)).route("/frame", get(frame)).with_state(engine)
}

async fn shown(State(engine): State<Arc<Engine>>) -> Response {
    Json(engine.shown()).into_response()
}

async fn show(State(engine): State<Arc<Engine>>, look: Result<Json<Look>, JsonRejection>) -> Response {
    let refused = |status: StatusCode, detail: String| (status, Json(json!({"detail": detail}))).into_response();
    match look {
        Err(rejection) => refused(rejection.status(), rejection.body_text()),
        Ok(Json(look)) => match engine.show(look) {
            Ok(number) => Json(json!({"look": number})).into_response(),
            Err(error) => refused(StatusCode::UNPROCESSABLE_ENTITY, error.to_string()),
        },
    }
}

/// The frame that a page shows.
#[derive(Deserialize)]
struct After {
    #[serde(default)]
    look: u64,
    #[serde(default)]
    frame: u32,
}

/// The newest frame after another, as soon as there is one. Answers 204 when there is none for long.
async fn frame(State(engine): State<Arc<Engine>>, Query(after): Query<After>) -> Response {
    let after = FrameNumber { look: after.look, frame: after.frame };
    let mut frames = engine.frames();
    let newer = timeout(LONGEST_WAIT, async {
        loop {
            let newest = frames.borrow_and_update().clone().filter(|frame| frame.number > after);
            if newest.is_some() || engine.is_over() || frames.changed().await.is_err() {
                return newest;
            }
        }
    });
    match newer.await {
        Ok(Some(frame)) => {
            let headers = [
                (CONTENT_TYPE, "image/png".to_owned()),
                (CACHE_CONTROL, "no-store".to_owned()),
                (LOOK, frame.number.look.to_string()),
                (FRAME, frame.number.frame.to_string()),
                (SAMPLES, frame.samples.to_string()),
            ];
            (headers, frame.png).into_response()
        }
        Ok(None) | Err(_) => StatusCode::NO_CONTENT.into_response(),
    }
}
