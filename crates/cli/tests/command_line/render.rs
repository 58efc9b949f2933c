//! Images made in one process.

use std::fs::{self, File};
use std::process::{Output, Stdio};

use serde_json::{Value, json};

use crate::support::Folder;

#[test]
fn tiles_and_threads_decide_no_bit_of_the_picture() {
    let folder = Folder::new();
    folder.succeeds(&["render", "scene.json", "--spp", "20", "--tile", "16", "--threads", "1"]);
    folder.succeeds(&["render", "scene.json", "--spp", "20", "--tile", "5", "--threads", "3", "-o", "other.exr"]);
    folder.succeeds(&["render", "scene.json", "--spp", "20", "--seed", "7", "-o", "seed.exr"]);
    assert_eq!(folder.comparison("other.exr", "scene.exr")["bit_identical"], true);
    assert_eq!(folder.comparison("seed.exr", "scene.exr")["bit_identical"], false);
}

#[test]
fn an_image_is_made_again_from_what_it_says_of_itself() {
    let folder = Folder::new();
    let first = ["--spp", "12", "--seed", "3", "--size", "17x9", "--tile", "8", "-o", "first.exr"];
    folder.succeeds(&[&["render", "scene.json"], first.as_slice()].concat());
    folder.succeeds(&["render", "scene.json", "--like", "first.exr", "-o", "again.exr"]);
    assert_eq!(folder.comparison("again.exr", "first.exr")["bit_identical"], true);

    // The file has moved on to the next version of the format, and with it the hash of its scene.
    let mut scene: Value = serde_json::from_slice(&fs::read(folder.path("scene.json")).unwrap()).unwrap();
    assert_eq!(scene["version"], 1);
    scene["version"] = json!(2);
    fs::write(folder.path("newer.json"), scene.to_string()).unwrap();
    for [like, image] in [["first.exr", "newer.exr"], ["newer.exr", "newest.exr"]] {
        folder.succeeds(&["render", "newer.json", "--like", like, "-o", image]);
        assert_eq!(folder.comparison(image, "first.exr")["bit_identical"], true);
    }

    folder.write_scene("other.json", [1.0, 1.0, 1.9]);
    folder.fails(
        &["render", "other.json", "--like", "first.exr", "-o", "no.exr"],
        2,
        &["other.json", "hash", "expected"],
    );
    for setting in ["--seed=1", "--target-mse=1", "--integrator=cone", "--set=film.width=4"] {
        let (option, _) = setting.split_once('=').unwrap_or((setting, ""));
        folder.fails(&["render", "scene.json", "--like", "first.exr", setting], 2, &["--like", option]);
    }
    assert!(!folder.path("no.exr").exists());
}

#[test]
fn frames_are_rendered_one_by_one_with_the_bits_of_each_alone() {
    let folder = Folder::new();
    let mut scene: Value = serde_json::from_slice(&fs::read(folder.path("scene.json")).unwrap()).unwrap();
    let lamp = |x: f64| json!({"name": "moved", "set": {"lights[lamp].position": [x, 1, 2]}});
    scene["timeline"] = json!([{}, lamp(0.5), lamp(-0.5)]);
    fs::write(folder.path("day.json"), scene.to_string()).unwrap();
    let text = folder.succeeds(&["render", "day.json", "--spp", "8", "--json"]);
    let frames: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(frames.len(), 3);
    assert_eq!((&frames[2]["frame"], &frames[2]["output"]), (&json!(2), &json!("day-0002.exr")));

    folder.succeeds(&["render", "day.json", "--spp", "8", "--frame", "2", "-o", "alone.exr"]);
    assert_eq!(folder.comparison("alone.exr", "day-0002.exr")["bit_identical"], true);
    assert_eq!(folder.comparison("alone.exr", "day-0001.exr")["bit_identical"], false);
    folder.succeeds(&["render", "day.json", "--like", "day-0002.exr", "-o", "again.exr"]);
    assert_eq!(folder.comparison("again.exr", "day-0002.exr")["bit_identical"], true);
    // The first frame sets nothing, so it is the scene without a timeline.
    folder.succeeds(&["render", "scene.json", "--spp", "8", "-o", "plain.exr"]);
    assert_eq!(folder.comparison("plain.exr", "day-0000.exr")["bit_identical"], true);
    // Appended frames change none before them.
    scene["timeline"].as_array_mut().unwrap().push(lamp(0.0));
    fs::write(folder.path("longer.json"), scene.to_string()).unwrap();
    folder.succeeds(&["render", "longer.json", "--spp", "8", "--frames", "1..2", "-o", "longer-#.exr"]);
    assert_eq!(folder.comparison("longer-2.exr", "day-0002.exr")["bit_identical"], true);
    assert!(!folder.path("longer-0.exr").exists() && !folder.path("longer-3.exr").exists());

    folder.fails(&["render", "day.json", "-o", "day.exr"], 2, &["--output", "day.exr", "####"]);
    folder.fails(&["render", "day.json", "--frame", "3"], 2, &["--frame", "3", "at most 2"]);
    folder.fails(&["render", "scene.json", "--frame", "1"], 2, &["--frame", "1", "no timeline"]);
}

