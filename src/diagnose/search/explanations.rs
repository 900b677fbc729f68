//! Everything that a search knows: one map from sets of terms to their evidence. Lists are queries, best first.
//!
//! ```text
//! r(E) = max_U log Z(E + U) − log Z(E)     E leaves nothing to explain if r < 4
//! ```

use crate::diagnose::thresholds::{Price, THRESHOLDS};
use crate::hypothesis::search::SEARCH;
use crate::hypothesis::search::explanation::Explanation;
use crate::hypothesis::search::model::Model;
use crate::hypothesis::set::TermSet;
use crate::hypothesis::term::{Nature, Part, Term};
use crate::math::descending;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Kind of term, as the answer weighs it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::diagnose) enum Class {
    Listed,
    Unknown,
    Noise,
}

impl Class {
    fn of(nature: Nature) -> Self {
        match nature {
            Nature::Listed => Self::Listed,
            Nature::Noise => Self::Noise,
            _ => Self::Unknown,
        }
    }
}

/// Explanations of the records, the twin alone among them.
#[derive(Clone)]
pub(in crate::diagnose) struct Explanations {
    known: BTreeMap<TermSet, Explanation>,
    /// Sets beside which unknown functions were fitted.
    extended: BTreeSet<TermSet>,
}

impl Explanations {
    /// The twin alone.
    pub fn new(twin: Explanation) -> Self {
        Self {
            known: BTreeMap::from([(TermSet::default(), twin)]),
            extended: BTreeSet::new(),
        }
    }

    /// Puts another fit of the twin in the place of its own; what unknown functions leave beside it is to be asked again.
    pub fn set_twin(&mut self, twin: Explanation) {
        self.known.insert(TermSet::default(), twin);
        self.extended.clear();
    }

    /// Adds an explanation: a fit in the place of a promise or of a worse fit, a promise in the place of an older one.
    pub fn add(&mut self, new: Explanation) {
        let set = new.set();
        let is_better = self.known.get(&set).is_none_or(|old| {
            match (old.model.is_some(), new.model.is_some()) {
                (true, is_fitted) => is_fitted && new.log_z > old.log_z,
                (false, _) => true,
            }
        });
        if is_better {
            self.known.insert(set, new);
        }
    }

    /// Adds unknown functions beside a set.
    pub fn extend(&mut self, set: TermSet, functions: Vec<Explanation>) {
        functions
            .into_iter()
            .for_each(|function| self.add(function));
        self.extended.insert(set);
    }

    /// log Z of all hypotheses together.
    pub fn log_z(&self) -> f64 {
        self.twin().log_z + self.posterior().log_evidence
    }

