//! Foreign text, fit for a terminal and for a message of one line.

use std::borrow::Cow;

/// Longest piece that a message quotes, in characters.
const QUOTED: usize = 160;

/// Whether a character steers what is around it instead of being seen: controls of terminals (U+009B alone begins an escape
/// sequence), marks that turn the direction of writing, and those without width.
pub(crate) fn hidden(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
}

/// Text for a terminal: lines stay lines, every other hidden character is a replacement character.
pub(crate) fn printable(text: &str) -> Cow<'_, str> {
    let odd = |c: char| hidden(c) && c != '\n';
    match text.contains(odd) {
        false => Cow::Borrowed(text),
        true => Cow::Owned(text.replace(odd, "\u{fffd}")),
    }
}

/// The beginning of `text` in one line, without hidden characters.
pub(crate) fn excerpt(text: &str) -> String {
    one_line(text, QUOTED)
}

/// As [`excerpt`], with `most` characters: for messages of parsers, which list what they know.
pub(crate) fn one_line(text: &str, most: usize) -> String {
    let (mut line, mut length, mut space) = (String::new(), 0, false);
    for c in text.chars() {
        if hidden(c) || c.is_whitespace() {
            space = !line.is_empty();
            continue;
        }
        if length >= most {
            line.push_str(" …");
            break;
        }
        if std::mem::take(&mut space) {
            line.push(' ');
            length += 1;
        }
        line.push(c);
        length += 1;
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn excerpts_are_short_and_in_one_line() {
        assert_eq!(excerpt(" a\n\u{1b}[31mb\t "), "a [31mb");
        assert_eq!(excerpt(&"ä".repeat(500)).chars().count(), QUOTED + 2);
        assert_eq!(excerpt("a\u{202e}b"), "a b");
        assert_eq!(excerpt(&" ".repeat(500)), "");
    }

    #[test]
    fn nothing_that_steers_a_terminal_is_printed() {
        assert_eq!(printable("k1 = 3 µm²\n"), "k1 = 3 µm²\n");
        let hostile = "\u{1b}[2J \u{9b}31m \u{202e}gpj.exe\r\u{7}\u{feff}";
        assert!(!printable(hostile).contains(hidden), "{hostile:?}");
    }
}
