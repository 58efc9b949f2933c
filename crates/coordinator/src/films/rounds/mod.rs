//! Rounds: recorded when they are complete, then merged.

pub(crate) mod film_lease;
mod film_state;
pub(crate) mod finalizer;
pub(crate) mod merging;
#[cfg(test)]
mod tests;
pub(crate) mod visits;
