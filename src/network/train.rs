//! The training loop.

use super::adam::Adam;
use super::checkpoints::{Position, TrainingState};
use super::data::{Feed, SeedUse, derive, gathered};
use super::loss::Loss;
use super::model::{FirstWeight, Layers, MultiHeadModel};
use super::{Checkpoints, History, NamedTensor, NetworkError, Training};
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

/// A training under way: everything that its rest depends on.
struct Trainee<M> {
    model: M,
    at: Position,
    adam: Adam,
    /// The model that was best on the rows held out.
    best: Option<M>,
}

impl<I, K, T, H> MultiHeadModel<I, K, T, H>
where
    I: ConstDim,
    K: ConstDim,
    T: Layers<I, K>,
    H: Layers<K, Const<1>> + FirstWeight<K>,
{
    /// Trains the model; where rows are held out, it ends with the weights that were best on them.
    pub(super) fn trained(
        self,
        feed: &Feed<'_>,
        course: &Course<'_>,
    ) -> Result<(Self, History), NetworkError> {
        let settings = course.settings;
        let loss = Loss {
            weights: settings.weights_for(self.heads.len())?,
            delta: settings.huber_delta as f32,
            orthogonality: settings.orthogonality as f32,
        };
        let mut trainee = Trainee::begin(self, course);
        let blocks = feed.blocks(0).len();
        let stage = (course.progress).stage(course.stage, settings.epochs * blocks);
        stage.skip(trainee.at.epoch * blocks + trainee.at.block);
        while trainee.at.epoch < settings.epochs {
            trainee.epoch(feed, &loss, course, &stage)?;
            if trainee.has_converged(settings) {
                stage.finish();
                break;
            }
            trainee.at.next_epoch();
            trainee.keep(course, &stage)?;
        }
        let Trainee {
            model, at, best, ..
        } = trainee;
        let model = best.unwrap_or(model);
        // Without holdout rows nothing has looked at the weights since the last step.
        let finite = |tensor: &NamedTensor| tensor.values.iter().all(|v| v.is_finite());
        match model.weights().iter().all(finite) {
            true => Ok((model, at.history)),
            false => Err(diverged(settings, at.history.epochs_run - 1)),
        }
    }
}

fn diverged(settings: &Training, epoch: usize) -> NetworkError {
    NetworkError::Diverged {
        epoch: epoch + 1,
        learning_rate: settings.rate(epoch),
    }
}

impl<I, K, T, H> Trainee<MultiHeadModel<I, K, T, H>>
where
    I: ConstDim,
    K: ConstDim,
    T: Layers<I, K>,
    H: Layers<K, Const<1>> + FirstWeight<K>,
{
    /// Begins with what was kept, else anew.
    fn begin(model: MultiHeadModel<I, K, T, H>, course: &Course<'_>) -> Self {
        let decay = course.settings.weight_decay;
        let restored = |weights: &[NamedTensor]| {
            let mut restored = model.clone();
            restored.restore(course.architecture, weights).ok()?;
            Some(restored)
        };
        let kept = course.checkpoints.load(decay).and_then(|state| {
            Some(Self {
                model: restored(&state.weights)?,
                best: match state.position.best {
                    Some(_) => Some(restored(&state.best)?),
                    None => None,
                },
                at: state.position,
                adam: state.adam,
            })
        });
        kept.unwrap_or_else(|| Self {
            model: model.clone(),
            at: Position::default(),
            adam: Adam::new(decay),
            best: None,
        })
    }

    /// Trains the rest of an epoch, and measures it.
    fn epoch(
        &mut self,
        feed: &Feed<'_>,
        loss: &Loss,
        course: &Course<'_>,
        stage: &Stage,
    ) -> Result<(), NetworkError> {
        let &Course { settings, seed, .. } = course;
        let epoch = self.at.epoch;
        let parts = feed.blocks(epoch);
        while self.at.block < parts.len() {
            let (data, order) = feed.block(&parts[self.at.block], self.at.block, epoch)?;
            for batch in order.chunks(settings.batch) {
                let device = Cpu::seed_from_u64(derive(seed, SeedUse::Dropout, self.at.step));
                self.at.step += 1;
                let predictions = (self.model).forward_taped(&data.features, batch, &device)?;
                let targets = gathered(&data.targets, batch);
                let (error, taped) = loss.taped(predictions, &targets, &self.model.heads)?;
                if !error.is_finite() {
                    return Err(diverged(settings, epoch));
                }
                self.at.total += error * batch.len() as f64;
                let mut gradients = taped.try_backward()?;
                let mut step = self.adam.step(settings.rate(epoch), &mut gradients);
                step.update(&mut self.model.trunk)?;
                for head in &mut self.model.heads {
                    step.update(head)?;
                }
            }
            self.at.block += 1;
            if self.at.block < parts.len() {
                self.keep(course, stage)?;
            }
        }
        let history = &mut self.at.history;
        history.training.push(self.at.total / feed.rows() as f64);
        history.epochs_run = epoch + 1;
        history.best_epoch = epoch;
        let held_out = feed
            .held_out(|data| Ok(loss.error(&self.model.predict(&data.features)?, &data.targets)))?;
        if let Some(error) = held_out {
            if !error.is_finite() {
                return Err(diverged(settings, epoch));
            }
            history.holdout.push(error);
            if self.at.best.is_none_or(|(least, _)| error < least) {
                self.at.best = Some((error, epoch));
                self.best = Some(self.model.clone());
            }
            history.best_epoch = self.at.best.map_or(epoch, |(_, epoch)| epoch);
        }
        Ok(())
    }

    /// Returns whether the rows held out have seen no better epoch for too long.
    fn has_converged(&self, settings: &Training) -> bool {
        let since = self.at.epoch - self.at.history.best_epoch;
        settings.patience > 0 && self.at.best.is_some() && since >= settings.patience
    }

    /// Reports a block, and keeps the state if it is time to, or if the work is to stop.
    fn keep(&self, course: &Course<'_>, stage: &Stage) -> Result<(), NetworkError> {
        let stopped = stage.tick();
        course
            .checkpoints
            .keep(stopped.is_err(), || TrainingState {
                position: self.at.clone(),
                weights: self.model.weights(),
                best: self.best.as_ref().map_or(vec![], MultiHeadModel::weights),
                adam: self.adam.clone(),
            })?;
        Ok(stopped?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::data::Data;
    use crate::network::layers::*;
    use crate::network::model;
    use crate::progress::Listener;
    use dfdx::prelude::{DeviceBuildExt, SplitTape, TensorFromVec, Trace};
    use ndarray::Array2;
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
            crate::network::tensors::set_dropout(&mut layers, 0.5).unwrap();
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
                features: Array2::from_shape_fn((20, 2), |(i, j)| number(2 * i + j)),
                targets: Array2::from_shape_fn((20, 1), |(i, _)| number(2 * i)),
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
            assert_eq!(feed.blocks(0).len(), blocks);
            let run = |checkpoints: &Checkpoints, progress: &Progress| {
                let model = model::build::<Small>(2, 1, 1).unwrap();
                let course = Course {
                    settings: &settings,
                    seed: 1,
                    checkpoints,
                    architecture: Small::ID,
                    progress,
                    stage: "train",
                };
                let (model, history) = model.trained(&feed, &course)?;
                Ok((model.weights(), history))
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