#[test]
fn a_day_is_rendered_hour_by_hour_with_the_sun_where_it_stood() {
    let folder = Folder::new();
    let mut scene: Value = serde_json::from_slice(&fs::read(folder.path("scene.json")).unwrap()).unwrap();
    scene["version"] = json!(2);
    scene["lights"] = json!([]);
    scene["site"] = json!({"latitude": 48.4476, "longitude": 1.4878, "up": [0, 1, 0], "axis": [0, 0, -1]});
    scene["daylight"] = json!({});
    fs::write(folder.path("day.json"), scene.to_string()).unwrap();
    // The wall faces south.
    let times = ["--times", "1250-12-25T10:00..14:00/120min", "--calendar", "julian", "--time-kind", "apparent"];
    let output = folder.run(&[&["render", "day.json", "--spp", "8", "--json"], &times[..]].concat());
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");
    for part in ["Frame 1 12:00", "1251-01-01", "180.00 from north by east", "12:00:00 by a sundial"] {
        assert!(message.contains(part), "{part}: {message}");
    }
    folder.succeeds(&["render", "day.json", "--spp", "8", "--at", "1250-christmas noon", "--calendar", "julian"]);
    assert_eq!(folder.comparison("day.exr", "day-0000.exr")["bit_identical"], false);
    let again = [&["render", "day.json", "--like", "day-0001.exr", "-o", "again.exr"], &times[..]].concat();
    folder.succeeds(&again);
    assert_eq!(folder.comparison("again.exr", "day-0001.exr")["bit_identical"], true);
    folder.fails(&["render", "scene.json", "--calendar", "julian"], 2, &["--calendar", "--at"]);
    folder.fails(&["render", "day.json"], 1, &["moment", "daylight"]);
}

#[test]
fn a_render_reports_to_scripts_and_to_people_apart() {
    let folder = Folder::new();
    let options = ["--spp", "8", "--json", "--png", "--stats", "stats.json", "-o", "image.exr"];
    let text = folder.succeeds(&[&["render", "scene.json"], options.as_slice()].concat());
    let summary: Value = serde_json::from_str(&text).unwrap();
    assert_eq!((&summary["output"], &summary["png"]), (&json!("image.exr"), &json!("image.png")));
    assert_eq!((&summary["samples"], &summary["width"]), (&json!(24 * 16 * 8), &json!(24)));
    let [wall, core] = [&summary["seconds"], &summary["core_seconds"]].map(|seconds| seconds.as_f64().unwrap());
    assert!(wall > 0.0 && core > 0.0, "{summary}");
    let stats: Value = serde_json::from_str(&fs::read_to_string(folder.path("stats.json")).unwrap()).unwrap();
    assert_eq!(stats, summary["counters"]);
    assert!(fs::read(folder.path("image.png")).unwrap().starts_with(b"\x89PNG"));

    let text = folder.succeeds(&["render", "scene.json", "--spp", "4", "--png", "-o", "both.exr"]);
    assert!(text.starts_with("Wrote both.exr and both.png: 1 pass, "), "{text}");
    let text = folder.succeeds(&["render", "scene.json", "--spp", "4", "--size", "1x1", "-o", "pixel.exr"]);
    assert!(text.starts_with("Wrote pixel.exr: 1 pass, 4 samples in ") && text.contains(" of core time)"), "{text}");

    let reference = ["--reference", "image.exr", "-o", "second.exr"];
    let output = folder.run(&[&["render", "scene.json", "--spp", "8"], reference.as_slice()].concat());
    let progress = String::from_utf8(output.stderr).unwrap();
    assert!(progress.contains("PSNR"), "the table of rounds: {progress}");
    assert!(progress.lines().any(|line| line.contains("0.0000e0")), "the last round equals the reference: {progress}");
}

