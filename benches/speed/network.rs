//! One training epoch of the `deep` architecture, with fused layers and with plain dfdx layers, and one prediction.
//!
//! 10 000 samples of 128 features, four heads, batches of 64, orthogonality 5e-4. Plain dfdx spreads its products over the
//! threads of rayon: compare them on one thread.

use crate::Clock;
use ndarray::Array2;
use std::hint::black_box;
use truetwin::network::untyped::{Checkpoints, Samples, architecture};
use truetwin::network::{Deep, Training, layers::*};
use truetwin::progress::Progress;

/// [`Deep`], written in plain dfdx layers.
struct PlainDeep;

type TrunkBlock<const I: usize> = (Linear<I, 256>, LayerNorm1D<256>, Leaky, Dropout);
type HeadBlock<const I: usize> = (Linear<I, 64>, LayerNorm1D<64>, Tanh, Dropout);

impl HeadArchitecture for PlainDeep {
    const ID: &'static str = "plain-deep";
    type Features = Const<128>;
    type Hidden = Const<256>;
    type Trunk = (TrunkBlock<128>, TrunkBlock<256>);
    type Head = (HeadBlock<256>, HeadBlock<64>, HeadBlock<64>, Linear<64, 1>);
    const DROPOUT: f64 = 0.15;
}

fn samples(count: usize) -> (Array2<f64>, Array2<f64>) {
    let features = Array2::from_shape_fn((count, 128), |(i, j)| {
        ((i * 7919 + j * 104_729) % 1009) as f64 / 291.0 - 1.733
    });
    let targets = Array2::from_shape_fn((count, 4), |(i, k)| {
        (features[(i, k)] + 0.5 * features[(i, k + 4)] * features[(i, k + 8)]).tanh()
    });
    (features, targets)
}

fn settings() -> Training {
    Training {
        epochs: 1,
        orthogonality: 5e-4,
        holdout: 0.0,
        ..Training::default()
    }
}

fn training(clock: &Clock) {
    let (features, targets) = samples(10_000);
    for (name, deep) in [
        ("fused", architecture::<Deep>()),
        ("plain", architecture::<PlainDeep>()),
    ] {
        let silent = Progress::silent();
        clock.time(&format!("network: one epoch, {name}"), 1, || {
            let samples = Samples::in_memory(&features, &targets);
            deep.train_on(&samples, &settings(), 1, &Checkpoints::none(), &silent)
        });
    }
}

fn tuning(clock: &Clock) {
    let (features, targets) = samples(1000);
    let silent = Progress::silent();
    let samples = Samples::in_memory(&features, &targets);
    let (network, _) = architecture::<Deep>()
        .train_on(&samples, &settings(), 1, &Checkpoints::none(), &silent)
        .expect("the samples are finite");
    clock.time("network: one epoch of heads, 1000 samples", 1, || {
        network.tune_heads(&features, &targets, &settings(), 1, &silent)
    });
    let row = features.slice(ndarray::s![..1, ..]).to_owned();
    clock.time("network: predict one row", 1, || {
        network.predict(black_box(&row))
    });
}

pub fn run(clock: &Clock) {
    if clock.wants("network") {
        training(clock);
        tuning(clock);
    }
}
