//! Decision by posterior odds.
//!
//! ```text
//! D     = log Σ w_h·Z_h − log Z_nothing               w: 0.6 shared by listed effects, 0.4 by unknown functions;  a gap if D > 3
//! Z_nothing = Z_0 + mean_N Z_0(N)                     N: other kinds of noise, correlated or with outliers, and pairs of them
//! r(E)  = max_U log Z(E + U) − log Z(E)               E leaves nothing to explain if r < 4
//! named : the largest log Z of what leaves nothing;  a larger set must be 2 nats better, an unknown function alone must not be better
//! partial: the largest log Z, where it leaves a third at most;  an unknown function alone must not be better by 15 %
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
    /// Pairs of listed effects, best first.
    pub several: Vec<Found<'a>>,
    /// Sets of listed effects with what unknown functions add on top, best first.
    pub beside: Vec<(Vec<String>, Vec<Found<'a>>)>,
    /// Other kinds of noise alone, best first.
    pub noise: Vec<Found<'a>>,
    /// The likeliest kind of noise with each other one, best first.
    pub noise_pairs: Vec<Found<'a>>,
    /// Another kind of noise beside the best listed effect, which makes it likelier by these nats.
    pub noise_beside: Option<(String, f64)>,
}

/// Posterior probabilities.
#[derive(Debug, Clone, Default)]
pub(in crate::diagnose) struct Chances {
    /// Kinds of explanation.
    pub kinds: Probabilities,
    /// Listed effects by their keys: alone, as part of a set, or beside something unknown.
    pub effects: BTreeMap<String, f64>,
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
        self.beside.retain(|(keys, _)| !same(keys, &found.keys()));
        self.beside.push((found.keys(), on_top));
        leaves_nothing(found.gain, added)
    }

    /// Nats that unknown functions add on top of a set; `None` where that was not asked.
    pub fn left(&self, keys: &[String]) -> Option<f64> {
        let (_, on_top) = self.beside(keys)?;
        let own = self.gain(keys)?;
        Some(on_top.first().map_or(0.0, |f| f.gain - own))
    }

    /// Unknown functions on top of a set, best first.
    pub fn beside(&self, keys: &[String]) -> Option<(&[String], &[Found<'a>])> {
        let found = self.beside.iter().find(|(k, _)| same(k, keys))?;
        Some((&found.0, &found.1))
    }

    /// A set of listed effects.
    fn set(&self, keys: &[String]) -> Option<&Found<'a>> {
        (self.listed.iter().chain(&self.several)).find(|f| same(&f.keys(), keys))
    }

    /// The fitted model of a set.
    pub fn model(&self, keys: &[String]) -> Option<&Model<'a>> {
        self.set(keys)?.model.as_ref()
    }

    /// The model that explains most.
    pub fn best(&self) -> Option<&Model<'a>> {
        let on_top = self.beside.iter().flat_map(|(_, all)| all);
        (self
            .listed
            .iter()
            .chain(&self.several)
            .chain(&self.unknown)
            .chain(on_top))
        .filter(|f| f.model.is_some())
        .max_by(|a, b| a.gain.total_cmp(&b.gain))
        .and_then(|f| f.model.as_ref())
    }

    /// The listed effects that explain most, where something is missing.
    pub fn best_listed(&self) -> Option<&Model<'a>> {
        let all = self.listed.iter().chain(&self.several);
        let gain = |f: &&Found<'a>| f.gain - self.price(f.terms.len());
        let best = all.max_by(|a, b| gain(a).total_cmp(&gain(b)))?;
        best.model.as_ref().filter(|_| best.gain > Thresholds::GAP)
    }

    /// log of the evidence of a set over that of the twin.
    pub fn gain(&self, keys: &[String]) -> Option<f64> {
        self.set(keys).map(|f| f.gain)
    }

    /// Evidence of the best single effect.
    pub fn top(&self) -> f64 {
        self.listed.first().map_or(0.0, |f| f.gain)
    }

    /// Returns whether a pair explains more than any single effect, its price paid.
    pub fn wins(&self, pair: &Found<'_>) -> bool {
        pair.gain - self.price(2) > self.top()
    }

    /// Nats that so many effects together cost: one of all that could stand beside the first, in either order, and what could be the
    /// first law's fine print.
    pub fn price(&self, count: usize) -> f64 {
        let pairs = 0.5 * (self.listed.len() as f64 - 1.0);
        let top = self.top().max(0.0);
        (pairs.max(1.0).ln() + Thresholds::FINE_PRINT * top) * (count - 1) as f64
    }

    /// The kind of noise that the records ask for: where something is missing beside it, where nothing is without it.
    pub fn asks_for_noise(&self) -> Option<&Found<'a>> {
        let key = match &self.noise_beside {
            Some((key, nats)) if *nats > Thresholds::NOISE => key.clone(),
            _ => {
                let best = self.noise.first()?;
                let explains = best.gain > Thresholds::NOISE;
                let enough = self.chances().log_odds <= Thresholds::GAP;
                (explains && enough).then(|| best.last().key())?
            }
        };
        (self.noise.iter()).find(|f| f.model.is_some() && f.last().key() == key)
    }

    /// log of the evidence of nothing missing, whatever the noise, over that of the twin.
    fn nothing(&self) -> f64 {
        let [alone, pairs] = [&self.noise, &self.noise_pairs]
            .map(|all| log_mean(&all.iter().map(|f| f.gain).collect::<Vec<f64>>()));
        // The best of n kinds makes n − 1 of the n(n − 1)/2 pairs.
        let pairs = pairs - (0.5 * self.noise.len() as f64).ln();
        let all: Vec<f64> = [0.0, alone, pairs]
            .into_iter()
            .filter(|z| z.is_finite())
            .collect();
        log_mean(&all) + (all.len() as f64).ln()
    }

    /// Posterior probabilities of all hypotheses.
    pub fn chances(&self) -> Chances {
        let (listed, unknown) = (
            self.listed.len().max(1) as f64,
            self.unknown.len().max(1) as f64,
        );
        let each = Thresholds::LISTED / listed;
        let every = (1.0 - Thresholds::LISTED) / unknown;
        let places = |found: &Found<'_>| -> Vec<String> {
            found.terms.iter().map(|t| t.target.clone()).collect()
        };
        let mut all: Vec<Weighed> = vec![];
        for found in self.listed.iter().chain(&self.several) {
            all.push(Weighed {
                log_weight: each.ln() + found.gain - self.price(found.terms.len()),
                kind: Kind::Listed(found.keys()),
                places: places(found),
            });
        }
        for found in &self.unknown {
            all.push(Weighed {
                log_weight: every.ln() + found.gain,
                kind: Kind::Unknown,
                places: places(found),
            });
        }
        for (keys, on_top) in &self.beside {
            for found in on_top {
                let second = Thresholds::SECOND.ln() + every.ln() - self.price(keys.len());
                all.push(Weighed {
                    log_weight: each.ln() + second + found.gain,
                    kind: Kind::Partial,
                    places: places(found),
                });
            }
        }
        let logs: Vec<f64> = all.iter().map(|h| h.log_weight).collect();
        let sum = log_mean(&logs) + (logs.len() as f64).ln();
        let nothing = self.nothing();
        let log_odds = sum - nothing;
        let whole = sum.max(nothing) + (-log_odds.abs()).exp().ln_1p();
        let mut chances = Chances {
            kinds: Probabilities {
                nothing: (nothing - whole).exp(),
                ..Probabilities::default()
            },
            log_odds,
            ..Chances::default()
        };
        // Which set explains a part, the sets' own evidence says: what is beside them is not known well enough to choose by.
        let top = (all.iter())
            .filter(|h| matches!(h.kind, Kind::Listed(_)))
            .map(|h| h.log_weight)
            .fold(f64::NEG_INFINITY, f64::max);
        // Each set, its probability alone, and its weight among them.
        let mut sets: Vec<(Vec<String>, f64, f64)> = vec![];
        let kinds = &mut chances.kinds;
        for hypothesis in all {
            let p = (hypothesis.log_weight - whole).exp();
            for place in &hypothesis.places {
                *chances.places.entry(place.clone()).or_default() +=
                    p / hypothesis.places.len() as f64;
            }
            match hypothesis.kind {
                Kind::Unknown => kinds.unknown += p,
                Kind::Partial => kinds.partial += p,
                Kind::Listed(keys) => {
                    kinds.listed += p;
                    sets.push((keys, p, (hypothesis.log_weight - top).exp()));
                }
            }
        }
        let shares: f64 = sets.iter().map(|(.., share)| share).sum();
        for (keys, p, share) in sets {
            for key in keys {
                *chances.effects.entry(key).or_default() += p + kinds.partial * share / shares;
            }
        }
        chances
    }
}

