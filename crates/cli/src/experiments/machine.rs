//! What is measured with: the machine.

use std::fs;

use serde::Serialize;

use crate::commands::worker::BUILD;
use crate::threads::cores;

/// What a reader must know of the machine to judge times.
#[derive(Debug, Serialize)]
pub(crate) struct Machine {
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
    pub(crate) fn this() -> Self {
        let system = format!("{} {}", std::env::consts::OS, std::env::consts::ARCH);
        Self { build: BUILD, system, processor: processor(), cores: cores().get() }
    }
}

/// The model of the processor, on systems that have a file which says so.
fn processor() -> Option<String> {
    let text = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}
