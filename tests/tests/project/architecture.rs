//! The arrows of the architecture, what each crate never names, and the order of the modules in each:
//! `cli -> {coordinator, worker, experiments, export} -> {api, render-core} -> film`.

#![expect(clippy::unwrap_used, reason = "a test that cannot read its own workspace has failed")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use cargo_metadata::{DependencyKind, Metadata, MetadataCommand};

use crate::modules::ModuleGraph;

/// Which crates of the workspace each of them may depend on.
const ARROWS: [(&str, &[&str]); 12] = [
    ("clerestory-api", &[]),
    ("clerestory-film", &[]),
    ("clerestory-glazing", &[]),
    ("clerestory-render-core", &["clerestory-film", "clerestory-glazing"]),
    ("clerestory-export", &["clerestory-film", "clerestory-render-core"]),
    ("clerestory-local-render", &["clerestory-film", "clerestory-render-core"]),
    (
        "clerestory-experiments",
        &["clerestory-api", "clerestory-film", "clerestory-local-render", "clerestory-render-core"],
    ),
    ("clerestory-coordinator", &["clerestory-api", "clerestory-film", "clerestory-render-core"]),
    ("clerestory-worker", &["clerestory-api", "clerestory-film", "clerestory-render-core"]),
    (
        "clerestory",
        &[
            "clerestory-api",
            "clerestory-coordinator",
            "clerestory-experiments",
            "clerestory-export",
            "clerestory-film",
            "clerestory-glazing",
            "clerestory-local-render",
            "clerestory-render-core",
            "clerestory-worker",
        ],
    ),
    ("clerestory-load", &["clerestory-api", "clerestory-film"]),
    ("clerestory-test-faults", &[]),
];

/// What starts real servers for tests.
const TEST_SERVERS: &str = "clerestory-test-servers";

/// The render core computes. These would let it wait, listen, store, or read the time.
const FOREIGN_TO_RENDER_CORE: [&str; 9] =
    ["tokio", "reqwest", "axum", "hyper", "rusqlite", "sqlx", "object_store", "chrono", "time"];

/// Crates whose modules have an order.
const ORDERED_CRATES: [&str; 9] = [
    "crates/film",
    "crates/glazing",
    "crates/render-core",
    "crates/export",
    "crates/local-render",
    "crates/worker",
    "crates/experiments",
    "crates/coordinator",
    "crates/cli",
];

/// Imports that break the order: crate, importing module, imported module, reason. At most five.
const ORDER_EXCEPTIONS: [(&str, &str, &str, &str); 2] = [
    ("crates/glazing", "filling::border", "filling::registry", "the field within a border is a filling again"),
    ("crates/glazing", "filling::drawn", "filling::registry", "the ground of drawn pieces is a filling again"),
];

/// What the coordinator may use of the render core: it merges and validates, and never renders.
const RENDER_CORE_MODULES_OF_COORDINATOR: [&str; 2] = ["document", "scene"];

fn workspace_root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

fn metadata() -> Metadata {
    MetadataCommand::new().manifest_path(workspace_root().join("Cargo.toml")).exec().unwrap()
}

#[test]
fn crates_depend_on_each_other_along_the_arrows_only() {
    let metadata = metadata();
    let members: BTreeMap<&str, _> =
        metadata.workspace_packages().into_iter().map(|package| (package.name.as_str(), package)).collect();
    for (name, allowed) in ARROWS {
        for dependency in &members[name].dependencies {
            // Servers that tests start are there for tests only.
            let is_of_tests = dependency.kind == DependencyKind::Development && dependency.name == TEST_SERVERS;
            let inside = members.contains_key(dependency.name.as_str()) && !is_of_tests;
            assert!(
                !inside || allowed.contains(&dependency.name.as_str()),
                "{name} must not depend on {}",
                dependency.name
            );
        }
    }
    let ruled: BTreeSet<&str> =
        ARROWS.iter().map(|(name, _)| *name).chain(["clerestory-tests", TEST_SERVERS]).collect();
    let present: BTreeSet<&str> = members.keys().copied().collect();
    assert_eq!(present, ruled, "every crate of the workspace has its arrows written down here");
}

#[test]
fn the_render_core_has_no_network_database_async_or_clock() {
    let metadata = metadata();
    let nodes: BTreeMap<_, _> = metadata.resolve.as_ref().unwrap().nodes.iter().map(|node| (&node.id, node)).collect();
    let names: BTreeMap<_, _> = metadata.packages.iter().map(|package| (&package.id, package.name.as_str())).collect();
    let start = metadata.packages.iter().find(|package| package.name.as_str() == "clerestory-render-core").unwrap();
    let mut reached = BTreeSet::new();
    let mut open = vec![&start.id];
    while let Some(id) = open.pop() {
        if !reached.insert(names[id]) {
            continue;
        }
        let normal = nodes[id]
            .deps
            .iter()
            .filter(|dependency| dependency.dep_kinds.iter().any(|edge| edge.kind == DependencyKind::Normal));
        open.extend(normal.map(|dependency| &dependency.pkg));
    }
    assert!(reached.contains("obvhs"), "the dependencies of the render core were not found");
    for foreign in FOREIGN_TO_RENDER_CORE {
        assert!(!reached.contains(foreign), "clerestory-render-core must not depend on {foreign}, even indirectly");
    }
    for (file, source) in sources("crates/render-core/src") {
        // Unit tests come last in a file, and may read the environment.
        let shipped = source.split("#[cfg(test)]").next().unwrap_or_default();
        for name in ["Instant", "SystemTime", "std::env", "std::net", "std::process"] {
            assert!(!shipped.contains(name), "{} names {name}", file.display());
        }
    }
}

