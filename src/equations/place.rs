//! Places in the text of a file, for messages.

use super::error::EquationsError;
use super::expression::{Expression, Problem};
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

/// The text of a file.
#[derive(Debug, Clone, Copy)]
pub(super) struct SourceText<'t>(pub &'t str);

impl SourceText<'_> {
    /// An error at a byte of the text.
    pub fn error<T>(&self, byte: usize, problem: impl Into<String>) -> Result<T, EquationsError> {
        Err(EquationsError::at(self.0, byte, problem))
    }

    /// Parses a value that is an expression: a text, or a number.
    pub fn expression(
        &self,
        value: &Spanned<DeValue<'_>>,
    ) -> Option<Result<PlacedExpression, EquationsError>> {
        if let Some(number) = number(value.get_ref()) {
            return Some(Ok(PlacedExpression {
                expression: Expression::number(number),
                start: value.span().start,
                bytes: vec![],
            }));
        }
        let text = value.get_ref().as_str()?;
        let start = value.span().start;
        let raw = self.0.get(value.span()).unwrap_or_default();
        let placed = |expression| PlacedExpression {
            expression,
            start,
            bytes: bytes_in(raw, text),
        };
        Some(match Expression::parse(text) {
            Ok(expression) => Ok(placed(expression)),
            Err((at, problem)) => {
                let place = placed(Expression::default()).byte(at);
                self.error(place, problem)
            }
        })
    }
}

/// Returns the byte of a string in a file for each byte of the text that it stands for: quotes and escapes take more.
fn bytes_in(raw: &str, text: &str) -> Vec<usize> {
    let is_literal = raw.starts_with('\'');
    let quote = raw.chars().next().unwrap_or_default();
    let mut at = raw.len() - raw.trim_start_matches(quote).len();
    if text.is_empty() || raw.len() < 2 * at {
        at = at.min(1);
    }
    let mut bytes = Vec::with_capacity(text.len());
    for c in text.chars() {
        let mut rest = raw.get(at..).unwrap_or_default();
        // What ends a line is left out behind the first quotes and behind a stroke; of its return the text may be without, too.
        loop {
            let skipped = match rest.as_bytes() {
                [b'\r', b'\n', ..] if c != '\r' => 1,
                [b'\n', ..] if c != '\n' => 1,
                [b'\\', b' ' | b'\t' | b'\r' | b'\n', ..] if !is_literal => {
                    rest.len() - rest[1..].trim_start().len()
                }
                _ => break,
            };
            rest = &rest[skipped..];
        }
        at = raw.len() - rest.len();
        bytes.extend(std::iter::repeat_n(at, c.len_utf8()));
        at += match rest.as_bytes() {
            [b'\\', escape, ..] if !is_literal => match escape {
                b'x' => 4,
                b'u' => 6,
                b'U' => 10,
                _ => 2,
            },
            _ => c.len_utf8(),
        };
    }
    bytes
}

/// An expression in a file.
#[derive(Debug, Clone)]
pub(super) struct PlacedExpression {
    pub expression: Expression,
    /// Byte at which the value begins, and those of the text within it.
    start: usize,
    bytes: Vec<usize>,
}

impl PlacedExpression {
    /// Returns the byte of the file for a byte of the expression.
    pub fn byte(&self, at: usize) -> usize {
        // A word that is missing is behind the last one.
        let behind = || self.bytes.last().map(|last| last + 1);
        let own = self.bytes.get(at).copied().or_else(behind);
        self.start + own.unwrap_or(0)
    }

    /// Returns the place of a problem.
    pub fn problem(&self, source: &SourceText<'_>, (at, problem): Problem) -> EquationsError {
        EquationsError::at(source.0, self.byte(at), problem)
    }
}

/// Returns the number that a value is.
pub(super) fn number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Float(number) => number.as_str().parse().ok(),
        DeValue::Integer(number) => {
            let digits = number.as_str();
            match number.radix() {
                10 => digits.parse().ok(),
                radix => (i64::from_str_radix(digits, radix).ok()).map(|whole| whole as f64),
            }
        }
        _ => None,
    }
}

/// A key of a table, and its value.
pub(super) type KeyedValue<'a, 't> = (&'a Spanned<DeString<'t>>, &'a Spanned<DeValue<'t>>);

/// Returns the entries of a table in the order of the file.
pub(super) fn in_order<'a, 't>(table: &'a DeTable<'t>) -> Vec<KeyedValue<'a, 't>> {
    let mut all: Vec<KeyedValue<'a, 't>> = table.iter().collect();
    all.sort_by_key(|(key, _)| key.span().start);
    all
}
