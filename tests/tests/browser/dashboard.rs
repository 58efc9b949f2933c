//! The dashboard as a user sees it: a real coordinator and real workers, watched with a real browser.
//!
//! Needs Debian's packages `chromium` and `chromium-driver`, and the built binary (`cargo build --release`).

#![expect(clippy::unwrap_used, reason = "a test that cannot drive its browser has failed")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clerestory_api::{Client, LeaseRequest, PartialUpload, WorkerRegistration};
use clerestory_render_core::document::WITH_CAUSTIC;
use clerestory_tests::browser::Browser;
use clerestory_tests::calls::Caller;
use clerestory_tests::farm::Farm;
use clerestory_tests::hand_worker::{Delivery, HandWorker};
use serde_json::Value;

/// Pixels across and down where the error does not matter.
const SMALL: &str = "48x48";
/// Samples for each pixel that no worker finishes while a test watches.
const ENDLESS: &str = "1000000";

fn in_scenes(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join("scenes/references").join(file)
}

fn scene() -> PathBuf {
    in_scenes("crown-point.json")
}

#[tokio::test]
async fn a_fresh_farm_tells_how_to_submit_a_scene_and_start_a_worker() {
    let farm = Farm::start(None, &[]);
    let browser = Browser::open(farm.address()).await;
    browser.shows(".connection", "Live").await;
    browser.shows("pre", &format!("clerestory worker --coordinator {}", farm.address())).await;
    browser.shows("pre", "clerestory submit scenes/").await;
    browser.shows("pre", &format!("--coordinator {}", farm.address())).await;
    assert_eq!(browser.complaints().await, [""; 0]);
    let foreign = "return performance.getEntriesByType('resource').map(entry => entry.name)
        .filter(name => !name.startsWith(location.origin))";
    assert_eq!(browser.script(foreign).await, Value::Array(Vec::new()), "the page asks nobody but its coordinator");

    // Behind a proxy that holds events back a stream opens, and nothing comes.
    browser.script(SILENCE_STREAMS).await;
    browser.shows(".connection", "Polling").await;
    let job = farm.submit(&scene(), &["--size", SMALL, "--spp", "16"]);
    browser.shows(&format!(".job-row[data-job='{job}'] .state"), "Queued").await;
}

/// Lets the page connect anew, to a stream that stays silent.
const SILENCE_STREAMS: &str = "
    window.EventSource = class extends EventTarget {
        constructor() { super(); setTimeout(() => this.onopen?.()); }
        close() {}
    };
    window.dispatchEvent(new Event('online'));";

/// Records a small grey copy of each image that the page shows.
const RECORD_IMAGES: &str = "
    window.recorded = [];
    const canvas = document.createElement('canvas');
    const context = canvas.getContext('2d', { willReadFrequently: true });
    const record = () => {
        const image = document.querySelector('#frame');
        if (!image?.complete || image.naturalWidth === 0 || image.src === window.recordedAddress) return;
        window.recordedAddress = image.src;
        canvas.width = image.naturalWidth;
        canvas.height = image.naturalHeight;
        context.drawImage(image, 0, 0);
        const pixels = context.getImageData(0, 0, canvas.width, canvas.height).data;
        window.recorded.push(Array.from(pixels).filter((_, index) => index % 4 === 1));
    };
    const observer = new MutationObserver(record);
    observer.observe(document.body, { subtree: true, childList: true, attributes: true, attributeFilter: ['src'] });
    document.addEventListener('load', record, true);";

/// Mean squared difference of each recorded image from the last one.
const DISTANCES_FROM_LAST: &str = "
    const last = window.recorded[window.recorded.length - 1];
    const squares = image => image.reduce((sum, value, at) => sum + (value - last[at]) ** 2, 0);
    return window.recorded.map(image => squares(image) / last.length);";

