//! glTF files written here: what is read, what is reported, and what is refused with its place.

pub(in crate::scene::import) mod builder;
mod files;
mod geometry;
mod malformed;
mod materials;
mod nodes;

use super::*;
use builder::{Builder, open};
