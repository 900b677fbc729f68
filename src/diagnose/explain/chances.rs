//! Posterior probabilities of everything that was found.
//!
//! ```text
//! D     = log Σ w_h·Z_h − log Z_nothing               w: 0.6 shared by listed effects, 0.4 by unknown functions;  a gap if D > 3
//! Z_nothing = Z_0 + mean_N Z_0(N)                     N: other kinds of noise, correlated or with outliers, and pairs of them
//! ```

use super::findings::Findings;
use super::found::Found;
use crate::diagnose::outcome::Probabilities;
use crate::diagnose::thresholds::Thresholds;
use crate::fit::evidence::log_mean;
use crate::hypothesis::term::Term;
use std::collections::BTreeMap;
use std::sync::Arc;

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
    /// log of the evidence of all hypotheses over that of the twin.
    pub log_evidence: f64,
}

impl Chances {
    /// Probability of an effect; 0 for one that was not weighed.
    pub fn effect(&self, key: &str) -> f64 {
        self.effects.get(key).copied().unwrap_or(0.0)
    }
}

impl Findings {
    /// Returns whether a second effect explains something that an unknown function beside the first does not, but for the fine print of laws:
    /// few functions are searched there.
    fn needs_second(&self) -> bool {
        let best = |count: usize| {
            let sets = self.beside.iter().filter(|(keys, _)| keys.len() == count);
            let gains = sets.filter_map(|(_, on_top)| Some(on_top.first()?.gain));
            gains.reduce(f64::max)
        };
        match (best(1), best(2)) {
            (Some(one), Some(two)) => two - self.prior(2) > (1.0 - Thresholds::FINE_PRINT) * one,
            (one, two) => one.is_none() && two.is_some(),
        }
    }

    /// The listed effects at the place of an unknown function that explain nearly as much, and the share of each: the function is one of
    /// them in another form. Where the form of the best misses R nats, a lead of R over the others counts as one of 3 nats does where
    /// none are missed.
    fn holding(&self, unknown: &Found) -> Vec<(Vec<String>, f64)> {
        let least = (1.0 - Thresholds::OUTDONE) * unknown.gain;
        let place = unknown.last().target.as_str();
        let all: Vec<&Found> = (self.listed.iter())
            .filter(|f| f.gain > least && f.last().places().contains(&place))
            .collect();
        let best = all.iter().map(|f| f.gain).fold(f64::NEG_INFINITY, f64::max);
        let error = ((unknown.gain - best) / Thresholds::RIVALS).max(1.0);
        let logs: Vec<f64> = all.iter().map(|f| f.gain / error).collect();
        let sum = log_sum(&logs);
        (all.iter().zip(logs))
            .map(|(found, log)| (found.keys(), (log - sum).exp()))
            .collect()
    }

    /// Returns whether an unknown function is a set of listed effects in another form.
    pub fn is_held_by(&self, keys: &[String], unknown: &Found) -> bool {
        self.holding(unknown).iter().any(|(held, _)| held == keys)
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
        log_sum(&all)
    }

    /// log of the odds of a gap against none, noise being of the twin's own kind.
    pub fn log_odds_alone(&self) -> f64 {
        self.chances().log_odds + self.nothing()
    }

