//! Posterior probabilities of sets of effects, of their places, and of kinds of explanation, from log Z alone.
//!
//! ```text
//! D    = log Σ w_h·Z_h − log Z_nothing        evidence for a gap; w: 0.6 shared by listed effects, 0.4 by unknown functions
//! odds = e^(D − 3)                            of a gap, prior odds 1 to 20: D > 3 is called, and then a gap is more probable than none
//! P(E) = Σ P(S), E ∈ S                        a name has the mass of the sets that contain it
//! ```
//!
//! An unknown function beside a set leaves it a part of the explanation if it adds less than a third; otherwise the set imitates an unknown law,
//! and its mass is that of the unknown. An effect that the function holds, as every function holds a constant, belongs to the set where
//! that explains more with it. An unknown function alone is a listed effect in another form as far as it is no better than an effect
//! of its own variable, at its place. What it explains more is something unknown beside the effect, if that is 15 % at most.

use crate::diagnose::outcome::{Probabilities, TargetShare};
use crate::diagnose::thresholds::{Price, THRESHOLDS};
use crate::math::{descending, log_mean};
use std::collections::BTreeMap;

/// Places and the share of each.
pub(in crate::diagnose) type Places = Vec<(String, f64)>;

/// A set of listed effects.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::diagnose) struct Set {
    pub keys: Vec<String>,
    /// log Z over that of the twin, in nats.
    pub log_z: f64,
    pub places: Places,
    /// Unknown functions beside the set, best first; `None` where they were not asked for.
    pub beside: Option<Vec<Function>>,
}

/// An unknown function.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::diagnose) struct Function {
    /// log Z over that of the twin, of the function with the set that it stands beside.
    pub log_z: f64,
    pub places: Places,
    /// Listed effects of the function's own variable at its place: the function holds them.
    pub holds: Vec<String>,
}

/// Everything that was weighed.
#[derive(Debug, Clone, PartialEq, Default)]
pub(in crate::diagnose) struct Hypotheses {
    /// log Z of nothing missing, whatever the noise, over that of the twin.
    pub nothing: f64,
    pub sets: Vec<Set>,
    /// Unknown functions alone.
    pub functions: Vec<Function>,
    /// Number of functions that share the prior of the unknown.
    pub searched: usize,
    /// False where functions cannot stand for what is inside the twin: nothing is then a part.
    pub has_equations: bool,
    /// Other names of effects that do the same in this twin.
    pub aliases: BTreeMap<String, Vec<String>>,
}

/// Posterior probability of a set of listed effects.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::diagnose) struct Mass {
    pub keys: Vec<String>,
    /// Mass of exactly these effects.
    pub alone: f64,
    /// Mass of these effects beside something unknown.
    pub beside: f64,
}

impl Mass {
    pub fn all(&self) -> f64 {
        self.alone + self.beside
    }

    /// Returns whether the set has every effect of another.
    pub fn contains(&self, other: &Self) -> bool {
        other.keys.iter().all(|key| self.keys.contains(key))
    }
}

/// Posterior probabilities; those of sets, of the unknown and of nothing add up to one.
#[derive(Debug, Clone, PartialEq, Default)]
pub(in crate::diagnose) struct Posterior {
    /// Sets of listed effects, most probable first.
    pub sets: Vec<Mass>,
    /// Names by probability.
    pub names: BTreeMap<String, f64>,
    /// Other names of effects.
    pub aliases: BTreeMap<String, Vec<String>>,
    /// Places of what explains the records, given a gap.
    pub places: BTreeMap<String, f64>,
    pub kinds: Probabilities,
    /// D: log of the odds of a gap, prior odds even.
    pub log_odds: f64,
    /// log of the evidence of all hypotheses over that of the twin.
    pub log_evidence: f64,
}

impl Posterior {
    /// Probability of a name; 0 of one that was not weighed.
    pub fn name(&self, key: &str) -> f64 {
        self.names.get(key).copied().unwrap_or(0.0)
    }

