//! Models that others made, imported as a user does: the samples of Khronos and the test models of Assimp.
//!
//! `tests/data/models.txt` says what becomes of each: how many triangles it has, and what the report has to say, or why
//! it is refused. Its counts come from a program of its own, which adds up the accessors of the nodes. No import may
//! panic, hang or take much memory.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Output};

use clap::Parser;
use clerestory_tests::farm::clerestory;

/// Imports all models, and compares each with what is expected.
#[derive(Parser)]
struct Arguments {
    /// The folder of test data of the Debian source package draco. It is written to.
    #[arg(long, value_name = "FOLDER")]
    draco: PathBuf,
    /// The folder of models of the Debian package assimp-testmodels. It is written to.
    #[arg(long, value_name = "FOLDER")]
    assimp: PathBuf,
    /// Also renders a small picture of each into this folder.
    #[arg(long, value_name = "FOLDER")]
    pictures: Option<PathBuf>,
}

/// What becomes of each model.
const EXPECTED: &str = include_str!("../../data/models.txt");

/// Endings of the files that are imported.
const ENDINGS: [&str; 3] = ["glb", "gltf", "obj"];

/// Memory for an import, KiB of address space, and its time in seconds.
const MEMORY: &str = "2097152";
const TIME: &str = "120";

fn main() -> ExitCode {
    let Arguments { draco, assimp, pictures } = Arguments::parse();
    let mut expected: BTreeMap<String, [&str; 2]> = BTreeMap::new();
    for line in EXPECTED.lines().filter(|line| !line.is_empty() && !line.starts_with('#')) {
        let fields: Vec<&str> = line.split('|').map(str::trim).collect();
        let [set, file, outcome, text] = fields[..] else { panic!("not a line of the table: {line}") };
        expected.insert(format!("{set} {file}"), [outcome, text]);
    }
    let mut wrong = Vec::new();
    let (mut imported, mut refused) = (0, 0);
    for (set, folder) in [("draco", &draco), ("assimp", &assimp)] {
        for file in models(folder) {
            let name = file.strip_prefix(folder).expect("it is in the folder").to_string_lossy();
            let name = format!("{set} {name}");
            let Some([outcome, text]) = expected.remove(&name) else {
                wrong.push(format!("{name} is not in the table"));
                continue;
            };
            let output = import(&file);
            let found = found(&output);
            println!("{name}: {found}");
            let said = [output.stdout, output.stderr].map(|said| String::from_utf8_lossy(&said).into_owned()).concat();
            if found != outcome || !said.contains(text) {
                wrong.push(format!("{name} is {found}, must be {outcome} and say {text:?}: {said}"));
            }
            if outcome == "refused" {
                refused += 1
            } else {
                imported += 1
            }
            if let Some(pictures) = &pictures
                && outcome != "refused"
            {
                render(&file, pictures, &name.replace(['/', ' '], "-"));
            }
        }
    }
    wrong.extend(expected.keys().map(|name| format!("{name} is not there")));
    println!("{imported} models are imported, {refused} are refused");
    wrong.iter().for_each(|wrong| println!("WRONG: {wrong}"));
    if wrong.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// All models in a folder and below, in the order of their names.
fn models(folder: &Path) -> Vec<PathBuf> {
    let (mut found, mut open) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder that can be read") {
            let path = entry.expect("an entry that can be read").path();
            let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
            if path.is_dir() {
                open.push(path);
            } else if ENDINGS.contains(&ending) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// The scene file of a model, beside it.
fn scene_file(model: &Path) -> PathBuf {
    model.with_extension("clerestory.json")
}

fn import(model: &Path) -> Output {
    let mut command = Command::new("sh");
    command.args(["-c", "ulimit -v \"$1\" && shift && exec timeout \"$@\"", "sh", MEMORY, TIME]);
    command.arg(clerestory().get_program()).arg("import").arg(model).arg("-o").arg(scene_file(model));
    command.output().expect("a shell")
}

/// The number of triangles, `refused`, or how else the command has ended.
fn found(output: &Output) -> String {
    let report = String::from_utf8_lossy(&output.stdout);
    let count = report.split(" triangles").next().and_then(|before| before.rsplit(' ').next());
    match output.status.code() {
        Some(0) => count.unwrap_or("without a count").to_owned(),
        Some(1) => "refused".to_owned(),
        _ => output.status.to_string(),
    }
}

fn render(model: &Path, pictures: &Path, name: &str) {
    let image = pictures.join(name).with_extension("exr");
    let mut command = clerestory();
    command.arg("render").arg(scene_file(model)).args(["--size", "240x180", "--spp", "64", "--png", "-o"]).arg(image);
    let output = command.output().expect("the binary");
    if !output.status.success() {
        println!("no picture of {name}: {}", String::from_utf8_lossy(&output.stderr));
    }
}
