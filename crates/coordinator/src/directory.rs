//! Folders that survive a loss of power, and files that only their owner may read.

use std::collections::BTreeSet;
use std::fs::{DirBuilder, File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Makes a folder with its missing ancestors. Only its owner may use it, and all names are on disk afterwards.
pub(crate) fn create(directory: &Path) -> io::Result<()> {
    let missing: Vec<&Path> = directory.ancestors().take_while(|ancestor| !ancestor.exists()).collect();
    if let Some(file) = directory.ancestors().nth(missing.len()).filter(|ancestor| !ancestor.is_dir()) {
        let found = format!("{} is a file, expected a folder", file.display());
        return Err(io::Error::new(io::ErrorKind::NotADirectory, found));
    }
    let mut builder = DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(directory)?;
    // An existing folder may have been made just before a crash.
    let first = missing.is_empty().then_some(directory);
    for made in first.into_iter().chain(missing) {
        let parent = made.parent().map_or_else(|| PathBuf::from("/"), |parent| parent.join("."));
        match File::open(parent) {
            Ok(parent) => parent.sync_all()?,
            // A parent that may not be read cannot be synced.
            Err(error) if error.kind() == io::ErrorKind::PermissionDenied => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Makes a file that only its owner may use, if there is none. An existing file that everybody may read is closed to
/// all but its owner, with the files beside it whose names end in one of `companions`. A file that is closed to some
/// is left alone: somebody has chosen that.
///
/// An existing file is not opened: when this process closed it, SQLite would lose its locks on it.
pub(crate) fn keep_private(file: &Path, companions: &[&str]) -> io::Result<()> {
    let mut options = OpenOptions::new();
    options.create_new(true).write(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    match options.open(file) {
        Ok(_) => return Ok(()),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
        Err(error) => return Err(error),
    }
    #[cfg(unix)]
    for ending in [""].iter().chain(companions) {
        let mut name = file.as_os_str().to_owned();
        name.push(ending);
        close_to_others(Path::new(&name));
    }
    Ok(())
}

/// Closes a file that everybody may read to all but its owner.
#[cfg(unix)]
fn close_to_others(file: &Path) {
    use std::os::unix::fs::PermissionsExt;
    let Ok(metadata) = file.metadata() else { return };
    let mode = metadata.permissions().mode();
    if mode & 0o007 != 0
        && let Err(error) = std::fs::set_permissions(file, std::fs::Permissions::from_mode(mode & 0o700))
    {
        tracing::warn!(%error, file = %file.display(), "all users of this machine may read the farm's state");
    }
}

/// Folders below a root, made before anything is put into them.
#[derive(Debug)]
pub(crate) struct Folders {
    root: PathBuf,
    /// Folders whose names are on disk, as far as this process knows.
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

    /// Makes a missing folder, and syncs its name, also when a killed process made it.
    pub(crate) fn make(&self, folder: &Path) -> io::Result<()> {
        let names: Vec<&Path> = folder.ancestors().filter(|name| !name.as_os_str().is_empty()).collect();
        names.into_iter().rev().try_for_each(|name| create(&self.root.join(name)))?;
        self.made.lock().unwrap_or_else(PoisonError::into_inner).insert(folder.to_owned());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[cfg(unix)]
    #[test]
    fn what_all_may_read_is_closed_and_what_was_closed_to_some_stays_as_it_is() {
        use std::os::unix::fs::PermissionsExt;
        let above = tempfile::tempdir().unwrap();
        let mode = |path: &Path| path.metadata().unwrap().permissions().mode() & 0o777;
        let folder = above.path().join("farm");
        create(&folder).unwrap();
        assert_eq!(mode(&folder), 0o700);
        let names = ["state", "state-wal", "state-shm"].map(|name| folder.join(name));
        keep_private(&names[0], &["-wal", "-shm"]).unwrap();
        assert_eq!(mode(&names[0]), 0o600);
        assert!(!names[1].exists(), "only the file itself is made");
        for (left, expected) in [(0o644, 0o600), (0o664, 0o600), (0o640, 0o640), (0o600, 0o600)] {
            for name in &names {
                fs::write(name, "kept").unwrap();
                fs::set_permissions(name, fs::Permissions::from_mode(left)).unwrap();
            }
            keep_private(&names[0], &["-wal", "-shm"]).unwrap();
            assert_eq!(names.each_ref().map(|name| mode(name)), [expected; 3], "{left:o}");
            assert_eq!(fs::read(&names[0]).unwrap(), b"kept");
        }
    }

    #[test]
    fn folders_below_one_are_made_with_all_between() {
        let above = tempfile::tempdir().unwrap();
        let folders = Folders::below(above.path().to_owned());
        for _ in 0..2 {
            folders.make(Path::new("nodes/a")).unwrap();
            assert!(above.path().join("nodes/a").is_dir() && folders.has(Path::new("nodes/a")));
        }
        fs::write(above.path().join("file"), "").unwrap();
        let refused = folders.make(Path::new("file/b")).unwrap_err();
        assert!(refused.to_string().ends_with("file is a file, expected a folder"), "{refused}");
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
