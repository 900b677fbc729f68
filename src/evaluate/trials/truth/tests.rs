//! Truths of every kind can be drawn, and have names that the library knows.

use super::*;
use crate::evaluate::paper::reference_studies;

#[test]
fn every_kind_can_be_drawn_and_repeats() {
    for study in reference_studies().unwrap() {
        let sampler = TruthSampler::new(&study).unwrap();
        for kind in Kind::ALL {
            sampler.check(kind).unwrap();
            for trial in 0..10 {
                let noise = Noise::new(5, "truth", trial as u64);
                let drawn = sampler.draw(trial, kind, true, noise).unwrap();
                let again = sampler.draw(trial, kind, true, noise).unwrap();
                assert_eq!(drawn.truth, again.truth);
                assert_eq!(drawn.record, again.record);
                // The same noise once more, and without departures as many records as with none.
                if let Some([own, _]) = sampler.paired(&drawn.truth, true, noise).unwrap() {
                    assert_eq!(own.perturbed, drawn.record);
                    assert_eq!(
                        own.plain == own.perturbed,
                        drawn.truth.perturbations.is_empty()
                    );
                }
                let truth = drawn.truth;
                let perturbations = match kind {
                    Kind::None | Kind::Outside => 0,
                    Kind::Pair => 2,
                    _ => 1,
                };
                assert_eq!(truth.perturbations.len(), perturbations, "{truth:?}");
                assert_eq!(truth.strength.is_some(), perturbations > 0);
                let text = serde_json::to_string(&truth).unwrap();
                assert_eq!(serde_json::from_str::<Truth>(&text).unwrap(), truth);
                if kind == Kind::Pair {
                    assert_ne!(truth.targets[0], truth.targets[1]);
                }
            }
        }
    }
}

/// Every effect that a world names is one of the library, at that target.
#[test]
fn worlds_and_library_use_the_same_names() {
    for study in reference_studies().unwrap() {
        let sampler = TruthSampler::new(&study).unwrap();
        assert_eq!(
            sampler.missing_effects().len(),
            sampler.world.missing_effects.len()
        );
        assert_eq!(sampler.doubles().len(), sampler.world.doubles.len());
        for missing in sampler.world.absorbed {
            assert!(
                sampler.library.contains(&missing.key()),
                "{}",
                missing.key()
            );
        }
    }
}
