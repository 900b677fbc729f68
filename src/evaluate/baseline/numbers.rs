//! Numbers of the baselines.

/// Numbers of the authors' code of Lakshminarayanan, Guerrero & Rojas.
pub(super) struct BaselineNumbers {
    /// Steps at most; the paper's six.
    pub iterations: usize,
    /// λ, in squared output units by squared parameter units.
    pub ridge: f64,
    /// Step of differences, in prior widths.
    pub step: f64,
    /// Halvings of a step before giving up.
    pub halvings: usize,
    /// Variance of each state at the first row.
    pub state_variance: f64,
    /// Variance of each parameter at the first row.
    pub parameter_variance: f64,
    /// Variance added to each state a step.
    pub state_walk: f64,
    /// Variance added to each parameter a step.
    pub parameter_walk: f64,
    /// Standard deviation of the measurement.
    pub measurement: f64,
    /// Step of differences, relative to the scale of what is varied.
    pub difference: f64,
    /// Standard deviation of the factor of a good start.
    pub good_spread: f64,
}

pub(super) const BASELINE: BaselineNumbers = BaselineNumbers {
    iterations: 6,
    ridge: 1e-3,
    step: 1e-4,
    halvings: 12,
    state_variance: 1e-2,
    parameter_variance: 0.1,
    state_walk: 1e-5,
    parameter_walk: 1e-7,
    measurement: 0.02,
    difference: 1e-5,
    good_spread: 0.1,
};
