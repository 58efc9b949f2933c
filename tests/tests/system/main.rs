//! Whole farms: real processes, real HTTP, real databases.

mod adaptive;
mod bad_input;
mod bench_farm;
mod chaos;
mod durability;
mod farm;
mod large_frames;
mod readiness;
mod stop_rules;
mod stored_farms;
mod trust;
