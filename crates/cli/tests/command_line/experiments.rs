//! Experiments with settings so small that they end within seconds: what they write, and what they refuse.

use std::fs;

use serde_json::Value;

use crate::support::Folder;

fn json(folder: &Folder, file: &str) -> Value {
    serde_json::from_str(&fs::read_to_string(folder.path(file)).unwrap()).unwrap()
}

/// Rows of a CSV file as maps from column to value, checked to be those of the JSON file.
#[track_caller]
fn rows(folder: &Folder, experiment: &str, table: &str) -> Vec<Value> {
    let content = json(folder, &format!("experiment-{experiment}/{experiment}.json"));
    let rows = content["tables"][table].as_array().unwrap().clone();
    let csv = fs::read_to_string(folder.path(&format!("experiment-{experiment}/{table}.csv"))).unwrap();
    assert_eq!(csv.lines().count(), rows.len() + 1, "a line of names and a line for each row");
    let definitions = content["definitions"][table].as_object().unwrap();
    let mut names: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
    names.sort_unstable();
    assert_eq!(names, definitions.keys().map(String::as_str).collect::<Vec<_>>(), "every column is defined");
    rows
}

#[track_caller]
fn page(folder: &Folder, experiment: &str) -> String {
    let page = fs::read_to_string(folder.path(&format!("experiment-{experiment}/index.html"))).unwrap();
    assert!(page.starts_with("<!doctype html>") && page.trim_end().ends_with("</html>"));
    assert!(!page.contains("src=\"http") && !page.contains("<script"), "the page needs nothing else");
    page
}

#[test]
fn experiments_are_listed_and_others_refused_with_the_list() {
    let folder = Folder::new();
    let list = folder.succeeds(&["bench", "experiment", "--list"]);
    let names = ["solvers", "table1", "panes", "selection", "fine-detail", "basins", "manifold", "pool", "triangles"];
    for name in names.into_iter().chain(["flicker", "adaptive", "regret"]) {
        assert!(list.lines().any(|line| line.starts_with(name)), "{name}: {list}");
        folder.fails(&["bench", "experiment", "nonsense"], 2, &["'nonsense'", "expected one of", name]);
    }
    folder.fails(&["bench", "experiment"], 2, &["<NAME>"]);
    folder.fails(&["bench", "experiment", "table1", "--times", "1"], 2, &["--times", "table1"]);
    folder.fails(&["bench", "experiment", "basins", "--farm"], 2, &["--farm", "basins"]);
    folder.fails(&["bench", "experiment", "basins", "--references", "x"], 2, &["--references", "basins"]);
    folder.fails(&["bench", "experiment", "solvers", "--times", "2,1"], 2, &["--times", "2,1"]);
    folder.fails(&["bench", "experiment", "solvers", "--size", "0x5"], 2, &["--size", "640x480"]);
    folder.fails(&["bench", "experiment", "solvers", "-o", "scene.json/x"], 1, &["cannot write scene.json/x"]);
    assert!(!folder.path("experiment-table1").exists());
}

#[test]
fn methods_are_compared_at_equal_time_in_files_and_on_a_page() {
    let folder = Folder::new();
    let words = "bench experiment solvers --size 16x16 --times 0.02,0.04 --seeds 2 --reference-spp 32 --threads 2";
    let words: Vec<&str> = words.split(' ').collect();
    folder.succeeds(&words);
    let content = json(&folder, "experiment-solvers/solvers.json");
    let variants: Vec<&str> =
        content["variants"].as_array().unwrap().iter().map(|variant| variant["name"].as_str().unwrap()).collect();
    assert!(variants.contains(&"fnee") && variants.contains(&"path"), "{variants:?}");
    assert_eq!(content["settings"]["threads"], 2);
    let measurements = rows(&folder, "solvers", "measurements");
    let summary = rows(&folder, "solvers", "summary");
    let regions = summary.len() / (variants.len() * 2);
    assert!(regions >= 2, "panes and the whole picture");
    assert_eq!(measurements.len(), 2 * summary.len(), "two seeds");
    for row in &summary {
        let number = |name: &str| row[name].as_f64().unwrap();
        assert!(number("wall_seconds") >= number("time") && number("samples_per_pixel") >= 1.0, "{row}");
        let rest = number("mse") - number("variance") - number("bias_squared");
        assert!(rest.abs() < 1e-9 * number("mse").abs().max(number("variance")), "{row}");
    }
    assert!(measurements.iter().all(|row| row["samples"].as_u64() >= Some(256)));

    let page = page(&folder, "solvers");
    assert_eq!(page.matches("<svg").count(), regions, "a figure for each region");
    assert!(page.contains("data:image/png;base64,") && page.contains("FNEE paper"));
    let reference = content["references"][0]["file"].as_str().unwrap();
    let image = content["images"].as_object().unwrap().values().next().unwrap().as_str().unwrap();
    let in_folder = |file: &str| format!("experiment-solvers/{file}");
    assert!(folder.comparison(&in_folder(image), &in_folder(reference))["corrected_mse"].is_number());

    let again = folder.run(&words);
    assert!(String::from_utf8_lossy(&again.stderr).contains("is here already"), "the reference is used again");
}