    /// The same where what listed effects do was refuted: their mass is that of the unknown.
    pub fn without_names(self) -> Self {
        let Probabilities {
            listed, partial, ..
        } = self.kinds;
        Self {
            kinds: Probabilities {
                listed: 0.0,
                partial: 0.0,
                unknown: self.kinds.unknown + listed + partial,
                ..self.kinds
            },
            names: self.names.into_keys().map(|key| (key, 0.0)).collect(),
            sets: vec![],
            ..self
        }
    }

    /// The same without names where a gap was shown otherwise: nothing is missing with this probability, or else something unknown, at one of
    /// these places where any are known.
    pub fn with_gap(self, nothing: f64, places: Vec<TargetShare>) -> Self {
        Self {
            kinds: Probabilities {
                nothing,
                unknown: 1.0 - nothing,
                ..self.kinds
            },
            places: match places.is_empty() {
                true => self.places,
                false => places
                    .into_iter()
                    .map(|t| (t.target, t.probability))
                    .collect(),
            },
            ..self
        }
    }
}

impl Hypotheses {
    fn price(&self) -> Price {
        Price::new(self.singles().count(), best(self.singles()))
    }

    fn singles(&self) -> impl Iterator<Item = &Set> {
        self.sets.iter().filter(|set| set.keys.len() == 1)
    }

    /// log weight of each listed effect, and of each unknown function.
    fn shares(&self) -> [f64; 2] {
        let each = THRESHOLDS.listed / self.singles().count().max(1) as f64;
        let every = (1.0 - THRESHOLDS.listed) / self.searched.max(1) as f64;
        [each.ln(), every.ln()]
    }

    /// Returns whether a set is a part of the explanation beside a function: it explains two thirds of what both do, and as much as
    /// functions alone nearly do, or as no other effect does.
    fn is_part(&self, set: &Set, function: &Function) -> bool {
        let own = set.log_z - self.price().of(set.keys.len());
        let added = function.log_z - set.log_z;
        let best_function = best_of(self.functions.iter().map(|f| f.log_z));
        let others = self.singles().filter(|s| !set.keys.contains(&s.keys[0]));
        let stands_alone = best(others).max(0.0) < own / 3.0;
        self.has_equations
            && added < THRESHOLDS.rest * (own + added)
            && (own > (1.0 - THRESHOLDS.outdone) * best_function || stands_alone)
    }

    /// The set beside which a function stands once effects that it holds in another form are told apart from it: the best known one.
    fn with_held<'s>(&'s self, set: &'s Set, function: &Function) -> &'s Set {
        let price = self.price();
        let own = |set: &Set| set.log_z - price.of(set.keys.len());
        let is_whole = |other: &&Set| {
            let is_told = |key| set.keys.contains(key) || function.holds.contains(key);
            set.keys.iter().all(|key| other.keys.contains(key)) && other.keys.iter().all(is_told)
        };
        let all = self.sets.iter().filter(is_whole);
        all.fold(set, |best, other| match own(other) > own(best) {
            true => other,
            false => best,
        })
    }

