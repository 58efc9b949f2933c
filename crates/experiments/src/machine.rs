//! The machine that measures.

use std::fs;
use std::thread::available_parallelism;

use serde::Serialize;

/// What a reader must know of the machine to judge times.
#[derive(Debug, Serialize)]
pub struct Machine {
    /// The program.
    build: &'static str,
    /// Operating system and instruction set.
    system: String,
    /// Model of the processor, where the system says.
    processor: Option<String>,
    /// Cores that this process may use.
    cores: usize,
}

impl Machine {
    /// The machine that this process runs on.
    pub fn this(build: &'static str) -> Self {
        let system = format!("{} {}", std::env::consts::OS, std::env::consts::ARCH);
        Self { build, system, processor: processor(), cores: available_parallelism().map_or(1, usize::from) }
    }
}

/// The model of the processor, on systems with `/proc/cpuinfo`.
fn processor() -> Option<String> {
    let text = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}
