//! Answers by address.

use super::access::{Access, Refusal};
use super::assets;
use super::runs::{self, RunRequest, Runs};
use crate::study::catalog::{Catalog, Source};
use crate::study::change::{Change, changed};
use crate::study::description;
use axum::body::{Body, to_bytes};
use axum::http::header::{self, HeaderValue};
use axum::http::{Method, Request, Response, StatusCode};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use stickslip_study::{StructureCache, read_study_with};

/// State of the server.
#[derive(Debug)]
pub(crate) struct State {
    pub catalog: Catalog,
    pub runs: Runs,
    pub threads: usize,
    /// The structures of the last studies, so that a change of a joint reduces no matrices again.
    pub structures: Arc<StructureCache>,
    access: Access,
    /// The study that the page shows first.
    first: Option<String>,
    rate: Rate,
    settings: RequestSettings,
}

/// Limits of requests.
#[derive(Debug, Clone, Copy)]
struct RequestSettings {
    /// Largest size of the body of a request, bytes. Default 256 KiB: a request holds the changes
    /// of one study.
    body: usize,
    /// Time in which the body must arrive. Default 10 s.
    time: Duration,
    /// Largest number of requests per second. Default 500: ten clients with 50 each, twice what
    /// a slider sends.
    rate: u64,
}

impl Default for RequestSettings {
    fn default() -> Self {
        RequestSettings { body: 256 << 10, time: Duration::from_secs(10), rate: 500 }
    }
}

impl State {
    pub fn new(catalog: Catalog, access: Access, first: Option<String>, threads: usize) -> State {
        let settings = RequestSettings::default();
        State {
            catalog,
            runs: Runs::default(),
            threads,
            structures: Arc::default(),
            access,
            first,
            rate: Rate::new(),
            settings,
        }
    }

    /// Stops all runs.
    pub fn stop(&self) {
        self.runs.stop_all();
    }
}

/// Counts requests per second of the clock of this process.
#[derive(Debug)]
struct Rate {
    begun: Instant,
    /// The second, and the number of its requests: `second << 32 | count`.
    count: AtomicU64,
}

impl Rate {
    fn new() -> Rate {
        Rate { begun: Instant::now(), count: AtomicU64::new(0) }
    }

    /// Counts a request and returns the number of requests in this second.
    fn count(&self) -> u64 {
        let second = self.begun.elapsed().as_secs() << 32;
        let next = |old: u64| if old & !0xffff_ffff == second { old + 1 } else { second + 1 };
        let old = self.count.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |old| Some(next(old)));
        old.map_or(1, next) & 0xffff_ffff
    }
}

