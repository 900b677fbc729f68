//! Outputs of a black box whose noise is known: they need no ensemble.

use crate::record::Signal;
use crate::twin::Noise;

/// Outputs as a mean, with independent normal noise on each of them.
#[derive(Debug, Clone)]
pub struct KnownNoise {
    /// Outputs without noise, N × channels.
    pub(crate) mean: Signal,
    pub(crate) parts: Vec<NoisePart>,
}

/// A part of an output's noise.
#[derive(Debug, Clone)]
pub(crate) struct NoisePart {
    /// Index of the output.
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

impl KnownNoise {
    /// A run: the mean with these draws on it.
    pub(crate) fn draw(self, noise: Noise) -> Signal {
        let mut outputs = self.mean;
        for part in &self.parts {
            let mut source = noise.source(&part.source);
            let column = outputs.column_mut(part.output);
            let Some(memory) = part.memory else {
                column
                    .into_iter()
                    .for_each(|value| *value += part.level * source.normal());
                continue;
            };
            let mut kept = part.start * source.normal();
            for value in column {
                *value += kept;
                kept = memory * kept + part.level * source.normal();
            }
        }
        outputs
    }
}
