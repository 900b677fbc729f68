//! Outcomes of checks.

use serde::Serialize;

/// Severity of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// The check passed.
    Pass,
    /// Worth knowing; the twin can be used.
    Warning,
    /// The twin breaks a rule that estimation relies on.
    Failure,
}

/// The outcome of one check.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Finding {
    /// Short name of the check.
    pub check: &'static str,
    /// Severity.
    pub severity: Severity,
    /// The result, and the remedy where there is one.
    pub message: String,
}

impl Finding {
    pub(crate) fn pass(check: &'static str, message: impl Into<String>) -> Self {
        Self::new(check, Severity::Pass, message)
    }

    pub(crate) fn failure(check: &'static str, message: impl Into<String>) -> Self {
        Self::new(check, Severity::Failure, message)
    }

    pub(crate) fn warning(check: &'static str, message: impl Into<String>) -> Self {
        Self::new(check, Severity::Warning, message)
    }

    fn new(check: &'static str, severity: Severity, message: impl Into<String>) -> Self {
        Self {
            check,
            severity,
            message: message.into(),
        }
    }
}
