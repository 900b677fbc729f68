//! The training loop.

use super::adam::Adam;
use super::checkpoints::{Position, State};
use super::feed::{Block, Feed};
use super::loss::Loss;
use super::model::Model;
use super::seed::{Purpose, derive};
use super::{Checkpoints, FirstWeight, History, Layers, NamedTensor, NetworkError, Training};
use crate::progress::{Progress, Stage};
use dfdx::prelude::{Backward, Const, ConstDim, Cpu};

/// Settings and seeds of one training.
pub(super) struct Course<'a> {
    pub settings: &'a Training,
    pub seed: u64,
    pub checkpoints: &'a Checkpoints,
    /// The model's architecture.
    pub architecture: &'static str,
    pub progress: &'a Progress,
    /// Its stage, one tick a block.
    pub stage: &'static str,
}

/// Trains `model` in place; where rows are held out, it ends with the weights that were best on them.
pub(super) fn train<I, K, T, H>(
    model: &mut Model<I, K, T, H>,
    feed: &Feed<'_>,
    course: &Course<'_>,
) -> Result<History, NetworkError>
where
    I: ConstDim,
    K: ConstDim,
    T: Layers<I, K>,
    H: Layers<K, Const<1>> + FirstWeight<K>,
{
    let &Course { settings, seed, .. } = course;
    let loss = Loss {
        weights: settings.weights_for(model.heads.len())?,
        delta: settings.huber_delta as f32,
        orthogonality: settings.orthogonality as f32,
    };
    let (mut at, mut adam, mut best) = begin(model, course);
    let rows = feed.rows() as f64;
    let blocks = feed.blocks(0, seed).len();
    let stage = (course.progress).stage(course.stage, settings.epochs * blocks);
    stage.skip(at.epoch * blocks + at.block);
    while at.epoch < settings.epochs {
        let learning_rate = settings.rate(at.epoch);
        let diverged = NetworkError::Diverged {
            epoch: at.epoch + 1,
            learning_rate,
        };
        let parts = feed.blocks(at.epoch, seed);
        while at.block < parts.len() {
            let Block { data, order } = feed.block(&parts[at.block], at.block, at.epoch, seed)?;
            for batch in order.chunks(settings.batch) {
                let device = Cpu::seed_from_u64(derive(seed, Purpose::Dropout, at.step));
                at.step += 1;
                let predictions = model.forward_taped(data.features.gather(batch), &device)?;
                let targets = data.targets.gather(batch);
                let (error, taped) = loss.taped(predictions, &targets, &model.heads)?;
                if !error.is_finite() {
                    return Err(diverged);
                }
                at.total += error * batch.len() as f64;
                let mut gradients = taped.try_backward()?;
                let mut adam = adam.step(learning_rate, &mut gradients);
                adam.update(&mut model.trunk)?;
                for head in &mut model.heads {
                    adam.update(head)?;
                }
            }
            at.block += 1;
            if at.block < parts.len() {
                done(course, &stage, &at, model, best.as_ref(), &adam)?;
            }
        }
        at.history.training.push(at.total / rows);
        at.history.epochs_run = at.epoch + 1;
        at.history.best_epoch = at.epoch;
        let mut stop = false;
        let held_out = feed.held_out(|data| {
            let predictions = model.predict(&data.features)?;
            Ok(loss.error(predictions.numbers(), data.targets.numbers()))
        })?;
        if let Some(error) = held_out {
            if !error.is_finite() {
                return Err(diverged);
            }
            at.history.holdout.push(error);
            if at.best.is_none_or(|(least, _)| error < least) {
                at.best = Some((error, at.epoch));
                best = Some(model.clone());
            }
            at.history.best_epoch = at.best.map_or(at.epoch, |(_, epoch)| epoch);
            stop = settings.patience > 0 && at.epoch - at.history.best_epoch >= settings.patience;
        }
        if stop {
            stage.finish();
            break;
        }
        (at.epoch, at.block, at.total) = (at.epoch + 1, 0, 0.0);
        done(course, &stage, &at, model, best.as_ref(), &adam)?;
    }
    let history = at.history;
    if let Some(best) = best {
        *model = best;
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

/// A block is done: says so, and keeps the state if it is time to, or if the work is to stop.
fn done<I, K, T, H>(
    course: &Course<'_>,
    stage: &Stage,
    at: &Position,
    model: &Model<I, K, T, H>,
    best: Option<&Model<I, K, T, H>>,
    adam: &Adam,
) -> Result<(), NetworkError>
where
    I: ConstDim,
    K: ConstDim,
    T: Layers<I, K>,
    H: Layers<K, Const<1>> + FirstWeight<K>,
{
    let stopped = stage.tick();
    course.checkpoints.keep(stopped.is_err(), || State {
        position: at.clone(),
        weights: model.weights(),
        best: best.map_or(vec![], Model::weights),
        adam: adam.clone(),
    })?;
    Ok(stopped?)
}

/// Where a training begins, Adam, and the weights that were best so far.
type Begun<M> = (Position, Adam, Option<M>);

/// Begins with what was kept, else anew.
fn begin<I, K, T, H>(model: &mut Model<I, K, T, H>, course: &Course<'_>) -> Begun<Model<I, K, T, H>>
where
    I: ConstDim,
    K: ConstDim,
    T: Layers<I, K>,
    H: Layers<K, Const<1>> + FirstWeight<K>,
{
    let decay = course.settings.weight_decay;
    let kept = course.checkpoints.load(decay).and_then(|state| {
        let restored = |weights| {
            let mut restored = model.clone();
            restored.restore(course.architecture, weights).ok()?;
            Some(restored)
        };
        let now = restored(&state.weights)?;
        let best = match state.position.best {
            Some(_) => Some(restored(&state.best)?),
            None => None,
        };
        Some((now, best, state))
    });
    match kept {
        Some((now, best, state)) => {
            *model = now;
            (state.position, state.adam, best)
        }
        None => (Position::default(), Adam::new(decay), None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::feed::Data;
    use crate::network::layers::*;
    use crate::network::model;
    use crate::network::rows::Rows;
    use crate::progress::Listener;
    use dfdx::prelude::{Cpu, DeviceBuildExt, SplitTape, TensorFromVec, Trace};
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::time::Duration;

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

    struct Small;
    impl HeadArchitecture for Small {
        const ID: &'static str = "small";
        type Features = Const<2>;
        type Hidden = Const<8>;
        type Trunk = NormDense<2, 8, Tanh>;
        type Head = Linear<8, 1>;
        const DROPOUT: f64 = 0.1;
    }

    /// Asks to stop once the work has come forward.
    #[derive(Default)]
    struct StopAtOnce(AtomicBool);

    impl Listener for StopAtOnce {
        fn advanced(&self, _: &str, done: u64, _: u64) {
            self.0.store(done > 0, Ordering::Relaxed);
        }
        fn cancelled(&self) -> bool {
            self.0.load(Ordering::Relaxed)
        }
    }

    /// Six parts of 20 rows, 40 rows in a block, or all; stopped at every block: weights, losses and the best epoch are those
    /// of a training that nothing has disturbed.
    #[test]
    fn a_training_that_is_stopped_goes_on_to_the_same_bits() {
        let read = |part: usize| {
            let number = |i: usize| ((part * 20 + i) as f32 * 0.618).fract() - 0.5;
            Ok(Data {
                features: Rows::new(2, (0..40).map(number).collect()),
                targets: Rows::new(1, (0..20).map(|i| number(2 * i)).collect()),
            })
        };
        for (most, holdout, blocks) in [(1000, 0.2, 1), (40, 0.2, 2), (40, 0.0, 3)] {
            let settings = Training {
                epochs: 6,
                batch: 16,
                holdout,
                patience: 3,
                ..Training::default()
            };
            let feed = Feed::with_block(&[20; 6], most, &read, holdout, 1).unwrap();
            assert_eq!(feed.blocks(0, 1).len(), blocks);
            let run = |checkpoints: &Checkpoints, progress: &Progress| {
                let mut model = model::build::<Small>(2, 1, 1).unwrap();
                let course = Course {
                    settings: &settings,
                    seed: 1,
                    checkpoints,
                    architecture: Small::ID,
                    progress,
                    stage: "train",
                };
                train(&mut model, &feed, &course).map(|history| (model.weights(), history))
            };
            let whole = run(&Checkpoints::none(), &Progress::silent()).unwrap();
            let place = tempfile::tempdir().unwrap();
            let path = place.path().join("training");
            let mut stops = 0;
            let resumed = loop {
                let kept = Checkpoints::new(&path, Duration::ZERO);
                match run(&kept, &Progress::new(Arc::new(StopAtOnce::default()))) {
                    Err(NetworkError::Cancelled(_)) => stops += 1,
                    trained => break trained.unwrap(),
                }
                assert!(stops < 100, "it does not come forward");
            };
            assert!(stops > 3 * blocks, "{stops}");
            assert_eq!(resumed, whole);
        }
    }
}
