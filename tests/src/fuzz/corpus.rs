//! The files that cases are made of: small ones of every format, kept in `tests/data/fuzz`.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::{Case, chosen};
use crate::random::Random;

/// Endings of the files that a user names, the likelier first where a folder has several.
const MAIN: [&str; 9] = ["glb", "gltf", "obj", "ply", "hdr", "exr", "png", "jpg", "webp"];

/// Files to be changed.
#[derive(Debug)]
pub struct Corpus(Vec<Case>);

impl Corpus {
    /// The seeds that are kept, and the files that once were trouble.
    pub fn kept() -> Self {
        Self(cases("seeds").into_iter().chain(cases("found")).map(|(_, case)| case).collect())
    }

    /// One of them.
    pub(super) fn choice(&self, random: &mut Random) -> &Case {
        chosen(&self.0, random)
    }
}

/// The cases in a folder of `tests/data/fuzz`, each a folder of files, in the order of their names.
///
/// # Panics
///
/// When the files cannot be read.
pub fn cases(folder: &str) -> Vec<(String, Case)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/fuzz").join(folder);
    let cases = entries(&folder).into_iter().map(|folder| {
        let files: BTreeMap<String, Vec<u8>> = entries(&folder)
            .iter()
            .map(|file| (name(file), fs::read(file).expect("a file that can be read")))
            .collect();
        let main = MAIN.iter().find_map(|ending| files.keys().find(|file| file.ends_with(ending)));
        let main = main.expect("a file of a known kind").clone();
        (name(&folder), Case { main, files })
    });
    cases.collect()
}

/// What is in a folder, in the order of the names; nothing, if there is no such folder.
fn entries(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("a readable folder").path()).collect();
    paths.sort();
    paths
}

fn name(path: &Path) -> String {
    path.file_name().and_then(|name| name.to_str()).expect("a name in UTF-8").to_owned()
}
