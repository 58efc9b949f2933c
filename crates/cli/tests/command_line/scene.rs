//! Scenes that are computed.

use std::fs;
use std::path::Path;

use crate::support::Folder;

#[test]
fn the_naves_that_ship_are_those_that_are_computed() {
    let folder = Folder::new();
    for panes in ["4", "16", "64", "256"] {
        let name = format!("nave-{panes}.json");
        let words = ["scene", "nave", "--panes", panes];
        assert_eq!(folder.succeeds(&[&words[..], &["-o", &name]].concat()), "");
        let written = fs::read_to_string(folder.path(&name)).unwrap();
        assert!(folder.succeeds(&words) == written, "{panes} panes: standard output differs from the file");
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/nave").join(&name);
        assert!(
            fs::read_to_string(&shipped).unwrap() == written,
            "{} is out of date; write it with: clerestory scene nave --panes {panes} -o scenes/nave/{name}",
            shipped.display()
        );
        // Half a megabyte still opens in any editor.
        assert!(written.len() < 500_000 && written.lines().all(|line| line.len() < 120), "{panes} panes");
    }
}

#[test]
fn a_nave_has_one_of_four_numbers_of_panes() {
    let folder = Folder::new();
    for panes in ["0", "5", "1024", "many"] {
        folder.fails(&["scene", "nave", "--panes", panes], 2, &["--panes", panes, "expected 4, 16, 64 or 256"]);
    }
    folder.fails(&["scene", "nave"], 2, &["--panes"]);
    folder.fails(&["scene", "nave", "--panes", "4", "-o", "no/such/nave.json"], 1, &["cannot write no/such/nave.json"]);
}
