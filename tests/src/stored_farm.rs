//! What builds of `clerestory` have left of farms, in `tests/data/farms`: the command `farm-fixture` writes it, tests
//! start today's build on it.

use std::fs;
use std::path::Path;

/// A data folder with SQLite.
pub const SQLITE: &str = "sqlite";

/// A data folder whose database is in PostgreSQL.
pub const POSTGRES: &str = "postgres";

/// In that folder, the dump of its database.
pub const DATABASE: &str = "farm.sql";

/// In both, a table of what the jobs were and have to become.
pub const JOBS: &str = "jobs.txt";

/// In that table instead of a state: what one process makes of the same job.
pub const ALONE: &str = "rendered alone";

/// Copies the files of a folder whose name is wanted, and all folders in it.
///
/// # Panics
///
/// When one cannot be read or written.
pub fn copy_folder(from: &Path, to: &Path, is_wanted: &dyn Fn(&str) -> bool) {
    fs::create_dir_all(to).expect("a writable folder");
    for entry in fs::read_dir(from).expect("a folder") {
        let entry = entry.expect("a folder");
        let (source, target) = (entry.path(), to.join(entry.file_name()));
        if source.is_dir() {
            copy_folder(&source, &target, is_wanted);
        } else if is_wanted(&entry.file_name().to_string_lossy()) {
            fs::copy(&source, &target).expect("a file that can be copied");
        }
    }
}
