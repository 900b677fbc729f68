//! Tuning constants of a diagnosis, in one place; the price of a second effect.

numbers! {
    /// Tuning constants of a diagnosis: unit and reason of each.
    ///
    /// Numerical tolerances, iterations of a fit and sizes of a search stand beside their use.
    pub(crate) const THRESHOLDS: Thresholds = {
        // Records and reports.
        /// Effects in the report: those below are of no weight.
        reported: usize = 12,
        /// Nats of likelihood within which a listed effect with θ inside the prior absorbs a parameter gap.
        absorbs: f64 = 2.0,
        /// Functions that are told.
        functions_told: usize = 3,
        /// Points at which a function is told.
        function_points: usize = 33,
        /// Share of draws of a function below which a term of its law is not told.
        rare_term: f64 = 0.1,
        /// Rows of an input's own past in the test for feedback. A smooth input that is not read far enough back leaves what outputs remember of it: with
        /// half, they told 25 of 60 sums of noisy sines, with a quarter 40, and none with all. Twice asks for longer records.
        feedback_own: usize = 32,
        /// Part of a record that the own past is at most: an eighth. Half asks less of short records, twice leaves few rows to them.
        feedback_part: usize = 8,
        /// Rows of outputs before: twice hardly shows more of a state that a few rows tell; half misses a controller's derivative.
        feedback_before: usize = 4,
        /// Level of both tests for feedback: chance takes one open loop in 10⁴ for a closed one, of inputs that also hold the noise by chance.
        feedback_level: f64 = 1e-4,
        /// Size over the median one from which a rest of an input is a jump: of normal rests one in 10⁶ is. Half cuts normal ones off, twice
        /// leaves small jumps.
        feedback_jump: f64 = 7.5,
        /// Share of an input below which its rest is rounding, not what a controller makes of noise. Half and twice: the same of all inputs here.
        feedback_rest: f64 = 1e-6,
        /// Rounds in which jumps are left out, the smaller ones once the larger are gone; a third round hardly finds any.
        feedback_rounds: usize = 2,
        // Maps of residuals: descriptions.
        /// Standard deviations above white noise of a cell that stands out.
        notable: f64 = 4.0,
        /// Samples below which a cut has no statistic.
        least_in_cut: f64 = 5.0,
        /// Lags of a whole output, in samples.
        lags: usize = 20,
        /// Windows of a record in the map of time.
        windows: usize = 8,
        /// Bins of a variable, with equal numbers of samples, in the map of values.
        bins: usize = 5,
        /// Ends of the bins of lags, in samples: octaves.
        lag_bins: [(usize, usize); 5] = [(1, 1), (2, 3), (4, 7), (8, 15), (16, 31)],
        /// Ends of the bands, in cycles a sample: octaves.
        bands: [f64; 7] = [0.0, 1.0 / 64.0, 1.0 / 32.0, 1.0 / 16.0, 0.125, 0.25, 0.5],
        // Extent.
        /// Largest floor of a free run that has a share, over the variance of y: beyond, noise alone drives a right twin away.
        follows: f64 = 0.5,
        /// Level of all intervals.
        interval_level: f64 = 0.9,
        /// Horizons of predictions in samples, up to a tenth of the record.
        horizons: [usize; 6] = [1, 3, 10, 30, 100, 300],
        /// Standard deviations of the floor that the twin's error on simulated records lies above it, for a share to be measured: 1/CLEAR is the
        /// standard deviation of a true system's share.
        clear: f64 = 3.0,
        /// Widest interval of a share beside which one number is told. Of 150 shares of true effects 85 % lie in −0.1 to 1.1; of 92 with an
        /// interval narrower than 0.25 98 %, of 113 at 0.5 96 %, of 130 at 1 94 %.
        widest: f64 = 0.5,
        /// Effects drawn at random, fitted alike, as a control.
        random_effects: usize = 5,
        /// Records simulated for the floor.
        floor_records: u64 = 32,
        /// Records simulated for the interval of a share: its ends are the fifth of each side.
        share_records: u64 = 100,
        /// Nats that a term must gain in likelihood to be seen: its share of the prior and what its size is averaged over.
        seen: f64 = 7.0,
        /// Normal quantile of 80 %: the power that a visible magnitude has.
        power_quantile: f64 = 0.8416,
        /// Rivals that a next input is to tell apart.
        most_rivals: usize = 3,
        /// Simulations of each proposal.
        proofs: u64 = 20,
        /// Lengths of proposals, in multiples of the record.
        lengths: [usize; 2] = [1, 3],
        /// Parts of a record for which a level is held.
        holds: [usize; 4] = [80, 27, 10, 4],
        /// Levels of a staircase.
        stairs: usize = 8,
        // Predictive check.
        /// Level of the check: a right twin is refused in one of a hundred records. At twice, false alarms take half of what the whole
        /// diagnosis is allowed.
        check_level: f64 = 0.01,
        /// Records simulated at first: enough for means and deviations.
        check_first: usize = 24,
        /// Records simulated in all, where few of the first are as far off as the measured ones: the fewest whose smallest p is below the level.
        check_records: usize = 120,
        /// Share of the output's variance from which noise that was not declared is called a gap: a twin that leaves a quarter to it predicts
        /// badly. At half of it, records with coloured noise of the declared variance are called; at twice, a pump that stops at random is not.
        swallowed: f64 = 0.25,
        /// Standard deviations of its declaration from which a noise level is beyond it.
        beyond_declared: f64 = 3.0,
        /// Simulated records as far off at which the check has passed.
        check_enough: f64 = 3.5,
        // Decision, in nats.
        /// log of the odds that something is missing from which a gap is told: 20 to 1, since prior odds are even and a false alarm in
        /// twenty is the most. At 2, three of 21 open trials without a gap are called instead of two, and three of 22 gaps more, all below 7
        /// nats; at 4, two more are lost.
        gap: f64 = 3.0,
        /// Nats by which a finer step must move the innovations, θ free to answer, to be fitted at all: less is hardly 2 nats of evidence.
        step_shows: f64 = 1.0,
        /// Evidence from which a finer step becomes that of the twin: 7 to 1, as the user is then asked to change the study.
        step_wins: f64 = 2.0,
        /// Evidence from which noise of another kind becomes the noise of the twin: 20 to 1.
        noise: f64 = 3.0,
        /// Prior share of listed effects among what could be missing; the rest belongs to unknown functions. At 0.4 or 0.8 evidence moves by 0.4.
        listed: f64 = 0.6,
        /// Most that an unknown function may add on top of effects that explain everything.
        adequate: f64 = 4.0,
        /// Share of the whole evidence that may be left as well, and that a second effect has to add beside its prior: integrators and
        /// discretisation differ by as much. On 12 open pairs that add more than 10 nats each, 10 are named; with a share of 0.1 for a second
        /// effect 5, with none 10.
        fine_print: f64 = 0.02,
        /// Most of the twin's free-run error that may be left with an effect of a black box's signals.
        nearer: f64 = 0.95,
        /// Least probability of a name, or of rivals together.
        said: f64 = 0.5,
        /// Distance within which effects are rivals.
        rivals: f64 = 3.0,
        /// Prior probability that something else is missing beside a listed effect, shared among listed effects and unknown functions as what
        /// is missing alone is. At half or twice, pairs cost 0.7 nats more or less.
        second: f64 = 0.15,
        /// Largest share of the whole that may remain beside a partial explanation.
        rest: f64 = 0.34,
        /// Share of its evidence by which an unknown function alone may be better than a partial explanation that others imitate. At half, the
        /// lag of a real heater is not named; without it, three of 24 closed records of a law outside the library get a name more.
        outdone: f64 = 0.15,
        /// Evidence from which functions are drawn over the states of the corrected twin, too.
        wider: f64 = 5.0,
        /// Most effects that a greedy search selects.
        selected: usize = 3,
        /// Pairs that are kept.
        pairs: usize = 6,
    }
}

/// Nats that each effect beside the first one costs.
#[derive(Clone, Copy)]
pub(in crate::diagnose) struct Price {
    /// −log of the prior probability that a pair is what is missing, over that of one effect.
    pub prior: f64,
    /// A share of what the first law explains: integrators and discretisation differ by as much.
    pub fine_print: f64,
}

impl Price {
    /// The price among so many listed effects, of which the best alone explains `top` nats.
    pub fn new(listed: usize, top: f64) -> Self {
        let pairs = 0.5 * (listed as f64 - 1.0);
        let second = THRESHOLDS.second * THRESHOLDS.listed / pairs.max(1.0);
        Self {
            prior: -second.ln(),
            fine_print: THRESHOLDS.fine_print * top.max(0.0),
        }
    }

    /// The price of so many effects together.
    pub fn of(self, count: usize) -> f64 {
        (self.fine_print + self.prior) * (count - 1) as f64
    }
}
