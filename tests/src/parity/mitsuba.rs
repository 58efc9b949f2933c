//! Exported scenes, rendered by Mitsuba.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;

use super::pictures::Pictures;
use super::scenes::ParityScene;
use crate::farm::{clerestory, succeeded};

/// What renders a picture with several seeds.
const SCRIPT: &str = include_str!("render.py");

/// The file of a scene for Mitsuba.
const SCENE: &str = "scene.xml";

/// A fault that is planted into an exported scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault {
    /// What it is.
    pub name: &'static str,
    /// What stands in the file.
    pub text: &'static str,
    /// What stands there then.
    pub fault: &'static str,
}

/// A scene in a folder of its own, exported.
#[derive(Debug)]
pub struct Exported {
    folder: TempDir,
    size: [usize; 2],
}

impl Exported {
    /// Exports a scene by the command.
    ///
    /// # Panics
    ///
    /// When the command fails.
    pub fn new(scene: &ParityScene) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("scene.json");
        fs::write(&file, scene.description.to_string()).expect("the scene can be written");
        for (name, bytes) in &scene.files {
            fs::write(folder.path().join(name), bytes).expect("its files can be written");
        }
        let exported = folder.path().join("exported");
        succeeded(clerestory().args(["export", "--to", "mitsuba"]).arg(&file).arg(&exported));
        let exported = Self { folder, size: scene.size() };
        scene.corrections.iter().for_each(|correction| exported.plant(correction));
        exported
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join("exported").join(name)
    }

    /// Plants a fault.
    ///
    /// # Panics
    ///
    /// When what is changed is not in the file.
    pub fn plant(&self, fault: &Fault) {
        let text = fs::read_to_string(self.file(SCENE)).expect("an exported scene");
        assert!(text.contains(fault.text), "the scene has no {}", fault.text);
        fs::write(self.file(SCENE), text.replace(fault.text, fault.fault)).expect("the scene can be written");
    }

    /// Renders it with consecutive seeds.
    ///
    /// # Panics
    ///
    /// When Mitsuba fails.
    pub fn render(&self, python: &Path, samples: u32, first_seed: u32, seeds: u32) -> Pictures {
        let (script, output) = (self.file("render.py"), self.file("pictures"));
        fs::write(&script, SCRIPT).expect("the script can be written");
        let mut command = Command::new(python);
        command.arg(&script).arg(self.file(SCENE)).arg(&output);
        succeeded(command.args([samples, first_seed, seeds].map(|number| number.to_string())));
        Pictures::from_bytes(&fs::read(&output).expect("pictures"), self.size)
    }
}
