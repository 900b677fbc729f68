//! One trial with its key opened: truth, answer, and the judgement of it.

use super::Kind;
use super::answer::{Answer, Outcome};
use super::opened::Opened;
use super::truth::Truth;
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

/// Nats from which on an effect is clear: it cannot be overlooked by chance.
const CLEAR: f64 = 12.0;

/// Held-out nats within which a listed effect is as good as an unlisted law.
const IMITATES: f64 = 6.0;

/// One trial with its key opened.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// From 0.
    pub trial: usize,
    /// Kind of truth.
    pub kind: Kind,
    /// Truth: `none`, `id@target`, two of them, or the name of something unlisted.
    pub truth: String,
    /// Listed effects that are right answers; none where the right answer is to abstain, or that nothing is wrong.
    pub right: Vec<String>,
    /// Effects that all have to be accepted.
    pub effects: Vec<String>,
    /// Places where the twin is wrong.
    pub targets: Vec<String>,
    /// From 0, hardly visible, to 1, obvious; of a pair, that of the weaker effect.
    pub strength: Option<f64>,
    /// Nats that the true effects gain when the diagnoser fits them.
    pub gain: Option<f64>,
    /// For a pair: nats that the weaker effect adds to the other one.
    pub added: Option<f64>,
    /// The share of the gap that the true system closes on the held-out data.
    pub share: Option<f64>,
    /// Held-out nats by which the best listed effect falls short of a law that is not listed.
    pub shortfall: Option<f64>,
    /// Result; none where the diagnosis failed.
    pub outcome: Option<Outcome>,
    /// Reason for a missing result.
    pub failure: Option<String>,
    /// Wall-clock seconds of the diagnosis.
    pub seconds: f64,
}

impl Serialize for Row {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let outcome = self.outcome.as_ref();
        let top = outcome.and_then(Outcome::top);
        let mut object = serializer.serialize_struct("Row", 19)?;
        object.serialize_field("trial", &self.trial)?;
        object.serialize_field("kind", &self.kind)?;
        object.serialize_field("truth", &self.truth)?;
        object.serialize_field("answer", &self.answer())?;
        object.serialize_field("right", &self.is_right())?;
        object.serialize_field("strength", &self.strength)?;
        object.serialize_field("added", &self.added)?;
        object.serialize_field("shortfall", &self.shortfall)?;
        object.serialize_field("gain", &self.gain)?;
        object.serialize_field("p_value", &outcome.map(|o| o.p_value))?;
        object.serialize_field("where", &outcome.and_then(|o| o.target.as_ref()))?;
        object.serialize_field("top", &top.map(|top| &top.key))?;
        object.serialize_field("probability", &top.map(|top| top.probability))?;
        object.serialize_field("class", &outcome.map(|o| &o.class))?;
        object.serialize_field("closed", &outcome.and_then(|o| o.closed))?;
        object.serialize_field("interval", &outcome.and_then(|o| o.interval))?;
        object.serialize_field("true_share", &self.share)?;
        object.serialize_field("failure", &self.failure)?;
        object.serialize_field("seconds", &self.seconds)?;
        object.end()
    }
}

impl Row {
    /// Joins a truth, an answer and the additions of the key; `without`: the true effects were not in the library.
    pub(super) fn new(truth: &Truth, answer: &Answer, opened: &Opened, without: bool) -> Self {
        let right = match truth.kind.is_structural() {
            true => (truth.right.iter())
                .filter(|key| !(without && truth.effects.contains(key)))
                .cloned()
                .collect(),
            false => vec![],
        };
        let named = match &truth.unlisted {
            Some(name) => format!("{name}@{}", truth.targets.join(" + ")),
            None => truth.effects.join(" + "),
        };
        Self {
            trial: truth.trial,
            kind: truth.kind,
            truth: match named.is_empty() {
                true => truth.kind.id().into(),
                false => named,
            },
            right,
            effects: truth.effects.clone(),
            targets: truth.targets.clone(),
            strength: truth.strength,
            gain: opened.gain,
            added: opened.added,
            share: opened.share,
            shortfall: opened.shortfall,
            outcome: answer.outcome.clone(),
            failure: answer.failure.clone(),
            seconds: answer.seconds,
        }
    }

