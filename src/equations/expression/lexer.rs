//! Words, numbers and signs of an expression.

use crate::storage::untrusted::hidden;

/// A piece of an expression.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Token<'t> {
    Number(f64),
    Name(&'t str),
    Sign(&'static str),
    End,
}

/// Signs, longer ones first.
const SIGNS: [&str; 15] = [
    "<=", ">=", "==", "!=", "+", "-", "*", "/", "^", "(", ")", ",", "<", ">", "=",
];

/// A problem at a byte of an expression.
pub(in crate::equations) type Problem = (usize, String);

/// Splits an expression into tokens, each with its byte; the last is [`Token::End`].
pub(super) fn tokens(text: &str) -> Result<Vec<(usize, Token<'_>)>, Problem> {
    let mut tokens = Vec::new();
    let mut at = 0;
    while let Some(first) = text[at..].chars().next() {
        let rest = &text[at..];
        let length = if first.is_whitespace() {
            first.len_utf8()
        } else if begins_name(first) {
            let end = rest.find(|c: char| !continues_name(c));
            let word = &rest[..end.unwrap_or(rest.len())];
            tokens.push((at, Token::Name(word)));
            word.len()
        } else if first.is_ascii_digit() || first == '.' {
            let word = &rest[..number_length(rest)];
            let number = word.parse().ok().filter(|n: &f64| n.is_finite());
            let number =
                number.ok_or_else(|| (at, format!("{word} is no number; write 1.5 or 2e-3")))?;
            tokens.push((at, Token::Number(number)));
            word.len()
        } else if let Some(sign) = SIGNS.into_iter().find(|sign| rest.starts_with(sign)) {
            tokens.push((at, Token::Sign(sign)));
            sign.len()
        } else {
            let problem = format!(
                "unexpected \"{}\"; expressions have numbers, names, + - * / ^ ( ) , and comparisons",
                match hidden(first) {
                    true => format!("U+{:04X}", u32::from(first)),
                    false => first.to_string(),
                }
            );
            return Err((at, problem));
        };
        at += length;
    }
    tokens.push((text.len(), Token::End));
    Ok(tokens)
}

/// Length of the number that a text begins with, in bytes.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits = |from: usize| {
        bytes[from..]
            .iter()
            .take_while(|b| b.is_ascii_digit())
            .count()
    };
    let mut end = digits(0);
    if bytes.get(end) == Some(&b'.') {
        end += 1 + digits(end + 1);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let exponent = digits((end + 1 + sign).min(bytes.len()));
        if exponent > 0 {
            end += 1 + sign + exponent;
        }
    }
    end
}

fn begins_name(c: char) -> bool {
    c.is_alphabetic() || c == '_'
}

fn continues_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Returns whether expressions can call something by this name.
pub(in crate::equations) fn is_name(name: &str) -> bool {
    name.starts_with(begins_name) && name.chars().all(continues_name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_names_and_signs_are_told_apart() {
        let all = |text| -> Vec<Token<'_>> {
            let tokens = tokens(text).unwrap();
            tokens.into_iter().map(|(_, token)| token).collect()
        };
        use Token::*;
        assert_eq!(all("2e-3*x_1"), [Number(2e-3), Sign("*"), Name("x_1"), End]);
        assert_eq!(all("a<=.5"), [Name("a"), Sign("<="), Number(0.5), End]);
        assert_eq!(all("1.e2 θ"), [Number(100.0), Name("θ"), End]);
        assert_eq!(all("2e"), [Number(2.0), Name("e"), End]);
        for wrong in [".", "1.5 $", "1e999", "a & b", "\"x\""] {
            assert!(tokens(wrong).is_err(), "{wrong}");
        }
    }
}
