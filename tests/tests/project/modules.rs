//! The modules of a crate and what they import of each other, read from the sources.
//!
//! Each file is a module. A path that begins with `crate`, `super`, `self` or the name of a submodule is an import of
//! the innermost module that it names. An item that a module re-exports counts as an import of the submodule that
//! defines it. Unit tests do not count.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// The path of a module from the root of its crate, which is empty.
type ModulePath = Vec<String>;

/// The modules of a crate and their imports.
pub(crate) struct ModuleGraph {
    modules: BTreeMap<ModulePath, Module>,
}

struct Module {
    /// The source without comments and unit tests.
    source: String,
    /// Imported modules.
    imports: BTreeSet<ModulePath>,
}

/// A path in a source, and whether a `pub use` only passes it on.
struct NamedPath {
    segments: Vec<String>,
    alias: Option<String>,
    is_reexport: bool,
}

impl ModuleGraph {
    /// Reads the sources of a crate.
    pub(crate) fn of(sources: &Path) -> Self {
        let mut graph = Self { modules: BTreeMap::new() };
        graph.read(sources, &[]);
        graph.forget_undeclared();
        let paths: Vec<ModulePath> = graph.modules.keys().cloned().collect();
        for path in paths {
            let imports = graph.imports_of(&path);
            if let Some(module) = graph.modules.get_mut(&path) {
                module.imports = imports;
            }
        }
        graph
    }

    /// Reads a folder.
    fn read(&mut self, folder: &Path, path: &[String]) {
        for entry in fs::read_dir(folder).expect("a folder of sources") {
            let file = entry.expect("an entry").path();
            let name = file.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default().to_owned();
            let is_root = matches!(name.as_str(), "mod" | "lib" | "main");
            let of_file = if is_root { path.to_vec() } else { [path, &[name]].concat() };
            if file.is_dir() {
                self.read(&file, &of_file);
            } else if file.extension().is_some_and(|extension| extension == "rs") {
                let source = shipped(&fs::read_to_string(&file).expect("a source"));
                self.modules.insert(of_file, Module { source, imports: BTreeSet::new() });
            }
        }
    }

    /// Forgets the modules that no parent declares: a parent declares modules of tests under `cfg(test)`.
    fn forget_undeclared(&mut self) {
        let is_declared = |path: &ModulePath| match path.split_last() {
            Some((name, parent)) => self.modules.get(parent).is_some_and(|module| declares(&module.source, name)),
            None => true,
        };
        let undeclared: Vec<ModulePath> = self.modules.keys().filter(|path| !is_declared(path)).cloned().collect();
        self.modules.retain(|path, _| !undeclared.iter().any(|undeclared| path.starts_with(undeclared)));
    }

    /// The modules that a module imports.
    fn imports_of(&self, path: &ModulePath) -> BTreeSet<ModulePath> {
        let named = self.named_paths(path).into_iter().filter(|named| !named.is_reexport);
        named.filter_map(|named| self.resolve(&named.segments)).filter(|import| import != path).collect()
    }

    /// The innermost module that an absolute path names, through re-exports.
    fn resolve(&self, segments: &[String]) -> Option<ModulePath> {
        let depth = (0..=segments.len()).rev().find(|depth| self.modules.contains_key(&segments[..*depth]))?;
        let module = segments[..depth].to_vec();
        let Some(item) = segments.get(depth) else { return Some(module) };
        let passed_on = self.named_paths(&module).into_iter().find(|named| {
            let name = named.alias.as_ref().or(named.segments.last());
            name == Some(item) && named.segments.len() > depth + 1 && named.segments.starts_with(&module)
        });
        match passed_on {
            Some(named) => self.resolve(&named.segments),
            None => Some(module),
        }
    }

    /// The paths within the crate that a source names, from the root of the crate.
    fn named_paths(&self, path: &ModulePath) -> Vec<NamedPath> {
        let Some(Module { source, .. }) = self.modules.get(path) else { return Vec::new() };
        let mut named = Vec::new();
        let children = self.modules.keys().filter(|module| module.len() == path.len() + 1 && module.starts_with(path));
        let children = children.filter_map(|module| module.last()).map(String::as_str);
        for start in ["crate", "super", "self"].into_iter().chain(children) {
            for (place, _) in source.match_indices(start) {
                let (before, rest) = (&source[..place], &source[place + start.len()..]);
                let is_inside =
                    before.ends_with(|last: char| last.is_alphanumeric() || matches!(last, '_' | ':' | '.'));
                if is_inside || !rest.starts_with("::") {
                    continue;
                }
                let base = match start {
                    "crate" => Vec::new(),
                    "super" => path[..path.len().saturating_sub(1)].to_vec(),
                    "self" => path.clone(),
                    child => [path.as_slice(), &[child.to_owned()]].concat(),
                };
                let is_reexport = before.trim_end().ends_with("use") && {
                    let line = before.rsplit(['\n', ';']).next().unwrap_or_default().trim_start();
                    line.starts_with("pub")
                };
                for (segments, alias) in leaves(&rest[2..]) {
                    let mut absolute = base.clone();
                    for segment in segments {
                        match segment.as_str() {
                            "super" => _ = absolute.pop(),
                            "self" => {}
                            _ => absolute.push(segment),
                        }
                    }
                    named.push(NamedPath { segments: absolute, alias, is_reexport });
                }
            }
        }
        named
    }

