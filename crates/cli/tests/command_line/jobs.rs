//! Jobs on a farm, and the commands that wait for them.

use std::fs;
use std::io::{BufRead, BufReader, Lines};
use std::process::{Child, ChildStderr, Stdio};
use std::time::Duration;

use serde_json::Value;

use crate::support::{Folder, Service};

/// A command that submits and waits, with its output.
struct Waiting {
    process: Child,
    messages: Lines<BufReader<ChildStderr>>,
    job: String,
}

impl Waiting {
    fn start(folder: &Folder, farm: &Service, options: &[&str]) -> Self {
        let words = ["submit", "scene.json", "--wait", "--coordinator", farm.address()];
        let mut command = folder.command(&[words.as_slice(), options].concat());
        let mut process = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let messages = BufReader::new(process.stderr.take().unwrap()).lines();
        let mut waiting = Self { process, messages, job: String::new() };
        let message = waiting.message("Job ");
        let page = message.split(' ').next_back().unwrap();
        assert!(page.starts_with(farm.address()), "{message}");
        waiting.job = page.rsplit('/').next().unwrap().to_owned();
        waiting
    }

    /// Waits for a message that contains a text.
    #[track_caller]
    fn message(&mut self, text: &str) -> String {
        self.messages.by_ref().map(Result::unwrap).find(|line| line.contains(text)).unwrap()
    }

    /// Waits for the end. Returns the exit code and the output since the last look.
    fn end(mut self) -> (Option<i32>, String) {
        let rest: Vec<String> = self.messages.map(Result::unwrap).collect();
        (self.process.wait().unwrap().code(), rest.join("\n"))
    }
}

#[test]
fn who_waits_is_told_once_that_the_coordinator_is_away_and_when_it_is_back() {
    let folder = Folder::new();
    let coordinator = folder.coordinator("127.0.0.1:0", None);
    let mut waiting = Waiting::start(&folder, &coordinator, &[]);
    let listen = coordinator.address().trim_start_matches("http://").to_owned();
    drop(coordinator);
    let away = waiting.message("does not answer");
    assert!(away.contains(&listen) && away.contains("trying again"), "{away}");
    let coordinator = folder.coordinator(&listen, None);
    waiting.message("answers again");
    let lonely = waiting.message("no worker");
    assert!(lonely.contains(&format!("`clerestory worker --coordinator {}`", coordinator.address())), "{lonely}");

    let cancel = ["cancel", &waiting.job, "--coordinator", coordinator.address()];
    assert_eq!(folder.succeeds(&cancel), format!("{} is cancelled\n", waiting.job));
    assert_eq!(folder.succeeds(&cancel), format!("{} was already cancelled\n", waiting.job));
    let (code, messages) = waiting.end();
    assert_eq!(code, Some(1), "{messages}");
    assert!(messages.contains("cancelled before anything was complete"), "{messages}");
    assert!(!messages.contains("answer"), "told once: {messages}");
}

#[cfg(unix)]
#[test]
fn who_stops_waiting_learns_that_the_job_goes_on() {
    use nix::sys::signal::{Signal, kill};
    use nix::unistd::Pid;

    let folder = Folder::new();
    let coordinator = folder.coordinator("127.0.0.1:0", None);
    let waiting = Waiting::start(&folder, &coordinator, &["-o", "image.exr"]);
    kill(Pid::from_raw(i32::try_from(waiting.process.id()).unwrap()), Signal::SIGINT).unwrap();
    let job = waiting.job.clone();
    let (code, messages) = waiting.end();
    assert_eq!(code, Some(130), "{messages}");
    assert!(messages.contains(&format!("job {job} goes on: see `clerestory watch {job}`")), "{messages}");
    assert!(folder.succeeds(&["jobs", "--coordinator", coordinator.address()]).contains(&job));
    assert!(
        !fs::read_dir(folder.path("")).unwrap().any(|file| file.unwrap().path().extension() == Some("part".as_ref()))
    );
}

