//! Outputs of a black box whose noise is known: they need no ensemble.

use crate::record::Signal;
use crate::twin::Noise;

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

impl KnownNoise {
    /// A run: the mean with these draws on it.
    pub(crate) fn draw(self, noise: Noise) -> Signal {
        let mut outputs = self.mean;
        (self.parts.iter()).for_each(|part| part.add(noise, &mut outputs));
        outputs
    }
}
