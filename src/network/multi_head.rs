//! Networks whose types are no longer known: the faces that the estimator sees, over the static types of an architecture.

use super::data::{Data, Feed, Samples, SeedUse, derive, missing, padded};
use super::model::{self, ModelOf, MultiHeadModel};
use super::train::Course;
use super::{Checkpoints, HeadArchitecture, History, NamedTensor, NetworkError, Training};
use crate::progress::Progress;
use crate::setting::count;
use dfdx::prelude::ConstDim;
use ndarray::Array2;
use std::fmt::{self, Debug};
use std::marker::PhantomData;
use std::sync::Arc;

/// An architecture behind an object-safe face; made by [`architecture`].
pub trait Architecture: Send + Sync + Debug {
    /// [`HeadArchitecture::ID`](super::HeadArchitecture::ID).
    fn id(&self) -> &'static str;

    /// The most features that it takes.
    fn max_features(&self) -> usize;

    /// Trains a new network on samples that the caller has standardised, by Adam on the loss of [`Training`]. The same
    /// arguments give the same bits. Ticks the stage `train` once an epoch.
    ///
    /// Samples that come in several parts may be larger than memory: at most 64 MiB are held at a time. The last parts are then held out,
    /// and each epoch takes the others in a new order, with the rows in memory shuffled.
    ///
    /// A training that was interrupted goes on with what `checkpoints` have kept of it, to the same bits.
    fn train_on(
        &self,
        samples: &Samples<'_>,
        settings: &Training,
        seed: u64,
        checkpoints: &Checkpoints,
        progress: &Progress,
    ) -> Result<(Arc<dyn Network>, History), NetworkError>;

    /// Puts a network of `inputs` features and `outputs` heads together from [`Network::weights`]. The error names the first
    /// tensor that is missing, surplus, of another shape, or not finite.
    fn restore(
        &self,
        inputs: usize,
        outputs: usize,
        weights: &[NamedTensor],
    ) -> Result<Arc<dyn Network>, NetworkError>;
}

/// A trained network. It never changes: tuning makes another one.
pub trait Network: Send + Sync + Debug {
    /// Number of features, n.
    fn inputs(&self) -> usize;

    /// Number of heads, d.
    fn outputs(&self) -> usize;

    /// Predictions (samples × d) from `features` (samples × n), without dropout.
    ///
    /// A sample's prediction may differ in its last bits (1e-6) with the number of samples that come along.
    fn predict(&self, features: &Array2<f64>) -> Result<Array2<f64>, NetworkError>;

    /// A network with the same trunk, and heads trained further on `features` and `targets`.
    ///
    /// The trunk is evaluated once, without dropout; then only the heads train, on its output, starting where they are.
    /// Ticks the stage `tune` once an epoch.
    fn tune_heads(
        &self,
        features: &Array2<f64>,
        targets: &Array2<f64>,
        settings: &Training,
        seed: u64,
        progress: &Progress,
    ) -> Result<(Arc<dyn Network>, History), NetworkError>;

    /// All tensors, by names such as `trunk.0.weight` and `heads.2.1.gamma`, in a fixed order.
    fn weights(&self) -> Vec<NamedTensor>;
}

/// Makes `A` usable where types are no longer known.
pub fn architecture<A: HeadArchitecture>() -> Arc<dyn Architecture> {
    const {
        assert!(
            A::DROPOUT >= 0.0 && A::DROPOUT < 1.0,
            "DROPOUT must be at least 0 and below 1"
        );
    }
    Arc::new(Typed::<A>(PhantomData))
}

/// An architecture by its static types.
struct Typed<A>(PhantomData<fn() -> A>);

impl<A: HeadArchitecture> fmt::Debug for Typed<A> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Architecture").field(&A::ID).finish()
    }
}

impl<A: HeadArchitecture> Typed<A> {
    fn build(inputs: usize, outputs: usize, seed: u64) -> Result<MultiHead<A>, NetworkError> {
        if inputs > A::Features::SIZE {
            return Err(NetworkError::Data(format!(
                "{}, but architecture `{}` takes at most {}; \
                 use fewer features or an architecture with larger `Features`",
                count(inputs, "feature"),
                A::ID,
                A::Features::SIZE
            )));
        }
        for (what, count) in [("features", inputs), ("targets", outputs)] {
            if count == 0 {
                return Err(missing(what, 1));
            }
        }
        let seed = derive(seed, SeedUse::Weights, 0);
        let model = model::build::<A>(inputs, outputs, seed)?;
        Ok(MultiHead { inputs, model })
    }
}

