//! The program that reads changed files notices what they must not do.

use clerestory_tests::farm::program;

#[test]
fn a_planted_panic_a_hang_and_too_much_memory_are_noticed_and_their_files_kept() {
    for (plant, what) in [("panic", "a planted panic"), ("hang", "takes more than 5s"), ("memory", "signal: 6")] {
        let folder = tempfile::tempdir().unwrap();
        let mut command = program("fuzz");
        command
            .args(["--minutes", "0.2", "--case-seconds", "5", "--memory", "512", "--plant", plant, "--found"])
            .arg(folder.path());
        let output = command.output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(!output.status.success() && said.contains("WRONG: case 2 ") && said.contains(what), "{plant}: {said}");
        let kept = std::fs::read_dir(folder.path().join("case-2")).unwrap();
        assert!(kept.count() > 0, "{plant}");
    }
}
