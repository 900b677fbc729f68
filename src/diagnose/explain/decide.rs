//! Decision by posterior odds.
//!
//! ```text
//! D     = log Σ w_h·Z_h − log Z_0                     w: 0.6 shared by listed effects, 0.4 by unknown functions;  a gap if D > 0
//! r(E)  = max_U log Z(E + U) − log Z(E)               E leaves nothing to explain if r < 4
//! named : the largest log Z of what leaves nothing;  a larger set must be 2 nats better, an unknown function alone must not be better
//! ```

use super::search::Found;
use crate::diagnose::model::Model;
use crate::diagnose::outcome::{Decision, Probabilities};
use crate::diagnose::thresholds::Thresholds;
use crate::fit::evidence::log_mean;
use std::collections::BTreeMap;

/// Everything that was found.
#[derive(Default)]
pub(in crate::diagnose) struct Findings<'a> {
    /// Listed effects alone, best first.
    pub listed: Vec<Found<'a>>,
    /// Unknown functions alone, best first.
    pub unknown: Vec<Found<'a>>,
    /// Pairs and triples of listed effects, best first.
    pub several: Vec<Found<'a>>,
    /// Sets of listed effects with what unknown functions add on top, best first.
    pub beside: Vec<(Vec<String>, Vec<Found<'a>>)>,
}

/// Posterior probabilities.
#[derive(Debug, Clone, Default)]
pub(in crate::diagnose) struct Chances {
    /// Nothing is missing.
    pub nothing: f64,
    /// Something unknown alone.
    pub unknown: f64,
    /// Sets of listed effects beside something unknown.
    pub parts: Vec<(Vec<String>, f64)>,
    /// Listed effects by their keys: alone, as part of a set, or beside something unknown.
    pub effects: BTreeMap<String, f64>,
    /// Sets of listed effects that explain everything.
    pub sets: Vec<(Vec<String>, f64)>,
    /// Places.
    pub places: BTreeMap<String, f64>,
    /// log of the odds of a gap against none, prior odds even.
    pub log_odds: f64,
}

impl<'a> Findings<'a> {
    /// Notes what unknown functions add on top of a set; returns whether they add nothing of weight.
    pub fn add(&mut self, found: &Found<'a>, on_top: Option<Vec<Found<'a>>>) -> bool {
        let Some(on_top) = on_top else { return false };
        let added = on_top.first().map_or(0.0, |f| f.gain - found.gain);
        self.beside.push((found.keys(), on_top));
        added < Thresholds::ADEQUATE
    }

    /// What unknown functions add on top of a set, in nats; `None` where that was not asked.
    pub fn left(&self, keys: &[String]) -> Option<f64> {
        let (_, on_top) = self.beside.iter().find(|(k, _)| same(k, keys))?;
        let own = self.gain(keys)?;
        Some(on_top.first().map_or(0.0, |f| f.gain - own))
    }

    /// What unknown functions add on top of a set, best first.
    pub fn beside(&self, keys: &[String]) -> Option<(&[String], &[Found<'a>])> {
        let found = self.beside.iter().find(|(k, _)| same(k, keys))?;
        Some((&found.0, &found.1))
    }

    /// The fitted model of a set.
    pub fn model(&self, keys: &[String]) -> Option<&Model<'a>> {
        (self.listed.iter().chain(&self.several))
            .find(|f| same(&f.keys(), keys))
            .and_then(|f| f.model.as_ref())
    }

    /// The model that explains most.
    pub fn best(&self) -> Option<&Model<'a>> {
        let on_top = self.beside.iter().flat_map(|(_, all)| all);
        (self.listed.iter().chain(&self.several).chain(&self.unknown).chain(on_top))
            .filter(|f| f.model.is_some())
            .max_by(|a, b| a.gain.total_cmp(&b.gain))
            .and_then(|f| f.model.as_ref())
    }

    /// log of the evidence of a set over that of the twin.
    pub fn gain(&self, keys: &[String]) -> Option<f64> {
        (self.listed.iter().chain(&self.several)).find(|f| same(&f.keys(), keys)).map(|f| f.gain)
    }

    /// Posterior probabilities of all hypotheses.
    pub fn chances(&self) -> Chances {
        let (listed, unknown) = (self.listed.len().max(1) as f64, self.unknown.len().max(1) as f64);
        let each = Thresholds::LISTED / listed;
        let every = (1.0 - Thresholds::LISTED) / unknown;
        // (log weight, listed effects, with something unknown, places)
        let mut all: Vec<(f64, Vec<String>, bool, Vec<String>)> = vec![];
        let places = |found: &Found<'_>| -> Vec<String> {
            found.terms.iter().map(|t| t.target.clone()).collect()
        };
        for found in &self.listed {
            all.push((each.ln() + found.gain, found.keys(), false, places(found)));
        }
        for found in &self.unknown {
            all.push((every.ln() + found.gain, vec![], true, places(found)));
        }
        let pair = (0.5 * (listed - 1.0)).max(1.0).ln();
        for found in &self.several {
            let price = pair * (found.terms.len() - 1) as f64;
            all.push((each.ln() + found.gain - price, found.keys(), false, places(found)));
        }
        for (keys, on_top) in &self.beside {
            let price = pair * (keys.len() - 1) as f64;
            for found in on_top {
                let weight = each.ln() + every.ln() + Thresholds::SECOND.ln() + found.gain - price;
                all.push((weight, keys.clone(), true, vec![found.last().target.clone()]));
            }
        }
        let logs: Vec<f64> = all.iter().map(|(w, ..)| *w).collect();
        let sum = log_mean(&logs) + (logs.len() as f64).ln();
        let nothing = 1.0 / (1.0 + sum.exp());
        let mut chances = Chances { nothing, log_odds: sum, ..Chances::default() };
        let whole = sum.max(0.0) + (-sum.abs()).exp().ln_1p();
        for (weight, keys, unknown, places) in all {
            let p = (weight - whole).exp();
            for key in &keys {
                *chances.effects.entry(key.clone()).or_default() += p;
            }
            match (unknown, keys.is_empty()) {
                (false, _) => chances.sets.push((keys, p)),
                (true, true) => chances.unknown += p,
                (true, false) => match chances.parts.iter_mut().find(|(k, _)| same(k, &keys)) {
                    Some((_, all)) => *all += p,
                    None => chances.parts.push((keys, p)),
                },
            }
            for place in &places {
                *chances.places.entry(place.clone()).or_default() += p / places.len() as f64;
            }
        }
        chances.sets.sort_by(|a, b| b.1.total_cmp(&a.1));
        chances.parts.sort_by(|a, b| b.1.total_cmp(&a.1));
        chances
    }
}

