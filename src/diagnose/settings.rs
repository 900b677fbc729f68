//! Settings of a diagnosis.

use crate::effect::EffectPattern;
use crate::twin::Noise;

/// Settings of a diagnosis.
///
/// | setting | default | range | meaning |
/// |---|---|---|---|
/// | `alpha` | 0.05 | (0, 1) | level of the test whether θ left its prior |
/// | `calibrate` | 0 | | records of the fitted twin that are simulated and diagnosed alike, for a p-value |
/// | `seed` | 1 | | of everything random |
/// | `without` | none | ids, or `id@target` | effects that are not to be named |
/// | `initial` | none | | θ that an estimator gave, a start of the fit |
/// | `detection_only` | no | | stop after the verdict: neither where, nor which, nor how far |
/// | `quick` | no | | effects one at a time, from few starts; no pairs, smallest visible effects or next input |
#[derive(Debug, Clone, PartialEq)]
pub struct DiagnoseSettings {
    /// Level of the test whether θ left its prior.
    pub alpha: f64,
    /// Records of the fitted twin that are simulated and diagnosed alike, for a p-value.
    pub calibrate: usize,
    /// Seed of everything random.
    pub seed: u64,
    /// Effects that are not to be named: `id` or `id@target`.
    pub without: Vec<EffectPattern>,
    /// θ from an estimator.
    pub initial: Option<Vec<f64>>,
    /// Stop after the verdict.
    pub detection_only: bool,
    /// Try effects one at a time, from few starts.
    pub quick: bool,
}

impl DiagnoseSettings {
    /// Source of everything random.
    pub(in crate::diagnose) fn noise(&self) -> Noise {
        Noise::new(self.seed, "diagnose", 0)
    }
}

impl Default for DiagnoseSettings {
    fn default() -> Self {
        Self {
            alpha: 0.05,
            calibrate: 0,
            seed: 1,
            without: vec![],
            initial: None,
            detection_only: false,
            quick: false,
        }
    }
}
