//! What a user gets wrong: the message names it, and the exit code tells whose fault it is.

use std::fs;
use std::io::{Read, Write};
use std::net::TcpListener;

use serde_json::{Value, json};

use crate::support::Folder;

#[test]
fn what_is_wrong_is_named_with_its_causes_and_the_exit_code_tells_whose_fault_it_is() {
    let folder = Folder::new();
    folder.fails(&["render"], 2, &["SCENE"]);
    for number in ["0", "-5", "1.5"] {
        folder.fails(
            &["render", "scene.json", "--spp", number],
            2,
            &["--spp", number, "a whole number, 1 to 16777216"],
        );
    }
    folder.fails(&["submit", "scene.json", "--priority", "high"], 2, &["--priority", "'high'", "a whole number"]);
    for size in ["12", "0x0"] {
        folder.fails(&["render", "scene.json", "--size", size], 2, &["--size", "640x480"]);
    }
    folder.fails(
        &["render", "scene.json", "--size", "16384x16384", "--tile", "1"],
        2,
        &["--tile", "at least 64 pixels"],
    );
    for time in ["1e19", "1e17", "0", "-1"] {
        folder.fails(&["render", "scene.json", "--time", time], 2, &["--time", "at most 315360000", "ten years"]);
        folder.fails(&["submit", "scene.json", "--time", time], 2, &["--time", "at most 315360000", "ten years"]);
    }
    for command in ["render", "submit"] {
        let target = [command, "scene.json", "--target-mse"];
        folder.fails(&[&target[..], &["1e-3"]].concat(), 2, &["--target-mse 1e-3", "expected a reference"]);
        folder.fails(&[&target[..], &["0"]].concat(), 2, &["--target-mse", "a positive number"]);
    }
    for option in ["--time=1", "--target-estimated-mse=1", "--adaptive"] {
        folder.fails(&["view", "scene.json", option], 2, &[option.split('=').next().unwrap()]);
    }
    folder.fails(
        &["render", "scene.json", "--adaptive", "--spp", "16"],
        2,
        &["--adaptive with 16 samples", "expected --spp of at least", "--time"],
    );
    let output = ["render", "scene.json", "--png", "-o", "a.exr", "--stats"];
    folder.fails(&[&output[..], &["a.png"]].concat(), 2, &["--png and --stats both write a.png"]);
    folder.fails(&[&output[..], &["./a.exr"]].concat(), 2, &["--output and --stats both write ./a.exr"]);
    for command in [["render"].as_slice(), &["submit", "--wait"]] {
        let words = [command, &["scene.json", "-o", "a.png"]].concat();
        folder.fails(&words, 2, &["--output a.png", "OpenEXR", "expected a.exr", "--png"]);
    }
    let solver = ["render", "scene.json", "--set", "integrator.fnee.solver=published"];
    folder.fails(&solver, 2, &["--set", "integrator is path", "the integrator fnee beside it"]);
    let chains = ["render", "scene.json", "--integrator", "sms", "--set", "integrator.sms.chains=[\"X\"]"];
    folder.fails(
        &chains,
        2,
        &["cannot use these options with the scene scene.json", "integrator.sms.chains[0]", "\"X\"", "letters R and T"],
    );
    folder.succeeds(&[
        "render",
        "scene.json",
        "--set=sampling.samples_per_pass=512",
        "--samples-per-block=512",
        "--spp=1",
    ]);
    folder.fails(&["render", "scene.json", "--set", "film.width"], 2, &["--set", "film.width", "PATH=VALUE"]);
    folder.fails(&["render", "scene.json", "--integrator", "cones"], 2, &["cones", "cone", "fnee"]);
    folder.fails(&["render", "scene.json", "--png", "--exposure", "bright"], 2, &["--exposure", "auto"]);
    folder.fails(&["render", "scene.json", "--curve", "srgb"], 2, &["--png"]);
    for command in ["render", "submit"] {
        folder.fails(&[command, "absent.json"], 1, &["error: cannot read absent.json: No such file"]);
    }
    folder.fails(
        &["render", "scene.json", "-o", "no/such/image.exr"],
        1,
        &["cannot write no/such/image.exr: the folder no/such does not exist"],
    );
    folder.fails(
        &["render", "scene.json", "--stats", "scene.json"],
        2,
        &["--stats would replace scene.json, which is the scene"],
    );
    folder.fails(
        &["bench", "experiment", "solvers", "-o", "scene.json"],
        1,
        &["cannot write scene.json: is a file, expected the name of a folder"],
    );
    folder.fails(
        &["render", "scene.json", "--samples-per-block", "6"],
        2,
        &["sampling.samples_per_block: found 6, must be a power of two times samples_per_pass (4)"],
    );
    folder.fails(&["view", "scene.json", "--samples-per-pass", "1"], 2, &["--samples-per-pass"]);
    folder.fails(&["render", "scene.json", "--reference", "scene.json"], 1, &["scene.json", "not an OpenEXR file"]);
    folder.fails(&["compare", "absent.exr", "absent.exr"], 1, &["cannot read absent.exr"]);
    folder.fails(&["jobs", "--coordinator", "http://127.0.0.1:1"], 1, &["http://127.0.0.1:1", "no answer"]);
    folder.fails(
        &["jobs", "--coordinator", "http://127.0.0.1:1"],
        1,
        &["`clerestory farm`", "`clerestory coordinator`", "--coordinator"],
    );
    for (address, said) in [
        ("nonsense", "expected http://nonsense"),
        ("127.0.0.1:7171", "expected http://127.0.0.1:7171"),
        ("http://127.0.0.1:1/#/jobs/7", "`#`"),
    ] {
        for command in ["jobs", "worker"] {
            folder.fails(&[command, "--coordinator", address], 2, &[address, said]);
        }
    }
    for command in ["watch", "cancel"] {
        folder.fails(&[command, "17"], 2, &["'17'", "expected the UUID of a job", "`clerestory jobs`"]);
    }
    for (command, option) in [("coordinator", "--lease-seconds"), ("coordinator", "--lease-nodes")] {
        folder.fails(&[command, option, "0"], 2, &["'0'", option, "expected a whole number, 1 to 4294967295"]);
    }
    folder.fails(&["coordinator", "--listen", "nowhere"], 2, &["nowhere", "127.0.0.1:7171"]);
    fs::write(folder.path("bad.toml"), "lisen = \"127.0.0.1:0\"\n").unwrap();
    folder.fails(&["coordinator", "--config", "bad.toml"], 2, &["bad.toml", "lisen", "listen"]);

    fs::write(folder.path("bad.json"), "{\"version\": 1, \"nmae\": \"x\"}").unwrap();
    folder.fails(&["render", "bad.json"], 1, &["bad.json", "nmae"]);
}

