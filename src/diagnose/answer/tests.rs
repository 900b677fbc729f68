//! Answers to random findings: none contradicts its own probabilities.

use super::posterior::{Function, Hypotheses, Set};
use super::*;
use crate::diagnose::outcome::{Decision, Diagnosis, EffectFit, Remains, TargetShare, Verdict};
use crate::twin::Noise;

/// Random numbers of one case.
pub(crate) struct Dice(Box<dyn FnMut() -> f64>);

impl Dice {
    pub(crate) fn new(case: u64) -> Self {
        let mut source = Noise::new(11, "answers", case).source("dice");
        Self(Box::new(move || source.uniform()))
    }

    fn below(&mut self, n: usize) -> usize {
        ((self.0)() * n as f64) as usize
    }

    fn chance(&mut self, p: f64) -> bool {
        (self.0)() < p
    }

    /// Mostly small, sometimes very large.
    fn nats(&mut self) -> f64 {
        let size = [3.0, 12.0, 60.0, 800.0][self.below(4)];
        size * (1.3 * (self.0)() - 0.3)
    }
}

const KEYS: [&str; 8] = [
    "state-ceiling@h1",
    "power-law@h1",
    "quadratic-drag@h2",
    "cross-coupling@h2",
    "constant-forcing@h1",
    "sensor-lag@sensor",
    "sensor-bias@sensor",
    "parameter-step@k1",
];

fn place(key: &str) -> String {
    key.split_once('@').unwrap().1.to_owned()
}

fn function(dice: &mut Dice, log_z: f64) -> Function {
    let at = place(KEYS[dice.below(KEYS.len())]);
    let holds = KEYS.iter().filter(|key| place(key) == at);
    let holds: Vec<String> = holds.map(|key| (*key).to_owned()).collect();
    Function {
        log_z,
        holds: if dice.chance(0.5) { holds } else { vec![] },
        places: vec![(at, 1.0)],
    }
}

/// Random findings: single effects near each other or far apart, pairs, functions alone and beside.
fn hypotheses(dice: &mut Dice) -> Hypotheses {
    let top = dice.nats();
    let near = [0.5, 4.0, 30.0][dice.below(3)];
    let mut sets: Vec<Set> = KEYS[..1 + dice.below(KEYS.len())]
        .iter()
        .map(|key| Set {
            keys: vec![(*key).to_owned()],
            log_z: top - near * (dice.0)(),
            places: vec![(place(key), 1.0)],
            beside: None,
        })
        .collect();
    let singles = sets.len();
    for _ in 0..dice.below(4) {
        let pair = [0, 1].map(|_| dice.below(singles));
        if pair[0] != pair[1] {
            let keys = pair.map(|i| sets[i].keys[0].clone()).to_vec();
            let places = keys.iter().map(|key| (place(key), 0.5)).collect();
            let log_z = top + dice.nats();
            if sets.iter().all(|set| set.keys != keys) {
                sets.push(Set {
                    keys,
                    log_z,
                    places,
                    beside: None,
                });
            }
        }
    }
    for set in &mut sets {
        if dice.chance(0.4) {
            let all = (0..dice.below(3)).map(|_| {
                let more = dice.nats();
                function(dice, set.log_z + more)
            });
            set.beside = Some(all.collect());
        }
    }
    let functions: Vec<Function> = (0..dice.below(6))
        .map(|_| {
            let log_z = top - 5.0 + dice.nats();
            function(dice, log_z)
        })
        .collect();
    Hypotheses {
        nothing: (0.2 * dice.nats()).max(0.0),
        searched: functions.len() + dice.below(60),
        sets,
        functions,
        has_equations: dice.chance(0.8),
        aliases: [("state-ceiling@h1".to_owned(), vec!["own-law@h1".to_owned()])]
            .into_iter()
            .filter(|_| dice.chance(0.2))
            .collect(),
    }
}

fn answer(dice: &mut Dice) -> Answer {
    let answer = Answer::new(hypotheses(dice).posterior(), dice.chance(0.3));
    match answer.verdict {
        Verdict::StructuralGap if dice.chance(0.05) => answer.decided().refuted(),
        Verdict::StructuralGap => answer.decided(),
        _ => answer,
    }
}