#[test]
fn an_image_without_a_standard_error_says_why_and_what_to_set() {
    let folder = Folder::new();
    let summary = |output: &Output| serde_json::from_slice::<Value>(&output.stdout).unwrap();
    let render = ["render", "scene.json", "--tile", "8", "--spp", "8", "--json"];
    let output = folder.run(&render);
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(messages.contains("No standard error: 8 samples in each pixel"), "{messages}");
    assert!(messages.contains("--spp 16 or more") && messages.contains("--samples-per-block 2"), "{messages}");
    let known = |output: &Output| {
        let summary = summary(output);
        (summary["standard_error_tiles"].clone(), summary["tiles"].clone())
    };
    assert_eq!(known(&output), (json!(0), json!(6)));
    // Nothing is measured, so no error is printed, not even as a dash.
    let rows: Vec<&str> = messages.lines().skip_while(|line| *line != "  round     spp       time").collect();
    assert!(rows.len() > 1 && rows.iter().all(|row| !row.contains('-')), "{messages}");

    let smaller = folder.run(&[&render[..], &["--samples-per-pass", "2", "--samples-per-block", "2"]].concat());
    assert_eq!(known(&smaller), (json!(6), json!(6)));
    let messages = String::from_utf8_lossy(&smaller.stderr);
    assert!(messages.contains("(estimated MSE ") && !messages.contains("standard error"), "{messages}");
}

#[cfg(unix)]
#[test]
fn an_image_on_standard_output_has_nothing_else_in_it() {
    let folder = Folder::new();
    // Standard output is a file, and a pipe.
    let render = ["render", "scene.json", "--spp", "4", "-o"];
    let mut to_a_file = folder.command(&[&render[..], &["/dev/stdout"]].concat());
    let output = to_a_file.stdout(File::create(folder.path("file.exr")).unwrap()).output().unwrap();
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && messages.contains("Wrote /dev/stdout: 1 pass"), "{messages}");
    let output = folder.run(&[&render[..], &["/dev/fd/1"]].concat());
    fs::write(folder.path("pipe.exr"), output.stdout).unwrap();
    assert_eq!(folder.comparison("file.exr", "pipe.exr")["bit_identical"], true);
    let magic = b"\x76\x2f\x31\x01";
    assert!(fs::read(folder.path("file.exr")).unwrap().starts_with(magic));
}

#[test]
fn an_image_is_called_as_its_scene_whatever_dots_are_in_the_name() {
    let folder = Folder::new();
    folder.write_scene("room-0.27.json", [1.0, 1.0, 2.0]);
    folder.succeeds(&["render", "room-0.27.json", "--time", "0.0004", "--png"]);
    assert!(folder.path("room-0.27.exr").is_file() && folder.path("room-0.27.png").is_file());
}

#[test]
fn a_comparison_has_every_measure() {
    let folder = Folder::new();
    folder.succeeds(&["render", "scene.json", "--spp", "4", "-o", "a.exr"]);
    folder.succeeds(&["render", "scene.json", "--spp", "16", "-o", "b.exr"]);
    let comparison = folder.comparison("a.exr", "b.exr");
    for key in ["mse", "corrected_mse", "rel_mse", "psnr", "flip", "mean_ratio", "max_abs_diff"] {
        assert!(comparison[key].is_number(), "{key}: {comparison}");
    }
    assert!(comparison["mse"].as_f64() > Some(0.0) && comparison["bit_identical"] == false);
    let again = ["render", "scene.json", "--spp", "4", "-o", "again.exr", "--reference", "b.exr", "--json"];
    let summary: Value = serde_json::from_str(&folder.succeeds(&again)).unwrap();
    assert_eq!(summary["metrics"], comparison, "render and compare measure alike");
    let rows = folder.succeeds(&["compare", "a.exr", "b.exr"]);
    let values: Vec<&str> = rows.lines().map(|row| row.split_whitespace().next_back().unwrap()).collect();
    assert_eq!(values.len(), 8, "{rows}");
    assert_eq!(values[3], format!("{:.2}", comparison["psnr"].as_f64().unwrap()));
    for value in values[..7].iter().filter(|value| value.contains('e')) {
        let (digits, _) = value.split_once('e').unwrap();
        assert!(digits.bytes().filter(u8::is_ascii_digit).count() <= 6, "{rows}");
    }
}

