//! Effort of a search.

numbers! {
    /// Numbers of rows, sets and starts that a search spends its time on.
    #[derive(Debug, Clone)]
    pub(in crate::diagnose) const BUDGET: Budget = {
        /// Rows of all records together from which the first rows are searched first. On two cores, a gap in half as many takes a minute.
        long_rows: usize = 4096,
        /// Rows that are searched first. With twice as many it takes twice as long; what half as many show, four times as many are asked for.
        first_rows: usize = 1024,
        /// Factor by which more rows are searched where a gap is not clear.
        more_rows: usize = 4,
        /// log of the odds from which a gap is clear: a rival that has a third of it stays in the race, and is 20 nats away.
        clear: f64 = 30.0,
        /// Share of the best effect's nats from which an explanation stands out: below, it is not the first of a pair, nor carried on.
        stands_out: f64 = 1.0 / 3.0,
        /// Share of the best effect's nats below which what a finer step explains does not change which effects stand out.
        minor: f64 = 1.0 / 3.0,
        /// Single effects beside which something is looked for.
        singles: usize = 3,
        /// Pairs beside which something is looked for.
        pairs: usize = 2,
        /// Second effects that are fitted beside one that leaves something, and beside one that leaves nothing.
        seconds: [usize; 2] = [8, 4],
        /// Nats that a second effect must promise.
        least_second: f64 = 3.0,
        /// Explanations of a kind from whose θ fits begin again.
        starts: usize = 2,
        /// Most functions that are fitted to all rows, alone and beside a set.
        functions_of_all_rows: usize = 2,
        /// Explanations of a kind that are tried with a finer step before a search with it: a few passes each. With three, a spring whose gain the step's
        /// error hides stays behind three effects with a memory that imitate both.
        step_trials: usize = 6,
        /// Most kinds of noise that are added to the twin's own.
        kinds_of_noise: usize = 2,
    }
}
