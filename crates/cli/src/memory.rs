//! How the allocator keeps memory that has been given back to it.

#![allow(unsafe_code)]

/// Bytes from which on a block is mapped, where no free piece is large enough, and goes back to the system at once. Most partials are smaller; images
/// and previews are larger.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const LARGE_BLOCK: libc::c_int = 1 << 20;

/// Where whoever starts a process says how many arenas its small blocks may come from.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const ARENAS: &str = "MALLOC_ARENA_MAX";

/// Lets large blocks go back to the system when they are freed, and small ones come from two arenas for each core. To be called before there are other threads.
///
/// glibc would soon count them as small ones: its limit rises to the largest mapped block that was ever freed, up to 32 MiB. They would then lie among small
/// ones that live on, and leave holes, in an arena for every thread. A coordinator that makes previews under load has 272 MB at most so, and 599 without,
/// at the same speed.
///
/// Of small blocks, glibc keeps what was freed in the arena that it came from, and has eight arenas for each core. A coordinator with 5000 workers that ask again at
/// once, on two cores, has 436 to 460 MB at most with four arenas, and 514 to 563 with sixteen, at the same speed (4274, 4334, 3996 nodes a second, and 3860, 3919, 4008).
pub(crate) fn keep_little() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let arenas = libc::c_int::try_from(2 * cores).unwrap_or(libc::c_int::MAX);
        let is_told = std::env::var_os(ARENAS).is_some();
        // SAFETY: `mallopt` takes two numbers and keeps neither a reference nor a pointer of ours; a number that it does not like, it refuses and changes
        // nothing. It must not run while another thread allocates, and there is none yet.
        unsafe {
            libc::mallopt(libc::M_MMAP_THRESHOLD, LARGE_BLOCK);
            if !is_told {
                libc::mallopt(libc::M_ARENA_MAX, arenas);
            }
        }
    }
}