#[test]
fn a_reader_that_has_seen_enough_is_no_failure() {
    let folder = Folder::new();
    let mut child = folder
        .command(&["render", "scene.json", "--spp", "4"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    assert!(child.wait().unwrap().success());
}

#[test]
fn a_png_is_made_as_its_options_say() {
    let folder = Folder::new();
    let png = |options: &[&str]| {
        let render = ["render", "scene.json", "--spp", "4", "--png", "-o", "image.exr"];
        folder.succeeds(&[render.as_slice(), options].concat());
        fs::read(folder.path("image.png")).unwrap()
    };
    let usual = png(&[]);
    assert!(usual == png(&["--exposure", "auto", "--curve", "filmic"]));
    let brightened = png(&["--exposure", "-2.5"]);
    assert!(usual != brightened && usual != png(&["--curve", "srgb"]));
    assert!(brightened != png(&["--exposure", "2.5"]));
}

#[test]
fn what_the_image_will_lack_is_said() {
    let folder = Folder::new();
    fs::write(folder.path("wall.obj"), "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nf 1 2 3\nf 1 2 2\n").unwrap();
    let mut scene: Value = serde_json::from_str(&fs::read_to_string(folder.path("scene.json")).unwrap()).unwrap();
    scene["meshes"][0]["source"] = json!({"obj": {"file": "wall.obj"}});
    fs::write(folder.path("scene.json"), scene.to_string()).unwrap();
    let output = folder.run(&["render", "scene.json", "--spp", "4"]);
    let messages = String::from_utf8(output.stderr).unwrap();
    assert!(messages.contains("left out of the mesh \"wall\": 1\n"), "{messages}");
    assert!(messages.contains("Light that this image lacks:\n  - paths of more than 4 vertices"), "{messages}");
}

#[cfg(unix)]
#[test]
fn an_image_that_replaces_one_of_another_user_keeps_its_group() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt, chown};
    use std::os::unix::process::CommandExt;

    let (user, group, other_group) = (54_321, 54_322, 54_323);
    let folder = Folder::new();
    let (place, image) = (folder.path("."), folder.path("scene.exr"));
    fs::write(&image, "old").unwrap();
    // Only the superuser can act as another user.
    if let Err(error) = chown(&image, Some(0), Some(group)).and_then(|()| chown(&place, None, Some(other_group))) {
        println!("NOT TESTED, run it as root: files that change hands: {error}");
        return;
    }
    fs::set_permissions(&image, fs::Permissions::from_mode(0o660)).unwrap();
    // What is made in the folder gets the folder's group.
    fs::set_permissions(&place, fs::Permissions::from_mode(0o2777)).unwrap();
    let command = folder.command(&["render", "scene.json", "--spp", "4"]);
    // The other user may not reach where it was built.
    let binary = folder.path("clerestory");
    fs::copy(command.get_program(), &binary).unwrap();
    let mut copied = std::process::Command::new(&binary);
    copied.args(command.get_args()).current_dir(&place);
    let output = copied.uid(user).gid(group).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let written = fs::metadata(&image).unwrap();
    assert!(written.len() > 3);
    assert_eq!((written.uid(), written.gid(), written.mode() & 0o7777), (user, group, 0o660));
}

#[test]
fn a_comparison_says_why_the_relative_error_can_rise() {
    let folder = Folder::new();
    folder.succeeds(&["render", "scene.json", "--spp", "4"]);
    let text = folder.succeeds(&["compare", "scene.exr", "scene.exr"]);
    let row = text.lines().find(|row| row.starts_with("relMSE")).unwrap();
    assert!(row.contains("it rises when a bright sample arrives"), "{text}");
}
