//! Output files. Each is written beside its destination, and renamed when it is complete and on the disk.

mod destination;

use std::collections::BTreeSet;
use std::ffi::{OsStr, OsString};
use std::fs::{self, File, Metadata};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use serde::Serialize;
use tempfile::{Builder, TempPath};

use self::destination::Destination;
use crate::failure::Failure;

/// Longest file name that is repeated in the name of the unfinished file: systems allow 255 bytes.
const LONGEST_PREFIX: usize = 200;

/// Unfinished files of this process, which are removed when the process ends at once.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Writes a file whole or not at all. A reader never sees half of it, and a full disk keeps the old file.
pub(crate) fn write(file: &Path, content: &[u8]) -> Result<(), Failure> {
    let mut output = OutputFile::create(file)?;
    output.write(content)?;
    output.finish()
}

/// Writes content that took long to make. On failure, a temporary file keeps it, and the failure names that file.
pub(crate) fn write_or_keep(file: &Path, content: &[u8]) -> Result<(), Failure> {
    write(file, content).map_err(|failure| {
        let Failure::Write { file, source } = failure else { return failure };
        match keep(file.file_name().unwrap_or(OsStr::new("image")), content) {
            Ok(kept) => Failure::WrittenElsewhere { file, kept, source },
            Err(_) => Failure::Write { file, source },
        }
    })
}

/// Writes a new file into the folder for temporary files, and returns its path. Other users write to that folder too,
/// and a guessable name may be a link of theirs.
fn keep(name: &OsStr, content: &[u8]) -> io::Result<PathBuf> {
    let mut suffix = OsString::from("-");
    suffix.push(if name.len() <= LONGEST_PREFIX { name } else { OsStr::new("image") });
    let mut file = Builder::new().prefix("clerestory-").suffix(&suffix).tempfile()?;
    let place = file.path().to_owned();
    unfinished().insert(place.clone());
    let kept = file.write_all(content).and_then(|()| file.as_file().sync_all()).and_then(|()| Ok(file.keep()?.1));
    unfinished().remove(&place);
    kept
}

/// Removes the unfinished files of this process, before it ends at once.
pub(crate) fn remove_unfinished() {
    for file in unfinished().iter() {
        // The process is about to end.
        let _ = fs::remove_file(file);
    }
}

/// No code leaves the set half changed while it holds the lock.
fn unfinished() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file that is written piece by piece, and appears under its name when it is complete.
#[derive(Debug)]
pub(crate) struct OutputFile {
    /// As the user gave it.
    name: PathBuf,
    content: File,
    /// Absent for a destination that is written in place.
    replacement: Option<Replacement>,
}

/// A file that is about to replace another.
#[derive(Debug)]
struct Replacement {
    /// Removed with the value, unless it has been renamed.
    unfinished: Option<TempPath>,
    folder: PathBuf,
    target: PathBuf,
}

impl OutputFile {
    /// Begins a file.
    pub(crate) fn create(file: &Path) -> Result<Self, Failure> {
        let created = Destination::find(file).and_then(|destination| match destination {
            Destination::File { folder, name } => {
                let (content, replacement) = Replacement::create(folder, &name)?;
                Ok((content, Some(replacement)))
            }
            Destination::StandardOutput => Ok((standard_output()?, None)),
            Destination::Special(place) => Ok((File::options().append(true).open(place)?, None)),
        });
        let (content, replacement) = created.map_err(|source| Failure::Write { file: file.to_owned(), source })?;
        Ok(Self { name: file.to_owned(), content, replacement })
    }

    /// Writes the next piece.
    pub(crate) fn write(&mut self, piece: &[u8]) -> Result<(), Failure> {
        self.content.write_all(piece).map_err(|source| Failure::Write { file: self.name.clone(), source })
    }

    /// Gives the file its name when its content is on the disk.
    pub(crate) fn finish(self) -> Result<(), Failure> {
        let Self { name, content, replacement } = self;
        let Some(mut replacement) = replacement else { return Ok(()) };
        let finished = content.sync_all().and_then(|()| replacement.rename()).and_then(|()| replacement.sync_folder());
        finished.map_err(|source| Failure::Write { file: name, source })
    }
}

