//! Noise levels and starts as a study declares them.

use crate::twin::TwinError;
use serde::{Deserialize, Serialize};

/// Refusal of a factor that nothing could take.
pub(crate) const KNOWN_WITH_FACTOR: &str =
    "a known level is not fitted, and has no factor; remove one of known and factor";

/// A noise level: `0.1`, `{ std = 0.1, known = true }`, or `"estimate"`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "NoiseText", into = "NoiseText")]
pub(crate) enum NoiseLevel {
    /// Declared: simulations use it. A likelihood of a measured record fits it, unless it is known.
    Declared(DeclaredNoise),
    /// Unknown: it becomes a parameter, which an estimator learns.
    Estimate,
}

/// A declared noise level.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct DeclaredNoise {
    /// Standard deviation; 0 declares nothing.
    pub std: f64,
    /// Share of an output's size |y| that is added to `std`.
    #[serde(default, skip_serializing_if = "is_none")]
    pub share: f64,
    /// `true` if nothing is to be fitted.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub known: bool,
    /// Factor that one standard deviation of the fitted level's logarithm is, above 1.
    #[serde(default = "usual_factor", skip_serializing_if = "is_usual_factor")]
    pub factor: f64,
    /// Unit of a state's level.
    #[serde(default)]
    pub per: Per,
}

/// Default of a declared level's factor: one standard deviation is a factor e. A level that is off by a factor of three costs 0.6 nats, less
/// than a record of 50 samples knows about it.
fn usual_factor() -> f64 {
    std::f64::consts::E
}

fn is_none(share: &f64) -> bool {
    *share == 0.0
}

fn is_usual_factor(factor: &f64) -> bool {
    *factor == usual_factor()
}

/// Time in which a state's noise adds up to its level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Per {
    /// A step of the study: `std` is that of the increment added at each.
    #[default]
    Step,
    /// A second: `std` is in units of the state per √s.
    Second,
}

impl DeclaredNoise {
    /// A level that is not fitted, a state's per step.
    pub(crate) fn known(std: f64) -> Self {
        Self {
            std,
            share: 0.0,
            known: true,
            factor: usual_factor(),
            per: Per::Step,
        }
    }
}

impl NoiseLevel {
    /// Returns whether the level says of itself that it is to be found.
    pub(crate) fn is_open(&self) -> bool {
        match self {
            Self::Declared(level) => !level.known && !is_usual_factor(&level.factor),
            Self::Estimate => true,
        }
    }

    /// A declared level, a state's per step.
    pub(crate) fn declared(std: f64) -> Self {
        Self::Declared(DeclaredNoise {
            std,
            share: 0.0,
            known: false,
            factor: usual_factor(),
            per: Per::Step,
        })
    }

    /// Checks numbers of the level of `name`, a state or an output.
    pub(super) fn check(self, name: &str, is_process: bool) -> Result<(), TwinError> {
        let Self::Declared(DeclaredNoise {
            std,
            share,
            factor,
            known,
            per,
        }) = self
        else {
            return Ok(());
        };
        let wrong = |key: &str, value, remedy| TwinError::Value {
            table: "noise",
            name: format!("{name}{key}"),
            value,
            remedy,
        };
        if !(std >= 0.0 && std.is_finite()) {
            return Err(wrong("", std, "a standard deviation is 0 or more"));
        }
        if !(0.0..1.0).contains(&share) {
            let remedy = "a share of the signal lies in [0, 1), such as 0.05";
            return Err(wrong(".share", share, remedy));
        }
        if is_process && share > 0.0 {
            let remedy =
                "a share is that of an output's noise in its signal; give a state std alone";
            return Err(wrong(".share", share, remedy));
        }
        if !is_process && per == Per::Second {
            let remedy =
                "per is of states, whose noise adds up over time; give an output std alone";
            return Err(wrong("", std, remedy));
        }
        if !(factor > 1.0 && factor.is_finite()) {
            let remedy = "factor is how many times larger or smaller the level may well be: above 1, such as 2";
            return Err(wrong(".factor", factor, remedy));
        }
        if known && !is_usual_factor(&factor) {
            return Err(wrong(".factor", factor, KNOWN_WITH_FACTOR));
        }
        Ok(())
    }
}

#[derive(Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected a number, { std = .., share = .., known = true, factor = 2.0, per = \"step\" or \"second\" }, or \"estimate\""
)]
enum NoiseText {
    Number(f64),
    Table(DeclaredNoise),
    Word(Word),
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Word {
    Estimate,
}

impl From<NoiseText> for NoiseLevel {
    fn from(text: NoiseText) -> Self {
        match text {
            NoiseText::Number(std) => Self::declared(std),
            NoiseText::Table(table) => Self::Declared(table),
            NoiseText::Word(Word::Estimate) => Self::Estimate,
        }
    }
}

impl From<NoiseLevel> for NoiseText {
    fn from(level: NoiseLevel) -> Self {
        match level {
            NoiseLevel::Declared(table) if level == NoiseLevel::declared(table.std) => {
                Self::Number(table.std)
            }
            NoiseLevel::Declared(table) => Self::Table(table),
            NoiseLevel::Estimate => Self::Word(Word::Estimate),
        }
    }
}

/// A state at the first row: `2.0`, `{ mean = 2.0, std = 0.5 }`, or `"estimate"`; or at a time before it: `{ value = 2.0, at = 0.0 }`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "StartText", into = "StartText")]
pub(crate) enum StartLevel {
    /// Normal around a mean; simulations draw from it, filters integrate over it. A deviation of 0 is a known start.
    Declared {
        /// Mean, in units of the state.
        mean: f64,
        /// Standard deviation, in units of the state.
        std: f64,
        /// Time that it belongs to, in seconds on the record's own clock; that of the first row if not given.
        at: Option<f64>,
    },
    /// Unknown: it becomes a parameter, which an estimator learns.
    Estimate,
}

impl StartLevel {
    /// A start that is known at the first row.
    pub(crate) fn known(value: f64) -> Self {
        Self::Declared {
            mean: value,
            std: 0.0,
            at: None,
        }
    }

