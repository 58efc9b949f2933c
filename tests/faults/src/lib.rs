//! Faults of the disk and of the clock, for the process that loads this library before its own (`LD_PRELOAD`).
//!
//! It takes the place of some functions of the C library, which is what Rust's standard library, SQLite and PostgreSQL
//! write and sync files and read the clock with. Each makes the same system call as the function that it replaces,
//! unless the *control* says otherwise: a small file that both sides map or write, so that faults come and go while the
//! process runs, and stay through a restart of it. `clerestory-test-servers` has the other side, with the layout of the
//! control.
//!
//! - On a full disk, writes to files below a folder fail with `ENOSPC`.
//! - A failing disk answers `EIO` when files below that folder are synced.
//! - A stepped clock shows another time of day; the clock that only measures goes on.

#[cfg(all(target_os = "linux", target_pointer_width = "64"))]
mod interposed;
