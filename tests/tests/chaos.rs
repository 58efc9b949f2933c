//! The short version of `chaos`: a farm whose processes, disks, clocks and connections fail loses no job and changes no bit.

use std::time::{Duration, Instant};

use clerestory_tests::siege::{Durations, Plan, Siege};

/// Long enough for leases to run out, and short enough for each kind of blow to come within seconds.
const DURATIONS: Durations = Durations { pauses: [0.1, 0.5], away: 0.5, fault: 1.0, sleep: 3.0, long_sleeps: 6 };

/// Longest time for a job, and for every kind of blow to come.
const PATIENCE: Duration = Duration::from_secs(150);

/// Attacks a farm until each kind of blow has come at least once.
fn attack(servers: bool) {
    let plan = Plan { seed: 5, servers, workers: 2, durations: DURATIONS, patience: PATIENCE, log: "off" };
    let start = Instant::now();
    let mut siege = Siege::lay(plan);
    while !siege.missing().is_empty() && siege.wrong().is_empty() && start.elapsed() < PATIENCE {
        siege.wave();
    }
    siege.lift();
    println!("{}", siege.told());
    assert!(siege.wrong().is_empty(), "{:#?}", siege.wrong());
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
