//! Training: early stopping, cancellation, weight decay, the penalty, kept states.

use super::*;
use crate::progress::{Cancelled, Listener};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Targets without relation to the features: the holdout loss soon rises, and the best weights must be kept.
#[test]
fn early_stopping_restores_the_best_epoch() {
    let (features, _) = samples(80, 8, 1);
    let targets = Array2::from_shape_fn((80, 1), |(i, _)| ((i * i * 7) % 13) as f64 / 6.0 - 1.0);
    let data = (features, targets);
    let settings = Training {
        patience: 10,
        learning_rate: 1e-2,
        ..quick(300)
    };
    let (best, history) = train_one::<Smooth>(&data, &settings, 1).unwrap();
    assert_eq!(history.epochs_run, history.best_epoch + 11);
    assert_eq!(history.holdout.len(), history.epochs_run);
    let least = history
        .holdout
        .iter()
        .copied()
        .fold(f64::INFINITY, f64::min);
    assert_eq!(history.holdout[history.best_epoch], least);
    // A constant learning rate makes a run of best_epoch + 1 epochs the beginning of the longer one.
    let until_best = Training {
        epochs: history.best_epoch + 1,
        ..settings
    };
    let (shorter, _) = train_one::<Smooth>(&data, &until_best, 1).unwrap();
    assert_eq!(best.weights(), shorter.weights());
}

#[test]
fn a_listener_counts_the_epochs_and_cancels() {
    struct StopAt(u64, AtomicU64);
    impl Listener for StopAt {
        fn advanced(&self, stage: &str, done: u64, total: u64) {
            assert_eq!((stage, total), ("train", 50));
            self.1.store(done, Ordering::Relaxed);
        }
        fn cancelled(&self) -> bool {
            self.1.load(Ordering::Relaxed) >= self.0
        }
    }
    let (features, targets) = samples(40, 3, 1);
    let listener = Arc::new(StopAt(4, AtomicU64::new(0)));
    let progress = Progress::new(listener.clone());
    let (samples, nowhere) = (Samples::in_memory(&features, &targets), Checkpoints::none());
    let result = architecture::<Mixed>().train_on(&samples, &quick(50), 1, &nowhere, &progress);
    assert_eq!(result.unwrap_err(), NetworkError::Cancelled(Cancelled));
    assert_eq!(listener.1.load(Ordering::Relaxed), 4);
}

#[test]
fn a_loss_that_diverges_names_epoch_and_remedy() {
    for holdout in [0.0, 0.2] {
        let wild = Training {
            learning_rate: 1e38,
            holdout,
            ..quick(5)
        };
        let error = train_one::<Smooth>(&samples(64, 3, 1), &wild, 1).unwrap_err();
        let said = error.to_string();
        assert!(
            said.starts_with("the loss is not finite in epoch "),
            "{said}"
        );
        assert!(said.contains("lower learning_rate"), "{said}");
    }
}

#[test]
fn weight_decay_shrinks_the_weights() {
    let data = samples(100, 4, 1);
    let size = |weight_decay| -> f32 {
        let settings = Training {
            weight_decay,
            ..quick(20)
        };
        let (network, _) = train_one::<Smooth>(&data, &settings, 1).unwrap();
        let weights = network.weights();
        weights.iter().flat_map(|t| &t.values).map(|v| v * v).sum()
    };
    assert!(size(0.1) < 0.8 * size(0.0));
}

#[test]
fn the_penalty_turns_the_heads_apart() {
    let data = samples(100, 4, 3);
    let overlap = |orthogonality| -> f64 {
        let settings = Training {
            orthogonality,
            ..quick(20)
        };
        let (network, _) = train_one::<Smooth>(&data, &settings, 1).unwrap();
        let weights = network.weights();
        let first: Vec<_> = weights
            .iter()
            .filter(|t| t.name.starts_with("heads.") && t.name.ends_with(".0.weight"))
            .map(|t| Array2::from_shape_vec((16, 32), t.values.clone()).unwrap())
            .collect();
        assert_eq!(first.len(), 3);
        let pair =
            |j: usize, k: usize| first[j].dot(&first[k].t()).mapv(|g| f64::from(g * g)).sum();
        pair(0, 1) + pair(0, 2) + pair(1, 2)
    };
    assert!(overlap(0.1) < 0.2 * overlap(0.0));
}

#[test]
fn a_state_that_is_damaged_or_of_another_network_counts_as_none() {
    let (features, targets) = samples(64, 3, 1);
    let samples = Samples::in_memory(&features, &targets);
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("training");
    let kept = || Checkpoints::new(&path, Duration::ZERO);
    let progress = Progress::silent();
    let settings = quick(3);
    let (whole, _) = (architecture::<Mixed>())
        .train_on(&samples, &settings, 1, &kept(), &progress)
        .unwrap();
    let state = std::fs::read(&path).unwrap();
    let mut altered = state.clone();
    altered[state.len() / 2] ^= 1;
    for damaged in [&state[..state.len() / 2], &altered, b"", b"no state"] {
        std::fs::write(&path, damaged).unwrap();
        let (network, _) = (architecture::<Mixed>())
            .train_on(&samples, &settings, 1, &kept(), &progress)
            .unwrap();
        assert_eq!(network.weights(), whole.weights());
    }
    let (_, history) = (architecture::<Smooth>())
        .train_on(&samples, &settings, 1, &kept(), &progress)
        .unwrap();
    assert_eq!(history.training.len(), 3, "it has begun anew");
}

#[test]
fn a_state_that_cannot_be_kept_is_said() {
    let (features, targets) = samples(64, 3, 1);
    let nowhere = Checkpoints::new("/nowhere/training", Duration::ZERO);
    let samples = Samples::in_memory(&features, &targets);
    let error = architecture::<Mixed>()
        .train_on(&samples, &quick(1), 1, &nowhere, &Progress::silent())
        .unwrap_err();
    assert!(
        error.to_string().starts_with("/nowhere/training: "),
        "{error}"
    );
}
