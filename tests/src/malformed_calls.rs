//! What callers of the API get wrong, other than in scenes and partials.

use clerestory_api::{JobId, ProblemCode};
use reqwest::Method;
use serde_json::{Value, json};

use crate::calls::{BadCall, Call, MAX_BODY_BYTES, Refusal, content_hash, refused};
use crate::exr_files::{edited, picture, with_huge_claim};
use crate::malformed_scenes::{HEIGHT, WIDTH, sound_files, sound_scene};

/// An identity that does not exist.
const UNKNOWN_ID: &str = "01890000-0000-7000-8000-000000000000";

/// A hash of nothing that has been uploaded.
const NOTHING: &str = "00000000000000000000000000000000000000000000000000000000000000ff";

/// All bad calls, for a farm that takes assets of [`MAX_BODY_BYTES`] and has a job without an image.
pub fn bad_calls(job: JobId) -> Vec<BadCall> {
    [requests(), submissions(), references(), assets(), workers(), images(job)].concat()
}

fn invalid(field: &'static str, says: &'static [&'static str]) -> Refusal {
    refused(400, ProblemCode::InvalidField, field, says)
}

fn get(path: impl Into<String>) -> Call {
    Call::new(Method::GET, path)
}

fn post(path: impl Into<String>, body: &Value) -> Call {
    Call::json(path, body.to_string())
}

/// A submission without a fault.
fn sound_submission() -> Value {
    let assets: Value = sound_files()
        .iter()
        .map(|(name, content)| ((*name).to_owned(), Value::from(content_hash(content).to_string())))
        .collect();
    json!({"scene": sound_scene(), "assets": assets, "samples_per_pixel": 4})
}

/// The submission with another value for a member, or with a member more.
fn submission_with(name: &str, value: Value) -> Call {
    let mut submission = sound_submission();
    submission[name] = value;
    post("/jobs", &submission)
}

/// The submission with `text`, which stands there once, replaced by `other`.
fn submission_replaced(text: &str, other: &str) -> Call {
    let submission = sound_submission().to_string();
    assert_eq!(submission.matches(text).count(), 1, "{text}");
    Call::json("/jobs", submission.replace(text, other))
}

fn requests() -> Vec<BadCall> {
    let invalid_body = |says| refused(400, ProblemCode::InvalidBody, "body", says);
    let unknown_job = refused(404, ProblemCode::UnknownJob, "job", &[UNKNOWN_ID]);
    vec![
        BadCall::new(
            "a path of another program",
            get("/render"),
            refused(404, ProblemCode::UnknownPath, "path", &["/api/v1/render"]),
        ),
        BadCall::new(
            "a method of another path",
            Call::new(Method::DELETE, "/jobs"),
            refused(
                405,
                ProblemCode::MethodNotAllowed,
                "method",
                &["DELETE", "a method that the header `allow` lists"],
            ),
        ),
        BadCall::new("a job that is no identity", get("/jobs/seven"), invalid("job", &["seven", "a UUID"])),
        BadCall::new("a job that there is not", get(format!("/jobs/{UNKNOWN_ID}")), unknown_job.clone()),
        BadCall::new(
            "the end of a job that there is not",
            Call::new(Method::POST, format!("/jobs/{UNKNOWN_ID}/cancel")),
            unknown_job,
        ),
        BadCall::new(
            "a call that was addressed to another name",
            get("/jobs").header("host", "farm.example"),
            refused(403, ProblemCode::ForeignOrigin, "host", &["farm.example", "localhost"]),
        ),
        BadCall::new(
            "a body that is declared as a form",
            Call::new(Method::POST, "/jobs").header("content-type", "multipart/form-data").body("{}"),
            refused(
                415,
                ProblemCode::UnsupportedMediaType,
                "content-type",
                &["multipart/form-data", "application/json"],
            ),
        ),
        BadCall::new("no body", Call::json("/jobs", ""), invalid_body(&["EOF", "a JSON object"])),
        BadCall::new(
            "half a body",
            Call::json("/jobs", "{\"scene\": "),
            invalid_body(&["line 1 column 10", "a JSON object"]),
        ),
        BadCall::new(
            "a body in another encoding",
            Call::json("/jobs", b"\xff\xfe{\0".to_vec()),
            invalid_body(&["line 1 column 1", "a JSON object"]),
        ),
        BadCall::new(
            "a list instead of an object",
            Call::json("/workers", "[\"w\", 1, \"b\"]"),
            invalid_body(&["sequence", "[\"w\",1,\"b\"]", "a JSON object"]),
        ),
        BadCall::new(
            "two bodies in one",
            Call::json("/leases", "{} {}"),
            invalid_body(&["trailing characters", "one JSON object"]),
        ),
        BadCall::new(
            "lists in lists without end",
            Call::json("/jobs", format!("{{\"scene\":{}", "[".repeat(100_000))),
            invalid_body(&["recursion limit"]),
        ),
        BadCall::new(
            "a body of 17 MiB",
            Call::json("/jobs", vec![b' '; 17 << 20]),
            refused(413, ProblemCode::BodyTooLarge, "body", &["larger than allowed", "at most 16777216 bytes"]),
        ),
    ]
}

fn submissions() -> Vec<BadCall> {
    let missing = |says| Refusal { status: 409, code: ProblemCode::MissingAssets, field: None, says };
    let mut without_scene = sound_submission();
    without_scene.as_object_mut().expect("an object").remove("scene");
    let mut many_tiles = sound_submission();
    many_tiles["scene"]["film"] = json!({"width": 16384, "height": 16384});
    many_tiles["tile_size"] = json!(4);
    let mut unnamed_file = sound_submission();
    unnamed_file["assets"].as_object_mut().expect("an object").remove("floor.ply");
    let with_asset = |name: &str, hash: &str| {
        let mut submission = sound_submission();
        submission["assets"][name] = json!(hash);
        post("/jobs", &submission)
    };
    vec![
        BadCall::new("no scene", post("/jobs", &without_scene), invalid("scene", &["`scene` is missing"])),
        BadCall::new(
            "a misspelt member",
            submission_with("spp", json!(4)),
            refused(400, ProblemCode::UnknownField, "spp", &["`spp`", "`samples_per_pixel`"]),
        ),
        BadCall::new(
            "a member twice",
            submission_replaced("\"samples_per_pixel\":4", "\"samples_per_pixel\":4,\"samples_per_pixel\":8"),
            invalid("samples_per_pixel", &["`samples_per_pixel` is there twice", "one value"]),
        ),
        BadCall::new(
            "a member of the scene twice",
            submission_replaced("\"width\":48", "\"width\":48,\"width\":64"),
            invalid("scene.film.width", &["`scene.film.width` is there twice", "one value"]),
        ),
        BadCall::new(
            "a number that no double can hold",
            submission_replaced("\"thickness\":0.002", "\"thickness\":1e999"),
            invalid("scene.panes[0].thickness", &["number out of range", "a number that a double can hold"]),
        ),
        BadCall::new(
            "words for a number",
            submission_with("samples_per_pixel", json!("many")),
            invalid("samples_per_pixel", &["`many`", "a whole number"]),
        ),
        BadCall::new(
            "half a sample",
            submission_with("samples_per_pixel", json!(0.5)),
            invalid("samples_per_pixel", &["`0.5`", "a whole number"]),
        ),
        BadCall::new(
            "fewer samples than none",
            submission_with("samples_per_pixel", json!(-4)),
            invalid("samples_per_pixel", &["`-4`", "0 to 4294967295"]),
        ),
        BadCall::new(
            "no samples",
            submission_with("samples_per_pixel", json!(0)),
            invalid("samples_per_pixel", &["`0`", "1 to 16777216"]),
        ),
        BadCall::new(
            "tiles of 5000 pixels",
            submission_with("tile_size", json!(5000)),
            invalid("tile_size", &["`5000`", "1 to 1024"]),
        ),
        BadCall::new(
            "millions of tiles",
            post("/jobs", &many_tiles),
            invalid("tile_size", &["`4`", "at least 64 pixels", "16384 x 16384"]),
        ),
        BadCall::new(
            "no time",
            submission_with("time_limit_ms", json!(0)),
            invalid("time_limit_ms", &["`0`", "1 to 315360000000"]),
        ),
        BadCall::new(
            "more time than anybody has",
            submission_with("time_limit_ms", json!(i64::MAX)),
            invalid("time_limit_ms", &["`9223372036854775807`", "1 to 315360000000"]),
        ),
        BadCall::new(
            "an error that no image has",
            submission_with("target_estimated_mse", json!(0.0)),
            invalid("target_estimated_mse", &["`0.0`", "a positive number"]),
        ),
        BadCall::new(
            "an error to reach, and nothing to measure it against",
            submission_with("target_mse", json!(0.001)),
            invalid("target_mse", &["`0.001`", "a reference beside it"]),
        ),
        BadCall::new(
            "nothing to share out",
            submission_with("adaptive", json!(true)),
            invalid("samples_per_pixel", &["`4`", "for an adaptive job"]),
        ),
        BadCall::new(
            "words for yes or no",
            submission_with("adaptive", json!("perhaps")),
            invalid("adaptive", &["`perhaps`"]),
        ),
        BadCall::new(
            "a file that the scene names and the submission does not",
            post("/jobs", &unnamed_file),
            invalid("assets.floor.ply", &["absent", "content hash"]),
        ),
        BadCall::new(
            "a file that the scene does not name",
            with_asset("roof.ply", NOTHING),
            invalid("assets.roof.ply", &[NOTHING, "only files that the scene names"]),
        ),
        BadCall::new(
            "a hash that is none",
            with_asset("floor.ply", "B3"),
            invalid("assets.floor.ply", &["`B3`", "64 lowercase hexadecimal digits"]),
        ),
        BadCall::new(
            "a file that has not been uploaded",
            with_asset("floor.ply", NOTHING),
            missing(&["1 of the named contents"]),
        ),
        BadCall::new(
            "a reference that has not been uploaded",
            submission_with("reference", json!(NOTHING)),
            missing(&["1 of the named contents"]),
        ),
    ]
}

fn references() -> Vec<BadCall> {
    let with = |what, reference: Vec<u8>, says| {
        let call = submission_with("reference", json!(content_hash(&reference).to_string()));
        let uploads = sound_files().into_values().chain([reference]).collect();
        BadCall { what, uploads, call, refusal: refused(422, ProblemCode::InvalidReference, "reference", says) }
    };
    let sized = |width: u32, height: u32, value| picture(width as usize, height as usize, &["B", "G", "R"], value);
    let sound = sized(WIDTH, HEIGHT, 1.0);
    let one_value_less = |file: &mut exr::prelude::FlatImage| _ = file.layer_data[0].channel_data.list.remove(0);
    vec![
        with(
            "a reference that is no image",
            b"no image".to_vec(),
            &["not an OpenEXR file", "finite channels R, G and B"],
        ),
        with(
            "a reference that is cut off",
            sound[..sound.len() - 9].to_vec(),
            &["damaged", "finite channels R, G and B"],
        ),
        with(
            "a reference that claims 60001 pixels each way",
            with_huge_claim(&sound),
            &["the reference has 60001 x 60001 pixels", "48 x 32 pixels, as the scene's film"],
        ),
        with("a reference of another size", sized(8, 8, 1.0), &["8 x 8 pixels", "48 x 32 pixels, as the scene's film"]),
        with(
            "a reference of what is no number",
            sized(WIDTH, HEIGHT, f32::NAN),
            &["RGB is not finite at pixel (0, 0)", "finite channels R, G and B"],
        ),
        with(
            "a reference without blue",
            edited(&sound, one_value_less),
            &["the channels are G, R", "finite channels R, G and B"],
        ),
    ]
}

fn assets() -> Vec<BadCall> {
    let put = |hash: &str, content: Vec<u8>| Call::new(Method::PUT, format!("/assets/{hash}")).body(content);
    let large = vec![7; MAX_BODY_BYTES + 1];
    vec![
        BadCall::new(
            "a file under a name that is no hash",
            put("floor.ply", b"ply".to_vec()),
            invalid("hash", &["floor.ply", "64 lowercase hexadecimal digits"]),
        ),
        BadCall::new(
            "a file under the hash of another",
            put(NOTHING, b"ply".to_vec()),
            refused(422, ProblemCode::HashMismatch, "hash", &[NOTHING, "the content has the hash"]),
        ),
        BadCall::new(
            "a file that is too large",
            put(&content_hash(&large).to_string(), large),
            refused(413, ProblemCode::BodyTooLarge, "body", &["larger than allowed", "at most 1048576 bytes"]),
        ),
        BadCall::new(
            "a file that nobody has uploaded",
            get(format!("/assets/{NOTHING}")),
            refused(404, ProblemCode::UnknownAsset, "hash", &[NOTHING]),
        ),
    ]
}

fn workers() -> Vec<BadCall> {
    let unknown_worker = refused(404, ProblemCode::UnknownWorker, "worker", &[UNKNOWN_ID, "register again"]);
    let register = |name: &str, value: Value| {
        let mut registration = json!({"name": "w", "cores": 1, "build": "b"});
        registration[name] = value;
        post("/workers", &registration)
    };
    let claim = |name: &str, value: Value| {
        let mut request = json!({"worker": UNKNOWN_ID});
        request[name] = value;
        post("/leases", &request)
    };
    vec![
        BadCall::new("a worker without a name", register("name", json!("")), invalid("name", &["1 to 200 characters"])),
        BadCall::new("a worker without cores", register("cores", json!(0)), invalid("cores", &["`0`", "1 to 65536"])),
        BadCall::new(
            "a worker that tells too much",
            register("gpu", json!(true)),
            refused(400, ProblemCode::UnknownField, "gpu", &["`gpu`", "`probe_digest`"]),
        ),
        BadCall::new(
            "a heartbeat of an unknown worker",
            Call::new(Method::POST, format!("/workers/{UNKNOWN_ID}/heartbeat")),
            unknown_worker.clone(),
        ),
        BadCall::new("a claim of an unknown worker", claim("max_nodes", json!(1)), unknown_worker),
        BadCall::new(
            "a claim of what is no identity",
            claim("worker", json!("w")),
            invalid("worker", &["`w`", "a UUID"]),
        ),
        BadCall::new(
            "a claim for no nodes",
            claim("max_nodes", json!(0)),
            invalid("max_nodes", &["`0`", "at least 1"]),
        ),
        BadCall::new(
            "a claim that would wait for a minute",
            claim("wait_ms", json!(60_000)),
            invalid("wait_ms", &["`60000`", "at most 20000"]),
        ),
        BadCall::new(
            "a lease that there is not, kept",
            post(format!("/leases/{UNKNOWN_ID}/renew"), &json!({"token": 1})),
            refused(404, ProblemCode::UnknownLease, "lease", &[UNKNOWN_ID]),
        ),
        BadCall::new(
            "a lease that there is not, given back",
            post(format!("/leases/{UNKNOWN_ID}/return"), &json!({"token": 1})),
            refused(404, ProblemCode::UnknownLease, "lease", &[UNKNOWN_ID]),
        ),
        BadCall::new(
            "a reason that is an essay",
            post(format!("/leases/{UNKNOWN_ID}/return"), &json!({"token": 1, "failure": "x".repeat(501)})),
            invalid("failure", &["xxx", "at most 500 characters"]),
        ),
    ]
}

fn images(job: JobId) -> Vec<BadCall> {
    let preview = |query: &str| get(format!("/jobs/{job}/preview.png?{query}"));
    vec![
        BadCall::new(
            "an image before there is one",
            get(format!("/jobs/{job}/image.exr")),
            Refusal { status: 404, code: ProblemCode::NoImageYet, field: None, says: &["no node of this job"] },
        ),
        BadCall::new(
            "words for an exposure",
            preview("exposure=bright"),
            invalid("exposure", &["`bright`", "a number"]),
        ),
        BadCall::new(
            "an exposure of a thousand stops",
            preview("exposure=1000"),
            invalid("exposure", &["`1000`", "between -32 and 32"]),
        ),
        BadCall::new(
            "an exposure that is no number",
            preview("exposure=NaN"),
            invalid("exposure", &["`NaN`", "between -32 and 32"]),
        ),
        BadCall::new(
            "two exposures",
            preview("exposure=1&exposure=2"),
            invalid("exposure", &["`exposure` is there twice"]),
        ),
        BadCall::new(
            "an unknown curve",
            preview("curve=pastel"),
            invalid("curve", &["`pastel`", "`srgb` or `filmic`"]),
        ),
        BadCall::new(
            "an unknown parameter",
            preview("gamma=2"),
            refused(400, ProblemCode::UnknownField, "gamma", &["`gamma`", "`exposure` or `curve`"]),
        ),
    ]
}
