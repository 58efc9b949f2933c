//! How the allocator returns freed memory to the system.

#![allow(unsafe_code)]

/// Size in bytes from which a block is mapped and returned to the system when it is freed. Most partials are smaller;
/// images and previews are larger.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const LARGE_BLOCK: libc::c_int = 1 << 20;

/// The environment variable of glibc for the number of arenas.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const ARENAS: &str = "MALLOC_ARENA_MAX";

/// Makes large freed blocks return to the system, and small blocks come from two arenas for each core. Must run before
/// other threads start.
///
/// By default, glibc raises its limit for mapped blocks to the largest freed one, up to 32 MiB. Images and previews
/// would then lie among small blocks and leave holes in the arenas. Freed small blocks stay in their arena, and glibc
/// has eight arenas for each core. Fewer arenas need less memory at the same speed.
pub(crate) fn keep_little() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let arenas = libc::c_int::try_from(2 * cores).unwrap_or(libc::c_int::MAX);
        let is_told = std::env::var_os(ARENAS).is_some();
        // SAFETY: `mallopt` takes two numbers, and keeps no reference or pointer of ours. It ignores a number that it
        // rejects. It must not run while another thread allocates, and no other thread has started.
        unsafe {
            libc::mallopt(libc::M_MMAP_THRESHOLD, LARGE_BLOCK);
            if !is_told {
                libc::mallopt(libc::M_ARENA_MAX, arenas);
            }
        }
    }
}