    /// log Z of the listed effect or pair that explains most, the price of a second one paid.
    pub fn listed_log_z(&self) -> f64 {
        let pairs = self
            .pairs()
            .into_iter()
            .map(|e| e.log_z - self.price().of(2));
        let singles = self.listed().into_iter().map(|e| e.log_z);
        pairs.chain(singles).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Those that others have as well.
    pub fn among(&self, others: &Self) -> Self {
        let mut both = self.clone();
        both.known.retain(|set, _| others.known.contains_key(set));
        both.extended.retain(|set| others.extended.contains(set));
        both
    }

    /// The twin alone.
    pub fn twin(&self) -> &Explanation {
        &self.known[&TermSet::default()]
    }

    /// log Z of an explanation over that of the twin, in nats.
    pub fn gain(&self, explanation: &Explanation) -> f64 {
        explanation.log_z - self.twin().log_z
    }

    /// The explanation by a set.
    pub fn get(&self, set: &TermSet) -> Option<&Explanation> {
        self.known.get(set)
    }

    /// The fitted model of a set.
    pub fn model(&self, set: &TermSet) -> Option<&Model> {
        self.get(set)?.model.as_ref()
    }

    /// Explanations by at least one term.
    pub fn all(&self) -> impl Iterator<Item = &Explanation> {
        self.known.values().filter(|e| !e.terms.is_empty())
    }

    /// Explanations by terms of these classes, in this order, best first.
    fn by(&self, classes: &[Class]) -> Vec<&Explanation> {
        sorted(self.all().filter(|e| {
            let own = e.terms.iter().map(|term| Class::of(term.nature));
            own.eq(classes.iter().copied())
        }))
    }

    /// Listed effects alone.
    pub fn listed(&self) -> Vec<&Explanation> {
        self.by(&[Class::Listed])
    }

    /// Unknown functions alone.
    pub fn unknown(&self) -> Vec<&Explanation> {
        self.by(&[Class::Unknown])
    }

    /// The best pairs of listed effects.
    pub fn pairs(&self) -> Vec<&Explanation> {
        let mut pairs = self.by(&[Class::Listed, Class::Listed]);
        pairs.truncate(THRESHOLDS.pairs);
        pairs
    }

    /// Other kinds of noise alone.
    pub fn noise(&self) -> Vec<&Explanation> {
        self.by(&[Class::Noise])
    }

    /// Pairs of other kinds of noise.
    pub fn noise_pairs(&self) -> Vec<&Explanation> {
        self.by(&[Class::Noise, Class::Noise])
    }

    /// Kinds of noise beside a listed effect.
    pub fn noise_beside(&self, effect: &Explanation) -> Vec<&Explanation> {
        let key = effect.last().key();
        let mut all = self.by(&[Class::Listed, Class::Noise]);
        all.retain(|e| e.terms[0].key() == key);
        all
    }

    /// Unknown functions beside a set; `None` where they were not fitted.
    pub fn beside(&self, set: &TermSet) -> Option<Vec<&Explanation>> {
        let is_beside = |e: &&Explanation| {
            let (own, others) = e.terms.split_last().expect("a term at least");
            Class::of(own.nature) == Class::Unknown && TermSet::of(others) == *set
        };
        let is_known = self.extended.contains(set);
        is_known.then(|| sorted(self.all().filter(is_beside)))
    }

    /// Nats that unknown functions add beside an explanation; `None` where they were not fitted.
    pub fn left(&self, explanation: &Explanation) -> Option<f64> {
        let beside = self.beside(&explanation.set())?;
        Some((beside.first()).map_or(0.0, |best| best.log_z - explanation.log_z))
    }

    /// Returns whether unknown functions beside an explanation add no more than chance, or than a law's fine print; `None` where they were
    /// not fitted.
    pub fn suffices(&self, explanation: &Explanation) -> Option<bool> {
        let own = self.gain(explanation);
        let least = THRESHOLDS.adequate.max(THRESHOLDS.fine_print * own);
        Some(self.left(explanation)? < least)
    }

    /// Nats of the best listed effect alone.
    pub fn top(&self) -> f64 {
        self.listed().first().map_or(0.0, |e| self.gain(e))
    }

    /// Nats of the best unknown function alone.
    pub fn best_unknown(&self) -> f64 {
        self.unknown().first().map_or(0.0, |e| self.gain(e))
    }

    /// The best effects and functions alone, so many of each that explain something.
    pub fn starts(&self, count: usize) -> Vec<&Explanation> {
        let all = [self.listed(), self.unknown()].into_iter();
        let best = all.flat_map(|all| all.into_iter().take(count));
        best.filter(|e| self.gain(e) > SEARCH.better).collect()
    }

    /// The fitted model that explains most, noise apart.
    pub fn best_model(&self) -> Option<&Model> {
        let is_noise = |term: &Arc<Term>| Class::of(term.nature) == Class::Noise;
        let is_gap = |e: &&Explanation| !e.terms.iter().any(is_noise);
        let fitted = self.all().filter(is_gap).filter(|e| e.model.is_some());
        let best = fitted.max_by(|a, b| a.log_z.total_cmp(&b.log_z))?;
        best.model.as_ref()
    }

    /// Returns whether the best effect, pair or function has a frequency.
    pub fn leads_with_wave(&self) -> bool {
        let first = [self.listed(), self.pairs(), self.unknown()].map(|all| all.first().copied());
        let best = (first.into_iter().flatten()).max_by(|a, b| a.log_z.total_cmp(&b.log_z));
        best.is_some_and(|e| e.terms.iter().any(|term| term.is_wave()))
    }

    /// Unknown functions that are not the library's. A wave at another place is no rival of a listed wave that explains as much: it is
    /// the same law with the same prior, which no evidence can tell from it.
    pub fn rivals(&self) -> Vec<&Explanation> {
        let wave = (self.listed().into_iter()).find(|e| e.last().is_listed_wave());
        let wave = wave.map_or(f64::NEG_INFINITY, |e| e.log_z);
        let mut all = self.unknown();
        all.retain(|e| e.last().nature != Nature::Periodic || e.log_z > wave + THRESHOLDS.rivals);
        all
    }

    /// Returns whether a pair explains more than any single effect, its price paid.
    pub fn wins(&self, pair: &Explanation) -> bool {
        self.gain(pair) - self.price().of(2) > self.top()
    }

    /// The best pair, if it explains more than any single effect.
    pub fn winning_pair(&self) -> Option<&Explanation> {
        let best = self.pairs().into_iter().next();
        best.filter(|pair| self.wins(pair))
    }

    /// The effects of a pair alone, best first.
    pub fn singles_of(&self, pair: &Explanation) -> Vec<&Explanation> {
        let keys: Vec<String> = pair.terms.iter().map(|term| term.key()).collect();
        let mut singles = self.listed();
        singles.retain(|e| keys.contains(&e.last().key()));
        singles
    }

    /// Nats that a second effect costs.
    pub fn price(&self) -> Price {
        Price::new(self.listed().len(), self.top())
    }

    /// Listed effects that may be what is missing: the best pair where it explains more than any single one, then all single ones near the
    /// best.
    pub fn candidates(&self) -> Vec<&Explanation> {
        let near = self.top() - SEARCH.candidates;
        let singles = self.listed().into_iter().filter(|e| self.gain(e) > near);
        let mut all: Vec<&Explanation> = self.winning_pair().into_iter().chain(singles).collect();
        all.retain(|e| self.gain(e) > THRESHOLDS.gap);
        all
    }

    /// The kind of noise alone that the records ask for beside listed effects: outliers and noise that grows with the signal beside the best one, or any kind that explains more
    /// beside one effect of the best pair than the other effect does and leaves nothing. Correlated noise beside an effect would otherwise
    /// pass for what that leaves.
    pub fn asks_for_noise_beside(&self) -> Option<&Explanation> {
        let with_noise = self.noise_instead_of_second();
        let with_noise = match with_noise.filter(|e| self.suffices(e) == Some(true)) {
            Some(with_noise) => with_noise,
            None => {
                let best = self.listed().into_iter().next()?;
                let mut all = self.noise_beside(best).into_iter();
                all.find(|e| is_noise_apart(e, best))?
            }
        };
        let single = self.get(&TermSet::of(&with_noise.terms[..1]))?;
        let is_likelier = with_noise.log_z - single.log_z > THRESHOLDS.noise;
        (is_likelier.then(|| self.get(&TermSet::of(&with_noise.terms[1..])))).flatten()
    }

    /// The best kind of noise beside one effect of the winning pair that explains more than the other effect does, its price paid.
    pub fn noise_instead_of_second(&self) -> Option<&Explanation> {
        let pair = self.winning_pair()?;
        let all = (self.singles_of(pair).into_iter()).flat_map(|single| self.noise_beside(single));
        let best = all.max_by(|a, b| a.log_z.total_cmp(&b.log_z))?;
        (best.log_z > pair.log_z - self.price().of(2)).then_some(best)
    }
}

/// Returns whether the last term of an explanation is noise that a correction does not imitate: outliers at another sensor than that of an
/// effect, or noise that grows with the signal.
pub(super) fn is_noise_apart(noise: &Explanation, effect: &Explanation) -> bool {
    let is_at = effect.last().target == noise.last().target;
    match noise.last().part {
        Part::Effect { .. } => !is_at,
        Part::Share { .. } => true,
        Part::Disturbance { .. } | Part::Function(_) => false,
    }
}

/// Best first.
fn sorted<'e>(all: impl Iterator<Item = &'e Explanation>) -> Vec<&'e Explanation> {
    let mut all: Vec<&Explanation> = all.collect();
    descending(&mut all, |a| a.log_z);
    all
}
