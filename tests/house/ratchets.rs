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

/// Lines of code with their files: not blank, no comment, no test.
fn code_lines(sources: &Crate) -> impl Iterator<Item = (String, &str)> {
    sources.sources.values().flat_map(|source| {
        let file = source.file.display().to_string();
        (source.text.lines().map(str::trim))
            .take_while(|line| !line.starts_with("#[cfg(test)]"))
            .filter(|line| !line.is_empty() && !line.starts_with("//"))
            .map(move |line| (file.clone(), line))
    })
}

/// Tables of a study file, as messages write them.
const TABLES: [&str; 9] = [
    "[noise]",
    "[bounds]",
    "[prior]",
    "[fixed]",
    "[record]",
    "[library]",
    "[start]",
    "[limits]",
    "[[effect]]",
];

/// Messages outside the command line that name one of its options or verbs, or a table of the study file.
fn foreign_words(sources: &Crate) -> Vec<String> {
    let names = |line: &str| {
        let text = line.split_once('"').map_or("", |(_, text)| text);
        let option = (text.match_indices("--"))
            .any(|(at, _)| text[at + 2..].starts_with(|c: char| c.is_ascii_lowercase()));
        option || text.contains("`truetwin ") || TABLES.iter().any(|table| text.contains(table))
    };
    (code_lines(sources))
        .filter(|(file, line)| !file.starts_with("cli/") && names(line))
        .map(|(file, _)| file)
        .collect()
}

/// Items that the documentation hides.
fn hidden(sources: &Crate) -> Vec<String> {
    let lines = code_lines(sources).filter(|(_, line)| line.contains("#[doc(hidden)]"));
    lines.map(|(file, _)| file).collect()
}

/// Methods of the trait that a user's twin implements.
fn methods_of_state_space(sources: &Crate) -> Vec<String> {
    let trait_of = |code: &str| {
        let (_, body) = code.split_once("pub trait StateSpace")?;
        let mut depth = 0;
        let words = body.split(' ').skip_while(|word| *word != "{");
        let body = words.take_while(move |word| {
            depth += i32::from(*word == "{") - i32::from(*word == "}");
            depth > 0
        });
        Some(body.map(str::to_owned).collect::<Vec<_>>())
    };
    let body = sources
        .sources
        .values()
        .find_map(|source| trait_of(&source.code));
    let body = body.expect("the trait");
    let pairs = body.windows(2).filter(|pair| pair[0] == "fn");
    pairs.map(|pair| pair[1].clone()).collect()
}

/// Named constants that are numbers.
fn constants(sources: &Crate) -> Vec<String> {
    let is_number = |kind: &str| {
        let digits = kind.strip_prefix(['f', 'i', 'u']).unwrap_or("?");
        digits == "size" || digits.parse::<u8>().is_ok()
    };
    let mut places = Vec::new();
    for source in sources.sources.values() {
        let words: Vec<&str> = source.code.split(' ').collect();
        // A number in angle brackets is a parameter of a type.
        let constants = words.windows(5).filter(|words| {
            let is_parameter = ["<", ","].contains(&words[0]);
            words[1] == "const" && words[3] == ":" && is_number(words[4]) && !is_parameter
        });
        places.extend(constants.map(|words| format!("{} {}", source.file.display(), words[2])));
    }
    places
}

/// Functions with `most` or more parameters.
fn wide_functions(sources: &Crate, least: usize) -> Vec<String> {
    let mut places = Vec::new();
    for source in sources.sources.values() {
        let words: Vec<&str> = source.code.split(' ').collect();
        for (at, _) in words.iter().enumerate().filter(|(_, word)| **word == "fn") {
            let (mut round, mut angle, mut count) = (0, 0, 0);
            for pair in words[at..].windows(2) {
                match pair[0] {
                    "(" => round += 1,
                    ")" => round -= 1,
                    "<" => angle += 1,
                    ">" => angle -= i32::from(angle > 0),
                    ":" if round == 1 && angle == 0 => count += 1,
                    "{" | ";" => break,
                    _ => {}
                }
                if round == 0 && pair[0] == ")" {
                    break;
                }
            }
            if count >= least {
                places.push(format!("{} {}", source.file.display(), words[at + 1]));
            }
        }
    }
    places
}

/// Functions of more than `most` lines, as rustfmt writes them.
fn long_functions(sources: &Crate, most: usize) -> Vec<String> {
    let mut places = Vec::new();
    for source in sources.sources.values() {
        let lines: Vec<&str> = (source.text.lines())
            .take_while(|line| !line.starts_with("#[cfg(test)]"))
            .collect();
        for (at, line) in lines.iter().enumerate() {
            let text = line.trim_start();
            let word = |word: &str| text.starts_with(word) || text.contains(&format!(" {word}"));
            if !word("fn ") || text.starts_with("//") || !text.contains('(') {
                continue;
            }
            let end = format!("{}}}", " ".repeat(line.len() - text.len()));
            let length = lines[at..].iter().position(|line| *line == end);
            if length.is_some_and(|length| length + 1 > most) {
                places.push(format!("{}:{}", source.file.display(), at + 1));
            }
        }
    }
    places
}

/// Names of types that stand more than once in the crate, once for each further place.
fn repeated_types(sources: &Crate) -> Vec<String> {
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    for source in sources.sources.values() {
        let words: Vec<&str> = source.code.split(' ').collect();
        for pair in words.windows(2) {
            let is_type = ["struct", "enum", "trait"].contains(&pair[0]);
            if is_type && pair[1].starts_with(char::is_uppercase) {
                *seen.entry(pair[1]).or_default() += 1;
            }
        }
    }
    (seen.into_iter())
        .flat_map(|(name, count)| std::iter::repeat_n(name.to_owned(), count - 1))
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
    let lines = code_lines(sources).map(|(file, _)| file).collect();
    let files = sources.sources.values();
    let files = files.map(|source| source.file.display().to_string());
    vec![
        Ratchet::new("public items", 164, items.collect()),
        Ratchet::new("error types", 14, errors),
        Ratchet::new("lines of code", 67_899, lines),
        Ratchet::new("files", 515, files.collect()),
        Ratchet::new("hidden items", 2, hidden(sources)),
        Ratchet::new("methods of StateSpace", 15, methods_of_state_space(sources)),
        Ratchet::new("named numeric constants", 273, constants(sources)),
        Ratchet::new(
            "functions of 6 or more parameters",
            3,
            wide_functions(sources, 6),
        ),
        Ratchet::new(
            "functions of more than 100 lines",
            1,
            long_functions(sources, 100),
        ),
        Ratchet::new("further types of one name", 23, repeated_types(sources)),
        Ratchet::new(
            "library messages with words of the command line",
            1,
            foreign_words(sources),
        ),
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
