//! A wrong clock, as a bucket sees it.
//!
//! Each request to a bucket is signed with the time of this machine, and object stores refuse a time that differs by
//! some minutes. Not all of them say so. Their answers carry their time, so that the refusal can be explained. Only
//! the machine's clock can mend it, because the client signs by that.

use std::future::Future;
use std::pin::Pin;
use std::time::{Duration, SystemTime};

use axum::http::StatusCode;
use axum::http::header::DATE;
use httpdate::{fmt_http_date, parse_http_date};
use object_store::ClientOptions;
use object_store::client::{
    HttpClient, HttpConnector, HttpError, HttpErrorKind, HttpRequest, HttpResponse, HttpService, ReqwestConnector,
};

/// Largest difference of clocks: stores allow 5 to 15 minutes.
const ALLOWED: Duration = Duration::from_mins(5);

/// A store has refused a request because of its time.
#[derive(Debug, thiserror::Error)]
#[error(
    "the store refuses requests ({status}), whose signature has the time of this machine: its clock shows {}, and \
     that of the store {}; \
     set the clock of this machine, for instance by NTP",
    fmt_http_date(*.ours), fmt_http_date(*.theirs)
)]
struct ClockIsWrong {
    status: StatusCode,
    ours: SystemTime,
    theirs: SystemTime,
}

/// Makes clients that explain such refusals.
#[derive(Debug, Default)]
pub(super) struct Explaining;

impl HttpConnector for Explaining {
    fn connect(&self, options: &ClientOptions) -> object_store::Result<HttpClient> {
        Ok(HttpClient::new(Explained(ReqwestConnector::default().connect(options)?)))
    }
}

#[derive(Debug)]
struct Explained(HttpClient);

impl HttpService for Explained {
    // What `async_trait` makes of an async function.
    fn call<'s, 'f>(
        &'s self,
        request: HttpRequest,
    ) -> Pin<Box<dyn Future<Output = Result<HttpResponse, HttpError>> + Send + 'f>>
    where
        's: 'f,
        Self: 'f,
    {
        Box::pin(async move {
            let response = self.0.execute(request).await?;
            let date = response.headers().get(DATE).and_then(|date| date.to_str().ok());
            match explain(response.status(), date, SystemTime::now()) {
                // It is not tried again.
                Some(wrong) => Err(HttpError::new(HttpErrorKind::Unknown, wrong)),
                None => Ok(response),
            }
        })
    }
}

/// Why a store has refused a request, if its clock and ours are far apart.
fn explain(status: StatusCode, date: Option<&str>, ours: SystemTime) -> Option<ClockIsWrong> {
    let is_refused = matches!(status, StatusCode::BAD_REQUEST | StatusCode::UNAUTHORIZED | StatusCode::FORBIDDEN);
    let theirs = parse_http_date(date.filter(|_| is_refused)?).ok()?;
    let apart = ours.duration_since(theirs).unwrap_or_else(|error| error.duration());
    (apart > ALLOWED).then_some(ClockIsWrong { status, ours, theirs })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_refusal_by_a_store_with_another_time_is_explained() {
        let now = parse_http_date("Fri, 27 Nov 2026 21:00:00 GMT").unwrap();
        let [right, late, early] =
            ["21:04:59", "18:00:00", "23:59:59"].map(|time| format!("Fri, 27 Nov 2026 {time} GMT"));
        let explained = |status, date: &str| explain(status, Some(date), now).map(|error| error.to_string());
        assert_eq!(explained(StatusCode::FORBIDDEN, &right), None, "another reason");
        assert_eq!(explained(StatusCode::OK, &late), None, "it is no matter");
        assert_eq!(explained(StatusCode::FORBIDDEN, "yesterday"), None);
        for other in [&late, &early] {
            let words = explained(StatusCode::FORBIDDEN, other).unwrap();
            let both =
                words.contains("its clock shows Fri, 27 Nov 2026 21:00:00 GMT") && words.contains(other.as_str());
            assert!(both && words.contains("set the clock of this machine"), "{words}");
        }
    }
}