/// A diagnosis with a random answer, interrupted or not.
pub(crate) fn random_diagnosis(base: Diagnosis, dice: &mut Dice) -> Diagnosis {
    let answer = answer(dice);
    let mut diagnosis = base;
    let is_gap = answer.verdict == Verdict::StructuralGap;
    diagnosis.verdict = answer.verdict;
    diagnosis.interrupted = dice.chance(0.3);
    diagnosis.detection.log_evidence = answer.posterior.log_odds;
    diagnosis.detection.p_value = None;
    diagnosis.location.target = answer.place().filter(|_| is_gap);
    diagnosis.location.targets = answer.posterior.targets();
    diagnosis.location.class = match &diagnosis.location.target {
        Some(target) => TargetShare::alike(&diagnosis.location.targets, target),
        None => vec![],
    };
    let cause = &mut diagnosis.cause;
    let first = cause.effects[0].clone();
    let mut names: Vec<(String, f64)> = answer.posterior.names.clone().into_iter().collect();
    names.sort_by(|a, b| b.1.total_cmp(&a.1));
    names.sort_by_key(|(key, _)| !answer.accepted.contains(key));
    cause.effects = (names.into_iter())
        .map(|(key, probability)| {
            let (id, target) = key.split_once('@').unwrap();
            EffectFit {
                id: id.into(),
                target: target.into(),
                probability,
                also: answer
                    .posterior
                    .aliases
                    .get(&key)
                    .cloned()
                    .unwrap_or_default(),
                ..first.clone()
            }
        })
        .collect();
    cause.decision = answer.decision;
    cause.accepted = answer.accepted;
    cause.class = answer.class;
    cause.probabilities = answer.posterior.kinds;
    cause.next_input = cause
        .next_input
        .take()
        .filter(|_| cause.decision == Decision::Class);
    cause.remains = is_gap.then(|| Remains {
        place: "h2".into(),
        log_evidence: dice.nats().max(0.0),
        share: 0.1,
    });
    diagnosis
}

#[test]
fn no_answer_contradicts_its_probabilities() {
    let mut seen = std::collections::BTreeSet::new();
    for case in 0..1000 {
        let mut dice = Dice::new(case);
        let answer = answer(&mut dice);
        let posterior = &answer.posterior;
        let kinds = posterior.kinds;
        let all = [kinds.listed, kinds.partial, kinds.unknown, kinds.nothing];
        seen.insert(answer.decision.id());
        assert!(
            all.iter().all(|p| (0.0..=1.0).contains(p)),
            "{case}: {kinds:?}"
        );
        assert!(
            (all.iter().sum::<f64>() - 1.0).abs() < 1e-9,
            "{case}: {kinds:?}"
        );
        let places: f64 = posterior.places.values().sum();
        assert!(
            (places - 1.0).abs() < 1e-9 && posterior.places.values().all(|p| *p <= 1.0 + 1e-12)
        );
        // A name has the mass of the sets that contain it.
        for (key, p) in &posterior.names {
            let sets = posterior.sets.iter().filter(|set| set.keys.contains(key));
            let mass: f64 = sets.map(|set| set.all()).sum();
            assert!(
                (mass.min(1.0) - p).abs() < 1e-9 && *p <= 1.0,
                "{case}: {key}"
            );
            assert!(*p <= kinds.listed + kinds.partial + 1e-9, "{case}: {key}");
        }
        assert_eq!(
            answer.verdict == Verdict::StructuralGap,
            kinds.nothing < 0.5,
            "{case}"
        );
        let names = posterior.names.values().copied();
        let most = names.fold(0.0, f64::max);
        match answer.decision {
            Decision::NoneOfThese => {
                assert!(most < 0.5 && answer.accepted.is_empty(), "{case}: {most}");
            }
            Decision::Named => {
                assert!(kinds.listed >= kinds.partial, "{case}");
                assert!(
                    answer.accepted.iter().all(|key| posterior.name(key) >= 0.5),
                    "{case}"
                );
            }
            Decision::Partial | Decision::Class => {
                assert_eq!(
                    kinds.partial > kinds.listed,
                    answer.decision == Decision::Partial
                );
                let class = posterior.sets.iter();
                let class =
                    class.filter(|set| set.keys.iter().any(|key| answer.class.contains(key)));
                assert!(class.map(|set| set.all()).sum::<f64>() >= 0.5, "{case}");
            }
            Decision::Absorbed | Decision::NotNeeded => {}
        }
    }
    assert_eq!(seen.len(), 5, "{seen:?}");
}

fn set(key: &str, log_z: f64, beside: Option<f64>) -> Set {
    let places = vec![(place(key), 1.0)];
    Set {
        keys: vec![key.into()],
        log_z,
        places: places.clone(),
        beside: beside.map(|log_z| {
            vec![Function {
                log_z,
                places: vec![("h2".into(), 1.0)],
                holds: vec![],
            }]
        }),
    }
}

