//! The short version of `chaos`: a farm whose processes, disks, clocks and connections fail loses no job and changes no
//! bit.

use std::time::{Duration, Instant};

use clerestory_tests::siege::{Durations, Plan, Siege};

/// Long enough for leases to run out, and short enough for each kind of blow to come within seconds.
const DURATIONS: Durations = Durations { pauses: [0.2, 0.8], away: 0.5, fault: 1.0, sleep: 3.0, long_sleeps: 6 };

/// Shortest and longest time between two blows where there are servers, seconds: when any of them is down, nothing goes
/// on.
const PAUSES_ON_SERVERS: [f64; 2] = [0.3, 1.5];

/// Longest time for a job, and for everything to happen.
const PATIENCE: Duration = Duration::from_secs(300);

/// Attacks a farm until each kind of blow has come at least once, and everything that can happen to a request.
fn attack(servers: bool) {
    let plan = Plan {
        seed: 5,
        servers,
        workers: 2,
        durations: Durations { pauses: if servers { PAUSES_ON_SERVERS } else { DURATIONS.pauses }, ..DURATIONS },
        is_long: false,
        roughness: 3.0,
        passes: 6,
        patience: PATIENCE,
        log: "off",
    };
    let start = Instant::now();
    let mut siege = Siege::lay(plan);
    while !siege.missing().is_empty() && siege.wrong().is_empty() && start.elapsed() < PATIENCE {
        siege.wave();
    }
    siege.lift();
    println!("{:.0} s: {}", start.elapsed().as_secs_f64(), siege.told());
    for wrong in siege.wrong() {
        println!("WRONG: {wrong}");
    }
    assert!(siege.wrong().is_empty());
    assert!(siege.missing().is_empty(), "these have not come: {:?}", siege.missing());
}

#[test]
fn a_farm_under_attack_loses_nothing() {
    attack(false);
}

#[test]
fn a_farm_of_two_coordinators_and_their_servers_under_attack_loses_nothing() {
    attack(true);
}