#[test]
fn an_upload_draws_no_bar_where_there_is_no_terminal() {
    let folder = Folder::new();
    folder.succeeds(&["render", "scene.json", "--spp", "4", "-o", "reference.exr"]);
    let farm = folder.coordinator("127.0.0.1:0", None);
    let words = ["submit", "scene.json", "--reference", "reference.exr", "--json", "--coordinator", farm.address()];
    let output = folder.run(&words);
    let messages = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{messages}");
    assert!(serde_json::from_slice::<Value>(&output.stdout).unwrap()["reference"].is_string());
    assert!(messages.starts_with("Job ") && !messages.contains('\x1b'), "{messages}");
}

#[test]
fn a_cancelled_job_leaves_its_image_and_fails_those_who_wait() {
    let folder = Folder::new();
    let farm = folder.farm();
    let waiting = Waiting::start(&folder, &farm, &["--spp", "1000000", "-o", "image.exr", "--png"]);
    let has_begun = || {
        let jobs = folder.succeeds(&["jobs", "--json", "--coordinator", farm.address()]);
        serde_json::from_str::<Value>(&jobs).unwrap()[0]["samples"].as_u64() > Some(0)
    };
    while !has_begun() {
        std::thread::sleep(Duration::from_millis(20));
    }
    let job = waiting.job.clone();
    folder.succeeds(&["cancel", &job, "--coordinator", farm.address()]);
    let (code, messages) = waiting.end();
    assert_eq!(code, Some(1), "{messages}");
    assert!(messages.contains(&format!("job {job} was cancelled; its image")), "{messages}");
    assert!(messages.contains("Wrote image.exr\nWrote image.png"), "{messages}");
    assert!(folder.path("image.png").is_file());
    assert!(!messages.contains("No standard error"), "enough samples were ordered: {messages}");
    assert_eq!(folder.comparison("image.exr", "image.exr")["bit_identical"], true);

    let watched = folder.run(&["watch", &job, "--coordinator", farm.address()]);
    assert_eq!(watched.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&watched.stderr).contains("was cancelled"));
}

#[test]
fn an_image_of_a_farm_without_a_standard_error_says_why_and_in_which_tiles() {
    let folder = Folder::new();
    let farm = folder.farm();
    let submit = ["submit", "scene.json", "--wait", "--tile", "8", "-o", "image.exr", "--coordinator", farm.address()];
    let messages = |options: &[&str]| {
        let output = folder.run(&[&submit[..], options].concat());
        let messages = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{messages}");
        messages
    };
    let few = messages(&["--spp", "8"]);
    assert!(few.contains("No standard error: 8 samples in each pixel") && few.contains("--spp 16 or more"), "{few}");
    assert!(!few.contains("Standard error:"), "said once: {few}");
    assert!(!messages(&["--spp", "16"]).contains("tandard error"));
    // More is ordered than there is time for.
    let stopped = messages(&["--spp", "1000000", "--samples-per-block", "65536", "--time", "2"]);
    assert!(stopped.contains("Standard error: no tile has a standard error"), "{stopped}");
    assert!(stopped.contains("less than two blocks of 65536 samples"), "{stopped}");
}

#[test]
fn a_demo_deletes_nothing_of_others_and_hears_no_settings_of_other_farms() {
    let folder = Folder::new();
    fs::create_dir_all(folder.path("demo-output/farm")).unwrap();
    fs::write(folder.path("demo-output/farm/letter.txt"), "dear").unwrap();
    let mut command = folder.command(&["demo", "--size", "12x8", "--spp", "4"]);
    let settings =
        [("CLERESTORY_TOKEN", "short"), ("CLERESTORY_TOKEN_FILE", "absent"), ("CLERESTORY_LEASE_NODES", "many")];
    let output = command.envs(settings).output().unwrap();
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{messages}");
    assert!(messages.contains("640x480"), "the reference has another size: {messages}");
    assert!(messages.contains("`clerestory farm`") && messages.contains("`clerestory submit "), "{messages}");
    assert!(!messages.contains("stays open"), "standard output is no terminal, so it ends: {messages}");
    let mut left: Vec<_> = fs::read_dir(folder.path("demo-output"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    left.sort();
    assert_eq!(left, ["coordinator.log", "demo.exr", "demo.png", "farm", "worker-1.log", "worker-2.log"]);
    assert_eq!(fs::read_to_string(folder.path("demo-output/farm/letter.txt")).unwrap(), "dear");
}
