//! Training on a bank on disk.

use super::{PretrainOptions, PretrainPlan, pretrain};
use crate::estimator::bank::{Bank, Draws};
use crate::estimator::shards::ShardedBank;
use crate::estimator::shards::tests::{fill, oscillator, plan};
use crate::estimator::{Estimator, EstimatorError, PresetName};
use crate::network::{Checkpoints, History};
use crate::progress::Progress;
use crate::study::Study;
use ndarray::Array2;
use std::borrow::Cow;
use std::sync::atomic::{AtomicUsize, Ordering};

fn pretrain_on(
    study: &Study,
    bank: &dyn Bank,
    options: &PretrainOptions,
) -> Result<(Estimator, History), EstimatorError> {
    let options = PretrainOptions {
        bank_size: Some(bank.rows()),
        ..*options
    };
    PretrainPlan::new(&study.into(), options)?.train(
        bank,
        &Checkpoints::none(),
        &Progress::silent(),
    )
}

fn options(size: usize) -> PretrainOptions {
    PretrainOptions {
        preset: PresetName::Paper,
        bank_size: Some(size),
        epochs: Some(3),
        seed: 3,
    }
}

#[test]
fn a_bank_on_disk_gives_the_estimator_of_one_in_memory() {
    let (study, place) = (oscillator(), tempfile::tempdir().unwrap());
    let path = place.path().join("bank");
    fill(&plan(&study, 300), &path, "1/1").unwrap();
    let bank = ShardedBank::open(&path).unwrap();
    let silent = Progress::silent();
    let (streamed, _) = pretrain_on(&study, &bank, &options(1)).unwrap();
    let (in_memory, _) = pretrain(&study, &options(300), &silent).unwrap();
    let saved = |estimator: &Estimator, name: &str| {
        let path = place.path().join(name);
        estimator.save(&path).unwrap();
        std::fs::read(path).unwrap()
    };
    assert_eq!(saved(&streamed, "a.est"), saved(&in_memory, "b.est"));
}

/// Many rows in parts, made when they are asked for; remembers how many were read.
struct Made {
    parts: usize,
    rows: usize,
    read: AtomicUsize,
}

impl Bank for Made {
    fn parts(&self) -> Vec<usize> {
        vec![self.rows; self.parts]
    }
    fn part(&self, index: usize) -> Result<Cow<'_, Draws>, EstimatorError> {
        self.read.fetch_add(1, Ordering::Relaxed);
        let number = |i: usize| ((index * self.rows + i) as f64 * 0.618_034) % 1.0;
        Ok(Cow::Owned(Draws {
            theta: Array2::from_shape_fn((self.rows, 1), |(i, _)| 0.5 + number(i)),
            features: Array2::from_shape_fn((self.rows, 5), |(i, j)| {
                (number(i) * (j + 1) as f64).sin()
            }),
            redrawn: 0,
        }))
    }
}

/// More than a block: each part is read once an epoch, and the network learns what the rows say.
#[test]
fn a_bank_that_does_not_fit_is_read_once_an_epoch_and_learnt_from() {
    let study = oscillator();
    // 128 features wide as the network has them: 130 000 rows are a block.
    let bank = Made {
        parts: 9,
        rows: 16_384,
        read: AtomicUsize::new(0),
    };
    let options = PretrainOptions {
        epochs: Some(1),
        ..options(1)
    };
    let (estimator, history) = pretrain_on(&study, &bank, &options).unwrap();
    // Two parts to standardise with, then each once.
    assert_eq!(bank.read.load(Ordering::Relaxed), 2 + 9);
    let holdout = history.holdout.first().or(history.training.first());
    assert!(holdout.is_some_and(|e| *e < 0.02), "{history:?}");
    let part = bank.part(8).unwrap();
    let error = estimator.predict(&part.features).unwrap() - &part.theta;
    let square = error.mapv(|e| e * e).mean().unwrap();
    // The variance of θ is 1/12.
    assert!(square < 0.01 / 12.0, "{square}");
}

#[test]
fn rows_of_another_width_are_refused() {
    let study = oscillator();
    let draws = Draws {
        theta: Array2::zeros((200, 2)),
        features: Array2::zeros((200, 5)),
        redrawn: 0,
    };
    let error = pretrain_on(&study, &draws, &options(1)).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("2 parameters, twin and preset have 1"),
        "{error}"
    );
}
