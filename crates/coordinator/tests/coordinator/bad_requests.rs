//! What callers get wrong, and what they are told. The farm goes on working afterwards.

use std::time::Duration;

use crate::support::*;
use clerestory_api::{Client, JobState, Problem};
use futures::future::join_all;
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use uuid::Uuid;

const TOKEN: &str = "0123456789abcdef0123456789abcdef";

struct Call {
    method: Method,
    path: String,
    headers: Vec<(&'static str, String)>,
    body: Vec<u8>,
}

fn call(method: Method, path: impl Into<String>) -> Call {
    Call { method, path: path.into(), headers: Vec::new(), body: Vec::new() }
}

impl Call {
    fn header(mut self, name: &'static str, value: impl ToString) -> Self {
        self.headers.push((name, value.to_string()));
        self
    }

    fn body(mut self, body: impl Into<Vec<u8>>) -> Self {
        self.body = body.into();
        self
    }

    fn json(self, body: &Value) -> Self {
        self.header("content-type", "application/json").body(body.to_string())
    }

    async fn send(self, farm: &TestFarm) -> reqwest::Response {
        let client = reqwest::Client::builder().no_proxy().build().unwrap();
        let mut request = client.request(self.method, format!("{}/api/v1{}", farm.address, self.path)).body(self.body);
        for (name, value) in self.headers {
            request = request.header(name, value);
        }
        request.send().await.unwrap()
    }
}

/// Sends the call and compares status, code and field of the problem.
#[track_caller]
fn check<'a>(
    farm: &'a TestFarm,
    call: Call,
    status: u16,
    code: &'a str,
    field: Option<&'a str>,
) -> impl Future<Output = Problem> + 'a {
    let caller = std::panic::Location::caller();
    async move {
        let name = format!("{} {} ({caller})", call.method, call.path);
        let response = call.send(farm).await;
        assert_eq!(response.status().as_u16(), status, "{name}");
        assert_eq!(response.headers()["content-type"], "application/problem+json", "{name}");
        let request_id = response.headers()["x-request-id"].to_str().unwrap().to_owned();
        let document: Value = response.json().await.unwrap();
        let problem: Problem = serde_json::from_value(document.clone()).unwrap();
        assert_eq!((problem.status, document["code"].as_str()), (status, Some(code)), "{name}: {document}");
        assert_eq!(problem.field.as_deref(), field, "{name}: {document}");
        assert_eq!(problem.request_id, Some(request_id), "{name}");
        problem
    }
}

fn submission_with(field: &str, value: Value) -> Value {
    let mut body = serde_json::to_value(submission(4)).unwrap();
    body[field] = value;
    body
}

fn scene_with(pointer: &str, value: Value) -> Value {
    let mut body = serde_json::to_value(submission(4)).unwrap();
    *body.pointer_mut(&format!("/scene{pointer}")).unwrap() = value;
    body
}

