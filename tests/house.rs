//! The plan of the house: every `use` of `src/` is held against the order of modules in `lib.rs`, and no file imports
//! another one in a circle.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// A source file: its module's path (`["plan", "cells"]`) and its text.
type Sources = BTreeMap<Vec<String>, String>;

fn sources() -> Sources {
    fn visit(directory: &Path, module: &[String], found: &mut Sources) {
        for entry in fs::read_dir(directory).expect("src/ is there") {
            let path = entry.expect("readable").path();
            let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
            if path.is_dir() {
                visit(&path, &[module, &[name]].concat(), found);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let is_face = ["mod", "lib", "main"].contains(&name.as_str());
                let module = if is_face { module.to_vec() } else { [module, std::slice::from_ref(&name)].concat() };
                if name != "main" {
                    found.insert(module, fs::read_to_string(&path).expect("UTF-8"));
                }
            }
        }
    }
    let mut found = Sources::new();
    visit(Path::new("src"), &[], &mut found);
    found
}

/// The layers of `lib.rs`, from the top down: modules that stand on one line together.
fn layers(lib: &str) -> Vec<Vec<String>> {
    let mut layers = vec![Vec::new()];
    for line in lib.lines() {
        match line.strip_prefix("pub mod ").or(line.strip_prefix("mod ")).and_then(|rest| rest.strip_suffix(';')) {
            Some(module) => layers.last_mut().expect("never empty").push(module.to_string()),
            None if line.is_empty() => layers.push(Vec::new()),
            None => {}
        }
    }
    layers.retain(|layer| !layer.is_empty());
    layers
}

/// Code without comments, strings' contents left as they are, and without what only tests see.
fn code(text: &str) -> String {
    let text = text.split("\n#[cfg(test)]\nmod ").next().expect("split gives one piece at least");
    let kept = text.lines().map(|line| line.split("//").next().expect("one piece at least"));
    kept.collect::<Vec<_>>().join("\n")
}

/// Every path that a file names from the crate's root, or from its own module up: `use` lines, their groups taken
/// apart, and paths within the code.
fn imports(module: &[String], text: &str) -> BTreeSet<Vec<String>> {
    let code = code(text);
    let mut found = BTreeSet::new();
    let mut rest = code.as_str();
    while let Some(at) = ["crate::", "super::"].iter().filter_map(|root| rest.find(root)).min() {
        let starts_word = !rest[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':' || c == '$');
        let mut base: Vec<String> = if rest[at..].starts_with("crate::") { Vec::new() } else { parent(module) };
        let mut end = at + "crate::".len(); // as long as `super::`
        while rest[end..].starts_with("super::") {
            base = parent(&base);
            end += "super::".len();
        }
        if starts_word {
            paths(&base, &rest[end..], &mut found);
        }
        rest = &rest[end..];
    }
    found
}

fn parent(module: &[String]) -> Vec<String> {
    module[..module.len().saturating_sub(1)].to_vec()
}

/// Adds the paths that begin at `text`: `a::b`, `a::{b, c::d}`.
fn paths(base: &[String], text: &str, found: &mut BTreeSet<Vec<String>>) {
    let word = text.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(text.len());
    if word > 0 {
        let path = [base, &[text[..word].to_string()]].concat();
        match text[word..].strip_prefix("::") {
            Some(rest) if rest.starts_with(|c: char| c == '{' || c.is_alphabetic()) => paths(&path, rest, found),
            _ => _ = found.insert(path),
        }
    } else if let Some(group) = text.strip_prefix('{') {
        // The group's members, as far as its own closing brace.
        let (mut depth, mut start) = (1, 0);
        for (at, c) in group.char_indices() {
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                _ => {}
            }
            if (c == ',' && depth == 1) || depth == 0 {
                paths(base, group[start..at].trim(), found);
                start = at + 1;
            }
            if depth == 0 {
                break;
            }
        }
    }
}

