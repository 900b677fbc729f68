//! Tuning constants of a diagnosis, in one place.

/// Tuning constants of a diagnosis: unit and reason of each.
///
/// Numerical tolerances, iterations of a fit and sizes of a search stand beside their use.
pub(in crate::diagnose) struct Thresholds;

/// Records.
impl Thresholds {
    /// Samples of the shortest record: the statistics take lags up to 20.
    pub const LEAST_SAMPLES: usize = 50;
    /// Explanations in the report: those below are of no weight.
    pub const REPORTED: usize = 12;
}

/// Structural test.
impl Thresholds {
    /// Least standard deviation of a statistic over the simulations: one that never moves cannot raise an alarm by a hair.
    pub const LEAST_SPREAD: f64 = 0.1;
    /// Simulations at a time.
    pub const BATCH: usize = 20;
    /// Simulations as extreme as the record that end the test: p is then at least 8 in the number asked for. Besag & Clifford,
    /// "Sequential Monte Carlo p-values", *Biometrika* 78 (1991).
    pub const ENOUGH_EXTREME: usize = 8;
    /// Standard deviations above all simulations that end the test once p has reached the level.
    pub const OVERWHELMING: f64 = 12.0;
    /// Lags in samples: of innovations, their squares and inputs.
    pub const LAGS: usize = 20;
    /// Lags over which squared correlations are added up: one, a few, all.
    pub const LAG_SUMS: [usize; 3] = [1, 5, Self::LAGS];
    /// Windows of a record in the omnibus test.
    pub const OMNIBUS_WINDOWS: usize = 10;
    /// Frequencies of the periodogram, over the length of the record.
    pub const OMNIBUS_FREQUENCIES: usize = 60;
    /// Largest p-value, over all cells of all maps together, of a cell that stands out.
    pub const NOTABLE: f64 = 0.1;
    /// Samples below which a cut has no statistic.
    pub const LEAST_IN_CUT: f64 = 5.0;
    /// Windows of a record in the map of time.
    pub const WINDOWS: usize = 8;
    /// Bins of a variable, with equal numbers of samples, in the map of values.
    pub const BINS: usize = 5;
    /// Ends of the bins of lags, in samples: octaves.
    pub const LAG_BINS: [(usize, usize); 5] = [(1, 1), (2, 3), (4, 7), (8, 15), (16, 31)];
    /// Ends of the bands, in cycles a sample: octaves.
    pub const BANDS: [f64; 7] = [0.0, 1.0 / 64.0, 1.0 / 32.0, 1.0 / 16.0, 0.125, 0.25, 0.5];
}

/// Hypotheses.
impl Thresholds {
    /// Memories a of the disturbances, per sample: a random walk, 20 and 5 samples.
    pub const MEMORIES: [f64; 3] = [1.0, 0.95, 0.8];
    /// Delays in samples, a list for each register: the shorter the register, the faster the filter.
    pub const DELAYS: [&[f64]; 3] = [&[0.5, 1.5], &[3.0], &[5.5]];
    /// Samples that the registers of the delays hold.
    pub const REGISTERS: [usize; 3] = [3, 5, 8];
    /// Frequencies of a periodic effect; the second number where it is enough to see that something is left.
    pub const FREQUENCIES: [usize; 2] = [8, 4];
    /// Times of a step; the second number as above.
    pub const TIMES: [usize; 2] = [8, 4];
    /// Levels of a threshold; the second number as above.
    pub const LEVELS: [usize; 2] = [4, 2];
    /// Nats for a mark that outputs bear, such as repeated values of a quantiser.
    pub const MARK_PRESENT: f64 = 12.0;
    /// Nats for an effect whose mark is absent; small, since other sensors have noise behind them.
    pub const MARK_ABSENT: f64 = -5.0;
    /// d·d of a magnitude that could just be seen: about three standard deviations.
    pub const VISIBLE: f64 = 10.0;
    /// d·d beyond which a secant is shortened: 20 standard deviations, where it is no derivative any more.
    pub const COARSE: f64 = 400.0;
    /// Largest magnitude, in multiples of the just visible one: gaps of long records are thousands of standard deviations.
    pub const REACH: f64 = 1e4;
}

