//! Identity of an effect: its id and its target.

use crate::twin::TwinError;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// An effect at one target; text writes it `id@target`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct EffectKey {
    /// Id of the kind, as in files.
    pub id: String,
    /// `sensor`, `actuator` (numbered where there are several), a state or a parameter.
    pub target: String,
}

impl EffectKey {
    /// Creates the key of effect `id` at `target`.
    pub fn new(id: &str, target: &str) -> Self {
        Self {
            id: id.into(),
            target: target.into(),
        }
    }

    /// Returns the name of the parameter that a magnitude adds to θ: `id@target.magnitude`.
    pub fn magnitude(&self, name: &str) -> String {
        format!("{self}.{name}")
    }
}

impl fmt::Display for EffectKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}@{}", self.id, self.target)
    }
}

impl FromStr for EffectKey {
    type Err = TwinError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text.split_once('@') {
            Some((id, target)) => Ok(Self::new(id, target)),
            None => Err(TwinError::effect(
                "id",
                format!("\"{text}\" is no effect at a target; write id@target"),
            )),
        }
    }
}

/// Effects chosen by name: an id, at every target, or `id@target`.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct EffectPattern(String);

impl EffectPattern {
    /// Returns whether the pattern names this effect.
    pub fn matches(&self, key: &EffectKey) -> bool {
        self.0 == key.id || self.0 == key.to_string()
    }

    /// Returns the text, with a target or without.
    pub(crate) fn as_str(&self) -> &str {
        &self.0
    }
}

impl From<&str> for EffectPattern {
    fn from(text: &str) -> Self {
        Self(text.into())
    }
}

impl From<String> for EffectPattern {
    fn from(text: String) -> Self {
        Self(text)
    }
}
