//! Decision by posterior mass: one rule, so that no answer contradicts its probabilities.
//!
//! ```text
//! family : the most probable sets, until they hold half of all mass, and all within 3 nats of the first
//! none   : listed effects, alone and beside something unknown, hold less than half
//! named  : the family is one set, but for larger ones;  class: it is several;  partial: something unknown beside them is more probable than not
//! ```

use super::posterior::{Mass, Posterior};
use crate::diagnose::outcome::{Decision, TargetShare, Verdict};
use crate::diagnose::thresholds::THRESHOLDS;
use crate::effect::EffectKey;
use crate::math::descending;

/// Verdict, decision, the effects that the twin is given, their rivals, and the probabilities behind them.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::diagnose) struct Answer {
    pub verdict: Verdict,
    pub decision: Decision,
    pub accepted: Vec<String>,
    /// The accepted ones and their rivals.
    pub class: Vec<String>,
    pub posterior: Posterior,
}

impl Answer {
    /// The kind of gap: structural where the evidence says so, otherwise by whether θ left its prior significantly; nothing is decided yet.
    pub fn new(posterior: Posterior, left_prior: bool) -> Self {
        let verdict = match posterior.log_odds > THRESHOLDS.gap {
            true => Verdict::StructuralGap,
            false if left_prior => Verdict::ParameterGap,
            false => Verdict::NoGap,
        };
        Self {
            verdict,
            decision: Decision::NotNeeded,
            accepted: vec![],
            class: vec![],
            posterior,
        }
    }

    /// Decides which effects a structural gap is.
    pub fn decided(self) -> Self {
        let posterior = &self.posterior;
        let family = posterior.family();
        let Some(&first) = family.first() else {
            return Self {
                decision: Decision::NoneOfThese,
                ..self
            };
        };
        // An effect of the first set that is less probable than not is not accepted where another one is.
        let is_said = |key: &&String| posterior.name(key) >= THRESHOLDS.said;
        let said: Vec<String> = first.keys.iter().filter(is_said).cloned().collect();
        let first = (posterior.sets.iter().find(|set| set.keys == said)).unwrap_or(first);
        // A set that contains the first is no rival of it: it says that there may be more.
        let rivals = family.iter().filter(|set| !set.contains(first));
        let keys = (first.keys.iter()).chain(rivals.flat_map(|set| &set.keys));
        let mut class: Vec<String> = vec![];
        for key in (first.keys.iter()).chain(keys.flat_map(|key| posterior.all_names(key))) {
            if !class.contains(key) {
                class.push(key.clone());
            }
        }
        let accepted = first.keys.clone();
        let decision = match class.len() > accepted.len() {
            _ if posterior.kinds.partial > posterior.kinds.listed => Decision::Partial,
            true => Decision::Class,
            false => Decision::Named,
        };
        Self {
            decision,
            accepted,
            class,
            ..self
        }
    }

    /// The answer where what listed effects do was refuted: something unknown is missing.
    pub fn refuted(self) -> Self {
        Self {
            decision: Decision::NoneOfThese,
            accepted: vec![],
            class: vec![],
            posterior: self.posterior.without_names(),
            ..self
        }
    }

    /// The answer where noise had swallowed what is missing, so that nothing is missing with this probability only: something unknown, at one
    /// of these places if they are known.
    pub fn swallowed(self, nothing: f64, places: Vec<TargetShare>) -> Self {
        let refuted = self.refuted();
        Self {
            verdict: Verdict::StructuralGap,
            posterior: refuted.posterior.with_gap(nothing, places),
            ..refuted
        }
    }

    /// The place of the first accepted effect, or else the most probable one.
    pub fn place(&self) -> Option<String> {
        let first: Option<EffectKey> = self.accepted.first().and_then(|key| key.parse().ok());
        let most = || self.posterior.targets().into_iter().next();
        first.map_or_else(|| most().map(|t| t.target), |key| Some(key.target))
    }
}

impl Posterior {
    /// The sets that the answer is about; none where listed effects hold less than half of all mass.
    fn family(&self) -> Vec<&Mass> {
        let mut family: Vec<&Mass> = vec![];
        if self.kinds.listed + self.kinds.partial < THRESHOLDS.said {
            return family;
        }
        let mut held = 0.0;
        for set in &self.sets {
            let is_near = (family.first())
                .is_none_or(|first| set.all() > first.all() * (-THRESHOLDS.rivals).exp());
            if !is_near && held >= THRESHOLDS.said {
                break;
            }
            held += set.all();
            family.push(set);
        }
        family
    }

    /// A name, and others of the same effect.
    fn all_names<'s>(&'s self, key: &'s String) -> impl Iterator<Item = &'s String> {
        std::iter::once(key).chain(self.aliases.get(key).into_iter().flatten())
    }

    /// Places, most probable first.
    pub fn targets(&self) -> Vec<TargetShare> {
        let mut targets: Vec<TargetShare> = (self.places.iter())
            .map(|(target, probability)| TargetShare {
                target: target.clone(),
                probability: *probability,
            })
            .collect();
        descending(&mut targets, |a| a.probability);
        targets
    }
}