impl<A: HeadArchitecture> Architecture for Typed<A> {
    fn id(&self) -> &'static str {
        A::ID
    }

    fn max_features(&self) -> usize {
        A::Features::SIZE
    }

    fn train_on(
        &self,
        samples: &Samples<'_>,
        settings: &Training,
        seed: u64,
        checkpoints: &Checkpoints,
        progress: &Progress,
    ) -> Result<(Arc<dyn Network>, History), NetworkError> {
        settings.check()?;
        let network = Self::build(samples.features, samples.targets, seed)?;
        let read = |index: usize| {
            let part = (samples.read)(index);
            let (features, targets) = part.map_err(|e| NetworkError::Data(e.to_string()))?;
            network.data(&features, &targets)
        };
        let width = A::Features::SIZE + samples.targets;
        let feed = Feed::new(&samples.parts, width, &read, settings.holdout, seed)?;
        let course = Course {
            settings,
            seed,
            checkpoints,
            architecture: A::ID,
            progress,
            stage: "train",
        };
        let (model, history) = network.model.clone().trained(&feed, &course)?;
        let inputs = network.inputs;
        Ok((Arc::new(MultiHead::<A> { inputs, model }), history))
    }

    fn restore(
        &self,
        inputs: usize,
        outputs: usize,
        weights: &[NamedTensor],
    ) -> Result<Arc<dyn Network>, NetworkError> {
        let mut network = Self::build(inputs, outputs, 0)?;
        network.model.restore(A::ID, weights)?;
        Ok(Arc::new(network))
    }
}

/// A network of architecture `A` for `inputs` ≤ `A::Features` features.
struct MultiHead<A: HeadArchitecture> {
    inputs: usize,
    model: ModelOf<A>,
}

impl<A: HeadArchitecture> fmt::Debug for MultiHead<A> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Network")
            .field("architecture", &A::ID)
            .field("inputs", &self.inputs)
            .field("outputs", &self.model.heads.len())
            .finish()
    }
}

fn expect(what: &str, expected: usize, found: usize) -> Result<(), NetworkError> {
    match expected == found {
        true => Ok(()),
        false => Err(NetworkError::Data(format!(
            "{what}: expected {expected}, found {found}"
        ))),
    }
}

impl<A: HeadArchitecture> MultiHead<A> {
    fn rows(&self, features: &Array2<f64>) -> Result<Array2<f32>, NetworkError> {
        expect("features of a sample", self.inputs, features.ncols())?;
        padded("features", features, A::Features::SIZE)
    }

    fn data(&self, features: &Array2<f64>, targets: &Array2<f64>) -> Result<Data, NetworkError> {
        let outputs = self.model.heads.len();
        expect("targets of a sample", outputs, targets.ncols())?;
        expect("rows of targets", features.nrows(), targets.nrows())?;
        Ok(Data {
            features: self.rows(features)?,
            targets: padded("targets", targets, outputs)?,
        })
    }
}

impl<A: HeadArchitecture> Network for MultiHead<A> {
    fn inputs(&self) -> usize {
        self.inputs
    }

    fn outputs(&self) -> usize {
        self.model.heads.len()
    }

    fn predict(&self, features: &Array2<f64>) -> Result<Array2<f64>, NetworkError> {
        Ok((self.model.predict(&self.rows(features)?)?).mapv(f64::from))
    }

    fn tune_heads(
        &self,
        features: &Array2<f64>,
        targets: &Array2<f64>,
        settings: &Training,
        seed: u64,
        progress: &Progress,
    ) -> Result<(Arc<dyn Network>, History), NetworkError> {
        settings.check()?;
        let read = |_: usize| {
            let Data { features, targets } = self.data(features, targets)?;
            Ok(Data {
                features: self.model.hidden(&features)?,
                targets,
            })
        };
        let width = A::Hidden::SIZE + targets.ncols();
        let feed = Feed::new(&[features.nrows()], width, &read, settings.holdout, seed)?;
        // Heads alone are a model too, with a trunk that does nothing.
        let heads = self.model.heads.clone();
        let heads = MultiHeadModel::<A::Hidden, A::Hidden, (), _>::new((), heads);
        let course = Course {
            settings,
            seed,
            checkpoints: &Checkpoints::none(),
            architecture: A::ID,
            progress,
            stage: "tune",
        };
        let (heads, history) = heads.trained(&feed, &course)?;
        let tuned = Self {
            inputs: self.inputs,
            model: MultiHeadModel::new(self.model.trunk.clone(), heads.heads),
        };
        Ok((Arc::new(tuned), history))
    }

    fn weights(&self) -> Vec<NamedTensor> {
        self.model.weights()
    }
}
