//! The services and their settings.

use std::collections::BTreeSet;
use std::net::TcpListener;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use crate::support::{Folder, Service};

#[test]
fn the_printed_configuration_does_not_hold_the_token() {
    let folder = Folder::new();
    let token = "0123456789abcdef0123456789abcdef";
    let output = folder.command(&["coordinator", "--print-config"]).env("CLERESTORY_TOKEN", token).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("listen = \"127.0.0.1:7171\"") && !text.contains(token), "{text}");
}

#[test]
fn a_coordinator_for_all_machines_prints_where_this_one_reaches_it_and_tells_what_holds_for_others() {
    let folder = Folder::new();
    // Its standard input is at its end, so it stops at once.
    let mut command = folder.command(&["coordinator", "--listen", "0.0.0.0:0", "--stop-with-stdin"]);
    let output = command.env("CLERESTORY_TOKEN", "0123456789abcdef").output().unwrap();
    let (address, log) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    let port = address.trim_end().strip_prefix("http://127.0.0.1:").unwrap();
    let told = log.lines().find(|line| line.contains("other machines reach")).unwrap();
    assert!(told.contains(&format!("port={port}")), "{told}");
}

#[test]
fn a_coordinator_prints_its_address_and_ends_with_its_parent() {
    let folder = Folder::new();
    let coordinator = folder.coordinator("127.0.0.1:0", None);
    let jobs = folder.succeeds(&["jobs", "--json", "--coordinator", coordinator.address()]);
    assert_eq!(jobs.trim(), "[]");
    assert!(coordinator.ended_by_its_parent().success());
    assert!(folder.path("data").is_dir());
}

#[test]
fn an_object_store_on_this_machine_is_not_called_through_a_proxy() {
    let folder = Folder::new();
    let store = TcpListener::bind("127.0.0.1:0").unwrap();
    let proxy = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = |listener: &TcpListener| format!("http://{}", listener.local_addr().unwrap());
    let mut command = folder.command(&["coordinator", "--listen", "127.0.0.1:0", "--object-store", "s3://glass"]);
    command.env("AWS_ENDPOINT_URL", address(&store)).env("AWS_ACCESS_KEY_ID", "k").env("AWS_SECRET_ACCESS_KEY", "s");
    for variable in ["http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"] {
        command.env(variable, address(&proxy));
    }
    let (told, called) = mpsc::channel();
    for (name, listener) in [("store", store), ("proxy", proxy)] {
        let told = told.clone();
        std::thread::spawn(move || listener.accept().map(|_| told.send(name)));
    }
    let mut coordinator = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let first = called.recv_timeout(Duration::from_secs(30));
    coordinator.kill().unwrap();
    coordinator.wait().unwrap();
    assert_eq!(first, Ok("store"));
}

/// The settings of ours that a text names.
fn settings(text: &str) -> BTreeSet<&str> {
    let is_name = |c: char| c.is_ascii_uppercase() || c == '_';
    text.split(|c| !is_name(c)).filter(|word| word.starts_with("CLERESTORY_")).collect()
}

#[test]
fn what_starts_services_names_settings_that_they_have() {
    let deploy = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../deploy");
    let read = |file: &str| std::fs::read_to_string(deploy.join(file)).unwrap();
    let kubernetes = read("kubernetes.yaml");
    let (how, objects) = kubernetes.split_once("\n---\n").unwrap();
    let pods: Vec<&str> = objects.split("\n---\n").filter(|object| object.contains("containers:")).collect();
    assert_eq!(pods.len(), 2);
    let folder = Folder::new();
    for (service, pod) in ["coordinator", "worker"].into_iter().zip(pods) {
        assert!(pod.contains(&format!("args: [{service}]")), "{pod}");
        let unit = read(&format!("systemd/clerestory-{service}.service"));
        assert!(unit.contains(&format!("clerestory {service}\n")), "{unit}");
        // The coordinator gets the whole of the secret.
        let secret = if service == "coordinator" { how } else { "" };
        let (help, named) = (folder.succeeds(&[service, "--help"]), [unit.as_str(), pod, secret].concat());
        let (known, named) = (settings(&help), settings(&named));
        assert!(named.len() > 3, "{named:?}");
        assert!(named.is_subset(&known), "{service} does not know {:?}", &named - &known);
    }
}

#[test]
fn a_farm_starts_its_coordinator_again_where_it_was_and_goes_on_with_the_job() {
    let folder = Folder::new();
    let farm = folder.farm();
    let submit = ["submit", "scene.json", "--spp", "100000", "--coordinator", farm.address()];
    let job = folder.succeeds(&submit).trim().to_owned();
    let killed = coordinator_of(&farm);
    assert!(Command::new("kill").args(["-9", &killed.to_string()]).status().unwrap().success());
    let deadline = Instant::now() + Duration::from_secs(60);
    let cancel = ["cancel", &job, "--coordinator", farm.address()];
    while !folder.run(&cancel).status.success() {
        assert!(Instant::now() < deadline, "the coordinator was not started again");
    }
    assert_ne!(coordinator_of(&farm), killed);
    let jobs = folder.succeeds(&["jobs", "--coordinator", farm.address()]);
    assert!(jobs.contains(&job) && jobs.contains("cancelled"), "{jobs}");
}

/// The number of the process that is a farm's coordinator.
fn coordinator_of(farm: &Service) -> u32 {
    children_of(farm).into_iter().find(|(_, words)| words[1] == "coordinator").unwrap().0
}

/// The processes that a farm has started, with their words.
fn children_of(farm: &Service) -> Vec<(u32, Vec<String>)> {
    let threads = std::fs::read_dir(format!("/proc/{}/task", farm.id())).unwrap();
    let children = threads.map(|thread| std::fs::read_to_string(thread.unwrap().path().join("children")).unwrap());
    let children: Vec<String> = children.collect();
    let numbers = children.iter().flat_map(|numbers| numbers.split_whitespace());
    let with_words = |number: &str| {
        let words = std::fs::read_to_string(format!("/proc/{number}/cmdline")).unwrap_or_default();
        let words: Vec<String> = words.split('\0').map(str::to_owned).collect();
        // One that has ended has none, nor has one that is just being started.
        (words.len() > 1).then(|| (number.parse().unwrap(), words))
    };
    numbers.filter_map(with_words).collect()
}

#[test]
fn the_workers_of_a_farm_have_the_memory_that_it_is_told() {
    let folder = Folder::new();
    let mut farm = folder.command(&["farm", "--workers", "2", "--threads", "1", "--listen", "127.0.0.1:0"]);
    let farm = Service::start(farm.args(["--data", "data"]).env("CLERESTORY_MEMORY_MIB", "300"));
    let memory_of = |words: &[String]| {
        let at = words.iter().position(|word| word == "--memory-mib")?;
        words.get(at + 1).cloned()
    };
    let is_worker = |words: &[String]| words[1] == "worker";
    let deadline = Instant::now() + Duration::from_secs(60);
    let workers = loop {
        let workers: Vec<_> = children_of(&farm).into_iter().filter(|(_, words)| is_worker(words)).collect();
        if workers.len() == 2 {
            break workers;
        }
        assert!(Instant::now() < deadline, "{workers:?}");
    };
    for (_, words) in workers {
        assert_eq!(memory_of(&words).as_deref(), Some("300"), "{words:?}");
    }
}
