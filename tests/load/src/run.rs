//! A run: all numbers of workers, one after the other.

use std::fs;
use std::path::{Path, PathBuf};

use crate::ceilings::Ceilings;
use crate::error::LoadError;
use crate::machine::Machine;
use crate::report::Report;
use crate::settings::Settings;
use crate::{coordinator, file_system, measurement, process};

/// Measures all numbers of workers, one after the other, on one farm whose coordinator is started anew for each. When
/// one fails, the report has the lines before it.
///
/// # Errors
///
/// When the folder, the coordinator or the bare machine cannot be used. The inner result has the failure of a line.
pub async fn run(settings: &Settings) -> Result<(Report, Result<(), LoadError>), LoadError> {
    let most = settings.workers.iter().copied().max().unwrap_or(0);
    process::allow_workers(most)?;
    let (folder, _temporary) = match &settings.data {
        Some(folder) => {
            check_empty(folder)?;
            (folder.clone(), None)
        }
        None => {
            let failure = |source| LoadError::Write { file: std::env::temp_dir(), source };
            let made = tempfile::Builder::new().prefix("clerestory-bench-").tempdir().map_err(failure)?;
            (made.path().to_owned(), Some(made))
        }
    };
    let machine = Machine::this(coordinator::build(&settings.clerestory)?);
    let bare = folder.join("bare");
    fs::create_dir_all(&bare).map_err(|source| LoadError::Write { file: bare.clone(), source })?;
    let ceilings = Ceilings::measure(&bare, settings.database.as_deref()).await?;
    fs::remove_dir_all(&bare).map_err(|source| LoadError::Write { file: bare, source })?;
    let (mut lines, mut outcome) = (Vec::new(), Ok(()));
    for &workers in &settings.workers {
        match measurement::measure(settings, &folder, workers).await {
            Ok(line) => lines.push(line),
            Err(failure) => {
                outcome = Err(failure);
                break;
            }
        }
    }
    Ok((Report::new(settings, machine, file_system::of(&folder), ceilings, lines), outcome))
}

/// Refuses a folder with files, whose sizes would count as those of the load.
fn check_empty(folder: &Path) -> Result<(), LoadError> {
    fs::create_dir_all(folder).map_err(|source| LoadError::Write { file: folder.to_owned(), source })?;
    let mut entries = fs::read_dir(folder).map_err(|source| LoadError::Read { file: folder.to_owned(), source })?;
    match entries.next() {
        None => Ok(()),
        Some(_) => Err(LoadError::Usage(format!("--data {} is not empty: expected an empty folder", folder.display()))),
    }
}

/// The program `clerestory` in the folder of this program, where cargo builds both.
pub fn clerestory() -> PathBuf {
    let this = std::env::current_exe().unwrap_or_default();
    let folder = this.parent().unwrap_or(Path::new(""));
    // Tests are in the folder `deps` below it.
    let folder = if folder.ends_with("deps") { folder.parent().unwrap_or(folder) } else { folder };
    folder.join(format!("clerestory{}", std::env::consts::EXE_SUFFIX))
}
