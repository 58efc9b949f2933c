//! Every dependency may be used under a licence that `deny.toml` allows.
//!
//! `cargo deny check licenses` says the same where it is installed; this test needs nothing but cargo.

#![expect(clippy::unwrap_used, reason = "a test that cannot read its own workspace has failed")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use cargo_metadata::{DependencyKind, Metadata, MetadataCommand, PackageId};
use serde::Deserialize;
use spdx::{Expression, Licensee, ParseMode};

#[derive(Deserialize)]
struct DenyFile {
    licenses: Licences,
}

#[derive(Deserialize)]
struct Licences {
    allow: Vec<String>,
    exceptions: Vec<Exception>,
}

#[derive(Deserialize)]
struct Exception {
    name: String,
    allow: Vec<String>,
}

fn workspace_root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

fn metadata() -> Metadata {
    MetadataCommand::new().manifest_path(workspace_root().join("Cargo.toml")).exec().unwrap()
}

fn policy() -> Licences {
    let text = std::fs::read_to_string(workspace_root().join("deny.toml")).unwrap();
    toml::from_str::<DenyFile>(&text).unwrap().licenses
}

fn is_allowed(expression: &str, allowed: &[String]) -> bool {
    let licensees: Vec<Licensee> = allowed.iter().map(|licence| Licensee::parse(licence).unwrap()).collect();
    let expression = Expression::parse_mode(expression, ParseMode::LAX).unwrap();
    expression.evaluate(|requirement| licensees.iter().any(|licensee| licensee.satisfies(requirement)))
}

/// Packages that end up in the binary: the closure of `clerestory` over all but development dependencies.
fn shipped_packages(metadata: &Metadata) -> BTreeSet<PackageId> {
    let nodes: BTreeMap<_, _> = metadata.resolve.as_ref().unwrap().nodes.iter().map(|node| (&node.id, node)).collect();
    let binary = metadata.packages.iter().find(|package| package.name.as_str() == "clerestory").unwrap();
    let mut shipped = BTreeSet::new();
    let mut open = vec![binary.id.clone()];
    while let Some(id) = open.pop() {
        let shipped_edges = nodes[&id]
            .deps
            .iter()
            .filter(|dependency| dependency.dep_kinds.iter().any(|edge| edge.kind != DependencyKind::Development));
        open.extend(shipped_edges.map(|dependency| dependency.pkg.clone()).filter(|next| !shipped.contains(next)));
        shipped.insert(id);
    }
    shipped
}

#[test]
fn every_dependency_has_a_licence_that_is_allowed() {
    let policy = policy();
    let refused: Vec<String> = metadata()
        .packages
        .iter()
        .filter(|package| {
            let exception = policy.exceptions.iter().find(|exception| exception.name == package.name.as_str());
            let allowed: Vec<String> =
                policy.allow.iter().chain(exception.iter().flat_map(|exception| &exception.allow)).cloned().collect();
            !package.license.as_deref().is_some_and(|expression| is_allowed(expression, &allowed))
        })
        .map(|package| format!("{} {}: {:?}", package.name, package.version, package.license))
        .collect();
    assert!(refused.is_empty(), "dependencies whose licence deny.toml does not allow: {refused:#?}");
}

#[test]
fn the_shipped_binary_needs_no_licence_exception() {
    let policy = policy();
    let metadata = metadata();
    let shipped = shipped_packages(&metadata);
    assert!(shipped.len() > 50, "the closure of the binary was not found: {} packages", shipped.len());
    let excepted: Vec<&str> = metadata
        .packages
        .iter()
        .filter(|package| shipped.contains(&package.id))
        .map(|package| package.name.as_str())
        .filter(|name| policy.exceptions.iter().any(|exception| exception.name == *name))
        .collect();
    assert!(excepted.is_empty(), "shipped packages that need an exception: {excepted:?}");
}

#[test]
fn a_copyleft_licence_is_refused_unless_there_is_a_choice() {
    let allowed = policy().allow;
    for refused in ["GPL-3.0-only", "MIT AND GPL-2.0-or-later", "MPL-2.0", "AGPL-3.0-only OR SSPL-1.0"] {
        assert!(!is_allowed(refused, &allowed), "{refused} should be refused");
    }
    for accepted in ["MIT OR GPL-3.0-only", "MIT/Apache-2.0", "(MIT OR Apache-2.0) AND Unicode-3.0"] {
        assert!(is_allowed(accepted, &allowed), "{accepted} should be allowed");
    }
}
