//! Folders that are still there after a loss of power.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Makes a folder and what is missing above it, and has its name on disk, and the names of those, when it returns.
pub(crate) fn create(directory: &Path) -> io::Result<()> {
    let missing: Vec<&Path> = directory.ancestors().take_while(|ancestor| !ancestor.exists()).collect();
    fs::create_dir_all(directory)?;
    // One that is there may have been made just before a crash.
    let first = missing.is_empty().then_some(directory);
    for made in first.into_iter().chain(missing) {
        let parent = made.parent().map_or_else(|| PathBuf::from("/"), |parent| parent.join("."));
        match File::open(parent) {
            Ok(parent) => parent.sync_all()?,
            // Who may not read it has no way to sync it.
            Err(error) if error.kind() == io::ErrorKind::PermissionDenied => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Folders below one, which are made before anything is put into them.
#[derive(Debug)]
pub(crate) struct Folders {
    root: PathBuf,
    /// Those whose names are on disk, as far as this process has seen to it.
    made: Mutex<BTreeSet<PathBuf>>,
}

impl Folders {
    /// Those below this one.
    pub(crate) fn below(root: PathBuf) -> Self {
        Self { root, made: Mutex::default() }
    }

    /// Whether a folder has been made.
    pub(crate) fn has(&self, folder: &Path) -> bool {
        self.made.lock().unwrap_or_else(PoisonError::into_inner).contains(folder)
    }

    /// Makes a folder, as far as it is missing, and has its name on disk when it returns, also where one that was killed made it.
    pub(crate) fn make(&self, folder: &Path) -> io::Result<()> {
        let names: Vec<&Path> = folder.ancestors().filter(|name| !name.as_os_str().is_empty()).collect();
        names.into_iter().rev().try_for_each(|name| create(&self.root.join(name)))?;
        self.made.lock().unwrap_or_else(PoisonError::into_inner).insert(folder.to_owned());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_below_one_are_made_with_all_between() {
        let above = tempfile::tempdir().unwrap();
        let folders = Folders::below(above.path().to_owned());
        for _ in 0..2 {
            folders.make(Path::new("nodes/a")).unwrap();
            assert!(above.path().join("nodes/a").is_dir() && folders.has(Path::new("nodes/a")));
        }
        fs::write(above.path().join("file"), "").unwrap();
        folders.make(Path::new("file/b")).unwrap_err();
    }

    #[test]
    fn folders_are_made_wherever_they_are_missing_and_may_be_there() {
        let above = tempfile::tempdir().unwrap();
        let directory = above.path().join("a/b/c");
        for _ in 0..2 {
            create(&directory).unwrap();
            assert!(directory.is_dir());
        }
    }
}
