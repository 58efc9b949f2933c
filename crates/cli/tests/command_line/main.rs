//! The binary as scripts see it: exit codes, standard output, error messages, files.

#![expect(clippy::unwrap_used, reason = "a test that cannot set itself up has failed")]

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use serde_json::{Value, json};
use tempfile::TempDir;

/// A folder with a scene of one wall, 24x16 pixels.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        folder.write_scene("scene.json", [1.0, 1.0, 2.0]);
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write_scene(&self, name: &str, lamp: [f64; 3]) {
        let scene = json!({
            "version": 1,
            "name": "one wall",
            "film": {"width": 24, "height": 16},
            "camera": {"perspective": {
                "position": [0, 0, 3], "look_at": [0, 0, 0], "up": [0, 1, 0], "vertical_field_of_view": 60
            }},
            "integrator": {"path": {"max_depth": 4}},
            "sampling": {"samples_per_pass": 4, "samples_per_block": 8},
            "materials": {"white": {"diffuse": {"reflectance": {"colour": [0.8, 0.8, 0.8]}}}},
            "meshes": [{"name": "wall", "material": "white", "source": {"inline": {
                "positions": [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]],
                "triangles": [[0, 1, 2], [0, 2, 3]]
            }}}],
            "lights": [{"point": {"name": "lamp", "position": lamp, "intensity": [5, 5, 5]}}]
        });
        fs::write(self.path(name), scene.to_string()).unwrap();
    }

    fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_clerestory"));
        command.args(words).current_dir(self.0.path()).env_remove("CLERESTORY_TOKEN").stdin(Stdio::null());
        command
    }

    fn run(&self, words: &[&str]) -> Output {
        self.command(words).output().unwrap()
    }

    #[track_caller]
    fn succeeds(&self, words: &[&str]) -> String {
        let output = self.run(words);
        assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    /// Runs a command that must fail with this exit code and say all of `expected`, and nothing on standard output.
    #[track_caller]
    fn fails(&self, words: &[&str], code: i32, expected: &[&str]) {
        let output = self.run(words);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{words:?}: {message}");
        for part in expected {
            assert!(message.contains(part), "{words:?} should say {part:?}: {message}");
        }
        assert!(output.stdout.is_empty(), "{words:?}: {}", String::from_utf8_lossy(&output.stdout));
    }

    #[track_caller]
    fn comparison(&self, image: &str, reference: &str) -> Value {
        serde_json::from_str(&self.succeeds(&["compare", image, reference, "--json"])).unwrap()
    }
}

#[test]
fn tiles_and_threads_decide_no_bit_of_the_picture() {
    let folder = Folder::new();
    folder.succeeds(&["render", "scene.json", "--spp", "20", "--tile", "16", "--threads", "1"]);
    folder.succeeds(&["render", "scene.json", "--spp", "20", "--tile", "5", "--threads", "3", "-o", "other.exr"]);
    folder.succeeds(&["render", "scene.json", "--spp", "20", "--seed", "7", "-o", "seed.exr"]);
    assert_eq!(folder.comparison("other.exr", "scene.exr")["bit_identical"], true);
    assert_eq!(folder.comparison("seed.exr", "scene.exr")["bit_identical"], false);
}

#[test]
fn an_image_is_made_again_from_what_it_says_of_itself() {
    let folder = Folder::new();
    let first = ["--spp", "12", "--seed", "3", "--size", "17x9", "--tile", "8", "-o", "first.exr"];
    folder.succeeds(&[&["render", "scene.json"], first.as_slice()].concat());
    folder.succeeds(&["render", "scene.json", "--like", "first.exr", "-o", "again.exr"]);
    assert_eq!(folder.comparison("again.exr", "first.exr")["bit_identical"], true);

    folder.write_scene("other.json", [1.0, 1.0, 1.9]);
    folder.fails(
        &["render", "other.json", "--like", "first.exr", "-o", "no.exr"],
        2,
        &["other.json", "hash", "expected"],
    );
    folder.fails(&["render", "scene.json", "--like", "first.exr", "--seed", "1"], 2, &["--like", "--seed"]);
    assert!(!folder.path("no.exr").exists());
}

