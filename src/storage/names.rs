//! Names of unfinished files and folders.

use super::checksum::sha256;
use std::path::{Path, PathBuf};

/// Start of the names that outputs may not have: those of unfinished files, also of other versions.
const RESERVED: &str = ".truetwin-";
/// Start of the names of unfinished files and folders.
const UNFINISHED: &str = ".truetwin-unfinished-";
/// Digits of a checksum in a name: 64 bits.
const DIGITS: usize = 16;
/// Random characters in a name.
const RANDOM: usize = 6;

/// Tells whether a path has a name that outputs may not have.
pub(super) fn is_reserved(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default();
    name.as_encoded_bytes().starts_with(RESERVED.as_bytes())
}

/// Start of the random names of this process.
pub(super) fn prefix() -> String {
    format!("{UNFINISHED}{}-", std::process::id())
}

/// Tells whether a name is one that this program gives to unfinished files and folders.
pub(super) fn is_unfinished(name: &str) -> bool {
    let Some(rest) = name.strip_prefix(UNFINISHED) else {
        return false;
    };
    let is_checksum =
        |text: &str| text.len() == DIGITS && text.bytes().all(|b| b.is_ascii_hexdigit());
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let is_random =
        |text: &str| text.len() == RANDOM && text.bytes().all(|b| b.is_ascii_alphanumeric());
    is_checksum(rest)
        || rest
            .split_once('-')
            .is_some_and(|(process, random)| is_number(process) && is_random(random))
}

/// Tells whether the name of an unfinished file is that of another process which lives.
pub(super) fn is_of_another(name: &str) -> bool {
    let rest = name.strip_prefix(UNFINISHED).unwrap_or_default();
    let process = rest
        .split_once('-')
        .and_then(|(process, _)| process.parse().ok());
    // Where the system lists its processes.
    let lives = |process: u32| Path::new("/proc").join(process.to_string()).exists();
    process.is_some_and(|process| process != std::process::id() && lives(process))
}

/// The places beside one that is taken: `out-2`, `out-3`, … for `out`, `r-2.csv`, … for `r.csv`.
pub(super) fn places_beside(place: &Path) -> impl Iterator<Item = PathBuf> {
    let [stem, ending] = [place.file_stem(), place.extension()].map(Option::unwrap_or_default);
    (2..100).map(move |number| {
        let mut name = stem.to_owned();
        name.push(format!("-{number}"));
        if !ending.is_empty() {
            name.push(".");
            name.push(ending);
        }
        place.with_file_name(name)
    })
}

/// The unfinished folder that one process at a time may have for a place.
pub(super) fn named(place: &Path) -> PathBuf {
    let name = place.file_name().unwrap_or_default();
    let sum = sha256(name.as_encoded_bytes());
    place.with_file_name(format!("{UNFINISHED}{}", &sum[..DIGITS]))
}
