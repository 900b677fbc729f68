//! The training loop.

use super::adam::Adam;
use super::feed::{Block, Feed};
use super::loss::Loss;
use super::model::Model;
use super::{FirstWeight, History, Layers, NamedTensor, NetworkError, Training};
use crate::progress::Progress;
use dfdx::prelude::{Backward, Const, ConstDim, Cpu};

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

/// The weights that did best on the held-out rows so far.
struct Best<M> {
    error: f64,
    epoch: usize,
    model: M,
}

/// Trains `model` in place; where rows are held out, it ends with the weights that were best on them. One tick of the stage a
/// block.
pub(super) fn train<I, K, T, H>(
    model: &mut Model<I, K, T, H>,
    feed: &Feed<'_>,
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
    let loss = Loss {
        weights: settings.weights_for(model.heads.len())?,
        delta: settings.huber_delta as f32,
        orthogonality: settings.orthogonality as f32,
    };
    let mut adam = Adam::new(settings.weight_decay);
    let mut history = History::default();
    let mut best: Option<Best<_>> = None;
    let mut step = 0;
    let rows = feed.rows() as f64;
    let blocks = feed.blocks(0, seed).len();
    let stage = progress.stage(stage, settings.epochs * blocks);
    for epoch in 0..settings.epochs {
        let learning_rate = settings.rate(epoch);
        let diverged = NetworkError::Diverged {
            epoch: epoch + 1,
            learning_rate,
        };
        let mut total = 0.0;
        for (number, parts) in feed.blocks(epoch, seed).iter().enumerate() {
            if number > 0 {
                stage.tick()?;
            }
            let Block { data, order } = feed.block(parts, number, epoch, seed)?;
            for batch in order.chunks(settings.batch) {
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
        }
        history.training.push(total / rows);
        history.epochs_run = epoch + 1;
        history.best_epoch = epoch;
        let mut stop = false;
        let held_out = feed.held_out(|data| {
            let predictions = model.predict(&data.features)?;
            Ok(loss.error(predictions.numbers(), data.targets.numbers()))
        })?;
        if let Some(error) = held_out {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::layers::*;
    use dfdx::prelude::{Cpu, DeviceBuildExt, SplitTape, TensorFromVec, Trace};
    use std::collections::HashSet;

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
