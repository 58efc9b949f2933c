//! Which paths the methods find in fixed problems, against lists of an earlier state of the code.
//!
//! Those of `fnee` are from before any of it was made faster, those of `sms` from when its walks were last changed.

use std::fs;
use std::path::Path;

use clerestory_tests::connections::{GLASS, METHODS, agree, problems, read_list};

/// Camera samples at each point when the lists were made.
const SAMPLES: u32 = 16;

#[test]
fn the_methods_find_the_paths_that_they_always_found() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/paths");
    for glass in GLASS {
        let problems = problems(glass);
        for name in METHODS {
            let found = problems.solve(&*problems.method(name), SAMPLES).paths;
            let file = folder.join(format!("{name}-{glass}.txt"));
            let expected = read_list(&fs::read_to_string(file).expect("the list ships"));
            assert!(!expected.is_empty(), "the list of {name} through {glass} glass is empty");
            assert!(agree(&found, &expected), "{name} through {glass} glass: {found:?}, not {expected:?}");
        }
    }
}
