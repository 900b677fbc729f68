//! Foreign text, fit for a terminal and for a message of one line.

use crate::math::six_digits;
use crate::setting::number;
use std::borrow::Cow;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Longest piece that a message quotes, in characters.
const QUOTED: usize = 160;
/// Longest message of a parser, in characters: it may list what it knows.
const MESSAGE: usize = 2000;
/// Words of parsers, and those of their readers.
const WORDS: [(&str, &str); 20] = [
    (
        " as i128, expected any valid TOML value",
        ", which has too many digits",
    ),
    ("invalid type: map", "found a table"),
    ("invalid type: sequence", "found a list"),
    ("invalid type: ", "found "),
    ("expected dyn FeatureRecipe", "expected a kind of features"),
    ("expected f64", "expected a number"),
    ("expected usize", "expected a whole number, 0 or more"),
    ("expected u64", "expected a whole number, 0 or more"),
    ("expected u32", "expected a whole number, 0 or more"),
    ("expected a boolean", "expected true or false"),
    ("expected a sequence", "expected a list"),
    ("expected a map", "expected a table"),
    (
        "expected an array of length 2",
        "expected two numbers, [low, high]",
    ),
    ("wanted string or table", "expected a text"),
    (
        "wanted exactly 1 element, more than 1 element",
        "expected a text, found a table",
    ),
    ("unknown field", "unknown key"),
    ("missing field", "missing key"),
    ("unknown variant", "unknown value"),
    ("EOF while parsing", "it ends inside"),
    ("expected ident", "expected true, false or null"),
];
/// Longest name or path in a study or effect file, in characters.
const LONGEST: usize = 1000;

/// Returns whether a character steers what is around it instead of being seen: controls of terminals (U+009B alone begins an escape
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

/// The beginning of a name or cell as it stands: hidden characters and unusual spaces as `\u{…}`.
pub(crate) fn quoted(text: &str) -> String {
    let odd = |c: char| hidden(c) || (c.is_whitespace() && c != ' ');
    let shown = |c: char| match odd(c) {
        true => c.escape_unicode().to_string(),
        false => c.to_string(),
    };
    excerpt(&text.chars().take(QUOTED + 1).map(shown).collect::<String>())
}

/// The message of a parser in one line, without the words of the language that this program is written in.
pub(crate) fn message(text: &str) -> String {
    let replace = |text: String, (theirs, ours): &(&str, &str)| text.replace(theirs, ours);
    let text = WORDS.iter().fold(short_numbers(text), replace);
    one_line(&short_quotes(&text), MESSAGE)
}

/// Quotes that are too long, by their beginnings: what stands behind them is not to be cut off.
fn short_quotes(text: &str) -> String {
    let parts = text.split('`').enumerate().map(|(i, part)| {
        let is_long = i % 2 == 1 && part.chars().count() > QUOTED;
        match is_long {
            true => Cow::Owned(excerpt(part)),
            false => Cow::Borrowed(part),
        }
    });
    parts.collect::<Vec<_>>().join("`")
}

/// Words that are too long, by their beginnings, likewise.
pub(crate) fn short_words(text: &str) -> String {
    let words = text.split(' ').map(|word| match word.chars().nth(QUOTED) {
        None => Cow::Borrowed(word),
        Some(_) => {
            let name = word.trim_end_matches(|c: char| !c.is_alphanumeric());
            Cow::Owned(excerpt(name) + &word[name.len()..])
        }
    });
    words.collect::<Vec<_>>().join(" ")
}

/// Numbers of more digits than a message needs, to six of them: a parser writes all that a number has.
fn short_numbers(text: &str) -> String {
    let is_part = |c: char| c.is_alphanumeric() || matches!(c, '.' | '_');
    let short = |word: &str| -> Option<String> {
        let digits = word.bytes().filter(u8::is_ascii_digit).count();
        let value: f64 = word.parse().ok().filter(|_| digits > 8)?;
        Some(number(six_digits(value)))
    };
    let mut all = String::with_capacity(text.len());
    let mut rest = text;
    while !rest.is_empty() {
        let begin = rest.find(is_part).unwrap_or(rest.len());
        let (between, from) = rest.split_at(begin);
        let (word, left) = from.split_at(from.find(|c| !is_part(c)).unwrap_or(from.len()));
        all += between;
        all += &short(word).unwrap_or_else(|| word.into());
        rest = left;
    }
    all
}

