use super::*;

fn check(file: &Path) -> Result<(), Failure> {
    check_outputs(&[("--output", Some(file))], &[])
}

/// What a failure says, with its causes.
fn message(result: Result<(), Failure>) -> String {
    result.unwrap_err().causes().map(ToString::to_string).collect::<Vec<_>>().join(": ")
}

fn entries(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_file_is_replaced_whole_and_nothing_else_is_left() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("image.exr");
    check(&file).unwrap();
    assert!(entries(folder.path()).is_empty());
    write(&file, b"old").unwrap();
    write(&file, b"new").unwrap();
    assert_eq!(fs::read(&file).unwrap(), b"new");
    let mut given_up = OutputFile::create(&file).unwrap();
    given_up.write(b"half").unwrap();
    drop(given_up);
    assert_eq!((fs::read(&file).unwrap(), entries(folder.path())), (b"new".to_vec(), vec!["image.exr".to_owned()]));
}

#[test]
fn two_writers_of_one_file_do_not_disturb_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("image.exr");
    let [mut first, mut second] = [(); 2].map(|()| OutputFile::create(&file).unwrap());
    first.write(b"of the ").unwrap();
    second.write(b"of the second").unwrap();
    first.write(b"first").unwrap();
    second.finish().unwrap();
    assert_eq!(fs::read(&file).unwrap(), b"of the second");
    first.finish().unwrap();
    assert_eq!((fs::read(&file).unwrap(), entries(folder.path()).len()), (b"of the first".to_vec(), 1));
}

#[test]
fn an_unfinished_file_is_known_until_it_is_gone() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("image.exr");
    fs::write(&file, "old").unwrap();
    let mut unfinished = OutputFile::create(&file).unwrap();
    unfinished.write(b"half").unwrap();
    assert_eq!(entries(folder.path()).len(), 2);
    let place = unfinished.replacement.as_ref().unwrap().unfinished.as_ref().unwrap().to_path_buf();
    assert!(super::unfinished().contains(&place));
    drop(unfinished);
    assert!(!super::unfinished().contains(&place) && !place.exists());
}

#[cfg(unix)]
#[test]
fn a_link_stays_and_what_it_points_to_is_written() {
    use std::os::unix::fs::symlink;

    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::create_dir(path("store")).unwrap();
    fs::write(path("store/real.exr"), "old").unwrap();
    // Relative, absolute, through another link, dangling, and by way of a folder that is a link.
    symlink("store/real.exr", path("relative")).unwrap();
    symlink(path("store/real.exr"), path("absolute")).unwrap();
    symlink("relative", path("second")).unwrap();
    symlink("store/new.exr", path("dangling")).unwrap();
    symlink("store", path("folder")).unwrap();
    for (name, target) in [
        ("relative", "store/real.exr"),
        ("absolute", "store/real.exr"),
        ("second", "store/real.exr"),
        ("dangling", "store/new.exr"),
        ("folder/other.exr", "store/other.exr"),
    ] {
        check(&path(name)).unwrap();
        write(&path(name), name.as_bytes()).unwrap();
        assert_eq!(fs::read_to_string(path(target)).unwrap(), name);
    }
    for name in ["relative", "absolute", "second", "dangling"] {
        assert!(fs::symlink_metadata(path(name)).unwrap().is_symlink(), "{name}");
    }
    assert_eq!(entries(&path("store")), ["new.exr", "other.exr", "real.exr"]);

    symlink("circle", path("circle")).unwrap();
    symlink("no/such/image.exr", path("nowhere")).unwrap();
    symlink("store", path("to a folder")).unwrap();
    for (name, expected) in
        [("circle", "in a circle"), ("nowhere", "no/such does not exist"), ("to a folder", "is a directory")]
    {
        for result in [check(&path(name)), write(&path(name), b"x")] {
            let message = message(result);
            assert!(message.contains(&format!("{name}: ")) && message.contains(expected), "{message}");
        }
    }
    assert_eq!(
        message(check_outputs(&[("--output", Some(&path("second"))), ("--stats", Some(&path("absolute")))], &[])),
        format!("--output and --stats both write {}: expected a file for each", path("absolute").display())
    );
}

#[cfg(unix)]
#[test]
fn a_file_keeps_its_permissions_and_a_new_one_has_the_usual() {
    use std::os::unix::fs::PermissionsExt;

    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let mode = |name: &str| fs::metadata(path(name)).unwrap().permissions().mode() & 0o7777;
    fs::write(path("usual"), "").unwrap();
    write(&path("new"), b"").unwrap();
    assert_eq!(mode("new"), mode("usual"));
    for kept in [0o640, 0o604, 0o777] {
        fs::set_permissions(path("new"), fs::Permissions::from_mode(kept)).unwrap();
        write(&path("new"), b"again").unwrap();
        assert_eq!(mode("new"), kept);
    }
}

#[cfg(unix)]
#[test]
fn devices_and_pipes_are_written_in_place() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("link");
    std::os::unix::fs::symlink("/dev/null", &link).unwrap();
    for file in [Path::new("/dev/null"), &link] {
        check(file).unwrap();
        write(file, b"nothing").unwrap();
        assert!(!fs::metadata(file).unwrap().is_file(), "{}", file.display());
    }
    // Standard output may be a file, which is not to be replaced.
    for name in ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"] {
        assert!(is_standard_output(Path::new(name)), "{name}");
    }
    assert!(!is_standard_output(Path::new("/dev/fd/2")) && !is_standard_output(&link));
    let reopened = Destination::find(Path::new("/dev/fd/2")).unwrap();
    assert!(matches!(reopened, Destination::Special(_)), "{reopened:?}");
    // Many outputs may go to one device.
    let null = Some(Path::new("/dev/null"));
    check_outputs(&[("--output", null), ("--stats", null)], &[]).unwrap();
}

