//! Decision by posterior odds.
//!
//! ```text
//! named : the largest log Z of what leaves nothing;  a larger set must be 2 nats better, an unknown function alone must not be better by 3
//! partial: the largest log Z, where it leaves a third at most;  an unknown function alone must not be better by 15 %, unless no other
//!          listed effect has a third of it;  nor may all of them be more probable than beside effects
//! ```

use super::chances::Chances;
use super::findings::{Findings, leaves_nothing};
use super::pairs::FIRST;
use crate::diagnose::outcome::Decision;
use crate::diagnose::thresholds::Thresholds;

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

/// Keys of a set, the nats of its evidence with its price paid, and those that functions add to it.
type Candidate = (Vec<String>, f64, f64);

/// Decides about a gap.
pub(in crate::diagnose) fn decide(
    findings: &Findings,
    chances: &Chances,
    most_effects: usize,
    has_equations: bool,
) -> Conclusion {
    let best_unknown = (findings.rivals().next()).map_or(f64::NEG_INFINITY, |f| f.gain);
    let top = findings
        .listed
        .first()
        .map_or(f64::NEG_INFINITY, |f| f.gain);
    let singles = (findings.listed.iter()).filter(|f| f.gain > top - Thresholds::CANDIDATES);
    let candidates: Vec<Candidate> = singles
        .chain(&findings.several)
        .filter_map(|f| {
            let keys = f.keys();
            let left = findings.left(&keys)?;
            Some((keys, f.gain - findings.price(f.terms.len()), left))
        })
        .collect();
    let mut chosen: Option<&Candidate> = None;
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
    chosen = chosen.map(|c| likeliest(c, &candidates, chances, |c| leaves_nothing(c.1, c.2)));
    // A function of the effect's own variable holds the effect: it refutes its form only if it is clearly better.
    if chosen.is_some_and(|c| best_unknown > c.1 + Thresholds::RIVALS) {
        chosen = None;
    }
    let mut most = most_effects;
    if let Some((keys, _, _)) = chosen {
        let conclusion = named(findings, chances, keys, Decision::Named);
        if conclusion.decision != Decision::NoneOfThese || keys.len() == 1 {
            return conclusion;
        }
        // A second effect that is no more probable than something unknown in its place: the first may explain most.
        most = keys.len() - 1;
    }
    // Listed effects that explain most, beside something unknown, or with so little left that chance may have made it. What is inside a
    // black box has no functions to stand for it. Of two of which one is refuted, the other may explain most.
    let kinds = &chances.kinds;
    let explains_most = |(keys, own, left): &Candidate| {
        has_equations
            && (*own > (1.0 - Thresholds::OUTDONE) * best_unknown
                || stands_alone(findings, keys, *own))
            && kinds.unknown
                < match leaves_nothing(*own, *left) {
                    true => kinds.partial,
                    false => kinds.partial + kinds.listed,
                }
            && *left < Thresholds::REST * (own + left)
    };
    (1..=most)
        .rev()
        .filter_map(|most| {
            let best = (candidates.iter())
                .filter(|c| c.0.len() <= most)
                .max_by(|a, b| a.1.total_cmp(&b.1))?;
            let best = likeliest(best, &candidates, chances, |_| true);
            explains_most(best).then(|| named(findings, chances, &best.0, Decision::Partial))
        })
        .find(|conclusion| conclusion.decision == Decision::Partial)
        .unwrap_or_else(Conclusion::none_of_these)
}

/// Returns whether no listed effect outside a set has a third of its nats: a law outside the library is imitated by several.
fn stands_alone(findings: &Findings, keys: &[String], own: f64) -> bool {
    let others = findings
        .listed
        .iter()
        .filter(|f| !keys.contains(&f.last().key()));
    others.map(|f| f.gain).fold(0.0, f64::max) < FIRST * own
}

