//! Where an output goes. Symbolic links are followed, so that the target is written and the links stay.

use std::ffi::{OsStr, OsString};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf, is_separator};
use std::{fs, process};

/// Longest chain of links that is followed, as on Linux.
const MOST_LINKS: usize = 40;

/// Where an output goes.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Destination {
    /// A regular file, existing or not, which is replaced as a whole.
    File {
        /// The folder's real path.
        folder: PathBuf,
        name: OsString,
    },
    /// Standard output, which is written in place.
    StandardOutput,
    /// A device, a pipe or another descriptor of this process: written in place.
    Special(PathBuf),
}

impl Destination {
    /// Finds out what a path stands for.
    pub(super) fn find(file: &Path) -> io::Result<Self> {
        let mut path = file.to_owned();
        for _ in 0..=MOST_LINKS {
            if path.as_os_str().is_empty() {
                return Err(io::Error::new(ErrorKind::InvalidInput, "an empty name: expected the name of a file"));
            }
            let Some(name) = path.file_name().filter(|_| !ends_with_separator(&path)) else {
                return Err(is_a_folder());
            };
            let (name, folder) = (name.to_owned(), real_folder(&path)?);
            let place = folder.join(&name);
            if is_folder_of_descriptors(&folder) {
                return Ok(Self::descriptor(&folder, &name));
            }
            match fs::symlink_metadata(&place) {
                Ok(found) if found.is_symlink() => path = folder.join(fs::read_link(&place)?),
                Ok(found) if found.is_dir() => return Err(is_a_folder()),
                Ok(found) if !found.is_file() => return Ok(Self::Special(place)),
                Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
                Ok(_) | Err(_) => return Ok(Self::File { folder, name }),
            }
        }
        Err(io::Error::other("its symbolic links lead in a circle"))
    }

    fn descriptor(folder: &Path, name: &OsStr) -> Self {
        let own = [PathBuf::from(format!("/proc/{}/fd", process::id())), PathBuf::from("/dev/fd")];
        if name == "1" && own.iter().any(|own| own == folder) {
            return Self::StandardOutput;
        }
        Self::Special(folder.join(name))
    }
}

fn is_a_folder() -> io::Error {
    io::Error::new(ErrorKind::IsADirectory, "is a directory, expected the name of a file")
}

fn ends_with_separator(path: &Path) -> bool {
    path.as_os_str().as_encoded_bytes().last().is_some_and(|&last| is_separator(char::from(last)))
}

/// The real path of the folder that a file lies in.
fn real_folder(file: &Path) -> io::Result<PathBuf> {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    fs::canonicalize(folder).map_err(|error| match error.kind() {
        ErrorKind::NotFound => {
            io::Error::new(ErrorKind::NotFound, format!("the folder {} does not exist", folder.display()))
        }
        _ => error,
    })
}

/// Whether the files of a folder stand for open files of a process, as the target of `/dev/stdout` does. A rename over
/// such a file would replace the system's entry.
fn is_folder_of_descriptors(folder: &Path) -> bool {
    folder.starts_with("/proc") || folder.starts_with("/dev/fd")
}
