//! One way to refuse a setting: which, its value, and what it must be.
//!
//! ```
//! use truetwin::estimator::GateSettings;
//! use truetwin::setting::SettingError;
//!
//! let gate = GateSettings { alpha: 2.0, ..GateSettings::default() };
//! let refused: SettingError = gate.check().unwrap_err();
//! assert_eq!(refused.name(), "gate: alpha");
//! assert_eq!(refused.to_string(), "gate: alpha = 2; choose a rate between 0 and 1");
//! ```

use std::fmt::Display;

/// Writes a number for a message, to eight digits; with an exponent where it is very large or small.
pub(crate) fn number(value: f64) -> String {
    let value = format!("{value:.7e}").parse().unwrap_or(value);
    let (plain, exponent) = (value.to_string(), format!("{value:e}"));
    let is_usual = value == 0.0 || !value.is_finite() || (1e-5..1e8).contains(&value.abs());
    if is_usual { plain } else { exponent }
}

/// So many of what is named in the singular: `1 input`, `2 inputs`.
pub(crate) fn count(n: usize, what: &str) -> String {
    let plural = if n == 1 { "" } else { "s" };
    format!("{n} {what}{plural}")
}

/// A setting that cannot be used. The message has its name, its value and the remedy.
///
/// Errors of all modules carry it, so that an application reads any of them in the same way. An example is that of the
/// [module](self).
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{name} = {value}; {remedy}")]
pub struct SettingError {
    name: String,
    value: String,
    remedy: String,
}

impl SettingError {
    /// Creates an error for setting `name` of value `value`; `remedy` says what it must be.
    pub fn new(name: impl Into<String>, value: impl Display, remedy: impl Into<String>) -> Self {
        let text = value.to_string();
        Self {
            name: name.into(),
            value: text.parse().map_or(text, number),
            remedy: remedy.into(),
        }
    }

    /// Fails unless `valid`.
    pub fn unless(
        valid: bool,
        name: impl Into<String>,
        value: impl Display,
        remedy: impl Into<String>,
    ) -> Result<(), Self> {
        match valid {
            true => Ok(()),
            false => Err(Self::new(name, value, remedy)),
        }
    }

    /// Fails unless a level lies between 0 and 1; `usual` is an example.
    pub(crate) fn unless_level(name: &str, level: f64, usual: f64) -> Result<(), Self> {
        let remedy = format!("choose a level between 0 and 1, such as {usual}");
        Self::unless(level > 0.0 && level < 1.0, name, level, remedy)
    }

    /// Fails where a count is larger than `most`.
    pub(crate) fn unless_at_most(name: &str, count: usize, most: usize) -> Result<(), Self> {
        Self::unless(count <= most, name, count, format!("choose at most {most}"))
    }

    /// Which setting.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its value, as text.
    pub fn value(&self) -> &str {
        &self.value
    }

    /// Returns the remedy.
    pub fn remedy(&self) -> &str {
        &self.remedy
    }
}

/// Returns the unit as it stands in a column of its own; a dash or a one is none.
pub(crate) fn own_unit(unit: &str) -> &str {
    if matches!(unit, "-" | "1") { "" } else { unit }
}

/// Returns " V", or nothing where a quantity has no unit.
pub(crate) fn unit_suffix(unit: &str) -> String {
    match own_unit(unit) {
        "" => String::new(),
        unit => format!(" {unit}"),
    }
}

/// Returns ` (did you mean "…"?)` with the known name nearest to `given`; nothing where none is near.
pub(crate) fn did_you_mean<'a>(
    given: &str,
    known: impl IntoIterator<Item = impl AsRef<str> + 'a>,
) -> String {
    let most = given.chars().count().div_ceil(3);
    let near = (known.into_iter())
        .map(|name| (edits(given, name.as_ref()), name))
        .filter(|(edits, _)| *edits <= most)
        .min_by_key(|(edits, _)| *edits);
    near.map_or(String::new(), |(_, name)| {
        format!(" (did you mean \"{}\"?)", name.as_ref())
    })
}

/// Returns how many letters have to be inserted, removed, replaced or swapped with their neighbour to turn `a` into `b`.
fn edits(a: &str, b: &str) -> usize {
    let beginning = |text: &str| text.to_lowercase().chars().take(64).collect::<String>();
    strsim::osa_distance(&beginning(a), &beginning(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_a_message_are_short() {
        for (value, expected) in [
            (0.0, "0"),
            (-2.5, "-2.5"),
            (366e5, "36600000"),
            (2e9, "2e9"),
            (2_147_483_648.0, "2.1474836e9"),
            (5e8, "5e8"),
            (123_456_789.123, "1.2345679e8"),
            (1e308, "1e308"),
            (-5e-312, "-5e-312"),
            (f64::NAN, "NaN"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(number(value), expected);
            assert_eq!(SettingError::new("ridge", value, "").value(), expected);
        }
        let text = SettingError::new("weights", "7 weights", "");
        assert_eq!(text.value(), "7 weights");
    }

    #[test]
    fn a_slip_of_the_keyboard_is_recognised() {
        let known = ["tanks", "van-der-pol", "state-ceiling@h1"];
        for (given, expected) in [
            ("tnaks", " (did you mean \"tanks\"?)"),
            ("vanderpol", " (did you mean \"van-der-pol\"?)"),
            ("state-cieling@h1", " (did you mean \"state-ceiling@h1\"?)"),
            ("pump", ""),
            ("", ""),
        ] {
            assert_eq!(did_you_mean(given, known), expected, "{given}");
        }
    }
}