/// A hypothesis and the log of its weight times its evidence, over those of nothing.
struct Weighed {
    log_weight: f64,
    kind: Kind,
    places: Vec<String>,
}

enum Kind {
    /// Listed effects alone.
    Listed(Vec<String>),
    /// Listed effects beside something unknown.
    Partial,
    /// Something unknown alone.
    Unknown,
}

/// Returns whether what an unknown function adds on top of a gain is no more than chance, or than a law's fine print.
pub(in crate::diagnose) fn leaves_nothing(gain: f64, added: f64) -> bool {
    added < Thresholds::ADEQUATE.max(Thresholds::FINE_PRINT * gain)
}

fn same(a: &[String], b: &[String]) -> bool {
    a.len() == b.len() && a.iter().all(|key| b.contains(key))
}

/// The decision, the effects that the twin is given, and their rivals.
#[derive(Debug, Clone)]
pub(in crate::diagnose) struct Conclusion {
    pub decision: Decision,
    pub accepted: Vec<String>,
    /// The accepted ones and their rivals.
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

impl Conclusion {
    /// Nothing listed explains the records.
    pub fn none_of_these() -> Self {
        Self {
            decision: Decision::NoneOfThese,
            ..Self::default()
        }
    }
}

/// Decides about a gap.
pub(in crate::diagnose) fn decide(
    findings: &Findings<'_>,
    chances: &Chances,
    most_effects: usize,
    has_equations: bool,
) -> Conclusion {
    let best_unknown = findings
        .unknown
        .first()
        .map_or(f64::NEG_INFINITY, |f| f.gain);
    let top = findings
        .listed
        .first()
        .map_or(f64::NEG_INFINITY, |f| f.gain);
    // (keys, value with its price, what is left)
    let singles = (findings.listed.iter()).filter(|f| f.gain > top - Thresholds::CANDIDATES);
    let candidates: Vec<(Vec<String>, f64, f64)> = singles
        .chain(&findings.several)
        .filter_map(|f| {
            let keys = f.keys();
            let left = findings.left(&keys)?;
            Some((keys, f.gain - findings.price(f.terms.len()), left))
        })
        .collect();
    let mut chosen: Option<&(Vec<String>, f64, f64)> = None;
    for count in 1..=most_effects {
        let best = (candidates.iter())
            .filter(|c| c.0.len() == count && leaves_nothing(c.1, c.2))
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
        return named(findings, chances, keys, Decision::Named);
    }
    // Listed effects that explain most, beside something unknown. What is inside a black box has no functions to stand for it.
    let best = (candidates.iter()).max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((keys, own, left)) = best
        && has_equations
        && *own > (1.0 - Thresholds::OUTDONE) * best_unknown
        && chances.kinds.partial > chances.kinds.unknown
        && *left < Thresholds::REST * (own + left)
    {
        return named(findings, chances, keys, Decision::Partial);
    }
    Conclusion::none_of_these()
}

/// A set that is named, with single effects that the records cannot tell from it.
fn named(
    findings: &Findings<'_>,
    chances: &Chances,
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
    // No name is worth saying that is, with all its rivals, less probable than not.
    let together: f64 = class
        .iter()
        .filter_map(|key| chances.effects.get(key))
        .sum();
    let alone = |key: &String| chances.effects.get(key).copied().unwrap_or(0.0);
    let refuted = keys.iter().any(|key| alone(key) < Thresholds::REFUTED);
    if refuted || together < Thresholds::SAID * keys.len() as f64 {
        return Conclusion::none_of_these();
    }
    let decision = match decision {
        Decision::Named if class.len() > keys.len() => Decision::Class,
        other => other,
    };
    Conclusion {
        decision,
        accepted: keys.to_vec(),
        class,
    }
}
