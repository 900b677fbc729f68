//! An effect at one target of a twin.

use super::key::EffectKey;
use super::kind::{EffectKind, OtherState};
use super::law::TargetKind;
use super::magnitude::Magnitude;
use crate::record::{Quantity, Signals};
use crate::twin::{Law, TwinError};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A kind of effect at one target, with the magnitudes that are given; the others are free, a part of θ.
///
/// ```
/// use truetwin::effect::Catalogue;
///
/// let lag = Catalogue::default().effect("sensor-lag", "sensor")?.hold("tau", 2.5);
/// assert_eq!(lag.key().to_string(), "sensor-lag@sensor");
/// assert_eq!(lag.given("tau"), Some(2.5));
/// # Ok::<(), truetwin::twin::TwinError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Effect {
    key: EffectKey,
    other: Option<String>,
    given: BTreeMap<String, f64>,
    kind: Arc<EffectKind>,
}

impl Effect {
    pub(super) fn new(kind: Arc<EffectKind>, target: &str, other: Option<&str>) -> Self {
        Self {
            key: EffectKey::new(kind.id(), target),
            other: other.map(Into::into),
            given: BTreeMap::new(),
            kind,
        }
    }

    /// Creates an effect that no library lists.
    pub(crate) fn unlisted(kind: EffectKind, target: &str) -> Self {
        Self::new(Arc::new(kind), target, None)
    }

    /// Creates the effect of a file's table.
    pub(super) fn from_entry(
        kind: Arc<EffectKind>,
        entry: &EffectEntry,
    ) -> Result<Self, TwinError> {
        let (id, own) = (kind.id(), kind.other_state().map(OtherState::key));
        for (key, state) in [("from", &entry.from), ("to", &entry.to)] {
            let (at, problem) = match state {
                Some(state) if own != Some(key) => {
                    (key, format!("has no {key}; remove {key} = \"{state}\""))
                }
                None if own == Some(key) => (
                    "id",
                    format!(
                        "acts between two states; add {key} = \"…\", the name of {}",
                        match kind.other_state() {
                            Some(OtherState::To) => "the other one, or of the only one",
                            Some(OtherState::RateOfOrItself) =>
                                "the one whose rate the target is, or else of the target itself",
                            Some(OtherState::RateOf) => "the one whose rate the target is",
                            Some(OtherState::From) | None => "the other one",
                        }
                    ),
                ),
                _ => continue,
            };
            return Err(TwinError::effect(at, format!("effect {id} {problem}")));
        }
        let other = entry.from.as_deref().or(entry.to.as_deref());
        Ok(Self {
            given: entry.magnitudes.clone(),
            ..Self::new(kind.clone(), &entry.target, other)
        })
    }

    /// Holds a magnitude at a value.
    #[must_use]
    pub fn hold(mut self, magnitude: &str, value: f64) -> Self {
        self.given.insert(magnitude.into(), value);
        self
    }

    /// Sets the other state of a law between two: `from` which it acts, or `to` which it spills.
    #[must_use]
    pub fn with_other(mut self, state: &str) -> Self {
        self.other = Some(state.into());
        self
    }

    /// Returns the identity: id and target.
    pub fn key(&self) -> &EffectKey {
        &self.key
    }

    /// Returns the id.
    pub fn id(&self) -> &str {
        &self.key.id
    }

    /// Returns the target: `sensor`, `actuator` (numbered where there are several), a state or a parameter.
    pub fn target(&self) -> &str {
        &self.key.target
    }

    /// Returns the other state of a law between two.
    pub fn other(&self) -> Option<&str> {
        self.other.as_deref()
    }

    /// Returns the value of a magnitude, if it is given; what is not given is free, a part of θ.
    pub fn given(&self, magnitude: &str) -> Option<f64> {
        self.given.get(magnitude).copied()
    }

