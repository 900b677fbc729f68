//! The rows of the table.

use crate::evaluate::baseline::Initialisation;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Scored method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
#[non_exhaustive]
pub enum ScoredMethod {
    /// The pretrained network.
    TsPre,
    /// Gauss–Newton, whatever the gate says.
    GaussNewton,
    /// Tuned heads, whatever the gate says.
    TsFine,
    /// The estimator's answer: gate, misfit and all.
    Final,
    /// The prediction-error method, the paper's six steps.
    PredictionError(Initialisation),
    /// The dual Kalman filter; of twins with equations only.
    DualFilter(Initialisation),
}

impl ScoredMethod {
    /// Every row, in the order of a table.
    pub fn all() -> Vec<Self> {
        let mut all = vec![Self::TsPre, Self::GaussNewton, Self::TsFine, Self::Final];
        all.extend(Initialisation::ALL.map(Self::PredictionError));
        all.extend(Initialisation::ALL.map(Self::DualFilter));
        all
    }

    /// Start of a baseline.
    pub fn initialisation(self) -> Option<Initialisation> {
        match self {
            Self::PredictionError(start) | Self::DualFilter(start) => Some(start),
            _ => None,
        }
    }

    /// Method and start: `PEM (bad)`.
    pub fn label(self) -> String {
        match self.initialisation() {
            Some(start) => format!("{self} ({start})"),
            None => self.to_string(),
        }
    }
}

impl fmt::Display for ScoredMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TsPre => "TS-pre",
            Self::GaussNewton => "GN",
            Self::TsFine => "TS-fine",
            Self::Final => "final",
            Self::PredictionError(_) => "PEM",
            Self::DualFilter(_) => "dual-EKF",
        })
    }
}

impl From<ScoredMethod> for String {
    fn from(method: ScoredMethod) -> Self {
        method.label()
    }
}

impl TryFrom<String> for ScoredMethod {
    type Error = String;

    fn try_from(label: String) -> Result<Self, String> {
        let found = Self::all().into_iter().find(|m| m.label() == label);
        found.ok_or_else(|| format!("no method is called \"{label}\""))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_label_is_read_again() {
        for method in ScoredMethod::all() {
            assert_eq!(ScoredMethod::try_from(String::from(method)), Ok(method));
        }
        assert!(ScoredMethod::try_from("PEM (worst)".to_owned()).is_err());
    }
}
