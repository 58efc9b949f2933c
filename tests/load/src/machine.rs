//! The machine that is measured.

use std::fs;
use std::thread::available_parallelism;

use serde::Serialize;

/// What a reader must know of the machine to judge rates.
#[derive(Debug, Serialize)]
pub(crate) struct Machine {
    /// The coordinator's build.
    pub(crate) build: String,
    /// Operating system and instruction set.
    pub(crate) system: String,
    /// Model of the processor, where the system says.
    pub(crate) processor: Option<String>,
    /// Cores that this process may use.
    pub(crate) cores: usize,
}

impl Machine {
    /// The machine that this process runs on.
    pub(crate) fn this(build: String) -> Self {
        let system = format!("{} {}", std::env::consts::OS, std::env::consts::ARCH);
        let cpus = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let model = cpus.lines().find(|line| line.starts_with("model name")).and_then(|line| line.split_once(':'));
        let processor = model.map(|(_, model)| model.trim().to_owned());
        Self { build, system, processor, cores: available_parallelism().map_or(1, usize::from) }
    }
}