    /// Returns the given magnitudes by the names of the parameters that [`augment`](super::augment) adds for them.
    pub fn given_by_parameter(&self) -> impl Iterator<Item = (String, f64)> + '_ {
        let given = self.magnitudes().iter();
        given.filter_map(|m| Some((self.key().magnitude(m.name), self.given(m.name)?)))
    }

    /// Returns the magnitudes that are given.
    pub(super) fn all_given(&self) -> &BTreeMap<String, f64> {
        &self.given
    }

    /// Returns the kind.
    pub fn kind(&self) -> &Arc<EffectKind> {
        &self.kind
    }

    /// Returns what it does in a sentence with names in braces ([`EffectKind::with_sentence`]), if it has one.
    pub(crate) fn sentence(&self) -> Option<&str> {
        self.kind.sentence()
    }

    /// Returns the law.
    pub(crate) fn law(&self) -> &Law {
        self.kind.law()
    }

    /// Returns the magnitudes of the law, in the order of θ.
    pub fn magnitudes(&self) -> &[Magnitude] {
        self.kind.magnitudes()
    }

    /// Returns the names in θ of magnitudes at which it can be off, and where each is.
    pub(crate) fn off(&self) -> impl Iterator<Item = (String, f64)> + '_ {
        (self.named_magnitudes()).filter_map(|(name, m)| Some((name, m.off?)))
    }

    /// Returns the names in θ of all magnitudes, with what each is.
    pub(crate) fn named_magnitudes(&self) -> impl Iterator<Item = (String, &Magnitude)> + '_ {
        (self.magnitudes().iter()).map(|m| (self.key.magnitude(m.name), m))
    }

    /// Returns the table that a file holds of it.
    pub fn entry(&self) -> EffectEntry {
        let other = |key| {
            let own = self.kind.other_state().map(OtherState::key);
            self.other.clone().filter(|_| own == Some(key))
        };
        EffectEntry {
            id: self.key.id.clone(),
            target: self.key.target.clone(),
            from: other("from"),
            to: other("to"),
            magnitudes: self.given.clone(),
        }
    }
}

/// An `[[effect]]` table of a file, not yet looked up among the known kinds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table with id and target")]
pub struct EffectEntry {
    /// Id of the kind.
    pub id: String,
    /// The target.
    pub target: String,
    /// The state that acts on the target.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<String>,
    /// The state that takes what the target loses.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to: Option<String>,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: BTreeMap<String, f64>,
}

/// Returns the unit of a magnitude in those of a twin: the words `signal`, `state` and `from` of the library stand for the unit of what is
/// bent, and of the other state. Empty where it has none.
pub(crate) fn magnitude_unit(
    effect: &Effect,
    unit: &str,
    states: &[Quantity],
    signals: &Signals,
) -> String {
    let of_state = |name: &str| {
        let state = states.iter().find(|q| q.name == name);
        state.map_or("", |q| q.unit.as_str())
    };
    let of = |channels| channel(channels, effect.target()).map_or("", |q: &Quantity| &q.unit);
    let bent = match effect.law().target() {
        TargetKind::Sensor => of(&signals.outputs),
        TargetKind::Actuator => of(&signals.inputs),
        TargetKind::State => of_state(effect.target()),
        TargetKind::Parameter => "",
    };
    let other = effect.other().map_or("", of_state);
    let inside = |word: &str, own: &str| match own {
        "" | "-" | "1" => "1".to_owned(),
        own if unit == word || own.chars().all(char::is_alphanumeric) => own.to_owned(),
        own => format!("({own})"),
    };
    let text = (unit.replace("signal", &inside("signal", bent)))
        .replace("state", &inside("state", bent))
        .replace("from", &inside("from", other));
    match text.replace("1·", "").replace("·1", "").as_str() {
        "1" | "1/1" => String::new(),
        text => text.replace("/(1/s)", "·s").replace("(s)", "s"),
    }
}

/// Returns the channel of `sensor`, or of `sensor2`.
pub(crate) fn channel<'a>(channels: &'a [Quantity], target: &str) -> Option<&'a Quantity> {
    let number = target.trim_start_matches(|c: char| !c.is_ascii_digit());
    let index = number.parse().unwrap_or(1_usize).saturating_sub(1);
    channels.get(index)
}
