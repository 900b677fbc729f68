//! Everything that was found, and posterior probabilities.
//!
//! ```text
//! D     = log Σ w_h·Z_h − log Z_nothing               w: 0.6 shared by listed effects, 0.4 by unknown functions;  a gap if D > 3
//! Z_nothing = Z_0 + mean_N Z_0(N)                     N: other kinds of noise, correlated or with outliers, and pairs of them
//! r(E)  = max_U log Z(E + U) − log Z(E)               E leaves nothing to explain if r < 4
//! ```

use super::found::{Found, own_theta};
use crate::diagnose::hypotheses::term::{Nature, Term};
use crate::diagnose::model::Model;
use crate::diagnose::outcome::Probabilities;
use crate::diagnose::thresholds::Thresholds;
use crate::fit::evidence::log_mean;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Explanations of a kind from whose θ the twin is fitted again.
const STARTS: usize = 2;

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
    /// True where the search was cancelled: what is here is all that was found until then.
    pub is_partial: bool,
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
    /// log of the evidence of all hypotheses over that of the twin.
    pub log_evidence: f64,
}

impl Chances {
    /// Probability of an effect; 0 for one that was not weighed.
    pub fn effect(&self, key: &str) -> f64 {
        self.effects.get(key).copied().unwrap_or(0.0)
    }
}

impl<'a> Findings<'a> {
    /// Notes what unknown functions add on top of a set; returns whether they add nothing of weight.
    pub fn add(&mut self, found: &Found<'a>, on_top: Option<Vec<Found<'a>>>) -> bool {
        let Some(on_top) = on_top else { return false };
        let is_enough = suffices(found, &on_top);
        self.beside.retain(|(keys, _)| !same(keys, &found.keys()));
        self.beside.push((found.keys(), on_top));
        is_enough
    }

    /// Evidence of the best unknown function alone.
    pub fn best_unknown(&self) -> f64 {
        self.unknown.first().map_or(0.0, |f| f.gain)
    }

    /// Returns whether a set is known that leaves nothing of weight.
    pub fn some_suffices(&self) -> bool {
        (self.beside.iter())
            .any(|(keys, on_top)| self.set(keys).is_some_and(|found| suffices(found, on_top)))
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
    pub fn set(&self, keys: &[String]) -> Option<&Found<'a>> {
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

    /// θ of the twin beside the best single explanations: from there its own fit may go further than it went.
    pub fn thetas(&self) -> Vec<Vec<f64>> {
        let best = |all: &[Found<'a>]| -> Vec<Vec<f64>> {
            (all.iter().take(STARTS))
                .filter(|found| found.gain > Thresholds::BETTER)
                .filter_map(own_theta)
                .collect()
        };
        [best(&self.listed), best(&self.unknown)].concat()
    }

    /// Listed effects that may be what is missing: the best pair where it explains more than any single one, then all single ones near the
    /// best.
    pub fn candidates(&self) -> impl Iterator<Item = &Found<'a>> {
        let pair = (self.several.first()).filter(|pair| self.wins(pair));
        let near = self.top() - Thresholds::CANDIDATES;
        let singles = (self.listed.iter()).filter(move |found| found.gain > near);
        (pair.into_iter().chain(singles)).filter(|found| found.gain > Thresholds::GAP)
    }

    /// log of the evidence of a set over that of the twin.
    pub fn gain(&self, keys: &[String]) -> Option<f64> {
        self.set(keys).map(|f| f.gain)
    }

    /// Evidence of the best single effect.
    pub fn top(&self) -> f64 {
        self.listed.first().map_or(0.0, |f| f.gain)
    }