impl Replacement {
    /// Makes an unfinished file beside the target, with the access rights of the target.
    fn create(folder: PathBuf, name: &OsStr) -> io::Result<(File, Self)> {
        let target = folder.join(name);
        let replaced = fs::metadata(&target).ok();
        let (content, unfinished) = unfinished_file(&folder, name, replaced.as_ref())?.into_parts();
        if let Some(replaced) = replaced {
            keep_access(&content, &replaced)?;
        }
        self::unfinished().insert(unfinished.to_path_buf());
        Ok((content, Self { unfinished: Some(unfinished), folder, target }))
    }

    /// Puts the file in place of its target. On failure, the content stays under another name.
    fn rename(&mut self) -> io::Result<()> {
        let Some(unfinished) = self.unfinished.take() else { return Ok(()) };
        let place = unfinished.to_path_buf();
        let renamed = unfinished.persist(&self.target).map_err(|failure| {
            let error = failure.error;
            match failure.path.keep() {
                Ok(kept) => io::Error::new(error.kind(), format!("{error}; its content is in {}", kept.display())),
                Err(_) => error,
            }
        });
        self::unfinished().remove(&place);
        renamed
    }

    /// Makes the new name survive a loss of power.
    fn sync_folder(&self) -> io::Result<()> {
        if !cfg!(unix) {
            return Ok(());
        }
        match File::open(&self.folder).and_then(|folder| folder.sync_all()) {
            // A folder that may not be read, or a file system without this.
            Err(error) if matches!(error.kind(), ErrorKind::PermissionDenied | ErrorKind::InvalidInput) => Ok(()),
            synced => synced,
        }
    }
}

impl Drop for Replacement {
    fn drop(&mut self) {
        if let Some(unfinished) = self.unfinished.take() {
            let place = unfinished.to_path_buf();
            // Only the first error is reported.
            let _ = unfinished.close();
            self::unfinished().remove(&place);
        }
    }
}

/// A new file beside another, with a name that no other process uses.
fn unfinished_file(folder: &Path, name: &OsStr, replaced: Option<&Metadata>) -> io::Result<tempfile::NamedTempFile> {
    let mut prefix = if name.len() <= LONGEST_PREFIX { name.to_owned() } else { "output".into() };
    prefix.push(".");
    let mut builder = Builder::new();
    builder.prefix(&prefix).suffix(".part");
    // The replaced file decides on access to the new one. Until its rights are copied, no other user has access.
    #[cfg(unix)]
    if replaced.is_none() {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder).map_err(|error| {
        let kind = error.kind();
        io::Error::new(kind, format!("no file can be made in the folder {}: {kind}", folder.display()))
    })
}

/// Gives a file the permissions of the replaced file, and its owner and group as far as this user may.
fn keep_access(content: &File, replaced: &Metadata) -> io::Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::{MetadataExt, fchown};
        let (owner, group) = (replaced.uid(), replaced.gid());
        if fchown(content, Some(owner), Some(group)).is_err() {
            // Without the right to keep another owner, the file becomes this user's. The group is tried alone, because
            // a refused owner changes neither.
            let _ = fchown(content, None, Some(group));
        }
    }
    content.set_permissions(replaced.permissions())
}

/// Another handle of standard output, with the same position.
fn standard_output() -> io::Result<File> {
    #[cfg(unix)]
    {
        use std::os::fd::AsFd;
        Ok(io::stdout().as_fd().try_clone_to_owned()?.into())
    }
    #[cfg(not(unix))]
    Err(ErrorKind::Unsupported.into())
}

/// Writes the counters of a render.
pub(crate) fn write_stats(file: &Path, counters: &impl Serialize) -> Result<(), Failure> {
    write(file, &serde_json::to_vec_pretty(counters).expect("counters have a form in JSON"))
}

/// Extensions of image formats other than OpenEXR.
const FOREIGN_EXTENSIONS: [&str; 15] =
    ["avif", "bmp", "dpx", "gif", "hdr", "jpeg", "jpg", "jxl", "pfm", "png", "ppm", "tga", "tif", "tiff", "webp"];