#[test]
fn an_image_that_has_the_name_of_a_folder_is_refused_before_it_is_rendered() {
    let folder = Folder::new();
    fs::create_dir(folder.path("pictures")).unwrap();
    fs::create_dir(folder.path("image.png")).unwrap();
    // No coordinator is asked, and 16 million samples take long.
    for command in [["render"].as_slice(), &["submit", "--wait"]] {
        for (options, name) in
            [(["-o", "pictures"].as_slice(), "pictures"), (&["-o", "image.exr", "--png"], "image.png")]
        {
            let words = [command, &["scene.json", "--spp", "16777216"], options].concat();
            folder.fails(&words, 1, &[&format!("cannot write {name}: is a directory")]);
        }
    }
}

#[test]
fn numbers_of_threads_and_workers_have_a_range() {
    let folder = Folder::new();
    let commands: [&[&str]; 5] = [
        &["render", "scene.json"],
        &["view", "scene.json"],
        &["worker"],
        &["farm"],
        &["bench", "experiment", "solvers"],
    ];
    for command in commands {
        for threads in ["0", "10000"] {
            let words = [command, &["--threads", threads]].concat();
            let named = format!("'{threads}' for '--threads <N>'");
            folder.fails(&words, 2, &[&named, "expected a whole number of threads, 1 to 1024"]);
        }
    }
    for workers in ["0", "257"] {
        folder.fails(&["farm", "--workers", workers], 2, &["--workers", workers, "expected a whole number, 1 to 256"]);
    }
    let together = ["farm", "--workers", "200", "--threads", "100"];
    folder.fails(&together, 2, &["--workers 200", "--threads 100", "are 20000 threads", "at most 4096"]);

    let output = folder.command(&["render", "scene.json"]).env("CLERESTORY_THREADS", "10000").output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("1 to 1024") && message.contains("environment variable CLERESTORY_THREADS"), "{message}");
}

