//! Files that a command leaves behind.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::failure::Failure;

/// Writes a file whole or not at all: a reader never sees half of it, and a full disk does not cost the old one.
pub(crate) fn write(file: &Path, content: &[u8]) -> Result<(), Failure> {
    let mut output = OutputFile::create(file)?;
    output.write(content)?;
    output.finish()
}

/// A file that is written piece by piece, and appears under its name when it is whole.
#[derive(Debug)]
pub(crate) struct OutputFile {
    name: PathBuf,
    /// Where it is until it is whole; none for what is no regular file.
    unfinished: Option<PathBuf>,
    content: File,
}

impl OutputFile {
    /// Begins a file.
    pub(crate) fn create(file: &Path) -> Result<Self, Failure> {
        let unfinished = (!is_special(file)).then(|| unfinished_name(file));
        let content = match &unfinished {
            Some(unfinished) => File::create(unfinished),
            None => File::options().write(true).open(file),
        };
        let content = content.map_err(|source| Failure::Write { file: file.to_owned(), source })?;
        Ok(Self { name: file.to_owned(), unfinished, content })
    }

    /// Writes the next piece.
    pub(crate) fn write(&mut self, piece: &[u8]) -> Result<(), Failure> {
        self.content.write_all(piece).map_err(|source| Failure::Write { file: self.name.clone(), source })
    }

    /// Gives the file its name.
    pub(crate) fn finish(mut self) -> Result<(), Failure> {
        if let Some(unfinished) = &self.unfinished {
            let renamed = fs::rename(unfinished, &self.name);
            renamed.map_err(|source| Failure::Write { file: self.name.clone(), source })?;
            self.unfinished = None;
        }
        Ok(())
    }
}

impl Drop for OutputFile {
    /// Removes what is not whole.
    fn drop(&mut self) {
        if let Some(unfinished) = &self.unfinished {
            // The error that matters is the first.
            let _ = fs::remove_file(unfinished);
        }
    }
}

/// Writes the counters of a render.
pub(crate) fn write_stats(file: &Path, counters: &impl Serialize) -> Result<(), Failure> {
    write(file, &serde_json::to_vec_pretty(counters).expect("counters have a form in JSON"))
}

/// Extensions of image files that hold something else than OpenEXR.
const FOREIGN_EXTENSIONS: [&str; 15] =
    ["avif", "bmp", "dpx", "gif", "hdr", "jpeg", "jpg", "jxl", "pfm", "png", "ppm", "tga", "tif", "tiff", "webp"];

/// Refuses a name for an image that says that the file is of another format.
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

/// The PNG that belongs to an image: `.exr` becomes `.png`, and to any other name `.png` is added.
pub(crate) fn png_beside(image: &Path) -> PathBuf {
    if image.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr")) {
        return image.with_extension("png");
    }
    let mut name = image.as_os_str().to_owned();
    name.push(".png");
    PathBuf::from(name)
}

/// Checks, before the work for them starts, that the files of a command can be written later and that no two are the
/// same. Each comes with the option that asks for it.
pub(crate) fn check_outputs(files: &[(&str, Option<&Path>)]) -> Result<(), Failure> {
    let mut seen: Vec<(&str, PathBuf)> = Vec::new();
    for (option, file) in files.iter().filter_map(|(option, file)| Some((*option, (*file)?))) {
        check_writable(file)?;
        // Two texts may well go to one terminal or pipe.
        if is_special(file) {
            continue;
        }
        let place = place(file);
        if let Some((other, _)) = seen.iter().find(|(_, other)| *other == place) {
            let file = file.display();
            return Err(Failure::Usage(format!("{other} and {option} both write {file}: expected a file for each")));
        }
        seen.push((option, place));
    }
    Ok(())
}

/// A file as the system finds it, however its folder was spelled.
fn place(file: &Path) -> PathBuf {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match (fs::canonicalize(folder), file.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => file.to_owned(),
    }
}

/// Checks that a file can be written later.
fn check_writable(file: &Path) -> Result<(), Failure> {
    if file.is_dir() {
        return Err(Failure::Write { file: file.to_owned(), source: io::ErrorKind::IsADirectory.into() });
    }
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
    fn a_png_keeps_the_name_of_its_image() {
        for (image, png) in
            [("a/room.exr", "a/room.png"), ("room-0.27.exr", "room-0.27.png"), ("room-0.27", "room-0.27.png")]
        {
            assert_eq!(png_beside(Path::new(image)), Path::new(png));
        }
    }

    #[test]
    fn a_name_of_another_image_format_is_refused_and_any_other_is_not() {
        for name in ["a.png", "a/room.JPG", "room-0.27.tiff"] {
            let message = check_image_name(Path::new(name)).unwrap_err().to_string();
            let expected = Path::new(name).with_extension("exr");
            assert!(message.contains(name) && message.contains(&*expected.to_string_lossy()), "{message}");
        }
        for name in ["a.exr", "a.EXR", "room-0.27", "/dev/stdout", "png", ""] {
            check_image_name(Path::new(name)).unwrap();
        }
    }

    #[test]
    fn two_outputs_in_one_file_are_refused_by_the_names_of_their_options() {
        let folder = tempfile::tempdir().unwrap();
        let (file, other) = (folder.path().join("a.png"), folder.path().join("./a.png"));
        check_outputs(&[("--output", Some(&file)), ("--png", None), ("--stats", Some(&folder.path().join("b")))])
            .unwrap();
        let failure = check_outputs(&[("--output", Some(&file)), ("--png", Some(&other))]).unwrap_err().to_string();
        assert!(failure.contains("--output and --png both write"), "{failure}");
    }

    #[test]
    fn a_folder_that_does_not_exist_or_has_the_files_name_is_noticed_before_the_work() {
        let folder = tempfile::tempdir().unwrap();
        let message = check_writable(folder.path()).unwrap_err();
        assert!(message.causes().any(|cause| cause.to_string() == "is a directory"), "{message:?}");
        let message = check_writable(&folder.path().join("no/such/image.exr")).unwrap_err().to_string();
        assert!(message.contains("no/such/image.exr"), "{message}");
    }
}