/// Explanations.
impl Thresholds {
    /// Nats within which explanations are rivals: of 78 clear effects in sealed trials, 76 were in the class then, of 1.6 members.
    pub const RIVALS: f64 = 3.0;
    /// Nats that a factor e in probability takes: fitted to answers of sealed trials (docs/withheld.md).
    pub const TEMPERATURE: f64 = 1.5;
    /// Probability that an unlisted law imitates all listed ones: fitted like the temperature.
    pub const IMITATED: f64 = 0.05;
    /// Numbers that a disturbance counts for: strength and memory.
    pub const DISTURBANCE_NUMBERS: f64 = 2.0;
    /// Points of the dictionary that a fit starts from, per candidate.
    pub const STARTS: usize = 2;
    /// The same for a threshold, whose likelihood has more tops.
    pub const THRESHOLD_STARTS: usize = 4;
    /// Explanations that are fitted once more, from the θ of the best.
    pub const SECOND_ROUND: usize = 10;
    /// Best explanations whose θ these fits start from.
    pub const SECOND_STARTS: usize = 2;
    /// Draws of θ from the prior that they start from as well: where much is missing, the best θ may be anywhere.
    pub const SECOND_DRAWS: u64 = 3;
    /// Explanations of a black box that are fitted once more: every likelihood costs an ensemble.
    pub const SECOND_ROUND_SIMULATED: usize = 5;
    /// Draws of θ for these.
    pub const SECOND_DRAWS_SIMULATED: u64 = 1;
    /// Nats within which a listed effect with θ inside the prior absorbs a parameter gap.
    pub const ABSORBS: f64 = 2.0;
    /// p-value of the structural test, the effect added, up to which something is left unexplained.
    pub const UNEXPLAINED: f64 = 0.02;
    /// Nats that another effect must add beyond its price.
    pub const WORTH_ANOTHER: f64 = 3.0;
    /// The same beside an effect that leaves nothing unexplained.
    pub const WORTH_BESIDE_SUFFICIENT: f64 = 8.0;
    /// The same for a third effect: three numbers more imitate nearly anything a little.
    pub const WORTH_A_THIRD: f64 = 20.0;
    /// Nats that several effects must be ahead of a disturbance: of so many pairs some imitate anything a little better.
    pub const SEVERAL_OVER_DISTURBANCE: f64 = 10.0;
    /// Nats beyond its price that the scan must promise for an effect beside others that leave nothing unexplained.
    pub const PROMISE: f64 = 5.0;
    /// Least share of the free-run error that effects must take off where something is left unexplained.
    pub const GOOD_PART: f64 = 0.1;
    /// Most effects together.
    pub const MOST_EFFECTS: usize = 3;
    /// First effects that pairs are made of.
    pub const FIRSTS: usize = 2;
    /// Second effects for each of them.
    pub const SECONDS: usize = 12;
    /// Exchanges of a partner of the best pair.
    pub const EXCHANGES: usize = 3;
    /// Frequencies scanned per 1/duration: two, so that none falls between.
    pub const FREQUENCIES_PER_CYCLE: f64 = 2.0;
    /// Most frequencies of a scan: a bound on its time.
    pub const MOST_FREQUENCIES: usize = 100;
    /// Best frequencies that become starts.
    pub const PEAKS: usize = 3;
    /// Highest frequency, in cycles a sample.
    pub const HIGHEST_FREQUENCY: f64 = 0.2;
}

/// Location.
impl Thresholds {
    /// Pieces of a record that the spread of a mean is taken from.
    pub const TERM_BLOCKS: usize = 20;
    /// Blocks of a record among which the onset is looked for.
    pub const ONSET_BLOCKS: usize = 12;
    /// Blocks before the first one that is predicted.
    pub const ONSET_LEARNT: usize = 2;
    /// Least samples of a block.
    pub const ONSET_SAMPLES: usize = 10;
    /// Simulations beyond those that a p-value at the level takes.
    pub const ONSET_BEYOND: f64 = 5.0;
    /// Resampled records of the regression.
    pub const DISCOVERY_RESAMPLES: u64 = 200;
    /// Most terms of the regression together.
    pub const MOST_TERMS: usize = 4;
    /// Most blocks of all records that are resampled.
    pub const DISCOVERY_BLOCKS: usize = 40;
    /// Share of resampled records below which a term is not reported.
    pub const RARE: f64 = 0.1;
    /// Correlation below which the sum of a correlation time ends.
    pub const UNCORRELATED: f64 = 0.05;
}

/// Extent.
impl Thresholds {
    /// Level of all intervals.
    pub const INTERVAL_LEVEL: f64 = 0.9;
    /// Records simulated for the floor.
    pub const FLOOR_RECORDS: u64 = 32;
    /// Resamples of the free-run error.
    pub const SHARE_RESAMPLES: u64 = 400;
    /// Blocks of a record that are resampled.
    pub const SHARE_BLOCKS: usize = 20;
    /// Normal quantile of 80 %: the power that a visible magnitude has.
    pub const POWER_QUANTILE: f64 = 0.8416;
    /// Largest multiple of a point of the dictionary among the visible magnitudes.
    pub const VISIBLE_REACH: f64 = 64.0;
    /// Rivals that a next input is to tell apart.
    pub const MOST_RIVALS: usize = 3;
    /// Simulations of each proposal.
    pub const PROOFS: u64 = 20;
    /// Lengths of proposals, in multiples of the record.
    pub const LENGTHS: [usize; 2] = [1, 3];
    /// Parts of a record for which a level is held.
    pub const HOLDS: [usize; 4] = [80, 27, 10, 4];
    /// Levels of a staircase.
    pub const STAIRS: usize = 8;
}
