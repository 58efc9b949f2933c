//! `clerestory sun`: positions, clocks, warnings, and what it refuses.

use std::process::{Command, Output};

use serde_json::Value;

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_clerestory")).arg("sun").args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn the_sun_of_a_moment_in_a_zone_is_printed_as_json() {
    let place = ["--latitude", "39.742476", "--longitude", "-105.1786"];
    let output = run(&[&place[..], &["--at", "2003-10-17T12:30:30-07:00", "--json"]].concat());
    assert!(output.status.success() && output.stderr.is_empty(), "{}", text(&output.stderr));
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    let number = |name: &str| json[name].as_f64().unwrap();
    assert!((number("altitude") - 39.87205).abs() < 1e-4, "{json}");
    assert!((number("azimuth") - 194.34024).abs() < 1e-4, "{json}");
    assert!((0.01..0.03).contains(&(number("altitude_refracted") - number("altitude"))), "{json}");
    assert_eq!(json["universal_time"], "2003-10-17T19:30:30");
    let names: Vec<&str> =
        json["day"].as_array().unwrap().iter().map(|event| event["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["sunrise", "prime", "terce", "sext", "noon", "none", "vespers", "sunset"]);
}

#[test]
fn terce_of_a_feast_is_a_quarter_of_the_day_after_sunrise() {
    let chartres = ["--latitude", "48.4476", "--longitude", "1.4878", "--calendar", "julian"];
    let output = run(&[&chartres[..], &["--at", "1250-christmasTterce"]].concat());
    let page = text(&output.stdout);
    assert!(output.status.success() && output.stderr.is_empty(), "{}", text(&output.stderr));
    for part in ["1251-01-01, Sunday", "1250-12-25", "3:00 of the day", "sunset"] {
        assert!(page.contains(part), "{part}: {page}");
    }
}

#[test]
fn a_year_before_the_first_begins_with_a_sign() {
    let place = ["--latitude", "48", "--longitude", "1", "--calendar", "julian", "--time", "apparent"];
    let output = run(&[&place[..], &["--at", "-0450-06-21T12:00"]].concat());
    let page = text(&output.stdout);
    assert!(output.status.success() && page.contains("-450-06-21"), "{page}{}", text(&output.stderr));
}

#[test]
fn an_old_date_without_a_calendar_is_gregorian_with_a_warning() {
    let output = run(&["--latitude", "48", "--longitude", "1", "--at", "1250-12-25T09:00", "--time", "apparent"]);
    assert!(output.status.success());
    let warning = text(&output.stderr);
    assert!(warning.contains("Gregorian") && warning.contains("1250-12-18"), "{warning}");
}

#[test]
fn what_cannot_be_used_names_its_field() {
    let place = ["--latitude", "48", "--longitude", "1"];
    for (more, parts) in [
        (&["--at", "1250-12-25T09:00"][..], &["time", "apparent"][..]),
        (&["--at", "1250-12-25 noon", "--calendar", "mayan"], &["--calendar", "mayan", "julian"]),
        (&["--at", "1250-yule noon"], &["feast", "yule", "christmas"]),
        (&["--at", "1250-12-25 noon", "--elevation", "99999"], &["elevation", "99999"]),
    ] {
        let output = run(&[&place[..], more].concat());
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(parts.iter().all(|part| message.contains(part)), "{more:?}: {message}");
    }
}