#[tokio::test(flavor = "multi_thread")]
async fn every_bad_call_gets_a_clear_problem_and_the_farm_goes_on_working() {
    let farm = TestFarm::start_with(|config| {
        config.lease_nodes = Some(200);
        config.max_asset_bytes = 1000;
        config.max_partial_bytes = 1 << 20;
    })
    .await;
    let farm = &farm;
    let nobody = Uuid::now_v7();
    let post = |path: &str, body: &Value| call(Method::POST, path).json(body);
    let submit = |body: &Value| post("/jobs", body);

    // Paths and methods.
    check(farm, call(Method::GET, "/nothing"), 404, "unknown_path", Some("path")).await;
    check(farm, call(Method::DELETE, "/jobs"), 405, "method_not_allowed", Some("method")).await;
    check(farm, call(Method::GET, "/jobs/abc"), 400, "invalid_field", Some("job")).await;
    check(farm, call(Method::GET, format!("/jobs/{nobody}")), 404, "unknown_job", Some("job")).await;
    check(farm, call(Method::GET, format!("/jobs/{nobody}/events")), 404, "unknown_job", Some("job")).await;
    check(farm, call(Method::GET, format!("/jobs/{nobody}/live")), 404, "unknown_job", Some("job")).await;
    check(farm, call(Method::POST, format!("/jobs/{nobody}/cancel")), 404, "unknown_job", Some("job")).await;
    for method in [Method::GET, Method::POST, Method::PUT, Method::DELETE, Method::PATCH] {
        for path in ["", "/", "/nothing", "/jobs/", "//jobs", "/JOBS", "/%6aobs", "/jobs/abc/nothing"] {
            check(farm, call(method.clone(), path), 404, "unknown_path", Some("path")).await;
        }
    }

    // Queries.
    let job_path = format!("/jobs/{nobody}");
    for (method, path) in [
        (Method::GET, "/jobs"),
        (Method::POST, "/jobs"),
        (Method::GET, "/events"),
        (Method::GET, job_path.as_str()),
        (Method::GET, "/workers"),
        (Method::POST, "/leases"),
        (Method::GET, "/openapi.json"),
        (Method::PUT, &*format!("/assets/{}", hash(b"x"))),
    ] {
        let problem =
            check(farm, call(method, format!("{path}?limit=5&limit=6")), 400, "unknown_field", Some("limit")).await;
        assert!(problem.detail.contains("`limit`") && problem.expected.unwrap().contains("no parameters"), "{path}");
    }
    assert_eq!(call(Method::GET, "/jobs?").send(farm).await.status(), StatusCode::OK, "it has no parameter");

    // Encoded bodies.
    for (method, path) in [
        (Method::POST, "/jobs"),
        (Method::POST, "/workers"),
        (Method::PUT, &*format!("/assets/{}", hash(b"x"))),
        (Method::PUT, &*format!("/leases/{nobody}/partial")),
    ] {
        for encoding in ["gzip", "br", "deflate", "zstd", "x-unknown", "identity, gzip"] {
            let encoded = call(method.clone(), path).header("content-encoding", encoding).body("\u{1f}\u{8b}");
            let problem = check(farm, encoded, 415, "unsupported_media_type", Some("content-encoding")).await;
            assert!(encoding.ends_with(&problem.value.unwrap()), "{encoding}");
        }
    }
    let encoded = call(Method::POST, "/jobs").header("content-encoding", "gzip").send(farm).await;
    assert_eq!(encoded.headers()["accept-encoding"], "identity");
    let plain = submit(&json!({})).header("content-encoding", "Identity");
    check(farm, plain, 400, "invalid_field", Some("scene")).await;

    // Bodies.
    check(farm, call(Method::POST, "/jobs").body("{}"), 415, "unsupported_media_type", Some("content-type")).await;
    let broken = call(Method::POST, "/jobs").header("content-type", "application/json").body("{\"scene\": ");
    check(farm, broken, 400, "invalid_body", Some("body")).await;
    check(farm, submit(&json!({})), 400, "invalid_field", Some("scene")).await;
    let problem = check(farm, submit(&submission_with("sppp", json!(1))), 400, "unknown_field", Some("sppp")).await;
    assert!(problem.expected.unwrap().contains("samples_per_pixel"));
    let problem = check(
        farm,
        submit(&submission_with("samples_per_pixel", json!("many"))),
        400,
        "invalid_field",
        Some("samples_per_pixel"),
    )
    .await;
    assert_eq!(problem.value.as_deref(), Some("many"));
    assert_eq!(problem.expected.as_deref(), Some("a whole number, 0 to 4294967295"));
    check(
        farm,
        submit(&submission_with("samples_per_pixel", json!(0))),
        400,
        "invalid_field",
        Some("samples_per_pixel"),
    )
    .await;
    check(
        farm,
        submit(&submission_with("samples_per_pixel", json!(-4))),
        400,
        "invalid_field",
        Some("samples_per_pixel"),
    )
    .await;
    check(farm, submit(&submission_with("tile_size", json!(0))), 400, "invalid_field", Some("tile_size")).await;
    check(farm, submit(&submission_with("tile_size", json!(5000))), 400, "invalid_field", Some("tile_size")).await;
    check(farm, submit(&submission_with("name", json!(""))), 400, "invalid_field", Some("name")).await;
    for name in ["\u{1b}[31mrose", "rose\nDone", "\0", "\u{9b}2J", "\u{7f}", "\u{202e}exr.esor", "rose\u{2028}"] {
        check(farm, submit(&submission_with("name", json!(name))), 422, "invalid_name", Some("name")).await;
        let response = submit(&scene_with("/name", json!(name))).send(farm).await;
        assert_eq!(response.status(), StatusCode::UNPROCESSABLE_ENTITY, "{name:?}");
        let worker = json!({"name": name, "cores": 1, "build": "b"});
        check(farm, post("/workers", &worker), 422, "invalid_name", Some("name")).await;
    }
    for limit_ms in [0, i64::MAX] {
        let body = submission_with("time_limit_ms", json!(limit_ms));
        check(farm, submit(&body), 400, "invalid_field", Some("time_limit_ms")).await;
    }
    for assumptions in [vec![String::new(); 101], vec!["x".repeat(301)]] {
        let body = submission_with("assumptions", json!(assumptions));
        check(farm, submit(&body), 400, "invalid_field", Some("assumptions")).await;
    }
    for field in ["target_mse", "target_estimated_mse"] {
        for target in [json!(0), json!(-1e-3), json!("little")] {
            check(farm, submit(&submission_with(field, target)), 400, "invalid_field", Some(field)).await;
        }
    }
    let problem =
        check(farm, submit(&submission_with("target_mse", json!(1e-9))), 400, "invalid_field", Some("target_mse"))
            .await;
    assert_eq!(problem.value.as_deref(), Some("1e-9"));
    assert!(problem.expected.unwrap().contains("a reference"));
    check(farm, submit(&submission_with("reference", json!("abc"))), 400, "invalid_field", Some("reference")).await;
    let surplus = json!({"roof.ply": hash(b"roof")});
    check(farm, submit(&submission_with("assets", surplus)), 400, "invalid_field", Some("assets.roof.ply")).await;

    // What a reader might take in silence: a list for an object, and the last of two members of one name.
    let list = call(Method::POST, "/workers").header("content-type", "application/json").body("[\"w\", 1, \"b\"]");
    let problem = check(farm, list, 400, "invalid_body", Some("body")).await;
    assert_eq!(problem.expected.as_deref(), Some("a JSON object"));
    let twice = submission_with("priority", json!(1)).to_string().replace("\"width\":37", "\"width\":37,\"width\":38");
    let twice = call(Method::POST, "/jobs").header("content-type", "application/json").body(twice);
    check(farm, twice, 400, "invalid_field", Some("scene.film.width")).await;

    // Scenes.
    check(farm, submit(&scene_with("/film/width", json!(0))), 422, "invalid_scene", Some("scene.film.width")).await;
    check(farm, submit(&scene_with("/version", json!(9))), 422, "invalid_scene", Some("scene.version")).await;
    check(farm, submit(&scene_with("/camera", json!({"fisheye": {}}))), 422, "invalid_scene", Some("scene.camera"))
        .await;
    check(
        farm,
        submit(&scene_with("/meshes/0/material", json!("marble"))),
        422,
        "invalid_scene",
        Some("scene.meshes[0].material"),
    )
    .await;
    let file = json!({"ply": {"file": "floor.ply"}});
    check(farm, submit(&scene_with("/meshes/0/source", file.clone())), 400, "invalid_field", Some("assets.floor.ply"))
        .await;
    let mut body = scene_with("/meshes/0/source", file);
    body["assets"] = json!({"floor.ply": hash(b"floor")});
    body["reference"] = json!(hash(b"reference"));
    let problem = check(farm, submit(&body), 409, "missing_assets", None).await;
    let mut missing = vec![hash(b"floor"), hash(b"reference")];
    missing.sort();
    assert_eq!(problem.missing, missing);

    // Assets.
    check(farm, call(Method::PUT, "/assets/ABC"), 400, "invalid_field", Some("hash")).await;
    check(farm, call(Method::GET, format!("/assets/{}", hash(b"x"))), 404, "unknown_asset", Some("hash")).await;
    let wrong = call(Method::PUT, format!("/assets/{}", hash(b"x"))).body("y");
    let problem = check(farm, wrong, 422, "hash_mismatch", Some("hash")).await;
    assert_eq!(problem.expected, Some(hash(b"y").to_string()));
    let large = vec![0; 2000];
    let large = call(Method::PUT, format!("/assets/{}", hash(&large))).body(large);
    check(farm, large, 413, "body_too_large", Some("body")).await;
    farm.client.upload_asset(&hash(b"no image"), "no image".into(), |_| ()).await.unwrap();
    let body = submission_with("reference", json!(hash(b"no image")));
    check(farm, submit(&body), 422, "invalid_reference", Some("reference")).await;

    // Workers and leases.
    let worker = json!({"name": "w", "cores": 0, "build": "b"});
    check(farm, post("/workers", &worker), 400, "invalid_field", Some("cores")).await;
    let worker = json!({"name": "w", "cores": 1, "build": "b", "colour": "red"});
    check(farm, post("/workers", &worker), 400, "unknown_field", Some("colour")).await;
    let heartbeat = call(Method::POST, format!("/workers/{nobody}/heartbeat"));
    check(farm, heartbeat, 404, "unknown_worker", Some("worker")).await;
    check(farm, post("/leases", &json!({"worker": nobody})), 404, "unknown_worker", Some("worker")).await;
    let lazy = json!({"worker": nobody, "wait_ms": 60_000});
    check(farm, post("/leases", &lazy), 400, "invalid_field", Some("wait_ms")).await;
    let greedy = json!({"worker": nobody, "max_nodes": 0});
    check(farm, post("/leases", &greedy), 400, "invalid_field", Some("max_nodes")).await;
    let renew = post(&format!("/leases/{nobody}/renew"), &json!({"token": 1}));
    check(farm, renew, 404, "unknown_lease", Some("lease")).await;

    // Partials.
    let job = farm.submit(4).await;
    let honest = farm.worker().await;
    let lease = honest.claim().await.unwrap();
    let upload = |body: Vec<u8>| {
        call(Method::PUT, format!("/leases/{}/partial", lease.id)).header("content-type", "image/x-exr").body(body)
    };
    let complete = |call: Call| call.header("clerestory-fencing-token", lease.token).header("clerestory-core-ms", 5);
    check(farm, upload(Vec::new()), 400, "invalid_field", Some("clerestory-fencing-token")).await;
    let without_time = upload(Vec::new()).header("clerestory-fencing-token", lease.token);
    check(farm, without_time, 400, "invalid_field", Some("clerestory-core-ms")).await;
    let absurd = upload(Vec::new()).header("clerestory-fencing-token", lease.token);
    let absurd = absurd.header("clerestory-core-ms", i64::MAX);
    check(farm, absurd, 400, "invalid_field", Some("clerestory-core-ms")).await;
    let stale = upload(Vec::new()).header("clerestory-fencing-token", 0).header("clerestory-core-ms", 5);
    check(farm, stale, 409, "stale_token", Some("clerestory-fencing-token")).await;
    check(farm, complete(upload(vec![0; 2 << 20])), 413, "body_too_large", Some("body")).await;
    check(farm, complete(upload(b"not an image".to_vec())), 422, "invalid_partial", Some("body")).await;
    let again = post(&format!("/leases/{}/return", lease.id), &json!({"token": lease.token, "why": 1}));
    check(farm, again, 400, "unknown_field", Some("why")).await;
    check(farm, complete(upload(b"again".to_vec())), 409, "lease_returned", None).await;

    // Images.
    let image = |rest: &str| call(Method::GET, format!("/jobs/{}/{rest}", job.id));
    check(farm, image("image.exr"), 404, "no_image_yet", None).await;
    check(farm, image("preview.png?exposure=bright"), 400, "invalid_field", Some("exposure")).await;
    check(farm, image("preview.png?exposure=1e9"), 400, "invalid_field", Some("exposure")).await;
    check(farm, image("preview.png?exposure=NaN"), 400, "invalid_field", Some("exposure")).await;
    check(farm, image("preview.png?curve=pastel"), 400, "invalid_field", Some("curve")).await;
    let problem = check(farm, image("preview.png?gamma=2"), 400, "unknown_field", Some("gamma")).await;
    assert_eq!((problem.value.as_deref(), problem.expected.as_deref()), (Some("2"), Some("`exposure` or `curve`")));
    check(farm, image("preview.png?curve=srgb&curve=filmic"), 400, "invalid_field", Some("curve")).await;
    check(farm, image("image.exr?frame=2"), 400, "unknown_field", Some("frame")).await;

    farm.worker().await.drain().await;
    farm.finished(job.id).await;
    assert!(bits(&farm.image(job.id).await) == expected_bits(4));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_page_has_its_files_and_nothing_else_exists_whatever_the_method() {
    let farm = TestFarm::start().await;
    let http = reqwest::Client::builder().no_proxy().build().unwrap();
    for (method, path, status) in [
        (Method::GET, "/", 200),
        (Method::HEAD, "/", 200),
        (Method::GET, "/app.js?v=1", 200),
        (Method::POST, "/app.js", 405),
        (Method::GET, "/app.js/", 404),
        (Method::GET, "//app.js", 404),
        (Method::GET, "/nothing", 404),
        (Method::HEAD, "/nothing", 404),
        (Method::POST, "/nothing", 404),
        (Method::DELETE, "/api", 404),
        (Method::OPTIONS, "/api/v2/jobs", 404),
        (Method::POST, "/API/V1/jobs", 404),
        (Method::OPTIONS, "/api/v1/jobs", 405),
    ] {
        let response = http.request(method.clone(), format!("{}{path}", farm.address)).send().await.unwrap();
        assert_eq!(response.status().as_u16(), status, "{method} {path}");
        assert_eq!(response.headers().contains_key("allow"), status == 405, "{method} {path}");
        if status >= 400 {
            assert_eq!(response.headers()["content-type"], "application/problem+json", "{method} {path}");
        } else {
            assert!(response.headers()["content-length"] != "0", "{method} {path}");
        }
    }
}

/// Sends a request on a connection, and answers the head and the body of the answer.
async fn exchange(connection: &mut TcpStream, head: &str, body: &[u8]) -> String {
    let request = format!("{head}\r\nhost: localhost\r\ncontent-length: {}\r\n\r\n", body.len());
    connection.write_all(request.as_bytes()).await.unwrap();
    connection.write_all(body).await.unwrap();
    let mut answer = Vec::new();
    loop {
        assert_ne!(connection.read_buf(&mut answer).await.unwrap(), 0, "{}", String::from_utf8_lossy(&answer));
        let text = String::from_utf8_lossy(&answer);
        let Some((head, body)) = text.split_once("\r\n\r\n") else { continue };
        let length =
            head.lines().find_map(|line| line.strip_prefix("content-length: ")).map(|text| text.parse().unwrap());
        if body.len() >= length.unwrap_or(0) {
            return text.into_owned();
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_connection_lives_on_when_the_answer_comes_before_the_body() {
    let farm = TestFarm::start_with(|config| config.max_partial_bytes = 1 << 20).await;
    let mut connection = TcpStream::connect(farm.address.trim_start_matches("http://")).await.unwrap();
    let body = vec![b' '; 9 << 20];
    let wrong_type = exchange(&mut connection, "POST /api/v1/jobs HTTP/1.1", &body).await;
    assert!(wrong_type.starts_with("HTTP/1.1 415 ") && !wrong_type.contains("connection: close"), "{wrong_type}");
    let lease = format!("PUT /api/v1/leases/{}/partial HTTP/1.1\r\ncontent-type: image/x-exr", Uuid::now_v7());
    let head = format!("{lease}\r\nclerestory-fencing-token: 1\r\nclerestory-core-ms: 1");
    let unknown_lease = exchange(&mut connection, &head, &body).await;
    assert!(
        unknown_lease.starts_with("HTTP/1.1 404 ") && !unknown_lease.contains("connection: close"),
        "{unknown_lease}"
    );
    let next = exchange(&mut connection, "GET /api/v1/jobs HTTP/1.1", b"").await;
    assert!(next.starts_with("HTTP/1.1 200 ") && next.ends_with("[]"), "{next}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_sends_far_too_much_gets_the_answer_whenever_it_reads() {
    let farm = TestFarm::start().await;
    let mut connection = TcpStream::connect(farm.address.trim_start_matches("http://")).await.unwrap();
    let head = "POST /api/v1/jobs HTTP/1.1\r\ncontent-type: application/json";
    let too_large = exchange(&mut connection, head, &vec![b' '; 100 << 20]).await;
    assert!(too_large.starts_with("HTTP/1.1 413 ") && too_large.contains("connection: close"), "{too_large}");
    assert_eq!(connection.read(&mut [0]).await.unwrap(), 0, "it ends in order");
}

#[tokio::test(flavor = "multi_thread")]
async fn uploads_that_stop_get_an_error_and_delay_no_other() {
    let farm = TestFarm::start_with(|config| config.lease_nodes = Some(200)).await;
    let job = farm.submit(1).await;
    let worker = farm.worker().await;
    let lease = worker.claim().await.unwrap();
    let mut stopped = Vec::new();
    for _ in 0..4 {
        let mut connection = TcpStream::connect(farm.address.trim_start_matches("http://")).await.unwrap();
        // Together they announce as much as is received at the same time.
        let head = format!(
            "PUT /api/v1/leases/{}/partial HTTP/1.1\r\nhost: localhost\r\ncontent-type: image/x-exr\r\n\
             clerestory-fencing-token: {}\r\nclerestory-core-ms: 1\r\ncontent-length: {}\r\n\r\n",
            lease.id,
            lease.token,
            8 << 20
        );
        connection.write_all(head.as_bytes()).await.unwrap();
        connection.write_all(&[0; 1000]).await.unwrap();
        stopped.push(connection);
    }
    let upload = worker.upload(&lease, noise_partial(&lease, &addresses(&lease)));
    tokio::time::timeout(Duration::from_secs(4), upload).await.expect("it waits for nobody").unwrap();
    assert_eq!(farm.finished(job.id).await.state, JobState::Done);
    for mut connection in stopped {
        let mut answer = Vec::new();
        let read = tokio::time::timeout(Duration::from_secs(30), connection.read_to_end(&mut answer));
        read.await.expect("an answer").unwrap();
        let answer = String::from_utf8_lossy(&answer);
        assert!(answer.starts_with("HTTP/1.1 408 ") && answer.contains("\"body_too_slow\""), "{answer}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn large_uploads_do_not_wait_for_each_other_for_ever() {
    let farm = TestFarm::start_with(|config| config.lease_nodes = Some(200)).await;
    farm.submit(1).await;
    let lease = farm.worker().await.claim().await.unwrap();
    // Each of them fits, and any two do not.
    let upload = || {
        let call = call(Method::PUT, format!("/leases/{}/partial", lease.id)).header("content-type", "image/x-exr");
        let call = call.header("clerestory-fencing-token", lease.token).header("clerestory-core-ms", 5);
        call.body(vec![0_u8; 20 << 20]).send(&farm)
    };
    let answers = tokio::time::timeout(Duration::from_secs(60), join_all((0..4).map(|_| upload()))).await.unwrap();
    let statuses: Vec<StatusCode> = answers.iter().map(reqwest::Response::status).collect();
    // The first that comes to its end is no partial, which ends the lease.
    let are_answered = statuses.iter().all(|status| matches!(status.as_u16(), 409 | 422));
    assert!(are_answered && statuses.contains(&StatusCode::UNPROCESSABLE_ENTITY), "{statuses:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_but_the_page_and_the_probes_opens_without_the_token() {
    let farm = TestFarm::start_with(|config| config.token = Some(TOKEN.parse().unwrap())).await;
    let farm = &farm;
    let session = |token: &str| call(Method::POST, "/session").json(&json!({"token": token}));
    let problem = check(farm, call(Method::GET, "/jobs"), 401, "unauthorized", Some("authorization")).await;
    assert_eq!(problem.detail, "no token was sent");
    let wrong = call(Method::GET, "/jobs").header("authorization", "Bearer 0123456789abcdef");
    let problem = check(farm, wrong, 401, "unauthorized", Some("authorization")).await;
    assert_eq!(problem.detail, "the token that was sent is not the farm's");
    check(farm, call(Method::GET, "/events"), 401, "unauthorized", Some("authorization")).await;
    check(farm, call(Method::GET, "/nothing"), 401, "unauthorized", Some("authorization")).await;
    let forged = call(Method::GET, "/jobs").header("cookie", format!("clerestory_session={TOKEN}"));
    check(farm, forged, 401, "unauthorized", Some("authorization")).await;
    check(farm, session("0123456789abcdef"), 401, "unauthorized", Some("token")).await;

    let opened = session(TOKEN).send(farm).await;
    assert_eq!(opened.status(), StatusCode::NO_CONTENT);
    let cookie = opened.headers()["set-cookie"].to_str().unwrap().to_owned();
    assert!(cookie.contains("HttpOnly") && cookie.contains("SameSite=Strict") && !cookie.contains(TOKEN));
    let pair = cookie.split(';').next().unwrap();
    let with_cookie = call(Method::GET, "/jobs").header("cookie", format!("theme=dark; {pair}")).send(farm).await;
    assert_eq!(with_cookie.status(), StatusCode::OK);

    let client = Client::new(&farm.address, Some(TOKEN)).unwrap();
    assert!(client.jobs().await.unwrap().is_empty());
    for path in ["/", "/app.js", "/healthz", "/readyz"] {
        let http = reqwest::Client::builder().no_proxy().build().unwrap();
        let response = http.get(format!("{}{path}", farm.address)).send().await.unwrap();
        assert!(response.status().is_success(), "{path}: {}", response.status());
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn pages_of_other_sites_cannot_use_a_coordinator_on_loopback() {
    let farm = TestFarm::start().await;
    let farm = &farm;
    // A foreign name that was made to resolve to 127.0.0.1.
    let rebound = call(Method::GET, "/jobs").header("host", "evil.example");
    check(farm, rebound, 403, "foreign_origin", Some("host")).await;
    let rebound = call(Method::GET, "/jobs").header("host", "127.0.0.1.evil.example:80");
    check(farm, rebound, 403, "foreign_origin", Some("host")).await;
    // A page that posts to this machine behind its reader's back.
    let posted = call(Method::POST, "/jobs").header("origin", "http://evil.example").json(&json!({}));
    check(farm, posted, 403, "foreign_origin", None).await;
    let posted = call(Method::POST, "/jobs").header("sec-fetch-site", "cross-site").json(&json!({}));
    check(farm, posted, 403, "foreign_origin", None).await;
    for host in ["localhost", "localhost:7171", "[::1]:7171", "127.0.0.1"] {
        let response = call(Method::GET, "/jobs").header("host", host).send(farm).await;
        assert_eq!(response.status(), StatusCode::OK, "{host}");
    }
    let own =
        call(Method::POST, "/session").header("origin", &farm.address).json(&json!({"token": ""})).send(farm).await;
    assert_eq!(own.status(), StatusCode::NO_CONTENT);
}
