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
                is_verbatim: false,
            }));
        }
        let text = value.get_ref().as_str()?;
        let (start, is_verbatim) = self.inside(value, text);
        let placed = |expression| PlacedExpression {
            expression,
            start,
            is_verbatim,
        };
        Some(match Expression::parse(text) {
            Ok(expression) => Ok(placed(expression)),
            Err((at, problem)) => {
                let place = placed(Expression::default()).byte(at);
                self.error(place, problem)
            }
        })
    }

    /// Byte at which the content of a text begins, and whether it stands in the file as it is.
    fn inside(&self, value: &Spanned<DeValue<'_>>, text: &str) -> (usize, bool) {
        let span = value.span();
        let raw = self.0.get(span.clone()).unwrap_or_default();
        match raw.find(text).filter(|_| !text.is_empty()) {
            Some(at) => (span.start + at, true),
            None => (span.start, false),
        }
    }
}

/// An expression in a file.
#[derive(Debug, Clone)]
pub(super) struct PlacedExpression {
    pub expression: Expression,
    start: usize,
    is_verbatim: bool,
}

impl PlacedExpression {
    /// Returns the byte of the file for a byte of the expression.
    pub fn byte(&self, at: usize) -> usize {
        match self.is_verbatim {
            true => self.start + at,
            false => self.start,
        }
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