#[test]
fn a_png_keeps_the_name_of_its_image() {
    for (image, png) in
        [("a/room.exr", "a/room.png"), ("room-0.27.exr", "room-0.27.png"), ("room-0.27", "room-0.27.png")]
    {
        assert_eq!(png_beside(Path::new(image)), Path::new(png));
    }
}

#[test]
fn a_name_of_another_image_format_is_refused_and_any_other_is_not() {
    for name in ["a.png", "a/room.JPG", "room-0.27.tiff"] {
        let message = check_image_name(Path::new(name)).unwrap_err().to_string();
        let expected = Path::new(name).with_extension("exr");
        assert!(message.contains(name) && message.contains(&*expected.to_string_lossy()), "{message}");
    }
    for name in ["a.exr", "a.EXR", "room-0.27", "/dev/stdout", "png", ""] {
        check_image_name(Path::new(name)).unwrap();
    }
}

#[test]
fn an_output_is_a_file_of_its_own_and_no_input() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let (file, other) = (path("a.png"), path("./a.png"));
    check_outputs(&[("--output", Some(&file)), ("--png", None), ("--stats", Some(&path("b")))], &[]).unwrap();
    let twice = message(check_outputs(&[("--output", Some(&file)), ("--png", Some(&other))], &[]));
    assert!(twice.contains("--output and --png both write"), "{twice}");
    fs::write(path("scene.json"), "{}").unwrap();
    let scene = [("the scene", Some(path("./scene.json")))];
    let scene = scene.each_ref().map(|(name, file)| (*name, file.as_deref()));
    let replaced = message(check_outputs(&[("--stats", Some(&path("scene.json")))], &scene));
    assert!(replaced.contains("--stats would replace") && replaced.contains("which is the scene"), "{replaced}");
    check_outputs(&[("--stats", Some(&path("stats.json")))], &scene).unwrap();
}

#[test]
fn a_place_where_nothing_can_be_written_is_noticed_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("file"), "").unwrap();
    for (name, expected) in [
        ("", "is a directory"),
        (".", "is a directory"),
        ("new/", "is a directory, expected the name of a file"),
        ("no/such/image.exr", "no/such does not exist"),
        ("file/image.exr", "Not a directory"),
    ] {
        let message = message(check(&path(name)));
        assert!(message.contains("cannot write") && message.contains(expected), "{name}: {message}");
    }
    assert!(message(check(Path::new(""))).contains("an empty name"));
    assert!(message(create_folder(&path("file"))).contains("is a file, expected the name of a folder"));
    create_folder(&path("new/folder")).unwrap();
    assert!(entries(&path("new/folder")).is_empty());
}

#[cfg(unix)]
#[test]
fn what_is_protected_is_noticed_before_the_work() {
    use std::os::unix::fs::PermissionsExt;

    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let protect = |name: &str, mode| fs::set_permissions(path(name), fs::Permissions::from_mode(mode)).unwrap();
    fs::write(path("kept.exr"), "kept").unwrap();
    fs::create_dir(path("shut")).unwrap();
    protect("kept.exr", 0o444);
    protect("shut", 0o555);
    // Nothing is protected from the superuser.
    if File::options().write(true).open(path("kept.exr")).is_err() {
        assert!(message(check(&path("kept.exr"))).contains("ermission denied"));
        let shut = message(check(&path("shut/image.exr")));
        assert!(shut.contains("no file can be made in the folder") && shut.contains("ermission denied"), "{shut}");
    }
    protect("shut", 0o755);
}

#[cfg(target_os = "linux")]
#[test]
fn an_image_that_does_not_fit_on_the_disk_is_kept_elsewhere() {
    use std::os::unix::fs::PermissionsExt;

    // Another user guesses the name, to have another file overwritten.
    let folder = tempfile::tempdir().unwrap();
    let victim = folder.path().join("victim");
    let guess = std::env::temp_dir().join(format!("clerestory-{}-full", std::process::id()));
    std::os::unix::fs::symlink(&victim, &guess).unwrap();
    let keep = || {
        let failure = write_or_keep(Path::new("/dev/full"), b"an image").unwrap_err();
        let Failure::WrittenElsewhere { kept, .. } = &failure else { panic!("{failure:?}") };
        (kept.clone(), failure)
    };
    let [(first, failure), (second, _)] = [keep(), keep()];
    fs::remove_file(&guess).unwrap();
    assert!(!victim.exists() && first != second);
    for kept in [&first, &second] {
        assert_eq!(fs::read(kept).unwrap(), b"an image");
        assert_eq!(fs::metadata(kept).unwrap().permissions().mode() & 0o077, 0, "it is for this user alone");
        assert!(!unfinished().contains(kept));
        fs::remove_file(kept).unwrap();
    }
    let text: Vec<String> = failure.causes().map(ToString::to_string).collect();
    assert!(text[0].contains("/dev/full") && text[0].contains(&*first.to_string_lossy()), "{text:?}");
    assert!(text[1].contains("No space left"), "{text:?}");
    assert!(crate::advice::advice(&failure).unwrap().contains("disk is full"), "{:?}", crate::advice::advice(&failure));
}
