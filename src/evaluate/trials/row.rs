//! One trial: its truth, its answer, and the worth of the answer.

use super::answer::{Outcome, TrialAnswer, TrueShare};
use super::truth::Truth;
use crate::diagnose::Decision;
use crate::effect::EffectKey;
use crate::evaluate::trials::numbers::TRIAL;
use serde::Serialize;
use std::fmt;
use std::sync::Arc;

/// Worth of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Fate {
    /// Nothing is missing, and no structural gap was stated.
    Quiet,
    /// Nothing is missing, but a structural gap was stated.
    FalseAlarm,
    /// The accepted answer is right, complete, and holds nothing false beside it; or nothing listed is right, and none was accepted.
    Delivered,
    /// Everything accepted is right, but the answer says that something unknown remains: it does where one of two effects lacks.
    Partial,
    /// Everything accepted is right, but one of two effects lacks, and the answer says that nothing remains.
    Incomplete,
    /// A false effect was accepted, one of a class of rivals; the stated class holds a right one.
    InClass,
    /// A false effect was accepted.
    WrongName,
    /// The most probable effect is right and was not accepted.
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
        self.serialize(f)
    }
}

/// One trial.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TrialRow {
    /// For each departure the effects of the trial's library that are a right answer.
    pub right: Vec<Vec<String>>,
    pub truth: Truth,
    pub answer: TrialAnswer,
    /// The fitted true effects, where they were fitted.
    pub true_share: Option<TrueShare>,
    /// Names of the twin's parameters.
    pub parameters: Arc<[String]>,
}

impl TrialRow {
    /// Pairs a truth with its answer; `without`: the true effects were not in the trial's library.
    pub(super) fn new(
        truth: Truth,
        answer: TrialAnswer,
        true_share: Option<TrueShare>,
        parameters: Arc<[String]>,
        without: bool,
    ) -> Self {
        let mut right = truth.right.clone();
        if without {
            (right.iter_mut()).for_each(|set| set.retain(|key| !truth.effects.contains(key)));
        }
        Self {
            right,
            truth,
            answer,
            true_share,
            parameters,
        }
    }

    /// The result of the diagnosis; `None` where it failed.
    pub fn outcome(&self) -> Option<&Outcome> {
        self.answer.outcome.as_ref()
    }

    /// Labels of the departures, or `nothing`.
    pub fn truth_name(&self) -> String {
        match self.truth.labels.is_empty() {
            true => "nothing".into(),
            false => self.truth.labels.join(" + "),
        }
    }

    /// Name of the nuisance.
    pub fn nuisance(&self) -> String {
        self.truth.conditions.nuisance.id().to_owned()
    }

    /// Returns true if a structural gap was stated.
    pub fn called(&self) -> bool {
        self.outcome().is_some_and(Outcome::is_structural)
    }

    /// Returns true if the diagnosis ended without an error.
    pub fn answered(&self) -> bool {
        self.answer.outcome.is_some()
    }

    /// Returns true if a structural gap was stated, and that nothing listed explains it all.
    pub fn says_unknown(&self) -> bool {
        self.decides(Decision::NoneOfThese) || self.decides(Decision::Partial)
    }

    /// Returns true if a structural gap was stated with this answer about its cause.
    pub fn decides(&self, decision: Decision) -> bool {
        self.called() && self.outcome().is_some_and(|o| o.decision == decision)
    }

    /// Returns true if an effect was accepted.
    pub fn accepts(&self) -> bool {
        self.outcome().is_some_and(|o| !o.accepted.is_empty())
    }

    /// Returns true if nothing is missing.
    pub fn is_null(&self) -> bool {
        !self.truth.kind.is_structural()
    }

    /// Returns true if the twin's own step shows.
    pub fn is_coarse(&self) -> bool {
        self.truth.step > TRIAL.coarse_step
    }

    /// Returns true if nothing is missing but a finer integration step.
    pub fn is_coarse_null(&self) -> bool {
        self.is_null() && self.is_coarse()
    }

    /// Returns true if nothing is missing, the step included.
    pub fn is_fine_null(&self) -> bool {
        self.is_null() && !self.is_coarse()
    }

    /// Returns true if the record decides: every listed effect that is wrong leaves more than 3 nats. False where that is not known.
    pub fn is_clear(&self) -> bool {
        let rival = self.truth.rival.as_ref();
        rival.is_some_and(|rival| rival.nats > TRIAL.clear_rival)
    }

    /// The evidence that the record holds for its true effect, where it was fitted; a pair has none, since it counts by its weaker one.
    pub fn held(&self) -> Option<f64> {
        self.true_share.filter(|_| self.right.len() == 1)?.held
    }

    /// Returns true if something is missing and no listed effect is right.
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
        let mut places = self.truth.targets.iter().chain(&self.truth.places);
        places.any(|true_place| true_place == place) || self.right.iter().flatten().any(of_right)
    }

    /// Returns true if the stated place is a true one.
    pub fn place_is_right(&self) -> bool {
        let target = self.outcome().and_then(|o| o.target.as_ref());
        target.is_some_and(|target| self.is_true_place(target))
    }

    /// Returns true if the stated place or one of its rivals is a true one.
    pub fn places_hold_it(&self) -> bool {
        let places = self.outcome().map_or(&[][..], |o| &o.places);
        places.iter().any(|place| self.is_true_place(place))
    }

    /// Returns the worth of the answer.
    pub fn fate(&self) -> Fate {
        let Some(outcome) = self.outcome() else {
            return Fate::Failed;
        };
        let is_right = |key: &String| self.is_right(key);
        let says_more = outcome.decision == Decision::Partial;
        match self.fate_of(outcome.is_structural(), &outcome.accepted) {
            Fate::Abstained if outcome.top().is_some_and(|top| is_right(&top.key)) => Fate::Refused,
            Fate::WrongName if outcome.rivals().iter().any(is_right) => Fate::InClass,
            // Where one of two departures has no listed name, more is missing indeed.
            Fate::Delivered if says_more && !self.right.iter().any(Vec::is_empty) => Fate::Partial,
            Fate::Incomplete if says_more => Fate::Partial,
            fate => fate,
        }
    }

    /// Returns the worth of an answer that states a gap or not and accepts these effects.
    pub fn fate_of(&self, structural: bool, accepted: &[String]) -> Fate {
        let is_named =
            |set: &Vec<String>| set.is_empty() || set.iter().any(|key| accepted.contains(key));
        match (self.is_null(), structural) {
            (true, false) => Fate::Quiet,
            (true, true) => Fate::FalseAlarm,
            (false, false) => Fate::Missed,
            _ if accepted.is_empty() && self.must_abstain() => Fate::Delivered,
            _ if accepted.is_empty() => Fate::Abstained,
            _ if !accepted.iter().all(|key| self.is_right(key)) => Fate::WrongName,
            _ if self.right.iter().all(is_named) => Fate::Delivered,
            _ => Fate::Incomplete,
        }
    }

    /// Answer in one word or as `id@target`.
    pub fn answer_text(&self) -> String {
        self.outcome()
            .map_or_else(|| "failed".into(), Outcome::text)
    }
}
