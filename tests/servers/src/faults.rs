//! Faults of the disk and of the clock of one process: the side that switches them on and off. The other side is the
//! library `clerestory-test-faults`, which the process loads before its own.

use std::fs::{self, File, Permissions};
use std::io;
use std::os::unix::fs::{FileExt, PermissionsExt, chown};
use std::path::{Path, PathBuf};

use nix::unistd::User;
use tempfile::TempDir;

/// The library as cargo names it.
const LIBRARY: &str = "libclerestory_test_faults.so";

/// The integers of the control, in their order, each of 64 bits.
#[derive(Clone, Copy)]
enum Word {
    DiskIsFull,
    SyncsFail,
    ClockStep,
    FailedWrites,
    FailedSyncs,
}

impl Word {
    const COUNT: usize = Self::FailedSyncs as usize + 1;

    fn place(self) -> u64 {
        self as u64 * size_of::<i64>() as u64
    }
}

/// Faults of one process, which last until they are taken back, also when it is started again.
#[derive(Debug)]
pub struct Faults {
    /// Holds the library and the control.
    folder: TempDir,
    control: File,
    below: PathBuf,
}

impl Faults {
    /// Faults of the disk on which everything below a folder is, for a process of this user; none yet.
    ///
    /// # Errors
    ///
    /// When the library has not been built, or the disk is really full.
    pub fn below(below: &Path, user: Option<&User>) -> io::Result<Self> {
        let folder = tempfile::tempdir()?;
        let copy = folder.path().join(LIBRARY);
        fs::copy(library()?, &copy)?;
        fs::set_permissions(&copy, Permissions::from_mode(0o755))?;
        let file = folder.path().join("control");
        let control = File::options().create_new(true).read(true).write(true).open(&file)?;
        control.write_all_at(&[0; Word::COUNT * size_of::<i64>()], 0)?;
        if let Some(user) = user {
            for path in [folder.path(), &copy, &file] {
                chown(path, Some(user.uid.as_raw()), Some(user.gid.as_raw()))?;
            }
        }
        Ok(Self { folder, control, below: below.canonicalize()? })
    }

    /// What the process has to find in its environment.
    pub fn environment(&self) -> [(String, String); 3] {
        let file = |name: &str| self.folder.path().join(name).display().to_string();
        [
            ("LD_PRELOAD", file(LIBRARY)),
            ("FAULTS_CONTROL", file("control")),
            ("FAULTS_FOLDER", self.below.display().to_string()),
        ]
        .map(|(name, value)| (name.to_owned(), value))
    }

    /// Whether every write fails, as on a full disk.
    ///
    /// # Panics
    ///
    /// When the control cannot be written.
    pub fn fill_disk(&self, is_full: bool) {
        self.set(Word::DiskIsFull, is_full.into());
    }

    /// Whether every sync fails.
    ///
    /// # Panics
    ///
    /// When the control cannot be written.
    pub fn fail_syncs(&self, fail: bool) {
        self.set(Word::SyncsFail, fail.into());
    }

    /// How far the clock that shows the time of day is off, in seconds.
    ///
    /// # Panics
    ///
    /// When the control cannot be written.
    pub fn step_clock(&self, seconds: i64) {
        self.set(Word::ClockStep, seconds);
    }

    /// How many writes have failed so far.
    ///
    /// # Panics
    ///
    /// When the control cannot be read.
    pub fn failed_writes(&self) -> u64 {
        self.get(Word::FailedWrites)
    }

    /// How many syncs have failed so far.
    ///
    /// # Panics
    ///
    /// When the control cannot be read.
    pub fn failed_syncs(&self) -> u64 {
        self.get(Word::FailedSyncs)
    }

    /// How many writes and syncs have failed so far.
    ///
    /// # Panics
    ///
    /// When the control cannot be read.
    pub fn failures(&self) -> u64 {
        self.failed_writes() + self.failed_syncs()
    }

    fn set(&self, word: Word, value: i64) {
        self.control.write_all_at(&value.to_ne_bytes(), word.place()).expect("the control can be written");
    }

    fn get(&self, word: Word) -> u64 {
        let mut bytes = [0; size_of::<i64>()];
        self.control.read_exact_at(&mut bytes, word.place()).expect("the control can be read");
        u64::from_ne_bytes(bytes)
    }
}

/// The library, as cargo built it with this test.
fn library() -> io::Result<PathBuf> {
    let test = std::env::current_exe()?;
    // Tests lie in target/PROFILE/deps, libraries in target/PROFILE.
    let found = test.ancestors().skip(1).map(|folder| folder.join(LIBRARY)).find(|library| library.is_file());
    found.ok_or_else(|| {
        let message = format!("no {LIBRARY} above the test: run `cargo build --release --workspace` first");
        io::Error::new(io::ErrorKind::NotFound, message)
    })
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::*;

    /// Runs a shell's words in a folder, with the faults.
    fn succeeds(faults: &Faults, folder: &Path, words: &str) -> bool {
        let mut command = Command::new("sh");
        let status = command.args(["-c", words]).current_dir(folder).envs(faults.environment()).status();
        status.unwrap().success()
    }

    #[test]
    fn writes_to_a_full_disk_fail_below_the_folder_only() {
        let (folder, elsewhere) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let faults = Faults::below(folder.path(), None).unwrap();
        assert!(succeeds(&faults, folder.path(), "printf lead > a"));
        faults.fill_disk(true);
        assert!(!succeeds(&faults, folder.path(), "printf lead > b 2>/dev/null"));
        assert!(succeeds(&faults, elsewhere.path(), "printf lead > b"));
        assert_eq!(fs::read(folder.path().join("b")).unwrap(), b"");
        assert!(faults.failed_writes() > 0 && faults.failed_syncs() == 0);
        faults.fill_disk(false);
        assert!(succeeds(&faults, folder.path(), "printf lead > b"));
        assert_eq!(fs::read(folder.path().join("b")).unwrap(), b"lead");
    }

    #[test]
    fn syncs_fail_while_they_are_told_to() {
        let folder = tempfile::tempdir().unwrap();
        let faults = Faults::below(folder.path(), None).unwrap();
        let synced = "dd if=/dev/zero of=a bs=1 count=1 conv=fsync 2>/dev/null";
        assert!(succeeds(&faults, folder.path(), synced));
        faults.fail_syncs(true);
        assert!(!succeeds(&faults, folder.path(), synced));
        assert!(faults.failed_syncs() > 0 && faults.failed_writes() == 0);
        faults.fail_syncs(false);
        assert!(succeeds(&faults, folder.path(), synced));
    }

    #[test]
    fn a_stepped_clock_shows_another_time() {
        let folder = tempfile::tempdir().unwrap();
        let faults = Faults::below(folder.path(), None).unwrap();
        let shown = || {
            let output = Command::new("date").arg("+%s").envs(faults.environment()).output().unwrap();
            String::from_utf8(output.stdout).unwrap().trim().parse::<i64>().unwrap()
        };
        let before = shown();
        faults.step_clock(-100_000);
        assert!((99_000..=100_000).contains(&(before - shown())));
    }
}
