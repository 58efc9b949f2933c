//! What holds for the project itself: who may use whom, and under which licences.

mod architecture;
mod licences;
mod modules;
mod writing;
