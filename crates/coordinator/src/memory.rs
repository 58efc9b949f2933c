//! Budgets of memory.

/// Permits for so many bytes of memory, one for each kibibyte.
pub(crate) fn permits(bytes: u64) -> u32 {
    u32::try_from(bytes >> 10).unwrap_or(u32::MAX).max(1)
}
