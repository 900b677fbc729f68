//! Outputs of a black box whose noise is known: they need no ensemble.

use crate::record::{Drive, Signal};
use crate::twin::{Noise, SimulationError};
use std::collections::HashMap;
use std::sync::{Arc, Mutex};

/// Outputs as a mean, with independent normal noise on each of them.
#[derive(Debug, Clone)]
pub(crate) struct KnownNoise {
    /// Outputs without noise, N × channels.
    pub mean: Signal,
    pub parts: Vec<NoisePart>,
}

/// A part of an output's noise.
#[derive(Debug, Clone)]
pub(crate) struct NoisePart {
    /// Index of the channel.
    pub output: usize,
    /// Standard deviation of what comes anew at each sample, in units of the output.
    pub level: f64,
    /// Share of itself that it keeps from a sample to the next; `None` for white noise.
    pub memory: Option<f64>,
    /// Standard deviation at the first sample of what is kept.
    pub start: f64,
    /// Name of its draws.
    pub source: String,
}

impl NoisePart {
    /// White noise of an output.
    pub(crate) fn white(output: usize, level: f64, source: String) -> Self {
        Self {
            output,
            level,
            memory: None,
            start: 0.0,
            source,
        }
    }

    /// Adds these draws to its channel of a signal.
    pub(crate) fn add(&self, noise: Noise, signal: &mut Signal) {
        let mut source = noise.source(&self.source);
        let column = signal.column_mut(self.output);
        let Some(memory) = self.memory else {
            column
                .into_iter()
                .for_each(|value| *value += self.level * source.normal());
            return;
        };
        let mut kept = self.start * source.normal();
        for value in column {
            *value += kept;
            kept = memory * kept + self.level * source.normal();
        }
    }
}

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
        let (dt, first_time) = (drive.dt(), drive.first_time());
        let numbers = theta[..self.entries]
            .iter()
            .chain([&dt, &first_time])
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
