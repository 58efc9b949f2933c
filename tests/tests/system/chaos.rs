//! The short version of `chaos`: a farm whose processes, disks, clocks and connections fail loses no job and changes no
//! bit.

use std::time::{Duration, Instant};

use clerestory_tests::chaos::{Chaos, Durations, Plan};

/// Long enough for leases to expire, and short enough for each kind of fault to come within seconds.
const DURATIONS: Durations = Durations { pauses: [0.2, 0.8], away: 0.5, fault: 1.0, sleep: 3.0, long_sleeps: 6 };

/// Shortest and longest time between two faults where there are servers, seconds. While one of them is down, the farm
/// waits.
const PAUSES_ON_SERVERS: [f64; 2] = [0.3, 1.5];

/// Longest time for a job, and for everything to happen.
const TIMEOUT: Duration = Duration::from_secs(300);

/// Attacks a farm until each kind of fault and each fate of a request has occurred.
fn attack(servers: bool) {
    let plan = Plan {
        seed: 5,
        servers,
        workers: 2,
        durations: Durations { pauses: if servers { PAUSES_ON_SERVERS } else { DURATIONS.pauses }, ..DURATIONS },
        is_long: false,
        roughness: 3.0,
        passes: 6,
        timeout: TIMEOUT,
        log: "off",
    };
    let start = Instant::now();
    let mut chaos = Chaos::start(plan);
    while !chaos.missing().is_empty() && chaos.wrong().is_empty() && start.elapsed() < TIMEOUT {
        chaos.render_jobs();
    }
    chaos.recover_all();
    println!("{:.0} s: {}", start.elapsed().as_secs_f64(), chaos.summary());
    for wrong in chaos.wrong() {
        println!("WRONG: {wrong}");
    }
    assert!(chaos.wrong().is_empty());
    assert!(chaos.missing().is_empty(), "these have not come: {:?}", chaos.missing());
}

#[test]
fn a_farm_under_attack_loses_nothing() {
    attack(false);
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn a_farm_of_two_coordinators_and_their_servers_under_attack_loses_nothing() {
    attack(true);
}