#[cfg(unix)]
#[test]
fn a_file_outside_the_folder_of_the_scene_is_not_uploaded() {
    let folder = Folder::new();
    fs::create_dir(folder.path("scene")).unwrap();
    fs::write(folder.path("secret"), "secret").unwrap();
    std::os::unix::fs::symlink("../secret", folder.path("scene/wall.obj")).unwrap();
    let mut scene: Value = serde_json::from_str(&fs::read_to_string(folder.path("scene.json")).unwrap()).unwrap();
    scene["meshes"][0]["source"] = json!({"obj": {"file": "wall.obj"}});
    fs::write(folder.path("scene/scene.json"), scene.to_string()).unwrap();
    // No coordinator is asked.
    for command in ["submit", "render", "view"] {
        folder.fails(
            &[command, "scene/scene.json"],
            1,
            &["meshes[0].source.obj.file", "leads to", "/secret", "copy it"],
        );
    }
}

#[cfg(target_os = "linux")]
#[test]
fn an_image_for_which_the_disk_has_no_room_is_not_lost() {
    let folder = Folder::new();
    let mut command = folder.command(&["render", "scene.json", "--spp", "4", "-o", "/dev/full"]);
    let output = command.env("TMPDIR", folder.path("")).output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("cannot write /dev/full, so it is in ") && message.contains("No space left"), "{message}");
    assert!(message.contains("the disk is full"), "{message}");
    let (_, kept) = message.split_once("so it is in ").unwrap();
    let (kept, _) = kept.split_once(" instead").unwrap();
    folder.succeeds(&["render", "scene.json", "--spp", "4", "-o", "image.exr"]);
    assert_eq!(folder.comparison(kept, "image.exr")["bit_identical"], true);
}

#[test]
fn data_that_are_in_use_make_no_farm_and_print_no_address() {
    let folder = Folder::new();
    let _first = folder.coordinator("127.0.0.1:0", None);
    for command in ["coordinator", "farm"] {
        folder.fails(&[command, "--listen", "127.0.0.1:0", "--data", "data"], 1, &["in use by another coordinator"]);
    }
}

#[test]
fn who_speaks_tls_to_a_farm_without_is_told_its_address() {
    let folder = Folder::new();
    let farm = folder.coordinator("127.0.0.1:0", None);
    let secure = farm.address().replacen("http", "https", 1);
    let advice = format!("does not speak TLS: is it {}?", farm.address());
    folder.fails(&["jobs", "--coordinator", &secure], 1, &[&advice]);
}

#[test]
fn who_speaks_http_to_a_server_with_tls_is_told_its_address() {
    let folder = Folder::new();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let server = std::thread::spawn(move || {
        let (mut connection, _) = listener.accept().unwrap();
        assert!(connection.read(&mut [0; 4096]).unwrap() > 0, "a request");
        // An alert of TLS: the message was not expected.
        connection.write_all(&[0x15, 3, 3, 0, 2, 2, 10]).unwrap();
    });
    let coordinator = format!("http://{address}");
    folder.fails(
        &["jobs", "--coordinator", &coordinator],
        1,
        &["does not speak plain HTTP", &format!("is it https://{address}?")],
    );
    server.join().unwrap();
}

#[test]
fn a_proxy_of_the_environment_is_not_asked_for_this_machine_and_named_where_it_fails() {
    let folder = Folder::new();
    let farm = folder.coordinator("127.0.0.1:0", None);
    // No server listens there.
    let proxy = "http://127.0.0.1:9";
    let variables = ["http_proxy", "HTTP_PROXY", "https_proxy", "HTTPS_PROXY", "all_proxy", "ALL_PROXY"];
    let behind = |words: &[&str]| folder.command(words).envs(variables.map(|name| (name, proxy))).output().unwrap();
    let output = behind(&["jobs", "--coordinator", farm.address()]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let output = behind(&["jobs", "--coordinator", "http://farm.example:7171"]);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains(&format!("through the proxy {proxy}")) && message.contains("no_proxy"), "{message}");
    assert!(!message.contains("clerestory farm"), "no coordinator is missing: {message}");
}

#[test]
fn a_coordinator_is_not_open_to_the_network_without_a_token() {
    let folder = Folder::new();
    for command in ["coordinator", "farm"] {
        folder.fails(&[command, "--listen", "0.0.0.0:0"], 2, &["0.0.0.0:", "openssl rand", "CLERESTORY_TOKEN"]);
    }
}