fn same(a: &[String], b: &[String]) -> bool {
    a.len() == b.len() && a.iter().all(|key| b.contains(key))
}

/// The decision, the effects that the twin is given, and their rivals.
#[derive(Debug, Clone)]
pub(in crate::diagnose) struct Conclusion {
    pub decision: Decision,
    pub accepted: Vec<String>,
    /// The accepted ones and their rivals; empty without any.
    pub class: Vec<String>,
}

impl Default for Conclusion {
    fn default() -> Self {
        Self {
            decision: Decision::NotNeeded,
            accepted: vec![],
            class: vec![],
        }
    }
}

impl Chances {
    /// Probabilities of the kinds of explanation.
    pub fn kinds(&self) -> Probabilities {
        Probabilities {
            listed: self.sets.iter().map(|(_, p)| p).sum(),
            partial: self.parts.iter().map(|(_, p)| p).sum(),
            unknown: self.unknown,
            nothing: self.nothing,
        }
    }
}

/// Decides about a gap.
pub(in crate::diagnose) fn decide(findings: &Findings<'_>, most_effects: usize) -> Conclusion {
    let best_unknown = findings.unknown.first().map_or(f64::NEG_INFINITY, |f| f.gain);
    let listed = findings.listed.len().max(2) as f64;
    let price = (0.5 * (listed - 1.0)).max(1.0).ln();
    let top = findings.listed.first().map_or(f64::NEG_INFINITY, |f| f.gain);
    // (keys, value with its price, what is left)
    let singles = (findings.listed.iter()).filter(|f| f.gain > top - Thresholds::CANDIDATES);
    let candidates: Vec<(Vec<String>, f64, f64)> = singles
        .chain(&findings.several)
        .filter_map(|f| {
            let keys = f.keys();
            let left = findings.left(&keys)?;
            Some((keys, f.gain - price * (f.terms.len() - 1) as f64, left))
        })
        .collect();
    let mut chosen: Option<&(Vec<String>, f64, f64)> = None;
    for count in 1..=most_effects {
        let best = (candidates.iter())
            .filter(|c| c.0.len() == count && c.2 < Thresholds::ADEQUATE)
            .max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some(best) = best
            && chosen.is_none_or(|c| best.1 > c.1 + Thresholds::WORTH_ANOTHER)
        {
            chosen = Some(best);
        }
    }
    if chosen.is_some_and(|c| best_unknown > c.1) {
        chosen = None;
    }
    if let Some((keys, _, _)) = chosen {
        return named(findings, keys, Decision::Named);
    }
    // Listed effects that explain most, beside something unknown.
    let chances = findings.chances();
    let partial: f64 = chances.parts.iter().map(|(_, p)| p).sum();
    let best = (candidates.iter())
        .filter(|c| chances.parts.iter().any(|(keys, _)| same(keys, &c.0)))
        .max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((keys, own, left)) = best
        && partial > chances.unknown
        && *left < Thresholds::REST * (own + left)
    {
        return named(findings, keys, Decision::Partial);
    }
    Conclusion {
        decision: Decision::NoneOfThese,
        ..Conclusion::default()
    }
}

/// A set that is named, with single effects that the records cannot tell from it.
fn named(
    findings: &Findings<'_>,
    keys: &[String],
    decision: Decision,
) -> Conclusion {
    let own = findings.gain(keys).unwrap_or(f64::NAN);
    let mut class = keys.to_vec();
    for found in findings.listed.iter().chain(&findings.several) {
        if found.gain > own - Thresholds::RIVALS && found.terms.len() == keys.len() {
            for key in found.keys() {
                if !class.contains(&key) {
                    class.push(key);
                }
            }
        }
    }
    let decision = match decision {
        Decision::Named if class.len() > keys.len() => Decision::Class,
        other => other,
    };
    Conclusion {
        decision,
        accepted: keys.to_vec(),
        class: if class.len() > keys.len() { class } else { vec![] },
    }
}
