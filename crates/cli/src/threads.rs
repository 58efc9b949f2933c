//! Numbers of threads, with one range for options, environment and configuration files.

use std::num::NonZeroUsize;
use std::str::FromStr;
use std::thread::available_parallelism;

use serde::Deserialize;

/// Most threads that render in one process. No machine has more cores, and idle threads cost time.
const MOST_THREADS: usize = 1024;

/// A number of threads that render.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "i64")]
pub(crate) struct ThreadCount(NonZeroUsize);

/// A number out of range.
#[derive(Debug, thiserror::Error)]
#[error("expected a whole number of threads, 1 to {MOST_THREADS}")]
pub(crate) struct InvalidThreadCount;

impl ThreadCount {
    /// One thread for each core that this process may use.
    pub(crate) fn of_cores() -> Self {
        Self(NonZeroUsize::new(MOST_THREADS).map_or(cores(), |most| cores().min(most)))
    }

    /// The number.
    pub(crate) fn get(self) -> NonZeroUsize {
        self.0
    }
}

/// Cores that this process may use; 1 where the system does not say.
pub(crate) fn cores() -> NonZeroUsize {
    available_parallelism().unwrap_or(NonZeroUsize::MIN)
}

impl TryFrom<i64> for ThreadCount {
    type Error = InvalidThreadCount;

    fn try_from(count: i64) -> Result<Self, InvalidThreadCount> {
        let count = usize::try_from(count).ok().and_then(NonZeroUsize::new);
        count.filter(|count| count.get() <= MOST_THREADS).map(Self).ok_or(InvalidThreadCount)
    }
}

impl FromStr for ThreadCount {
    type Err = InvalidThreadCount;

    fn from_str(text: &str) -> Result<Self, InvalidThreadCount> {
        text.parse::<i64>().map_err(|_| InvalidThreadCount)?.try_into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_of_threads_is_one_to_a_thousand() {
        for (text, count) in [("1", 1), ("7", 7), ("1024", 1024)] {
            assert_eq!(text.parse::<ThreadCount>().unwrap().get().get(), count);
        }
        for text in ["0", "-1", "1.5", "1025", "10000", "18446744073709551616", "many", ""] {
            let message = text.parse::<ThreadCount>().unwrap_err().to_string();
            assert_eq!(message, "expected a whole number of threads, 1 to 1024", "{text}");
        }
    }
}
