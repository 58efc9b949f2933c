//! Usage of a process, as Linux reports it: memory, processor time, writes and sockets. And the limit on sockets.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::error::LoadError;

/// Ticks in a second of the times in `/proc`, on every Linux.
const TICKS: u64 = 100;

/// Sockets for each worker: one for its claims, one for its uploads, and one for heartbeats while it waits for a lease.
const SOCKETS: u64 = 3;

/// Files and sockets that a process has open besides these.
const OTHER_FILES: u64 = 200;

/// A process in `/proc`.
#[derive(Clone, Debug)]
pub(crate) struct Process {
    folder: PathBuf,
}

/// The usage of a process so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Usage {
    /// Core time.
    pub(crate) processor: Duration,
    /// Bytes that it made the system write to a disk.
    pub(crate) written_bytes: u64,
    /// Memory now, bytes.
    pub(crate) resident_bytes: u64,
    /// Most memory so far, bytes.
    pub(crate) peak_bytes: u64,
    /// Open sockets.
    pub(crate) sockets: u64,
}

impl Process {
    /// This process.
    pub(crate) fn this() -> Self {
        Self { folder: PathBuf::from("/proc/self") }
    }

    /// The process with this number.
    pub(crate) fn new(id: u32) -> Self {
        Self { folder: PathBuf::from(format!("/proc/{id}")) }
    }

    /// Its usage so far.
    pub(crate) fn usage(&self) -> Result<Usage, LoadError> {
        let status = self.read("status")?;
        let kibibytes = |name| self.number("status", &status, name).map(|kibibytes| kibibytes << 10);
        let written_bytes = self.number("io", &self.read("io")?, "write_bytes")?;
        Ok(Usage {
            processor: self.processor()?,
            written_bytes,
            resident_bytes: kibibytes("VmRSS")?,
            peak_bytes: kibibytes("VmHWM")?,
            sockets: self.sockets()?,
        })
    }

    /// Core time so far, in steps of 10 ms.
    pub(crate) fn processor(&self) -> Result<Duration, LoadError> {
        let stat = self.read("stat")?;
        let ticks = ticks(&stat).ok_or_else(|| self.malformed("stat", "utime"))?;
        Ok(Duration::from_millis(ticks * (1000 / TICKS)))
    }

    fn sockets(&self) -> Result<u64, LoadError> {
        let folder = self.folder.join("fd");
        let entries = fs::read_dir(&folder).map_err(|source| LoadError::Read { file: folder, source })?;
        let is_socket = |file: &Path| fs::read_link(file).is_ok_and(|to| to.to_string_lossy().starts_with("socket:"));
        Ok(entries.flatten().filter(|entry| is_socket(&entry.path())).count() as u64)
    }

    fn read(&self, name: &str) -> Result<String, LoadError> {
        let file = self.folder.join(name);
        fs::read_to_string(&file).map_err(|source| LoadError::Read { file, source })
    }

    /// The number after `NAME:` in a file of such lines.
    fn number(&self, file: &str, text: &str, name: &str) -> Result<u64, LoadError> {
        named_number(text, name).ok_or_else(|| self.malformed(file, name))
    }

    fn malformed(&self, file: &str, name: &str) -> LoadError {
        let source = io::Error::new(io::ErrorKind::InvalidData, format!("it has no number `{name}`"));
        LoadError::Read { file: self.folder.join(file), source }
    }
}

fn named_number(text: &str, name: &str) -> Option<u64> {
    let values = text.lines().filter_map(|line| line.split_once(':'));
    let value = values.into_iter().find(|(found, _)| *found == name)?.1;
    value.split_whitespace().next()?.parse().ok()
}

/// Ticks in user and kernel mode. The name of the process may contain anything and ends at the last parenthesis.
fn ticks(stat: &str) -> Option<u64> {
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    Some(fields.get(11)?.parse::<u64>().ok()? + fields.get(12)?.parse::<u64>().ok()?)
}

/// Raises the limit of open files of this process and its children for `workers` workers.
#[cfg(unix)]
pub(crate) fn allow_workers(workers: u32) -> Result<(), LoadError> {
    use nix::sys::resource::{Resource, getrlimit, setrlimit};

    let needed = SOCKETS * u64::from(workers) + OTHER_FILES;
    let failure = |limit: u64| {
        LoadError::Usage(format!(
            "{workers} workers need {needed} open files and the limit (RLIMIT_NOFILE) is {limit}: expected fewer \
             --workers, or a higher limit, such as by `ulimit -n {needed}`"
        ))
    };
    let (soft, hard) = getrlimit(Resource::RLIMIT_NOFILE).map_err(|_| failure(0))?;
    if soft >= needed {
        return Ok(());
    }
    if hard < needed {
        return Err(failure(hard));
    }
    setrlimit(Resource::RLIMIT_NOFILE, needed, hard).map_err(|_| failure(soft))
}

/// Systems without such a limit.
#[cfg(not(unix))]
pub(crate) fn allow_workers(_workers: u32) -> Result<(), LoadError> {
    Ok(())
}

/// Bytes of all files below a folder, without files that disappear.
pub(crate) fn bytes_in(folder: &Path) -> u64 {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let sizes = entries.map(|entry| match entry.metadata() {
        Ok(metadata) if metadata.is_dir() => bytes_in(&entry.path()),
        Ok(metadata) => metadata.len(),
        Err(_) => 0,
    });
    sizes.sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_numbers_of_a_process_are_found() {
        assert_eq!(ticks("7 (a) b) S 1 7 7 0 -1 4 9 0 0 0 250 50 0 0 20 0 3 0"), Some(300));
        assert_eq!(ticks("7 (a) S 1"), None);
        assert_eq!(named_number("VmPeak:\t   9 kB\nVmRSS:\t  12 kB\n", "VmRSS"), Some(12));
        assert_eq!(named_number("rchar: 3\nwrite_bytes: 4096\ncancelled_write_bytes: 1\n", "write_bytes"), Some(4096));
        assert_eq!(named_number("rchar: 3\n", "write_bytes"), None);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn this_process_has_memory_and_a_missing_one_is_named() {
        let usage = Process::this().usage().unwrap();
        assert!(usage.resident_bytes > 0 && usage.peak_bytes >= usage.resident_bytes, "{usage:?}");
        let failure = Process::new(u32::MAX).usage().unwrap_err();
        assert!(failure.to_string().contains("/proc/4294967295/status"), "{failure}");
    }

    #[test]
    fn bytes_are_those_of_all_files() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("a")).unwrap();
        fs::write(folder.path().join("a/b"), [0; 10]).unwrap();
        fs::write(folder.path().join("c"), [0; 5]).unwrap();
        assert_eq!((bytes_in(folder.path()), bytes_in(&folder.path().join("nothing"))), (15, 0));
    }
}
