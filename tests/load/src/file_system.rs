//! The file system of a folder. One in memory syncs at no cost, so its figures are not those of a disk.

use std::fs;
use std::path::Path;

/// Where Linux lists what is mounted.
const MOUNTS: &str = "/proc/self/mounts";

/// The kind of the file system that holds a folder, as `ext4` or `tmpfs`; `unknown` where the system does not say.
pub(crate) fn of(folder: &Path) -> String {
    let kind = || {
        let mounts = fs::read_to_string(MOUNTS).ok()?;
        Some(holder(&mounts, &folder.canonicalize().ok()?)?.to_owned())
    };
    kind().unwrap_or_else(|| "unknown".to_owned())
}

/// The kind of the innermost mount that holds a folder. Of several mounts on one place, the last hides the others.
fn holder<'a>(mounts: &'a str, folder: &Path) -> Option<&'a str> {
    let holders = mounts.lines().filter_map(|line| {
        let mut fields = line.split(' ').skip(1);
        let (place, kind) = (fields.next()?, fields.next()?);
        folder.starts_with(place).then_some((place.len(), kind))
    });
    Some(holders.max_by_key(|(length, _)| *length)?.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_innermost_and_last_mount_holds_a_folder() {
        let mounts =
            "/dev/vda / ext4 rw 0 0\nproc /proc proc rw 0 0\ntmpfs /tmp tmpfs rw 0 0\n/dev/vdb /tmp xfs rw 0 0\n";
        let holder = |folder: &str| holder(mounts, Path::new(folder));
        assert_eq!(holder("/tmp/farm"), Some("xfs"));
        assert_eq!(holder("/tmpfs/farm"), Some("ext4"));
        assert_eq!(holder("farm"), None);
    }
}
