//! The sources as tokens: modules, what each imports, names in paths and declares. Enough to draw a graph of files; no compiler.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Names of a module, from the crate's root: `["record", "csv"]`.
pub type Module = Vec<String>;

/// An item brought into a module by `use`.
#[derive(Debug)]
pub struct Import {
    /// Segments as written; `*` is last in a glob.
    pub path: Vec<String>,
    pub name: String,
    pub public: bool,
}

/// One source file.
#[derive(Debug, Default)]
pub struct Source {
    /// Path below `src/`.
    pub file: PathBuf,
    pub text: String,
    /// Text without comments, strings and tests.
    pub code: String,
    pub imports: Vec<Import>,
    /// Paths in code that start with `crate`, `super` or `self`; those of an inline module are taken from the file.
    pub paths: Vec<Vec<String>>,
    /// `mod x;`, and whether it is public and shown.
    pub children: BTreeMap<String, bool>,
    /// Items declared `pub` at the file's root and shown, with their kinds: `fn`, `struct`.
    pub items: BTreeMap<String, String>,
}

/// All files of `src/` by module. Files of tests are left out.
pub fn sources() -> BTreeMap<Module, Source> {
    let root = root().join("src");
    let mut all = BTreeMap::new();
    read(&root, &root, &mut all);
    let tests: Vec<Module> = all
        .iter()
        .flat_map(|(module, source): (&Module, &Source)| {
            tests_of(&tokens(&source.text))
                .into_iter()
                .map(|name| child(module, &name))
        })
        .collect();
    all.retain(|module, _| !tests.iter().any(|test| module.starts_with(test)));
    assert!(all.len() > 100, "only {} files were found", all.len());
    all
}

pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(folder: &Path, root: &Path, all: &mut BTreeMap<Module, Source>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            read(&path, root, all);
        } else if path.extension().is_some_and(|e| e == "rs") {
            let file = path.strip_prefix(root).unwrap().to_owned();
            let mut module: Module = (file.with_extension("").components())
                .map(|part| part.as_os_str().to_str().unwrap().to_owned())
                .collect();
            if ["mod", "lib"].contains(&module.last().unwrap().as_str()) {
                module.pop();
            }
            if module != ["main"] && module != ["book"] {
                all.insert(
                    module,
                    Source::parse(file, fs::read_to_string(&path).unwrap()),
                );
            }
        }
    }
}

pub fn child(module: &[String], name: &str) -> Module {
    [module, &[name.to_owned()]].concat()
}

impl Source {
    pub fn parse(file: PathBuf, text: String) -> Self {
        let tokens = without_tests(tokens(&text));
        let mut source = Self {
            file,
            code: tokens.join(" "),
            ..Self::default()
        };
        source.read_tokens(&tokens);
        source.text = text;
        source
    }

    fn read_tokens(&mut self, tokens: &[String]) {
        // Braces that are open; true for those of an inline module.
        let mut open: Vec<bool> = Vec::new();
        let (mut hidden, mut at) = (false, 0);
        while at < tokens.len() {
            let is = |ahead: usize, text: &str| tokens.get(at + ahead).is_some_and(|t| t == text);
            let inline = open.iter().filter(|module| **module).count();
            match tokens[at].as_str() {
                "#" if is(1, "[") => {
                    let end = closing(tokens, at + 1);
                    hidden |= tokens[at..end].join("") == "#[doc(hidden)";
                    at = end;
                }
                "{" => open.push(at >= 2 && tokens[at - 2] == "mod"),
                "}" => drop(open.pop()),
                "use" => {
                    let end = at + tokens[at..].iter().position(|t| t == ";").unwrap();
                    let public = at > 0 && tokens[at - 1] == "pub" && open.is_empty();
                    let mut paths = Vec::new();
                    use_tree(&tokens[at + 1..end], &mut Vec::new(), &mut paths);
                    for (path, name) in paths {
                        if let Some(path) = from_file(path, inline) {
                            self.imports.push(Import { path, name, public });
                        }
                    }
                    at = end;
                    hidden = false;
                }
                "mod" if is(2, ";") => {
                    let shown = at > 0 && tokens[at - 1] == "pub" && !hidden;
                    self.children.insert(tokens[at + 1].clone(), shown);
                    hidden = false;
                }
                "crate" | "super" | "self" if is(1, "::") => {
                    let mut path = vec![tokens[at].clone()];
                    let more = tokens[at + 1..].chunks(2);
                    let more = more
                        .take_while(|pair| pair.len() == 2 && pair[0] == "::" && is_word(&pair[1]));
                    path.extend(more.map(|pair| pair[1].clone()));
                    at += 2 * (path.len() - 1);
                    self.paths.extend(from_file(path, inline));
                }
                "pub" if open.is_empty() && !is(1, "(") => {
                    let item = (tokens[at + 1..].iter())
                        .skip_while(|t| ["const", "unsafe", "async"].contains(&t.as_str()))
                        .take(2)
                        .collect::<Vec<_>>();
                    let kinds = ["fn", "struct", "enum", "trait", "type", "static"];
                    let constant = is(1, "const") && !kinds.contains(&item[0].as_str());
                    if constant && !hidden {
                        self.items.insert(tokens[at + 2].clone(), "const".into());
                    } else if kinds.contains(&item[0].as_str()) && !hidden {
                        self.items.insert(item[1].clone(), item[0].clone());
                    }
                    if !is(1, "mod") && !is(1, "use") {
                        hidden = false;
                    }
                }
                "fn" | "struct" | "enum" | "trait" | "impl" => hidden = false,
                _ => {}
            }
            at += 1;
        }
    }
}

