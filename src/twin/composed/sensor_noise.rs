//! Noise of the sensors of a black box.

use super::known_noise::NoisePart;
use crate::record::{Drive, Signal};
use crate::twin::SimulationError;
use std::collections::HashMap;
use std::sync::{Arc, Mutex};

/// Noise level of an output.
#[derive(Debug, Clone)]
pub(crate) struct WhiteLevel {
    pub output: usize,
    /// Entry of θ.
    pub entry: usize,
    /// Name of its draws.
    pub source: String,
}

/// White noise of the sensors of a simulator. One run of a simulator without noise of its own serves a whole ensemble.
#[derive(Clone)]
pub(crate) struct SensorNoise {
    pub levels: Vec<WhiteLevel>,
    /// `true` of a simulator without noise of its own.
    pub is_silent: bool,
    /// Entries of θ that its runs depend on: the first ones.
    pub entries: usize,
    pub runs: Arc<Mutex<KeptRuns>>,
}

/// Values of runs that are kept.
const KEPT: usize = 2_000_000;

/// Runs by θ and drive.
#[derive(Default)]
pub(crate) struct KeptRuns {
    runs: HashMap<Vec<u64>, Arc<Signal>>,
    values: usize,
}

impl SensorNoise {
    pub fn parts<'a>(&'a self, theta: &'a [f64]) -> impl Iterator<Item = NoisePart> + 'a {
        (self.levels.iter())
            .map(|level| NoisePart::white(level.output, theta[level.entry], level.source.clone()))
    }

    /// Returns the run without noise at these parameters, made anew where it is not kept.
    pub fn run(
        &self,
        theta: &[f64],
        drive: &Drive,
        run: impl FnOnce() -> Result<Signal, SimulationError>,
    ) -> Result<Signal, SimulationError> {
        let dt = drive.dt();
        let numbers = theta[..self.entries]
            .iter()
            .chain([&dt])
            .chain(drive.inputs());
        let key: Vec<u64> = numbers
            .map(|v| v.to_bits())
            .chain([drive.samples() as u64])
            .collect();
        let kept = || self.runs.lock().unwrap_or_else(|e| e.into_inner());
        if let Some(run) = kept().runs.get(&key) {
            return Ok(run.as_ref().clone());
        }
        let run = run()?;
        let mut kept = kept();
        if kept.values > KEPT {
            *kept = KeptRuns::default();
        }
        kept.values += run.len() + key.len();
        kept.runs.insert(key, Arc::new(run.clone()));
        Ok(run)
    }
}