#[test]
fn the_work_of_the_solvers_is_stated_beside_the_papers() {
    let folder = Folder::new();
    folder.succeeds(&["bench", "experiment", "table1", "--size", "6x6"]);
    let rows = rows(&folder, "table1", "work");
    let row = |solver: &str| rows.iter().find(|row| row["solver"] == solver).unwrap();
    assert_eq!(row("paper: FNEE")["height_evaluations"], 956_000_000);
    let ours = row("fnee published sharp");
    let number = |name: &str| ours[name].as_f64().unwrap();
    assert!(number("solver_calls") > number("trials") && number("converged") <= number("solver_calls"));
    assert!((number("success") - number("converged") / number("solver_calls")).abs() < 1e-12);
    assert!(page(&folder, "table1").contains("paper: 8.85"));
}

#[test]
fn basins_are_shares_of_all_starts_in_pictures_with_axes() {
    let folder = Folder::new();
    folder.succeeds(&["bench", "experiment", "basins", "--size", "24x24"]);
    let rows = rows(&folder, "basins", "basins");
    for problem in ["three paths", "most paths"] {
        for solver in ["fnee published", "fnee complete", "sms"] {
            let of = rows.iter().filter(|row| row["problem"] == problem && row["solver"] == solver);
            for share in ["share_of_pane", "share_of_close_up", "share_of_seeds"] {
                let sum: f64 = of.clone().map(|row| row[share].as_f64().unwrap()).sum();
                assert!((sum - 1.0).abs() < 1e-9, "{problem}, {solver}: {share} is {sum} in all");
            }
        }
    }
    // What theory says of three paths, and of a line search that descends.
    let found = |solver: &str, kind: &str| {
        let is_wanted =
            |row: &&Value| row["problem"] == "three paths" && row["solver"] == solver && row["kind"] == kind;
        rows.iter().filter(is_wanted).map(|row| row["share_of_seeds"].as_f64().unwrap()).collect::<Vec<f64>>()
    };
    for solver in ["fnee published", "fnee complete"] {
        let (minima, saddles, maxima) = (found(solver, "minimum"), found(solver, "saddle"), found(solver, "maximum"));
        assert_eq!((minima.len() + maxima.len(), saddles.len()), (2, 1), "the index of three paths is one");
        let extrema: f64 = minima.iter().chain(&maxima).sum();
        let is_found_well = saddles[0] > 0.05 * extrema;
        assert_eq!(is_found_well, solver == "fnee complete", "{solver}: minima {minima:?}, saddle {saddles:?}");
    }
    assert!(page(&folder, "basins").matches("<svg").count() == 12, "pane and close-up of two problems for each solver");
    let image = "experiment-basins/three-paths-fnee-complete-the-pane.exr";
    assert_eq!(folder.comparison(image, image)["bit_identical"], true);
}

#[test]
fn a_farm_renders_the_variants_as_ordinary_jobs() {
    let folder = Folder::new();
    let farm = folder.farm();
    let words = "bench experiment manifold --size 12x12 --times 0.2 --seeds 1 --reference-spp 32 --farm --coordinator";
    let words: Vec<&str> = words.split(' ').chain([farm.address()]).collect();
    folder.succeeds(&words);
    let content = json(&folder, "experiment-manifold/manifold.json");
    let jobs = content["farm"]["convergence"].as_array().unwrap();
    assert_eq!(jobs.len(), (10 + 1) + (8 + 1), "for each scene a job for each variant and one for the reference");
    for job in jobs.iter().filter(|job| !job["job"].as_str().unwrap().starts_with("reference")) {
        let points = job["points"].as_array().unwrap();
        assert!(!points.is_empty() && points.iter().all(|point| point["mse"].is_number()), "{job}");
    }
    let rows = rows(&folder, "manifold", "measurements");
    assert!(rows.iter().all(|row| row["samples_per_pixel"].as_u64() > Some(0) && row["rays"].as_u64() > Some(0)));
    let listed = folder.succeeds(&["jobs", "--coordinator", farm.address()]);
    assert!(listed.contains("slab, cone") && listed.contains("pool, path"), "{listed}");
}