#[test]
fn a_port_that_is_taken_is_called_so_and_a_free_one_suggested() {
    let folder = Folder::new();
    let first = folder.coordinator("127.0.0.1:0", None);
    let listen = first.address().trim_start_matches("http://");
    for command in ["coordinator", "farm"] {
        let expected = [listen, "the port is taken", "--listen 127.0.0.1:0"];
        folder.fails(&[command, "--listen", listen, "--data", "second"], 1, &expected);
    }
}

#[test]
fn a_reference_of_another_size_is_refused_by_the_sizes() {
    let folder = Folder::new();
    folder.succeeds(&["render", "scene.json", "--spp", "4", "--size", "12x8", "-o", "small.exr"]);
    folder.succeeds(&["render", "scene.json", "--spp", "4", "--size", "480x320", "-o", "large.exr"]);
    for command in ["render", "submit"] {
        for (reference, size) in [("small.exr", "12x8"), ("large.exr", "480x320")] {
            let words = [command, "scene.json", "--reference", reference];
            folder.fails(&words, 2, &[reference, size, "the image 24x16", "--size"]);
        }
    }
}

#[test]
fn submit_builds_the_scene_after_the_coordinator_has_answered_and_before_anything_is_sent() {
    let folder = Folder::new();
    let mut scene: Value = serde_json::from_slice(&fs::read(folder.path("scene.json")).unwrap()).unwrap();
    scene["panes"] = json!([{"name": "pane", "centre": [0, 0, 1], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0],
        "width": 0.5, "height": 0.5, "thickness": 0.004}]);
    scene["materials"]["silver"] = json!({"mirror": {}});
    scene["meshes"] = json!([{"name": "mirror", "material": "silver", "source": {"inline": {
        "positions": [[0, 0, 0], [0.1, 0, 2], [0, 0.1, 2]], "triangles": [[0, 1, 2]]}}}]);
    fs::write(folder.path("stuck.json"), scene.to_string()).unwrap();
    let farm = folder.coordinator("127.0.0.1:0", Some("0123456789abcdef"));
    fs::write(folder.path("token"), "0123456789abcdef\n").unwrap();
    let submit = ["submit", "stuck.json", "--coordinator"];
    folder.fails(
        &[&submit[..], &["http://127.0.0.1:1"]].concat(),
        1,
        &["http://127.0.0.1:1", "no coordinator is there"],
    );
    folder.fails(&[&submit[..], &[farm.address()]].concat(), 1, &["no token was sent"]);
    let with_token = [farm.address(), "--token-file", "token"];
    let refused = [&submit[..], &with_token].concat();
    folder.fails(&refused, 1, &["cannot use the scene stuck.json", "meshes[0].source: found mesh "]);
    let jobs = folder.succeeds(&[&["jobs", "--json", "--coordinator"][..], &with_token].concat());
    assert_eq!(serde_json::from_str::<Value>(&jobs).unwrap(), json!([]));
}

#[test]
fn who_lacks_the_token_is_told_where_to_put_it() {
    let folder = Folder::new();
    let farm = folder.coordinator("127.0.0.1:0", Some("0123456789abcdef"));
    for command in [["jobs"].as_slice(), &["submit", "scene.json"], &["worker"]] {
        let words = [command, &["--coordinator", farm.address()]].concat();
        folder.fails(&words, 1, &["no token was sent", "CLERESTORY_TOKEN", "--token-file"]);
    }
    fs::write(folder.path("wrong"), "0123456789abcdee\n").unwrap();
    let wrong = ["jobs", "--coordinator", farm.address(), "--token-file", "wrong"];
    folder.fails(&wrong, 1, &["the token that was sent is not the farm's", "CLERESTORY_TOKEN", "--token-file"]);
    fs::write(folder.path("token"), "0123456789abcdef\n").unwrap();
    let command = ["jobs", "--coordinator", farm.address(), "--token-file", "token"];
    folder.succeeds(&command);
    let output = folder.command(&command).env("CLERESTORY_TOKEN", "that of another farm").output().unwrap();
    assert!(output.status.success(), "an option wins: {}", String::from_utf8_lossy(&output.stderr));
    let named = folder.command(&command[..3]).env("CLERESTORY_TOKEN_FILE", "token").output().unwrap();
    assert!(named.status.success(), "{}", String::from_utf8_lossy(&named.stderr));
}