    /// The most probable of the best single effect and those within 3 nats of it.
    pub fn likeliest_single(&self) -> Option<&Found<'a>> {
        let chances = self.chances();
        let probability = |found: &Found<'_>| chances.effect(&found.last().key());
        (self.listed.iter())
            .filter(|found| found.gain > self.top() - Thresholds::RIVALS)
            .max_by(|a, b| probability(a).total_cmp(&probability(b)))
    }

    /// Returns whether a pair explains more than any single effect, its price paid.
    pub fn wins(&self, pair: &Found<'_>) -> bool {
        pair.gain - self.price(2) > self.top()
    }

    /// The effect of a pair that explains more alone.
    pub fn likelier_of(&self, pair: &Found<'_>) -> Option<&Found<'a>> {
        let keys = pair.keys();
        self.listed.iter().find(|f| keys.contains(&f.last().key()))
    }

    /// Nats that so many effects together cost: their prior, and what the first law's own form may leave.
    pub fn price(&self, count: usize) -> f64 {
        self.prior(count) + Thresholds::SECOND_SHARE * self.top().max(0.0) * (count - 1) as f64
    }

    /// Nats of the prior that something else is missing beside the first effect, one of all that are listed, in either order.
    fn prior(&self, count: usize) -> f64 {
        let pairs = 0.5 * (self.listed.len() as f64 - 1.0);
        let second = Thresholds::SECOND * Thresholds::LISTED / pairs.max(1.0);
        -second.ln() * (count - 1) as f64
    }

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

    /// Returns whether the records ask for another kind of noise beside the best listed effect.
    pub fn asks_beside(&self) -> bool {
        self.beside_noise()
            .is_some_and(|key| self.noise_of(key).is_some())
    }

    fn beside_noise(&self) -> Option<&str> {
        let (key, nats) = self.noise_beside.as_ref()?;
        (*nats > Thresholds::NOISE).then_some(key)
    }

    /// The fitted kind of noise of this key.
    fn noise_of(&self, key: &str) -> Option<&Found<'a>> {
        (self.noise.iter()).find(|f| f.model.is_some() && f.last().key() == key)
    }

    /// The kind of noise that the records ask for: where something is missing beside it, where nothing is without it.
    pub fn asks_for_noise(&self) -> Option<&Found<'a>> {
        if let Some(key) = self.beside_noise() {
            return self.noise_of(key);
        }
        let best = self.noise.first()?;
        let explains = best.gain > Thresholds::NOISE;
        let enough = self.chances().log_odds <= Thresholds::GAP;
        (explains && enough).then(|| self.noise_of(&best.last().key()))?
    }

    /// Unknown functions that are not the library's. A wave at another place is no rival of a listed wave that explains as much: it is
    /// the same law with the same prior, which no evidence can tell from it.
    pub fn rivals(&self) -> impl Iterator<Item = &Found<'a>> {
        let wave = (self.listed.iter())
            .filter(|f| f.last().is_listed_wave())
            .map(|f| f.gain)
            .fold(f64::NEG_INFINITY, f64::max);
        (self.unknown.iter()).filter(move |f| {
            f.last().nature != Nature::Periodic || f.gain > wave + Thresholds::RIVALS
        })
    }

    /// The best listed effect at the place of an unknown function, if it explains nearly as much: the function is that effect in another
    /// form.
    fn held_by(&self, unknown: &Found<'_>) -> Option<&Found<'a>> {
        let least = (1.0 - Thresholds::OUTDONE) * unknown.gain;
        let place = unknown.last().target.as_str();
        (self.listed.iter()).find(|f| f.gain > least && f.last().places().contains(&place))
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
                kind: match self.held_by(found) {
                    Some(effect) => Kind::Rest(effect.keys()),
                    None => Kind::Unknown,
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
                Kind::Rest(keys) => {
                    kinds.partial += p;
                    for key in keys {
                        *chances.effects.entry(key).or_default() += p;
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
    /// A listed effect in another form.
    Rest(Vec<String>),
    /// Something unknown alone.
    Unknown,
}

/// Returns whether what an unknown function adds on top of a gain is no more than chance, or than a law's fine print.
pub(in crate::diagnose) fn leaves_nothing(gain: f64, added: f64) -> bool {
    added < Thresholds::ADEQUATE.max(Thresholds::FINE_PRINT * gain)
}

/// Returns whether unknown functions on top of a set, best first, leave nothing that is worth a word.
pub(in crate::diagnose) fn suffices(found: &Found<'_>, on_top: &[Found<'_>]) -> bool {
    let added = on_top.first().map_or(0.0, |f| f.gain - found.gain);
    leaves_nothing(found.gain, added)
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

fn same(a: &[String], b: &[String]) -> bool {
    a.len() == b.len() && a.iter().all(|key| b.contains(key))
}

#[cfg(test)]
pub(super) mod fixture {
    use super::*;
    use crate::diagnose::hypotheses::term::fixture;
    use std::sync::Arc;

    /// An explanation of this nature that was not fitted.
    pub fn wave(nature: Nature, target: &str, gain: f64) -> Found<'static> {
        Found {
            terms: vec![Arc::new(fixture::wave(nature, target, 0.0))],
            gain,
            model: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::fixture::wave;
    use super::*;

    /// All pairs of n effects together are as probable as something else beside one of n, of the listed kind.
    #[test]
    fn a_second_effect_has_the_prior_of_something_else() {
        let n = 21;
        let findings = Findings {
            listed: (0..n).map(|_| wave(Nature::Listed, "h1", 0.0)).collect(),
            ..Findings::default()
        };
        let pairs = 0.5 * (n * (n - 1)) as f64;
        let share = pairs * (-findings.price(2)).exp() / n as f64;
        assert!((share - Thresholds::SECOND * Thresholds::LISTED).abs() < 1e-12);
        assert_eq!(findings.price(1), 0.0);
    }

    /// A second effect has to add a tenth of what the first one explains, and its prior; what may imitate the step's error is asked about
    /// it, the nearest rivals, too.
    #[test]
    fn a_second_effect_adds_a_share() {
        let found = |pair: f64| {
            let single = |gain| wave(Nature::Listed, "h1", gain);
            let mut several = single(pair);
            several.terms.extend(several.terms.clone());
            let findings = Findings {
                listed: vec![single(200.0), single(197.0), single(190.0)],
                several: vec![several],
                ..Findings::default()
            };
            findings.candidates().map(|f| f.gain).collect::<Vec<f64>>()
        };
        assert_eq!(found(221.0), [200.0, 197.0]);
        assert_eq!(found(223.0), [223.0, 200.0, 197.0]);
    }

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