#[test]
fn a_render_reports_to_scripts_and_to_people_apart() {
    let folder = Folder::new();
    let options = ["--spp", "8", "--json", "--png", "--stats", "stats.json", "-o", "image.exr"];
    let text = folder.succeeds(&[&["render", "scene.json"], options.as_slice()].concat());
    let summary: Value = serde_json::from_str(&text).unwrap();
    assert_eq!((&summary["samples"], &summary["width"]), (&json!(24 * 16 * 8), &json!(24)));
    let stats: Value = serde_json::from_str(&fs::read_to_string(folder.path("stats.json")).unwrap()).unwrap();
    assert_eq!(stats, summary["counters"]);
    assert!(fs::read(folder.path("image.png")).unwrap().starts_with(b"\x89PNG"));

    let reference = ["--reference", "image.exr", "-o", "second.exr"];
    let output = folder.run(&[&["render", "scene.json", "--spp", "8"], reference.as_slice()].concat());
    let progress = String::from_utf8(output.stderr).unwrap();
    assert!(progress.contains("PSNR"), "the table of rounds: {progress}");
    assert!(progress.lines().any(|line| line.contains("0.0000e0")), "the last round equals the reference: {progress}");
}

#[test]
fn a_comparison_has_every_measure() {
    let folder = Folder::new();
    folder.succeeds(&["render", "scene.json", "--spp", "4", "-o", "a.exr"]);
    folder.succeeds(&["render", "scene.json", "--spp", "16", "-o", "b.exr"]);
    let comparison = folder.comparison("a.exr", "b.exr");
    for key in ["mse", "corrected_mse", "rel_mse", "psnr", "mean_ratio", "max_abs_diff"] {
        assert!(comparison[key].is_number(), "{key}: {comparison}");
    }
    assert!(comparison["mse"].as_f64() > Some(0.0) && comparison["bit_identical"] == false);
}

#[test]
fn what_is_wrong_is_named_with_its_causes_and_the_exit_code_tells_whose_fault_it_is() {
    let folder = Folder::new();
    folder.fails(&["render"], 2, &["SCENE"]);
    folder.fails(&["render", "scene.json", "--spp", "0"], 2, &["--spp"]);
    folder.fails(&["render", "scene.json", "--size", "12"], 2, &["--size", "640x480"]);
    folder.fails(&["render", "absent.json"], 1, &["cannot use the scene absent.json", "No such file"]);
    folder.fails(&["render", "scene.json", "-o", "no/such/image.exr"], 1, &["cannot write no/such/image.exr"]);
    folder.fails(&["render", "scene.json", "--reference", "scene.json"], 1, &["scene.json", "not an OpenEXR file"]);
    folder.fails(&["compare", "absent.exr", "absent.exr"], 1, &["cannot read absent.exr"]);
    folder.fails(&["jobs", "--coordinator", "http://127.0.0.1:1"], 1, &["http://127.0.0.1:1", "no answer"]);
    folder.fails(&["jobs", "--coordinator", "nonsense"], 1, &["nonsense", "expected"]);
    folder.fails(&["watch", "17"], 2, &["17"]);
    folder.fails(&["coordinator", "--listen", "nowhere"], 1, &["nowhere", "127.0.0.1:7171"]);
    fs::write(folder.path("bad.toml"), "lisen = \"127.0.0.1:0\"\n").unwrap();
    folder.fails(&["coordinator", "--config", "bad.toml"], 2, &["bad.toml", "lisen", "listen"]);

    fs::write(folder.path("bad.json"), "{\"version\": 1, \"nmae\": \"x\"}").unwrap();
    folder.fails(&["render", "bad.json"], 1, &["bad.json", "nmae"]);
}

#[test]
fn the_printed_configuration_does_not_hold_the_token() {
    let folder = Folder::new();
    let token = "0123456789abcdef0123456789abcdef";
    let output = folder.command(&["coordinator", "--print-config"]).env("CLERESTORY_TOKEN", token).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("listen = \"127.0.0.1:7171\"") && !text.contains(token), "{text}");
}

#[test]
fn a_reader_that_has_seen_enough_is_no_failure() {
    let folder = Folder::new();
    let mut child = folder
        .command(&["render", "scene.json", "--spp", "4"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    assert!(child.wait().unwrap().success());
}

#[test]
fn a_coordinator_prints_its_address_and_ends_with_its_parent() {
    let folder = Folder::new();
    let mut coordinator = folder
        .command(&["coordinator", "--listen", "127.0.0.1:0", "--data", "data", "--stop-with-stdin"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut address = String::new();
    BufReader::new(coordinator.stdout.as_mut().unwrap()).read_line(&mut address).unwrap();
    let jobs = folder.succeeds(&["jobs", "--json", "--coordinator", address.trim()]);
    assert_eq!(jobs.trim(), "[]");
    drop(coordinator.stdin.take());
    assert!(coordinator.wait().unwrap().success());
    assert!(folder.path("data").is_dir());
}
