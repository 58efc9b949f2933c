//! The settings of a worker.

use std::num::NonZeroUsize;

/// Settings of a worker.
#[derive(Clone, Debug)]
pub struct Config {
    /// Address of the coordinator, for instance `http://127.0.0.1:7171`.
    pub coordinator: String,
    /// The farm's token, where it has one.
    pub token: Option<String>,
    /// Its name, for instance that of the machine.
    pub name: String,
    /// Threads that render.
    pub threads: NonZeroUsize,
    /// Bytes of memory that scenes may take together; `None` for all that the machine has.
    pub memory: Option<u64>,
    /// Which build of Clerestory this is; written into every partial.
    pub build: String,
}