/// A path of an inline module as its file would write it: one `super` less for each module between.
fn from_file(mut path: Vec<String>, inline: usize) -> Option<Vec<String>> {
    for _ in 0..inline {
        match path.first()?.as_str() {
            "super" => drop(path.remove(0)),
            "crate" => {}
            _ => return None,
        }
    }
    if inline > 0 && path.first().is_none_or(|p| p != "crate" && p != "super") {
        path.insert(0, "self".into());
    }
    Some(path)
}

fn is_word(token: &str) -> bool {
    token.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// The index of the bracket that closes the one at `open`.
fn closing(tokens: &[String], open: usize) -> usize {
    let mut depth = 0;
    for (at, token) in tokens.iter().enumerate().skip(open) {
        match token.as_str() {
            "[" | "{" | "(" => depth += 1,
            "]" | "}" | ")" => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return at;
        }
    }
    tokens.len() - 1
}

/// Paths of a `use`, with the names that they get.
fn use_tree(tokens: &[String], prefix: &mut Vec<String>, paths: &mut Vec<(Vec<String>, String)>) {
    let depth = prefix.len();
    let mut at = 0;
    while at < tokens.len() {
        match tokens[at].as_str() {
            "::" => {}
            "," => prefix.truncate(depth),
            "{" => {
                let end = closing(tokens, at);
                use_tree(&tokens[at + 1..end], prefix, paths);
                prefix.truncate(depth);
                at = end;
            }
            "as" => {
                if let Some((_, name)) = paths.last_mut() {
                    *name = tokens[at + 1].clone();
                }
                at += 1;
            }
            word => {
                prefix.push(word.to_owned());
                if tokens.get(at + 1).is_none_or(|next| next != "::") {
                    let mut path = prefix.clone();
                    if word == "self" && path.len() > 1 {
                        path.pop();
                    }
                    let name = path.last().unwrap().clone();
                    paths.push((path, name));
                }
            }
        }
        at += 1;
    }
    prefix.truncate(depth);
}

/// The end of the item that starts at `at`: its `;` or closing brace.
fn item_end(tokens: &[String], mut at: usize) -> usize {
    while at < tokens.len() {
        match tokens[at].as_str() {
            ";" => return at,
            "{" => return closing(tokens, at),
            "(" | "[" => at = closing(tokens, at),
            _ => {}
        }
        at += 1;
    }
    tokens.len() - 1
}

const TEST: &str = "#[cfg(test)";

fn is_test(tokens: &[String], at: usize) -> bool {
    tokens[at] == "#" && tokens[at..(at + 6).min(tokens.len())].concat() == TEST
}

/// Names of modules that are compiled for tests alone.
fn tests_of(tokens: &[String]) -> Vec<String> {
    let mut names = Vec::new();
    for at in (0..tokens.len()).filter(|at| is_test(tokens, *at)) {
        let end = item_end(tokens, at + 7);
        let item = &tokens[at + 7..end];
        if tokens[end] == ";"
            && let Some(name) = item.iter().position(|t| t == "mod")
        {
            names.push(item[name + 1].clone());
        }
    }
    names
}

fn without_tests(tokens: Vec<String>) -> Vec<String> {
    let (mut kept, mut at) = (Vec::new(), 0);
    while at < tokens.len() {
        if is_test(&tokens, at) {
            at = item_end(&tokens, at + 7) + 1;
        } else {
            kept.push(tokens[at].clone());
            at += 1;
        }
    }
    kept
}

/// Words, `::` and single signs; comments are left out, strings are empty.
fn tokens(text: &str) -> Vec<String> {
    let text: Vec<char> = text.chars().collect();
    let at_is = |at: usize, c: char| text.get(at) == Some(&c);
    let word = |c: char| c.is_alphanumeric() || c == '_';
    let (mut tokens, mut at) = (Vec::new(), 0);
    while at < text.len() {
        let c = text[at];
        if c == '/' && at_is(at + 1, '/') {
            while at < text.len() && text[at] != '\n' {
                at += 1;
            }
        } else if c == '"' {
            tokens.push("\"\"".into());
            at += 1;
            while at < text.len() && text[at] != '"' {
                at += if text[at] == '\\' { 2 } else { 1 };
            }
            at += 1;
        } else if c == 'r' && (at_is(at + 1, '"') || at_is(at + 1, '#') && !at_is(at + 2, ' ')) {
            let hashes = text[at + 1..].iter().take_while(|c| **c == '#').count();
            if !at_is(at + 1 + hashes, '"') {
                at += 1 + hashes; // a raw identifier
                continue;
            }
            tokens.push("\"\"".into());
            at += hashes + 2;
            let end = |at: usize| text[at] == '"' && (1..=hashes).all(|k| at_is(at + k, '#'));
            while at < text.len() && !end(at) {
                at += 1;
            }
            at += hashes + 1;
        } else if c == '\'' && (at_is(at + 1, '\\') || at_is(at + 2, '\'')) {
            let start = if at_is(at + 1, '\\') { at + 3 } else { at + 2 };
            let end = start + text[start..].iter().position(|c| *c == '\'').unwrap() + 1;
            tokens.push(text[at..end].iter().collect());
            at = end;
        } else if word(c) {
            let end = at + text[at..].iter().take_while(|c| word(**c)).count();
            tokens.push(text[at..end].iter().collect());
            at = end;
        } else if c == ':' && at_is(at + 1, ':') {
            tokens.push("::".into());
            at += 2;
        } else {
            if !c.is_whitespace() {
                tokens.push(c.into());
            }
            at += 1;
        }
    }
    tokens
}

/// Sources and what their paths lead to.
#[derive(Debug)]
pub struct Crate {
    pub sources: BTreeMap<Module, Source>,
}

impl Crate {
    pub fn read() -> Self {
        Self { sources: sources() }
    }

    /// The module that declares what a path of `from` leads to, and the rest of the path; `None` outside the crate.
    pub fn resolve(&self, from: &[String], path: &[String]) -> Option<(Module, Vec<String>)> {
        self.resolved(from, path, 0)
    }

    fn resolved(
        &self,
        from: &[String],
        path: &[String],
        depth: u8,
    ) -> Option<(Module, Vec<String>)> {
        let (mut module, mut rest) = match path.first()?.as_str() {
            "crate" => (Vec::new(), &path[1..]),
            "self" => (from.to_vec(), &path[1..]),
            "super" => (from[..from.len().checked_sub(1)?].to_vec(), &path[1..]),
            name if self.sources.contains_key(&child(from, name)) => (from.to_vec(), path),
            _ => return None,
        };
        while rest.first().is_some_and(|name| name == "super") {
            module.pop()?;
            rest = &rest[1..];
        }
        while let Some(name) = rest.first() {
            let below = child(&module, name);
            if self.sources.contains_key(&below) {
                (module, rest) = (below, &rest[1..]);
                continue;
            }
            let source = self.sources.get(&module)?;
            let import = (source.imports.iter())
                .find(|i| i.name == *name && i.path.last().is_none_or(|l| l != "*"));
            return match import {
                Some(import) if depth < 9 => {
                    let path = [&import.path, &rest[1..]].concat();
                    (self.resolved(&module, &path, depth + 1)).or(Some((module, rest.to_vec())))
                }
                _ => Some((module, rest.to_vec())),
            };
        }
        Some((module, Vec::new()))
    }

    /// Modules that a module's code names.
    pub fn uses(&self, module: &[String]) -> BTreeSet<Module> {
        let source = &self.sources[module];
        let imports = source.imports.iter().map(|import| &import.path);
        (imports.chain(&source.paths))
            .filter_map(|path| Some(self.resolve(module, path)?.0))
            .filter(|used| used != module)
            .collect()
    }
}
