//! Folders that are still there after a loss of power.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

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

#[cfg(test)]
mod tests {
    use super::*;

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
