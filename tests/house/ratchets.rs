//! Counts that must not grow: `cargo test --test house ratchets -- --nocapture` prints them. Lower a limit when its count falls.

use crate::cycles::cycles;
use crate::source::Crate;
use std::collections::BTreeMap;

/// A count, the places that it counts, and what it may be.
struct Ratchet {
    name: &'static str,
    places: Vec<String>,
    most: usize,
}

impl Ratchet {
    fn new(name: &'static str, most: usize, places: Vec<String>) -> Self {
        Self { name, places, most }
    }
}

/// Places of `needle` in the code of files that `asked` picks; code has a space between tokens.
fn uses(sources: &Crate, needle: &str, asked: impl Fn(&str) -> bool) -> Vec<String> {
    let mut places = Vec::new();
    for source in sources.sources.values() {
        let file = source.file.to_str().unwrap();
        if asked(file) {
            let count = source.code.matches(needle).count();
            places.extend(std::iter::repeat_n(file.to_owned(), count));
        }
    }
    places
}

/// Doc comments that do not start with what the item is or does.
fn odd_first_words(sources: &Crate) -> Vec<String> {
    let mut places = Vec::new();
    for source in sources.sources.values() {
        let mut before = "";
        for (line, number) in source.text.lines().zip(1..) {
            let line = line.trim_start();
            let is_doc = |line: &str| line.starts_with("///") || line.starts_with("//!");
            if is_doc(line) && !is_doc(before) {
                let word = line[3..].split_whitespace().next().unwrap_or_default();
                let word = word.trim_end_matches([',', '.']);
                if ["Of", "And", "What", "Whether", "Who", "How"].contains(&word) {
                    places.push(format!("{}:{number}", source.file.display()));
                }
            }
            before = line;
        }
    }
    places
}

/// Places outside `twin` and `likelihood` that ask a twin for its equations.
fn questions(sources: &Crate) -> Vec<String> {
    let outside = |file: &str| !file.starts_with("twin/") && !file.starts_with("likelihood/");
    let of = |needle| uses(sources, needle, outside);
    let handles = [of("Twin :: Equations"), of("Twin :: BlackBox")];
    // A handle that is made asks nothing.
    let made = [
        of("Twin :: Equations ( Arc :: new"),
        of("Twin :: BlackBox ( Arc :: new"),
    ];
    let mut arms: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
    for (arm, (places, made)) in handles.iter().zip(&made).enumerate() {
        for file in places {
            arms.entry(file).or_default()[arm] += 1;
        }
        for file in made {
            arms.entry(file).or_default()[arm] -= 1;
        }
    }
    let mut places = [of(". state_space ("), of(". equations (")].concat();
    for (file, counts) in arms {
        let most = counts[0].max(counts[1]);
        places.extend(std::iter::repeat_n(file.to_owned(), most));
    }
    places
}

/// Places that take a target, a start or a noise level out of a string: one place should parse a name.
fn identities(sources: &Crate) -> Vec<String> {
    let mut places = uses(sources, "( '@'", |_| true);
    for source in sources.sources.values() {
        let count = ["(\"start.\")", "(\"noise.\")", "(\"@\")"]
            .map(|part| source.text.matches(part).count());
        let file = source.file.display().to_string();
        places.extend(std::iter::repeat_n(file, count.iter().sum()));
    }
    places
}

/// Folders with more files than can be taken in at once; the command line has one a verb.
fn crowded(sources: &Crate, most: usize) -> Vec<String> {
    let mut folders: BTreeMap<String, usize> = BTreeMap::new();
    for source in sources.sources.values() {
        let folder = source.file.parent().unwrap().display().to_string();
        *folders.entry(folder).or_default() += 1;
    }
    (folders.into_iter())
        .filter(|(folder, files)| folder != "cli" && *files > most)
        .map(|(folder, files)| format!("{folder}: {files}"))
        .collect()
}

fn ratchets(sources: &Crate) -> Vec<Ratchet> {
    let items = sources.public_items();
    let items = items.keys().map(|(m, n)| format!("{}::{n}", m.join("::")));
    let errors = (sources.sources.values())
        .flat_map(|source| {
            let derives = source.code.split("# [ derive (").skip(1);
            let count = derives
                .filter(|d| {
                    d.split(')')
                        .next()
                        .unwrap()
                        .split(' ')
                        .any(|w| w == "Error")
                })
                .count();
            std::iter::repeat_n(source.file.display().to_string(), count)
        })
        .collect();
    let lines = (sources.sources.values())
        .flat_map(|source| {
            let file = source.file.display().to_string();
            std::iter::repeat_n(file, source.text.lines().count())
        })
        .collect();
    vec![
        Ratchet::new("public items", 148, items.collect()),
        Ratchet::new("error types", 13, errors),
        Ratchet::new("lines of src, files of tests apart", 74_800, lines),
        Ratchet::new("folders with more than 18 files", 0, crowded(sources, 18)),
        Ratchet::new("questions for equations", 8, questions(sources)),
        Ratchet::new(
            "doc comments of odd first words",
            0,
            odd_first_words(sources),
        ),
        Ratchet::new("identities taken from strings", 5, identities(sources)),
        Ratchet::new("import cycles inside a folder", 0, cycles(sources)),
    ]
}

#[test]
fn counts_do_not_grow() {
    let sources = Crate::read();
    let mut grown = Vec::new();
    for Ratchet { name, places, most } in ratchets(&sources) {
        println!("{name}: {} of at most {most}", places.len());
        if std::env::var_os("TRUETWIN_PLACES").is_some() {
            places.iter().for_each(|place| println!("  {place}"));
        }
        if places.len() > most {
            let mut files = places.clone();
            files.dedup();
            let files = match files.len() {
                0..=20 => files.join(", "),
                many => format!("in {many} files; TRUETWIN_PLACES=1 lists them"),
            };
            grown.push(format!("{name}: {} > {most}: {files}", places.len()));
        }
    }
    assert!(grown.is_empty(), "{}", grown.join("\n"));
}
