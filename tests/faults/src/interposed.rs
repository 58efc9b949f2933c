//! The functions that take the place of those of the C library, and what they look at first.
//!
//! Without a control in the environment, each does what it replaces. Once the control is mapped, nothing here allocates
//! or calls a function that is replaced here. `errno` stays as the system call sets it.

#![expect(unsafe_code, reason = "functions of the C library can be replaced by functions of the same form only")]

use std::ffi::{c_int, c_long, c_void};
use std::fs::File;
use std::io::Write;
use std::os::fd::AsRawFd;
use std::os::unix::ffi::OsStringExt;
use std::ptr;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicI64, Ordering};

use libc::{clockid_t, iovec, off_t, size_t, ssize_t, timespec};

/// Where the environment names the control.
const CONTROL: &str = "FAULTS_CONTROL";

/// Where the environment names the folder below which files are on the faulty disk.
const FOLDER: &str = "FAULTS_FOLDER";

/// The control, as the file has it: integers of 64 bits in the machine's order of bytes.
#[repr(C)]
struct Control {
    /// Not 0 while the disk is full.
    disk_is_full: AtomicI64,
    /// Not 0 while syncs fail.
    syncs_fail: AtomicI64,
    /// How far the clock is off, in seconds.
    clock_step: AtomicI64,
    /// Writes that have failed.
    failed_writes: AtomicI64,
    /// Syncs that have failed.
    failed_syncs: AtomicI64,
}

/// What this process is told.
struct Orders {
    control: &'static Control,
    folder: Vec<u8>,
}

/// The orders, if there are any.
fn orders() -> Option<&'static Orders> {
    static ORDERS: OnceLock<Option<Orders>> = OnceLock::new();
    ORDERS
        .get_or_init(|| {
            let control = std::env::var_os(CONTROL)?;
            let folder = std::env::var_os(FOLDER)?.into_vec();
            Some(Orders { control: mapped(&File::options().read(true).write(true).open(control).ok()?)?, folder })
        })
        .as_ref()
}

/// The control in a file, for as long as the process lives.
fn mapped(file: &File) -> Option<&'static Control> {
    let size = size_of::<Control>();
    if file.metadata().ok()?.len() < size as u64 {
        return None;
    }
    // SAFETY: a new mapping at an address of the system's choice touches no memory that is in use; the descriptor is
    // open.
    let address = unsafe {
        libc::mmap(ptr::null_mut(), size, libc::PROT_READ | libc::PROT_WRITE, libc::MAP_SHARED, file.as_raw_fd(), 0)
    };
    if address == libc::MAP_FAILED {
        return None;
    }
    // SAFETY: the mapping is never removed, starts at a page, and is as long as a `Control` in a file that is never cut
    // short. All bits are sound in its atomic integers, which both sides change as wholes.
    Some(unsafe { &*address.cast::<Control>() })
}

/// Whether a file lies below the faulty folder.
fn is_below(folder: &[u8], file: c_int) -> bool {
    let mut link = [0_u8; 40];
    let mut free = &mut link[..];
    // The last byte stays 0: a descriptor has eleven characters at most.
    if write!(free, "/proc/self/fd/{file}").is_err() {
        return false;
    }
    let mut path = [0_u8; 4096];
    // SAFETY: the link's name ends with 0, and the buffer is as long as is said.
    let length = unsafe { libc::readlink(link.as_ptr().cast(), path.as_mut_ptr().cast(), path.len()) };
    let Ok(length) = usize::try_from(length) else { return false };
    path[..length].starts_with(folder)
}

/// Counts and answers whether a write to a file has to fail.
fn write_fails(file: c_int) -> bool {
    let Some(orders) = orders() else { return false };
    let fails = orders.control.disk_is_full.load(Ordering::Relaxed) != 0 && is_below(&orders.folder, file);
    if fails {
        orders.control.failed_writes.fetch_add(1, Ordering::Relaxed);
    }
    fails
}

/// Counts and answers whether a sync of a file has to fail.
fn sync_fails(file: c_int) -> bool {
    let Some(orders) = orders() else { return false };
    let fails = orders.control.syncs_fail.load(Ordering::Relaxed) != 0 && is_below(&orders.folder, file);
    if fails {
        orders.control.failed_syncs.fetch_add(1, Ordering::Relaxed);
    }
    fails
}

