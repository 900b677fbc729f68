//! Budget of an estimator: the sizes and thresholds of its steps that no setting changes.

numbers! {
    /// Budget of an estimator.
    pub(super) const BUDGET: EstimatorBudget = {
        /// Failures of one sample before the draws count as hopeless; a twin that fails nine times in ten passes.
        attempts: usize = 200,
        /// Share of failed draws beyond which the work stops.
        hopeless: f64 = 0.9,
        /// Simulations apart from the bank, on which the error of the network is measured.
        calibration: usize = 1000,
        /// Rows that inputs and targets are standardised with.
        standard_rows: usize = 20_000,
        /// Largest network input, in standard deviations of the bank: far outside, the network should not extrapolate.
        largest_input: f64 = 6.0,
        /// Neighbours of a prediction whose errors are taken as its own.
        neighbours: usize = 100,
        /// Weight of a row of zeros in the ridge regression of the quadratic layer.
        layer_ridge: f64 = 1.0,
        /// Monte-Carlo errors between p-value and level that leave the answer to chance in fewer than 1 of 20 cases.
        unsure: f64 = 2.0,
        /// Simulations of the test of an unsure answer, over those of the first: they halve its Monte-Carlo error.
        larger_test: usize = 4,
        /// Iterations about features that were centred on the record.
        centred_iterations: u64 = 3,
        /// Largest move, in prior widths, of an estimate that rests.
        at_rest: f64 = 1e-3,
        /// Half-width of the box, in standard deviations of a cloud of spread 1.
        box_reach: f64 = 1.8,
        /// Draws out of bounds before a draw is reflected at them: where the estimate lies in a corner of many dimensions, hardly any draw falls
        /// inside by itself.
        redraws: usize = 10,
        /// Part of the cloud that is simulated beyond M_FT, to measure the error of the tuned heads: one of so many.
        cloud_calibration: usize = 5,
        /// Its least size.
        least_cloud_calibration: usize = 200,
        /// Largest network input of tuned heads, in standard deviations of the cloud.
        largest_tuned_input: f64 = 8.0,
        /// The tuned estimate is kept within this quantile of χ²_d: of its squared distance from the record's posterior, or of its whitened misfit.
        keep_tuned: f64 = 0.999,
        /// Standard errors of ln σ that a fitted level lies off the declared one before it takes its place: by chance in 3 of 1000. At two of
        /// them every twentieth level of a right twin would; at six a sensor twice as loud as declared goes unseen in 50 samples.
        level_off: f64 = 3.0,
        /// Least factor between the two: less changes no interval by more than a fifth, however sure it is.
        level_factor: f64 = 1.2,
        /// Draws of the noise levels for the tests: their spread is then known to an eighth.
        level_draws: u64 = 32,
        /// Ratio of free-run errors from which on the twin's own records are asked: few answers pay for them.
        larger_error: f64 = 1.2,
        /// Records of the twin itself that a free run's error is compared with: by chance, one in twenty lies beyond all.
        own_records: u64 = 19,
        /// Probability that the likelihood at the truth lies so far below its top.
        less_likely: f64 = 0.1,
        /// Share of a prior's information in an answer from which on the answer leans on it: the prior then moves the answer by this share of
        /// the truth's distance from its centre.
        leaning: f64 = 0.1,
    }
}
