//! Tests of whole windows.

mod designs;
mod input;
mod pieces;
mod random_designs;
