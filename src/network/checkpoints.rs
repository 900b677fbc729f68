//! A training that is interrupted goes on where it was, to the same bits.

use super::adam::{Adam, AdamMoments};
use super::{History, NamedTensor, NetworkError, bytes_of, values_of};
use crate::storage::checksum::sha256;
use crate::storage::files::{replace, with_remedy};
use crate::storage::untrusted::read_kept;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Key of what is not a tensor, in the container's metadata.
const KEY: &str = "training";
/// Longest file: four times that of an estimator, for weights, moments and the best weights.
const MOST: u64 = 4 << 30;
/// Length of the checksum before the container.
const DIGITS: usize = 64;
/// Prefixes of the tensors' names.
const WEIGHTS: &str = "weights/";
const BEST: &str = "best/";
const FIRST: &str = "first/";
const SECOND: &str = "second/";

/// Where a training keeps its state, and how often; by default nowhere.
///
/// The state is taken between two blocks of samples: weights, both moments of Adam, the best weights so far, losses, and the
/// numbers of epoch, block and step, which everything random is drawn from. It is one file, which appears whole; one that is
/// damaged or of another network counts as none, and the training begins anew. What else a training depends on (samples,
/// settings, seed) is the caller's to compare before the state is gone on with.
#[derive(Debug, Default)]
pub struct Checkpoints(Option<CheckpointFile>);

#[derive(Debug)]
struct CheckpointFile {
    path: PathBuf,
    every: Duration,
    last: Mutex<Instant>,
}

/// Where a training stands: at the beginning of a block.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Position {
    pub epoch: usize,
    pub block: usize,
    /// Batches behind it.
    pub step: u64,
    /// Sum of the errors of this epoch's rows so far.
    pub total: f64,
    pub history: History,
    /// Error and epoch of the weights that were best.
    pub best: Option<(f64, usize)>,
}

impl Position {
    /// The beginning of the next epoch.
    pub(super) fn next_epoch(&mut self) {
        (self.epoch, self.block, self.total) = (self.epoch + 1, 0, 0.0);
    }
}

/// All that the rest of a training depends on, as it is kept.
pub(super) struct TrainingState {
    pub position: Position,
    pub weights: Vec<NamedTensor>,
    pub best: Vec<NamedTensor>,
    pub adam: Adam,
}

impl Checkpoints {
    /// Keeps the state in a file, each time that so long has passed.
    pub fn new(path: impl Into<PathBuf>, every: Duration) -> Self {
        Self(Some(CheckpointFile {
            path: path.into(),
            every,
            last: Mutex::new(Instant::now()),
        }))
    }

    /// Keeps nothing.
    pub fn none() -> Self {
        Self::default()
    }

    /// Loads the last checkpoint, if it can be used.
    pub(super) fn load(&self, weight_decay: f64) -> Option<TrainingState> {
        let bytes = read_kept(&self.0.as_ref()?.path, MOST).ok()?;
        TrainingState::parse(&bytes, weight_decay)
    }

    /// Keeps a state, if it is time to, or if there will be no other time.
    pub(super) fn keep(
        &self,
        last_time: bool,
        state: impl FnOnce() -> TrainingState,
    ) -> Result<(), NetworkError> {
        let Some(place) = &self.0 else {
            return Ok(());
        };
        let mut last = place.last.lock().unwrap_or_else(|error| error.into_inner());
        if !last_time && last.elapsed() < place.every {
            return Ok(());
        }
        let failed = |reason: String| NetworkError::Checkpoint {
            path: place.path.clone(),
            reason,
        };
        let bytes = state().bytes().map_err(failed)?;
        replace(&place.path, &bytes).map_err(|error| failed(with_remedy(&error)))?;
        *last = Instant::now();
        Ok(())
    }
}

impl TrainingState {
    fn bytes(&self) -> Result<Vec<u8>, String> {
        let mut tensors = Vec::new();
        for (prefix, list) in [(WEIGHTS, &self.weights), (BEST, &self.best)] {
            for tensor in list {
                let name = format!("{prefix}{}", tensor.name);
                tensors.push((name, tensor.shape.clone(), bytes_of(&tensor.values)));
            }
        }
        for (index, moments) in self.adam.moments.iter().enumerate() {
            for (prefix, values) in [(FIRST, &moments.first), (SECOND, &moments.second)] {
                let name = format!("{prefix}{index}");
                tensors.push((name, vec![values.len()], bytes_of(values)));
            }
        }
        let views = (tensors.iter())
            .map(|(name, shape, bytes)| {
                Ok((name, TensorView::new(Dtype::F32, shape.clone(), bytes)?))
            })
            .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
            .map_err(|error| format!("{error:?}"))?;
        let text = serde_json::to_string(&self.position).map_err(|error| error.to_string())?;
        let metadata = Some(HashMap::from([(KEY.to_owned(), text)]));
        let container =
            safetensors::serialize(views, &metadata).map_err(|error| format!("{error:?}"))?;
        Ok([sha256(&container).as_bytes(), &container].concat())
    }

    fn parse(bytes: &[u8], weight_decay: f64) -> Option<Self> {
        let (digest, bytes) = bytes.split_at_checked(DIGITS)?;
        if sha256(bytes).as_bytes() != digest {
            return None;
        }
        let (_, metadata) = SafeTensors::read_metadata(bytes).ok()?;
        let text = metadata.metadata().as_ref()?.get(KEY)?;
        let position: Position = serde_json::from_str(text).ok()?;
        let container = SafeTensors::deserialize(bytes).ok()?;
        let (mut weights, mut best) = (Vec::new(), Vec::new());
        for (name, view) in container.tensors() {
            let list = [(WEIGHTS, &mut weights), (BEST, &mut best)];
            for (prefix, list) in list {
                if let Some(name) = name.strip_prefix(prefix) {
                    list.push(NamedTensor {
                        name: name.into(),
                        shape: view.shape().to_vec(),
                        values: values_of(view.data()),
                    });
                }
            }
        }
        let moment = |prefix: &str, index: usize| {
            let view = container.tensor(&format!("{prefix}{index}")).ok()?;
            Some(values_of(view.data()))
        };
        let mut adam = Adam::new(weight_decay);
        // A step a batch.
        adam.steps = i32::try_from(position.step).ok()?;
        while let (Some(first), Some(second)) = (
            moment(FIRST, adam.moments.len()),
            moment(SECOND, adam.moments.len()),
        ) {
            adam.moments.push(AdamMoments { first, second });
        }
        Some(Self {
            position,
            weights,
            best,
            adam,
        })
    }
}
