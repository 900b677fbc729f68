//! The module from outside: what a user of networks relies on.

mod training;

use super::layers::*;
use super::*;
use crate::progress::Progress;
use ndarray::{Array2, Axis, concatenate, s};
use std::sync::Arc;

/// Small, and with each kind of layer and dropout.
struct Mixed;
impl HeadArchitecture for Mixed {
    const ID: &'static str = "mixed";
    type Features = Const<8>;
    type Hidden = Const<16>;
    type Trunk = (
        Dense<8, 24, ReLU>,
        Linear<24, 16>,
        LayerNorm1D<16>,
        Leaky,
        Dropout,
    );
    type Head = (NormDense<16, 8, Tanh>, Linear<8, 1>);
    const DROPOUT: f64 = 0.05;
}

/// No dropout, so that a linear map can be fitted closely.
struct Smooth;
impl HeadArchitecture for Smooth {
    const ID: &'static str = "smooth";
    type Features = Const<8>;
    type Hidden = Const<32>;
    type Trunk = Dense<8, 32, Tanh>;
    type Head = (Dense<32, 16, Tanh>, Linear<16, 1>);
}

/// Features in ±1.7 without a pattern, and d linear targets of them.
fn samples(count: usize, n: usize, d: usize) -> (Array2<f64>, Array2<f64>) {
    let features = Array2::from_shape_fn((count, n), |(i, j)| {
        let x = ((i * n + j + 1) as f64 * 0.618_033_988_749_895).fract();
        ((x * 9973.0).fract() - 0.5) * 3.4
    });
    let map = Array2::from_shape_fn((n, d), |(i, j)| {
        ((i + 2 * j) % 3) as f64 * 0.4 - 0.4 + 0.2 * (i == j) as u8 as f64
    });
    let targets = features.dot(&map);
    (features, targets)
}

fn quick(epochs: usize) -> Training {
    Training {
        epochs,
        learning_rate: 3e-3,
        orthogonality: 1e-3,
        ..Training::default()
    }
}

fn train_one<A: HeadArchitecture>(
    (features, targets): &(Array2<f64>, Array2<f64>),
    settings: &Training,
    seed: u64,
) -> Result<(Arc<dyn Network>, History), NetworkError> {
    let (samples, nowhere) = (Samples::in_memory(features, targets), Checkpoints::none());
    architecture::<A>().train_on(&samples, settings, seed, &nowhere, &Progress::silent())
}

#[test]
fn a_linear_map_is_learnt_for_any_number_of_features_and_targets() {
    for (n, d) in [(1, 1), (3, 2), (5, 1), (8, 4)] {
        let (features, targets) = samples(600, n, d);
        let known = (
            features.slice(s![..500, ..]).to_owned(),
            targets.slice(s![..500, ..]).to_owned(),
        );
        let settings = Training {
            schedule: Schedule::Cosine,
            orthogonality: 0.0,
            patience: 0,
            ..quick(80)
        };
        let (network, history) = train_one::<Smooth>(&known, &settings, 1).unwrap();
        assert_eq!((network.inputs(), network.outputs()), (n, d));
        let predicted = network
            .predict(&features.slice(s![500.., ..]).to_owned())
            .unwrap();
        let miss = (&predicted - &targets.slice(s![500.., ..]))
            .mapv(|e| e * e)
            .mean()
            .unwrap();
        let spread = targets.mapv(|t| t * t).mean().unwrap();
        assert!(miss < 0.01 * spread, "n={n} d={d}: {miss} of {spread}");
        assert!(history.holdout[history.best_epoch] < 0.1 * history.holdout[0]);
    }
}

#[test]
fn the_seed_decides_every_bit() {
    let data = samples(150, 4, 3);
    let weights = |seed| {
        train_one::<Mixed>(&data, &quick(3), seed)
            .unwrap()
            .0
            .weights()
    };
    let (once, again, other) = (weights(5), weights(5), weights(6));
    assert_eq!(once, again);
    for (a, b) in once.iter().zip(&other) {
        assert_ne!(a.values, b.values, "{}", a.name);
    }
}

