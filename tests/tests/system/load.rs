//! The load generator: simulated workers against a real coordinator, which loses nothing of what they bring.

use clerestory_test_servers::{postgres, s3};
use clerestory_tests::farm::{program, succeeded};
use serde_json::Value;
use tempfile::TempDir;

/// Rows of every table, by how they begin.
const ROWS: [&str; 11] = [
    "nodes merged, /s",
    "claim until lease, p50, ms",
    "upload until answer, p50, ms",
    "last upload of a round until merged, p50, ms",
    "any upload until merged, p50, ms",
    "stored for each camera sample, bytes",
    "written for each byte of partials, bytes",
    "the bare machine:",
    "  SQLite commits of one row, synced, /s",
    "  SQLite commits of 16 rows, synced, /s",
    "  SQLite commits of 256 rows, synced, /s",
];

/// A short load by four workers: its report, and its table.
fn measure(options: &[&str]) -> (Value, String) {
    let folder = TempDir::new().expect("a temporary folder");
    let file = folder.path().join("report.json");
    let mut command = program("load-generator");
    command.args(["--workers", "4", "--seconds", "1", "--nodes-per-lease", "8", "--output"]).arg(&file);
    command.arg("--data").arg(folder.path().join("data")).args(options).envs(s3().environment());
    let output = succeeded(&mut command);
    let table = String::from_utf8(output.stdout).expect("text");
    for row in ROWS {
        assert!(has_row(&table, row), "{row} in {table}");
    }
    let first = table.lines().next().expect("a first line");
    assert!(first.ends_with("fraction of nodes that are checked: 0"), "{table}");
    (serde_json::from_slice(&std::fs::read(&file).expect("the report is there")).expect("JSON"), table)
}

fn has_row(table: &str, name: &str) -> bool {
    table.lines().any(|line| line.starts_with(name))
}

/// Of groups of 16 and 256 rows some are committed, and as many rows as they have.
#[track_caller]
fn assert_groups(groups: &Value) {
    let groups = groups.as_array().expect("groups");
    let sizes: Vec<Option<u64>> = groups.iter().map(|group| group["rows"].as_u64()).collect();
    assert_eq!(sizes, [Some(16), Some(256)]);
    for group in groups {
        let [rows, commits, all] = ["rows", "commits_per_second", "rows_per_second"].map(|name| group[name].as_f64());
        let expected = rows.zip(commits).map(|(rows, commits)| rows * commits);
        assert!(commits > Some(0.0), "{group}");
        assert!(expected.zip(all).is_some_and(|(expected, all)| (all - expected).abs() < 1e-6 * expected), "{group}");
    }
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
    let count = |latency: &str| line[latency]["count"].as_u64().unwrap_or_else(|| panic!("{latency} in {line}"));
    // A partial may have nodes of two rounds.
    assert!(count("upload") > 0 && count("upload_merge") >= count("upload"), "{line}");
    assert_eq!(report["checked_fraction"].as_f64(), Some(0.0), "{report}");
    assert_groups(&report["ceilings"]["sqlite_groups"]);
}

#[test]
fn all_nodes_are_merged_into_files() {
    let (report, table) = measure(&[]);
    assert_eq!((&report["state"], &report["blobs"]), (&"sqlite".into(), &"folder".into()));
    assert_nothing_is_lost(&report);
    for latency in ["claim", "round_merge"] {
        assert!(report["lines"][0][latency]["count"].as_u64() > Some(0), "{latency} in {report}");
    }
    for ceiling in ["postgres_commits_per_second", "postgres_groups"] {
        assert!(report["ceilings"].get(ceiling).is_none(), "{ceiling} in {report}");
    }
    assert!(report["lines"][0].get("database_log_amplification").is_none(), "{report}");
    for row in ["  and by PostgreSQL", "  PostgreSQL", "preview"] {
        assert!(!has_row(&table, row), "{row} in {table}");
    }
}

#[test]
fn all_nodes_are_merged_into_postgres_and_a_bucket() {
    let (database, bucket) = (postgres().new_database(), format!("s3://{}/farm", s3().new_bucket()));
    let (report, table) = measure(&["--database", &database, "--object-store", &bucket, "--rate", "400"]);
    assert_eq!((&report["state"], &report["blobs"]), (&"postgres".into(), &"bucket".into()));
    assert_nothing_is_lost(&report);
    assert!(report["ceilings"]["postgres_commits_per_second"].as_f64() > Some(0.0), "{report}");
    assert_groups(&report["ceilings"]["postgres_groups"]);
    assert!(report["lines"][0]["database_log_amplification"].as_f64() > Some(0.0), "{report}");
    for row in ["  and by PostgreSQL to its log, bytes", "  PostgreSQL commits of 256 rows, synced, /s"] {
        assert!(has_row(&table, row), "{row} in {table}");
    }
}

#[test]
fn previews_come_while_somebody_looks() {
    // Larger tiles, so that fewer nodes are left when the measured time is over.
    let (report, table) = measure(&["--watch", "--tile", "64"]);
    assert_nothing_is_lost(&report);
    let line = &report["lines"][0];
    assert_eq!((report["is_watched"].as_bool(), line["failed_previews"].as_u64()), (Some(true), Some(0)), "{report}");
    for latency in ["preview", "preview_age"] {
        assert!(line[latency]["count"].as_u64() > Some(0), "{latency} in {line}");
    }
    for row in ["previews", "previews that failed", "preview, age when it comes", "preview, age when it is replaced"] {
        assert!(has_row(&table, row), "{row} in {table}");
    }
}

#[test]
fn noise_gets_into_no_other_folder_and_no_other_farm() {
    let folder = TempDir::new().expect("a temporary folder");
    std::fs::write(folder.path().join("farm.sqlite"), "anything").expect("a writable folder");
    let output = program("load-generator").arg("--data").arg(folder.path()).output().expect("the command starts");
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("--data") && message.contains("is not empty"), "{message}");
}
