//! The services and their settings.

use crate::support::Folder;

#[test]
fn the_printed_configuration_does_not_hold_the_token() {
    let folder = Folder::new();
    let token = "0123456789abcdef0123456789abcdef";
    let output = folder.command(&["coordinator", "--print-config"]).env("CLERESTORY_TOKEN", token).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("listen = \"127.0.0.1:7171\"") && !text.contains(token), "{text}");
}

#[test]
fn a_coordinator_prints_its_address_and_ends_with_its_parent() {
    let folder = Folder::new();
    let coordinator = folder.coordinator("127.0.0.1:0", None);
    let jobs = folder.succeeds(&["jobs", "--json", "--coordinator", coordinator.address()]);
    assert_eq!(jobs.trim(), "[]");
    assert!(coordinator.ended_by_its_parent().success());
    assert!(folder.path("data").is_dir());
}
