//! The load generator: simulated workers against a real coordinator, which loses nothing of what they bring.

use clerestory_test_servers::{postgres, s3};
use clerestory_tests::farm::{clerestory, succeeded};
use serde_json::Value;
use tempfile::TempDir;

/// A short load by four workers, and its report.
fn report(options: &[&str]) -> Value {
    let folder = TempDir::new().expect("a temporary folder");
    let file = folder.path().join("report.json");
    let mut command = clerestory();
    command
        .args(["bench", "farm", "--workers", "4", "--seconds", "1", "--nodes-per-lease", "8", "--output"])
        .arg(&file);
    command.arg("--data").arg(folder.path().join("data")).args(options).envs(s3().environment());
    let output = succeeded(&mut command);
    let table = String::from_utf8(output.stdout).expect("text");
    assert!(table.contains("nodes merged, /s") && table.contains("the bare machine:"), "{table}");
    serde_json::from_slice(&std::fs::read(&file).expect("the report is there")).expect("JSON")
}

/// All nodes that were leased were uploaded and merged, each once.
#[track_caller]
fn assert_nothing_is_lost(report: &Value) {
    let lines = report["lines"].as_array().expect("lines");
    assert_eq!(lines.len(), 1);
    let line = &lines[0];
    let number = |name: &str| line[name].as_u64().unwrap_or_else(|| panic!("{name} in {line}"));
    assert_eq!(number("workers"), 4);
    assert!(number("uploaded_nodes") >= 1024, "{line}");
    assert_eq!(number("leased_nodes"), number("uploaded_nodes"), "{line}");
    assert_eq!(number("merged_nodes"), number("uploaded_nodes"), "{line}");
    for name in ["lost_nodes", "refused_nodes", "late_nodes", "duplicate_nodes"] {
        assert_eq!(number(name), 0, "{name} in {line}");
    }
    assert_eq!(number("samples") % (16 * 16 * 16), 0, "{line}");
}

#[test]
fn all_nodes_are_merged_into_files() {
    let report = report(&[]);
    assert_eq!((&report["state"], &report["blobs"]), (&"sqlite".into(), &"folder".into()));
    assert_nothing_is_lost(&report);
    assert!(report["lines"][0]["claim"]["count"].as_u64() > Some(0), "{report}");
    assert!(report["ceilings"].get("postgres_commits_per_second").is_none(), "{report}");
}

#[test]
fn all_nodes_are_merged_into_postgres_and_a_bucket() {
    let (database, bucket) = (postgres().new_database(), format!("s3://{}/farm", s3().new_bucket()));
    let report = report(&["--database", &database, "--object-store", &bucket, "--rate", "400"]);
    assert_eq!((&report["state"], &report["blobs"]), (&"postgres".into(), &"bucket".into()));
    assert_nothing_is_lost(&report);
    assert!(report["ceilings"]["postgres_commits_per_second"].as_f64() > Some(0.0), "{report}");
}

#[test]
fn noise_gets_into_no_other_folder_and_no_other_farm() {
    let folder = TempDir::new().expect("a temporary folder");
    std::fs::write(folder.path().join("farm.sqlite"), "anything").expect("a writable folder");
    let output =
        clerestory().args(["bench", "farm", "--data"]).arg(folder.path()).output().expect("the command starts");
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("--data") && message.contains("is not empty"), "{message}");
}
