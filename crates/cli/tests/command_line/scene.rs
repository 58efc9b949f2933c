//! Scenes that are computed.

use std::fs;
use std::path::Path;

use crate::support::Folder;

#[test]
fn the_naves_that_ship_are_those_that_are_computed() {
    let folder = Folder::new();
    let cut = ["4", "16", "64", "256"].map(|panes| (panes, vec!["--panes", panes]));
    for (panes, glass) in cut.into_iter().chain([("diamonds", vec!["--diamonds"])]) {
        let name = format!("nave-{panes}.json");
        let words = [&["scene", "nave"], &glass[..]].concat();
        assert_eq!(folder.succeeds(&[&words[..], &["-o", &name]].concat()), "");
        let written = fs::read_to_string(folder.path(&name)).unwrap();
        assert!(folder.succeeds(&words) == written, "{panes}: standard output differs from the file");
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/nave").join(&name);
        assert!(
            fs::read_to_string(&shipped).unwrap() == written,
            "{} is out of date; write it with: clerestory {} -o scenes/nave/{name}",
            shipped.display(),
            words.join(" ")
        );
        // Half a megabyte still opens in any editor.
        assert!(written.len() < 500_000 && written.lines().all(|line| line.len() < 120), "{panes}");
    }
}

#[test]
fn a_nave_has_one_of_four_numbers_of_panes() {
    let folder = Folder::new();
    for panes in ["0", "5", "1024", "many"] {
        folder.fails(&["scene", "nave", "--panes", panes], 2, &["--panes", panes, "expected 4, 16, 64 or 256"]);
    }
    folder.fails(&["scene", "nave"], 2, &["--diamonds", "--panes"]);
    folder.fails(&["scene", "nave", "--panes", "4", "--diamonds"], 2, &["--diamonds", "--panes"]);
    folder.fails(&["scene", "nave", "--panes", "4", "-o", "no/such/nave.json"], 1, &["cannot write no/such/nave.json"]);
}

#[test]
fn water_is_written_as_asked_for_and_can_be_rendered() {
    let folder = Folder::new();
    for scene in ["pool", "lagoon"] {
        folder.succeeds(&[
            "scene",
            scene,
            "--triangles",
            "200",
            "--time",
            "-1.5",
            "--view",
            "floor",
            "-o",
            "water.json",
        ]);
        let written = fs::read_to_string(folder.path("water.json")).unwrap();
        assert!(written.contains("\"time\": -1.5") && written.contains("\"D T L\""), "{written}");
        let size = ["--size", "16x16", "--spp", "16"];
        folder.succeeds(&[&["render", "water.json", "-o", "water.exr"][..], &size].concat());
        assert!(folder.path("water.exr").exists());
    }
}

#[test]
fn water_that_cannot_be_is_refused() {
    let folder = Folder::new();
    for triangles in ["7", "20000001", "many"] {
        folder.fails(
            &["scene", "pool", "--triangles", triangles],
            2,
            &["--triangles", triangles, "expected a whole number from 8 to 20000000"],
        );
    }
    folder.fails(&["scene", "lagoon", "--time", "inf"], 2, &["--time", "found inf, expected a number of seconds"]);
}
