//! One way to refuse a setting: which, its value, and what it must be.
//!
//! ```
//! use truetwin::estimator::gate::GateSettings;
//! use truetwin::setting::SettingError;
//!
//! let gate = GateSettings { alpha: 2.0, ..GateSettings::default() };
//! let refused: SettingError = gate.check().unwrap_err();
//! assert_eq!(refused.name(), "gate: alpha");
//! assert_eq!(refused.to_string(), "gate: alpha = 2; choose a rate between 0 and 1");
//! ```

use std::fmt::Display;

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
    /// Of the setting `name`, which is `value`, and must be what `remedy` says.
    ///
    /// ```
    /// use truetwin::setting::SettingError;
    ///
    /// let error = SettingError::new("step", -0.1, "must be positive");
    /// assert_eq!(error.to_string(), "step = -0.1; must be positive");
    /// ```
    pub fn new(name: impl Into<String>, value: impl Display, remedy: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            value: value.to_string(),
            remedy: remedy.into(),
        }
    }

    /// Fails unless `valid`.
    ///
    /// ```
    /// use truetwin::setting::SettingError;
    ///
    /// let check = |hold: usize| SettingError::unless(hold > 0, "hold", hold, "take at least 1 sample");
    /// assert!(check(3).is_ok());
    /// assert_eq!(check(0).unwrap_err().value(), "0");
    /// ```
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

    /// Which setting.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its value, as text.
    pub fn value(&self) -> &str {
        &self.value
    }

    /// What it must be.
    pub fn remedy(&self) -> &str {
        &self.remedy
    }
}