    /// Posterior probabilities of all hypotheses.
    pub fn chances(&self) -> Chances {
        let (listed, unknown) = (
            self.listed.len().max(1) as f64,
            self.unknown.len().max(1) as f64,
        );
        let each = Thresholds::LISTED / listed;
        let every = (1.0 - Thresholds::LISTED) / unknown;
        let mut all: Vec<Weighed> = vec![];
        for found in self.listed.iter().chain(&self.several) {
            all.push(Weighed {
                log_weight: each.ln() + found.gain - self.price(found.terms.len()),
                kind: Kind::Listed(found.keys()),
                places: places(&found.terms),
            });
        }
        for found in self.rivals() {
            all.push(Weighed {
                log_weight: every.ln() + found.gain,
                kind: match self.holding(found) {
                    effects if effects.is_empty() => Kind::Unknown,
                    effects => Kind::Rest(effects),
                },
                places: places(&found.terms),
            });
        }
        for (keys, on_top) in &self.beside {
            let own = self.gain(keys).unwrap_or(0.0);
            for found in on_top {
                let by_effects = (own / found.gain.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
                let second = Thresholds::SECOND.ln() + every.ln() - self.price(keys.len());
                all.push(Weighed {
                    log_weight: each.ln() + second + found.gain,
                    kind: Kind::Partial(keys.len(), by_effects),
                    places: (places(std::slice::from_ref(found.last())).into_iter())
                        .map(|(place, share)| (place, share * (1.0 - by_effects)))
                        .collect(),
                });
            }
        }
        let logs: Vec<f64> = all.iter().map(|h| h.log_weight).collect();
        let sum = log_sum(&logs);
        let nothing = self.nothing();
        let log_odds = sum - nothing;
        let whole = sum.max(nothing) + (-log_odds.abs()).exp().ln_1p();
        let mut chances = Chances {
            kinds: Probabilities {
                nothing: (nothing - whole).exp(),
                ..Probabilities::default()
            },
            log_odds,
            log_evidence: whole,
            ..Chances::default()
        };
        // Each set, its probability alone, and the log of its weight among them.
        let mut sets: Vec<(Vec<String>, f64, f64)> = vec![];
        // Probability of something unknown beside sets of each number of effects, and the part of it that the effects explain.
        let mut beside: BTreeMap<usize, [f64; 2]> = BTreeMap::new();
        let kinds = &mut chances.kinds;
        for hypothesis in all {
            let p = (hypothesis.log_weight - whole).exp();
            for (place, share) in hypothesis.places {
                *chances.places.entry(place).or_default() += p * share;
            }
            match hypothesis.kind {
                Kind::Unknown => kinds.unknown += p,
                Kind::Rest(effects) => {
                    kinds.partial += p;
                    for (keys, share) in effects {
                        for key in keys {
                            *chances.effects.entry(key).or_default() += p * share;
                        }
                    }
                }
                Kind::Partial(count, by_effects) => {
                    kinds.partial += p;
                    let of_count = beside.entry(count).or_default();
                    of_count[0] += p;
                    of_count[1] += p * by_effects;
                }
                Kind::Listed(keys) => {
                    kinds.listed += p;
                    sets.push((keys, p, hypothesis.log_weight));
                }
            }
        }
        // Which set explains a part, the sets' own evidence says: what is beside them is not known well enough to choose by. What is unknown
        // beside one effect says nothing for a second one, unless that is needed, too.
        let all_alike = self.needs_second();
        let count = |keys: &[String]| if all_alike { 1 } else { keys.len() };
        if all_alike {
            let sum = |i: usize| beside.values().map(|of_count| of_count[i]).sum();
            beside = BTreeMap::from([(1, [sum(0), sum(1)])]);
        }
        for (keys, p, log_weight) in &sets {
            let alike: Vec<f64> = (sets.iter())
                .filter(|(other, ..)| count(other) == count(keys))
                .map(|(.., log_weight)| *log_weight)
                .collect();
            let share = (log_weight - log_sum(&alike)).exp();
            let of_count = beside.get(&count(keys)).copied().unwrap_or_default();
            let [part, by_effects] = of_count.map(|p| p * share);
            for key in keys {
                *chances.effects.entry(key.clone()).or_default() += p + part;
            }
            let terms = self.set(keys).map_or(&[][..], |found| &found.terms);
            for (place, share) in places(terms) {
                *chances.places.entry(place).or_default() += by_effects * share;
            }
        }
        chances
    }
}

/// A hypothesis and the log of its weight times its evidence, over those of nothing.
struct Weighed {
    log_weight: f64,
    kind: Kind,
    /// Places, and the share of each.
    places: Vec<(String, f64)>,
}

enum Kind {
    /// Listed effects alone.
    Listed(Vec<String>),
    /// So many listed effects beside something unknown, and the share of the evidence that is theirs.
    Partial(usize, f64),
    /// A listed effect in another form: which, and the share of each.
    Rest(Vec<(Vec<String>, f64)>),
    /// Something unknown alone.
    Unknown,
}

/// Places of terms, and the share of each: a term's part of one is shared by the places of its names.
fn places(terms: &[Arc<Term>]) -> Vec<(String, f64)> {
    let mut all = vec![];
    for term in terms {
        let places = term.places();
        let share = 1.0 / (terms.len() * places.len()) as f64;
        all.extend(places.into_iter().map(|place| (place.to_owned(), share)));
    }
    all
}

/// log of the sum of exponentials.
fn log_sum(logs: &[f64]) -> f64 {
    log_mean(logs) + (logs.len() as f64).ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::explain::findings::fixture::wave;
    use crate::hypothesis::term::Nature;

    /// A function beside the first effect is no reason to believe in the second.
    #[test]
    fn what_is_beside_one_effect_is_not_credited_to_a_pair() {
        let single = |target: &str, gain| wave(Nature::Listed, target, gain);
        let (first, second) = (single("h1", 50.0), single("h2", 10.0));
        let mut pair = first.clone();
        pair.terms.extend(second.terms.clone());
        pair.gain = 66.0;
        let mut findings = Findings {
            several: vec![pair],
            ..Findings::default()
        };
        findings.add(&first, Some(vec![wave(Nature::Function, "h2", 75.0)]));
        let key = second.last().key();
        let pair = findings.several[0].clone();
        findings.listed = vec![first, second];
        let chances = findings.chances();
        assert!(chances.kinds.partial > 0.9);
        assert!(chances.effects[&key] < 0.1, "{}", chances.effects[&key]);
        // The first explains two thirds of the evidence, at its place.
        assert!((chances.places["h1"] - 2.0 / 3.0).abs() < 0.03);
        let sum: f64 = chances.places.values().sum();
        assert!((sum + chances.kinds.nothing - 1.0).abs() < 1e-9, "{sum}");
        // Unless the second one explains something that functions do not.
        findings.add(&pair, Some(vec![wave(Nature::Function, "h2", 90.0)]));
        let chances = findings.chances();
        assert!(chances.effects[&key] > 0.9, "{}", chances.effects[&key]);
    }

    /// A function of the level speaks for a loss there, and for friction as much if both miss as much of it: not if one misses little.
    #[test]
    fn a_function_speaks_for_all_that_it_may_be() {
        let of = |gain: f64| {
            let [loss, friction] = [("loss", 160.0), ("friction", 157.0)].map(|(id, gain)| {
                let mut found = wave(Nature::Listed, "h1", gain);
                let term = Arc::make_mut(found.terms.last_mut().unwrap());
                term.id = id.into();
                found
            });
            let findings = Findings {
                unknown: vec![wave(Nature::Function, "h1", gain)],
                listed: vec![loss, friction],
                ..Findings::default()
            };
            let key = findings.listed[0].last().key();
            findings.chances().effect(&key)
        };
        assert!(of(150.0) > 0.94, "{}", of(150.0));
        let far = of(180.0);
        assert!((0.5..0.7).contains(&far), "{far}");
    }

    /// A wave of the flow explains what a wave of the level does, and takes no probability from it, unless it explains more.
    #[test]
    fn the_same_wave_elsewhere_is_no_rival() {
        for (gain, expected) in [(45.0, 0.0), (60.0, 1.0)] {
            let findings = Findings {
                listed: vec![wave(Nature::Listed, "h1", 44.0)],
                unknown: vec![wave(Nature::Periodic, "actuator", gain)],
                ..Findings::default()
            };
            let unknown = findings.chances().kinds.unknown;
            assert!((unknown - expected).abs() < 1e-4, "{gain}: {unknown}");
        }
    }
}