/// As [`excerpt`], with `most` characters.
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

/// Checks whether every key and text of a TOML table can be shown as a name; else the byte where one stands that cannot, and the problem.
pub(crate) fn check_names(table: &DeTable<'_>) -> Result<(), (usize, String)> {
    table.iter().try_for_each(|(key, value)| {
        check_name(key.get_ref()).map_err(|problem| (key.span().start, problem))?;
        check_value(value)
    })
}

/// No deeper than the parser lets tables be nested.
fn check_value(value: &Spanned<DeValue<'_>>) -> Result<(), (usize, String)> {
    match value.get_ref() {
        DeValue::String(text) => check_name(text).map_err(|problem| (value.span().start, problem)),
        DeValue::Array(values) => values.iter().try_for_each(check_value),
        DeValue::Table(table) => check_names(table),
        _ => Ok(()),
    }
}

/// Checks whether a text can be shown as a name; else what cannot.
pub(crate) fn check_name(name: &str) -> Result<(), String> {
    if name.chars().count() > LONGEST {
        let begin = excerpt(name);
        return Err(format!(
            "\"{begin}\" has more than {LONGEST} characters; shorten it"
        ));
    }
    match name.chars().find(|c| hidden(*c)) {
        Some(c) => Err(format!(
            "\"{}\" holds the hidden character {c:?}; leave it out",
            excerpt(name)
        )),
        None => Ok(()),
    }
}

/// Returns the line, from 1, of a byte of a text.
pub(crate) fn line(text: &str, byte: usize) -> usize {
    1 + text.bytes().take(byte).filter(|b| *b == b'\n').count()
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
        let long = format!(
            "found `1{}`, 0.{}1 in a_123456789",
            "0".repeat(308),
            "0".repeat(300)
        );
        assert_eq!(message(&long), "found `1e308`, 1e-301 in a_123456789");
        assert_eq!(message("98765432 of 100000000"), "98765432 of 1e8");
        assert_eq!(quoted("t\u{feff}1\u{a0}0"), "t\\u{feff}1\\u{a0}0");
        let key = message(&format!(
            "unknown field `{}`, expected `a`",
            "[".repeat(5000)
        ));
        assert!(key.ends_with(" …`, expected `a`"), "{key}");
        assert!(key.chars().count() < 2 * QUOTED, "{key}");
        let name = "x".repeat(5000);
        let name = short_words(&format!("no twin is called \"{name}\"; name one"));
        assert!(name.ends_with("xxx …\"; name one"), "{name}");
    }

    #[test]
    fn messages_have_no_words_of_rust() {
        let number: Result<f64, _> = serde_json::from_str("\"a\"");
        let told = message(&number.unwrap_err().to_string());
        assert!(
            told.starts_with("found string \"a\", expected a number"),
            "{told}"
        );
    }

    #[test]
    fn names_that_cannot_be_shown_are_found_wherever_they_stand() {
        let check = |text: &str| check_names(DeTable::parse(text).unwrap().get_ref());
        assert_eq!(check("a = 1\n[b]\n\"µ.c\" = ['x y', 2.0]"), Ok(()));
        for bad in [
            "\"a\\u001B\" = 1",
            "a = [[{ b = \"\\n\" }]]",
            "a.\"\\u202E\".b = 1",
        ] {
            let (_, problem) = check(bad).unwrap_err();
            assert!(
                problem.contains("hidden") && !problem.contains(hidden),
                "{problem}"
            );
        }
        let long = format!("{} = 1", "a".repeat(1001));
        assert!(check(&long).unwrap_err().1.contains("more than 1000"));
    }

    #[test]
    fn nothing_that_steers_a_terminal_is_printed() {
        assert_eq!(printable("k1 = 3 µm²\n"), "k1 = 3 µm²\n");
        let hostile = "\u{1b}[2J \u{9b}31m \u{202e}gpj.exe\r\u{7}\u{feff}";
        assert!(!printable(hostile).contains(hidden), "{hostile:?}");
    }
}