/// Refuses an image name with the extension of another format.
pub(crate) fn check_image_name(file: &Path) -> Result<(), Failure> {
    let extension = file.extension().unwrap_or_default();
    if FOREIGN_EXTENSIONS.iter().any(|foreign| extension.eq_ignore_ascii_case(foreign)) {
        return Err(Failure::Usage(format!(
            "--output {} would be an OpenEXR image in spite of its name: expected {}, with --png for a PNG beside it",
            file.display(),
            file.with_extension("exr").display()
        )));
    }
    Ok(())
}

/// Refuses a name for a PNG with the extension of another image format.
pub(crate) fn check_png_name(file: &Path) -> Result<(), Failure> {
    let extension = file.extension().unwrap_or_default();
    let is_other = |other: &str| extension.eq_ignore_ascii_case(other) && other != "png";
    if FOREIGN_EXTENSIONS.into_iter().chain(["exr"]).any(is_other) {
        return Err(Failure::Usage(format!(
            "{} would be a PNG in spite of its name: expected {}",
            file.display(),
            file.with_extension("png").display()
        )));
    }
    Ok(())
}

/// The PNG that belongs to an image: `.exr` becomes `.png`, and to any other name `.png` is added.
pub(crate) fn png_beside(image: &Path) -> PathBuf {
    if image.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr")) {
        return image.with_extension("png");
    }
    let mut name = image.as_os_str().to_owned();
    name.push(".png");
    PathBuf::from(name)
}

/// Whether a file is standard output, under whatever name.
pub(crate) fn is_standard_output(file: &Path) -> bool {
    Destination::find(file).is_ok_and(|destination| destination == Destination::StandardOutput)
}

/// Checks the outputs of a command before its work starts. Each must be writable, no two may be the same file, and none
/// may replace an input. Each comes with its option.
pub(crate) fn check_outputs(
    outputs: &[(&str, Option<&Path>)],
    inputs: &[(&str, Option<&Path>)],
) -> Result<(), Failure> {
    fn given<'a>(files: &[(&'a str, Option<&'a Path>)]) -> impl Iterator<Item = (&'a str, &'a Path)> {
        files.iter().filter_map(|(option, file)| Some((*option, (*file)?))).collect::<Vec<_>>().into_iter()
    }
    let read = given(inputs).filter_map(|(option, file)| Some((option, fs::canonicalize(file).ok()?)));
    let read: Vec<(&str, PathBuf)> = read.collect();
    let mut written: Vec<(&str, PathBuf)> = Vec::new();
    for (option, file) in given(outputs) {
        let checked = Destination::find(file).and_then(check_writable);
        let place = checked.map_err(|source| Failure::Write { file: file.to_owned(), source })?;
        // Two outputs may go to one terminal or pipe.
        let Some(place) = place else { continue };
        let file = file.display();
        if let Some((other, _)) = written.iter().find(|(_, other)| *other == place) {
            return Err(Failure::Usage(format!("{other} and {option} both write {file}: expected a file for each")));
        }
        if let Some((input, _)) = read.iter().find(|(_, input)| *input == place) {
            return Err(Failure::Usage(format!(
                "{option} would replace {file}, which is {input}: expected another file"
            )));
        }
        written.push((option, place));
    }
    Ok(())
}

/// Makes a folder for outputs, and checks that files can be made in it.
pub(crate) fn create_folder(folder: &Path) -> Result<(), Failure> {
    let failure = |source| Failure::Write { file: folder.to_owned(), source };
    if folder.exists() && !folder.is_dir() {
        return Err(failure(io::Error::new(ErrorKind::NotADirectory, "is a file, expected the name of a folder")));
    }
    fs::create_dir_all(folder).map_err(failure)?;
    unfinished_file(folder, OsStr::new("output"), None).map(drop).map_err(failure)
}

/// Checks that an output can be written later, and returns the place of a regular file. A pipe is not opened, because
/// that would wait for its reader.
fn check_writable(destination: Destination) -> io::Result<Option<PathBuf>> {
    let Destination::File { folder, name } = destination else { return Ok(None) };
    let place = folder.join(&name);
    match File::options().write(true).open(&place) {
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
        Ok(_) | Err(_) => {}
    }
    unfinished_file(&folder, &name, None)?;
    Ok(Some(place))
}

#[cfg(test)]
mod tests;
