//! Settings of a diagnosis.

use crate::effect::EffectPattern;

/// Settings of a diagnosis.
///
/// | setting | default | range | meaning |
/// |---|---|---|---|
/// | `alpha` | 0.05 | (0, 1) | level of every test |
/// | `replicates` | 60 | ≥ 1/alpha | simulations of the structural test |
/// | `unexplained` | 99 | ≥ 50 | simulations of the test that a named effect must pass |
/// | `seed` | 1 | | of everything random |
/// | `without` | none | ids, or `id@target` | effects that are not to be named |
/// | `initial` | none | | θ that an estimator gave, a start of the fit |
/// | `detection_only` | no | | stop after the verdict: neither where, nor which, nor how far |
#[derive(Debug, Clone, PartialEq)]
pub struct DiagnoseSettings {
    /// Level of every test.
    pub alpha: f64,
    /// Simulations of the structural test.
    pub replicates: usize,
    /// Simulations of the test with the effect added.
    pub unexplained: usize,
    /// Seed of everything random.
    pub seed: u64,
    /// Effects that are not to be named: `id` or `id@target`.
    pub without: Vec<EffectPattern>,
    /// θ from an estimator.
    pub initial: Option<Vec<f64>>,
    /// Stop after the verdict.
    pub detection_only: bool,
}

impl Default for DiagnoseSettings {
    fn default() -> Self {
        Self {
            alpha: 0.05,
            replicates: 60,
            unexplained: 99,
            seed: 1,
            without: vec![],
            initial: None,
            detection_only: false,
        }
    }
}