    /// All modules that a module reaches by imports, with itself.
    pub(crate) fn reached_from(&self, start: &str) -> BTreeSet<String> {
        let start: ModulePath = start.split("::").map(str::to_owned).collect();
        assert!(self.modules.contains_key(&start), "no module {start:?}");
        let mut reached = BTreeSet::new();
        let mut open = vec![start];
        while let Some(path) = open.pop() {
            if reached.insert(path.join("::")) {
                open.extend(self.modules[&path].imports.iter().cloned());
                // A folder module is used as a whole.
                open.extend(
                    self.modules.keys().filter(|module| !path.is_empty() && module.starts_with(&path)).cloned(),
                );
            }
        }
        reached
    }

    /// The source of a module, without comments and unit tests.
    pub(crate) fn source(&self, module: &str) -> &str {
        let path: ModulePath = module.split("::").map(str::to_owned).collect();
        self.modules.get(&path).map_or("", |module| &module.source)
    }

    /// Removes an import; returns whether it was there. Both are modules or folders.
    pub(crate) fn remove_import(&mut self, from: &str, to: &str) -> bool {
        let [from, to] = [from, to].map(|path| path.split("::").map(str::to_owned).collect::<ModulePath>());
        let mut is_found = false;
        for (_, module) in self.modules.iter_mut().filter(|(path, _)| path.starts_with(&from)) {
            let before = module.imports.len();
            module.imports.retain(|import| !import.starts_with(&to));
            is_found |= module.imports.len() < before;
        }
        is_found
    }

    /// The modules of each folder, those that import nothing of the others first.
    ///
    /// # Errors
    ///
    /// The imports of the modules that cannot be ordered.
    pub(crate) fn orders(&self) -> Result<Vec<(String, Vec<String>)>, String> {
        let folders: BTreeSet<&[String]> =
            self.modules.keys().filter_map(|path| path.split_last()).map(|(_, folder)| folder).collect();
        let (orders, circles): (Vec<_>, Vec<_>) = (folders.into_iter())
            .map(|folder| self.order(folder).map(|order| (folder.join("::"), order)))
            .partition(Result::is_ok);
        let circles: Vec<String> = circles.into_iter().filter_map(Result::err).collect();
        if circles.is_empty() { Ok(orders.into_iter().flatten().collect()) } else { Err(circles.join("\n")) }
    }

    fn order(&self, folder: &[String]) -> Result<Vec<String>, String> {
        // A submodule stands for all that is in it; the folder's own file is a module beside its submodules.
        let child = |path: &ModulePath| match path.starts_with(folder) {
            true => Some(path.get(folder.len()).cloned().unwrap_or_else(|| "(its own file)".to_owned())),
            false => None,
        };
        let mut open: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for (path, module) in &self.modules {
            let Some(from) = child(path) else { continue };
            let imports = open.entry(from.clone()).or_default();
            imports.extend(module.imports.iter().filter_map(child).filter(|to| *to != from));
        }
        let mut order = Vec::new();
        while let Some(next) = open.iter().find(|(_, imports)| imports.is_empty()).map(|(name, _)| name.clone()) {
            open.remove(&next);
            open.values_mut().for_each(|imports| _ = imports.remove(&next));
            order.push(next);
        }
        // Modules that nothing in the circle imports only follow it.
        while let Some(last) = open.keys().find(|name| !open.values().any(|imports| imports.contains(*name))).cloned() {
            open.remove(&last);
        }
        if open.is_empty() {
            return Ok(order);
        }
        let is_between = |from: &ModulePath, to: &ModulePath| match (child(from), child(to)) {
            (Some(from), Some(to)) => open.get(&from).is_some_and(|imports| imports.contains(&to)),
            _ => false,
        };
        let all = self.modules.iter().flat_map(|(from, module)| module.imports.iter().map(move |to| (from, to)));
        let in_circle = all.filter(|(from, to)| is_between(from, to));
        let circle: String = in_circle.map(|(from, to)| format!("\n  {} imports {}", name(from), name(to))).collect();
        Err(format!("in `{}`, after {order:?}, a circle:{circle}", folder.join("::")))
    }
}

fn name(path: &ModulePath) -> String {
    if path.is_empty() { "the root".to_owned() } else { path.join("::") }
}

/// A source without comments and unit tests.
fn shipped(source: &str) -> String {
    let source = source.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n");
    let mut shipped = String::new();
    let mut rest = source.as_str();
    while let Some((before, after)) = rest.split_once("#[cfg(test)]") {
        shipped.push_str(before);
        let end_of_item = match (after.find(';'), after.find('{')) {
            (Some(statement), Some(body)) if statement < body => statement + 1,
            (Some(statement), None) => statement + 1,
            (_, Some(body)) => body + 1 + closing_brace(&after[body + 1..]),
            (None, None) => after.len(),
        };
        rest = &after[end_of_item..];
    }
    shipped + rest
}

