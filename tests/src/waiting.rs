//! Waiting until something can be seen.

use std::thread;
use std::time::{Duration, Instant};

/// Longer than whatever is waited for takes on a machine that does much else.
const TIMEOUT: Duration = Duration::from_secs(240);

/// Looks again and again until there is something to see.
///
/// # Panics
///
/// With `what`, when that takes minutes.
pub fn until(what: &str, mut is_seen: impl FnMut() -> bool) {
    let start = Instant::now();
    while !is_seen() {
        assert!(start.elapsed() < TIMEOUT, "{what}: in vain for {TIMEOUT:?}");
        thread::sleep(Duration::from_millis(20));
    }
}