#[tokio::test]
async fn a_job_is_watched_from_its_submission_to_its_last_round() {
    let mut farm = Farm::start(None, &[]);
    let browser = Browser::open(farm.address()).await;
    browser.shows(".connection", "Live").await;

    let reference = in_scenes("crown-point-reference.exr");
    let options =
        ["--spp", "256", "--tile", "32", "--name", "A crown window", "--reference", reference.to_str().unwrap()];
    let job = farm.submit(&scene(), &options);
    let row = format!(".job-row[data-job='{job}']");
    browser.shows(&format!("{row} .state"), "Queued").await;
    browser.click(&format!("{row} a"), "A crown window").await;
    browser.shows(".no-image", "Waiting for a worker").await;
    browser.script(RECORD_IMAGES).await;

    farm.start_worker("nave");
    browser.shows("article.job .state", "Done").await;
    browser.shows("article.job .percent", "100 %").await;
    assert_eq!(browser.script("return document.querySelector('article.job progress').value").await, 1);
    browser.shows(".samples", "256 of 256").await;
    let shown = "const image = document.querySelector('#frame'); return [image.naturalWidth, image.naturalHeight]";
    assert_eq!(browser.script(shown).await, serde_json::json!([128, 128]));

    let distances = numbers(&browser.script(DISTANCES_FROM_LAST).await);
    let (first, middle) = (distances[0], distances[distances.len() / 2]);
    assert!(distances.len() >= 3 && first > middle && middle > 0.0, "the frame does not sharpen: {distances:?}");

    let rounds = "const rows = document.querySelectorAll('table.rounds tbody tr').length;
        const drawn = Number(document.querySelector('.chart')?.dataset.points);
        const fact = [...document.querySelectorAll('.facts dt')].find(each => each.textContent === 'rounds');
        const counted = Number(fact.nextElementSibling.textContent);
        return rows === drawn && rows === counted ? rows : null";
    let rounds = browser.script_gives(rounds).await.as_u64().unwrap();
    assert!(rounds >= 3, "{rounds} rounds make no curve");
    let column =
        "return [...document.querySelectorAll('td[data-column=\"MSE\"]')].map(cell => Number(cell.textContent))";
    let errors = numbers(&browser.script(column).await);
    let (newest, oldest) = (errors[0], errors[errors.len() - 1]);
    assert!(newest < oldest / 2.0, "the error does not fall; newest first: {errors:?}");
    let ink = "const canvas = document.querySelector('.chart canvas');
        const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
        return new Set(Array.from(pixels).filter((_, index) => index % 4 === 3)).size";
    assert!(browser.script(ink).await.as_u64().unwrap() > 1, "nothing is drawn on the chart");

    browser.click(".brand", "").await;
    browser.shows(&format!("{row} .state"), "Done").await;
    browser.shows(".workers tbody th", "nave").await;
    browser.shows(".workers .state", "Idle").await;
    assert_eq!(browser.complaints().await, [""; 0]);
}

#[tokio::test]
async fn between_rounds_the_page_shows_a_live_error_and_what_it_is_of() {
    let mut farm = Farm::start(None, &[]);
    farm.start_worker("nave");
    let reference = in_scenes("crown-point-reference.exr");
    let job = farm.submit(&scene(), &["--spp", ENDLESS, "--tile", "32", "--reference", reference.to_str().unwrap()]);
    let browser = Browser::open(&format!("{}/#/jobs/{job}", farm.address())).await;
    browser.shows(".live-error", "live: MSE ").await;
    browser.shows(".live-error", "over 100 % of the pixels at ").await;
    browser.click("button.danger", "Cancel job").await;
    browser.click("dialog button", "Cancel the job").await;
    browser.shows("article.job .state", "Cancelled").await;
    assert_eq!(
        browser.script("return document.querySelector('.live-error')").await,
        Value::Null,
        "what has ended is not live"
    );
    assert_eq!(browser.complaints().await, [""; 0]);
}