#[test]
fn tuning_moves_the_heads_and_nothing_else() {
    let (features, targets) = samples(200, 5, 2);
    let data = (features, targets);
    let (network, _) = train_one::<Mixed>(&data, &quick(5), 1).unwrap();
    let before = network.weights();
    let moved = data.1.mapv(|t| 0.5 * t + 0.3);
    let tune = |seed| network.tune_heads(&data.0, &moved, &quick(40), seed, &Progress::silent());
    let (tuned, history) = tune(2).unwrap();
    assert_eq!(network.weights(), before, "the original stays");
    assert_eq!(tuned.weights(), tune(2).unwrap().0.weights(), "repeatable");
    for (a, b) in before.iter().zip(&tuned.weights()) {
        assert_eq!(a.name, b.name);
        assert_eq!(
            a.values == b.values,
            a.name.starts_with("trunk."),
            "{}",
            a.name
        );
    }
    assert!(history.holdout[history.best_epoch] < 0.5 * history.holdout[0]);
}

#[test]
fn padding_changes_nothing() {
    let data = samples(60, 5, 2);
    let (network, _) = train_one::<Mixed>(&data, &quick(2), 1).unwrap();
    let wide = architecture::<Mixed>()
        .restore(8, 2, &network.weights())
        .unwrap();
    let padded = concatenate(Axis(1), &[data.0.view(), Array2::zeros((60, 3)).view()]).unwrap();
    assert_eq!(
        network.predict(&data.0).unwrap(),
        wide.predict(&padded).unwrap()
    );
}

#[test]
fn rows_are_predicted_alike_alone_and_together() {
    let data = samples(600, 5, 2);
    let (network, _) = train_one::<Mixed>(&data, &quick(1), 1).unwrap();
    let together = network.predict(&data.0).unwrap();
    for i in [0, 255, 256, 599] {
        let alone = network
            .predict(&data.0.slice(s![i..=i, ..]).to_owned())
            .unwrap();
        let gap = (&alone - &together.slice(s![i..=i, ..]))
            .mapv(f64::abs)
            .sum();
        assert!(gap < 1e-5, "row {i}: {gap}");
    }
    assert_eq!(
        network.predict(&Array2::zeros((0, 5))).unwrap().dim(),
        (0, 2)
    );
}

#[test]
fn what_does_not_fit_is_refused_with_numbers_and_remedy() {
    let said =
        |result: Result<(Arc<dyn Network>, History), NetworkError>| result.unwrap_err().to_string();
    assert_eq!(
        said(train_one::<Mixed>(&samples(20, 9, 1), &quick(1), 1)),
        "9 features, but architecture `mixed` takes at most 8; \
         use fewer features or an architecture with larger `Features`"
    );
    let (features, targets) = samples(20, 3, 1);
    let short = (features.clone(), targets.slice(s![..19, ..]).to_owned());
    assert_eq!(
        said(train_one::<Mixed>(&short, &quick(1), 1)),
        "rows of targets: expected 20, found 19"
    );
    let weighted = Training {
        target_weights: vec![1.0, 2.0],
        ..quick(1)
    };
    assert_eq!(
        said(train_one::<Mixed>(
            &(features.clone(), targets.clone()),
            &weighted,
            1
        )),
        "target_weights = 2 weights; give 1, one for each target, or none"
    );
    let mut holed = features.clone();
    holed[(4, 2)] = f64::NAN;
    assert_eq!(
        said(train_one::<Mixed>(&(holed, targets.clone()), &quick(1), 1)),
        "features, row 4, column 2: NaN is not a finite 32-bit number"
    );
    let (network, _) = train_one::<Mixed>(&(features, targets), &quick(1), 1).unwrap();
    let error = network.predict(&Array2::zeros((2, 4))).unwrap_err();
    assert_eq!(
        error.to_string(),
        "features of a sample: expected 3, found 4"
    );
}