/// Answers a request.
pub(crate) async fn answer(state: Arc<State>, request: Request<Body>) -> Response<Body> {
    let mut response = match route(&state, request).await {
        Ok(response) => response,
        Err(Refusal { status, reason }) => text(status, reason),
    };
    let headers = response.headers_mut();
    let policy = HeaderValue::try_from(state.access.policy()).unwrap_or(HeaderValue::from_static("default-src 'none'"));
    headers.insert(header::CONTENT_SECURITY_POLICY, policy);
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(header::REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    headers.insert("cross-origin-resource-policy", HeaderValue::from_static("same-origin"));
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    response
}

async fn route(state: &Arc<State>, request: Request<Body>) -> Result<Response<Body>, Refusal> {
    let (parts, body) = request.into_parts();
    state.access.check_origin(&parts.method, &parts.headers)?;
    if state.rate.count() > state.settings.rate {
        return Err(Refusal { status: StatusCode::TOO_MANY_REQUESTS, reason: "too many requests in one second" });
    }
    let address = parts.uri.path();
    if parts.method == Method::GET
        && let Some(asset) = assets::find(address)
    {
        return Ok(typed(asset.kind, Body::from(asset.content)));
    }
    state.access.check_token(&parts.uri, &parts.headers)?;
    match (&parts.method, address) {
        (&Method::GET, "/") => {
            let mut page = typed("text/html; charset=utf-8", Body::from(assets::PAGE));
            if let Ok(cookie) = HeaderValue::try_from(state.access.cookie()) {
                page.headers_mut().insert(header::SET_COOKIE, cookie);
            }
            Ok(page)
        }
        (&Method::GET, "/api/catalog") => {
            Ok(json_response(&json!({ "entries": state.catalog.entries(), "first": state.first })))
        }
        (&Method::POST, "/api/describe") => {
            let request: DescribeRequest = content(state, body).await?;
            Ok(json_response(&blocking(state, move |state| describe(&state, &request)).await?))
        }
        (&Method::POST, "/api/run") => {
            let request: RunRequest = content(state, body).await?;
            Ok(typed("application/x-ndjson", runs::start(state.clone(), request)?))
        }
        (_, "/" | "/api/catalog" | "/api/describe" | "/api/run") => {
            Err(Refusal { status: StatusCode::METHOD_NOT_ALLOWED, reason: "this address does not support the method" })
        }
        _ => Err(Refusal { status: StatusCode::NOT_FOUND, reason: "there is no such address" }),
    }
}

/// A request for the description of a study.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct DescribeRequest {
    study: String,
    #[serde(default)]
    changes: Vec<Change>,
}

/// Describes a changed study. An error in the study is an answer, not a refusal.
fn describe(state: &State, request: &DescribeRequest) -> Value {
    let wrong = |message: String| json!({ "event": "error", "message": message });
    let Source { file, text } = match state.catalog.source(&request.study) {
        Ok(source) => source,
        Err(message) => return wrong(message),
    };
    let document = match changed(&text, &request.changes) {
        Ok(document) => document,
        Err(error) => return wrong(error.to_string()),
    };
    match read_study_with(&file, &document.to_string(), &state.structures) {
        Ok(study) => description::describe(&study, &document),
        Err(error) => description::error(&error, &Source { file, text }),
    }
}

/// Runs a computation outside the thread of the connections.
async fn blocking(
    state: &Arc<State>,
    compute: impl FnOnce(Arc<State>) -> Value + Send + 'static,
) -> Result<Value, Refusal> {
    let state = state.clone();
    tokio::task::spawn_blocking(move || compute(state))
        .await
        .map_err(|_| Refusal { status: StatusCode::INTERNAL_SERVER_ERROR, reason: "the computation ended early" })
}

/// Returns the content of a request.
async fn content<T: DeserializeOwned>(state: &State, body: Body) -> Result<T, Refusal> {
    let RequestSettings { body: limit, time, .. } = state.settings;
    let bytes = tokio::time::timeout(time, to_bytes(body, limit)).await;
    let slow = Refusal { status: StatusCode::REQUEST_TIMEOUT, reason: "the request arrives too slowly" };
    let large = Refusal { status: StatusCode::PAYLOAD_TOO_LARGE, reason: "the request is too large or incomplete" };
    let wrong = Refusal { status: StatusCode::BAD_REQUEST, reason: "the request is not valid for this address" };
    serde_json::from_slice(&bytes.map_err(|_| slow)?.map_err(|_| large)?).map_err(|_| wrong)
}

fn typed(kind: &'static str, body: Body) -> Response<Body> {
    let mut response = Response::new(body);
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(kind));
    response
}

fn text(status: StatusCode, reason: &'static str) -> Response<Body> {
    let mut response = typed("text/plain; charset=utf-8", Body::from(reason));
    *response.status_mut() = status;
    response
}

fn json_response(value: &Value) -> Response<Body> {
    typed("application/json", Body::from(value.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_counted_by_second() {
        let rate = Rate::new();
        assert_eq!([rate.count(), rate.count(), rate.count()], [1, 2, 3]);
        rate.count.store(7 << 32 | 400, Ordering::Relaxed);
        assert_eq!(rate.count(), 1);
    }
}