/// Bytes up to and with the brace that closes a block.
fn closing_brace(text: &str) -> usize {
    let mut depth = 1;
    for (place, character) in text.char_indices() {
        depth += i32::from(character == '{') - i32::from(character == '}');
        if depth == 0 {
            return place + 1;
        }
    }
    text.len()
}

fn declares(source: &str, name: &str) -> bool {
    let declaration = format!("mod {name}");
    source.match_indices(&declaration).any(|(place, found)| {
        let rest = source[place + found.len()..].trim_start();
        rest.starts_with(';') || rest.starts_with('{')
    })
}

/// The paths that a text begins with: one, or each of a group in braces. With their aliases.
fn leaves(text: &str) -> Vec<(Vec<String>, Option<String>)> {
    let text = text.trim_start();
    if let Some(group) = text.strip_prefix('{') {
        let group = &group[..closing_brace(group).saturating_sub(1)];
        return entries(group).into_iter().flat_map(leaves).collect();
    }
    let end = text.find(|character: char| !character.is_alphanumeric() && character != '_').unwrap_or(text.len());
    let (segment, rest) = text.split_at(end);
    if segment.is_empty() {
        return vec![(Vec::new(), None)];
    }
    let rest = rest.trim_start();
    if let Some(below) = rest.strip_prefix("::") {
        let prefixed = |(mut segments, alias): (Vec<String>, Option<String>)| {
            segments.insert(0, segment.to_owned());
            (segments, alias)
        };
        return leaves(below).into_iter().map(prefixed).collect();
    }
    let alias = rest.strip_prefix("as ").and_then(|alias| leaves(alias).pop()).and_then(|(mut name, _)| name.pop());
    vec![(vec![segment.to_owned()], alias)]
}

/// The entries of a group, without those of groups within.
fn entries(group: &str) -> Vec<&str> {
    let (mut depth, mut start, mut entries) = (0, 0, Vec::new());
    for (place, character) in group.char_indices() {
        depth += i32::from(character == '{') - i32::from(character == '}');
        if character == ',' && depth == 0 {
            entries.push(&group[start..place]);
            start = place + 1;
        }
    }
    entries.push(&group[start..]);
    entries.into_iter().filter(|entry| !entry.trim().is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graph(files: &[(&str, &str)]) -> ModuleGraph {
        let folder = tempfile::tempdir().unwrap();
        for (file, source) in files {
            let file = folder.path().join(file);
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(file, source).unwrap();
        }
        ModuleGraph::of(folder.path())
    }

    #[test]
    fn modules_are_ordered_by_what_they_import() {
        let graph = graph(&[
            ("lib.rs", "mod a; mod b; mod c; pub use a::Item;\n#[cfg(test)]\nmod tests;"),
            ("a.rs", "pub struct Item; // crate::c"),
            ("b/mod.rs", "mod x;\nmod y;\nuse x::X;\nfn f() -> X {}"),
            ("b/x.rs", "use crate::{a::{self, Item}, c::C as D};"),
            ("b/y.rs", "fn f() { super::x::g(crate::Item) }\n#[cfg(test)]\nmod tests { use crate::b::x; }"),
            ("c.rs", "#[cfg(test)]\nuse crate::b;\nuse super::Item;"),
            ("tests.rs", "use crate::b;"),
        ]);
        let orders = graph.orders().unwrap();
        assert_eq!(orders[0].1, ["(its own file)", "a", "c", "b"].map(str::to_owned), "the facade imports nothing");
        assert_eq!(orders[1].1, ["x", "(its own file)", "y"].map(str::to_owned));
        assert_eq!(graph.reached_from("c"), ["a", "c"].map(str::to_owned).into());
        assert_eq!(graph.reached_from("b").len(), 5);
    }

    #[test]
    fn a_circle_is_named_with_its_imports_and_an_exception_removes_one() {
        let mut graph = graph(&[
            ("lib.rs", "mod a; mod b; mod c;"),
            ("a.rs", "use crate::b::f;"),
            ("b.rs", "fn f() { crate::a::g() }"),
            ("c.rs", "use crate::a;"),
        ]);
        let circle = graph.orders().unwrap_err();
        assert!(circle.contains("a imports b") && circle.contains("b imports a") && !circle.contains("c imports"));
        assert!(graph.remove_import("b", "a") && !graph.remove_import("b", "a"));
        assert_eq!(graph.orders().unwrap()[0].1, ["(its own file)", "b", "a", "c"].map(str::to_owned));
    }

    #[test]
    fn an_item_of_a_folder_makes_its_file_a_module_beside_its_submodules() {
        let circle = graph(&[
            ("lib.rs", "mod a;"),
            ("a/mod.rs", "mod x;\npub struct Shape;\nfn f() { x::g() }"),
            ("a/x.rs", "use super::Shape;"),
        ]);
        assert!(circle.orders().unwrap_err().contains("a::x imports a"));
    }
}
