//! A coordinator says that it is not ready (`/readyz`) while what it stores cannot be stored, and why.

use clerestory_api::Problem;
use clerestory_test_servers::S3Server;
use clerestory_tests::farm::Farm;
use clerestory_tests::waiting::until;
use tokio::runtime::Runtime;

/// Why the coordinator says that it is not ready. `None` when it is.
pub(crate) fn unreadiness(farm: &Farm) -> Option<String> {
    let answer = async {
        let http = reqwest::Client::builder().no_proxy().build()?;
        let answer = http.get(format!("{}/readyz", farm.address())).send().await?;
        Ok::<_, reqwest::Error>((answer.status().as_u16(), answer.bytes().await?))
    };
    let (status, body) = Runtime::new().expect("a runtime").block_on(answer).expect("a coordinator that serves");
    match status {
        204 => None,
        503 => Some(serde_json::from_slice::<Problem>(&body).expect("a problem document").detail),
        _ => panic!("{status}"),
    }
}

/// Asks until the answer is as expected. Outcomes of a bucket hold for ten seconds, and a silent one is given four.
fn wait_until(farm: &Farm, what: &str, is_expected: impl Fn(Option<&str>) -> bool) {
    until(what, || is_expected(unreadiness(farm).as_deref()));
}

#[test]
fn a_full_disk_and_an_object_store_that_is_away_are_named_until_they_are_mended() {
    let mut objects = S3Server::start().expect("an S3 server");
    // They would be logged.
    let silent = [("CLERESTORY_LOG".to_owned(), "off".to_owned())];
    let environment = [&objects.environment()[..], &silent].concat();
    let bucket = format!("s3://{}", objects.new_bucket());
    let farm = Farm::start_with_faults(1, &environment, &["--object-store", &bucket]);
    let ready = |reason: Option<&str>| reason.is_none();
    let says = |words: &'static str| move |reason: Option<&str>| reason.is_some_and(|reason| reason.contains(words));
    wait_until(&farm, "ready", ready);

    let faults = farm.faults(0).expect("a disk that can be full");
    faults.fill_disk(true);
    wait_until(&farm, "not ready with a full disk", says("the database cannot be written"));
    faults.fill_disk(false);
    wait_until(&farm, "ready when there is room", ready);

    objects.kill();
    wait_until(&farm, "not ready without its object store", says("the blob store"));
    objects.restart().expect("an S3 server");
    wait_until(&farm, "ready when its object store is back", ready);
    objects.suspend(true);
    wait_until(&farm, "not ready while its object store is silent", says("the blob store"));
    objects.suspend(false);
    wait_until(&farm, "ready when its object store answers", ready);
}
