//! Everything that was found.
//!
//! ```text
//! r(E) = max_U log Z(E + U) − log Z(E)     E leaves nothing to explain if r < 4
//! ```

use super::found::{Found, own_theta};
use crate::diagnose::thresholds::Thresholds;
use crate::hypothesis::model::Model;
use crate::hypothesis::term::Nature;

/// Explanations of a kind from whose θ the twin is fitted again.
const STARTS: usize = 2;

/// Everything that was found.
#[derive(Default)]
pub(in crate::diagnose) struct Findings {
    /// Listed effects alone, best first.
    pub listed: Vec<Found>,
    /// Unknown functions alone, best first.
    pub unknown: Vec<Found>,
    /// Pairs of listed effects, best first.
    pub several: Vec<Found>,
    /// Sets of listed effects with what unknown functions add on top, best first.
    pub beside: Vec<(Vec<String>, Vec<Found>)>,
    /// Other kinds of noise alone, best first.
    pub noise: Vec<Found>,
    /// The likeliest kind of noise with each other one, best first.
    pub noise_pairs: Vec<Found>,
    /// Another kind of noise beside the best listed effect, which makes it likelier by these nats.
    pub noise_beside: Option<(String, f64)>,
    /// True where the search was cancelled: what is here is all that was found until then.
    pub is_partial: bool,
}

impl Findings {
    /// Notes what unknown functions add on top of a set; returns whether they add nothing of weight.
    pub fn add(&mut self, found: &Found, on_top: Option<Vec<Found>>) -> bool {
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
    pub fn beside(&self, keys: &[String]) -> Option<(&[String], &[Found])> {
        let found = self.beside.iter().find(|(k, _)| same(k, keys))?;
        Some((&found.0, &found.1))
    }

    /// A set of listed effects.
    pub fn set(&self, keys: &[String]) -> Option<&Found> {
        (self.listed.iter().chain(&self.several)).find(|f| same(&f.keys(), keys))
    }

    /// The fitted model of a set.
    pub fn model(&self, keys: &[String]) -> Option<&Model> {
        self.set(keys)?.model.as_ref()
    }

    /// The model that explains most.
    pub fn best(&self) -> Option<&Model> {
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
        let best = |all: &[Found]| -> Vec<Vec<f64>> {
            (all.iter().take(STARTS))
                .filter(|found| found.gain > Thresholds::BETTER)
                .filter_map(own_theta)
                .collect()
        };
        [best(&self.listed), best(&self.unknown)].concat()
    }

    /// Listed effects that may be what is missing: the best pair where it explains more than any single one, then all single ones near the
    /// best.
    pub fn candidates(&self) -> impl Iterator<Item = &Found> {
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

    /// Returns whether the best effect, pair or function has a frequency.
    pub fn leads_with_wave(&self) -> bool {
        let first = [&self.listed, &self.several, &self.unknown].map(|all| all.first());
        let best = first
            .into_iter()
            .flatten()
            .max_by(|a, b| a.gain.total_cmp(&b.gain));
        best.is_some_and(|found| found.terms.iter().any(|term| term.is_wave()))
    }

    /// The most probable of the best single effect and those within 3 nats of it.
    pub fn likeliest_single(&self) -> Option<&Found> {
        let posterior = self.posterior();
        let probability = |found: &Found| posterior.name(&found.last().key());
        (self.listed.iter())
            .filter(|found| found.gain > self.top() - Thresholds::RIVALS)
            .max_by(|a, b| probability(a).total_cmp(&probability(b)))
    }

    /// Returns whether a pair explains more than any single effect, its price paid.
    pub fn wins(&self, pair: &Found) -> bool {
        pair.gain - self.price(2) > self.top()
    }

    /// The effect of a pair that explains more alone.
    pub fn likelier_of(&self, pair: &Found) -> Option<&Found> {
        let keys = pair.keys();
        self.listed.iter().find(|f| keys.contains(&f.last().key()))
    }

    /// Nats that so many effects together cost: their prior, and the fine print of the first law.
    pub fn price(&self, count: usize) -> f64 {
        self.prior(count) + Thresholds::FINE_PRINT * self.top().max(0.0) * (count - 1) as f64
    }

    /// Nats of the prior that something else is missing beside the first effect, one of all that are listed, in either order.
    pub(super) fn prior(&self, count: usize) -> f64 {
        let pairs = 0.5 * (self.listed.len() as f64 - 1.0);
        let second = Thresholds::SECOND * Thresholds::LISTED / pairs.max(1.0);
        -second.ln() * (count - 1) as f64
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
    fn noise_of(&self, key: &str) -> Option<&Found> {
        (self.noise.iter()).find(|f| f.model.is_some() && f.last().key() == key)
    }

    /// The kind of noise that the records ask for: where something is missing beside it, where nothing is without it.
    pub fn asks_for_noise(&self) -> Option<&Found> {
        if let Some(key) = self.beside_noise() {
            return self.noise_of(key);
        }
        let best = self.noise.first()?;
        let explains = best.gain > Thresholds::NOISE;
        let enough = self.posterior().log_odds <= Thresholds::GAP;
        (explains && enough).then(|| self.noise_of(&best.last().key()))?
    }

    /// Unknown functions that are not the library's. A wave at another place is no rival of a listed wave that explains as much: it is
    /// the same law with the same prior, which no evidence can tell from it.
    pub fn rivals(&self) -> impl Iterator<Item = &Found> {
        let wave = (self.listed.iter())
            .filter(|f| f.last().is_listed_wave())
            .map(|f| f.gain)
            .fold(f64::NEG_INFINITY, f64::max);
        (self.unknown.iter()).filter(move |f| {
            f.last().nature != Nature::Periodic || f.gain > wave + Thresholds::RIVALS
        })
    }
}

/// Returns whether what an unknown function adds on top of a gain is no more than chance, or than a law's fine print.
pub(in crate::diagnose) fn leaves_nothing(gain: f64, added: f64) -> bool {
    added < Thresholds::ADEQUATE.max(Thresholds::FINE_PRINT * gain)
}

/// Returns whether unknown functions on top of a set, best first, leave nothing that is worth a word.
pub(in crate::diagnose) fn suffices(found: &Found, on_top: &[Found]) -> bool {
    let added = on_top.first().map_or(0.0, |f| f.gain - found.gain);
    leaves_nothing(found.gain, added)
}

fn same(a: &[String], b: &[String]) -> bool {
    a.len() == b.len() && a.iter().all(|key| b.contains(key))
}

#[cfg(test)]
pub(super) mod fixture {
    use super::*;
    use crate::hypothesis::term::fixture;
    use std::sync::Arc;

    /// An explanation of this nature that was not fitted.
    pub fn wave(nature: Nature, target: &str, gain: f64) -> Found {
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

    /// A second effect has to add its prior, and a little of what the first one explains; what may imitate the step's error is asked about
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
        assert_eq!(found(206.0), [200.0, 197.0]);
        assert_eq!(found(207.0), [207.0, 200.0, 197.0]);
    }
}
