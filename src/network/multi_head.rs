//! The object-safe faces: an architecture that trains networks, and a network that predicts.

use super::feed::{Data, Feed};
use super::model::{self, Model, ModelOf};
use super::rows::Rows;
use super::seed::{Purpose, derive};
use super::train::{Course, train};
use super::{
    Architecture, Checkpoints, HeadArchitecture, History, NamedTensor, Network, NetworkError,
    Samples, Training,
};
use crate::progress::Progress;
use dfdx::prelude::ConstDim;
use ndarray::Array2;
use std::fmt;
use std::marker::PhantomData;
use std::sync::Arc;

/// Makes `A` usable where types are no longer known.
pub fn architecture<A: HeadArchitecture>() -> Arc<dyn Architecture> {
    const {
        assert!(
            A::DROPOUT >= 0.0 && A::DROPOUT < 1.0,
            "DROPOUT must be at least 0 and below 1"
        );
    }
    Arc::new(Of::<A>(PhantomData))
}

struct Of<A>(PhantomData<fn() -> A>);

impl<A: HeadArchitecture> fmt::Debug for Of<A> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Architecture").field(&A::ID).finish()
    }
}

impl<A: HeadArchitecture> Of<A> {
    fn build(inputs: usize, outputs: usize, seed: u64) -> Result<MultiHead<A>, NetworkError> {
        if inputs > A::Features::SIZE {
            return Err(NetworkError::TooManyFeatures {
                architecture: A::ID,
                features: inputs,
                limit: A::Features::SIZE,
            });
        }
        for (what, count) in [("features", inputs), ("targets", outputs)] {
            if count == 0 {
                return Err(NetworkError::Empty { what, least: 1 });
            }
        }
        let seed = derive(seed, Purpose::Weights, 0);
        let model = model::build::<A>(inputs, outputs, seed)?;
        Ok(MultiHead { inputs, model })
    }
}

impl<A: HeadArchitecture> Architecture for Of<A> {
    fn id(&self) -> &'static str {
        A::ID
    }

    fn max_features(&self) -> usize {
        A::Features::SIZE
    }

    fn train_on(
        &self,
        samples: &dyn Samples,
        settings: &Training,
        seed: u64,
        checkpoints: &Checkpoints,
        progress: &Progress,
    ) -> Result<(Arc<dyn Network>, History), NetworkError> {
        settings.check()?;
        let network = Self::build(samples.features(), samples.targets(), seed)?;
        let read = |index: usize| {
            let part = samples.part(index);
            let (features, targets) = part.map_err(|e| NetworkError::Samples(e.to_string()))?;
            network.data(&features, &targets)
        };
        let width = A::Features::SIZE + samples.targets();
        let feed = Feed::new(&samples.parts(), width, &read, settings.holdout, seed)?;
        let mut model = network.model.clone();
        let course = Course {
            settings,
            seed,
            checkpoints,
            architecture: A::ID,
            progress,
            stage: "train",
        };
        let history = train(&mut model, &feed, &course)?;
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

fn expect(what: &'static str, expected: usize, found: usize) -> Result<(), NetworkError> {
    if expected == found {
        return Ok(());
    }
    Err(NetworkError::Size {
        what,
        expected,
        found,
    })
}

impl<A: HeadArchitecture> MultiHead<A> {
    fn rows(&self, features: &Array2<f64>) -> Result<Rows, NetworkError> {
        expect("features of a sample", self.inputs, features.ncols())?;
        Rows::padded("features", features, A::Features::SIZE)
    }

    fn data(&self, features: &Array2<f64>, targets: &Array2<f64>) -> Result<Data, NetworkError> {
        let outputs = self.model.heads.len();
        expect("targets of a sample", outputs, targets.ncols())?;
        expect("rows of targets", features.nrows(), targets.nrows())?;
        Ok(Data {
            features: self.rows(features)?,
            targets: Rows::padded("targets", targets, outputs)?,
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
        Ok(self.model.predict(&self.rows(features)?)?.to_matrix())
    }

    fn hidden(&self, features: &Array2<f64>) -> Result<Array2<f64>, NetworkError> {
        Ok(self.model.hidden(&self.rows(features)?)?.to_matrix())
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
        let mut heads = Model::<A::Hidden, A::Hidden, (), _>::new((), heads);
        let course = Course {
            settings,
            seed,
            checkpoints: &Checkpoints::none(),
            architecture: A::ID,
            progress,
            stage: "tune",
        };
        let history = train(&mut heads, &feed, &course)?;
        let tuned = Self {
            inputs: self.inputs,
            model: Model::new(self.model.trunk.clone(), heads.heads),
        };
        Ok((Arc::new(tuned), history))
    }

    fn weights(&self) -> Vec<NamedTensor> {
        self.model.weights()
    }
}