    /// The effects that a function holds in another form, with the share of its mass that is theirs; and whether they explain nearly all that
    /// it does, so that the rest of it is something unknown beside them.
    fn held_by<'s>(&'s self, function: &'s Function) -> (Vec<(&'s str, f64)>, bool) {
        let held: Vec<&Set> = (self.singles())
            .filter(|set| function.holds.contains(&set.keys[0]))
            .collect();
        let top = best(held.iter().copied());
        let credit = (top - function.log_z).min(0.0).exp();
        let sum: f64 = held.iter().map(|set| (set.log_z - top).exp()).sum();
        let leaves_rest =
            self.has_equations && top > (1.0 - THRESHOLDS.outdone) * function.log_z.max(0.0);
        let shares = (held.into_iter())
            .map(|set| (set.keys[0].as_str(), credit * (set.log_z - top).exp() / sum))
            .collect();
        (shares, leaves_rest)
    }

    /// Posterior probabilities.
    pub fn posterior(&self) -> Posterior {
        let ([each, every], price) = (self.shares(), self.price());
        let alone: Vec<f64> = (self.sets.iter())
            .map(|set| each + set.log_z - price.of(set.keys.len()))
            .collect();
        let unknown: Vec<f64> = self.functions.iter().map(|f| every + f.log_z).collect();
        let mut beside = vec![];
        for set in &self.sets {
            let second = THRESHOLDS.second.ln() + each + every - price.of(set.keys.len());
            for function in set.beside.iter().flatten() {
                beside.push((set, function, second + function.log_z));
            }
        }
        let sum = |fine_print: f64| {
            let beside = beside
                .iter()
                .map(|(.., log_weight)| log_weight - fine_print);
            log_sum(alone.iter().chain(&unknown).copied().chain(beside))
        };
        let odds = Odds::new(sum(0.0), self.nothing);
        // Which one: a second law pays the fine print of the first.
        let whole = sum(price.fine_print);
        let mass = |log_weight: f64| (log_weight - whole).exp() * odds.gap();
        let mut sums = Sums::new(&self.sets, &alone, mass);
        for (function, log_weight) in self.functions.iter().zip(&unknown) {
            let (held, leaves_rest) = self.held_by(function);
            sums.function(function, mass(*log_weight), &held, leaves_rest);
        }
        for (set, function, log_weight) in &beside {
            let set = self.with_held(set, function);
            let is_part = self.is_part(set, function);
            sums.beside(set, function, mass(log_weight - price.fine_print), is_part);
        }
        let masses = sums.divided(&self.sets, &alone, self.needs_second());
        sums.posterior(masses, odds, &self.aliases)
    }

    /// Returns whether a second effect explains something that an unknown function beside the first does not: few functions are searched
    /// there.
    fn needs_second(&self) -> bool {
        let best = |count: usize| {
            let sets = self.sets.iter().filter(|set| set.keys.len() == count);
            let firsts = sets.filter_map(|set| Some(set.beside.as_ref()?.first()?.log_z));
            firsts.reduce(f64::max)
        };
        match (best(1), best(2)) {
            (Some(one), Some(two)) => {
                two - self.price().prior > (1.0 - THRESHOLDS.fine_print) * one
            }
            (one, two) => one.is_none() && two.is_some(),
        }
    }
}

/// Evidence for and against a gap.
#[derive(Clone, Copy)]
struct Odds {
    /// log of the odds, prior odds even.
    even: f64,
    /// log of the evidence of all hypotheses.
    whole: f64,
}

impl Odds {
    fn new(gap: f64, nothing: f64) -> Self {
        Self {
            even: gap - nothing,
            whole: log_sum([gap, nothing].into_iter()),
        }
    }

    /// Probability of a gap.
    fn gap(self) -> f64 {
        1.0 / (1.0 + (THRESHOLDS.gap - self.even).exp())
    }
}

/// Masses while they are added up.
struct Sums {
    /// Mass of each set alone, in the order of the sets.
    alone: Vec<f64>,
    /// Mass of something unknown beside each number of effects, and the part of its evidence that is theirs.
    beside: BTreeMap<usize, [f64; 2]>,
    unknown: f64,
    places: BTreeMap<String, f64>,
    singles: BTreeMap<String, usize>,
}

impl Sums {
    fn new(sets: &[Set], alone: &[f64], mass: impl Fn(f64) -> f64) -> Self {
        let singles = sets
            .iter()
            .enumerate()
            .filter(|(_, set)| set.keys.len() == 1);
        let mut sums = Self {
            alone: alone.iter().map(|log| mass(*log)).collect(),
            beside: BTreeMap::new(),
            unknown: 0.0,
            places: BTreeMap::new(),
            singles: singles.map(|(i, set)| (set.keys[0].clone(), i)).collect(),
        };
        for (i, set) in sets.iter().enumerate() {
            sums.place(&set.places, sums.alone[i]);
        }
        sums
    }

    fn place(&mut self, places: &Places, mass: f64) {
        for (place, share) in places {
            *self.places.entry(place.clone()).or_default() += mass * share;
        }
    }

