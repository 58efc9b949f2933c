//! The pages in a real browser.

mod dashboard;
mod viewer;
