//! The public items of the library, as `docs/public-api.txt` lists them. A change of the list is a change that users see.

use crate::source::{Crate, Module, child, root};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;

const LIST: &str = "docs/public-api.txt";
const RENEW: &str = "UPDATE_PUBLIC_API";

const HEAD: &str = "\
# Public items of the library: path, kind. A second path of an item is listed as an alias.
# tests/house/public_api.rs compares this list with the source. To renew it:
#   UPDATE_PUBLIC_API=1 cargo test --test house public_api
";

impl Crate {
    /// The item that its parent imports under the name of a module that is not public: `use a::pretrain` is the function.
    fn item_beside(&self, module: &[String]) -> Option<(Module, Vec<String>)> {
        let (name, parent) = module.split_last()?;
        let source = &self.sources[parent];
        let shown = source.children.get(name).is_some_and(|shown| *shown);
        let mut imports = source
            .imports
            .iter()
            .filter(|import| !shown && import.name == *name);
        self.resolve(parent, &imports.next()?.path)
    }

    /// Public items, as (module that declares it, name), with every path from the root by `pub mod` and `pub use`.
    pub fn public_items(&self) -> BTreeMap<(Module, String), BTreeSet<Vec<String>>> {
        let mut items: BTreeMap<_, BTreeSet<_>> = BTreeMap::new();
        let mut open = vec![(Module::new(), Vec::new())];
        let mut seen = BTreeSet::new();
        while let Some((module, path)) = open.pop() {
            if !seen.insert((module.clone(), path.clone())) {
                continue;
            }
            let source = &self.sources[&module];
            for name in source.items.keys() {
                let item = (module.clone(), name.clone());
                items.entry(item).or_default().insert(child(&path, name));
            }
            let children = source.children.iter().filter(|(_, shown)| **shown);
            open.extend(children.map(|(name, _)| (child(&module, name), child(&path, name))));
            for import in source.imports.iter().filter(|import| import.public) {
                let glob = import.path.last().is_some_and(|last| last == "*");
                let from = &import.path[..import.path.len() - usize::from(glob)];
                let mut resolved = self.resolve(&module, from);
                if let Some((target, rest)) = &resolved
                    && !glob
                    && rest.is_empty()
                    && let Some(item) = self.item_beside(target)
                {
                    resolved = Some(item);
                }
                match resolved {
                    Some((target, rest)) if rest.is_empty() => {
                        let name = (!glob).then_some(&import.name);
                        open.push((target, path.iter().chain(name).cloned().collect()));
                    }
                    Some((target, rest)) if self.sources[&target].items.contains_key(&rest[0]) => {
                        let item = (target, rest[0].clone());
                        let paths = items.entry(item).or_default();
                        paths.insert(child(&path, &import.name));
                    }
                    _ => {}
                }
            }
        }
        items
    }
}

/// A line for each path of each public item: its kind at the shortest path, that path at the others.
fn listed(sources: &Crate) -> BTreeSet<String> {
    let mut lines = BTreeSet::new();
    for ((module, name), paths) in sources.public_items() {
        let home = (paths.iter())
            .min_by_key(|path| (path[0] == "prelude", path.len(), *path))
            .expect("a public item has a path");
        for path in &paths {
            let kind = match path == home {
                true => sources.sources[&module].items[&name].clone(),
                false => format!("alias of {}", home.join("::")),
            };
            lines.insert(format!("{}  {kind}", path.join("::")));
        }
    }
    lines
}

/// Lines that came (+) and went (-); empty if the lists are equal.
fn difference(old: &BTreeSet<String>, new: &BTreeSet<String>) -> Vec<String> {
    let gone = old.difference(new).map(|line| format!("- {line}"));
    let come = new.difference(old).map(|line| format!("+ {line}"));
    gone.chain(come).collect()
}

fn lines(text: &str) -> BTreeSet<String> {
    let items = text.lines().filter(|line| !line.starts_with('#'));
    items.map(str::to_owned).collect()
}

#[test]
fn the_public_api_is_listed() {
    let new = listed(&Crate::read());
    let path = root().join(LIST);
    let body: String = new.iter().map(|line| format!("{line}\n")).collect();
    let whole = format!("{HEAD}{body}");
    if std::env::var_os(RENEW).is_some_and(|value| value == "1") {
        fs::write(&path, &whole).unwrap();
        return;
    }
    let text = fs::read_to_string(&path).unwrap_or_default();
    let changed = difference(&lines(&text), &new);
    assert!(
        changed.is_empty(),
        "public items differ from {LIST}:\n{}\nIf this is meant, renew the list: {RENEW}=1 cargo test --test house public_api",
        changed.join("\n")
    );
    assert_eq!(
        text, whole,
        "{LIST}: only the head or the order differs; renew the list with {RENEW}=1"
    );
}

#[test]
fn a_changed_item_is_seen() {
    let new = listed(&Crate::read());
    assert!(new.contains("record::Record  struct"), "{new:#?}");
    assert!(new.contains("prelude::Record  alias of record::Record"));
    assert!(new.contains("twin::StateSpace  trait"));
    assert!(new.contains("diagnose::diagnose  fn"));
    assert!(!new.iter().any(|line| line.contains("fuzzing")), "hidden");
    let mut old = new.clone();
    old.remove("record::Record  struct");
    old.insert("record::Measured  struct".into());
    assert_eq!(
        difference(&old, &new),
        ["- record::Measured  struct", "+ record::Record  struct"]
    );
}
