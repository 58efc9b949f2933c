//! The memory of a process, as the system tells it.

/// The most memory that a process has had, in bytes.
#[derive(Clone, Copy, Debug)]
pub struct PeakMemory {
    /// What it had written to or read from.
    pub resident: u64,
    /// What it had asked for, whether it used it or not.
    pub address_space: u64,
}

/// The most memory that a process has had so far; `None` when it has ended, or the system does not describe processes
/// as Linux does.
pub fn peak_memory(process: u32) -> Option<PeakMemory> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let bytes = |name: &str| {
        let value = status.lines().find_map(|line| line.strip_prefix(name))?;
        value
            .trim_start_matches(':')
            .trim()
            .trim_end_matches(" kB")
            .parse::<u64>()
            .ok()
            .map(|kibibytes| kibibytes << 10)
    };
    Some(PeakMemory { resident: bytes("VmHWM")?, address_space: bytes("VmPeak")? })
}
