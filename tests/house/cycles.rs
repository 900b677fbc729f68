//! No import cycle inside a room: the files and folders of a folder have an order, too.

use crate::source::{Crate, Module, Source, child};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

type Graph = BTreeMap<String, BTreeSet<String>>;

/// For each folder, which of its files and folders use which others. The folder's own `mod.rs` is above them all: it may use
/// each, and each may use the types that stand in it.
fn graphs(sources: &Crate) -> BTreeMap<Module, Graph> {
    let mut graphs: BTreeMap<Module, Graph> = BTreeMap::new();
    for module in sources.sources.keys() {
        for used in sources.uses(module) {
            let shared = module.iter().zip(&used).take_while(|(a, b)| a == b).count();
            if shared < module.len().min(used.len()) {
                let folder = graphs.entry(module[..shared].to_vec()).or_default();
                let edges = folder.entry(module[shared].clone()).or_default();
                edges.insert(used[shared].clone());
            }
        }
    }
    graphs
}

/// Names that lie on a cycle.
fn cycle(graph: &Graph) -> Vec<String> {
    let mut left = graph.clone();
    loop {
        let ends: Vec<String> = (left.iter())
            .filter(|(_, used)| !used.iter().any(|name| left.contains_key(name)))
            .map(|(name, _)| name.clone())
            .collect();
        if ends.is_empty() {
            break;
        }
        ends.iter().for_each(|name| drop(left.remove(name)));
    }
    // What only leads to a cycle is not on it.
    let reaches = |from: &String| {
        let (mut open, mut seen) = (vec![from], BTreeSet::new());
        while let Some(name) = open.pop() {
            for used in left.get(name).into_iter().flatten() {
                if used == from {
                    return true;
                }
                if seen.insert(used) {
                    open.push(used);
                }
            }
        }
        false
    };
    left.keys().filter(|name| reaches(name)).cloned().collect()
}

/// Cycles of the crate, one line a folder; the root's are those of rooms.
pub fn cycles(sources: &Crate) -> Vec<String> {
    (graphs(sources).iter())
        .filter_map(|(folder, graph)| {
            let names = cycle(graph);
            (!names.is_empty()).then(|| {
                let edges: Vec<String> = (names.iter())
                    .map(|name| {
                        let used = graph[name].iter().filter(|used| names.contains(used));
                        let used: Vec<&str> = used.map(String::as_str).collect();
                        format!("{name} -> {}", used.join(" "))
                    })
                    .collect();
                format!("src/{}: {}", folder.join("/"), edges.join(", "))
            })
        })
        .collect()
}

#[test]
fn a_cycle_is_seen_through_imports_and_reexports() {
    let sources = [
        ("", "pub mod a;"),
        ("a", "mod b; mod c; mod d; pub use b::B; pub struct Shared;"),
        ("a/b", "use super::{Shared, c::{C as D}};\npub struct B;"),
        (
            "a/c",
            "// use super::d\nfn f(_: super::B) { \"super::d::D\"; }\n#[cfg(test)]\nmod tests { use super::super::d::D; }",
        ),
        ("a/d", "mod inner { fn f() { super::super::c::f(); } }"),
    ];
    let sources = sources.map(|(path, text)| {
        let module: Module = path
            .split('/')
            .filter(|p| !p.is_empty())
            .map(Into::into)
            .collect();
        (module, Source::parse(PathBuf::from(path), text.into()))
    });
    let sources = Crate {
        sources: sources.into(),
    };
    assert_eq!(cycles(&sources), ["src/a: b -> c, c -> b"]);
    let d = child(&["a".to_owned()], "d");
    assert_eq!(sources.uses(&d).len(), 1, "{:?}", sources.uses(&d));
    let items = sources.public_items();
    let names: Vec<&str> = items.keys().map(|(_, name)| name.as_str()).collect();
    assert_eq!(names, ["Shared", "B"]);
}
