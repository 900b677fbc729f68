//! Thresholds of the checks of a record.

numbers! {
    /// Distances from what a twin expects at which a record is doubted, and how much of it is looked at.
    pub(super) const LIMITS: SuitabilityLimits = {
        /// Runs of the twin at draws of its prior, beside the one at the centre: one of them is near enough to any point of the prior for a
        /// comparison of sizes and shapes, and a slow simulator still answers within a minute or so.
        draws: u64 = 24,
        /// Samples that are looked at, at most: statistics of longer records say nothing new, and runs of the twin take time.
        looked_at: usize = 20_000,
        /// Levels within the range of a channel below which rounding shapes it: with 50, rounding adds 2 % of the range to each row, as much as
        /// the noise of a common sensor.
        few_levels: f64 = 50.0,
        /// Distance from the neighbours, in deviations of the noise, that noise does not reach: 36 right records of the reference twins and of
        /// two tanks have none, an outlier of 6 V in two tanks lies at 30.
        outlying: f64 = 7.0,
        /// Least deviation of the noise, as a share of the channel's own: curvature of a smooth signal.
        smooth: f64 = 0.02,
        /// Neighbours on each side: one outlier more than it may come in a row.
        side: usize = 2,
        /// Fewest values that outliers are looked for among.
        fewest: usize = 50,
        /// Rows that a message names.
        named: usize = 5,
        /// Times that an error must exceed that of a planned record before the record is blamed. Planned records of the tanks differ among
        /// themselves by up to 2.
        worse: f64 = 2.5,
        /// Share of the planned range that an input may leave it by: the accuracy of an actuator.
        margin: f64 = 0.05,
        /// Powers of ten that a unit may be off by: mega to micro, in one.
        powers: i32 = 6,
        /// Times that an output is larger or smaller than in any run of the twin before its unit is doubted. In 30 simulated records of two tanks
        /// outputs left the range of the runs by 1.12 at most.
        doubted: f64 = 2.5,
        /// The same where no power of ten explains it.
        unlike: f64 = 6.0,
        /// Times that the deviation of an output in the right unit may leave the range of the runs by.
        usual: f64 = 2.0,
        /// Correlation with another output's run that a swapped output has at least.
        alike: f64 = 0.5,
        /// Times that what is left unexplained, 1 − r, must be smaller for two outputs in the other order, as a geometric mean. In 30 simulated
        /// records of two tanks the right order was better by 3.5 to 27; at 4, swapped ones are missed.
        better: f64 = 2.0,
        /// Largest ratio of a step to the plan's, in the right unit: records are seldom sampled quite as planned, and units differ by 60 or more.
        near_plan: f64 = 3.0,
        /// The same for a twin without equations, where nothing but the plan tells its pace.
        as_planned: f64 = 1.2,
        /// Share within which steps are the same.
        same: f64 = 1e-3,
    }
}