/// What a function of the C library answers when it fails.
fn failed(error: c_int) -> c_long {
    // SAFETY: the address is that of this thread's `errno`.
    unsafe { *libc::__errno_location() = error };
    -1
}

/// Writes to a file.
///
/// # Safety
///
/// As that of the C library.
#[unsafe(no_mangle)]
unsafe extern "C" fn write(file: c_int, bytes: *const c_void, length: size_t) -> ssize_t {
    if write_fails(file) {
        return failed(libc::ENOSPC) as ssize_t;
    }
    // SAFETY: the caller keeps the promises of the call.
    unsafe { libc::syscall(libc::SYS_write, file, bytes, length) as ssize_t }
}

/// Writes pieces to a file.
///
/// # Safety
///
/// As that of the C library.
#[unsafe(no_mangle)]
unsafe extern "C" fn writev(file: c_int, pieces: *const iovec, count: c_int) -> ssize_t {
    if write_fails(file) {
        return failed(libc::ENOSPC) as ssize_t;
    }
    // SAFETY: the caller keeps the promises of the call.
    unsafe { libc::syscall(libc::SYS_writev, file, pieces, count) as ssize_t }
}

/// Writes at a place of a file.
///
/// # Safety
///
/// As that of the C library.
#[unsafe(no_mangle)]
unsafe extern "C" fn pwrite(file: c_int, bytes: *const c_void, length: size_t, offset: off_t) -> ssize_t {
    if write_fails(file) {
        return failed(libc::ENOSPC) as ssize_t;
    }
    // SAFETY: the caller keeps the promises of the call.
    unsafe { libc::syscall(libc::SYS_pwrite64, file, bytes, length, offset) as ssize_t }
}

/// Writes at a place of a file; the same with 64 bits.
///
/// # Safety
///
/// As that of the C library.
#[unsafe(no_mangle)]
unsafe extern "C" fn pwrite64(file: c_int, bytes: *const c_void, length: size_t, offset: off_t) -> ssize_t {
    // SAFETY: the caller keeps the promises of the call.
    unsafe { pwrite(file, bytes, length, offset) }
}

/// Writes pieces at a place of a file.
///
/// # Safety
///
/// As that of the C library.
#[unsafe(no_mangle)]
unsafe extern "C" fn pwritev(file: c_int, pieces: *const iovec, count: c_int, offset: off_t) -> ssize_t {
    if write_fails(file) {
        return failed(libc::ENOSPC) as ssize_t;
    }
    // SAFETY: the caller keeps the promises of the call. The system takes the offset in two halves, of which the lower
    // is whole here.
    unsafe { libc::syscall(libc::SYS_pwritev, file, pieces, count, offset, 0_i64) as ssize_t }
}

/// Syncs a file.
///
/// # Safety
///
/// As that of the C library.
#[unsafe(no_mangle)]
unsafe extern "C" fn fsync(file: c_int) -> c_int {
    if sync_fails(file) {
        return failed(libc::EIO) as c_int;
    }
    // SAFETY: the call takes no memory.
    unsafe { libc::syscall(libc::SYS_fsync, file) as c_int }
}

/// Syncs the content of a file.
///
/// # Safety
///
/// As that of the C library.
#[unsafe(no_mangle)]
unsafe extern "C" fn fdatasync(file: c_int) -> c_int {
    if sync_fails(file) {
        return failed(libc::EIO) as c_int;
    }
    // SAFETY: the call takes no memory.
    unsafe { libc::syscall(libc::SYS_fdatasync, file) as c_int }
}

/// Reads a clock.
///
/// # Safety
///
/// As that of the C library.
#[unsafe(no_mangle)]
unsafe extern "C" fn clock_gettime(clock: clockid_t, time: *mut timespec) -> c_int {
    // SAFETY: the caller keeps the promises of the call.
    let outcome = unsafe { libc::syscall(libc::SYS_clock_gettime, clock, time) as c_int };
    if outcome == 0
        && matches!(clock, libc::CLOCK_REALTIME | libc::CLOCK_REALTIME_COARSE)
        && let Some(orders) = orders()
    {
        // SAFETY: the call has written there, so that the caller's address is good.
        unsafe { (*time).tv_sec += orders.control.clock_step.load(Ordering::Relaxed) };
    }
    outcome
}
