//! One trial: what was true, what was answered, what that is worth.

use super::Kind;
use super::answer::{Answer, Outcome, Repeat};
use super::shares::TrueShare;
use super::truth::{Rival, Truth};
use crate::diagnose::Decision;
use crate::effect::EffectKey;
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};
use std::fmt;

/// A twin whose own step shows by more nats than this is no null: its integrator is the gap.
const COARSE: f64 = 1.0;
/// A record decides for the truth where every wrong name leaves more nats than this: odds of 20 to 1.
const CLEAR: f64 = 3.0;

/// Worth of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Fate {
    /// Nothing is missing, and nothing was said to be.
    Quiet,
    /// Nothing is missing, but a structural gap was stated.
    FalseAlarm,
    /// The accepted answer is right, complete, and holds nothing false beside it; or nothing listed is right, and none was accepted.
    Delivered,
    /// Everything accepted is right, but something unknown was said to remain: it does where one of two effects lacks.
    Partial,
    /// Everything accepted is right, but one of two effects lacks, and nothing was said to remain.
    Incomplete,
    /// A false effect was accepted, one of a class of rivals; the class that was stated holds a right one.
    InClass,
    /// A false effect was accepted.
    WrongName,
    /// The effect on top is right and was not accepted.
    Refused,
    /// Nothing was accepted, although a listed effect is right.
    Abstained,
    /// No structural gap was stated.
    Missed,
    /// The diagnosis ended in an error.
    Failed,
}

impl fmt::Display for Fate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Quiet => "quiet",
            Self::FalseAlarm => "false alarm",
            Self::Delivered => "delivered",
            Self::Partial => "partial",
            Self::Incomplete => "incomplete",
            Self::InClass => "in class",
            Self::WrongName => "wrong name",
            Self::Refused => "refused",
            Self::Abstained => "abstained",
            Self::Missed => "missed",
            Self::Failed => "failed",
        })
    }
}

/// Departures of a trial by name.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Missing {
    /// Labels of the departures, or `nothing`.
    pub name: String,
    /// The nearest listed effect that is no right answer.
    pub rival: Option<Rival>,
    /// Places that mean the same as those of the departures.
    pub places: Vec<String>,
}

impl From<&str> for Missing {
    /// Creates departures with no rival and no other place.
    fn from(name: &str) -> Self {
        Self {
            name: name.into(),
            rival: None,
            places: vec![],
        }
    }
}

/// One trial.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Row {
    pub trial: usize,
    pub kind: Kind,
    pub truth: Missing,
    /// For each departure the effects of the trial's library that are a right answer.
    pub right: Vec<Vec<String>>,
    /// Places of the departures.
    pub targets: Vec<String>,
    /// Expected information in nats.
    pub information: Option<f64>,
    /// Nats by which the twin's own step shows.
    pub step: f64,
    /// Nuisance of the record.
    pub nuisance: String,
    /// Names and true values of the parameters.
    pub theta: Vec<(String, f64)>,
    /// Draws given up before this one.
    pub redraws: u64,
    pub outcome: Option<Outcome>,
    pub failure: Option<String>,
    pub seconds: f64,
    pub correlated: Option<String>,
    pub greedy: Option<Vec<String>>,
    pub repeats: Vec<Repeat>,
    /// The true effects, fitted, where that was done.
    pub true_share: Option<TrueShare>,
}

impl Row {
    /// Puts a truth beside its answer; `without`: the true effects were not in the trial's library.
    pub(super) fn new(
        truth: &Truth,
        answer: &Answer,
        true_share: Option<TrueShare>,
        parameters: &[String],
        without: bool,
    ) -> Self {
        let left_out = |key: &String| without && truth.effects.contains(key);
        let right = (truth.right.iter())
            .map(|set| set.iter().filter(|key| !left_out(key)).cloned().collect())
            .collect();
        Self {
            trial: truth.trial,
            kind: truth.kind,
            truth: Missing {
                name: match truth.labels.is_empty() {
                    true => "nothing".into(),
                    false => truth.labels.join(" + "),
                },
                rival: truth.rival.clone(),
                places: truth.places.clone(),
            },
            right,
            targets: truth.targets.clone(),
            information: truth.information,
            step: truth.step,
            nuisance: truth.conditions.nuisance.to_string(),
            theta: (parameters.iter().cloned())
                .zip(truth.theta.iter().copied())
                .collect(),
            redraws: truth.redraws,
            outcome: answer.outcome.clone(),
            failure: answer.failure.clone(),
            seconds: answer.seconds,
            correlated: answer.correlated.clone(),
            greedy: answer.greedy.clone(),
            repeats: answer.repeats.clone(),
            true_share,
        }
    }

    /// Returns true if a structural gap was stated.
    pub fn called(&self) -> bool {
        self.outcome.as_ref().is_some_and(Outcome::is_structural)
    }

    /// Returns true if a structural gap was stated, and that nothing listed explains it all.
    pub fn says_unknown(&self) -> bool {
        let decision = self.outcome.as_ref().map(|o| o.decision);
        let unknown = [Decision::NoneOfThese, Decision::Partial];
        self.called() && decision.is_some_and(|decision| unknown.contains(&decision))
    }

    /// Returns true if nothing is missing.
    pub fn is_null(&self) -> bool {
        !self.kind.is_structural()
    }

    /// Returns true if nothing is missing but a finer integration step.
    pub fn is_coarse(&self) -> bool {
        self.is_null() && self.step > COARSE
    }

