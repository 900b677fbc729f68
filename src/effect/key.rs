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
#[serde(from = "String", into = "String")]
pub struct EffectPattern {
    /// Id of the kind.
    pub id: String,
    /// The target; every target if none.
    pub target: Option<String>,
}

impl EffectPattern {
    /// Returns whether the pattern names this effect.
    pub fn matches(&self, key: &EffectKey) -> bool {
        self.id == key.id && self.target.as_ref().is_none_or(|t| *t == key.target)
    }
}

impl From<&str> for EffectPattern {
    fn from(text: &str) -> Self {
        match text.parse::<EffectKey>() {
            Ok(key) => key.into(),
            Err(_) => Self {
                id: text.into(),
                target: None,
            },
        }
    }
}

impl From<String> for EffectPattern {
    fn from(text: String) -> Self {
        text.as_str().into()
    }
}

impl From<EffectKey> for EffectPattern {
    fn from(key: EffectKey) -> Self {
        Self {
            id: key.id,
            target: Some(key.target),
        }
    }
}

impl From<EffectPattern> for String {
    fn from(pattern: EffectPattern) -> Self {
        pattern.to_string()
    }
}

impl fmt::Display for EffectPattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.target {
            Some(target) => write!(f, "{}@{target}", self.id),
            None => f.write_str(&self.id),
        }
    }
}
