//! The memory of this machine.

use std::fs;
use std::path::Path;

/// Where control groups are.
const GROUPS: &str = "/sys/fs/cgroup";

/// Bytes of memory that this process can have: those of the machine or of its control group, whichever are fewer.
/// `None` where the system does not say.
pub fn machine_memory() -> Option<u64> {
    let machine = installed(&fs::read_to_string("/proc/meminfo").ok()?)?;
    let groups = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    Some(limits(Path::new(GROUPS), &groups).into_iter().fold(machine, u64::min))
}

/// Bytes of memory that the machine has.
fn installed(meminfo: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

/// The limits of the control groups of a process, of either version, and of their parents.
fn limits(root: &Path, groups: &str) -> Vec<u64> {
    let mut limits = Vec::new();
    for line in groups.lines() {
        let mut fields = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(group)) = (fields.next(), fields.next()) else { continue };
        let (mount, file) = match controllers {
            "" => (root.to_owned(), "memory.max"),
            _ if controllers.split(',').any(|controller| controller == "memory") => {
                (root.join("memory"), "memory.limit_in_bytes")
            }
            _ => continue,
        };
        // In a container, its own group is the mount itself.
        let own = mount.join(group.trim_start_matches('/'));
        let above = own.ancestors().take_while(|folder| folder.starts_with(&mount));
        limits
            .extend(above.filter_map(|folder| fs::read_to_string(folder.join(file)).ok()?.trim().parse::<u64>().ok()));
    }
    limits
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_limit_of_all_groups_counts() {
        let root = tempfile::tempdir().unwrap();
        for (folder, file, limit) in [
            ("farm/worker", "memory.max", "max"),
            ("farm", "memory.max", "2147483648"),
            ("memory/old", "memory.limit_in_bytes", "9223372036854771712"),
        ] {
            fs::create_dir_all(root.path().join(folder)).unwrap();
            fs::write(root.path().join(folder).join(file), format!("{limit}\n")).unwrap();
        }
        assert_eq!(limits(root.path(), "0::/farm/worker\n"), [2_147_483_648]);
        assert_eq!(limits(root.path(), "4:cpu,memory:/old\n3:pids:/old\n"), [9_223_372_036_854_771_712]);
        assert_eq!(limits(root.path(), "nonsense"), [0; 0]);
    }

    #[test]
    fn installed_memory_is_read_in_kibibytes() {
        assert_eq!(installed("MemTotal:       24576 kB\nMemFree: 1 kB\n"), Some(24576 << 10));
        assert_eq!(installed("MemTotal: much"), None);
    }
}
