//! Budget of an estimator: the sizes and thresholds of its steps that no setting changes.

/// Budget of an estimator.
#[derive(Debug)]
pub(super) struct EstimatorBudget {
    /// Failures of one sample before the draws count as hopeless; a twin that fails nine times in ten passes.
    pub attempts: usize,
    /// Share of failed draws beyond which the work stops.
    pub hopeless: f64,
    /// Simulations apart from the bank, on which the error of the network is measured.
    pub calibration: usize,
    /// Rows that inputs and targets are standardised with.
    pub standard_rows: usize,
    /// Largest network input, in standard deviations of the bank: far outside, the network should not extrapolate.
    pub largest_input: f64,
    /// Neighbours of a prediction whose errors are taken as its own.
    pub neighbours: usize,
    /// Weight of a row of zeros in the ridge regression of the quadratic layer.
    pub layer_ridge: f64,
    /// Monte-Carlo errors between p-value and level that leave the answer to chance in fewer than 1 of 20 cases.
    pub unsure: f64,
    /// Simulations of the test of an unsure answer, over those of the first: they halve its Monte-Carlo error.
    pub larger_test: usize,
    /// Iterations about features that were centred on the record.
    pub centred_iterations: u64,
    /// Largest move, in prior widths, of an estimate that rests.
    pub at_rest: f64,
    /// Half-width of the box, in standard deviations of a cloud of spread 1.
    pub box_reach: f64,
    /// Draws out of bounds before a draw is reflected at them: where the estimate lies in a corner of many dimensions, hardly any draw falls
    /// inside by itself.
    pub redraws: usize,
    /// Part of the cloud that is simulated beyond M_FT, to measure the error of the tuned heads: one of so many.
    pub cloud_calibration: usize,
    /// Its least size.
    pub least_cloud_calibration: usize,
    /// Largest network input of tuned heads, in standard deviations of the cloud.
    pub largest_tuned_input: f64,
    /// The tuned estimate is kept within this quantile of χ²_d: of its squared distance from the record's posterior, or of its whitened misfit.
    pub keep_tuned: f64,
    /// Standard errors of ln σ that a fitted level lies off the declared one before it takes its place: by chance in 3 of 1000. At two of
    /// them every twentieth level of a right twin would; at six a sensor twice as loud as declared goes unseen in 50 samples.
    pub level_off: f64,
    /// Least factor between the two: less changes no interval by more than a fifth, however sure it is.
    pub level_factor: f64,
    /// Draws of the noise levels for the tests: their spread is then known to an eighth.
    pub level_draws: u64,
    /// Ratio of free-run errors from which on the twin's own records are asked: few answers pay for them.
    pub larger_error: f64,
    /// Records of the twin itself that a free run's error is compared with: by chance, one in twenty lies beyond all.
    pub own_records: u64,
    /// Probability that the likelihood at the truth lies so far below its top.
    pub less_likely: f64,
    /// Share of a prior's information in an answer from which on the answer leans on it: the prior then moves the answer by this share of
    /// the truth's distance from its centre.
    pub leaning: f64,
}

/// The budget of every estimator.
pub(super) const BUDGET: EstimatorBudget = EstimatorBudget {
    attempts: 200,
    hopeless: 0.9,
    calibration: 1000,
    standard_rows: 20_000,
    largest_input: 6.0,
    neighbours: 100,
    layer_ridge: 1.0,
    unsure: 2.0,
    larger_test: 4,
    centred_iterations: 3,
    at_rest: 1e-3,
    box_reach: 1.8,
    redraws: 10,
    cloud_calibration: 5,
    least_cloud_calibration: 200,
    largest_tuned_input: 8.0,
    keep_tuned: 0.999,
    level_off: 3.0,
    level_factor: 1.2,
    level_draws: 32,
    larger_error: 1.2,
    own_records: 19,
    less_likely: 0.1,
    leaning: 0.1,
};
