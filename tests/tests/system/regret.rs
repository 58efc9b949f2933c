//! References of pairs, and the experiment that compares methods with them, from end to end in tiny pictures.

use std::fs;

use clerestory_experiments::pairs::{self, stored};
use clerestory_tests::farm::clerestory;
use clerestory_tests::pair_references::store;
use serde_json::Value;

const SIZE: [u32; 2] = [16, 8];

#[test]
fn regret_is_measured_where_there_are_references_and_said_to_be_unknown_elsewhere() {
    let folder = tempfile::tempdir().unwrap();
    let references = folder.path().join("references");
    let pair = pairs::find("slab").unwrap();
    let record = store(&references, pair, SIZE, [4.0, 2.0], |_| ()).unwrap();
    assert!(record.agrees && record.noise < 1e-2, "{record:?}");
    let index = stored::index(&references).unwrap();
    let found = |size| stored::find(&references, &index, pair, &pair.bundle(size).unwrap()).unwrap();
    assert!(found(SIZE).is_some() && found([32, 16]).is_none(), "a reference is of its scene in its size");

    let report = folder.path().join("report");
    let mut command = clerestory();
    command.args(["bench", "experiment", "regret", "--size", "16x8", "--times", "0.1", "--seeds", "3"]);
    let output = command.arg("--references").arg(&references).arg("-o").arg(&report).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("claims are not met") && message.contains("nave: no reference"), "{message}");

    let json: Value = serde_json::from_slice(&fs::read(report.join("regret.json")).unwrap()).unwrap();
    let rows = json["tables"]["ratios"].as_array().unwrap();
    let row = |pair: &str| rows.iter().find(|row| row["pair"] == pair && row["metric"] == "relMSE").unwrap();
    let of_slab = row("slab");
    let [lower, estimate, upper] = ["lower", "estimate", "upper"].map(|name| of_slab[name].as_f64().unwrap());
    assert!(0.0 < lower && lower < estimate && estimate < upper, "{of_slab}");
    assert_eq!((&row("nave")["remark"], &row("nave")["verdict"]), (&"no reference".into(), &"not known".into()));
    let measurements = json["tables"]["measurements"].as_array().unwrap();
    assert_eq!(measurements.len(), 3 * (1 + pair.methods.len()));
    let seconds = |row: &Value| row["core_seconds"].as_f64().unwrap();
    assert!(measurements.iter().all(|row| seconds(row) >= 0.1), "every render takes its time");

    let page = fs::read_to_string(report.join("regret.md")).unwrap();
    for text in ["## Required scenes", "| slab | small lamp | smooth | ", "## Glass tax", "no reference"] {
        assert!(page.contains(text), "{text}: {page}");
    }
}
