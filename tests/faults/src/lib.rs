//! Faults of the disk and of the clock, for the process that loads this library before its own (`LD_PRELOAD`).
//!
//! It replaces some functions of the C library. Rust's standard library, SQLite and PostgreSQL use these to write and
//! sync files and to read the clock. Each makes the same system call as the function that it replaces, unless the
//! *control* says otherwise. The control is a small file that both sides map or write. So faults come and go while the
//! process runs, and persist when it restarts. `clerestory-test-servers` has the other side, with the layout of the
//! control.
//!
//! - On a full disk, writes to files below a folder fail with `ENOSPC`.
//! - A failing disk answers `EIO` when files below that folder are synced.
//! - A stepped clock shows another time of day; the clock that only measures goes on.

#[cfg(all(target_os = "linux", target_pointer_width = "64"))]
mod interposed;