    /// Returns true if the twin's own step shows beside a departure.
    pub fn is_coarse_gap(&self) -> bool {
        !self.is_null() && self.step > COARSE
    }

    /// Returns true if the record decides: every listed effect that is wrong leaves more than 3 nats. False where that is not known.
    pub fn is_clear(&self) -> bool {
        let rival = self.truth.rival.as_ref();
        rival.is_some_and(|rival| rival.nats > CLEAR)
    }

    /// The evidence that the record holds for its true effect, where it was fitted; a pair has none, since it counts by its weaker one.
    pub fn held(&self) -> Option<f64> {
        self.true_share.filter(|_| self.right.len() == 1)?.held
    }

    /// Returns true if something is missing and nothing that the library lists is right.
    pub fn must_abstain(&self) -> bool {
        !self.is_null() && self.right.iter().all(Vec::is_empty)
    }

    /// Returns true if the key is a right answer to one of the departures.
    pub fn is_right(&self, key: &str) -> bool {
        self.right.iter().flatten().any(|right| right == key)
    }

    /// Returns true if a departure acts at this place or at one that means the same, or if a right answer does.
    pub fn is_true_place(&self, place: &str) -> bool {
        let of_right = |key: &String| {
            let key = key.parse::<EffectKey>();
            key.is_ok_and(|key| key.target == place)
        };
        let mut places = self.targets.iter().chain(&self.truth.places);
        places.any(|true_place| true_place == place) || self.right.iter().flatten().any(of_right)
    }

    /// Returns true if the place that is stated is a true one.
    pub fn place_is_right(&self) -> bool {
        let target = self.outcome.as_ref().and_then(|o| o.target.as_ref());
        target.is_some_and(|target| self.is_true_place(target))
    }

    /// Returns true if a true place is the one that is stated, or is among those that are told as its rivals.
    pub fn places_hold_it(&self) -> bool {
        let places = self.outcome.as_ref().map_or(&[][..], |o| &o.places);
        places.iter().any(|place| self.is_true_place(place))
    }

    /// Returns the worth of the answer.
    pub fn fate(&self) -> Fate {
        match &self.outcome {
            None => Fate::Failed,
            Some(outcome) => {
                let fate = self.fate_of(outcome.is_structural(), &outcome.accepted, || {
                    outcome.top().is_some_and(|top| self.is_right(&top.key))
                });
                let holds = outcome.rivals().iter().any(|key| self.is_right(key));
                let says_more = outcome.decision == Decision::Partial;
                match fate {
                    Fate::WrongName if holds => Fate::InClass,
                    // Where one of two departures has no listed name, more is missing indeed.
                    Fate::Delivered if says_more && !self.right.iter().any(Vec::is_empty) => {
                        Fate::Partial
                    }
                    Fate::Incomplete if says_more => Fate::Partial,
                    fate => fate,
                }
            }
        }
    }

    /// Returns the worth of an answer that states a gap or not, accepts these effects, and has a right one on top or not.
    pub fn fate_of(
        &self,
        structural: bool,
        accepted: &[String],
        top_is_right: impl FnOnce() -> bool,
    ) -> Fate {
        match (self.is_null(), structural) {
            (true, false) => return Fate::Quiet,
            (true, true) => return Fate::FalseAlarm,
            (false, false) => return Fate::Missed,
            (false, true) => {}
        }
        if accepted.is_empty() {
            return match self.must_abstain() {
                true => Fate::Delivered,
                false if top_is_right() => Fate::Refused,
                false => Fate::Abstained,
            };
        }
        if !accepted.iter().all(|key| self.is_right(key)) {
            return Fate::WrongName;
        }
        let is_complete = (self.right.iter())
            .all(|set| set.is_empty() || set.iter().any(|key| accepted.contains(key)));
        match is_complete {
            true => Fate::Delivered,
            false => Fate::Incomplete,
        }
    }

    /// Answer in one word or as `id@target`.
    pub fn answer(&self) -> String {
        (self.outcome.as_ref()).map_or_else(|| "failed".into(), Outcome::text)
    }
}

impl Serialize for Row {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut object = serializer.serialize_struct("Row", 20)?;
        object.serialize_field("trial", &self.trial)?;
        object.serialize_field("kind", &self.kind)?;
        object.serialize_field("truth", &self.truth.name)?;
        object.serialize_field("right", &self.right)?;
        object.serialize_field("rival", &self.truth.rival)?;
        object.serialize_field("targets", &self.targets)?;
        object.serialize_field("places", &self.truth.places)?;
        object.serialize_field("information", &self.information)?;
        object.serialize_field("held", &self.held())?;
        object.serialize_field("step_information", &self.step)?;
        object.serialize_field("nuisance", &self.nuisance)?;
        object.serialize_field("answer", &self.answer())?;
        object.serialize_field("fate", &self.fate())?;
        let outcome = self.outcome.as_ref();
        object.serialize_field("stated", &outcome.and_then(Outcome::stated))?;
        object.serialize_field("target", &outcome.and_then(|o| o.target.clone()))?;
        object.serialize_field("closed", &outcome.and_then(|o| o.closed))?;
        object.serialize_field("true_closed", &self.true_share.and_then(|s| s.closed))?;
        object.serialize_field("failure", &self.failure)?;
        object.serialize_field("redraws", &self.redraws)?;
        object.serialize_field("passes", &outcome.map(|o| o.passes))?;
        object.serialize_field("seconds", &self.seconds)?;
        object.end()
    }
}
