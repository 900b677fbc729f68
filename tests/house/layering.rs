//! Rooms depend downward only, in the order of `src/lib.rs`; a large library is named in one room.

use crate::source::Crate;
use std::collections::BTreeMap;

/// The rooms of docs/architecture.md, lowest first.
const ROOMS: [&str; 23] = [
    "setting",
    "math",
    "parallel",
    "progress",
    "storage",
    "record",
    "twin",
    "twins",
    "equations",
    "effect",
    "likelihood",
    "fit",
    "feature",
    "network",
    "hypothesis",
    "study",
    "external",
    "estimator",
    "diagnose",
    "evaluate",
    "report",
    "cli",
    "prelude",
];

#[test]
fn rooms_depend_downward_only() {
    let sources = Crate::read();
    let order: BTreeMap<&str, usize> = ROOMS.into_iter().zip(0..).collect();
    let (mut wrong, mut checked) = (Vec::new(), 0);
    for (module, source) in sources.sources.iter().filter(|(m, _)| !m.is_empty()) {
        let room = |name: &str| {
            *(order.get(name)).unwrap_or_else(|| panic!("{name} is no room: {:?}", source.file))
        };
        for used in sources.uses(module).iter().filter(|used| !used.is_empty()) {
            checked += 1;
            if room(&used[0]) > room(&module[0]) {
                wrong.push(format!(
                    "{} uses {}",
                    source.file.display(),
                    used.join("::")
                ));
            }
        }
    }
    assert!(checked > 500, "only {checked} uses were seen");
    assert!(wrong.is_empty(), "upward:\n{}", wrong.join("\n"));
}

/// The order of `src/lib.rs` is that of this test.
#[test]
fn the_library_lists_its_rooms_in_order() {
    let text = std::fs::read_to_string(crate::source::root().join("src/lib.rs")).unwrap();
    let listed: Vec<&str> = (text.lines())
        .filter_map(|line| line.trim_start_matches("pub ").strip_prefix("mod "))
        .filter_map(|line| line.strip_suffix(';'))
        .filter(|name| *name != "book")
        .collect();
    assert_eq!(listed, ROOMS);
}

/// A library that is named in one room can be replaced there.
#[test]
fn large_libraries_have_one_room() {
    let sources = Crate::read();
    for (library, room) in [
        ("dfdx", "network"),
        ("argmin", "fit"),
        ("fmi", "external/fmu"),
        ("clap", "cli"),
        ("clap_complete", "cli"),
        ("clap_mangen", "cli"),
        ("indicatif", "cli"),
        ("ctrlc", "cli"),
        ("parquet", "record"),
        ("mpi", "storage"),
    ] {
        let named = format!("{library} ::");
        let mut users = 0;
        for source in sources.sources.values() {
            let mut before = source
                .code
                .match_indices(&named)
                .map(|(at, _)| &source.code[..at]);
            if before.any(|before| {
                before.is_empty() || before.ends_with(' ') && !before.ends_with(":: ")
            }) {
                let inside = source.file.starts_with(room);
                assert!(inside, "{} names {library}", source.file.display());
                users += 1;
            }
        }
        assert!(users > 0, "nobody names {library}: is it still used?");
    }
}
