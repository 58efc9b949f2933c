//! The build of this program.

/// The version, with the commit where the sources are a git checkout.
pub(crate) const BUILD: &str = env!("CLERESTORY_BUILD");
