//! How the allocator keeps memory that has been given back to it.

#![allow(unsafe_code)]

/// Bytes from which on a block is mapped, where no free piece is large enough, and goes back to the system at once. Most partials are smaller; images
/// and previews are larger.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const LARGE_BLOCK: libc::c_int = 1 << 20;

/// Lets large blocks go back to the system when they are freed. To be called before there are other threads.
///
/// glibc would soon count them as small ones: its limit rises to the largest mapped block that was ever freed, up to 32 MiB. They would then lie among small
/// ones that live on, and leave holes, in an arena for every thread. A coordinator that makes previews under load has 272 MB at most so, and 599 without,
/// at the same speed.
pub(crate) fn give_large_blocks_back() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: `mallopt` takes two numbers and keeps neither a reference nor a pointer of ours; a number that it does not like, it refuses and changes
    // nothing. It must not run while another thread allocates, and there is none yet.
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, LARGE_BLOCK);
    }
}
