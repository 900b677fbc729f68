//! Tuning constants of a diagnosis, in one place.

/// Tuning constants of a diagnosis: unit and reason of each.
///
/// Numerical tolerances, iterations of a fit and sizes of a search stand beside their use.
pub(in crate::diagnose) struct Thresholds;

/// Hypotheses.
impl Thresholds {
    /// Delays in samples, a list for each register: the shorter the register, the faster the filter.
    pub const DELAYS: [&[f64]; 3] = [&[0.5, 1.5], &[3.0], &[5.5]];
    /// Samples that the registers of the delays hold.
    pub const REGISTERS: [usize; 3] = [3, 5, 8];
    /// Times of a step that are tried, evenly over the record.
    pub const TIMES: usize = 9;
    /// Nats for a mark that outputs bear, such as repeated values of a quantiser.
    pub const MARK_PRESENT: f64 = 12.0;
    /// Nats for an effect whose mark is absent; small, since other sensors have noise behind them.
    pub const MARK_ABSENT: f64 = -5.0;
}

/// Decision, in nats.
impl Thresholds {
    /// Prior share of listed effects among what could be missing; the rest belongs to unknown functions. At 0.4 or 0.8 evidence moves by 0.4.
    pub const LISTED: f64 = 0.6;
    /// Most that an unknown function may add on top of effects that explain everything.
    pub const ADEQUATE: f64 = 4.0;
    /// Distance to the best within which a single effect may still be the explanation.
    pub const CANDIDATES: f64 = 6.0;
    /// What a larger set of effects must be ahead of a smaller one, its price paid.
    pub const WORTH_ANOTHER: f64 = 2.0;
    /// Distance within which effects are rivals.
    pub const RIVALS: f64 = 3.0;
    /// Prior probability that something unknown is missing beside what a listed effect explains.
    pub const SECOND: f64 = 0.15;
    /// Largest share of the whole that may remain beside a partial explanation.
    pub const REST: f64 = 0.34;
    /// Evidence up to which few hypotheses are refitted: nothing seems to be missing.
    pub const NULL_LIKE: f64 = 4.0;
    /// Evidence from which fits begin with loud noise, too: where much is missing, the likelihood of quiet noise has narrow valleys.
    pub const DEEP: f64 = 30.0;
    /// Evidence from which functions are drawn over the states of the corrected twin, too.
    pub const WIDER: f64 = 5.0;
    /// Pairs that are kept.
    pub const PAIRS: usize = 6;
}
