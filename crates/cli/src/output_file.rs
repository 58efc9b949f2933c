//! Files that a command leaves behind.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::failure::Failure;

/// Writes a file whole or not at all: a reader never sees half of it, and a full disk does not cost the old one.
pub(crate) fn write(file: &Path, content: &[u8]) -> Result<(), Failure> {
    let failure = |source| Failure::Write { file: file.to_owned(), source };
    if is_special(file) {
        return fs::write(file, content).map_err(failure);
    }
    let unfinished = unfinished_name(file);
    let result = fs::write(&unfinished, content).and_then(|()| fs::rename(&unfinished, file));
    if result.is_err() {
        // The error that matters is the first.
        let _ = fs::remove_file(&unfinished);
    }
    result.map_err(failure)
}

/// Writes the counters of a render.
pub(crate) fn write_stats(file: &Path, counters: &impl Serialize) -> Result<(), Failure> {
    write(file, &serde_json::to_vec_pretty(counters).expect("counters have a form in JSON"))
}

/// Checks that a file can be written later, before the work for it starts.
pub(crate) fn check_writable(file: &Path) -> Result<(), Failure> {
    if is_special(file) {
        return Ok(());
    }
    let unfinished = unfinished_name(file);
    fs::write(&unfinished, [])
        .and_then(|()| fs::remove_file(&unfinished))
        .map_err(|source| Failure::Write { file: file.to_owned(), source })
}

/// Whether it is there and no regular file, such as `/dev/stdout`: a thing to write into, not to replace.
fn is_special(file: &Path) -> bool {
    fs::metadata(file).is_ok_and(|metadata| !metadata.is_file())
}

fn unfinished_name(file: &Path) -> PathBuf {
    let mut name = file.as_os_str().to_owned();
    name.push(".part.tmp");
    PathBuf::from(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_whole_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("image.exr");
        check_writable(&file).unwrap();
        write(&file, b"old").unwrap();
        write(&file, b"new").unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_folder_that_does_not_exist_is_noticed_before_the_work() {
        let folder = tempfile::tempdir().unwrap();
        let message = check_writable(&folder.path().join("no/such/image.exr")).unwrap_err().to_string();
        assert!(message.contains("no/such/image.exr"), "{message}");
    }
}
