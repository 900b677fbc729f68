//! The training loop.

use super::adam::Adam;
use super::loss::Loss;
use super::model::Model;
use super::rows::Rows;
use super::{FirstWeight, History, Layers, NamedTensor, NetworkError, Training};
use crate::progress::Progress;
use dfdx::prelude::{Backward, Const, ConstDim, Cpu};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

/// What a number drawn from the seed is for; each purpose has draws of its own.
#[derive(Clone, Copy)]
pub(super) enum Purpose {
    Weights,
    Split,
    Shuffle,
    Dropout,
}

/// A seed for `purpose` and `counter`, which may be the epoch or the step.
pub(super) fn derive(seed: u64, purpose: Purpose, counter: u64) -> u64 {
    // The finaliser of SplitMix64; the seed passes it too, lest neighbouring seeds meet at neighbouring counters.
    let scramble = |state: u64| {
        let mut z = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    scramble(scramble(scramble(seed) ^ purpose as u64) ^ counter)
}

/// Samples to learn from: one row of features and one of targets each.
pub(super) struct Data {
    pub(super) features: Rows,
    pub(super) targets: Rows,
}

/// The weights that did best on the held-out rows so far.
struct Best<M> {
    error: f64,
    epoch: usize,
    model: M,
}

/// Trains `model` in place; where rows are held out, it ends with the weights that were best on them.
pub(super) fn train<I, K, T, H>(
    model: &mut Model<I, K, T, H>,
    data: &Data,
    settings: &Training,
    seed: u64,
    progress: &Progress,
    stage: &'static str,
) -> Result<History, NetworkError>
where
    I: ConstDim,
    K: ConstDim,
    T: Layers<I, K>,
    H: Layers<K, Const<1>> + FirstWeight<K>,
{
    settings.validate()?;
    let loss = Loss {
        weights: settings.weights_for(model.heads.len())?,
        delta: settings.huber_delta as f32,
        orthogonality: settings.orthogonality as f32,
    };
    let (mut rows, held_out) = split(data.targets.len(), settings.holdout, seed)?;
    let held_out = Data {
        features: data.features.select(&held_out),
        targets: data.targets.select(&held_out),
    };
    let mut adam = Adam::new(settings.weight_decay);
    let mut history = History::default();
    let mut best: Option<Best<_>> = None;
    let mut step = 0;
    let stage = progress.stage(stage, settings.epochs);
    for epoch in 0..settings.epochs {
        let learning_rate = settings.rate(epoch);
        let diverged = NetworkError::Diverged {
            epoch: epoch + 1,
            learning_rate,
        };
        // Each epoch orders the rows anew from their first order, so that an epoch depends on its number alone.
        rows.sort_unstable();
        let order = derive(seed, Purpose::Shuffle, epoch as u64);
        rows.shuffle(&mut ChaCha8Rng::seed_from_u64(order));

        let mut total = 0.0;
        for batch in rows.chunks(settings.batch) {
            let device = Cpu::seed_from_u64(derive(seed, Purpose::Dropout, step));
            step += 1;
            let predictions = model.forward_taped(data.features.gather(batch), &device)?;
            let targets = data.targets.gather(batch);
            let (error, taped) = loss.taped(predictions, &targets, &model.heads)?;
            if !error.is_finite() {
                return Err(diverged);
            }
            total += error * batch.len() as f64;
            let mut gradients = taped.try_backward()?;
            let mut adam = adam.step(learning_rate, &mut gradients);
            adam.update(&mut model.trunk)?;
            for head in &mut model.heads {
                adam.update(head)?;
            }
        }
        history.training.push(total / rows.len() as f64);
        history.epochs_run = epoch + 1;
        history.best_epoch = epoch;
        let mut stop = false;
        if held_out.targets.len() > 0 {
            let predictions = model.predict(&held_out.features)?;
            let error = loss.error(predictions.numbers(), held_out.targets.numbers());
            if !error.is_finite() {
                return Err(diverged);
            }
            history.holdout.push(error);
            if best.as_ref().is_none_or(|best| error < best.error) {
                let model = model.clone();
                best = Some(Best {
                    error,
                    epoch,
                    model,
                });
            }
            history.best_epoch = best.as_ref().map_or(epoch, |best| best.epoch);
            stop = settings.patience > 0 && epoch - history.best_epoch >= settings.patience;
        }
        stage.tick()?;
        if stop {
            stage.finish();
            break;
        }
    }
    if let Some(best) = best {
        *model = best.model;
    }
    // Without holdout rows nothing has looked at the weights since the last step.
    let finite = |tensor: &NamedTensor| tensor.values.iter().all(|v| v.is_finite());
    if !model.weights().iter().all(finite) {
        return Err(NetworkError::Diverged {
            epoch: history.epochs_run,
            learning_rate: settings.rate(history.epochs_run - 1),
        });
    }
    Ok(history)
}

/// Indices of the rows to train on and of those held out.
fn split(count: usize, share: f64, seed: u64) -> Result<(Vec<usize>, Vec<usize>), NetworkError> {
    let held_out = match (share * count as f64).round() as usize {
        0 if share > 0.0 => 1,
        held_out => held_out,
    };
    if held_out >= count {
        return Err(NetworkError::Empty {
            what: "rows left to train on",
            least: 1 + usize::from(share > 0.0),
        });
    }
    let mut training: Vec<usize> = (0..count).collect();
    let order = derive(seed, Purpose::Split, 0);
    training.shuffle(&mut ChaCha8Rng::seed_from_u64(order));
    let held_out = training.split_off(count - held_out);
    Ok((training, held_out))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::layers::*;
    use dfdx::prelude::{Cpu, DeviceBuildExt, SplitTape, TensorFromVec, Trace};
    use std::collections::HashSet;

    #[test]
    fn the_split_is_a_partition_that_the_seed_decides() {
        let (training, held_out) = split(50, 0.2, 3).unwrap();
        assert_eq!((training.len(), held_out.len()), (40, 10));
        let all: HashSet<_> = training.iter().chain(&held_out).collect();
        assert_eq!(all.len(), 50);
        assert_eq!(split(50, 0.2, 3).unwrap().1, held_out);
        assert_ne!(split(50, 0.2, 4).unwrap().1, held_out);
        assert_eq!(
            split(3, 0.01, 0).unwrap().1.len(),
            1,
            "a share is never nothing"
        );
        assert!(split(1, 0.2, 0).is_err());
        assert!(split(0, 0.0, 0).is_err());
    }

    #[test]
    fn derived_seeds_differ_by_seed_purpose_and_counter() {
        let mut seen = HashSet::new();
        for seed in 0..10 {
            for counter in 0..100 {
                for purpose in [Purpose::Weights, Purpose::Shuffle, Purpose::Dropout] {
                    assert!(seen.insert(derive(seed, purpose, counter)));
                }
            }
        }
    }

    /// Dropout must have no memory: the input's device alone decides it, two layers deep and in both kinds of layer.
    #[test]
    fn the_device_of_the_input_decides_dropout() {
        fn outputs<L>(mut layers: L, seed: u64) -> Vec<f32>
        where
            L: Layers<Const<8>, Const<8>>,
        {
            crate::network::tensors::set_dropout(&mut layers, 0.5);
            let device = Cpu::seed_from_u64(seed);
            let x = (0..80).map(|i| (i % 7) as f32 - 3.0).collect();
            let x = device.tensor_from_vec(x, (10, Const::<8>)).leaky_traced();
            layers.forward_mut(x).split_tape().0.as_vec()
        }
        type Plain = (
            (Linear<8, 8>, LayerNorm1D<8>, Tanh, Dropout),
            (Linear<8, 8>, Leaky, Dropout),
        );
        type Fused = (NormDense<8, 8, Tanh>, Dense<8, 8, Leaky>);
        let device = Cpu::default();
        let plain = device.build_module::<Plain, f32>();
        let fused = device.build_module::<Fused, f32>();
        assert_eq!(outputs(plain.clone(), 1), outputs(plain.clone(), 1));
        assert_ne!(outputs(plain.clone(), 1), outputs(plain, 2));
        assert_eq!(outputs(fused.clone(), 1), outputs(fused.clone(), 1));
        assert_ne!(outputs(fused.clone(), 1), outputs(fused, 2));
    }
}