#[test]
fn the_coordinator_never_names_an_integrator_or_a_specular_method() {
    for (file, source) in sources("crates/coordinator/src") {
        for module in modules_named(&source, "clerestory_render_core") {
            assert!(
                RENDER_CORE_MODULES_OF_COORDINATOR.contains(&module.as_str()),
                "{} uses clerestory_render_core::{module}; the coordinator uses only \
                 {RENDER_CORE_MODULES_OF_COORDINATOR:?}",
                file.display()
            );
        }
        assert!(!source.contains("Scene::build"), "{} builds a scene, which is the work of workers", file.display());
    }
}

#[test]
fn the_modules_of_a_crate_have_an_order() {
    assert!(ORDER_EXCEPTIONS.len() <= 5);
    let mut circles = Vec::new();
    for name in ORDERED_CRATES {
        let mut graph = ModuleGraph::of(&workspace_root().join(name).join("src"));
        for (_, from, to, reason) in ORDER_EXCEPTIONS.iter().filter(|(of, ..)| *of == name) {
            println!("{name}: {from} may import {to}: {reason}");
            assert!(graph.remove_import(from, to), "{name}: {from} does not import {to}: an exception less");
        }
        match graph.orders() {
            Ok(orders) => orders.iter().for_each(|(folder, order)| println!("{name}/{folder}: {}", order.join(" < "))),
            Err(circle) => circles.push(format!("{name} {circle}")),
        }
    }
    assert!(circles.is_empty(), "{}", circles.join("\n"));
}

#[test]
fn render_needs_no_coordinator() {
    let graph = ModuleGraph::of(&workspace_root().join("crates/cli/src"));
    let reached = graph.reached_from("commands::render");
    assert!(reached.contains("local_image"), "the imports of the command were not found");
    for module in reached {
        let named = modules_named(graph.source(&module), "clerestory_coordinator");
        assert!(named.is_empty(), "`clerestory render` uses {module}, which uses clerestory_coordinator::{named:?}");
    }
}

#[test]
fn every_way_of_naming_a_module_is_seen() {
    #[track_caller]
    fn check(source: &str, expected: &[&str]) {
        assert_eq!(modules_named(&without_comments(source), "core_crate"), expected);
    }
    check("use core_crate::film::Node;", &["film"]);
    check("let n = core_crate :: integrator::render_node(s);", &["integrator"]);
    check("use core_crate::{film::{Node, tree}, scene, specular::fnee};", &["film", "scene", "specular"]);
    check("use core_crate::*;", &["*"]);
    check("use core_crate as other;", &["(an alias)"]);
    check("// core_crate::integrator\n/// [core_crate::specular]\nuse core_crate::scene;", &["scene"]);
    check("use my_core_crate::integrator;", &[]);
}

/// All Rust sources below `folder`, without comments.
fn sources(folder: &str) -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    let mut open = vec![workspace_root().join(folder)];
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let source = std::fs::read_to_string(&path).unwrap();
                found.push((path, without_comments(&source)));
            }
        }
    }
    assert!(!found.is_empty(), "no sources below {folder}");
    found
}

fn without_comments(source: &str) -> String {
    source.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// The modules of `crate_name` that `source` names, directly or in a `use` group.
fn modules_named(source: &str, crate_name: &str) -> Vec<String> {
    let is_word = |character: char| character.is_alphanumeric() || character == '_';
    let mut modules = Vec::new();
    for (start, _) in source.match_indices(crate_name) {
        let rest = source[start + crate_name.len()..].trim_start();
        if source[..start].ends_with(is_word) || rest.starts_with(is_word) && !rest.starts_with("as ") {
            continue;
        }
        let Some(path) = rest.strip_prefix("::").map(str::trim_start) else {
            modules.push("(an alias)".to_owned());
            continue;
        };
        let Some(group) = path.strip_prefix('{') else {
            modules.push(first_word(path));
            continue;
        };
        let mut depth = 0;
        let mut entry = String::new();
        for character in group.chars() {
            match character {
                '}' if depth == 0 => break,
                ',' if depth == 0 => modules.push(first_word(&std::mem::take(&mut entry))),
                _ => {
                    depth += i32::from(character == '{') - i32::from(character == '}');
                    entry.push(character);
                }
            }
        }
        modules.push(first_word(&entry));
    }
    modules.retain(|module| !module.is_empty());
    modules
}

fn first_word(path: &str) -> String {
    let path = path.trim_start();
    if path.starts_with('*') {
        return "*".to_owned();
    }
    path.chars().take_while(|character| character.is_alphanumeric() || *character == '_').collect()
}
