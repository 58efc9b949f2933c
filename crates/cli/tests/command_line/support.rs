//! A folder to work in, and running services.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Output, Stdio};

use serde_json::{Value, json};
use tempfile::TempDir;

/// A folder with a scene of one wall, 24x16 pixels.
pub(crate) struct Folder(TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        folder.write_scene("scene.json", [1.0, 1.0, 2.0]);
        folder
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn write_scene(&self, name: &str, lamp: [f64; 3]) {
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

    pub(crate) fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_clerestory"));
        command.args(words).current_dir(self.0.path()).stdin(Stdio::null());
        // Whatever the shell of the developer says about farms is not for the test.
        for (name, _) in std::env::vars_os().filter(|(name, _)| name.to_string_lossy().starts_with("CLERESTORY_")) {
            command.env_remove(name);
        }
        command
    }

    /// Starts a coordinator with its data in this folder.
    pub(crate) fn coordinator(&self, listen: &str, token: Option<&str>) -> Service {
        let mut command = self.command(&["coordinator", "--listen", listen, "--data", "data", "--stop-with-stdin"]);
        Service::start(command.envs(token.map(|token| ("CLERESTORY_TOKEN", token))))
    }

    /// Starts a farm of one worker with its data in this folder.
    pub(crate) fn farm(&self) -> Service {
        Service::start(&mut self.command(&["farm", "--threads", "1", "--listen", "127.0.0.1:0", "--data", "data"]))
    }

    pub(crate) fn run(&self, words: &[&str]) -> Output {
        self.command(words).output().unwrap()
    }

    #[track_caller]
    pub(crate) fn succeeds(&self, words: &[&str]) -> String {
        let output = self.run(words);
        assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    /// Runs a command that must fail with this exit code and say all of `expected`, and nothing on standard output.
    #[track_caller]
    pub(crate) fn fails(&self, words: &[&str], code: i32, expected: &[&str]) {
        let output = self.run(words);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{words:?}: {message}");
        for part in expected {
            assert!(message.contains(part), "{words:?} should say {part:?}: {message}");
        }
        assert!(output.stdout.is_empty(), "{words:?}: {}", String::from_utf8_lossy(&output.stdout));
    }

    #[track_caller]
    pub(crate) fn comparison(&self, image: &str, reference: &str) -> Value {
        serde_json::from_str(&self.succeeds(&["compare", image, reference, "--json"])).unwrap()
    }
}

/// A coordinator or a farm, killed with the value.
pub(crate) struct Service {
    process: Child,
    address: String,
}

impl Service {
    /// Starts it, and waits until it listens.
    pub(crate) fn start(command: &mut Command) -> Self {
        let command = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut process = command.spawn().unwrap();
        let mut address = String::new();
        BufReader::new(process.stdout.as_mut().unwrap()).read_line(&mut address).unwrap();
        Self { process, address: address.trim().to_owned() }
    }

    pub(crate) fn address(&self) -> &str {
        &self.address
    }

    /// Number of its process.
    pub(crate) fn id(&self) -> u32 {
        self.process.id()
    }

    /// Lets go of its standard input, and waits until it has ended.
    pub(crate) fn ended_by_its_parent(mut self) -> ExitStatus {
        drop(self.process.stdin.take());
        self.process.wait().unwrap()
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