    /// Adds a function alone: the effects that it holds have their share of it. The rest is something unknown, beside an effect where that
    /// leaves it.
    fn function(
        &mut self,
        function: &Function,
        mass: f64,
        held: &[(&str, f64)],
        leaves_rest: bool,
    ) {
        self.place(&function.places, mass);
        let mut rest = mass;
        for (key, share) in held {
            if let Some(i) = self.singles.get(*key) {
                self.alone[*i] += mass * share;
                rest -= mass * share;
            }
        }
        let rest = rest.max(0.0);
        match leaves_rest {
            true => self.beside.entry(1).or_default()[0] += rest,
            false => self.unknown += rest,
        }
    }

    /// Adds a function beside a set.
    fn beside(&mut self, set: &Set, function: &Function, mass: f64, is_part: bool) {
        let by_effects = (set.log_z / function.log_z.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        self.place(&function.places, mass * (1.0 - by_effects));
        if is_part {
            let sums = self.beside.entry(set.keys.len()).or_default();
            sums[0] += mass;
            sums[1] += mass * by_effects;
        } else {
            self.place(&set.places, mass * by_effects);
            self.unknown += mass;
        }
    }

    /// Divides the mass beside effects: which set explains a part, the sets' own evidence says, since what is beside them is not known well
    /// enough to choose by. What is unknown beside one effect says nothing for a second one, unless that is needed, too.
    fn divided(&mut self, sets: &[Set], logs: &[f64], needs_second: bool) -> Vec<Mass> {
        let group = |set: &Set| if needs_second { 1 } else { set.keys.len() };
        if needs_second {
            let sum = |i: usize| self.beside.values().map(|all| all[i]).sum();
            self.beside = BTreeMap::from([(1, [sum(0), sum(1)])]);
        }
        let mut masses = vec![];
        for (i, (set, log)) in sets.iter().zip(logs).enumerate() {
            let alike = sets.iter().zip(logs);
            let alike = alike.filter(|(other, _)| group(other) == group(set));
            let share = (log - log_sum(alike.map(|(_, log)| *log))).exp();
            let beside = self.beside.get(&group(set)).copied().unwrap_or_default();
            self.place(&set.places, beside[1] * share);
            masses.push(Mass {
                keys: set.keys.clone(),
                alone: self.alone[i],
                beside: beside[0] * share,
            });
        }
        descending(&mut masses, |a| a.all());
        masses
    }

    fn posterior(
        mut self,
        sets: Vec<Mass>,
        odds: Odds,
        aliases: &BTreeMap<String, Vec<String>>,
    ) -> Posterior {
        let mut names: BTreeMap<String, f64> = BTreeMap::new();
        for mass in &sets {
            for key in &mass.keys {
                *names.entry(key.clone()).or_default() += mass.all();
            }
        }
        names.values_mut().for_each(|p| *p = p.min(1.0));
        let all = self.places.values().sum::<f64>().max(f64::MIN_POSITIVE);
        self.places.values_mut().for_each(|p| *p /= all);
        let kinds = Probabilities {
            listed: sets.iter().map(|m| m.alone).sum(),
            partial: sets.iter().map(|m| m.beside).sum(),
            unknown: self.unknown.max(0.0),
            nothing: 1.0 - odds.gap(),
        };
        Posterior {
            sets,
            names,
            aliases: aliases.clone(),
            places: self.places,
            kinds: kinds.normalised(),
            log_odds: odds.even,
            log_evidence: odds.whole,
        }
    }
}

fn best<'s>(sets: impl Iterator<Item = &'s Set>) -> f64 {
    best_of(sets.map(|set| set.log_z))
}

fn best_of(logs: impl Iterator<Item = f64>) -> f64 {
    logs.fold(f64::NEG_INFINITY, f64::max)
}

/// log of the sum of exponentials.
pub(in crate::diagnose) fn log_sum(logs: impl Iterator<Item = f64>) -> f64 {
    let logs: Vec<f64> = logs.filter(|log| !log.is_nan()).collect();
    log_mean(&logs) + (logs.len() as f64).ln()
}
