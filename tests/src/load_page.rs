//! The page of results of the loads, docs/results/farm.md: one table, a row for each number of workers.

use std::time::SystemTime;

use serde_json::Value;

/// A column: its name, and its figure in a line of a report, with digits after the point.
type Column = (&'static str, &'static str, usize);

const COLUMNS: [Column; 11] = [
    ("nodes sustained, /s", "/sustained_per_second", 0),
    ("uploaded, /s", "/uploaded_per_second", 0),
    ("merged, /s", "/merged_per_second", 0),
    ("lease p50, ms", "/claim/p50_ms", 1),
    ("lease p99, ms", "/claim/p99_ms", 1),
    ("upload p99, ms", "/upload/p99_ms", 1),
    ("round merged p99, ms", "/round_merge/p99_ms", 0),
    ("preview age p99, ms", "/preview_age/p99_ms", 0),
    ("memory, MB", "/coordinator_peak_megabytes", 0),
    ("stored, bytes a sample", "/stored_bytes_per_sample", 3),
    ("late or lost", "", 0),
];

/// The page for some reports of `load-generator`.
pub fn page(reports: &[Value]) -> String {
    let names: Vec<&str> = COLUMNS.iter().map(|(name, ..)| *name).collect();
    let mut page = format!(
        "# A coordinator under load\n\n\
         Simulated workers lease nodes and upload noise, 16 nodes in a lease. *Sustained* counts all nodes until all \
         are merged. Latencies\n\
         count while there is work. A dash says that a load does not measure a figure.\n\n\
         `target/release/load --page docs/results/farm.md` measures again and writes this page. It fails when a load \
         misses a goal.\n\n\
         {}\n\n\
         | state | workers | offered, /s | tile | {} |\n|{}\n",
        circumstances(reports),
        names.join(" | "),
        " --- |".repeat(COLUMNS.len() + 4),
    );
    for report in reports {
        for line in report["lines"].as_array().into_iter().flatten() {
            let text = |name: &str| report[name].as_str().unwrap_or("-").to_owned();
            let offered =
                line["offered_nodes_per_second"].as_u64().map_or_else(|| "all".to_owned(), |rate| rate.to_string());
            let figures: Vec<String> = COLUMNS.iter().map(|column| figure(line, *column)).collect();
            page.push_str(&format!(
                "| {} | {} | {offered} | {} | {} |\n",
                text("state"),
                line["workers"],
                line["tile_size"],
                figures.join(" | ")
            ));
        }
    }
    page
}

/// The machine, the build and the date.
fn circumstances(reports: &[Value]) -> String {
    let Some(report) = reports.first() else { return "Nothing was measured.".to_owned() };
    let machine = &report["machine"];
    let text = |value: &Value| value.as_str().unwrap_or("unknown").to_owned();
    // Such as `Sat, 28 Nov 2026 04:38:58 GMT`.
    let now = httpdate::fmt_http_date(SystemTime::now());
    let date = now.get(5..16).unwrap_or(&now);
    format!(
        "Clerestory {} on {}, {} cores, {}, file system {}.",
        text(&machine["build"]),
        text(&machine["processor"]),
        machine["cores"],
        date,
        text(&report["file_system"])
    )
}

fn figure(line: &Value, (_, pointer, digits): Column) -> String {
    if pointer.is_empty() {
        let names = ["late_nodes_under_load", "lost_nodes", "refused_nodes"];
        return names.iter().filter_map(|name| line[*name].as_u64()).sum::<u64>().to_string();
    }
    // A latency is 0 where none was measured.
    let latency = pointer[1..].split_once('/').map(|(latency, _)| latency);
    let is_measured = latency.is_none_or(|latency| line[latency]["count"].as_u64() > Some(0));
    match line.pointer(pointer).and_then(Value::as_f64).filter(|_| is_measured) {
        Some(figure) => format!("{figure:.digits$}"),
        None => "-".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn the_page_has_a_row_for_each_number_of_workers() {
        let line = |workers: u32| {
            json!({
                "workers": workers, "tile_size": 16, "sustained_per_second": 2000.4, "lost_nodes": 0,
                "refused_nodes": 1, "late_nodes_under_load": 2, "claim": {"count": 0, "p50_ms": 0.0},
                "upload": {"count": 3, "p99_ms": 4.25}
            })
        };
        let machine = json!({"build": "0.1.0+abc", "processor": "a processor", "cores": 2});
        let report =
            json!({"machine": machine, "state": "sqlite", "file_system": "ext4", "lines": [line(10), line(100)]});
        let page = page(&[report]);
        assert!(page.contains("Clerestory 0.1.0+abc on a processor, 2 cores, "), "{page}");
        let rows: Vec<&str> = page.lines().filter(|line| line.starts_with("| sqlite")).collect();
        assert_eq!(rows[1], "| sqlite | 100 | all | 16 | 2000 | - | - | - | - | 4.2 | - | - | - | - | 3 |");
        let columns = |line: &str| line.matches('|').count();
        assert!(page.lines().filter(|line| line.starts_with('|')).all(|line| columns(line) == columns(rows[0])));
    }
}