    /// Returns true if a structural gap was found.
    pub fn called(&self) -> bool {
        self.outcome.as_ref().is_some_and(Outcome::is_structural)
    }

    /// Returns true if a structural gap was found, and none of the listed effects.
    pub fn abstained(&self) -> bool {
        self.outcome.as_ref().is_some_and(Outcome::abstains)
    }

    /// Returns true if the truth is a gap that no effect of the trial's library describes.
    pub fn must_abstain(&self) -> bool {
        self.kind.is_structural() && self.right.is_empty()
    }

    /// Returns true if the truth is such a gap, and no listed effect imitates it either.
    pub fn nothing_fits(&self) -> bool {
        self.must_abstain() && self.shortfall.is_some_and(|nats| nats > IMITATES)
    }

    /// Returns true if the truth is one effect that the trial's library has, and no double of it counts.
    pub fn is_single(&self) -> bool {
        matches!(self.kind, Kind::Listed | Kind::Parametrised) && !self.right.is_empty()
    }

    /// Returns true if the true effects gain more than chance could.
    pub fn is_clear(&self) -> bool {
        self.gain.is_some_and(|gain| gain > CLEAR)
    }

    /// Returns true if each effect of a pair gains more than chance could beside the other one.
    pub fn is_clear_pair(&self) -> bool {
        self.kind == Kind::Pair && self.added.is_some_and(|added| added > CLEAR)
    }

    /// Returns true if the effect on top is a true one.
    pub fn top_is_right(&self) -> bool {
        let top = self.outcome.as_ref().and_then(Outcome::top);
        top.is_some_and(|top| self.right.contains(&top.key))
    }

    /// Returns true if the true effect is in the class.
    pub fn class_is_right(&self) -> bool {
        let class = self.outcome.as_ref().map(|o| &o.class);
        class.is_some_and(|class| self.right.iter().any(|key| class.contains(key)))
    }

    /// Returns true if the place that is named is the true one.
    pub fn place_is_right(&self) -> bool {
        let target = self.outcome.as_ref().and_then(|o| o.target.as_ref());
        target.is_some_and(|target| self.targets.contains(target))
    }

    /// Returns true if every true effect, and nothing else, was accepted.
    pub fn accepted_are_right(&self) -> bool {
        let accepted = self.outcome.as_ref().map(|o| &o.accepted);
        accepted.is_some_and(|accepted| {
            accepted.len() == self.effects.len()
                && self.effects.iter().all(|key| accepted.contains(key))
        })
    }

    /// Returns true if the answer is right by the rule of its kind.
    pub fn is_right(&self) -> bool {
        match self.kind {
            Kind::None | Kind::Outside | Kind::Absorbed => self.outcome.is_some() && !self.called(),
            _ if self.must_abstain() => self.abstained(),
            Kind::Pair => self.accepted_are_right(),
            Kind::Confounded => self.class_is_right(),
            _ => self.called() && !self.abstained() && self.top_is_right(),
        }
    }

    /// The share closed that the answer states with an interval, beside that of the true system, where the answer is right.
    pub fn interval(&self) -> Option<([f64; 2], f64)> {
        let interval = self.outcome.as_ref()?.interval?;
        let named = self.is_right() && !self.must_abstain();
        Some((interval, self.share.filter(|_| named)?))
    }

    /// Answer in one word or as `id@target`.
    pub fn answer(&self) -> String {
        match &self.outcome {
            None => "failed".into(),
            Some(o) if !o.is_structural() => o.verdict.id().into(),
            Some(o) if o.accepted.is_empty() => o.decision.id().into(),
            Some(o) => o.accepted.join(" + "),
        }
    }
}