/// The most probable of the candidates within 3 nats of the best one, and of as many effects: a function may be one of them in another
/// form, and speak for it.
fn likeliest<'c>(
    best: &'c Candidate,
    all: &'c [Candidate],
    chances: &Chances,
    may: impl Fn(&Candidate) -> bool,
) -> &'c Candidate {
    let probability = |c: &Candidate| -> f64 {
        let each = c.0.iter().map(|key| chances.effect(key));
        each.fold(1.0, f64::min)
    };
    (all.iter())
        .filter(|c| c.0.len() == best.0.len() && c.1 > best.1 - Thresholds::RIVALS && may(c))
        .fold(best, |a, b| match probability(b) > probability(a) {
            true => b,
            false => a,
        })
}

/// A set that is named, with single effects that the records cannot tell from it.
fn named(
    findings: &Findings,
    chances: &Chances,
    keys: &[String],
    decision: Decision,
) -> Conclusion {
    let own = findings.gain(keys).unwrap_or(f64::NAN);
    let mut class = keys.to_vec();
    let rivals = (findings.listed.iter().chain(&findings.several))
        .filter(|f| f.gain > own - Thresholds::RIVALS && f.terms.len() == keys.len());
    for term in (findings.set(keys).into_iter().chain(rivals)).flat_map(|found| &found.terms) {
        for key in term.keys() {
            if !class.contains(&key) {
                class.push(key);
            }
        }
    }
    // No name is worth saying that is, with all its rivals, less probable than not.
    let together: f64 = class.iter().map(|key| chances.effect(key)).sum();
    let refuted = (keys.iter()).any(|key| chances.effect(key) < Thresholds::REFUTED);
    if refuted || together < keys.len() as f64 - 1.0 + Thresholds::SAID {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::explain::findings::fixture::wave;
    use crate::hypothesis::term::Nature;

    /// An effect that leaves a little is told as a part while it and the rest are more probable than what is unknown alone.
    #[test]
    fn an_effect_that_leaves_little_is_a_part() {
        let decided = |unknown: f64| {
            let effect = wave(Nature::Listed, "h1", 50.0);
            let mut findings = Findings {
                unknown: (0..40).map(|_| wave(Nature::Function, "h2", 0.0)).collect(),
                ..Findings::default()
            };
            findings.unknown[0].gain = unknown;
            findings.add(&effect, Some(vec![wave(Nature::Function, "h2", 55.2)]));
            findings.listed.push(effect);
            decide(&findings, &findings.chances(), 2, true).decision
        };
        assert_eq!(decided(53.0), Decision::Partial);
        assert_eq!(decided(56.0), Decision::NoneOfThese);
    }

    /// An effect beside which an unknown function alone is much better is a part only if no other effect does anything like it.
    #[test]
    fn an_effect_that_stands_alone_is_a_part() {
        let decided = |other: f64| {
            let effect = wave(Nature::Listed, "h1", 120.0);
            let mut findings = Findings {
                unknown: (0..40).map(|_| wave(Nature::Function, "h2", 0.0)).collect(),
                ..Findings::default()
            };
            findings.unknown[0].gain = 150.0;
            findings.add(&effect, Some(vec![wave(Nature::Function, "h2", 170.0)]));
            findings.listed = vec![effect, wave(Nature::Listed, "h2", other)];
            decide(&findings, &findings.chances(), 2, true).decision
        };
        assert_eq!(decided(20.0), Decision::Partial);
        assert_eq!(decided(60.0), Decision::NoneOfThese);
    }

    /// The first of a pair still explains most where its second effect is less probable than something unknown in its place.
    #[test]
    fn the_first_of_a_refuted_pair_is_a_part() {
        let [first, second] =
            [("h1", 130.0), ("h2", 80.0)].map(|(at, gain)| wave(Nature::Listed, at, gain));
        let mut pair = second.clone();
        pair.terms.extend(first.terms.clone());
        pair.gain = 145.0;
        let mut findings = Findings {
            unknown: (0..40).map(|_| wave(Nature::Function, "y", 0.0)).collect(),
            ..Findings::default()
        };
        findings.add(&first, Some(vec![wave(Nature::Function, "y", 150.0)]));
        findings.add(&pair, Some(vec![wave(Nature::Function, "y", 149.2)]));
        findings.listed = vec![first.clone(), second];
        findings.several.push(pair);
        let conclusion = decide(&findings, &findings.chances(), 2, true);
        assert_eq!(conclusion.decision, Decision::Partial);
        assert_eq!(conclusion.accepted, first.keys());
    }
}
