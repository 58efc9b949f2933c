//! Limits on the memory of a process, kept by the system: control groups of Linux, of either version.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Where control groups are.
const ROOT: &str = "/sys/fs/cgroup";

/// A control group below that of this process, or below one above it, with a limit on its memory. It goes with the
/// value, when its processes have ended.
#[derive(Debug)]
pub struct MemoryGroup {
    folder: PathBuf,
    peak_file: &'static str,
}

impl MemoryGroup {
    /// A group whose processes have at most this many bytes together, with the pages of files that they read or wrote.
    /// The system takes such pages back when it needs them; for other memory beyond the limit, it ends a process, and
    /// moves nothing to swap.
    ///
    /// # Errors
    ///
    /// When the system has no such groups, or does not let this process make one.
    pub fn new(name: &str, limit: u64) -> io::Result<Self> {
        let own = fs::read_to_string("/proc/self/cgroup")?;
        let second_version = Path::new(ROOT).join("cgroup.controllers").exists();
        let (parent, limit_file, swap, peak_file) = if second_version {
            (giving_memory(&own_group(&own, "", "")?)?.to_owned(), "memory.max", ("memory.swap.max", 0), "memory.peak")
        } else {
            let swap = ("memory.memsw.limit_in_bytes", limit);
            (own_group(&own, "memory", "memory")?, "memory.limit_in_bytes", swap, "memory.max_usage_in_bytes")
        };
        let folder = parent.join(name);
        fs::create_dir(&folder)?;
        let group = Self { folder, peak_file };
        fs::write(group.folder.join(limit_file), limit.to_string())?;
        // A system that does not count swap has no such file.
        let (swap_file, swap) = (group.folder.join(swap.0), swap.1);
        if swap_file.exists() {
            fs::write(swap_file, swap.to_string())?;
        }
        Ok(group)
    }

    /// Takes a process in. What it has already stays where it was counted.
    ///
    /// # Errors
    ///
    /// When it has ended.
    pub fn add(&self, process: u32) -> io::Result<()> {
        fs::write(self.folder.join("cgroup.procs"), process.to_string())
    }

    /// The most bytes that its processes have had together, pages of files included.
    ///
    /// # Errors
    ///
    /// When the system does not say.
    pub fn peak_bytes(&self) -> io::Result<u64> {
        let text = fs::read_to_string(self.folder.join(self.peak_file))?;
        text.trim().parse().map_err(io::Error::other)
    }
}

impl Drop for MemoryGroup {
    fn drop(&mut self) {
        // A process may still be in it.
        let _ = fs::remove_dir(&self.folder);
    }
}

/// The folder of a process's group: that of a controller in version 1, where it is mounted, or of all controllers in
/// version 2.
fn own_group(groups: &str, controller: &str, mount: &str) -> io::Result<PathBuf> {
    let group = groups.lines().find_map(|line| {
        let mut fields = line.splitn(3, ':').skip(1);
        let is_it = fields.next()?.split(',').any(|found| found == controller);
        fields.next().filter(|_| is_it)
    });
    let group =
        group.ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, "this process is in no group for memory"))?;
    Ok(Path::new(ROOT).join(mount).join(group.trim_start_matches('/')))
}

/// The nearest group of version 2 whose children can have memory limits: this one or a parent. Limits cannot be enabled
/// in a group that has processes.
fn giving_memory(group: &Path) -> io::Result<&Path> {
    let gives_memory = |group: &&Path| {
        let given = fs::read_to_string(group.join("cgroup.subtree_control"));
        given.is_ok_and(|given| given.split_whitespace().any(|controller| controller == "memory"))
    };
    group.ancestors().find(gives_memory).ok_or_else(|| {
        io::Error::new(io::ErrorKind::NotFound, "no group above this process gives limits on memory to its own")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_is_set_below_the_nearest_group_that_gives_memory() {
        let root = tempfile::tempdir().unwrap();
        let groups = ["", "user", "user/session"].map(|group| root.path().join(group));
        for (group, given) in groups.iter().zip(["cpu memory pids", "cpu memory", ""]) {
            fs::create_dir_all(group).unwrap();
            fs::write(group.join("cgroup.subtree_control"), given).unwrap();
        }
        assert_eq!(giving_memory(&groups[2]).unwrap(), groups[1]);
        fs::write(groups[1].join("cgroup.subtree_control"), "cpu").unwrap();
        assert_eq!(giving_memory(&groups[2]).unwrap(), groups[0]);
        fs::remove_file(groups[0].join("cgroup.subtree_control")).unwrap();
        assert!(giving_memory(&groups[2]).is_err());
    }

    #[test]
    fn the_group_of_a_process_is_found_in_both_versions() {
        let found = |groups, controller, mount| own_group(groups, controller, mount).unwrap();
        let first = "9:name=systemd:/a\n4:cpu,memory:/b/c\n0::/\n";
        assert_eq!(found(first, "memory", "memory"), Path::new("/sys/fs/cgroup/memory/b/c"));
        assert_eq!(found("0::/user.slice/x\n", "", ""), Path::new("/sys/fs/cgroup/user.slice/x"));
        assert!(own_group("9:name=systemd:/a\n", "memory", "memory").is_err());
    }
}