#[tokio::test]
async fn a_job_that_its_time_ends_shows_the_time_and_no_total() {
    let mut farm = Farm::start(None, &[]);
    farm.start_worker("nave");
    let job = farm.submit(&scene(), &["--size", SMALL, "--time", "2", "--wait"]);
    let browser = Browser::open(&format!("{}/#/jobs/{job}", farm.address())).await;
    browser.shows("article.job .percent", "100 %").await;
    browser.shows(".samples", "within 2.0 s").await;
}

#[tokio::test]
async fn an_adaptive_job_says_that_its_passes_are_shared_out() {
    let mut farm = Farm::start(None, &[]);
    farm.start_worker("nave");
    let job = farm.submit(&scene(), &["--size", "16x16", "--spp", "1024", "--adaptive", "--wait"]);
    let browser = Browser::open(&format!("{}/#/jobs/{job}", farm.address())).await;
    browser.shows("article.job .percent", "100 %").await;
    browser.shows(".sharing", "shared out by noise").await;
    browser.shows(".samples", "1088 of 1088").await;
    assert_eq!(browser.complaints().await, [""; 0]);
}

#[tokio::test]
async fn a_job_that_its_target_ends_shows_the_target_and_why_it_ended() {
    let mut farm = Farm::start(None, &[]);
    farm.start_worker("nave");
    // Any image of four blocks of 256 samples is as good as this.
    let job = farm.submit(&scene(), &["--size", "16x16", "--target-estimated-mse", "1e6", "--wait"]);
    let browser = Browser::open(&format!("{}/#/jobs/{job}", farm.address())).await;
    browser.shows("article.job .percent", "100 %").await;
    browser.shows(".samples", "1024 to estimated MSE 1.000e+6").await;
    browser.shows(".reason", "its target estimated MSE").await;
    browser.shows(".convergence", "at most 1.000e+6").await;
    browser.shows(".chart .u-legend", "target").await;
    assert_eq!(browser.complaints().await, [""; 0]);
}

#[tokio::test]
async fn a_job_lists_what_was_assumed_for_a_file_and_what_is_left_out_of_it() {
    let mut farm = Farm::start(None, &[]);
    farm.start_worker("nave");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("wall.obj");
    std::fs::write(&file, "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl <i>moss</i>\nf 1 2 3\n").unwrap();
    let job = farm.submit(&file, &["--size", "16x16", "--spp", "16", "--wait"]);
    let browser = Browser::open(&format!("{}/#/jobs/{job}", farm.address())).await;
    browser.shows("section[aria-labelledby=assumed-heading] li", "The file has no lamp and no sun").await;
    let notes = "section[aria-labelledby=imports-heading]";
    browser.shows(&format!("{notes} li"), "material <i>moss</i> is not described").await;
    let marked = format!("return document.querySelector('{notes} i')");
    assert_eq!(browser.script(&marked).await, Value::Null, "names in files are text");
    assert_eq!(browser.complaints().await, [""; 0]);
}