#[test]
fn a_network_comes_back_from_its_weights() {
    let data = samples(60, 4, 3);
    let (network, _) = train_one::<Mixed>(&data, &quick(2), 1).unwrap();
    let weights = network.weights();
    let names: Vec<_> = weights.iter().map(|t| t.name.as_str()).collect();
    assert_eq!(&names[..2], ["trunk.0.weight", "trunk.0.bias"]);
    assert!(names.contains(&"heads.2.0.gamma"));
    let same = architecture::<Mixed>().restore(4, 3, &weights).unwrap();
    assert_eq!(
        network.predict(&data.0).unwrap(),
        same.predict(&data.0).unwrap()
    );
    assert_eq!(weights, same.weights());
}

#[test]
fn altered_weights_are_refused_by_name() {
    let (network, _) = train_one::<Mixed>(&samples(30, 4, 2), &quick(1), 1).unwrap();
    let refused = |alter: &dyn Fn(&mut Vec<NamedTensor>)| {
        let mut weights = network.weights();
        alter(&mut weights);
        let result = architecture::<Mixed>().restore(4, 2, &weights);
        result.unwrap_err().to_string()
    };
    assert_eq!(
        refused(&|w| drop(w.remove(0))),
        "tensor `trunk.0.weight` of shape [24, 8] is missing; was it stored by `mixed`?"
    );
    assert_eq!(
        refused(&|w| w[1].shape = vec![4, 6]),
        "tensor `trunk.0.bias` has shape [4, 6] with 24 values, expected [24]"
    );
    assert!(refused(&|w| w[0].values.truncate(191)).contains("with 191 values"));
    assert!(refused(&|w| w.push(w[0].clone())).starts_with("tensor `trunk.0.weight`"));
    assert!(refused(&|w| w[2].values[0] = f32::NAN).contains("not finite"));
    let one_head = architecture::<Mixed>().restore(4, 1, &network.weights());
    assert_eq!(
        one_head.unwrap_err().to_string(),
        "tensor `heads.1.0.beta` of shape [8] has no place in `mixed`; was it stored by another architecture?"
    );
}

/// Products of plain layers this large are spread over rayon's threads, and still each sum keeps its order.
#[test]
fn the_number_of_threads_changes_no_bit() {
    struct Wide;
    impl HeadArchitecture for Wide {
        const ID: &'static str = "wide";
        type Features = Const<128>;
        type Hidden = Const<256>;
        type Trunk = (Linear<128, 256>, Tanh, Dropout);
        type Head = Linear<256, 1>;
        const DROPOUT: f64 = 0.1;
    }
    let data = samples(200, 128, 2);
    let [one, three] = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let (network, _) = pool
            .install(|| train_one::<Wide>(&data, &quick(2), 1))
            .unwrap();
        network.weights()
    });
    assert_eq!(one, three);
}

#[test]
fn the_ready_architectures_train() {
    let few = samples(70, 5, 1);
    let (network, _) = train_one::<Compact>(&few, &quick(1), 1).unwrap();
    assert!(
        network
            .predict(&few.0)
            .unwrap()
            .iter()
            .all(|v| v.is_finite())
    );
    let many = samples(70, 128, 4);
    let (network, _) = train_one::<Deep>(&many, &quick(1), 1).unwrap();
    assert!(
        network
            .predict(&many.0)
            .unwrap()
            .iter()
            .all(|v| v.is_finite())
    );
    assert_eq!(architecture::<Deep>().max_features(), 128);
    assert_eq!(architecture::<Compact>().id(), "compact");
    assert_eq!(
        format!("{network:?}"),
        "Network { architecture: \"deep\", inputs: 128, outputs: 4 }"
    );
}
