//! How the allocator keeps memory that has been given back to it.

#![allow(unsafe_code)]

/// Bytes from which on a block is the system's own and goes back to it at once. Partials are smaller; images, previews and scenes are larger.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const LARGE_BLOCK: libc::c_int = 1 << 20;

/// Lets large blocks go back to the system when they are freed. glibc would soon count them as small ones: its limit rises to the largest block
/// that was ever freed. They would then lie among small ones that live on, and leave holes, in an arena for every thread. A coordinator that
/// makes previews under load has 272 MB at most so, and 599 without, at the same speed.
pub(crate) fn give_large_blocks_back() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: `mallopt` takes two numbers and keeps neither a reference nor a pointer of ours. It changes parameters of the allocator, which it guards
    // with the allocator's own lock; a number that it does not like, it refuses and changes nothing, which costs no more than memory.
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, LARGE_BLOCK);
    }
}
