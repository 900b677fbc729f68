//! Words of a call as a shell reads them, whatever bytes they hold.

use std::ffi::OsStr;
use std::fmt::Write;
use std::path::Path;

/// Signs, besides letters and digits, that mean nothing to a shell within a word.
const PLAIN: &str = "_-./=:,+@%";

/// A call as a shell reads it.
pub(super) fn line<'a>(words: impl IntoIterator<Item = &'a OsStr>) -> String {
    let words: Vec<String> = words.into_iter().map(quoted).collect();
    words.join(" ")
}

/// A word as a shell reads it: in quotes where it needs them, with escapes where it holds control characters or no text.
pub(super) fn quoted(word: &OsStr) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || PLAIN.contains(c);
    match word.to_str() {
        Some(text) if !text.is_empty() && text.chars().all(is_plain) => text.to_owned(),
        Some(text) if !text.contains(char::is_control) => {
            format!("'{}'", text.replace('\'', r"'\''"))
        }
        _ => escaped(word.as_encoded_bytes()),
    }
}

/// A file's name in a text: as it is, in the form of [`quoted`] where it holds control characters or no text.
pub(super) fn shown(path: &Path) -> String {
    match path.to_str() {
        Some(text) if !text.contains(char::is_control) => text.to_owned(),
        _ => quoted(path.as_os_str()),
    }
}

/// Bytes in the shell's `$'…'`.
fn escaped(bytes: &[u8]) -> String {
    let mut word = String::from("$'");
    for chunk in bytes.utf8_chunks() {
        for c in chunk.valid().chars() {
            match c {
                '\'' | '\\' => word.extend(['\\', c]),
                c if c.is_control() => {
                    let mut bytes = [0; 4];
                    c.encode_utf8(&mut bytes)
                        .bytes()
                        .for_each(|b| byte(&mut word, b));
                }
                c => word.push(c),
            }
        }
        chunk.invalid().iter().for_each(|b| byte(&mut word, *b));
    }
    word.push('\'');
    word
}

fn byte(word: &mut String, byte: u8) {
    // Three digits at most: the next character is none of them. A string takes all that is written to it.
    let _ = write!(word, "\\{byte:03o}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_survive_a_shell() {
        for (word, expected) in [
            ("k1=0.6,k2=0.5", "k1=0.6,k2=0.5"),
            ("t=a b", "'t=a b'"),
            ("", "''"),
            ("it's $(id)", r"'it'\''s $(id)'"),
            ("µ.csv", "µ.csv"),
            ("a\n1'", r"$'a\0121\''"),
        ] {
            assert_eq!(quoted(OsStr::new(word)), expected);
        }
        assert_eq!(shown(Path::new("it's a b")), "it's a b");
        assert_eq!(shown(Path::new("a\nb")), r"$'a\012b'");
    }

    #[cfg(unix)]
    #[test]
    fn bytes_that_are_no_text_survive_a_shell() {
        use std::os::unix::ffi::OsStrExt;
        let name = OsStr::from_bytes(b"Messung_f\xfcr.csv");
        assert_eq!(quoted(name), r"$'Messung_f\374r.csv'");
        let script = format!("printf %s {}", quoted(name));
        let shell = std::process::Command::new("bash")
            .args(["-c", &script])
            .output();
        if let Ok(printed) = shell {
            assert_eq!(printed.stdout, b"Messung_f\xfcr.csv");
        }
    }
}
