//! TODO

mod film_lease;
pub(crate) mod finalizer;
mod merging;
#[cfg(test)]
mod tests;
