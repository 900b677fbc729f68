//! Effort of a search.

/// Numbers of rows, sets and starts that a search spends its time on.
#[derive(Debug, Clone)]
pub(in crate::diagnose) struct Budget {
    /// Rows of all records together from which the first rows are searched first. On two cores, a gap in half as many takes a minute.
    pub long_rows: usize,
    /// Rows that are searched first. With twice as many it takes twice as long; what half as many show, four times as many are asked for.
    pub first_rows: usize,
    /// Factor by which more rows are searched where a gap is not clear.
    pub more_rows: usize,
    /// log of the odds from which a gap is clear: a rival that has a third of it stays in the race, and is 20 nats away.
    pub clear: f64,
    /// Share of the best effect's nats from which an explanation stands out: below, it is not the first of a pair, nor carried on.
    pub stands_out: f64,
    /// Share of the best effect's nats below which what a finer step explains does not change which effects stand out.
    pub minor: f64,
    /// Single effects beside which something is looked for.
    pub singles: usize,
    /// Pairs beside which something is looked for.
    pub pairs: usize,
    /// Second effects that are fitted beside one that leaves something, and beside one that leaves nothing.
    pub seconds: [usize; 2],
    /// Nats that a second effect must promise.
    pub least_second: f64,
    /// Explanations of a kind from whose θ fits begin again.
    pub starts: usize,
    /// Most functions that are fitted to all rows, alone and beside a set.
    pub functions_of_all_rows: usize,
    /// Explanations of a kind that are tried with a finer step before a search with it: a few passes each. With three, a spring whose gain the step's
    /// error hides stays behind three effects with a memory that imitate both.
    pub step_trials: usize,
    /// Most kinds of noise that are added to the twin's own.
    pub kinds_of_noise: usize,
}

impl Default for Budget {
    fn default() -> Self {
        Self {
            long_rows: 4096,
            first_rows: 1024,
            more_rows: 4,
            clear: 30.0,
            stands_out: 1.0 / 3.0,
            minor: 1.0 / 3.0,
            singles: 3,
            pairs: 2,
            seconds: [8, 4],
            least_second: 3.0,
            starts: 2,
            functions_of_all_rows: 2,
            step_trials: 6,
            kinds_of_noise: 2,
        }
    }
}