#[test]
fn the_time_to_an_equal_error_is_stated_with_what_it_can_be_at_the_least() {
    let folder = Folder::new();
    let options = ["--size", "16x16", "--times", "0.02", "--seeds", "2", "--reference-spp", "64"];
    folder.succeeds(&[&["bench", "experiment", "pool"], &options[..]].concat());
    let samples = rows(&folder, "pool", "samples");
    let of = |row: &Value, name: &str| row[name].as_f64().unwrap();
    for pair in samples.windows(2).filter(|pair| pair[0]["variant"] == pair[1]["variant"]) {
        let factor = of(&pair[1], "samples_per_pixel") / of(&pair[0], "samples_per_pixel");
        assert_eq!(factor, if pair[0]["variant"] == "sms unbiased" { 4.0 } else { 2.0 }, "{pair:?}");
        assert!(of(&pair[1], "core_seconds") > of(&pair[0], "core_seconds"), "{pair:?}");
    }
    let first = |variant: &str| samples.iter().find(|row| row["variant"] == variant).unwrap();
    let preparation = of(first("conic"), "preparation_seconds");
    assert!(preparation > 0.0 && preparation < of(first("conic"), "core_seconds"), "there is a tree to build");

    let equal = rows(&folder, "pool", "equal_error");
    assert!(equal.len() >= (6 * 2 + 1) * 3, "biased sampling at two points, unbiased at one or more; three methods");
    for row in &equal {
        let first = first(row["method"].as_str().unwrap());
        let is_bound = of(first, "mse") <= of(row, "mse");
        assert_eq!(row["bound"] == "at least", is_bound, "{row}");
        if is_bound {
            assert_eq!(
                (of(row, "method_samples_per_pixel"), &row["method_core_seconds"]),
                (1.0, &first["core_seconds"])
            );
        }
        assert_eq!(row["ratio"].is_null(), row["method_core_seconds"].is_null(), "{row}");
    }
    assert!(page(&folder, "pool").contains("sms biased M = 1, settled"));
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn more_triangles_are_measured_against_path_tracing_alone() {
    let folder = Folder::new();
    folder.succeeds(&["bench", "experiment", "triangles", "--size", "16x12", "--seeds", "1"]);
    let rows = rows(&folder, "triangles", "triangles");
    assert_eq!(rows.len(), 8 * 3, "six floors and two frames, three variants");
    for row in &rows {
        let is_path = row["variant"] == "path";
        assert_eq!(row["growth"].is_null(), is_path, "{row}");
        assert!(row["seconds_per_sample"].as_f64().unwrap() > 0.0, "{row}");
        assert!(is_path || row["paths_per_sample"].as_f64().unwrap() > 0.3, "{row}");
    }
    assert!(page(&folder, "triangles").contains("what the caustic costs"));
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn passes_shared_out_are_compared_with_the_same_in_every_tile() {
    let folder = Folder::new();
    let options = ["--size", "24x24", "--reference-spp", "64", "--seeds", "1"];
    folder.succeeds(&[&["bench", "experiment", "adaptive"], &options[..]].concat());
    let rows = rows(&folder, "adaptive", "adaptive");
    assert_eq!(rows.len(), 2 * 2 * 2, "two scenes, two integrators, with and without");
    for pair in rows.chunks(2) {
        let [even, shared] = [0, 1].map(|index| pair[index]["samples_per_pixel"].as_f64().unwrap());
        assert!(even == 256.0 && shared < even && shared > 32.0, "{pair:?}");
        let product = |row: usize| pair[row]["mse"].as_f64().unwrap() * pair[row]["core_seconds"].as_f64().unwrap();
        let gain = pair[1]["gain"].as_f64().unwrap();
        assert!((gain / (product(0) / product(1)) - 1.0).abs() < 1e-9, "{pair:?}");
    }
    assert!(page(&folder, "adaptive").contains("a gain of"));
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn frames_of_an_animation_are_compared_with_those_before_and_after() {
    let folder = Folder::new();
    folder.succeeds(&["bench", "experiment", "flicker", "--size", "24x24", "--reference-spp", "16"]);
    let rows = rows(&folder, "flicker", "flicker");
    assert_eq!(rows.len(), 7 * 2, "seven variants, with the same random numbers and with others");
    for row in &rows {
        let [flicker, noise] = ["flicker", "noise"].map(|name| row[name].as_f64().unwrap());
        assert!(flicker > 0.0 && noise <= flicker, "{row}");
        assert!(row["samples_per_pixel"].as_u64() > Some(0), "{row}");
        let [light, of_all_light] = ["light", "noise_of_all_light"].map(|name| row[name].as_f64().unwrap());
        assert!((of_all_light - noise * light).abs() <= 1e-9 * of_all_light, "{row}");
    }
    let of = |variant: &str, name: &str| {
        let row = rows.iter().find(|row| row["variant"] == variant).unwrap();
        row[name].as_f64().unwrap()
    };
    let light = |variant: &str| of(variant, "light");
    assert!(light("sms biased M = 1") < 0.8 * light("conic"), "one walk finds the less likely paths seldom");
    assert!(of("conic", "preparation_seconds") > 0.0, "there is a tree to build");
    assert!(page(&folder, "flicker").contains("one pixel of the floor"));
}
