//! Tests of headlines.

use super::*;
use crate::diagnose::EffectFit;
use crate::report::fixture::{made, oscillator, tanks};
use crate::twin::Noise;

/// Tanks with these effects and probabilities, so many of them accepted.
fn told(decision: Decision, effects: &[(&str, f64)], count: usize) -> String {
    let mut diagnosis = made::tanks_class();
    let cause = &mut diagnosis.cause;
    let first = cause.effects[0].clone();
    cause.decision = decision;
    cause.effects = (effects.iter())
        .map(|(key, probability)| {
            let (id, target) = key.split_once('@').unwrap();
            let mut fit = first.clone();
            (fit.id, fit.target) = (id.into(), target.into());
            fit.probability = *probability;
            fit
        })
        .collect();
    let keys = cause.effects.iter().map(|fit| fit.key());
    cause.accepted = keys.take(count).collect();
    cause.class.clone_from(&cause.accepted);
    headline(&Units::of(&tanks()), &diagnosis)
}

#[test]
fn no_name_is_told_below_a_half() {
    let pair = [
        ("actuator-rate-limit@actuator", 0.9),
        ("parameter-step@k1", 0.31),
        ("sensor-lag@sensor", 0.3),
        ("sensor-bias@sensor", 0.2),
    ];
    assert_eq!(
        told(Decision::Partial, &pair[1..], 1),
        "Structural gap: most of it is explained by one of parameter-step@k1, sensor-lag@sensor, sensor-bias@sensor (together 0.81); \
         more remains."
    );
    let long = [
        ("actuator-rate-limit@actuator", 0.31),
        ("periodic-disturbance@h1", 0.3),
        ("actuator-dead-zone@actuator", 0.2),
    ];
    assert_eq!(
        told(Decision::Partial, &long, 1),
        "Structural gap: most of it is explained by one of 3 effects (together 0.81); more remains."
    );
    let sure = told(Decision::Partial, &pair, 2);
    assert!(
        sure.starts_with("Structural gap: the twin lacks actuator-rate-limit@actuator; the rest is explained by one of"),
        "{sure}"
    );
    let few = [("state-ceiling@h1", 0.45), ("power-law@h1", 0.4)];
    assert_eq!(
        told(Decision::Partial, &few, 1),
        "Structural gap: most of it is explained by one of a ceiling and a power law at the upper tank (h1) (together 0.85); more \
         remains."
    );
    let unsure = [("state-ceiling@h1", 0.2), ("power-law@h1", 0.1)];
    assert_eq!(
        told(Decision::Partial, &unsure, 1),
        "Structural gap: listed effects explain most of it, but none can be named; more remains at the lower tank (h2)."
    );
    assert!(told(Decision::Named, &pair, 1).contains("lacks a rate limit at the actuator of"));
}

/// Any effects at any places, any probabilities and decisions: two lines of a page, at most three ids.
#[test]
fn a_thousand_answers_are_short() {
    let mut source = Noise::new(3, "headlines", 0).source("answers");
    for study in [tanks(), oscillator()] {
        let units = Units::of(&study);
        let keys: Vec<String> = (study.effects().iter())
            .map(|effect| effect.key().to_string())
            .collect();
        for _ in 0..500 {
            let mut below = |n: usize| (source.uniform() * n as f64) as usize;
            let mut diagnosis = made::tanks_class();
            let first = diagnosis.cause.effects[0].clone();
            let effects: Vec<EffectFit> = (0..4)
                .map(|_| {
                    let (id, target) = keys[below(keys.len())].split_once('@').unwrap();
                    EffectFit {
                        id: id.into(),
                        target: target.into(),
                        probability: 0.01 * below(101) as f64,
                        ..first.clone()
                    }
                })
                .collect();
            let cause = &mut diagnosis.cause;
            cause.class = effects.iter().map(EffectFit::key).collect();
            cause.accepted = cause.class[..1 + below(2)].to_vec();
            cause.class.truncate(1 + below(4));
            cause.decision = [
                Decision::Named,
                Decision::Class,
                Decision::Partial,
                Decision::NoneOfThese,
            ][below(4)];
            let location = &mut diagnosis.location;
            location.class = effects.iter().map(|fit| fit.target.clone()).collect();
            location.class.truncate(below(5));
            location.target = Some(effects[0].target.clone());
            cause.effects = effects;
            let told = headline(&units, &diagnosis);
            assert!(told.chars().count() <= LONGEST, "{told}");
            assert!(told.matches('@').count() <= MOST_NAMES, "{told}");
        }
    }
}