#[tokio::test]
async fn exposure_makes_the_frame_brighter() {
    let mut farm = Farm::start(None, &[]);
    farm.start_worker("nave");
    let job = farm.submit(&scene(), &["--size", SMALL, "--spp", "16", "--wait"]);
    let browser = Browser::open(&format!("{}/#/jobs/{job}", farm.address())).await;
    let brightness = "const image = document.querySelector('#frame');
        if (!image?.complete || image.src === window.measured) return null;
        const canvas = document.createElement('canvas');
        [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
        const context = canvas.getContext('2d');
        context.drawImage(image, 0, 0);
        window.measured = image.src;
        return context.getImageData(0, 0, canvas.width, canvas.height).data.reduce((sum, value) => sum + value, 0)";
    browser.shows(".exposure output", "automatic").await;
    browser.script_gives(brightness).await;
    let expose = |stops: i32| {
        format!(
            "const slider = document.querySelector('#exposure');
            slider.value = {stops};
            slider.dispatchEvent(new Event('input', {{ bubbles: true }}))"
        )
    };
    browser.script(&expose(-1)).await;
    browser.shows(".exposure output", "−1 stop").await;
    let before = browser.script_gives(brightness).await.as_f64().unwrap();
    browser.script(&expose(1)).await;
    browser.shows(".exposure output", "+1 stop").await;
    let after = browser.script_gives(brightness).await.as_f64().unwrap();
    assert!(after > before, "two stops more give {after}, before {before}");
}

#[tokio::test]
async fn a_job_is_cancelled_after_a_question_and_keeps_what_is_complete() {
    let mut farm = Farm::start(None, &[]);
    farm.start_worker("nave");
    let job = farm.submit(&scene(), &["--size", SMALL, "--spp", ENDLESS, "--tile", "16"]);
    let browser = Browser::open(&format!("{}/#/jobs/{job}", farm.address())).await;
    browser.script_gives("return document.querySelector('#frame')?.naturalWidth || null").await;

    browser.click("button.danger", "Cancel job").await;
    browser.click("dialog button", "Keep rendering").await;
    browser.shows("article.job .state", "Running").await;
    browser.click("button.danger", "Cancel job").await;
    browser.click("dialog button", "Cancel the job").await;
    browser.shows("article.job .state", "Cancelled").await;
    let exr = browser.shows(".actions a", "Download EXR").await.attr("href").await.unwrap().unwrap();
    let image = reqwest::get(format!("{}/{exr}", farm.address())).await.unwrap().error_for_status().unwrap();
    assert_eq!(image.bytes().await.unwrap()[..4], [0x76, 0x2f, 0x31, 0x01], "the magic number of OpenEXR");
    browser.click("nav a", "All jobs").await;
    browser.shows(".workers .state", "Idle").await;
    assert_eq!(browser.complaints().await, [""; 0]);
}

#[tokio::test]
async fn a_held_job_says_why_and_goes_on_when_it_is_released() {
    let mut farm = Farm::start(None, &["--lease-seconds", "1"]);
    let client = Client::new(farm.address(), None).unwrap();
    let job = farm.submit(&scene(), &["--size", "16x16", "--spp", "16"]);
    let browser = Browser::open(&format!("{}/#/jobs/{job}", farm.address())).await;
    browser.shows("article.job .state", "Queued").await;
    // They know the layer `caustic` of scenes with glass.
    let method_digests = BTreeMap::from([(format!("fnee{WITH_CAUSTIC}"), vec!["digest".to_owned()])]);
    for name in ["nave", "aisle", "apse"] {
        let registration = WorkerRegistration {
            name: name.to_owned(),
            cores: 1,
            build: "by hand".to_owned(),
            method_digests: method_digests.clone(),
            ..WorkerRegistration::default()
        };
        let worker = client.register_worker(&registration).await.unwrap().id;
        // It waits for the lease of the one before to run out, and is not heard of again.
        let request =
            LeaseRequest { worker, max_nodes: Some(1), wanted_ms: Some(60_000), wait_ms: 20_000, built: Vec::new() };
        client.claim_lease(&request).await.unwrap().unwrap();
    }
    browser.shows("article.job .state", "Held").await;
    browser.shows(".hold", "`nave`, `aisle` and `apse`").await;
    browser.click(".hold button", "Let it go on").await;
    browser.shows("article.job .state", "Running").await;
    farm.start_worker("crypt");
    browser.shows("article.job .state", "Done").await;
    browser.click("nav a", "All jobs").await;
    let is_shown = |name: &str, shown: bool| {
        format!(
            "const names = [...document.querySelectorAll('.workers tbody th')].map(name => name.textContent.trim());
            return names.length > 0 && names.includes('{name}') === {shown} || null"
        )
    };
    browser.script_gives(&is_shown("crypt", true)).await;
    farm.ask_worker_to_stop(0);
    browser.script_gives(&is_shown("crypt", false)).await;
    assert_eq!(browser.complaints().await, [""; 0]);
}

#[tokio::test]
async fn a_job_that_no_worker_can_continue_names_the_two_ways_out() {
    let farm = Farm::start(None, &[]);
    let client = Client::new(farm.address(), None).unwrap();
    let job = farm.submit(&scene(), &["--size", "16x16", "--spp", "16", "--tile", "8"]);
    let id = job.parse().unwrap();
    let begins = std::thread::scope(|threads| {
        // The calls of a worker by hand block.
        let begin = || {
            let caller = Caller::new(&farm);
            let worker = HandWorker::register(&caller, id);
            let Delivery { lease, partial } = worker.claim();
            let upload = PartialUpload { lease: lease.id, token: lease.token, core_ms: 5, body: partial.into() };
            caller.wait(caller.client().upload_partial(upload)).unwrap();
            worker.id()
        };
        threads.spawn(begin).join().unwrap()
    });
    let browser = Browser::open(&format!("{}/#/jobs/{job}", farm.address())).await;
    browser.shows("article.job .state", "Running").await;
    let other = WorkerRegistration { name: "apse".to_owned(), cores: 1, build: "b".to_owned(), ..Default::default() };
    client.register_worker(&other).await.unwrap();
    client.end_worker(begins).await.unwrap();
    browser.shows("article.job .state", "Waiting").await;
    browser.shows(".build-wait", "start a worker of build `by hand`").await;
    browser.shows(".build-wait", "or submit the job again").await;
    browser.click("nav a", "All jobs").await;
    browser.shows(".job-row .failure", "submit the job again").await;
    browser.shows(".workers th", "Computes other bits").await;
    assert_eq!(browser.complaints().await, [""; 0]);
}

#[tokio::test]
async fn a_wrong_token_is_explained_and_the_right_one_opens_the_farm() {
    let token = "5f2b7c0e91d34a6888aa";
    let farm = Farm::start(Some(token), &[]);
    let browser = Browser::open(farm.address()).await;
    browser.shows("h1", "asks for its token").await;
    browser.fill("#token", "guessed").await;
    browser.click("form button", "Enter").await;
    let text = browser.shows(".problem", "token").await.text().await.unwrap();
    assert!(!text.contains("guessed"), "a secret is not repeated: {text}");
    browser.fill("#token", token).await;
    browser.click("form button", "Enter").await;
    browser.shows(".connection", "Live").await;
    browser.shows(".empty", "Nothing has been submitted yet").await;
    let cookies = browser.script("return document.cookie").await;
    assert_eq!(cookies, "", "scripts cannot read the session");
}

#[tokio::test]
async fn the_page_outlives_its_coordinator() {
    let mut farm = Farm::start(None, &[]);
    farm.start_worker("nave");
    let job = farm.submit(&scene(), &["--size", SMALL, "--spp", ENDLESS, "--tile", "16", "--name", "A long job"]);
    let browser = Browser::open(&format!("{}/#/jobs/{job}", farm.address())).await;
    browser.shows(".connection", "Live").await;
    browser.script_gives("return document.querySelector('#frame')?.naturalWidth || null").await;
    // Lost if the page were loaded anew.
    browser.script("window.isTheSamePage = true").await;

    farm.kill_coordinator(0);
    browser.shows(".connection", "Offline").await;
    browser.shows(".offline", "The coordinator is out of reach").await;
    assert_eq!(browser.text("#job-heading").await, "A long job", "what is known stays on the page");
    let samples = browser.text(".samples").await;

    farm.restart_coordinator(0);
    browser.shows(".connection", "Live").await;
    let goes_on = format!("return document.querySelector('.samples').textContent !== {samples:?} || null");
    browser.script_gives(&goes_on).await;
    assert_eq!(browser.script("return document.querySelector('.offline')").await, Value::Null);
    assert_eq!(browser.script("return window.isTheSamePage").await, true);
}

#[track_caller]
fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|each| each.as_f64().unwrap()).collect()
}
