//! Messages that the pages quote are those of the program.

use super::{pages, read, root};
use std::fs;
use std::path::Path;

fn sources(folder: &Path, all: &mut String) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => sources(&path, all),
            false => all.push_str(&read(&path)),
        }
    }
}

/// Without line ends, escapes and the strings' own continuations.
fn plain(text: &str) -> String {
    let text = text.replace("\\\"", "\"").replace("\\\n", " ");
    let text = text.replace("{{", "{").replace("}}", "}");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Rows of tables headed `| message |`: what stands between … is in the sources as written.
#[test]
fn quoted_messages_are_in_the_sources() {
    let mut all = String::new();
    sources(&root().join("src"), &mut all);
    let all = plain(&all);
    let mut checked = 0;
    for page in pages() {
        let text = read(&page);
        for table in text.split("| message |").skip(1) {
            let rows = table
                .lines()
                .skip(2)
                .take_while(|line| line.starts_with('|'));
            for row in rows.filter(|row| !row.contains("by the compiler")) {
                let message = row.split('`').nth(1).unwrap_or_default();
                for part in message
                    .split('…')
                    .map(str::trim)
                    .filter(|part| part.len() > 11)
                {
                    assert!(all.contains(&plain(part)), "{}: {part}", page.display());
                    checked += 1;
                }
            }
        }
    }
    assert!(checked > 30, "{checked}");
}

/// Every `module::Name` in a page is one of the sources: the module, and the name.
#[test]
fn names_of_the_code_are_there() {
    let mut all = String::new();
    sources(&root().join("src"), &mut all);
    let mut checked = 0;
    for page in pages() {
        for code in super::prose(&read(&page)).1 {
            let name = code.strip_prefix("truetwin::").unwrap_or(&code);
            let parts: Vec<&str> = name.split("::").collect();
            let word = |part: &&str| {
                !part.is_empty() && part.chars().all(|c| c.is_alphanumeric() || c == '_')
            };
            if parts.len() < 2 || !parts.iter().all(word) {
                continue;
            }
            let last = parts[parts.len() - 1];
            let kinds = [
                "fn", "struct", "enum", "trait", "mod", "type", "const", "pub",
            ];
            let declared = kinds
                .iter()
                .any(|kind| all.contains(&format!("{kind} {last}")));
            let variant =
                all.contains(&format!("    {last},")) || all.contains(&format!("    {last} {{"));
            let exported = all.contains(&format!("{last},")) || all.contains(&format!("{last}}}"));
            let module = parts[0].chars().next().unwrap().is_uppercase()
                || root().join("src").join(parts[0]).exists()
                || root().join(format!("src/{}.rs", parts[0])).exists();
            assert!(
                module && (declared || variant || exported),
                "{}: {code}",
                page.display()
            );
            checked += 1;
        }
    }
    assert!(checked > 40, "{checked}");
}
