//! Pieces of foreign text, fit for a one-line message.

use crate::storage::untrusted::one_line;

/// Longest end of standard error that a message quotes, in characters.
const LAST_WORDS: usize = 400;

/// The end of what a program wrote to standard error, in one line; its lines are parted by ` | `.
pub(super) fn last_words(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let lines: Vec<String> = (text.lines().map(|line| one_line(line, usize::MAX)))
        .filter(|line| !line.is_empty())
        .collect();
    let joined = lines.join(" | ");
    let surplus = joined.chars().count().saturating_sub(LAST_WORDS);
    match joined.char_indices().nth(surplus) {
        Some((from, _)) if surplus > 0 => format!("… {}", &joined[from..]),
        _ => joined,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_short_and_in_one_line() {
        assert_eq!(
            last_words(b"Traceback:\n  File x\n\nValueError: no\n"),
            "Traceback: | File x | ValueError: no"
        );
        let long = last_words(format!("{}end", "ö".repeat(999)).as_bytes());
        assert!(long.starts_with("… ö") && long.ends_with("end"), "{long}");
        assert_eq!(last_words(&[0xff, 0xfe]), "\u{fffd}\u{fffd}");
    }
}