/// What stands against the order of layers: `from -> to`.
fn upward(sources: &Sources, layers: &[Vec<String>]) -> Vec<String> {
    let floor = |module: &str| layers.iter().position(|layer| layer.iter().any(|m| m == module));
    let mut found = Vec::new();
    for (module, text) in sources.iter().filter(|(module, _)| !module.is_empty()) {
        let Some(from) = floor(&module[0]) else {
            found.push(format!("{} is not in lib.rs", module.join("::")));
            continue;
        };
        for import in imports(module, text).iter().filter(|import| import.first() != module.first()) {
            match import.first().map(|first| (first, floor(first))) {
                Some((_, Some(to))) if to > from => {}
                Some((_, Some(_))) => found.push(format!("{} -> {}", module.join("::"), import.join("::"))),
                _ => {}
            }
        }
    }
    found
}

/// Files that import each other in a circle. A folder's face (`mod.rs`) hands its files' names on, so what a file takes
/// from the face of its own folder counts as taken from where the face has it, as far as that is told by name.
fn circles(sources: &Sources) -> Vec<Vec<String>> {
    let file_of =
        |path: &[String]| (1..=path.len()).rev().map(|n| path[..n].to_vec()).find(|m| sources.contains_key(m));
    let mut arrows: BTreeMap<Vec<String>, BTreeSet<Vec<String>>> = BTreeMap::new();
    for (module, text) in sources {
        let taken = imports(module, text).iter().filter_map(|path| file_of(path)).collect::<BTreeSet<_>>();
        // Towards the faces above a file there is no arrow: they are its own house's door.
        let outward = taken.into_iter().filter(|to| !module.starts_with(to));
        arrows.insert(module.clone(), outward.collect());
    }
    let reaches = |from: &Vec<String>| {
        let (mut seen, mut open) = (BTreeSet::new(), vec![from.clone()]);
        while let Some(next) = open.pop() {
            for to in arrows.get(&next).into_iter().flatten() {
                if seen.insert(to.clone()) {
                    open.push(to.clone());
                }
            }
        }
        seen
    };
    let reach: BTreeMap<_, _> = sources.keys().map(|module| (module, reaches(module))).collect();
    let mut found = BTreeSet::new();
    for (module, reached) in &reach {
        if reached.contains(*module) {
            let ring = reached.iter().filter(|other| reach.get(other).is_some_and(|back| back.contains(*module)));
            found.insert(ring.map(|module| module.join("::")).collect::<Vec<_>>());
        }
    }
    found.into_iter().collect()
}

#[test]
fn imports_only_point_down() {
    let sources = sources();
    let layers = layers(&sources[&Vec::new()]);
    assert!(sources.len() > 100 && layers.len() > 8, "{} files, {} layers", sources.len(), layers.len());
    let found = upward(&sources, &layers);
    assert!(found.is_empty(), "imports that do not point down the list of lib.rs:\n{}", found.join("\n"));
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let found = circles(&sources());
    assert!(found.is_empty(), "circles:\n{}", found.iter().map(|c| c.join(", ")).collect::<Vec<_>>().join("\n"));
}

#[test]
fn an_import_turned_round_is_found() {
    let mut sources = sources();
    let layers = layers(&sources[&Vec::new()]);
    for line in
        ["use crate::cli::options::Size;", "use crate::{cli::options, scene::Scene};", "fn f() { crate::cli::run(); }"]
    {
        let sound = sources[&vec!["scene".to_string()]].clone();
        sources.insert(vec!["scene".into()], format!("{line}\n{sound}"));
        let found = upward(&sources, &layers);
        assert!(found.len() == 1 && found[0].starts_with("scene -> cli::"), "{line}: {found:?}");
        sources.insert(vec!["scene".into()], sound);
    }
    // What tests, comments and the own folder name is no import.
    let text = "// use crate::cli::A;\nuse super::check;\n#[cfg(test)]\nmod tests { use crate::cli::A; }\n";
    sources.insert(vec!["scene".into(), "parse".into()], text.into());
    assert!(upward(&sources, &layers).is_empty());
}

#[test]
fn a_circle_is_found() {
    let module = |name: &str| vec!["a".to_string(), name.to_string()];
    let face = "mod b;\nmod c;\npub use b::B;\n".to_string();
    let mut sources = Sources::from([
        (vec!["a".into()], face),
        (module("b"), "use super::c::C;\n".into()),
        (module("c"), "use super::B;\n".into()),
    ]);
    assert!(circles(&sources).is_empty());
    sources.insert(module("c"), "use crate::a::b::B;\n".into());
    assert_eq!(circles(&sources), [["a::b", "a::c"]]);
}