    /// Checks numbers of the start of `name`, whose limits are `limit`.
    pub(super) fn check(self, name: &str, limit: crate::twin::Interval) -> Result<(), TwinError> {
        let Self::Declared { mean, std, at } = self else {
            return Ok(());
        };
        let wrong = |value, remedy| TwinError::Value {
            table: "start",
            name: name.into(),
            value,
            remedy,
        };
        if !(limit.contains(mean) && mean.is_finite()) {
            return Err(wrong(mean, "a start lies within the state's limits"));
        }
        if !(std >= 0.0 && std.is_finite()) {
            return Err(wrong(std, "a standard deviation is 0 or more"));
        }
        match at {
            Some(at) if !at.is_finite() => Err(wrong(
                at,
                "at is a time in seconds on the record's own clock",
            )),
            _ => Ok(()),
        }
    }
}

#[derive(Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected a number, { value = .., at = .. }, { mean = .., std = .. }, or \"estimate\""
)]
enum StartText {
    Number(f64),
    Value(ValueAt),
    Table(StartTable),
    Word(Word),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ValueAt {
    value: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    at: Option<f64>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StartTable {
    mean: f64,
    std: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    at: Option<f64>,
}

impl From<StartText> for StartLevel {
    fn from(text: StartText) -> Self {
        match text {
            StartText::Number(mean) => Self::known(mean),
            StartText::Value(ValueAt { value, at }) => Self::Declared {
                mean: value,
                std: 0.0,
                at,
            },
            StartText::Table(StartTable { mean, std, at }) => Self::Declared { mean, std, at },
            StartText::Word(Word::Estimate) => Self::Estimate,
        }
    }
}

impl From<StartLevel> for StartText {
    fn from(level: StartLevel) -> Self {
        match level {
            StartLevel::Declared {
                mean,
                std: 0.0,
                at: None,
            } => Self::Number(mean),
            StartLevel::Declared {
                mean: value,
                std: 0.0,
                at,
            } => Self::Value(ValueAt { value, at }),
            StartLevel::Declared { mean, std, at } => Self::Table(StartTable { mean, std, at }),
            StartLevel::Estimate => Self::Word(Word::Estimate),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct File {
        h: NoiseLevel,
        x: StartLevel,
    }

    #[test]
    fn every_form_is_read_and_written_again() {
        for text in [
            "h = 0.1\nx = 2.0\n",
            "h = \"estimate\"\nx = \"estimate\"\n",
            "[h]\nstd = 0.1\nknown = true\nper = \"second\"\n\n[x]\nmean = 2.0\nstd = 0.5\n",
            "h = 0.1\n\n[x]\nvalue = 2.0\nat = -1.5\n",
            "h = 0.1\n\n[x]\nmean = 2.0\nstd = 0.5\nat = 0.0\n",
            "[h]\nstd = 0.1\nshare = 0.05\nper = \"step\"\n\n[x]\nmean = 2.0\nstd = 0.5\n",
        ] {
            let file: File = toml::from_str(text).unwrap();
            assert_eq!(toml::to_string(&file).unwrap(), text);
        }
        let error = toml::from_str::<File>("h = { std = 0.1, sd = 1.0 }\nx = 1.0").unwrap_err();
        assert!(error.message().contains("known = true"), "{error}");
    }

    #[test]
    fn numbers_that_cannot_be_used_are_named() {
        let of = |share, factor| {
            NoiseLevel::Declared(DeclaredNoise {
                std: 0.1,
                share,
                known: false,
                factor,
                per: Per::Step,
            })
        };
        for (level, value) in [
            (NoiseLevel::declared(-0.1), "-0.1"),
            (of(0.0, 0.5), "h1.factor = 0.5"),
            (of(-0.2, 2.0), "h1.share = -0.2"),
            (of(0.05, 2.0), "a state"),
        ] {
            let error = level.check("h1", true).unwrap_err().to_string();
            assert!(error.contains(value), "{error}");
        }
        let text = "h = { std = 0.1, per = \"second\" }";
        let per_second =
            toml::from_str::<std::collections::BTreeMap<String, NoiseLevel>>(text).unwrap()["h"];
        assert!(per_second.check("h", true).is_ok());
        let error = per_second.check("y", false).unwrap_err().to_string();
        assert!(error.contains("give an output std alone"), "{error}");
    }
}
