//! Whole farms: real processes, real HTTP, real databases.

mod adaptive;
mod bad_input;
mod chaos;
mod durability;
mod farm;
mod fuzz;
mod large_frames;
mod load;
mod readiness;
mod regret;
mod stop_rules;
mod stored_farms;
mod trust;