fn alone(log_z: f64, holds: &[&str]) -> Function {
    Function {
        log_z,
        places: vec![("h1".into(), 1.0)],
        holds: holds.iter().map(|key| (*key).to_owned()).collect(),
    }
}

fn weighed(sets: Vec<Set>, functions: Vec<Function>) -> Answer {
    let hypotheses = Hypotheses {
        sets,
        functions,
        searched: 40,
        has_equations: true,
        ..Hypotheses::default()
    };
    Answer::new(hypotheses.posterior(), false).decided()
}

/// A function of the effect's own variable that is no better speaks for the effect; a better one, or another variable's, against it.
#[test]
fn a_function_speaks_for_the_effects_that_it_holds() {
    let stated = |log_z, holds: &[&str]| {
        let answer = weighed(vec![set(KEYS[0], 50.0, None)], vec![alone(log_z, holds)]);
        answer.posterior.name(KEYS[0])
    };
    assert!(stated(49.0, &KEYS[..1]) > 0.999);
    assert!(stated(60.0, &KEYS[..1]) < 0.05);
    assert!(stated(60.0, &[]) < 0.05);
}

/// An effect that leaves less than a third is a part; one that leaves more imitates an unknown law.
#[test]
fn what_leaves_much_is_an_imitation() {
    let part = weighed(
        vec![set(KEYS[0], 100.0, Some(130.0))],
        vec![alone(90.0, &[])],
    );
    assert_eq!(part.decision, Decision::Partial);
    assert_eq!(part.accepted, [KEYS[0]]);
    assert!(part.posterior.kinds.partial > 0.99 && part.posterior.name(KEYS[0]) > 0.99);
    let imitation = weighed(
        vec![set(KEYS[0], 100.0, Some(170.0))],
        vec![alone(90.0, &[])],
    );
    assert_eq!(imitation.decision, Decision::NoneOfThese);
    assert!(imitation.posterior.name(KEYS[0]) < 0.01);
    assert!(imitation.posterior.kinds.unknown > 0.99);
}

/// A function beside the first effect is no reason to believe in the second.
#[test]
fn what_is_beside_one_effect_is_not_credited_to_a_pair() {
    let (first, second) = (KEYS[0], KEYS[2]);
    let pair = |log_z, beside| Set {
        keys: vec![first.into(), second.into()],
        log_z,
        places: vec![("h1".into(), 0.5), ("h2".into(), 0.5)],
        ..set(first, 0.0, beside)
    };
    let sets = |beside| {
        vec![
            set(first, 50.0, Some(75.0)),
            set(second, 10.0, None),
            pair(66.0, beside),
        ]
    };
    let answer = weighed(sets(None), vec![]);
    assert!(answer.posterior.name(second) < 0.1);
    // The first explains two thirds of the evidence, at its place.
    assert!((answer.posterior.places["h1"] - 2.0 / 3.0).abs() < 0.03);
    // Unless the second one explains something that functions do not.
    let answer = weighed(sets(Some(90.0)), vec![]);
    assert!(answer.posterior.name(second) > 0.9);
}

/// A constant force that a function beside friction holds belongs to the pair, where friction with it explains far more than alone; a function
/// that holds nothing leaves friction the imitation of an unknown law.
#[test]
fn what_a_function_holds_is_told_apart_from_it() {
    let (friction, force) = (KEYS[0], KEYS[4]);
    let answer = |holds: &[&str]| {
        let both = Set {
            keys: vec![friction.into(), force.into()],
            ..set(friction, 1100.0, Some(1515.0))
        };
        let mut alone = set(friction, 700.0, Some(1510.0));
        let beside = &mut alone.beside.as_mut().unwrap()[0];
        beside.holds = holds.iter().map(|key| (*key).to_owned()).collect();
        weighed(vec![alone, set(force, 50.0, None), both], vec![])
    };
    let told = answer(&[force]);
    assert_eq!(told.decision, Decision::Partial);
    assert_eq!(told.accepted, [friction, force]);
    assert_eq!(answer(&[]).decision, Decision::NoneOfThese);
}

#[test]
fn near_rivals_are_a_class_and_a_clear_lead_is_a_name() {
    let decided = |lead: f64| {
        let sets = vec![set(KEYS[0], 40.0 + lead, None), set(KEYS[1], 40.0, None)];
        let answer = weighed(sets, vec![]);
        (answer.decision, answer.class.len())
    };
    assert_eq!(decided(1.0), (Decision::Class, 2));
    assert_eq!(decided(5.0), (Decision::Named, 1));
}
